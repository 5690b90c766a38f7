"""How a comparison is presented: the verdict, its facts, then one section per log, then the baseline."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.identification import Twist, apply_twists_to_frames
from urmpipe_models.math3d import Transform
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import apply_alignment, format_alignment, frame_to_option
from urmpipe_pipeline.comparison.baseline import baseline_checks, baseline_section, worse_facts
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Share
from urmpipe_pipeline.comparison.figures import (
    comparison_scene,
    deviation_figures,
    overview_figure,
    path_figure,
    speed_scatter,
)
from urmpipe_pipeline.comparison.iso_presenter import present_test
from urmpipe_pipeline.comparison.tables import (
    MEANING,
    comparison_lines,
    max_place,
    max_value,
    ranking_tables,
    share_value,
    statistics_rows,
    statistics_tables,
)
from urmpipe_pipeline.comparison.verdict import (
    UNITS,
    absolute_symbol,
    format_amount,
    format_decisive,
    format_interval,
    format_out_of_tolerance,
    format_time_of_max,
    format_tolerance,
    format_utilisation,
    format_verdict,
    quantity_name,
)
from urmpipe_pipeline.comparison.warnings import is_stationary
from urmpipe_pipeline.diagnosis import presenter as diagnosis_presenter
from urmpipe_pipeline.diagnosis.causes import Cause
from urmpipe_pipeline.diagnosis.diagnose import MIN_SAMPLES
from urmpipe_pipeline.diagnosis.presenter import diagnosis_facts, diagnosis_tables
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.presentation.palette import run_colour
from urmpipe_pipeline.presentation.parts import inputs_table, minute, provenance_table, recording_fact
from urmpipe_pipeline.presentation.section import (
    Advice,
    Block,
    Check,
    Event,
    Fact,
    Level,
    Presentation,
    Ref,
    Section,
    Value,
)
from urmpipe_pipeline.runs.parts import log_events, log_facts, log_tables
from urmpipe_pipeline.runs.playback import playback_figures
from urmpipe_pipeline.trajectories import Sync


def present(comparison: Comparison) -> Presentation:
    """Return the presentation of a comparison."""
    if comparison.iso is not None:
        return present_test(comparison, comparison.iso)
    worst = comparison.worst
    colour = run_colour(comparison.runs.index(worst))
    return Presentation(
        name=comparison.name,
        headline=format_verdict(comparison),
        verdict=comparison.verdict,
        facts=(*cause_facts(comparison), *decisive_facts(worst, colour), *_against(comparison)),
        body=_body(comparison),
        opens_at_ns=int(worst.t_ns[worst.worst_statistics_index]) if worst.run.timed else 0,
        opens_at_row=None if worst.run.timed else worst.worst_statistics.sample_max,
        scene=partial(comparison_scene, comparison) if worst.statistics else None,
        lines=tuple(comparison_lines(comparison)),
        rows=partial(statistics_rows, comparison),
        created=comparison.provenance.created,
        word="incomplete" if comparison.verdict is None else "",
    )


def present_diagnosis(diagnosis: Diagnosis) -> Presentation:
    """Return the presentation of a diagnosis, with the parameters of its comparison that remove causes."""
    comparison = diagnosis.comparison
    runs = comparison.runs if isinstance(comparison, Comparison) else ()
    hints = [hint for run in runs if run.name == diagnosis.name for hint in remedy_hints(run)]
    return diagnosis_presenter.present(diagnosis, hints)


def _against(comparison: Comparison) -> tuple[Fact, ...]:
    """Return the quantities worse than a baseline, the reference and the tolerance.

    The tolerance of joints is in the units of those compared.
    """
    units = {
        statistics.unit for deviation in comparison.runs for statistics in deviation.joint_statistics.values()
    }
    since = comparison.baseline
    return (
        *(worse_facts(since) if since is not None and since.verdict == "fail" else ()),
        Fact("Reference", comparison.reference.name, brief=False),
        Fact("Tolerance", format_tolerance(comparison.tolerance, units or {"rad"}), brief=False),
    )


def _body(comparison: Comparison) -> Section:
    sections = [_log_section(deviation, comparison) for deviation in comparison.runs]
    for log in comparison.failed_logs:
        sections.append(Section(log.name, errors=log.errors, rank=len(sections)))
    if comparison.baseline is not None:
        sections.append(baseline_section(comparison.baseline, len(sections)))
    return Section(
        f"Comparison {comparison.name}",
        comparison.verdict,
        (
            *(replace(fact, page=False) for fact in _against(comparison)),
            Fact("Reference samples", Value(len(comparison.reference.t_ns)), brief=False, page=False),
            Fact("Made", minute(comparison.provenance), brief=False),
            recording_fact(comparison.recording),
        ),
        ranking_tables(comparison),
        blocks=partial(_overview, comparison),
        warnings=comparison.general_warnings,
        sections=tuple(sections),
    )


def _overview(comparison: Comparison) -> Iterator[Block]:
    """Yield the figure of all logs on a page, the files, and how the comparison was made."""
    yield from overview_figure(comparison)
    yield inputs_table("Reference files", comparison.reference.files)
    yield provenance_table(comparison.provenance, kinds=UNITS)


def _log_section(deviation: Deviation, comparison: Comparison) -> Section:
    """Return the section of a compared log."""
    return Section(
        deviation.name,
        deviation.verdict,
        tuple(deviation_facts(deviation, comparison)),
        (
            *(diagnosis_tables(deviation.diagnosis) if deviation.diagnosis else ()),
            *statistics_tables(deviation, ranked=len(comparison.runs) > 1),
        ),
        partial(deviation_figures, deviation),
        partial(_page, deviation),
        tuple(_checks(comparison, deviation)),
        _properties(comparison, deviation),
        partial(_events, deviation),
        comparison.warnings_of(deviation),
        rank=comparison.ranking.index(deviation),
        opened=deviation is comparison.worst,
    )


def _checks(comparison: Comparison, deviation: Deviation) -> Iterator[Check]:
    """Yield the checks of a log: its tolerances, then its quantities against the baseline."""
    for statistics in deviation.all_statistics:
        if statistics.verdict is not None:
            has_row = deviation.run.timed and not statistics.missing
            row = f" (row {deviation.row(statistics)})" if has_row else ""
            out = format_out_of_tolerance(statistics.out_of_tolerance or 0, len(deviation.sample))
            failure = f"{format_decisive(statistics)}{row}; out of tolerance: {out}"
            message = failure if statistics.verdict == "fail" else ""
            yield Check(quantity_name(statistics), statistics.verdict, message, deviation.name)
    for share in deviation.shares.values():
        if share.verdict is not None:
            message = format_decisive(share) if share.verdict == "fail" else ""
            yield Check(share.quantity, share.verdict, message, deviation.name)
    if comparison.baseline:
        yield from baseline_checks(comparison.baseline, deviation.name)


def _properties(comparison: Comparison, deviation: Deviation) -> dict[str, Any]:
    """Return the properties of a log, and every field of the statistics of each quantity."""
    longest = deviation.longest_out_interval
    return {
        "reference": comparison.reference.name,
        "robot": deviation.run.robot.name if deviation.run.robot else None,
        "verdict": deviation.verdict,
        **({"cause": deviation.diagnosis.summary} if deviation.diagnosis else {}),
        "assumptions": "; ".join(comparison.assumptions),
        "duration": deviation.duration if deviation.run.timed else None,
        "samples": len(deviation.sample),
        "left_out": deviation.left_out,
        "reference_left_out": deviation.reference_left_out,
        "sync_offset": deviation.sync.offset if deviation.run.timed else None,
        "out_fraction": deviation.out_fraction,
        "longest_out_interval": 0.0 if longest is None else longest.duration,
        "speed_correlation": deviation.speed_correlation,
    } | {
        f"{quantity_name(statistics)}.{field}": value
        for statistics in deviation.quantities
        for field, value in statistics.fields().items()
    }


def _page(deviation: Deviation) -> Iterator[Block]:
    """Yield the figures and tables of a compared log that only a page shows."""
    yield from path_figure(deviation)
    yield from speed_scatter(deviation)
    yield from (replace(figure, folded=True) for figure in playback_figures(deviation.run))
    yield from (replace(table, folded=True) for table in log_tables(deviation.run))


def _events(deviation: Deviation) -> Iterator[Event]:
    """Yield the clocks and the alignment of a log, its events, and its largest deviation."""
    start = int(deviation.t_ns[0]) if deviation.run.timed else None
    if deviation.sync.mode != "start":
        yield Event(start, f"clocks: {', '.join(format_sync(deviation.sync))}")
    if deviation.alignment.mode != "none":
        yield Event(start, f"alignment: {'; '.join(format_alignment(deviation))}")
    if deviation.left_out:
        total = deviation.left_out + len(deviation.sample)
        yield Event(
            start, f"{deviation.left_out} of {total} samples left out: no reference or no value", "warning"
        )
    yield from log_events(deviation.run)
    level: Level = "info" if deviation.verdict == "pass" else "error"
    if (
        (longest := deviation.longest_out_interval) is not None
        and longest.t is not None
        and longest.duration is not None
    ):
        lasts = f"{longest.samples} samples, {text.format_seconds(longest.duration)} s"
        yield Event(round(longest.t * 1e9), f"longest stretch out of tolerance begins: {lasts}", level)
    worst, timed = deviation.worst_statistics, deviation.run.timed
    if isinstance(deviation.decisive, Share):
        yield Event(start, f"decides: {format_decisive(deviation.decisive)}", level)
    elif worst.tolerance is not None:
        at = round(worst.t_max * 1e9) if timed else None
        yield Event(
            at,
            f"decides: {format_amount(worst)}{'' if timed else f' {format_time_of_max(worst)}'}",
            level,
        )
    if not deviation.statistics:
        return
    x, y, z, norm = (text.format_quantity(float(value), "m") for value in deviation.delta[deviation.worst])
    message = f"largest deviation: {norm} (x {x}, y {y}, z {z})"
    row = "" if timed else f" in row {deviation.sample[deviation.worst] + 1}"
    yield Event(int(deviation.t_ns[deviation.worst]) if timed else None, f"{message}{row}", level)


MAX_LEADING = 3  # logs whose causes are at the top of a page; tables and sections have the others


def cause_facts(comparison: Comparison) -> Iterator[Fact]:
    """Yield the diagnosed causes of the logs that deviate most."""
    for deviation in _leading(comparison) or [comparison.worst]:
        if deviation.diagnosis is not None and deviation.decisive is deviation.worst_statistics:
            cause = diagnosis_facts(deviation.diagnosis)[0]
            name = f"{cause.name} of {deviation.name}" if len(comparison.runs) > 1 else cause.name
            yield replace(cause, name=name, page=deviation.verdict == "fail")


def decisive_facts(deviation: Deviation, colour: str) -> Iterator[Fact]:
    """Yield the quantity that decided the verdict: its value, time and place."""
    decisive, worst = deviation.decisive, deviation.worst_statistics
    yield Fact("Decisive log", Ref(deviation.name, colour))
    yield Fact("Decided by", format_decisive(decisive), page=False)
    short = ", ".join(filter(None, (absolute_symbol(decisive), format_utilisation(decisive))))
    yield Fact("Decided by", short, brief=False)
    if decisive is worst:
        if not worst.missing and deviation.run.timed:
            yield Fact("Data row", Value(deviation.row(worst)), page=False)
        yield Fact("Position", max_place(deviation, worst), page=False)
    yield from _worst_joint_fact(deviation)
    yield from (replace(fact, page=False) for fact in _undiagnosed(deviation))


def _leading(comparison: Comparison) -> list[Deviation]:
    """Return the logs whose causes are at the top of a page: those that fail, the worst first."""
    known = (deviation for deviation in reversed(comparison.ranking) if deviation.diagnosis is not None)
    return [
        deviation
        for deviation in known
        if deviation.verdict == "fail" and deviation.decisive is deviation.worst_statistics
    ][:MAX_LEADING]


def deviation_facts(deviation: Deviation, comparison: Comparison) -> Iterator[Fact]:
    """Yield the facts of a compared log, starting with the decisive quantity."""
    decisive, timed = deviation.decisive, deviation.run.timed
    if isinstance(decisive, Share):
        yield Fact(decisive.quantity, share_value(decisive), brief=False, page=False)
    else:
        name, used = absolute_symbol(decisive), format_utilisation(decisive)
        yield Fact(name, max_value(decisive), used, brief=False, page=False)
        if timed:
            yield Fact("Time", Value(decisive.t_max, "s"), brief=False, page=False)
        yield Fact("Data row", Value(deviation.row(decisive)), brief=False)
        yield Fact("Position", max_place(deviation, decisive), brief=False)
    ranked = len(comparison.runs) > 1  # a table at the top of the page has the log's verdict
    yield from (replace(fact, brief=False) for fact in _worst_joint_fact(deviation))
    compared = f"{format_count(len(deviation.sample), 'pose')}, row by row"
    if timed:
        samples = format_count(len(deviation.sample), "sample")
        compared = f"{samples} over {text.format_seconds(deviation.duration)} s"
    yield Fact("Compared", compared)
    for share in deviation.shares.values():
        seen = f"{share.samples} of {format_count(share.total, 'sample')}"
        name, words = share.quantity.capitalize(), f"{MEANING[share.quantity]}: {seen}"
        yield Fact(name, share_value(share), words, share in deviation.incomplete_shares, page=False)
    yield _left_out(deviation, len(comparison.reference.t_ns))
    yield from _out_of_tolerance(deviation, ranked=ranked)
    if timed:
        yield Fact("Clocks", *format_sync(deviation.sync))
    yield Fact("Turns removed", _turns(deviation), "whole turns counted differently at the start")
    yield from _alignment(deviation)
    yield Fact("Joint tolerance", _sliding(deviation))
    if (r := deviation.speed_correlation) is not None:
        yield Fact("r(‖Δ‖, speed)", Value(r, "1", signed=True), "1: they grow together; 0: no correlation")
    yield from _why(deviation, comparison)
    for fact in log_facts(deviation.run):
        counted = fact.name in ("Rows", "Grid", "Duration")  # what was compared says so
        yield replace(fact, brief=fact.name == "Robot", page=not counted)


def _why(deviation: Deviation, comparison: Comparison) -> Iterator[Fact]:
    """Yield the causes of the deviation of a log, or the command that finds them."""
    if deviation.diagnosis is not None:
        several = len(comparison.runs) > 1  # else the answer is next to the verdict
        answer, *further = diagnosis_facts(deviation.diagnosis, remedy_hints(deviation))
        for fact in (replace(answer, page=deviation not in _leading(comparison)), *further):
            yield replace(fact, brief=fact.brief and several)
    yield from (replace(fact, brief=False) for fact in _undiagnosed(deviation))


def _undiagnosed(deviation: Deviation) -> Iterator[Fact]:
    """Yield the command that finds why a log deviates by more than its tolerance.

    Nothing if that is known, with an alignment, or if a diagnosis finds nothing: in one pose, or in few.
    """
    is_diagnosable = len(deviation.sample) >= MIN_SAMPLES and not is_stationary(deviation)
    failed = deviation.worst_statistics.verdict == "fail"
    if failed and deviation.diagnosis is None and deviation.alignment.mode == "none" and is_diagnosable:
        yield Fact("Cause", "urmpipe diagnose with the same arguments searches for it")


def format_sync(sync: Sync) -> tuple[str, str]:
    """Return the relation of two clocks, and its origin."""
    if sync.mode == "start":
        return "aligned at the first sample", ""
    sign = "-" if sync.offset < 0.0 else "+"
    within = "" if sync.precision is None else f" ± {text.format_standard_error(sync.precision)}"
    relation = f"t_reference = t_log {sign} {abs(sync.offset):.6g} s{within}"
    if sync.mode in ("given", "stamps"):
        return relation, "as given" if sync.mode == "given" else "by absolute stamps on both sides"
    similarity = "" if sync.similarity is None else f", similarity {sync.similarity:.4f}"
    return relation, f"estimated from {sync.by or 'the motion'}{similarity}"


def _worst_joint_fact(deviation: Deviation) -> Iterator[Fact]:
    """Yield the joint that deviates most, of a log that is decided by something else."""
    joint = deviation.worst_joint("rad") or deviation.worst_joint("m")
    if joint is not None and deviation.worst_statistics.kind != "joint" and joint.max:
        message = f"{joint.quantity}: {text.format_quantity(joint.max, joint.unit)}"
        yield Fact("Largest joint deviation", message, page=False)


def _left_out(deviation: Deviation, reference_samples: int) -> Fact:
    total = format_count(deviation.left_out + len(deviation.sample), "sample")
    counts = f"{deviation.left_out} of {total} of the log"
    counts += f", {deviation.reference_left_out} of {reference_samples} of the reference"
    some = bool(deviation.left_out or deviation.reference_left_out)
    return Fact("Not compared", counts, "no counterpart, or no value", some, page=some)


def _out_of_tolerance(deviation: Deviation, *, ranked: bool) -> Iterator[Fact]:
    out = int(np.count_nonzero(deviation.out_of_tolerance))
    yield Fact(
        "Out of tolerance",
        format_out_of_tolerance(out, len(deviation.sample)),
        brief=out > 0,
        page=not ranked,
    )
    if longest := deviation.longest_out_interval:
        yield Fact("Longest interval out of tolerance", format_interval(longest))


def _turns(deviation: Deviation) -> str:
    counts = zip(deviation.joint_statistics, deviation.joint_turns, strict=True)
    return ", ".join(f"{name} {count:+d}" for name, count in counts if count)


def _alignment(deviation: Deviation) -> Iterator[Fact]:
    """Yield the alignment of a log, and the option that applies it permanently."""
    mode = deviation.alignment.mode
    yield Fact("Alignment", *format_alignment(deviation), brief=mode != "none")
    if mode in ("tool", "base+tool") and deviation.run.robot is not None:
        arm = apply_alignment(deviation.run.robot, deviation.alignment)
        hints = [Hint("tool", _given(arm.tool))]
        if mode == "base+tool":
            moved = Hint("base", _given(arm.base), "moves the arm")
            hints = [moved, replace(hints[0], effect="moves its tool as well")]
        yield Fact("To apply this permanently", Advice(hints=tuple(hints)))


def remedy_hints(deviation: Deviation) -> list[Hint]:
    """Return the parameters that remove causes of a diagnosed log, with their complete new values."""
    diagnosis, robot = deviation.diagnosis, deviation.run.robot
    if diagnosis is None or diagnosis.unexplained.is_unrelated_motion:
        return []
    hints = []
    for cause in diagnosis.causes:
        if cause.kind == "time_lag":
            hints.append(Hint("sync", round(deviation.sync.offset + cause.value[0], 6), "aligns the clocks"))
        elif cause.kind == "joint_unit":
            unit = "deg" if cause.value[0] < 1.0 else "rad"
            hints.append(Hint("unit", dict.fromkeys(cause.joints, unit), "reads the joints in this unit"))
        elif cause.kind == "other_robot":
            hints.append(Hint("robot", cause.name, "selects this robot"))
    by_joints = all("joint_offset" not in untested.kinds for untested in diagnosis.untested)
    if robot is not None and by_joints:  # poses that a log recorded have another base and tool than its arm
        base, tool = _corrected_frames(diagnosis.causes, robot.base, robot.tool)
        hints += [Hint("base", _given(base), "sets this base")] if base != robot.base else []
        hints += [Hint("tool", _given(tool), "sets this tool")] if tool != robot.tool else []
    return hints


def _corrected_frames(causes: Sequence[Cause], base: Transform, tool: Transform) -> list[Transform]:
    """Return a base and a tool to which the shifts and then the turns of causes are added."""
    at_base = Transform(translation=base.translation)  # shifted and turned in the world, about its origin
    changes: list[tuple[Twist, float]] = []
    # shifts, then fitted turns, then the quarter and half turns that these are fitted after
    for cause in sorted(causes, key=lambda cause: (cause.kind.endswith("rotation"), not cause.low)):
        if cause.kind in ("base_shift", "base_rotation", "tool_shift", "tool_rotation"):
            place, frame = (0, at_base) if cause.kind.startswith("base") else (1, tool)
            turns = cause.kind.endswith("rotation")
            axes = [cause.axis] if cause.axis else [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
            added = [
                (Twist(place, "about" if turns else "along", axis, frame), value)
                for axis, value in zip(axes, cause.value, strict=True)
            ]
            changes += reversed(added) if turns else added  # rx, ry, rz of Rz Ry Rx
    return apply_twists_to_frames((base, tool), changes)[0]


def _given(frame: Transform) -> list[float]:
    """Return a frame as an option takes it, to a tenth of a micrometre."""
    return [round(value, 7) + 0.0 for value in frame_to_option(frame)]  # + 0.0: no -0.0


def _sliding(deviation: Deviation) -> str:
    """Return the tolerance of prismatic joints; empty without any."""
    sliding = [
        statistics
        for statistics in deviation.joint_statistics.values()
        if statistics.unit == "m" and statistics.tolerance
    ]
    if not sliding:
        return ""
    names = ", ".join(statistics.quantity for statistics in sliding)
    return f"in m for prismatic joints: {names} {text.format_limit(sliding[0].tolerance)} mm"
