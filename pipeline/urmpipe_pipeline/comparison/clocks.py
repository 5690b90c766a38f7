"""What two logs themselves say about the offset between their clocks.

1. `stamp_offset`: Unix times or dates on both sides give it, exactly, where they overlap.
2. `clocks_differ`: a log that follows the path and is far off at each time shows that an offset is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.errors import Hint, LogError
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.alignment import align
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.sync import BY_HAND, BY_MOTION, synchronise
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources.cells.text_clock import DATE
from urmpipe_pipeline.sources.checks import REBUILT, SPREAD
from urmpipe_pipeline.sources.clocks.halves import EPOCH
from urmpipe_pipeline.sources.clocks.text_times import ZONED
from urmpipe_pipeline.trajectories import Trajectory, match

CLOCKS_DIFFER = "clocks-differ"

FAR = 3.0
"""Ratio of the rms at the same time and from the path. A late log is on the path, except for noise and what
lies beyond its ends: with 30 % of the time beyond, the ratio is 3. A displaced log has about 1 on a curve."""

SURE = 50.0
"""Ratio from which the clocks differ though the motion determines no offset: no displacement explains it."""

BETTER = 0.5
"""An offset is the cause if it leaves less than this share of the rms."""

UTC, LOCAL = "in UTC", "without a time zone"


def stamp_offset(reference: Run, log: Run) -> float | str:
    """Return t_reference - t_log in [s], from their first rows, by absolute stamps; or why there is none.

    Stamps are Unix times and dates, of 2000 to 2100. Dates without a time zone are comparable with each other
    alone. Sets of columns of one file share its clock, whatever it counts from.
    """
    offset_ns = log.log.clock_start_ns - reference.log.clock_start_ns
    if reference.log.files and reference.log.files == log.log.files:
        return offset_ns / 1e9
    zones = [(run.name, _zone(run.log)) for run in (reference, log)]
    if unknown := [name for name, zone in zones if zone is None]:
        return f"neither Unix times nor dates in {text.enumerated(unknown)}"
    if zones[0][1] != zones[1][1]:
        return " and ".join(f"times {zone} in {name}" for name, zone in zones)
    for run in (reference, log):
        if any(warning.kind in (REBUILT, SPREAD) for warning in run.log.warnings):
            return f"times that several rows share in {run.name}"
    t_ns = log.log.t_ns + offset_ns
    inside = np.count_nonzero((t_ns >= 0) & (t_ns <= reference.log.t_ns[-1]))
    if inside < min(
        2, log.log.rows, reference.log.rows
    ):  # the last stamp of a file may be the first of the next
        return f"no time in both: {log.name} begins {offset_ns / 1e9:.6g} s after {reference.name}"
    return offset_ns / 1e9


def _zone(log: JointLog) -> str | None:
    """Return in which time zone the stamps of a log count; None if its clock has no fixed start."""
    if any(column.role == "time" and column.unit == DATE for column in log.columns):
        return UTC if any(inference.kind == ZONED for inference in log.inferences) else LOCAL
    return UTC if log.timed and EPOCH[0] <= log.clock_start <= EPOCH[1] else None


def late(log: Deviation) -> bool:
    """Return whether a log fails though it follows the path: it is far from it in time alone."""
    failed = any(value.verdict == "fail" and value.kind != "path" for value in log.all_statistics)
    if not (failed and log.statistics and log.run.timed) or log.diagnosis is not None:
        return False
    return log.sync.mode != "auto" and log.statistics["norm"].rms > FAR * log.statistics["path"].rms


def clocks_differ(reference: Trajectory, log: Trajectory, deviation: Deviation) -> Iterator[LogWarning]:
    """Yield a warning about a late log: the offset by its motion, or that the motion determines none.

    A log whose motion is in time has another cause, and no warning.
    """
    norm, path = deviation.statistics["norm"].rms, deviation.statistics["path"].rms
    message = f"the clocks differ: {text.quantity(norm, 'm')} rms at the same time"
    message += f", but {text.quantity(path, 'm')} rms from the path"
    mode = deviation.alignment.mode
    try:
        sync = synchronise(reference, log, "auto", mode)
    except LogError:
        if norm > SURE * path:
            message += "; the motion determines no offset: is one side slower?"
            yield LogWarning(CLOCKS_DIFFER, message, about=deviation.name, hints=BY_HAND[1:])
        return
    matched = match(reference, log, sync)
    if not len(matched.sample) or abs(sync.offset - deviation.sync.offset) < deviation.run.log.period:
        return
    aligned = align(matched, mode, deviation.run)
    remainder = float(np.sqrt(np.mean(np.sum((aligned.reference - aligned.actual) ** 2, axis=1))))
    if remainder < BETTER * norm:
        message += f"; an offset of {sync.offset:.6g} s leaves {text.quantity(remainder, 'm')} rms"
        hints = (BY_MOTION, Hint("sync", float(f"{sync.offset:.6g}"), "sets it"))
        yield LogWarning(CLOCKS_DIFFER, message, about=deviation.name, hints=hints)
