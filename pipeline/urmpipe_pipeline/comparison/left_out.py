"""What was not compared, in words: samples without a value, and samples beyond the other side."""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import WHOLE, Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.grid import ROUNDING_NS

BEYOND = "sync-left-out"
"""Kind of the warning that says what an offset between the clocks leaves out: no doubt about the log."""


def left_out_warnings(one: Deviation, reference: Trajectory) -> list[LogWarning]:
    """Return what was not compared of a log and of the reference.

    Samples that an offset moves beyond the reference's time are what `sync` asks for; they are told apart
    from those that lack a value, lie in a gap, or come after a reference that started together with the log.
    A part of the reference that was not judged is told however the clocks were put together.

    Args:
        one: The deviation of the log.
        reference: What was asked for, whole.
    """
    samples = one.left_out + len(one.sample)
    beyond = _beyond(one, reference) if one.sync.offset else 0
    warnings = []
    if one.left_out > beyond:
        said = f"{one.left_out - beyond} of {samples} samples have no reference or no value"
        warnings.append(LogWarning("left-out", said, about=one.name))
    partly = one.reference_left_out > (1.0 - WHOLE) * len(reference.t_ns)
    if partly:
        warnings.append(LogWarning("not-covered", _covered(one, reference), about=one.name))
    if one.sync.offset and (beyond or (one.reference_left_out and not partly)):
        theirs = f"{one.reference_left_out} of {len(reference.t_ns)} samples of {reference.name}"
        said = f"the offset of {one.sync.offset:.6g} s leaves {beyond} of {samples} samples and {theirs}"
        warnings.append(LogWarning(BEYOND, f"{said} without the other side", about=one.name))
    return warnings


def _covered(one: Deviation, reference: Trajectory) -> str:
    """Say how much of the time of the reference a log lasts, and by which offset."""
    kept = len(reference.t_ns) - one.reference_left_out
    first, last = one.sync.offset, one.sync.offset + float(one.run.t[-1])
    lasts = min(last, float(reference.t[-1])) - max(first, 0.0)
    share = text.percent(kept / len(reference.t_ns))
    shifted = f" at the offset of {one.sync.offset:.6g} s" if one.sync.offset else ""
    said = f"{text.seconds(lasts)} s of the {text.seconds(reference.t[-1])} s of {reference.name}"
    return f"it covers {said} ({share}){shifted}: the rest was not judged"


def _beyond(one: Deviation, reference: Trajectory) -> int:
    """Return how many samples of a log lie outside the time of the reference."""
    at_ns = one.run.t_ns + round(one.sync.offset * 1e9)
    before, after = at_ns < reference.t_ns[0] - ROUNDING_NS, at_ns > reference.t_ns[-1] + ROUNDING_NS
    return int(np.count_nonzero(before | after))
