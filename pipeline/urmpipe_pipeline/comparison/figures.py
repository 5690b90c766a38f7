"""Figures and scene of a comparison: each log's deviation over time, over its speed and in space.

1. `overview_figure`, `deviation_figures`, `path_figure`, `speed_scatter`: the plots of all logs and of one.
2. `residual_figure`: the deviation without the causes that a diagnosis names.
3. `comparison_scene`: the arm of the worst log, all paths, the decisive sample, and the causes at the arm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import apply_alignment
from urmpipe_pipeline.comparison.comparison import Comparison, tolerance_sort_key
from urmpipe_pipeline.comparison.deviation import AXES, Deviation, Statistics
from urmpipe_pipeline.comparison.verdict import (
    SYMBOLS,
    format_amount,
    format_peak,
    format_time_of_max,
    symbol,
)
from urmpipe_pipeline.diagnosis.cause_texts import format_cause, joint_names
from urmpipe_pipeline.diagnosis.result import Diagnosis, format_residual
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.figure import Figure, Line, Over, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    CORRECTED_COLOUR,
    DEVIATION_COLOUR,
    REFERENCE_COLOUR,
    joint_colour,
    run_colour,
)
from urmpipe_pipeline.presentation.parts import ends, spot_at
from urmpipe_pipeline.presentation.scene import Arm, ArmMark, Arrows, Path, Scene, Spot
from urmpipe_pipeline.presentation.section import Value
from urmpipe_pipeline.runs.figures import joints_figure, motion_figure, speed_figure, times_of
from urmpipe_pipeline.trajectories import Trajectory, extent

MAX_LINEAR_RATIO = 30.0  # of largest values: above, a linear axis shows the small ones as flat lines

# Least |r| of two quantities that correlate, and its name.
STRENGTHS = ((0.7, "strongly"), (0.4, "moderately"), (0.2, "weakly"))


def overview_figure(comparison: Comparison) -> Iterator[Figure]:
    """Yield the norm of every log over its time, from best to worst; nothing for a single log."""
    ranking = comparison.ranking
    if len(ranking) < 2 or not all(deviation.statistics for deviation in ranking):
        return
    largest = [deviation.statistics["norm"].max for deviation in ranking]
    logarithmic = min(largest) > 0.0 and max(largest) > MAX_LINEAR_RATIO * min(largest)
    placed = [(f"{place}. {deviation.name}", deviation) for place, deviation in enumerate(ranking, start=1)]
    order = "; ".join(
        f"{name}: at most {text.format_quantity(deviation.statistics['norm'].max, 'm')}, {deviation.verdict}"
        for name, deviation in placed
    )
    over = "its own time" if all(deviation.run.timed for deviation in ranking) else "the rows"
    lines = tuple(
        _line(deviation, column(deviation.delta, 3), (name,), (run_colour(comparison.runs.index(deviation)),))
        for name, deviation in placed
    )
    panel = Panel(
        "‖Δ‖", "m", lines, limit=comparison.tolerance.get("norm"), signed=False, logarithmic=logarithmic,
        small=True, share=3.0,
    )  # fmt: skip
    scale = " The axis is logarithmic." if logarithmic else ""
    yield Figure(
        "Deviation of all logs",
        f"The norm of each log's deviation over {over}, from best to worst.{scale}",
        f"Norm of the deviation of {len(ranking)} logs over {over}, from best to worst. {order}.",
        (View("‖Δ‖ of all logs", (panel,)),),
    )


def deviation_figures(deviation: Deviation) -> Iterator[Figure]:
    """Yield the plots of a compared log: how it deviates, then how it moves."""
    if deviation.statistics:
        yield _deviation(deviation)
        yield from residual_figure(deviation)
    yield from _joints(deviation)
    if not deviation.statistics:
        yield from residual_figure(deviation)
    moves = [*joints_figure(deviation.run, 1 if deviation.joint_delta is not None else None)]
    if np.isfinite(deviation.speed).any():
        moves.append(speed_figure(deviation.name, deviation.t_ns, deviation.speed))
    moves += motion_figure(deviation.run)
    yield from (replace(figure, folded=True) for figure in moves)


def path_figure(deviation: Deviation) -> Iterator[SpaceFigure]:
    """Yield the reference and the actual path in space, the actual one coloured by its deviation."""
    place = deviation.place(deviation.worst_statistics)
    if place is None:
        return
    spots = (*ends(deviation.actual), Spot(place, format_peak(deviation), DEVIATION_COLOUR))
    decided = "The verdict was decided" if isinstance(deviation.decisive, Statistics) else "It deviates most"
    decided += f" at x, y, z = {text.format_point(place)} m: {format_amount(deviation.worst_statistics)}."
    if not deviation.run.timed:
        arrows = deviation_arrows(deviation, extent(deviation.actual) / 2)
        yield SpaceFigure(
            "Poses in space",
            f"Equal scale on all axes. Dots: poses of the reference; arrows: the {arrows.name}, coloured by"
            " size.",
            f"Poses of {deviation.name} in three dimensions, each with its deviation as an arrow. {decided}",
            (),
            spots[2:],
            arrows,
        )
        return
    corrected = tuple(corrected_path(deviation))
    caption = "The colour is the distance from the reference at the same time"
    limit = norm_tolerance(deviation)
    caption += ": blue within the tolerance, orange to crimson beyond it." if limit else "."
    caption += " Green, dashed: where the log would be without the causes named above." if corrected else ""
    yield SpaceFigure(
        "Path in space",
        caption,
        f"Paths of the reference and of {deviation.name} in three dimensions. {decided}",
        (
            Path(
                "reference", deviation.reference, deviation.t_ns, REFERENCE_COLOUR, asked=True,
                sample=deviation.sample,
            ),
            *corrected,
            Path(
                "actual: ‖Δ‖", deviation.actual, deviation.t_ns, AXIS_COLOURS["norm"],
                values=column(deviation.delta, 3), limit=limit, sample=deviation.sample,
                kept=(deviation.worst_statistics_index,),
            ),
        ),
        spots,
    )  # fmt: skip


def speed_scatter(deviation: Deviation) -> Iterator[Figure]:
    """Yield the norm over the speed of the tool centre point; nothing without a speed."""
    if not np.isfinite(deviation.speed).any():
        return
    caption = format_correlation(deviation.speed_correlation)
    line = Line(column(deviation.delta, 3), ("‖Δ‖",), (AXIS_COLOURS["norm"],), points=True)
    over = Over(deviation.speed, "‖v‖", "m/s")
    panel = Panel(
        "‖Δ‖", "m", (line,), deviation.t_ns, signed=False, peaks=(deviation.worst,), over=over, small=True
    )
    yield Figure(
        "Deviation over speed",
        f"Each point is a sample. {caption}",
        f"Norm of the deviation of {deviation.name} over the speed of its tool centre point. {caption}",
        (View("‖Δ‖ over ‖v‖", (panel,)),),
        folded=True,
    )


def format_correlation(r: float | None) -> str:
    """Return the correlation of norm and speed as a sentence."""
    if r is None:
        return "The norm or the speed does not change, so there is no correlation."
    caption = f"r = {written(Value(r, '1', signed=True))}: deviation"
    strength = next((word for least, word in STRENGTHS if abs(r) >= least), "")
    if not strength:
        return f"{caption} does not correlate with speed."
    if r > 0:
        return f"{caption} grows {strength} with speed, as it does with a lag in time."
    return f"{caption} shrinks {strength} with speed."


def column(values: FloatArray, index: int) -> FloatArray:
    """Return a column of an array in any unit of shape (n, k), shape (n,)."""
    return np.asarray(np.asarray(values)[:, index])


def _deviation(deviation: Deviation) -> Figure:
    """Return delta, its norm, the distance from the path and the angle, with the tolerance of each."""
    delta = tuple(
        _panel(
            deviation,
            deviation.statistics[axis],
            _line(deviation, column(deviation.delta, i), (SYMBOLS[axis],), (AXIS_COLOURS[axis],)),
        )
        for i, axis in enumerate(AXES)
    )
    path = _panel(
        deviation,
        deviation.statistics["path"],
        _line(deviation, deviation.path, ("path",), (AXIS_COLOURS["norm"],)),
    )
    views = [View("delta = reference - log", delta), View("Distance from the path", (path,))]
    if deviation.angle is not None:
        line = _line(deviation, deviation.angle, ("angle",), (AXIS_COLOURS["norm"],))
        views.append(
            View("Angle between the orientations", (_panel(deviation, deviation.statistics["angle"], line),))
        )
    largest = ", ".join(
        f"{symbol(statistics)} {text.format_quantity(statistics.max, statistics.unit)}"
        f" {format_time_of_max(statistics)}"
        for statistics in deviation.statistics.values()
    )
    caption = "Δ is reference minus actual at the same time; path is the distance from the reference's path,"
    caption += " regardless of time; angle is that between the two orientations."
    if not deviation.run.timed:
        caption = (
            "Δ is reference minus actual in the same row; path is the distance from the reference's nearest"
        )
        caption += " pose; angle is that between the two orientations."
    over = "time" if deviation.run.timed else "the rows"
    dotted = (
        "what decided the verdict" if isinstance(deviation.decisive, Statistics) else "where it deviates most"
    )
    return Figure(
        f"Deviation over {over}",
        f"{caption} Dashed: the tolerance; tinted: out of it. Diamonds: the largest value of each. Dotted:"
        f" {dotted}.",
        f"Deviation of {deviation.name} from the reference over {over}. Largest absolute values: {largest}."
        f" {_format_out_fraction(deviation)}",
        tuple(views),
        _instant(deviation),
        opened={"path": 1, "angle": 2}.get(deviation.worst_statistics.kind, 0),
        share=3.6,
    )


def _joints(deviation: Deviation) -> Iterator[Figure]:
    """Yield reference minus log of the joints, a panel for those that turn and one for those that slide."""
    if deviation.joint_delta is None or not deviation.joint_statistics:
        return
    quantities = list(deviation.joint_statistics.values())
    units = [unit for unit in text.SHOWN if any(joint.unit == unit for joint in quantities)]
    values = np.asarray(deviation.joint_delta)
    panels = tuple(_joint_panel(deviation, values, quantities, unit) for unit in units)
    largest = ", ".join(
        f"{joint.quantity} {text.format_quantity(joint.max, joint.unit)}" for joint in quantities
    )
    yield Figure(
        "Deviation of joints",
        "Reference minus log of each joint, without whole turns counted differently at the start. Dashed: the"
        " tolerance; tinted: out of it.",
        f"Deviation of the joints of {deviation.name}. Largest absolute values: {largest}.",
        tuple(View("Joints, reference - log", (panel,)) for panel in panels),
        _instant(deviation),
        opened=units.index(deviation.worst_statistics.unit)
        if deviation.worst_statistics.kind == "joint"
        else 0,
        share=3.0,
    )


def _joint_panel(
    deviation: Deviation, delta: FloatArray, quantities: Sequence[Statistics], unit: str
) -> Panel:
    """Return the deviation of the joints of one unit, each in its colour."""
    indices = [j for j, joint in enumerate(quantities) if joint.unit == unit]
    values = delta if len(indices) == len(quantities) else delta[:, indices]
    names, colours = tuple(quantities[j].quantity for j in indices), tuple(map(joint_colour, indices))
    line, allowed = _line(deviation, values, names, colours), quantities[indices[0]].tolerance
    return Panel("Δ joints", unit, (line,), deviation.axis_ns, allowed, small=True, share=1.9)


def _panel(deviation: Deviation, statistics: Statistics, line: Line) -> Panel:
    """Return one quantity over time with its tolerance and its largest value."""
    peak = deviation.peak(statistics) if deviation.run.timed else statistics.sample_max
    return Panel(
        symbol(statistics), statistics.unit, (line,), deviation.axis_ns, statistics.tolerance,
        statistics.kind == "axis", (peak,), small=True,
    )  # fmt: skip


def _line(
    deviation: Deviation, values: FloatArray, names: tuple[str, ...], colours: tuple[str, ...],
    sample: IntArray | None = None,
) -> Line:  # fmt: skip
    """Return values at the compared samples, or at rows of the log, over time; static poses as points."""
    if deviation.run.timed:
        t_ns = deviation.t_ns if sample is None else np.asarray(deviation.run.log.t_ns)[sample]
        return Line(values, names, colours, t_ns=t_ns)
    by_row = np.full((deviation.run.log.rows, *values.shape[1:]), np.nan)
    by_row[deviation.sample if sample is None else sample] = values
    return Line(by_row, names, colours, points=True)


def _instant(deviation: Deviation) -> dict[int, str]:
    """Return the time in [ns], or the row, that decided the verdict or deviates most, with its caption."""
    worst, caption = deviation.worst_statistics, format_peak(deviation)
    if not deviation.run.timed:
        return {worst.sample_max: f"{caption} {format_time_of_max(worst)}"}
    t_ns = int(deviation.t_ns[deviation.worst_statistics_index])
    return {t_ns: f"{caption} at {text.format_seconds(worst.t_max)} s"}


def _format_out_fraction(deviation: Deviation) -> str:
    """Return the fraction of the samples out of tolerance as a sentence."""
    if all(statistics.tolerance is None for statistics in deviation.all_statistics):
        return "There is no tolerance."
    return f"Out of tolerance: {text.format_percent(deviation.out_fraction)} of the samples."


DISPLAY_FACTORS = (50, 20, 10, 5, 2)  # of a deviation that is drawn enlarged, the usual one first
MIN_VISIBLE = 0.005  # of the scene's radius: a smaller enlarged deviation is within the width of the lines
MAX_ARROWS = 20_000  # poses whose deviation is drawn as an arrow
MAX_SAMPLED_POSES = 1000  # of an arm, for the extent of the scene


def comparison_scene(comparison: Comparison) -> Scene:
    """Return the arm of the worst log, the reference, all logs, and the worst log's deviation enlarged."""
    shown = select_shown_log(comparison)
    index, several = comparison.runs.index(shown), len(comparison.runs) > 1
    arms = tuple(_arm(shown, run_colour(index)))
    paths = [
        *_reference(comparison.reference, shown),
        *(_log(deviation, run_colour(i)) for i, deviation in enumerate(comparison.runs)),
    ]
    radius, spots = _radius(arms, paths), (_decided(shown, several=several),)
    whose = f"Arm of {shown.name}" if arms and several else "Arm"
    if not shown.run.timed:
        arrows = deviation_arrows(shown, radius)
        title = f"{whose} and poses [m], {arrows.name}, from light to dark the larger"
        return Scene(title, arms, tuple(paths), spots, arrows=arrows)
    paths += corrected_path(shown)
    if larger := _enlarged(shown, radius):
        paths.append(larger)
    enlarged = f", in crimson the {larger.name}" if larger else ""
    return Scene(f"{whose} and paths [m]{enlarged}", arms, tuple(paths), spots)


