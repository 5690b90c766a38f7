"""The lines of what is allowed, each in the plot of its own unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_models.arrays import IntArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.palette import AXIS_COLOURS, REFERENCE_COLOUR, rgb
from urmpipe_pipeline.recording.columns import scalar_column, time_columns
from urmpipe_pipeline.recording.entities import entity_path
from urmpipe_pipeline.recording.signal_entities import verdict_entities
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.text import SHOWN

if TYPE_CHECKING:
    from rerun import RecordingStream

PLOTS = {
    **dict.fromkeys(("axis", "x", "y", "z", "norm"), "delta"),
    "path": "path",
    "angle": "angle",
    "joint": "joints",
}
"""In which plot a tolerance belongs."""

UNSIGNED = ("norm", "path", "angle")
"""What is never negative, so that its tolerance is one line."""

LIMIT_WIDTH = 1.5
"""Width of a tolerance's line in points of the screen."""


def draw_tolerances(stream: RecordingStream, result: Comparison) -> None:
    """Draw what is allowed as lines over the compared times: both signs of what has a sign."""
    ends = _ends([one.t_ns for one in result.runs])
    numbers = _ends([one.sample for one in result.runs])
    for kind, allowed in result.tolerance.items():
        unit, factor = SHOWN[_unit(result, kind)]
        entity = entity_path("tolerance", PLOTS[kind], kind)
        _draw(stream, entity, kind, allowed * factor, unit, ends, numbers)


def _unit(result: Comparison, kind: str) -> str:
    """Return the SI unit of what is allowed: that of joints is of those that were held against it."""
    if kind != "joint":
        return "rad" if kind == "angle" else "m"
    joints = (joint for one in result.runs for joint in one.joint_statistics.values())
    return next((joint.unit for joint in joints if joint.tolerance is not None), "rad")


def draw_meter_tolerances(stream: RecordingStream, result: Simulation) -> None:
    """Draw what the delta meters of a simulation allow over all its samples."""
    if not len(result.t_ns):
        return
    ends, numbers = result.t_ns[[0, -1]], np.array([0, len(result.t_ns) - 1])
    for one, root in zip(result.verdicts, verdict_entities(result, "tolerance"), strict=True):
        for kind, allowed in one.tolerance.items():
            _draw(stream, f"{root}/{kind}", kind, allowed, "m", ends, numbers)


def _draw(
    stream: RecordingStream,
    entity: str,
    kind: str,
    allowed: float,
    unit: str,
    ends: IntArray,
    numbers: IntArray,
) -> None:
    """Draw one tolerance, in the unit of its plot, as lines: both signs of what has a sign."""
    import rerun as rr

    signs = (1,) if kind in UNSIGNED else (1, -1)
    colour = rgb(AXIS_COLOURS.get(kind, REFERENCE_COLOUR))
    what = "tolerance" if kind not in AXIS_COLOURS else f"tolerance of {kind}"
    said = f"{what} {allowed:.4g} {unit}"
    names = [f"{'+' if sign > 0 else '-'}{said}" if len(signs) > 1 else said for sign in signs]
    style = rr.SeriesLines(colors=[colour] * len(signs), names=names, widths=[LIMIT_WIDTH] * len(signs))
    stream.log(entity, style, static=True)
    values = np.array([[sign * allowed for sign in signs]] * len(ends))
    stream.send_columns(entity, time_columns(ends, "sample", numbers), [scalar_column(values)])


def tolerance_entities(plot: str) -> str:
    """Return the entities of the tolerances in one plot."""
    return f"{entity_path('tolerance', plot)}/**"


def _ends(ranges: Sequence[IntArray]) -> IntArray:
    """Return the least and the largest number in all of the ranges."""
    return np.array([min(int(one[0]) for one in ranges), max(int(one[-1]) for one in ranges)], dtype=np.int64)
