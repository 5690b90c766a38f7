"""How a log was compared, in lines for people: samples, clocks, place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.causes import causes
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.comparison.wording import (
    alignment_words,
    correlation,
    out_words,
    stretch_words,
    sync_words,
    tool_option,
)
from urmpipe_pipeline.presentation.digits import written


def facts(run: Deviation, reference: Trajectory) -> Iterator[str]:
    """Yield what is to be known of how a log was compared, a line each."""
    arm = f", robot {run.run.robot.name}" if run.run.robot else ""
    yield f"{text.counted(len(run.sample), 'sample')} compared over {text.seconds(run.duration)} s{arm}"
    if run.left_out or run.reference_left_out:
        yield (
            f"left out: {text.counted(run.left_out, 'sample')} of the log,"
            f" {text.counted(run.reference_left_out, 'sample')} of the reference outside its time"
        )
    if longest := run.longest_out:
        out = out_words(int(np.count_nonzero(run.outside)), len(run.sample))
        yield f"out of tolerance: {out}, the longest stretch: {stretch_words(longest)}"
    yield sync_words(run.sync) or "clocks: both from their first samples"
    turns = zip(run.joint_statistics, run.joint_turns, strict=True)
    turned = [f"{name} by {number:+d}" for name, number in turns if number]
    if turned:
        yield f"whole turns counted apart at the start, taken out: {', '.join(turned)}"
    yield from _place(run)
    yield from _sliding(run)
    if run.speed_correlation is not None:
        yield f"the norm goes with the speed by r = {correlation(run.speed_correlation)}"
    yield from (f"looks like: {written(cause)}" for cause in causes(run, reference))


def _place(run: Deviation) -> Iterator[str]:
    """Say how the log was moved in space, and how to have a tool that was found so for good."""
    if words := alignment_words(run.alignment):
        yield words
    if run.alignment.mode == "tool" and run.run.robot is not None:
        yield f"to have it so from the start: {tool_option(run.run.robot, run.alignment)}"


def _sliding(run: Deviation) -> Iterator[str]:
    """Say what a tolerance for joints is where they slide."""
    sliding = [one for one in run.joint_statistics.values() if one.unit == "m" and one.tolerance]
    if sliding:
        names = ", ".join(one.quantity for one in sliding)
        allowed = text.limit(sliding[0].tolerance, "m")
        yield f"the tolerance of joints is in m where they slide: {names} {allowed} mm"
