"""Targets from a file: where the tool shall be, a row a pose or a position; with times, a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.ik.solutions import Targets
from urmpipe_pipeline.joint_log import Inference, LogWarning, SourceFile
from urmpipe_pipeline.logs.clock import even_clock, unused_period
from urmpipe_pipeline.logs.columns import listed
from urmpipe_pipeline.logs.formats.text import fingerprint
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.targets import NAMED, PoseTable, read_pose_table

FEWEST = 3
"""An orientation has at least so many columns."""


@dataclass(frozen=True, slots=True, eq=False)
class TargetFile:
    """The targets of a file, a row each.

    Attributes:
        file: The file.
        row: Its data rows, from 1, shape (n,).
        t_ns: Time of each row in integer [ns] from the first, shape (n,), rising: the targets are a path.
            None without times: each target stands for itself. A faulty row whose own time is
            not known has one between its neighbours'.
        position: In [m], shape (n, 3); NaN in a row with a fault.
        rotation: Matrices [-], shape (n, 3, 3), NaN in a row with a fault; None if the file has positions
            only.
        faults: What is wrong with a row, one line, by the data row.
        clock_start_ns: The file's own clock at the first row in integer [ns].
        inferences: What was found out about the file.
        warnings: What a person should know about it.
    """

    file: SourceFile
    row: IntArray
    t_ns: IntArray | None
    position: FloatArray
    rotation: FloatArray | None
    faults: Mapping[int, str]
    clock_start_ns: int = 0
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()

    def __len__(self) -> int:
        return len(self.row)

    @property
    def targets(self) -> Targets:
        """The poses for inverse kinematics, faulty rows as NaN."""
        return Targets(self.position, self.rotation)


def read_targets(file: Path, options: LogMap | None = None, tsp: float | None = None) -> TargetFile:
    """Return the targets of a file: x, y, z and, where it has one, the orientation.

    Lengths are in m and angles in rad unless the header or the options give a unit; rz, ry, rx mean
    R = Rz Ry Rx. A file with a time is a path, and so is one without if the time between its rows is
    given: t = i Tsp.

    Args:
        file: A text table, as a log may be.
        options: How to read the file where it does not show it; those about joints are not used. Its period
            is the same as `tsp`.
        tsp: Time between the rows in [s], of a file without one.

    Raises:
        LogError: If the file as a whole is wrong: no x, y, z, an unknown unit, no row, a clock that repeats
            or runs backwards.
        OptionError: If an option's value makes no sense.

    Source: [UrmArm2021]_ eq. 22 (t = i Tsp).
    """
    asked = options or LogMap()
    table = read_pose_table(Path(file), asked)
    t_ns, start, said, noticed = _times(table, tsp, asked.period)
    return TargetFile(
        file=fingerprint(Path(file)),
        row=np.arange(1, len(table) + 1),
        t_ns=t_ns,
        position=table.position,
        rotation=table.rotation,
        faults={row: "; ".join(map(str, faults)) for row, faults in table.faults.items()},
        clock_start_ns=start,
        inferences=(*table.inferences, *said),
        warnings=(*table.warnings, *_not_used(table, asked), *noticed),
    )


def _not_used(table: PoseTable, asked: LogMap) -> list[LogWarning]:
    """Warn if enough columns are left for an orientation, unless the user or urmpipe says what they are."""
    known = table.plan.tables.known
    told = asked.position or (known is not None and known.own)
    if table.rotation is not None or told or len(table.unused_numbers) < FEWEST:
        return []
    targets = f"{listed(table.plan.roles.position)} are targets without an orientation"
    said = f"{targets}: {listed(table.unused_numbers, most=8)} are not used"
    return [LogWarning("columns-not-used", said, hints=(NAMED,))]


def _times(
    table: PoseTable, tsp: float | None, period: float | None
) -> tuple[IntArray | None, int, tuple[Inference, ...], list[LogWarning]]:
    """Return the rows' times in [ns] from the first, the clock there in [ns], and what there is to say."""
    step, keyword = (period, "period") if tsp is None else (tsp, "tsp")
    if table.clock is None and step is None:
        return None, 0, (), []
    if table.clock is None:
        times, said, noticed = even_clock(len(table), step, keyword)
        return times, 0, said, noticed
    start = int(table.clock[0])
    unused = [] if step is None else [unused_period(keyword)]
    return table.clock - start, start, (), unused