def deviation_arrows(deviation: Deviation, radius: float) -> Arrows:
    """Return the deviation of each pose, enlarged to fit a scene of a radius in [m].

    Of very many poses those that deviate most are drawn.
    """
    factor = display_factor(deviation.statistics["norm"].max, radius) or 1
    size = np.asarray(deviation.delta[:, 3])
    drawn = np.sort(np.argsort(-size, kind="stable")[:MAX_ARROWS])
    start = np.asarray(deviation.reference)[drawn]
    end = start + factor * (np.asarray(deviation.actual)[drawn] - start)
    sample = np.asarray(deviation.sample)[drawn]
    return Arrows(
        f"deviation drawn x{factor}", start, end, size[drawn], sample, limit=norm_tolerance(deviation)
    )


def norm_tolerance(deviation: Deviation) -> float | None:
    """Return the tolerance of the norm in [m], else the least of an axis; None without a tolerance."""
    norm = deviation.statistics["norm"].tolerance
    axes = [tolerance for axis in AXES[:3] if (tolerance := deviation.statistics[axis].tolerance) is not None]
    return min(axes, default=None) if norm is None else norm


def select_shown_log(comparison: Comparison) -> Deviation:
    """Return the compared log whose arm is drawn: the worst that has kinematics, else the worst."""
    worst_first = sorted(comparison.runs, key=tolerance_sort_key)[::-1]
    return next((deviation for deviation in worst_first if deviation.run.tcp is not None), worst_first[0])


