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
        yield from residual_figure(one)
    yield from _joints(one)
    if not one.statistics:
        yield from residual_figure(one)
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
    spots = (*ends(one.actual), Spot(place, format_peak(one), DEVIATION_COLOUR))
    decided = "The verdict was decided" if isinstance(one.decisive, Statistics) else "It deviates most"
    if not one.run.timed:
        arrows = deviation_arrows(one, extent(one.actual) / 2)
        yield SpaceFigure(
            "Poses in space",
            f"Equal scale on all axes. A dot is where a pose was asked for, the arrow from it"
            f" the {arrows.name}, in the colour of its size.",
            f"Poses of {one.name} in three dimensions, each with its deviation as an arrow."
            f" {decided} at x, y, z = {text.format_point(place)} m: {format_amount(one.worst_statistics)}.",
            (),
            spots[2:],
            arrows,
        )
        return
    supposed = tuple(corrected_path(one))
    said = "The colour is the distance from the reference at the same time"
    said += ": blue within the tolerance, orange to crimson beyond it." if norm_tolerance(one) else "."
    said += " Green, dashed: where the log would be without the causes named above." if supposed else ""
    yield SpaceFigure(
        "Path in space",
        said,
        f"Paths of the reference and of {one.name} in three dimensions. {decided} at"
        f" x, y, z = {text.format_point(place)} m: {format_amount(one.worst_statistics)}.",
        (
            Path("reference", one.reference, one.t_ns, REFERENCE_COLOUR, asked=True, sample=one.sample),
            *supposed,
            Path(
                "actual: ‖Δ‖", one.actual, one.t_ns, AXIS_COLOURS["norm"], values=column(one.delta, 3),
                limit=norm_tolerance(one), sample=one.sample, kept=(one.worst_statistics_index,),
            ),
        ),
        spots,
    )  # fmt: skip


def speed_scatter(one: Deviation) -> Iterator[Figure]:
    """Yield the norm over the speed of the tool centre point; nothing where the speed is not known."""
    if not np.isfinite(one.speed).any():
        return
    said = format_correlation(one.speed_correlation)
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


def format_correlation(r: float | None) -> str:
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
        f"{symbol(held)} {text.format_quantity(held.max, held.unit)} {format_time_of_max(held)}"
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


def _line(
    one: Deviation, values: FloatArray, names: tuple[str, ...], colours: tuple[str, ...],
    sample: IntArray | None = None,
) -> Line:  # fmt: skip
    """Return values at the compared samples, or at rows of the log, over time; static poses as points."""
    if one.run.timed:
        t_ns = one.t_ns if sample is None else np.asarray(one.run.log.t_ns)[sample]
        return Line(values, names, colours, t_ns=t_ns)
    by_row = np.full((one.run.log.rows, *values.shape[1:]), np.nan)
    by_row[one.sample if sample is None else sample] = values
    return Line(by_row, names, colours, points=True)


def _instant(one: Deviation) -> dict[int, str]:
    """Return when the verdict was decided, or the log deviates most."""
    if not one.run.timed:
        return {
            one.worst_statistics.sample_max: f"{format_peak(one)} {format_time_of_max(one.worst_statistics)}"
        }
    return {
        int(
            one.t_ns[one.worst_statistics_index]
        ): f"{format_peak(one)} at {text.format_seconds(one.worst_statistics.t_max)} s"
    }


def _out_words(one: Deviation) -> str:
    """Say how much of the log is out of tolerance."""
    if all(held.tolerance is None for held in one.all_statistics):
        return "There is no tolerance."
    return f"Out of tolerance: {text.format_percent(one.out_fraction)} of the samples."


FACTORS = (50, 20, 10, 5, 2)
"""How many times a deviation may be drawn, the usual one first."""

MIN_VISIBLE = 0.005
"""An enlarged deviation below this share of the scene's radius lies within the width of the lines."""

MAX_ARROWS = 20_000
"""Poses whose deviation is drawn as an arrow."""

POSES = 1000
"""Poses from which the extent of the scene is told."""


