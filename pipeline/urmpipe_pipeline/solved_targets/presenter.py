"""How solved targets show themselves: how many the arm reaches, how, and why not the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from urmpipe_models.display import format_count
from urmpipe_models.ik.closed import format_method
from urmpipe_pipeline.presentation.exports import Exports
from urmpipe_pipeline.presentation.figure import Figure
from urmpipe_pipeline.presentation.parts import inputs_table, provenance_table
from urmpipe_pipeline.presentation.section import Block, Check, Judged, Presentation, Ref, Section, Value
from urmpipe_pipeline.runs import exports as run_exports
from urmpipe_pipeline.runs.figures import run_figures
from urmpipe_pipeline.runs.scene import path_figure
from urmpipe_pipeline.solved_targets.parts import (
    events,
    facts,
    fast_words,
    jump_words,
    missed_table,
    path_facts,
    tables,
    unreached,
    unreached_facts,
)
from urmpipe_pipeline.solved_targets.result import IkResult
from urmpipe_pipeline.solved_targets.scene import opening_row, scene
from urmpipe_pipeline.text import join_list


def present(one: IkResult) -> Presentation:
    """Return what solved targets show."""
    row, reached = opening_row(one), int(one.reached.sum())
    body = Section(
        f"Targets {one.name}",
        one.verdict,
        tuple(facts(one)),
        (*([] if one.reached.all() else [missed_table(one)]), *tables(one)),
        partial(_figures, one),
        partial(_page, one),
        tuple(_checks(one)),
        {"targets": len(one), "reached": reached, "robot": one.robot.name, "method": one.method},
        partial(events, one),
        one.warnings,
    )
    return Presentation(
        name=one.name,
        headline=headline(one),
        verdict=one.verdict,
        facts=(*(path_facts(one, one.path) if one.path else ()), *unreached_facts(one)),
        body=body,
        opens_at_ns=0 if one.t_ns is None else int(one.t_ns[row]),
        opens_at_row=row if one.t_ns is None else None,
        scene=partial(scene, one),
        lines=(
            {
                "Targets": Ref(body.title),
                "Verdict": Judged(one.verdict),
                "Robot": one.robot.name,
                "Method": format_method(one.method),
                "Rows": Value(len(one)),
                "Reached": Value(reached),
                "Duration": None if one.t_ns is None else Value(float(one.t_ns[-1]) / 1e9, "s"),
                "Warnings": Value(len(one.warnings)),
            },
        ),
        created=one.provenance.created,
    )


def exports(one: IkResult) -> Exports:
    """Return what can leave of solved targets: that of the run of their chosen solutions."""
    return run_exports.exports(one.as_run())


def headline(one: IkResult) -> str:
    """Return how many targets the arm reaches, how they were solved, and why it cannot follow a path."""
    found, wanted = int(one.reached.sum()), len(one)
    part = "" if found == wanted else f"{found} of "
    method = format_method(one.method)
    said = f"{one.name}: {one.robot.name} reaches {part}{format_count(wanted, 'target')} ({method})"
    if one.path is None:
        return said
    jumps, fast = len(one.path.jumps), len({stretch.joint for stretch in one.path.speed_violations})
    others = [format_count(jumps, "jump")] * bool(jumps) + [f"{format_count(fast, 'joint')} too fast"] * bool(
        fast
    )
    return f"{said}, with {join_list(others)}" if others else said


def _checks(one: IkResult) -> Iterator[Check]:
    """Yield what the verdict rests on: every target is reached, without a jump or a joint too fast."""
    missed = len(one) - int(one.reached.sum())
    why = (
        ""
        if not missed
        else f"{missed} of {format_count(len(one), 'target')}: {': '.join(next(unreached(one)))}"
    )
    yield Check("every target reached", "fail" if missed else "pass", why, kind="unreachable")
    if one.path is None:
        return
    jumps = [jump_words(one, jump) for jump in one.path.jumps]
    yield Check("no jump", "fail" if jumps else "pass", "; ".join(jumps[:1]), kind="jump")
    fast = [fast_words(one, stretch) for stretch in one.path.speed_violations]
    yield Check("no joint too fast", "fail" if fast else "pass", "; ".join(fast[:1]), kind="joint-too-fast")


def _figures(one: IkResult) -> Iterator[Figure]:
    """Yield how the joints and the tool centre point move, or stand without times; a line at each jump."""
    run = one.as_run()
    first, *others = run_figures(run)
    if one.t_ns is not None and one.path is not None:
        jumps = {int(one.t_ns[jump.sample]): f"jump in row {one.row[jump.sample]}" for jump in one.path.jumps}
        first = replace(first, instants=jumps)
    if run.timed and not run.audit:
        views = tuple(replace(view, name="Joints, solved") for view in first.views)
        first = replace(first, caption="The chosen solutions.", views=views)
    yield first
    yield from others


def _page(one: IkResult) -> Iterator[Block]:
    """Yield what only a page shows."""
    yield from path_figure(one.as_run())
    yield inputs_table("Input files", one.provenance.inputs)
    yield provenance_table(one.provenance)