def _arm(deviation: Deviation, colour: str) -> Iterator[Arm]:
    """Yield the arm of a log where the alignment puts it; nothing without kinematics."""
    run = deviation.run
    if run.robot is None or run.tcp is None:
        return
    decided = int(deviation.t_ns[deviation.worst_statistics_index])
    row = min(int(np.searchsorted(run.t_ns, decided)), len(run.t_ns) - 1)
    chain = apply_alignment(run.robot, deviation.alignment)
    yield Arm(chain, run.q, times_of(run), colour, kept=(row,), marks=cause_marks(deviation, chain))


def _reference(reference: Trajectory, shown: Deviation) -> Iterator[Path]:
    """Yield the whole reference as a line, and the point where it is at the samples of a log."""
    if shown.run.timed:
        yield Path(reference.name, reference.position, None, REFERENCE_COLOUR, asked=True)
    yield Path(
        reference.name, shown.reference, shown.axis_ns, REFERENCE_COLOUR, asked=True, sample=shown.sample,
        kept=(shown.worst_statistics_index,), line=False,
    )  # fmt: skip


def _log(deviation: Deviation, colour: str) -> Path:
    """Return the path of a compared log."""
    return Path(
        deviation.name, deviation.actual, deviation.axis_ns, colour, sample=deviation.sample,
        kept=(deviation.worst_statistics_index,), line=deviation.run.timed,
    )  # fmt: skip


