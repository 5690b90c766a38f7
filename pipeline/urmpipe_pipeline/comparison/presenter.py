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


def present(result: Comparison) -> Presentation:
    """Return what a comparison shows."""
    if result.iso is not None:
        return present_test(result, result.iso)
    worst = result.worst
    colour = run_colour(result.runs.index(worst))
    return Presentation(
        name=result.name,
        headline=format_verdict(result),
        verdict=result.verdict,
        facts=(*cause_facts(result), *decisive_facts(worst, colour), *_against(result)),
        body=_body(result),
        opens_at_ns=int(worst.t_ns[worst.worst_statistics_index]) if worst.run.timed else 0,
        opens_at_row=None if worst.run.timed else worst.worst_statistics.sample_max,
        scene=partial(comparison_scene, result) if worst.statistics else None,
        lines=tuple(comparison_lines(result)),
        rows=partial(statistics_rows, result),
        created=result.provenance.created,
        word="incomplete" if result.verdict is None else "",
    )


def present_diagnosis(diagnosis: Diagnosis) -> Presentation:
    """Return what a diagnosis alone shows, with the parameters of its comparison that remove causes."""
    made = diagnosis.comparison
    runs = made.runs if isinstance(made, Comparison) else ()
    hints = [hint for run in runs if run.name == diagnosis.name for hint in remedy_hints(run)]
    return diagnosis_presenter.present(diagnosis, hints)


def _against(result: Comparison) -> tuple[Fact, ...]:
    """Return what is worse than a baseline, what the reference was and what is allowed.

    That of joints is in the units of those compared.
    """
    units = {held.unit for one in result.runs for held in one.joint_statistics.values()}
    since = result.baseline
    return (
        *(worse_facts(since) if since is not None and since.verdict == "fail" else ()),
        Fact("Reference", result.reference.name, brief=False),
        Fact("Tolerance", format_tolerance(result.tolerance, units or {"rad"}), brief=False),
    )


def _body(result: Comparison) -> Section:
    sections = [_log(one, result) for one in result.runs]
    for log in result.failed_logs:
        sections.append(Section(log.name, errors=log.errors, rank=len(sections)))
    if result.baseline is not None:
        sections.append(baseline_section(result.baseline, len(sections)))
    return Section(
        f"Comparison {result.name}",
        result.verdict,
        (
            *(replace(fact, page=False) for fact in _against(result)),
            Fact("Reference samples", Value(len(result.reference.t_ns)), brief=False, page=False),
            Fact("Made", minute(result.provenance), brief=False),
            recording_fact(result.recording),
        ),
        ranking_tables(result),
        blocks=partial(_overview, result),
        warnings=result.general_warnings,
        sections=tuple(sections),
    )


def _overview(result: Comparison) -> Iterator[Block]:
    """Yield what a page shows of all logs together, and how the comparison was made."""
    yield from overview_figure(result)
    yield inputs_table("Reference files", result.reference.files)
    yield provenance_table(result.provenance, kinds=UNITS)


def _log(one: Deviation, result: Comparison) -> Section:
    """Return the section of a compared log."""
    return Section(
        one.name,
        one.verdict,
        tuple(deviation_facts(one, result)),
        (
            *(diagnosis_tables(one.diagnosis) if one.diagnosis else ()),
            *statistics_tables(one, ranked=len(result.runs) > 1),
        ),
        partial(deviation_figures, one),
        partial(_page, one),
        tuple(_checks(result, one)),
        _properties(result, one),
        partial(_events, one),
        result.warnings_of(one),
        rank=result.ranking.index(one),
        opened=one is result.worst,
    )


def _checks(result: Comparison, one: Deviation) -> Iterator[Check]:
    """Yield the checks of a log: its tolerances, then its quantities against the baseline."""
    for held in one.all_statistics:
        if held.verdict is not None:
            row = "" if held.missing or not one.run.timed else f" (row {one.row(held)})"
            out = format_out_of_tolerance(held.out_of_tolerance or 0, len(one.sample))
            said = f"{format_decisive(held)}{row}; out of tolerance: {out}"
            yield Check(quantity_name(held), held.verdict, said if held.verdict == "fail" else "", one.name)
    for share in one.shares.values():
        if share.verdict is not None:
            said = format_decisive(share) if share.verdict == "fail" else ""
            yield Check(share.quantity, share.verdict, said, one.name)
    if result.baseline:
        yield from baseline_checks(result.baseline, one.name)


