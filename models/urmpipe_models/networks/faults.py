"""What is wrong with the parts of a network: names, bodies, joints, elements and controls.

What is wrong with a network at values of its controls: numbers, lengths, user joints, parallel lines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, get_args

import numpy as np

from urmpipe_models.elementwise import Element, FloatArray, Vector, cross, dot, subtract
from urmpipe_models.errors import Finding, closest_name, format_unknown_name, format_value
from urmpipe_models.networks.elements import pair_faults
from urmpipe_models.networks.mechanism import build_graph, build_mechanism
from urmpipe_models.networks.parts import (
    AXES_TOLERANCE,
    JOINT_UNITS,
    POSE_UNITS,
    ConstraintElement,
    Control,
    ElementKind,
    Joint,
    Parts,
    control_faults,
    sample_range,
    sort_controls,
)

if TYPE_CHECKING:
    from urmpipe_models.math3d import Transform

MOST = 500
"""Joints and elements of a network at most: the search for an assembly solves for all of them at once."""


def validate_parts(parts: Parts) -> Iterator[Finding]:
    """Yield what is wrong with the parts of a network.

    What may follow from something that could not be read has a kind: "untied", a body that nothing ties,
    "idle", a control that drives nothing, "parallel", two lines, and "coupled", a joint of a pair.
    """
    found = [*_structure_faults(parts), *validate_values(parts)]
    yield from found or lines_faults(parts)


def _structure_faults(parts: Parts) -> Iterator[Finding]:
    """Yield what is wrong whatever the values of controls are."""
    if not parts.constraints:
        message = "found none, and no elements; allowed: at least one of them"
        yield Finding(message, about="joints", kind="untied")
    if len(parts.constraints) > MOST:
        message = f"found {len(parts.constraints)} with elements and those of chains, allowed: {MOST} at most"
        yield Finding(message, about="joints")
    yield from _name_faults(parts)
    yield from _body_faults(parts)
    for where, tie in parts.constraints:
        if isinstance(tie, Joint) or not tie.is_pair:
            yield from _tie_faults(where, tie, parts.body_names)
    for joint in parts.joints:
        yield from _joint_faults(f"joints.{joint.name}", joint)
        yield from _limit_faults(f"joints.{joint.name}", joint)
    for element in parts.elements:
        if element.is_pair:
            yield from pair_faults(f"elements.{element.name}", element, parts)
        else:
            yield from _element_faults(f"elements.{element.name}", element)
    yield from control_faults(parts)


def _name_faults(parts: Parts) -> Iterator[Finding]:
    """Yield names that stand for two things.

    A body may have the name of the joint that carries it, as those of a chain, unless it has freedoms of its
    own: these would be called like the joint's.
    """
    known, free = set(parts.body_names), set(build_graph(parts).roots)
    carriers = (one for one in parts.joints if one.name == one.bodies[1])
    carried = {one.name for one in carriers if one.name not in free or one.bodies[0] not in known}
    named = [("bodies", name) for name in parts.body_names if name not in carried]
    named += [("joints", one.name) for one in parts.joints]
    named += [("elements", one.name) for one in parts.elements]
    named += [("controls", one.name) for one in parts.controls]
    first: dict[str, str] = {}
    for table, name in named:
        where = f"{table}.{name}"
        if table != "controls" and not name.strip():
            yield Finding(f"found {format_value(name)} as a name, allowed: one that can be seen", about=where)
        if name in first:
            yield Finding(f"{first[name]} has this name, too; allowed: each name once", about=where)
        first.setdefault(name, where)


def _body_faults(parts: Parts) -> Iterator[Finding]:
    """Yield bodies that nothing ties, and starts that are not allowed."""
    tied = {name for _, tie in parts.constraints for name in tie.bodies}
    tied |= {closest_name(name, parts.body_names) or "" for name in tied - set(parts.body_names)}
    for body in parts.bodies:
        where = f"bodies.{body.name}"
        if body.name not in tied:
            message = "nothing is tied to it; allowed: bodies with a joint or an element"
            yield Finding(message, about=where, kind="untied")
        if body.start and len(body.start) != len(POSE_UNITS):
            count = f"{len(body.start)} numbers, allowed: 6: x, y, z and a rotation vector"
            yield Finding(f"found {count}", about=f"{where}.start")
        yield from _finite_faults(f"{where}.start", body.start)
    yield from _start_faults(parts)


def _start_faults(parts: Parts) -> Iterator[Finding]:
    """Yield starts of bodies whose pose joints give."""
    started = {one.name for one in parts.bodies if one.start}
    for cluster in build_graph(parts).clusters:
        if cluster[0] == parts.ground:
            reason, others = f"joints tie it to {parts.ground}", started.intersection(cluster)
        else:  # a root is a body with a start, if there is one
            reason, others = (
                f"joints tie it to {cluster[0]}, which has one",
                started.intersection(cluster[1:]),
            )
        for name in sorted(others):
            allowed = "one for all bodies that joints tie together, none for those tied to the ground"
            yield Finding(f"found a start, but {reason}; allowed: {allowed}", about=f"bodies.{name}.start")


def _tie_faults(where: str, tie: Joint | ConstraintElement, names: tuple[str, ...]) -> Iterator[Finding]:
    """Yield what is wrong with the bodies of a joint or an element."""
    for name in tie.bodies:
        if name not in names:
            yield Finding(f"body {format_unknown_name(name, names)}", about=f"{where}.bodies")
    if tie.bodies[0] == tie.bodies[1]:
        yield Finding(f"found {tie.bodies[0]} twice, allowed: two bodies", about=f"{where}.bodies")


def _joint_faults(where: str, joint: Joint) -> Iterator[Finding]:
    """Yield what is wrong with a joint by itself."""
    if joint.kind not in JOINT_UNITS:
        yield Finding(format_unknown_name(joint.kind, JOINT_UNITS), about=f"{where}.kind")
        return
    if joint.kind == "user":
        yield from _user_faults(where, joint)
        return
    count = len(joint.units)
    for key, given in (("start", joint.start), ("value", joint.values)):
        if len(given) not in {0, count}:
            yield Finding(f"found {len(given)} of them, allowed: {count}", about=f"{where}.{key}")
    yield from _finite_faults(f"{where}.start", joint.start)
    yield from _finite_faults(f"{where}.pitch", (joint.pitch,))
    yield from _frame_faults(where, joint.frames)


def _limit_faults(where: str, joint: Joint) -> Iterator[Finding]:
    """Yield limits that a joint cannot have."""
    if not joint.limits:
        return
    count = 0 if joint.kind in ("global", "user") else len(joint.units)
    if len(joint.limits) != count:
        reason = f"{count}, one pair per variable" if count else f"none of a {joint.kind} joint"
        yield Finding(f"found {len(joint.limits)} limits, allowed: {reason}", about=f"{where}.lower")
        return
    for unit, (lower, upper) in zip(joint.units, joint.limits, strict=True):
        if not lower <= upper:
            message = f"found {lower:g} {unit}, above upper, {upper:g} {unit}; allowed: at most upper"
            yield Finding(message, about=f"{where}.lower")


def _user_faults(where: str, joint: Joint) -> Iterator[Finding]:
    """Yield what a user joint has and may not have, or the other way round."""
    for key, given in (("start", joint.start), ("value", joint.values)):
        if given:
            yield Finding(
                "found some, allowed: none of a user joint: m, n and a move it", about=f"{where}.{key}"
            )
    if len(joint.motion) != 9:
        allowed = "9: of m, n and a three each"
        yield Finding(f"found {len(joint.motion)} functions, allowed: {allowed}", about=where)
    yield from _frame_faults(where, joint.frames)


def _frame_faults(where: str, frames: tuple[Transform, Transform]) -> Iterator[Finding]:
    """Yield the frames of a joint whose axes are not orthonormal, one finding if both are the same."""
    for frame, body in zip(frames[: 1 + (frames[0] != frames[1])], ("first", "second"), strict=False):
        m, n, k = frame.columns
        off = math.sqrt(dot(m, m)) - 1.0, math.sqrt(dot(n, n)) - 1.0, dot(m, n)
        of = f" in the {body} body" if frames[0] != frames[1] else ""
        if all(abs(one) <= AXES_TOLERANCE for one in off[:2]) and abs(off[2]) > AXES_TOLERANCE:
            allowed = f"{AXES_TOLERANCE:g} at most, or no m: then one perpendicular to n is taken"
            message = f"m is not perpendicular to n{of}: m . n = {off[2]:.3g}; allowed: {allowed}"
            yield Finding(message, about=f"{where}.m")
        elif not all(abs(one) <= AXES_TOLERANCE for one in off):
            key = "m" if all(abs(one) <= AXES_TOLERANCE for one in off[1:]) else "n"
            yield Finding(not_orthonormal(off, of), about=f"{where}.{key}")
        elif not all(abs(one) <= AXES_TOLERANCE for one in subtract(cross(m, n), k)):
            yield Finding(f"the third axis{of} is not m x n", about=where)
        yield from _finite_faults(f"{where}.a", frame.translation)


def _element_faults(where: str, element: ConstraintElement) -> Iterator[Finding]:
    """Yield what is wrong with an element by itself."""
    kinds = get_args(ElementKind)
    if element.kind not in kinds:
        yield Finding(format_unknown_name(element.kind, kinds), about=f"{where}.kind")
        return
    normals: tuple[Vector, ...] = {"gg": (), "crc": element.normals}.get(element.kind, element.normals[:1])
    for n in dict.fromkeys(normals):
        off = math.sqrt(dot(n, n)) - 1.0
        if not abs(off) <= AXES_TOLERANCE:
            message = f"is not a unit vector: |n| - 1 = {off:.3g}; allowed: {AXES_TOLERANCE:g} at most"
            yield Finding(message, about=f"{where}.n")
    for point in element.points[element.kind == "eg" :]:
        yield from _finite_faults(f"{where}.a", point)


def _finite_faults(where: str, numbers: tuple[float, ...]) -> Iterator[Finding]:
    """Yield the first number that is none, infinite or of no mechanism."""
    if wrong := [one for one in numbers if not math.isfinite(one)]:
        yield Finding(f"found {wrong[0]:g}, allowed: a finite number", about=where)
    elif wrong := [one for one in numbers if abs(one) > LARGEST]:
        yield Finding(f"found {wrong[0]:g}, allowed: {LARGEST:g} at most, in m or rad", about=where)


LARGEST = 1e9
"""No length in [m] or angle in [rad] of a mechanism is larger: rounding would leave nothing of it."""

PARALLEL = 1e-9
"""Below this sine of their angle two lines have no common normal."""

SAMPLES = 11
"""At so many values of a control, from its least to its largest, a user joint is looked at."""


def validate_values(parts: Parts, at: str = "where controls start") -> Iterator[Finding]:
    """Yield what is wrong with the values of functions, where controls start and over their ranges.

    Args:
        parts: The parts.
        at: Where controls start, in words.
    """
    values = control_values(parts.controls, {})
    finite = {name: float(value) for name, value in values.items() if math.isfinite(value)}
    for where, one in (*parts.control_functions, *parts.joint_functions, *parts.length_functions):
        value = float(one.value(finite)) if one.names <= finite.keys() else 0.0
        if not abs(value) <= LARGEST:
            allowed = f"{LARGEST:g} at most, in m or rad" if math.isfinite(value) else "a finite number"
            yield Finding(f"found {value:g} {at}, allowed: {allowed}", about=where)
    yield from _length_faults(parts, finite, at)
    for joint in parts.joints:
        if len(joint.motion) == 9 and all(one.names <= finite.keys() for one in joint.motion):
            yield from _motion_faults(joint, parts.controls, at)


def control_values(controls: tuple[Control, ...], given: Mapping[str, Element]) -> dict[str, Element]:
    """Return the value of each control but those of a cycle.

    Args:
        controls: The controls.
        given: Values of some that can be set, any elements; the others have their starts.
    """
    found: dict[str, Element] = {}
    for one in sort_controls(controls):
        found[one.name] = given.get(one.name, one.start) if one.value is None else one.value.value(found)
    return found


def _length_faults(parts: Parts, values: Mapping[str, float], at: str) -> Iterator[Finding]:
    """Yield lengths that are too small where controls start; h and offsets may be less than 0."""
    for element, (where, function) in zip(parts.elements, parts.length_functions, strict=True):
        if element.length_key == "d" and function.names <= values.keys():
            length, lines = float(function.value(values)), element.kind == "crc"
            if length < 0.0 or (length == 0.0 and not lines):
                allowed = "0 or more" if lines else "more than 0"
                message = f"found {length:g} m {at}, allowed: {allowed}"
                yield Finding(message, about=where)


def _motion_faults(joint: Joint, controls: tuple[Control, ...], at: str) -> Iterator[Finding]:
    """Yield where m and n of a user joint are not orthonormal: at the start, or along each control."""
    where = f"joints.{joint.name}.n"
    worst = _worst(joint, control_values(controls, {}))[1]
    if not np.max(np.abs(worst)) <= AXES_TOLERANCE:
        yield Finding(not_orthonormal(worst, f" {at}"), about=where)
        return
    for one in controls:
        if one.value is None:
            low, high = sample_range(one)
            sampled = np.linspace(low, high, SAMPLES)
            k, worst = _worst(joint, control_values(controls, {one.name: sampled}))
            if not np.max(np.abs(worst)) <= AXES_TOLERANCE:
                message = not_orthonormal(worst, f" at {one.name} = {sampled[k]:.6g}")
                yield Finding(message, about=where)


def _worst(joint: Joint, values: Mapping[str, Element]) -> tuple[int, FloatArray]:
    """Return where m and n of a user joint are the least orthonormal, and |m| - 1, |n| - 1 and m . n there.

    Args:
        joint: The joint.
        values: Of each control a number, or numbers of shape (n,).
    """
    parts = (np.asarray(one.value(values), float) for one in joint.motion[:6])
    m, n = np.stack(np.broadcast_arrays(*parts)).reshape(2, 3, -1)
    with np.errstate(all="ignore"):  # what is no number is the worst
        off = np.array(
            [np.linalg.norm(m, axis=0) - 1.0, np.linalg.norm(n, axis=0) - 1.0, np.sum(m * n, axis=0)]
        )
    k = int(np.argmax(np.max(np.abs(np.nan_to_num(off, nan=np.inf)), axis=0)))
    return k, off[:, k]


def not_orthonormal(off: Sequence[float] | FloatArray, place: str) -> str:
    """Return how far m and n are from orthonormal.

    Args:
        off: |m| - 1, |n| - 1 and m . n [-], shape (3,).
        place: Where that is so, such as " in the first body".
    """
    m, n, both = off
    found = f"|m| - 1 = {m:.3g}, |n| - 1 = {n:.3g}, m . n = {both:.3g}"
    return f"m and n are not orthonormal{place}: {found}; allowed: {AXES_TOLERANCE:g} at most"


def lines_faults(parts: Parts) -> Iterator[Finding]:
    """Yield crc elements whose lines are parallel where assembly starts; nothing else may be wrong."""
    skew = [one for one in parts.elements if one.kind == "crc"]
    if not skew:
        return
    mechanism = build_mechanism(parts)
    with np.errstate(all="ignore"):  # starts as large as 1e300
        poses = mechanism.poses(mechanism.start.tolist())  # constants: right angles are exact
    for element in skew:
        first, second = (
            poses[name].rotate(n) for name, n in zip(element.bodies, element.normals, strict=True)
        )
        normal = cross(first, second)
        sine = math.sqrt(dot(normal, normal))
        if not sine >= PARALLEL:
            message = f"the lines are parallel where assembly starts: |n1 x n2| = {sine:.3g}; allowed: more"
            yield Finding(message, about=f"elements.{element.name}.n", kind="parallel")