def _decided(deviation: Deviation, *, several: bool) -> Spot:
    """Return the position that decided the verdict on a log, with the quantity, its value and its time."""
    whose = f", {deviation.name}" if several else ""
    worst = deviation.worst_statistics
    label = f"{format_amount(worst)} {format_time_of_max(worst)}{whose}"
    return Spot(spot_at(deviation.actual[deviation.worst_statistics_index]), label, DEVIATION_COLOUR)


def _enlarged(deviation: Deviation, radius: float) -> Path | None:
    """Return reference + factor (actual - reference) of a log; None if it is not visible.

    Only that of the log whose arm is drawn: one line per log would hide all of them.
    """
    factor = display_factor(deviation.statistics["norm"].max, radius)
    if factor is None:
        return None
    position = deviation.reference + factor * (np.asarray(deviation.actual) - deviation.reference)
    kept = (deviation.worst_statistics_index,)
    return Path(
        f"deviation x{factor}", position, deviation.t_ns, DEVIATION_COLOUR, sample=deviation.sample, kept=kept
    )


def display_factor(largest: float, radius: float) -> int | None:
    """Return the largest factor that keeps a deviation inside the scene; None if it is not visible."""
    factor = next((factor for factor in DISPLAY_FACTORS if factor * largest <= radius), None)
    return None if factor is None or factor * largest < MIN_VISIBLE * radius else factor


