"""What every kind of result has, so that it can be recorded, shown and handed on."""

from __future__ import annotations

from abc import abstractmethod
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
        # By names, as in the registry of kinds: it and the figures import this module.
        registry = import_module("urmpipe_pipeline.results")
        presentation = registry.present(registry.enclosing_result(self))
        figure: Figure = import_module("urmpipe_pipeline.figures.plot").plot(presentation, title, width, font)
        return figure

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the object that `--json` prints."""

    def _repr_html_(self) -> str:
        presentation = import_module("urmpipe_pipeline.results").present(self)
        page: str = import_module("urmpipe_pipeline.presentation.notebook").notebook_page(
            type(self).__name__, presentation
        )
        return page
