"""How a plan shows itself: how long it takes, what limits it, and whether the arm can move so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from urmpipe_pipeline import text
from urmpipe_pipeline.planned_paths.figures import plan_figures
from urmpipe_pipeline.planned_paths.obstacles import ObstacleKind
from urmpipe_pipeline.planned_paths.parts import (
    LIMITS,
    decisive_fact,
    events,
    facts,
    joints_table,
    obstacle_words,
    segments_table,
)
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.planned_paths.scene import arm_drawing, opening_ns, path_figure, scene
from urmpipe_pipeline.presentation.exports import Exports
from urmpipe_pipeline.presentation.parts import inputs_table, provenance_table, recording_fact
from urmpipe_pipeline.presentation.section import (
    Block,
    Check,
    Fact,
    Judged,
    Presentation,
    Ref,
    Section,
    Value,
)
from urmpipe_pipeline.runs import exports as run_exports

CHECKS: dict[ObstacleKind, str] = {
    "unreachable": "every sample reached",
    "jump": "no jump",
    "singular": "no singular pose",
    "too-slow": "at least 1 % of the speed left",
}
"""What is judged of a plan, by what may be in its way."""


def present(plan: PlannedPath) -> Presentation:
    """Return what a plan shows."""
    every, decisive = tuple(facts(plan)), tuple(decisive_fact(plan))
    moved = [joints_table(plan, plan.joints)] if plan.joints is not None and plan.reached.any() else []
    body = Section(
        f"Plan {plan.name}",
        plan.verdict,
        (
            *decisive,
            Fact("Robot", plan.robot.name if plan.robot else "none: path and time alone", brief=False),
            *(replace(one, brief=False) for one in every if not (decisive and one.name == LIMITS)),
            recording_fact(plan.recording),
        ),
        (*moved, segments_table(plan)),
        partial(plan_figures, plan),
        partial(_page, plan),
        tuple(_checks(plan)),
        _properties(plan) if plan.robot else {},
        partial(events, plan),
        plan.warnings,
    )
    return Presentation(
        name=plan.name,
        headline=headline(plan),
        verdict=plan.verdict,
        facts=tuple(one for one in every if one.brief),
        body=body,
        word="planned",
        opens_at_ns=opening_ns(plan),
        scene=partial(scene, plan),
        lines=(
            {
                "Plan": Ref(body.title),
                "Verdict": Judged(plan.verdict),
                "Robot": plan.robot.name if plan.robot else None,
                "Law": plan.law,
                "Length": Value(plan.path.total, "m"),
                "Duration": Value(plan.duration, "s"),
                "Speed left": Value(None if plan.infeasibilities else plan.speed_factor, "%"),
                "Warnings": Value(len(plan.warnings)),
            },
        ),
        created=plan.provenance.created,
    )


def exports(plan: PlannedPath) -> Exports:
    """Return what can leave of a plan: that of its run."""
    return run_exports.exports(plan.as_run())


def headline(plan: PlannedPath) -> str:
    """Return how long the path is and takes, and what holds the arm back."""
    way = f"{plan.path.total:.4g} m in {plan.duration:.3f} s ({plan.law})"
    if plan.robot is None:
        return f"{plan.name}: {way}, without a robot"
    if plan.infeasibilities:
        first = plan.infeasibilities[0]
        what = f"{first.kind} at t = {first.t:.3f} s (row {first.row})"
        return f"{plan.name}: {plan.robot.name} cannot run {way}: {what}"
    said = f"{plan.name}: {plan.robot.name} runs {way}"
    if plan.speed_factor == 1.0 or plan.joints is None:
        return said
    speed = text.format_percent(plan.speed_factor)
    return f"{said}, reduced to {speed} of the speed by {plan.joints.most_used[0]}"


def _checks(plan: PlannedPath) -> Iterator[Check]:
    """Yield what the verdict rests on; nothing without an arm."""
    for kind, name in CHECKS.items() if plan.robot is not None else ():
        found = [obstacle_words(one) for one in plan.infeasibilities if one.kind == kind]
        yield Check(name, "fail" if found else "pass", "; ".join(found[:1]), kind=kind)


def _properties(plan: PlannedPath) -> dict[str, Any]:
    """Return the numbers that stand with the checks."""
    return {
        "length": plan.path.total,
        "duration": plan.duration,
        "speed_factor": plan.speed_factor,
        "law": plan.law,
    }


def _page(plan: PlannedPath) -> Iterator[Block]:
    """Yield what only a page shows."""
    yield path_figure(plan)
    yield from arm_drawing(plan)
    if plan.provenance.inputs:
        yield inputs_table("Input files", plan.provenance.inputs)
    yield provenance_table(plan.provenance)