def _radius(arms: Sequence[Arm], paths: Sequence[Path]) -> float:
    """Return half of the diagonal around arms and paths in [m]; 1 around one point."""
    points: list[FloatArray] = [np.asarray(path.position) for path in paths]
    for arm in arms:
        rows = np.unique(np.linspace(0, len(arm.q) - 1, min(MAX_SAMPLED_POSES, len(arm.q))).astype(np.int64))
        points.append(points_over_log(arm.chain, np.asarray(arm.q)[rows]).reshape(-1, 3))
    low = np.min([np.nanmin(part, axis=0) for part in points if np.isfinite(part).any()], axis=0)
    high = np.max([np.nanmax(part, axis=0) for part in points if np.isfinite(part).any()], axis=0)
    return float(np.linalg.norm(high - low)) / 2 or 1.0


def residual_figure(deviation: Deviation) -> Iterator[Figure]:
    """Yield the residual per axis, or per joint, if the diagnosis names a cause.

    It has a separate figure because it is often far smaller than the deviation.
    """
    diagnosis = deviation.diagnosis
    if diagnosis is None or not diagnosis.causes:
        return
    over = "time" if deviation.run.timed else "the rows"
    yield Figure(
        f"Deviation over {over} without the causes",
        "The deviation that remains without the causes above. Dashed: the tolerance; tinted: out of it.",
        f"Deviation of {deviation.name} over {over} without the causes: {diagnosis.summary}."
        f" Remaining: {format_residual(diagnosis.unexplained, diagnosis.unit)}.",
        (View("delta without the causes", tuple(_residual_panels(deviation, diagnosis))),),
        share=3.0,
        beside=True,
        folded=True,
    )


