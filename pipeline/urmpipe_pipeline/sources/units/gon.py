"""Angles in `grad`, which is degrees in German and gon (0.9 deg) elsewhere: taken as degrees, and said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.units.unit_evidence import FULL_TURN_DEG, FULL_TURN_GON, steps_of
from urmpipe_pipeline.sources.units.unit_hints import unit_hints
from urmpipe_pipeline.sources.vocabulary import Unit, vocabulary


@dataclass(slots=True)
class GonDoubt:
    """The columns of one log that were taken as degrees and may be in gon.

    Attributes:
        given: Units given by the user, by the column's number; by 0 that of all joints that turn.
        file: The file, for errors.
    """

    given: Mapping[int, Unit]
    file: str
    _columns: list[Column] = field(default_factory=list)

    @property
    def warnings(self) -> list[LogWarning]:
        """One of all columns, if there are any."""
        if not self._columns:
            return []
        names = ", ".join(column.name for column in self._columns)
        said = f"{names}: {self._columns[0].unit_text} is taken as deg, as in German; elsewhere it is gon"
        hints = unit_hints(self._columns, "deg", "confirms it; multiply values in gon by 0.9")
        return [LogWarning("gon-or-deg", f"{said}, 0.9 deg", hints=hints)]

    def note(self, columns: Sequence[Column]) -> None:
        """Note those of some columns whose names alone tell a unit that is deg or gon."""
        self._columns += self._unclear(columns)

    def note_unless_wrapped(self, columns: Sequence[Column], values: FloatArray) -> None:
        """Note those of the joint columns, unless their wraps tell degrees.

        Args:
            columns: The joint columns.
            values: Their values in the file's own units, shape (n, joints).

        Raises:
            LogError: If they wrap by a full turn in gon.
        """
        unclear = self._unclear(columns)
        own = values[:, [column in unclear for column in columns]]
        if not unclear or steps_of(FULL_TURN_DEG, own):
            return
        if turned := steps_of(FULL_TURN_GON, own):
            said = f"found {', '.join(one.name for one in unclear)} in {unclear[0].unit_text} and {turned}"
            hint = "a full turn in gon, allowed: rad, deg; multiply the values by 0.9, which are deg then"
            raise LogError(Finding(f"{said}, {hint}", self.file))
        self._columns += unclear

    def _unclear(self, columns: Sequence[Column]) -> list[Column]:
        """Return the columns whose names alone tell a unit that is deg or gon."""
        named = [one for one in columns if one.unit_text and not {0, one.number} & set(self.given)]
        return [one for one in named if vocabulary().gon.doubted(one.unit_text or "", one.key)]
