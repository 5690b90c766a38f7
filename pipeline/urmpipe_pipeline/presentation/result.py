"""What every kind of result has, so that it can be recorded, shown and handed on."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from urmpipe_models.display import Displayable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Result(Displayable):
    """A result: a frozen dataclass, whose fields are all that a recording keeps of it.

    Attributes:
        name: What people call it.
        recording: Where it was written; not kept.
    """

    __slots__ = ()

    name: str
    recording: Path | None

    draw: ClassVar[Callable[[Any, str | None, str | float, float], Any]]
    """Returns a figure of a result by its title, a width and a font; set by who renders presentations."""

    @abstractmethod
    def to_frame(self) -> pd.DataFrame:
        """Return its numbers as a table."""

    def plot(self, title: str | None = None, *, width: str | float = "page", font: float = 8.0) -> Figure:
        """Return a figure as matplotlib draws it; a notebook shows it, and `savefig` writes it.

        It needs the extra `figures`. pyplot and its settings are left alone.

        Args:
            title: The figure's title in the report or a pattern such as "Deviation*", with the heading of its
                part before it where several have it: "log-2/Deviation over time". By default the main one.
            width: column (88 mm), page (180 mm), a text such as "85mm" or "3.5in", or a number in [m].
            font: Size of the text in [pt].

        Raises:
            OptionError: If there is no such figure, with those that there are; if a size is out of range.
            OutputError: If matplotlib is missing.
        """
        figure: Figure = Result.draw(self, title, width, font)
        return figure

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the object that `--json` prints, its messages in somebody's words."""