def _properties(result: Comparison, one: Deviation) -> dict[str, Any]:
    """Return what is worth keeping of a log, and every field of the statistics of each quantity."""
    longest = one.longest_out_interval
    return {
        "reference": result.reference.name,
        "robot": one.run.robot.name if one.run.robot else None,
        "verdict": one.verdict,
        **({"cause": one.diagnosis.summary} if one.diagnosis else {}),
        "assumptions": "; ".join(result.assumptions),
        "duration": one.duration if one.run.timed else None,
        "samples": len(one.sample),
        "left_out": one.left_out,
        "reference_left_out": one.reference_left_out,
        "sync_offset": one.sync.offset if one.run.timed else None,
        "out_fraction": one.out_fraction,
        "longest_out_interval": 0.0 if longest is None else longest.duration,
        "speed_correlation": one.speed_correlation,
    } | {
        f"{quantity_name(held)}.{field}": value
        for held in one.quantities
        for field, value in held.fields().items()
    }


def _page(one: Deviation) -> Iterator[Block]:
    """Yield what only a page shows of a compared log."""
    yield from path_figure(one)
    yield from speed_scatter(one)
    yield from (replace(figure, folded=True) for figure in playback_figures(one.run))
    yield from (replace(table, folded=True) for table in log_tables(one.run))


def _events(one: Deviation) -> Iterator[Event]:
    """Yield how a log was put beside the reference, what was found in it, and where it deviates most."""
    start = int(one.t_ns[0]) if one.run.timed else None
    if one.sync.mode != "start":
        yield Event(start, f"clocks: {', '.join(format_sync(one.sync))}")
    if one.alignment.mode != "none":
        yield Event(start, f"alignment: {'; '.join(format_alignment(one))}")
    if one.left_out:
        whole = one.left_out + len(one.sample)
        yield Event(start, f"{one.left_out} of {whole} samples left out: no reference or no value", "warning")
    yield from log_events(one.run)
    level: Level = "info" if one.verdict == "pass" else "error"
    if (
        (longest := one.longest_out_interval) is not None
        and longest.t is not None
        and longest.duration is not None
    ):
        lasts = f"{longest.samples} samples, {text.format_seconds(longest.duration)} s"
        yield Event(round(longest.t * 1e9), f"longest stretch out of tolerance begins: {lasts}", level)
    held, timed = one.worst_statistics, one.run.timed
    if isinstance(one.decisive, Share):
        yield Event(start, f"decides: {format_decisive(one.decisive)}", level)
    elif held.tolerance is not None:
        at = round(held.t_max * 1e9) if timed else None
        yield Event(
            at,
            f"decides: {format_amount(held)}{'' if timed else f' {format_time_of_max(held)}'}",
            level,
        )
    if not one.statistics:
        return
    x, y, z, norm = (text.format_quantity(float(value), "m") for value in one.delta[one.worst])
    said = f"largest deviation: {norm} (x {x}, y {y}, z {z})"
    row = "" if timed else f" in row {one.sample[one.worst] + 1}"
    yield Event(int(one.t_ns[one.worst]) if timed else None, f"{said}{row}", level)


LEADING = 3
"""Causes of so many logs stand at the top of a page; tables and sections have the others."""


def cause_facts(result: Comparison) -> Iterator[Fact]:
    """Yield why the logs deviate that are furthest out, where that is known."""
    for one in _leading(result) or [result.worst]:
        if one.diagnosis is not None and one.decisive is one.worst_statistics:
            cause = diagnosis_facts(one.diagnosis)[0]
            name = f"{cause.name} of {one.name}" if len(result.runs) > 1 else cause.name
            yield replace(cause, name=name, page=one.verdict == "fail")


