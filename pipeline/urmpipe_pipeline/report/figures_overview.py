"""All logs of a comparison in one figure: which of them deviates when."""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.palette import RUN_COLOURS, run_colour
from urmpipe_pipeline.report.spec import Figure, Panel, Spec, stacked
from urmpipe_pipeline.report.traces import DASHES, level, line, stroke

OVERVIEW_PX = 380
"""Height of the overview."""

APART = 30.0
"""Largest values further apart than this factor need a logarithmic axis: else the small ones are flat."""

DEPTH = 1000.0
"""So far below the best log's largest value the logarithmic axis reaches."""


def overview_figure(comparison: Comparison) -> Figure | None:
    """Return the norm of every log over time, from best to worst; None of a single log."""
    if len(comparison.runs) < 2:
        return None
    ranking = comparison.ranking
    largest = [one.statistics["norm"].max for one in ranking]
    logarithmic = min(largest) > 0.0 and max(largest) > APART * min(largest)
    duration = max(one.run.duration for one in ranking)
    shapes = []
    tolerance = comparison.tolerance.get("norm")
    if tolerance:
        shapes.append(level(tolerance * 1e3, f"{text.limit(tolerance)} mm"))
    lines = [_line(comparison, place, one) for place, one in enumerate(ranking, start=1)]
    spec = stacked([Panel("‖Δ‖ [mm]", lines, shapes, from_zero=not logarithmic)], duration)
    if logarithmic:
        top = max(*largest, tolerance or 0.0)
        ends = np.log10([1e3 * min(largest) / DEPTH, 1.5e3 * top])
        spec["layout"]["yaxis"] |= {"type": "log", "range": ends.tolist()}
    order = "; ".join(
        f"{place}. {one.name}: at most {text.millimetres(one.statistics['norm'].max)} mm, {one.verdict}"
        for place, one in enumerate(ranking, start=1)
    )
    scale = " The axis is logarithmic." if logarithmic else ""
    return Figure(
        "Deviation of all logs",
        f"The norm of each log's deviation over its own time, from best to worst.{scale}",
        f"Norm of the deviation of {len(ranking)} logs over time, from best to worst. {order}.",
        spec,
        OVERVIEW_PX,
    )


def _line(comparison: Comparison, place: int, deviation: Deviation) -> Spec:
    """Return one log, in the colour that it has everywhere."""
    index = comparison.runs.index(deviation)
    style = stroke(run_colour(index), DASHES[index // len(RUN_COLOURS) % len(DASHES)])
    values = deviation.delta[:, 3] * 1e3
    name = f"{place}. {deviation.name}"
    return line(deviation.t, values, name, style["color"], "mm", line=style, showlegend=True)
