"""How a log was compared, in lines for people: samples, clocks, place."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from urmpipe.guards import offset_of
from urmpipe.printing import count
from urmpipe.wording import limit
from urmpipe_models.transform import translation
from urmpipe_pipeline.comparison import Alignment, Deviation, Sync
from urmpipe_pipeline.report import text


def facts(run: Deviation) -> Iterator[str]:
    """Yield what is to be known of how a log was compared, a line each."""
    arm = f", robot {run.run.robot.name}" if run.run.robot else ""
    yield f"{count(len(run.sample), 'sample')} compared over {text.seconds(run.duration)} s{arm}"
    if run.left_out or run.reference_left_out:
        yield (
            f"left out: {count(run.left_out, 'sample')} of the log,"
            f" {count(run.reference_left_out, 'sample')} of the reference outside its time"
        )
    if longest := run.longest_out:
        yield (
            f"{text.percent(run.share_out)} out of tolerance; the longest stretch:"
            f" {text.seconds(longest.duration)} s ({count(longest.samples, 'sample')})"
            f" from t = {text.seconds(longest.t)} s"
        )
    yield _clocks(run.sync)
    turns = zip(run.joint_statistics, run.joint_turns, strict=True)
    turned = [f"{name} by {number:+d}" for name, number in turns if number]
    if turned:
        yield f"whole turns counted apart at the start, taken out: {', '.join(turned)}"
    yield from _place(run)
    yield from _sliding(run)
    if run.speed_correlation is not None:
        yield f"the norm goes with the speed by r = {run.speed_correlation:+.3f}"


def _clocks(sync: Sync) -> str:
    """Say how the clocks were put together."""
    if sync.mode == "start":
        return "clocks: both from their first samples"
    sure = "" if sync.precision is None else f" ± {sync.precision:.2g} s"
    alike = "" if sync.similarity is None else f" (similarity {sync.similarity:.4g})"
    why = "as given" if sync.mode == "given" else f"estimated by the {sync.by}{alike}"
    sign = "-" if sync.offset < 0.0 else "+"
    return f"clocks: t_reference = t_log {sign} {abs(sync.offset):.6g} s{sure}, {why}"


def _place(run: Deviation) -> Iterator[str]:
    """Say how the log was moved in space, and how to have a tool that was found so for good."""
    moved, robot = run.alignment, run.run.robot
    if moved.mode == "tool":
        yield f"aligned (tool): the tool centre point moved by {_vector(moved.tool)} mm in the tool's frame"
        if robot is not None:
            placed = offset_of(robot.tool @ translation(*moved.tool))
            yield f"to have it so from the start: --tool {','.join(f'{value:.6g}' for value in placed)}"
    elif moved.mode != "none":
        turn = math.degrees(turn_of(moved))
        by = _vector(moved.translation)
        yield f"aligned ({moved.mode}): turned by {turn:.4f} deg about the origin, then moved by {by} mm"


def _sliding(run: Deviation) -> Iterator[str]:
    """Say what a tolerance for joints is where they slide."""
    sliding = [one for one in run.joint_statistics.values() if one.unit == "m" and one.tolerance]
    if sliding:
        names = ", ".join(one.quantity for one in sliding)
        allowed = limit(sliding[0].tolerance, "m")
        yield f"the tolerance of joints is in m where they slide: {names} {allowed} mm"


def turn_of(alignment: Alignment) -> float:
    """Return the angle of a rotation in [rad], exact near 0 as well."""
    r = np.array(alignment.rotation)
    twice_sine = np.linalg.norm([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    return float(np.arctan2(twice_sine, np.trace(r) - 1.0))


def _vector(metres: tuple[float, ...]) -> str:
    """Return a vector in [m] as (x, y, z) in [mm]."""
    return f"({', '.join(text.millimetres(value) for value in metres)})"