def decisive_facts(one: Deviation, colour: str) -> Iterator[Fact]:
    """Yield what decided the verdict: how much, when and where."""
    held, furthest = one.decisive, one.worst_statistics
    yield Fact("Furthest out" if one.verdict == "fail" else "Closest to the limit", Ref(one.name, colour))
    yield Fact("Decided by", format_decisive(held), page=False)
    yield Fact(
        "Decided by", ", ".join(filter(None, (absolute_symbol(held), format_utilisation(held)))), brief=False
    )
    if held is furthest:
        if not furthest.missing and one.run.timed:
            yield Fact("Data row", Value(one.row(furthest)), page=False)
        yield Fact("Position", max_place(one, furthest), page=False)
    yield from _furthest_joint(one)
    yield from (replace(fact, page=False) for fact in _undiagnosed(one))


def _leading(result: Comparison) -> list[Deviation]:
    """Return the logs whose causes are at the top of a page: those that fail, the worst first."""
    known = (one for one in reversed(result.ranking) if one.diagnosis is not None)
    return [one for one in known if one.verdict == "fail" and one.decisive is one.worst_statistics][:LEADING]


def deviation_facts(one: Deviation, result: Comparison) -> Iterator[Fact]:
    """Yield what is to be known of a compared log, what decided first."""
    held, timed = one.decisive, one.run.timed
    if isinstance(held, Share):
        yield Fact(held.quantity, share_value(held), brief=False, page=False)
    else:
        yield Fact(absolute_symbol(held), max_value(held), format_utilisation(held), brief=False, page=False)
        if timed:
            yield Fact("Time", Value(held.t_max, "s"), brief=False, page=False)
        yield Fact("Data row", Value(one.row(held)), brief=False)
        yield Fact("Position", max_place(one, held), brief=False)
    ranked = len(result.runs) > 1  # a table at the top of the page has the log's verdict
    yield from (replace(fact, brief=False) for fact in _furthest_joint(one))
    compared = f"{format_count(len(one.sample), 'sample')} over {text.format_seconds(one.duration)} s"
    yield Fact("Compared", compared if timed else f"{format_count(len(one.sample), 'pose')}, row by row")
    for share in one.shares.values():
        seen = f"{share.samples} of {format_count(share.total, 'sample')}"
        name, words = share.quantity.capitalize(), f"{MEANING[share.quantity]}: {seen}"
        yield Fact(name, share_value(share), words, share in one.incomplete_shares, page=False)
    yield _left_out(one, len(result.reference.t_ns))
    yield from _out_of_tolerance(one, ranked=ranked)
    if timed:
        yield Fact("Clocks", *format_sync(one.sync))
    yield Fact("Turns removed", _turns(one), "whole turns counted differently at the start")
    yield from _alignment(one)
    yield Fact("Joint tolerance", _sliding(one))
    if (r := one.speed_correlation) is not None:
        yield Fact("r(‖Δ‖, speed)", Value(r, "1", signed=True), "1: they grow together; 0: no correlation")
    yield from _why(one, result)
    for fact in log_facts(one.run):
        counted = fact.name in ("Rows", "Grid", "Duration")  # what was compared says so
        yield replace(fact, brief=fact.name == "Robot", page=not counted)


def _why(one: Deviation, result: Comparison) -> Iterator[Fact]:
    """Yield why a log deviates, or what says so."""
    if one.diagnosis is not None:
        several = len(result.runs) > 1  # else the answer stands with the verdict
        answer, *others = diagnosis_facts(one.diagnosis, remedy_hints(one))
        for fact in (replace(answer, page=one not in _leading(result)), *others):
            yield replace(fact, brief=fact.brief and several)
    yield from (replace(fact, brief=False) for fact in _undiagnosed(one))


def _undiagnosed(one: Deviation) -> Iterator[Fact]:
    """Yield what says why a log deviates by more than its tolerance.

    Nothing if that is known, with an alignment, or where a diagnosis finds nothing: in one pose, or in few.
    """
    told = len(one.sample) >= MIN_SAMPLES and not is_stationary(one)
    failed = one.worst_statistics.verdict == "fail"
    if failed and one.diagnosis is None and one.alignment.mode == "none" and told:
        yield Fact("Cause", Advice(hints=(Hint("diagnose", True, "says why"),)))


