"""The plots of a comparison: how each log deviates over time, over its speed and in space."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES, Deviation, Statistics
from urmpipe_pipeline.comparison.mended import mended_figure, mended_path
from urmpipe_pipeline.comparison.scene import allowed_norm, deviation_arrows
from urmpipe_pipeline.comparison.wording import SYMBOLS, amount_words, peak_words, symbol, when
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.figure import Figure, Line, Over, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    DEVIATION_COLOUR,
    REFERENCE_COLOUR,
    joint_colour,
    run_colour,
)
from urmpipe_pipeline.presentation.parts import ends
from urmpipe_pipeline.presentation.scene import Path, Spot
from urmpipe_pipeline.presentation.section import Value
from urmpipe_pipeline.runs.figures import joints_figure, motion_figure, speed_figure
from urmpipe_pipeline.trajectories import extent

APART = 30.0
"""Largest values further apart than this factor need a logarithmic axis: else the small ones are flat."""

STRENGTHS = ((0.7, "strongly"), (0.4, "moderately"), (0.2, "weakly"))
"""From which |r| on two quantities go together, in words."""


def overview_figure(comparison: Comparison) -> Iterator[Figure]:
    """Yield the norm of every log over its own time, from best to worst; nothing of a single one."""
    ranking = comparison.ranking
    if len(ranking) < 2 or not all(one.statistics for one in ranking):
        return
    largest = [one.statistics["norm"].max for one in ranking]
    logarithmic = min(largest) > 0.0 and max(largest) > APART * min(largest)
    placed = [(f"{place}. {one.name}", one) for place, one in enumerate(ranking, start=1)]
    order = "; ".join(
        f"{name}: at most {text.format_quantity(one.statistics['norm'].max, 'm')}, {one.verdict}"
        for name, one in placed
    )
    own = "its own time" if all(one.run.timed for one in ranking) else "the rows"
    lines = tuple(
        _line(one, column(one.delta, 3), (name,), (run_colour(comparison.runs.index(one)),))
        for name, one in placed
    )
    panel = Panel(
        "‖Δ‖", "m", lines, limit=comparison.tolerance.get("norm"), signed=False, logarithmic=logarithmic,
        small=True, share=3.0,
    )  # fmt: skip
    scale = " The axis is logarithmic." if logarithmic else ""
    yield Figure(
        "Deviation of all logs",
        f"The norm of each log's deviation over {own}, from best to worst.{scale}",
        f"Norm of the deviation of {len(ranking)} logs over {own}, from best to worst. {order}.",
        (View("‖Δ‖ of all logs", (panel,)),),
    )


def deviation_figures(one: Deviation) -> Iterator[Figure]:
    """Yield the plots of a compared log: how it deviates, then how it moves."""
    if one.statistics:
        yield _deviation(one)
        yield from mended_figure(one)
    yield from _joints(one)
    if not one.statistics:
        yield from mended_figure(one)
    moves = [*joints_figure(one.run, 1 if one.joint_delta is not None else None)]
    if np.isfinite(one.speed).any():
        moves.append(speed_figure(one.name, one.t_ns, one.speed))
    moves += motion_figure(one.run)
    yield from (replace(figure, folded=True) for figure in moves)


def path_figure(one: Deviation) -> Iterator[SpaceFigure]:
    """Yield the reference and the actual path in space, the actual one coloured by its deviation."""
    place = one.place(one.worst_statistics)
    if place is None:
        return
    spots = (*ends(one.actual), Spot(place, peak_words(one), DEVIATION_COLOUR))
    decided = "The verdict was decided" if isinstance(one.decisive, Statistics) else "It deviates most"
    if not one.run.timed:
        arrows = deviation_arrows(one, extent(one.actual) / 2)
        yield SpaceFigure(
            "Poses in space",
            f"Equal scale on all axes. A dot is where a pose was asked for, the arrow from it"
            f" the {arrows.name}, in the colour of its size.",
            f"Poses of {one.name} in three dimensions, each with its deviation as an arrow."
            f" {decided} at x, y, z = {text.format_point(place)} m: {amount_words(one.worst_statistics)}.",
            (),
            spots[2:],
            arrows,
        )
        return
    supposed = tuple(mended_path(one))
    said = "The colour is the distance from the reference at the same time"
    said += ": blue within the tolerance, orange to crimson beyond it." if allowed_norm(one) else "."
    said += " Green, dashed: where the log would be without the causes named above." if supposed else ""
    yield SpaceFigure(
        "Path in space",
        said,
        f"Paths of the reference and of {one.name} in three dimensions. {decided} at"
        f" x, y, z = {text.format_point(place)} m: {amount_words(one.worst_statistics)}.",
        (
            Path("reference", one.reference, one.t_ns, REFERENCE_COLOUR, asked=True, sample=one.sample),
            *supposed,
            Path(
                "actual: ‖Δ‖", one.actual, one.t_ns, AXIS_COLOURS["norm"], values=column(one.delta, 3),
                limit=allowed_norm(one), sample=one.sample, kept=(one.worst_statistics_index,),
            ),
        ),
        spots,
    )  # fmt: skip


def speed_cloud(one: Deviation) -> Iterator[Figure]:
    """Yield the norm over the speed of the tool centre point; nothing where the speed is not known."""
    if not np.isfinite(one.speed).any():
        return
    said = correlation_words(one.speed_correlation)
    line = Line(column(one.delta, 3), ("‖Δ‖",), (AXIS_COLOURS["norm"],), points=True)
    over = Over(one.speed, "‖v‖", "m/s")
    panel = Panel("‖Δ‖", "m", (line,), one.t_ns, signed=False, peaks=(one.worst,), over=over, small=True)
    yield Figure(
        "Deviation over speed",
        f"Each point is a sample. {said}",
        f"Norm of the deviation of {one.name} over the speed of its tool centre point. {said}",
        (View("‖Δ‖ over ‖v‖", (panel,)),),
        folded=True,
    )


def correlation_words(r: float | None) -> str:
    """Say what the correlation of norm and speed means."""
    if r is None:
        return "The norm or the speed does not change, so there is no correlation."
    said = f"r = {written(Value(r, '1', signed=True))}: deviation"
    strength = next((word for least, word in STRENGTHS if abs(r) >= least), "")
    if not strength:
        return f"{said} does not correlate with speed."
    if r > 0:
        return f"{said} grows {strength} with speed, as it does with a lag in time."
    return f"{said} shrinks {strength} with speed."


def column(values: FloatArray, index: int) -> FloatArray:
    """Return a column of an array in any unit of shape (n, k), shape (n,)."""
    return np.asarray(np.asarray(values)[:, index])


def _deviation(one: Deviation) -> Figure:
    """Return delta, its norm, the distance from the path and the angle, with what is allowed of each."""
    delta = tuple(
        _panel(
            one,
            one.statistics[axis],
            _line(one, column(one.delta, i), (SYMBOLS[axis],), (AXIS_COLOURS[axis],)),
        )
        for i, axis in enumerate(AXES)
    )
    path = _panel(one, one.statistics["path"], _line(one, one.path, ("path",), (AXIS_COLOURS["norm"],)))
    views = [View("delta = reference - log", delta), View("Distance from the path", (path,))]
    if one.angle is not None:
        line = _line(one, one.angle, ("angle",), (AXIS_COLOURS["norm"],))
        views.append(View("Angle between the orientations", (_panel(one, one.statistics["angle"], line),)))
    largest = ", ".join(
        f"{symbol(held)} {text.format_quantity(held.max, held.unit)} {when(held)}"
        for held in one.statistics.values()
    )
    said = "Δ is reference minus actual at the same time; path is the distance from the reference's path,"
    said += " regardless of time; angle is that between the two orientations."
    if not one.run.timed:
        said = (
            "Δ is reference minus actual in the same row; path is the distance from the reference's nearest"
        )
        said += " pose; angle is that between the two orientations."
    over = "time" if one.run.timed else "the rows"
    dotted = "what decided the verdict" if isinstance(one.decisive, Statistics) else "where it deviates most"
    return Figure(
        f"Deviation over {over}",
        f"{said} Dashed: the tolerance; tinted: out of it. Diamonds: the largest value of each. Dotted:"
        f" {dotted}.",
        f"Deviation of {one.name} from the reference over {over}. Largest absolute values: {largest}."
        f" {_out_words(one)}",
        tuple(views),
        _instant(one),
        opened={"path": 1, "angle": 2}.get(one.worst_statistics.kind, 0),
        share=3.6,
    )


def _joints(one: Deviation) -> Iterator[Figure]:
    """Yield reference minus log of the joints, a panel for those that turn and one for those that slide."""
    if one.joint_delta is None or not one.joint_statistics:
        return
    held = list(one.joint_statistics.values())
    units = [unit for unit in text.SHOWN if any(joint.unit == unit for joint in held)]
    values = np.asarray(one.joint_delta)
    panels = tuple(_joint_panel(one, values, held, unit) for unit in units)
    largest = ", ".join(f"{joint.quantity} {text.format_quantity(joint.max, joint.unit)}" for joint in held)
    yield Figure(
        "Deviation of joints",
        "Reference minus log of each joint, without whole turns counted differently at the start. Dashed: the"
        " tolerance; tinted: out of it.",
        f"Deviation of the joints of {one.name}. Largest absolute values: {largest}.",
        tuple(View("Joints, reference - log", (panel,)) for panel in panels),
        _instant(one),
        opened=units.index(one.worst_statistics.unit) if one.worst_statistics.kind == "joint" else 0,
        share=3.0,
    )


def _joint_panel(one: Deviation, delta: FloatArray, held: Sequence[Statistics], unit: str) -> Panel:
    """Return the deviation of the joints of one unit, each in its colour."""
    own = [j for j, joint in enumerate(held) if joint.unit == unit]
    values = delta if len(own) == len(held) else delta[:, own]
    names, colours = tuple(held[j].quantity for j in own), tuple(map(joint_colour, own))
    line, allowed = _line(one, values, names, colours), held[own[0]].tolerance
    return Panel("Δ joints", unit, (line,), one.axis_ns, allowed, small=True, share=1.9)


def _panel(one: Deviation, held: Statistics, line: Line) -> Panel:
    """Return one quantity over time with its tolerance and its largest value."""
    signed, peaks = held.kind == "axis", (one.peak(held) if one.run.timed else held.sample_max,)
    return Panel(symbol(held), held.unit, (line,), one.axis_ns, held.tolerance, signed, peaks, small=True)


def _line(one: Deviation, values: FloatArray, names: tuple[str, ...], colours: tuple[str, ...]) -> Line:
    """Return what was compared as a line over its times; of still poses as points, one a row of the log."""
    if one.run.timed:
        return Line(values, names, colours, t_ns=one.t_ns)
    every = np.full((one.run.log.rows, *values.shape[1:]), np.nan)
    every[one.sample] = values
    return Line(every, names, colours, points=True)


def _instant(one: Deviation) -> dict[int, str]:
    """Return when the verdict was decided, or the log deviates most."""
    if not one.run.timed:
        return {one.worst_statistics.sample_max: f"{peak_words(one)} {when(one.worst_statistics)}"}
    return {
        int(
            one.t_ns[one.worst_statistics_index]
        ): f"{peak_words(one)} at {text.format_seconds(one.worst_statistics.t_max)} s"
    }


def _out_words(one: Deviation) -> str:
    """Say how much of the log is out of tolerance."""
    if all(held.tolerance is None for held in one.all_statistics):
        return "There is no tolerance."
    return f"Out of tolerance: {text.format_percent(one.out_fraction)} of the samples."
