"""The result of a test after ISO 9283: cycles, criteria, and what is drawn of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.corners import CornerPath, LegSpeed
from urmpipe_pipeline.iso9283.criteria import Criterion, Verdict, combine_verdicts


@dataclass(frozen=True, slots=True)
class Cycle:
    """A cycle of a test.

    Attributes:
        name: Its name.
        row: Its first row in its log, from 1.
        last_row: Its last row in its log, from 1.
        sync_offset: t_reference - t_cycle in [s]; None for static poses.
    """

    name: str
    row: int
    last_row: int
    sync_offset: float | None


@dataclass(frozen=True, slots=True)
class FailedCycle:
    """A whole cycle that does not follow the command; the criteria do not include it.

    Attributes:
        name: Its name.
        row: Its first row in its log, from 1.
        last_row: Its last row in its log, from 1.
        distance: Its largest distance from the command's path in [m]; None if it has no position.
        reason: What it does instead; a clause that follows its name.
    """

    name: str
    row: int
    last_row: int
    distance: float | None
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class AttainedPoses:
    """The poses of a test, and where each cycle attained them.

    Attributes:
        command: In [m], shape (k, 3).
        attained: In [m], shape (n, k, 3): cycles, poses, coordinates.
        command_quat: Commanded orientations x, y, z, w [-], shape (k, 4); None without them.
        attained_quat: Attained ones [-], shape (n, k, 4); None without them.
    """

    command: FloatArray
    attained: FloatArray
    command_quat: FloatArray | None = None
    attained_quat: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class CutPath:
    """The command path cut by planes, and where the cycles cross them.

    Attributes:
        s: Arc length of each plane along the command in [m], shape (m,).
        command: Where the command crosses it in [m], shape (m, 3).
        normal: Direction of the command there [-], shape (m, 3).
        crossed: Where the cycles cross it in [m], shape (n, m, 3).
        accuracy: AT of each plane in [m], shape (m,).
        repeatability: RT of each plane in [m], shape (m,); None for one cycle.
        path: The command in [m], shape (c, 3).
        speed_s: Arc lengths at which speeds are drawn in [m], shape (q,).
        speed: Speed of each cycle there in [m/s], shape (n, q).
        commanded_speed: Speed of the command there in [m/s], shape (q,).
        legs: Straight legs with a constant commanded speed.
        corners: Corners of the command.
        total: Length of the command in [m].
    """

    s: FloatArray
    command: FloatArray
    normal: FloatArray
    crossed: FloatArray
    accuracy: FloatArray
    repeatability: FloatArray | None
    path: FloatArray
    speed_s: FloatArray
    speed: FloatArray
    commanded_speed: FloatArray
    legs: tuple[LegSpeed, ...]
    corners: tuple[CornerPath, ...]
    total: float

    @property
    def mean(self) -> FloatArray:
        """The mean path: barycentres at the planes in [m], shape (m, 3)."""
        return np.asarray(self.crossed.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class IsoTest:
    """Accuracy and repeatability of a motion that was repeated, after ISO 9283.

    Attributes:
        cycles: The cycles that follow the command: those of the criteria.
        criteria: Every criterion, over all and at each place, in the order of `criteria.UNITS`.
        poses: The poses; None if the command has no rest.
        path: The path; None for static poses, and if nothing moves.
        band: Half of the width of the band in which poses are stabilised, in [m].
        reference_rows: The rows of the reference, from 1, that are the command of each cycle, if the
            reference repeats it; None: all.
        failed_cycles: The whole cycles that do not follow the command: with a tolerance, the test fails.
    """

    cycles: tuple[Cycle, ...]
    criteria: tuple[Criterion, ...]
    poses: AttainedPoses | None
    path: CutPath | None
    band: float
    reference_rows: tuple[int, int] | None = None
    failed_cycles: tuple[FailedCycle, ...] = ()

    @property
    def cycle_count(self) -> str:
        """Number of cycles that follow the command, and of all if some do not: "9 of 10 cycles"."""
        count = format_count(len(self.cycles) + len(self.failed_cycles), "cycle")
        return f"{len(self.cycles)} of {count}" if self.failed_cycles else count

    @property
    def overall(self) -> tuple[Criterion, ...]:
        """Each criterion over all poses, planes, corners or legs."""
        return tuple(criterion for criterion in self.criteria if criterion.at is None)

    def worst_of(self, name: str) -> Criterion:
        """Return a criterion at the place where it is largest."""
        places = [
            criterion for criterion in self.criteria if criterion.name == name and criterion.at is not None
        ]
        return max(places, key=lambda criterion: abs(criterion.value or 0.0))

    def at(self, place: str, name: str) -> Criterion | None:
        """Return a criterion at a pose, plane, corner or leg, such as "pose 1"; None if it has none."""
        both = (place, name)
        return next(
            (criterion for criterion in self.criteria if (criterion.at, criterion.name) == both), None
        )

    @property
    def verdict(self) -> Verdict:
        """Fail if a criterion is out of its tolerance or a cycle failed; None if none has a tolerance.

        None, too, if nothing failed and a criterion with a tolerance needs more cycles.
        """
        if self.failed_cycles and any(criterion.tolerance is not None for criterion in self.overall):
            return "fail"
        verdict = combine_verdicts(criterion.verdict for criterion in self.overall)
        return None if verdict == "pass" and self.not_judged else verdict

    @property
    def not_judged(self) -> tuple[Criterion, ...]:
        """The criteria with a tolerance that need more cycles than there are."""
        return tuple(c for c in self.overall if c.tolerance is not None and c.value is None)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield one row per criterion and place with the keys of the JSON, then one per failed cycle."""
        yield from (asdict(criterion) for criterion in self.criteria)
        verdict = self.verdict and "fail"
        for cycle in self.failed_cycles:
            rows = f"rows {cycle.row} to {cycle.last_row}"
            yield asdict(Criterion(cycle.name, rows, cycle.distance, "m", 1, verdict=verdict))

    def to_dict(self) -> dict[str, Any]:
        """Return the object `iso` of `urmpipe iso --json`."""
        return {
            "cycles": [asdict(cycle) for cycle in self.cycles],
            "failed_cycles": [asdict(cycle) for cycle in self.failed_cycles],
            "poses": 0 if self.poses is None else len(self.poses.command),
            "reference_rows": None if self.reference_rows is None else list(self.reference_rows),
            "criteria": [asdict(criterion) for criterion in self.criteria],
        }