def format_sync(sync: Sync) -> tuple[str, str]:
    """Return how two clocks were put together, and how that was found."""
    if sync.mode == "start":
        return "aligned at the first sample", ""
    sign = "-" if sync.offset < 0.0 else "+"
    within = "" if sync.precision is None else f" ± {text.format_standard_error(sync.precision)}"
    said = f"t_reference = t_log {sign} {abs(sync.offset):.6g} s{within}"
    if sync.mode in ("given", "stamps"):
        return said, "as given" if sync.mode == "given" else "by absolute stamps on both sides"
    alike = "" if sync.similarity is None else f", similarity {sync.similarity:.4f}"
    return said, f"estimated from {sync.by or 'the motion'}{alike}"


def _furthest_joint(one: Deviation) -> Iterator[Fact]:
    """Yield the joint that deviates most, of a log that is decided by something else."""
    joint = one.worst_joint("rad") or one.worst_joint("m")
    if joint is not None and one.worst_statistics.kind != "joint" and joint.max:
        said = f"{joint.quantity}: {text.format_quantity(joint.max, joint.unit)}"
        yield Fact("Joint furthest off", said, page=False)


def _left_out(one: Deviation, reference_samples: int) -> Fact:
    own = f"{one.left_out} of {format_count(one.left_out + len(one.sample), 'sample')}"
    theirs = f"{one.reference_left_out} of {reference_samples} of the reference"
    some = bool(one.left_out or one.reference_left_out)
    return Fact("Left out", f"{own}, {theirs}", "no counterpart, or no value", some, page=some)


def _out_of_tolerance(one: Deviation, *, ranked: bool) -> Iterator[Fact]:
    out = int(np.count_nonzero(one.out_of_tolerance))
    yield Fact(
        "Out of tolerance", format_out_of_tolerance(out, len(one.sample)), brief=out > 0, page=not ranked
    )
    if longest := one.longest_out_interval:
        yield Fact("Longest stretch out", format_interval(longest))


def _turns(one: Deviation) -> str:
    counts = zip(one.joint_statistics, one.joint_turns, strict=True)
    return ", ".join(f"{name} {count:+d}" for name, count in counts if count)


def _alignment(one: Deviation) -> Iterator[Fact]:
    """Yield how a log was moved in space, and the option that does so permanently."""
    mode = one.alignment.mode
    yield Fact("Alignment", *format_alignment(one), brief=mode != "none")
    if mode in ("tool", "base+tool") and one.run.robot is not None:
        arm = apply_alignment(one.run.robot, one.alignment)
        hints = [Hint("tool", _given(arm.tool))]
        if mode == "base+tool":
            moved = Hint("base", _given(arm.base), "moves the arm")
            hints = [moved, replace(hints[0], effect="moves its tool as well")]
        yield Fact("To apply this permanently", Advice(hints=tuple(hints)))


def remedy_hints(one: Deviation) -> list[Hint]:
    """Return the parameters that remove causes of a diagnosed log, with their complete new values."""
    diagnosis, robot = one.diagnosis, one.run.robot
    if diagnosis is None or diagnosis.unexplained.is_unrelated_motion:
        return []
    hints = []
    for cause in diagnosis.causes:
        if cause.kind == "time_lag":
            hints.append(Hint("sync", round(one.sync.offset + cause.value[0], 6), "sets the clocks"))
        elif cause.kind == "joint_unit":
            unit = "deg" if cause.value[0] < 1.0 else "rad"
            hints.append(Hint("unit", dict.fromkeys(cause.joints, unit), "reads it so"))
        elif cause.kind == "other_robot":
            hints.append(Hint("robot", cause.name, "takes this arm"))
    by_joints = all("joint_offset" not in untested.kinds for untested in diagnosis.untested)
    if robot is not None and by_joints:  # poses that a log recorded have another base and tool than its arm
        base, tool = _corrected_frames(diagnosis.causes, robot.base, robot.tool)
        hints += [Hint("base", _given(base), "puts the arm there")] if base != robot.base else []
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


def _sliding(one: Deviation) -> str:
    """Say what a tolerance of joints is where they slide; nothing where none does."""
    sliding = [held for held in one.joint_statistics.values() if held.unit == "m" and held.tolerance]
    if not sliding:
        return ""
    names = ", ".join(held.quantity for held in sliding)
    return f"in m for joints that slide: {names} {text.format_limit(sliding[0].tolerance)} mm"