def _residual_panels(deviation: Deviation, diagnosis: Diagnosis) -> Iterator[Panel]:
    """Yield one panel per axis or joint; panels of one unit share their scale."""
    quantities = list(deviation.joint_statistics.values())
    names = [f"Δ {joint.quantity}" for joint in quantities]
    colours = [joint_colour(k) for k in range(len(quantities))]
    if diagnosis.unit == "m":
        quantities = [deviation.statistics[axis] for axis in AXES[:3]]
        names, colours = ([look[axis] for axis in AXES[:3]] for look in (SYMBOLS, AXIS_COLOURS))
    residual = np.asarray(diagnosis.residual)
    largest = np.nanmax(np.abs(residual), axis=0, initial=0.0).tolist()
    for k, (name, colour, quantity) in enumerate(zip(names, colours, quantities, strict=True)):
        label = f"{name} without the causes"
        line = _line(deviation, residual[:, k], (label,), (colour,), diagnosis.sample)
        same_unit = [
            most for most, other in zip(largest, quantities, strict=True) if other.unit == quantity.unit
        ]
        yield Panel(
            name,
            quantity.unit,
            (line,),
            deviation.axis_ns,
            quantity.tolerance,
            small=True,
            close=max(same_unit),
        )


def corrected_path(deviation: Deviation) -> Iterator[Path]:
    """Yield the path of the log without the causes, reference - residual, if the residual is in space."""
    diagnosis = deviation.diagnosis
    if diagnosis is None or not diagnosis.causes or diagnosis.unit != "m":
        return
    rows, compared, diagnosed = np.intersect1d(deviation.sample, diagnosis.sample, return_indices=True)
    position = np.asarray(deviation.reference)[compared] - np.asarray(diagnosis.residual)[diagnosed]
    timed = deviation.run.timed
    t_ns = deviation.t_ns[compared] if timed else None
    yield Path("without the causes", position, t_ns, CORRECTED_COLOUR, supposed=True, sample=rows, line=timed)


def cause_marks(deviation: Deviation, chain: Chain) -> tuple[ArmMark, ...]:
    """Return the joints and segments that causes name, as texts at the arm."""
    joints = [joint.name for joint in chain.joints]
    texts_by_place: dict[tuple[int, bool], list[str]] = {}
    for cause in deviation.diagnosis.causes if deviation.diagnosis is not None else ():
        places = [(joints.index(name), False) for name in joint_names(cause) if name in joints]
        if cause.segment in chain.point_names:
            places = [(chain.point_names.index(cause.segment) + 1, True)]
        for place in places:
            texts_by_place.setdefault(place, []).append(format_cause(cause))
    return tuple(
        ArmMark(point, text.join_list(texts), DEVIATION_COLOUR, segment)
        for (point, segment), texts in texts_by_place.items()
    )
