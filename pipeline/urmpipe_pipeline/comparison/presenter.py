"""How a comparison shows itself: the verdict, then a section a log, then the baseline."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Share
from urmpipe_pipeline.comparison.facts import (
    cause_facts,
    decisive_facts,
    deviation_facts,
    format_alignment,
    format_sync,
    remedy_hints,
)
from urmpipe_pipeline.comparison.figures import (
    comparison_scene,
    deviation_figures,
    overview_figure,
    path_figure,
    speed_scatter,
)
from urmpipe_pipeline.comparison.iso_presenter import present_test
from urmpipe_pipeline.comparison.tables import (
    baseline_checks,
    baseline_section,
    comparison_lines,
    ranking_tables,
    statistics_rows,
    statistics_tables,
    worse_facts,
)
from urmpipe_pipeline.comparison.verdict import UNITS
from urmpipe_pipeline.comparison.wording import (
    format_decisive,
    format_out_of_tolerance,
    format_time_of_max,
    format_tolerance,
    format_value,
    format_verdict,
    quantity_name,
)
from urmpipe_pipeline.diagnosis import presenter as diagnosis_presenter
from urmpipe_pipeline.diagnosis.presenter import diagnosis_tables
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.presentation.palette import run_colour
from urmpipe_pipeline.presentation.parts import inputs_table, minute, provenance_table, recording_fact
from urmpipe_pipeline.presentation.section import (
    Block,
    Check,
    Event,
    Fact,
    Level,
    Presentation,
    Section,
    Value,
)
from urmpipe_pipeline.runs.parts import log_events, log_tables
from urmpipe_pipeline.runs.playback import playback_figures


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
            at, f"decides: {format_value(held)}{'' if timed else f' {format_time_of_max(held)}'}", level
        )
    if not one.statistics:
        return
    x, y, z, norm = (text.format_quantity(float(value), "m") for value in one.delta[one.worst])
    said = f"largest deviation: {norm} (x {x}, y {y}, z {z})"
    row = "" if timed else f" in row {one.sample[one.worst] + 1}"
    yield Event(int(one.t_ns[one.worst]) if timed else None, f"{said}{row}", level)
