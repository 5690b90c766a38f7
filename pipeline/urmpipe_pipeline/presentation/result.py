"""What every kind of result has, so that it can be recorded, shown and handed on."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe_models.display import Shown
from urmpipe_models.spelling import Voice

if TYPE_CHECKING:
    import pandas as pd


class Result(Shown):
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

    @abstractmethod
    def to_dict(self, voice: Voice = "python") -> dict[str, Any]:
        """Return the object that `--json` prints, its messages in somebody's words."""
