"""The presentation of an accuracy: the running speed, errors over velocity, then a section per velocity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion
from urmpipe_pipeline.accuracy.figures import motion_figures, velocity_figure
from urmpipe_pipeline.accuracy.parts import (
    error_cell,
    events,
    facts,
    format_velocity,
    headline,
    motion_facts,
    select_shown_motion,
    velocities_table,
)
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.accuracy.scene import accuracy_scene, arm_drawing, path_figure
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.parts import inputs_table, provenance_table, recording_fact
from urmpipe_pipeline.presentation.section import (
    Block,
    Cell,
    Check,
    Fact,
    Judged,
    Presentation,
    Section,
    Value,
)


def present(result: AccuracyResult) -> Presentation:
    """Return the presentation of an accuracy."""
    all_facts, motion = tuple(facts(result)), select_shown_motion(result)
    return Presentation(
        name=result.name,
        headline=headline(result),
        verdict=result.verdict,
        facts=all_facts,
        body=_body(result, all_facts),
        word="simulated",
        opens_at_ns=int(motion.t_ns[motion.worst]),
        scene=partial(accuracy_scene, result),
        lines=(line(result),),
        created=result.provenance.created,
    )


def line(result: AccuracyResult) -> Mapping[str, Cell]:
    """Return the row of an arm among others: running speed, errors at the least and largest velocity."""
    slow, fast = (end(result.errors, key=lambda errors: errors.velocity) for end in (min, max))
    speed = result.running_speed
    cells: dict[str, Cell] = {
        "Robot": result.robot.name,
        "Path": result.name,
        "Verdict": Judged(result.verdict),
        "Running speed": None if speed is None else Value(float(f"{speed:.4g}"), "m/s"),
        "Limit": Value(result.limit, "m", given=True),
        "Decides": result.limited_error,
    }
    for errors in dict.fromkeys((slow, fast)):
        velocity = format_velocity(errors.velocity)
        cells[f"Error at {velocity}"] = error_cell(result, errors, result.limited_error)
        cells[f"At voltage limit at {velocity}"] = Value(errors.saturated_share, "%")
    return cells


def _body(result: AccuracyResult, all_facts: tuple[Fact, ...]) -> Section:
    title = f"Accuracy of {result.robot.name}, {result.name}"
    tables = [velocities_table(result, "Errors by velocity", result.errors, linked=True)]
    if result.probed:
        tried = "Velocities run to find the running speed"
        tables.append(velocities_table(result, tried, result.probed, folded=True))
    return Section(
        title,
        result.verdict,
        (*all_facts, recording_fact(result.recording)),
        tuple(tables),
        blocks=partial(_page, result),
        checks=tuple(_checks(result)),
        properties={
            "running_speed": result.running_speed,
            "limit": result.limit,
            "limited_error": result.limited_error,
            "loop_radius": result.loop_radius,
            "compiled": result.compiled,
        },
        warnings=result.warnings,
        sections=tuple(_motion(result, motion) for motion in result.motions),
    )


def _checks(result: AccuracyResult) -> Iterator[Check]:
    """Yield one check per velocity; none without a limit."""
    for errors in result.errors:
        verdict = result.judge(errors)
        if verdict is not None:
            error = written(error_cell(result, errors, result.limited_error), unit=True)
            allowed = written(Value(result.limit, "m", given=True), unit=True)
            message = f"{error} ({result.limited_error}), allowed: {allowed}"
            yield Check(format_velocity(errors.velocity), verdict, message if verdict == "fail" else "")


def _page(result: AccuracyResult) -> Iterator[Block]:
    """Yield what only a page shows: errors over velocity, the arm and the path of the motion shown first."""
    yield velocity_figure(result)
    yield arm_drawing(result)
    yield path_figure(result)
    if result.provenance.inputs:
        yield inputs_table("Input files", result.provenance.inputs)
    yield provenance_table(result.provenance)


def _motion(result: AccuracyResult, motion: DrivenMotion) -> Section:
    """Return the section of a motion."""
    return Section(
        format_velocity(motion.velocity),
        result.judge(motion.errors),
        tuple(motion_facts(result, motion)),
        figures=partial(motion_figures, result, motion),
        events=partial(events, motion),
        opened=motion is select_shown_motion(result),
    )
