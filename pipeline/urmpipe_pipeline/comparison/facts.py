"""The facts of a compared log: what decided, when and where; how it was put beside the reference."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.identification import Twist, apply_twists_to_frames
from urmpipe_models.math3d import Transform
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import apply_alignment, frame_to_option
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Share, Statistics
from urmpipe_pipeline.comparison.warnings import is_stationary
from urmpipe_pipeline.comparison.wording import (
    absolute_symbol,
    format_decisive,
    format_interval,
    format_out_of_tolerance,
    format_utilisation,
)
from urmpipe_pipeline.diagnosis.causes import Cause
from urmpipe_pipeline.diagnosis.diagnose import MIN_SAMPLES
from urmpipe_pipeline.diagnosis.presenter import diagnosis_facts
from urmpipe_pipeline.presentation.section import Advice, Fact, Place, Ref, Value
from urmpipe_pipeline.runs.parts import log_facts
from urmpipe_pipeline.trajectories import Alignment, Sync

MEANING = {"coverage": "of the reference, shown by the log", "judged": "of the log's motion, judged"}
"""What a share is of."""

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


def max_place(one: Deviation, held: Statistics) -> Place | None:
    """Return where a log was when a quantity of it was largest; None where joints alone are compared."""
    place = one.place(held)
    return None if place is None else Place(place)


def max_value(one: Statistics | None, *, most: bool = False) -> Value | None:
    """Return the largest absolute value of a quantity, with what is allowed of it; None without one."""
    if one is None:
        return None
    return Value(one.max, one.unit, one.tolerance, one.verdict, one.utilisation, most=most)


def share_value(one: Share | None) -> Value | None:
    """Return a share with what is needed of it; None without one."""
    if one is None:
        return None
    used = math.inf if one.verdict == "fail" else one.utilisation
    return Value(one.value, "%", one.tolerance, one.verdict, used, least=True)


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


def format_alignment(one: Deviation) -> tuple[str, str]:
    """Return how a log was moved in space, and by which rule."""
    alignment = one.alignment
    match alignment.mode:
        case "none":
            return "none", "both sides as recorded"
        case "tool":
            moved = text.format_quantity(float(np.linalg.norm(alignment.tool)), "m")
            by = f"{_vector(alignment.tool)} mm in the tool's frame"
            return f"tool centre point moved by {moved}", f"the best constant offset: {by}"
        case "base+tool":
            return _base_and_tool_words(alignment)
    turned = text.format_quantity(alignment.angle, "rad")
    moved = text.format_quantity(float(alignment.moved(one.actual).max()), "m")
    first = alignment.mode == "start"
    rule = "the first compared poses agree" if first else "the best rigid motion"
    about = f"rotated about the origin, then translated by {_vector(alignment.translation)} mm"
    return f"{alignment.mode}: moved by up to {moved}, turned by {turned}", f"{rule}: {about}"


def _base_and_tool_words(alignment: Alignment) -> tuple[str, str]:
    """Return how base and tool were moved, by how much and to where."""
    sides = (
        ("base", alignment.translation, alignment.angle),
        ("tool", alignment.tool, alignment.tool_angle),
    )
    moved = (
        f"{name} by {text.format_quantity(float(np.linalg.norm(shift)), 'm')}"
        f" and {text.format_quantity(turn, 'rad')}"
        for name, shift, turn in sides
    )
    base, tool = _vector(alignment.translation), _vector(alignment.tool)
    by = f"base at {base} mm, tool at {tool} mm in the tool's frame"
    return f"moved and turned: {', '.join(moved)}", f"the best base and tool: {by}"


def _vector(metres: tuple[float, ...]) -> str:
    """Return a vector in [m] as (x, y, z) in [mm]."""
    return f"({', '.join(text.format_number(value, 'm') for value in metres)})"


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
