"""A compared log without the causes that its diagnosis names, over time and in space; these on the arm."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.comparison.wording import SYMBOLS
from urmpipe_pipeline.diagnosis.cause_texts import format_cause, joint_names
from urmpipe_pipeline.diagnosis.result import Diagnosis, format_residual
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, View
from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    CORRECTED_COLOUR,
    DEVIATION_COLOUR,
    joint_colour,
)
from urmpipe_pipeline.presentation.scene import ArmMark, Path


def mended_figure(one: Deviation) -> Iterator[Figure]:
    """Yield each axis, or each joint, without the causes; nothing where no cause is named.

    The deviation as it was stands in a figure of its own: on one scale with it, little would be seen.
    """
    found = one.diagnosis
    if found is None or not found.causes:
        return
    panels = tuple(_panels(one, found))
    over = "time" if one.run.timed else "the rows"
    yield Figure(
        f"Deviation over {over} without the causes",
        "What stays when the causes above are taken away. Dashed: the tolerance; tinted: out of it.",
        f"Deviation of {one.name} over {over} without the causes: {found.summary}."
        f" What stays: {format_residual(found.unexplained, found.unit)}.",
        (View("delta without the causes", panels),),
        share=3.0,
        beside=True,
        folded=True,
    )


def _panels(one: Deviation, found: Diagnosis) -> Iterator[Panel]:
    """Yield a panel for each axis or joint."""
    if found.unit == "m":
        held = [one.statistics[axis] for axis in AXES[:3]]
        looks = [(SYMBOLS[axis], AXIS_COLOURS[axis]) for axis in AXES[:3]]
    else:
        held = list(one.joint_statistics.values())
        looks = [(f"Δ {joint.quantity}", joint_colour(k)) for k, joint in enumerate(held)]
    mended = np.asarray(found.residual)
    largest = np.nanmax(np.abs(mended), axis=0, initial=0.0)
    for k, ((name, colour), statistics) in enumerate(zip(looks, held, strict=True)):
        unit = statistics.unit
        line = _line(one, found.sample, mended[:, k], f"{name} without the causes", colour)
        alike = [most for most, other in zip(largest.tolist(), held, strict=True) if other.unit == unit]
        yield Panel(name, unit, (line,), one.axis_ns, statistics.tolerance, small=True, close=max(alike))


def _line(one: Deviation, sample: IntArray, values: FloatArray, name: str, colour: str) -> Line:
    """Return values at some rows of the log as a line over their times; of still poses as points."""
    if one.run.timed:
        return Line(values, (name,), (colour,), t_ns=np.asarray(one.run.log.t_ns)[sample])
    every = np.full(one.run.log.rows, np.nan)
    every[sample] = values
    return Line(every, (name,), (colour,), points=True)


def mended_path(one: Deviation) -> Iterator[Path]:
    """Yield where the log would be: reference - mended; nothing where no cause moves it in space."""
    found = one.diagnosis
    if found is None or not found.causes or found.unit != "m":
        return
    both, own, mended = np.intersect1d(one.sample, found.sample, return_indices=True)
    position = np.asarray(one.reference)[own] - np.asarray(found.residual)[mended]
    t_ns = one.t_ns[own] if one.run.timed else None
    yield Path(
        "without the causes", position, t_ns, CORRECTED_COLOUR, supposed=True, sample=both, line=one.run.timed
    )


def cause_marks(one: Deviation, chain: Chain) -> tuple[ArmMark, ...]:
    """Return the joints and segments that causes name, as words at the arm."""
    joints = [joint.name for joint in chain.joints]
    words: dict[tuple[int, bool], list[str]] = {}
    for cause in one.diagnosis.causes if one.diagnosis is not None else ():
        places = [(joints.index(name), False) for name in joint_names(cause) if name in joints]
        if cause.segment in chain.point_names:
            places = [(chain.point_names.index(cause.segment) + 1, True)]
        for place in places:
            words.setdefault(place, []).append(format_cause(cause))
    return tuple(
        ArmMark(point, text.join_words(said), DEVIATION_COLOUR, segment)
        for (point, segment), said in words.items()
    )