def comparison_scene(result: Comparison) -> Scene:
    """Return the arm of the worst log, the reference, all logs, and the worst log's deviation enlarged."""
    shown = select_shown_log(result)
    index, several = result.runs.index(shown), len(result.runs) > 1
    arms = tuple(_arm(shown, run_colour(index)))
    paths = [
        *_reference(result.reference, shown),
        *(_log(one, run_colour(i)) for i, one in enumerate(result.runs)),
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
    said = f", in crimson the {larger.name}" if larger else ""
    return Scene(f"{whose} and paths [m]{said}", arms, tuple(paths), spots)


def deviation_arrows(one: Deviation, radius: float) -> Arrows:
    """Return the deviation of each pose, enlarged as far as a scene of a radius in [m] allows.

    Of very many poses those that deviate most are drawn.
    """
    factor = display_factor(one.statistics["norm"].max, radius) or 1
    size = np.asarray(one.delta[:, 3])
    drawn = np.sort(np.argsort(-size, kind="stable")[:MAX_ARROWS])
    start = np.asarray(one.reference)[drawn]
    end = start + factor * (np.asarray(one.actual)[drawn] - start)
    sample = np.asarray(one.sample)[drawn]
    return Arrows(f"deviation drawn x{factor}", start, end, size[drawn], sample, limit=norm_tolerance(one))


def norm_tolerance(one: Deviation) -> float | None:
    """Return what is allowed of the norm in [m]: its tolerance, else the least of an axis; None without."""
    norm = one.statistics["norm"].tolerance
    axes = [found for axis in AXES[:3] if (found := one.statistics[axis].tolerance) is not None]
    return min(axes, default=None) if norm is None else norm


def select_shown_log(result: Comparison) -> Deviation:
    """Return the compared log whose arm is drawn: the worst that has kinematics, else the worst."""
    worst_first = sorted(result.runs, key=tolerance_sort_key)[::-1]
    return next((one for one in worst_first if one.run.tcp is not None), worst_first[0])


def _arm(one: Deviation, colour: str) -> Iterator[Arm]:
    """Yield the arm of a log where the alignment puts it; nothing without kinematics."""
    run = one.run
    if run.robot is None or run.tcp is None:
        return
    decided = int(one.t_ns[one.worst_statistics_index])
    row = min(int(np.searchsorted(run.t_ns, decided)), len(run.t_ns) - 1)
    chain = apply_alignment(run.robot, one.alignment)
    yield Arm(chain, run.q, times_of(run), colour, kept=(row,), marks=cause_marks(one, chain))


def _reference(reference: Trajectory, shown: Deviation) -> Iterator[Path]:
    """Yield the whole reference as a line, and the point where it is at the samples of a log."""
    if shown.run.timed:
        yield Path(reference.name, reference.position, None, REFERENCE_COLOUR, asked=True)
    yield Path(
        reference.name, shown.reference, shown.axis_ns, REFERENCE_COLOUR, asked=True, sample=shown.sample,
        kept=(shown.worst_statistics_index,), line=False,
    )  # fmt: skip


def _log(one: Deviation, colour: str) -> Path:
    """Return where a compared log was."""
    return Path(
        one.name, one.actual, one.axis_ns, colour, sample=one.sample, kept=(one.worst_statistics_index,),
        line=one.run.timed,
    )  # fmt: skip


def _decided(one: Deviation, *, several: bool) -> Spot:
    """Return where the verdict on a log was decided: by what, how much and when."""
    whose = f", {one.name}" if several else ""
    said = f"{format_amount(one.worst_statistics)} {format_time_of_max(one.worst_statistics)}{whose}"
    return Spot(spot_at(one.actual[one.worst_statistics_index]), said, DEVIATION_COLOUR)


def _enlarged(one: Deviation, radius: float) -> Path | None:
    """Return reference + factor (actual - reference) of a log; None where it shows nothing.

    Only that of the log whose arm is drawn: a line a log would hide all of them.
    """
    factor = display_factor(one.statistics["norm"].max, radius)
    if factor is None:
        return None
    position = one.reference + factor * (np.asarray(one.actual) - one.reference)
    kept = (one.worst_statistics_index,)
    return Path(f"deviation x{factor}", position, one.t_ns, DEVIATION_COLOUR, sample=one.sample, kept=kept)


def display_factor(largest: float, radius: float) -> int | None:
    """Return the largest factor that keeps a deviation inside the scene; None where none makes it seen."""
    factor = next((factor for factor in FACTORS if factor * largest <= radius), None)
    return None if factor is None or factor * largest < MIN_VISIBLE * radius else factor


def _radius(arms: Sequence[Arm], paths: Sequence[Path]) -> float:
    """Return half of the diagonal around arms and paths in [m]; 1 around one point."""
    points: list[FloatArray] = [np.asarray(path.position) for path in paths]
    for arm in arms:
        rows = np.unique(np.linspace(0, len(arm.q) - 1, min(POSES, len(arm.q))).astype(np.int64))
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
        "What stays when the causes above are taken away. Dashed: the tolerance; tinted: out of it.",
        f"Deviation of {deviation.name} over {over} without the causes: {diagnosis.summary}."
        f" What stays: {format_residual(diagnosis.unexplained, diagnosis.unit)}.",
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
        ArmMark(point, text.join_list(said), DEVIATION_COLOUR, segment)
        for (point, segment), said in words.items()
    )
