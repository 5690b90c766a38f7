"""Validation of the parts of a network: every error, with its place in a file.

1. `validate_parts`: the structure, then values, then parallel lines.
2. Structure: names, bodies and their starts, joints and their limits, elements, higher pairs, controls.
3. `validate_values`: the values of functions at values of the controls: finite numbers, lengths, and the axes
   of user joints, which must be orthonormal over the ranges of the controls.
4. Lines of crc elements that are parallel at the start of assembly.

An error that may follow from an unreadable part of a file has a kind: "untied", a body without a joint or an
element, "idle", a control that drives nothing, "parallel", two lines, and "coupled", a joint of a pair.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import get_args

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import Element, FloatArray, Vector, cross, dot, subtract
from urmpipe_models.errors import Finding, closest_name, format_unknown_name, format_value
from urmpipe_models.networks.joint_motion import TURN
from urmpipe_models.networks.mechanism import build_graph, build_mechanism
from urmpipe_models.networks.parts import (
    AXES_TOLERANCE,
    JOINT_UNITS,
    MAX_POINTS,
    MIN_POINTS,
    PAIR_JOINTS,
    POSE_UNITS,
    ConstraintElement,
    Control,
    ElementKind,
    Joint,
    Parts,
    PlacedExpression,
    Profile,
    is_control_name,
    pair_bodies,
    sample_range,
    sort_controls,
)

MAX_CONSTRAINTS = 500  # joints and elements: the search for an assembly solves for all of them at once
MAX_VALUE = 1e9  # [m], [rad] of a mechanism: beyond, rounding leaves no digits of it
MIN_SINE = 1e-9  # of the angle of two lines that have a common normal
SAMPLES = 11  # values of a control, over its range, at which user joints are checked


def validate_parts(parts: Parts) -> Iterator[Finding]:
    """Yield the errors of the parts of a network; of parallel lines only if there are no others."""
    faults = [*_validate_structure(parts), *validate_values(parts)]
    yield from faults or _validate_lines(parts)


def _validate_structure(parts: Parts) -> Iterator[Finding]:
    """Yield errors that do not depend on the values of controls."""
    if not parts.constraints:
        message = "found none, and no elements; allowed: at least one of them"
        yield Finding(message, about="joints", kind="untied")
    if (count := len(parts.constraints)) > MAX_CONSTRAINTS:
        message = f"found {count} with elements and those of chains, allowed: {MAX_CONSTRAINTS} at most"
        yield Finding(message, about="joints")
    yield from _validate_names(parts)
    yield from _validate_bodies(parts)
    yield from _validate_starts(parts)
    for where, constraint in parts.constraints:
        if isinstance(constraint, Joint) or not constraint.is_pair:
            yield from _validate_ends(where, constraint, parts.body_names)
    for joint in parts.joints:
        yield from _validate_joint(f"joints.{joint.name}", joint)
        yield from _validate_limits(f"joints.{joint.name}", joint)
    for element in parts.elements:
        if element.is_pair:
            yield from _validate_pair(f"elements.{element.name}", element, parts)
        else:
            yield from _validate_element(f"elements.{element.name}", element)
    yield from _validate_controls(parts)


# --- names and bodies


def _validate_names(parts: Parts) -> Iterator[Finding]:
    """Yield duplicate names.

    A body may have the name of the joint that carries it, as those of a chain, unless it has freedoms: these
    would have the names of the joint's.
    """
    known, free = set(parts.body_names), set(build_graph(parts).roots)
    carriers = (joint for joint in parts.joints if joint.name == joint.bodies[1])
    carried = {joint.name for joint in carriers if joint.name not in free or joint.bodies[0] not in known}
    names = [("bodies", name) for name in parts.body_names if name not in carried]
    names += [("joints", joint.name) for joint in parts.joints]
    names += [("elements", element.name) for element in parts.elements]
    names += [("controls", control.name) for control in parts.controls]
    first: dict[str, str] = {}
    for table, name in names:
        where = f"{table}.{name}"
        if table != "controls" and not name.strip():
            yield Finding(f"found {format_value(name)} as a name, allowed: one that can be seen", about=where)
        if name in first:
            yield Finding(f"{first[name]} has this name, too; allowed: each name once", about=where)
        first.setdefault(name, where)


def _validate_bodies(parts: Parts) -> Iterator[Finding]:
    tied = {name for _, constraint in parts.constraints for name in constraint.bodies}
    tied |= {closest_name(name, parts.body_names) or "" for name in tied - set(parts.body_names)}
    for body in parts.bodies:
        where = f"bodies.{body.name}"
        if body.name not in tied:
            message = "nothing is tied to it; allowed: bodies with a joint or an element"
            yield Finding(message, about=where, kind="untied")
        if body.start and len(body.start) != len(POSE_UNITS):
            count = f"{format_count(len(body.start), 'number')}, allowed: 6: x, y, z and a rotation vector"
            yield Finding(f"found {count}", about=f"{where}.start")
        yield from _validate_numbers(f"{where}.start", body.start)


def _validate_starts(parts: Parts) -> Iterator[Finding]:
    """Yield starts of bodies whose pose follows from joints."""
    started = {body.name for body in parts.bodies if body.start}
    for cluster in build_graph(parts).clusters:
        root = cluster[0]  # a body with a start, if there is one
        if root == parts.ground:
            reason, needless = f"joints tie it to {root}", started.intersection(cluster)
        else:
            reason, needless = f"joints tie it to {root}, which has one", started.intersection(cluster[1:])
        for name in sorted(needless):
            allowed = "one for all bodies that joints tie together, none for those tied to the ground"
            yield Finding(f"found a start, but {reason}; allowed: {allowed}", about=f"bodies.{name}.start")


def _validate_ends(
    where: str, constraint: Joint | ConstraintElement, names: tuple[str, ...]
) -> Iterator[Finding]:
    first, second = constraint.bodies
    for name in (first, second):
        if name not in names:
            yield Finding(f"body {format_unknown_name(name, names)}", about=f"{where}.bodies")
    if first == second:
        yield Finding(f"found {first} twice, allowed: two bodies", about=f"{where}.bodies")


def _validate_numbers(where: str, numbers: tuple[float, ...]) -> Iterator[Finding]:
    """Yield the first number that is not finite, else the first that is too large."""
    if infinite := [number for number in numbers if not math.isfinite(number)]:
        yield Finding(f"found {infinite[0]:g}, allowed: a finite number", about=where)
    elif large := [number for number in numbers if abs(number) > MAX_VALUE]:
        yield Finding(f"found {large[0]:g}, allowed: {MAX_VALUE:g} at most, in m or rad", about=where)


# --- joints and elements


def _validate_joint(where: str, joint: Joint) -> Iterator[Finding]:
    if joint.kind not in JOINT_UNITS:
        yield Finding(format_unknown_name(joint.kind, JOINT_UNITS), about=f"{where}.kind")
        return
    count, is_user = len(joint.units), joint.kind == "user"
    for key, values in (("start", joint.start), ("value", joint.values)):
        if is_user and values:
            message = "found some, allowed: none of a user joint: m, n and a move it"
            yield Finding(message, about=f"{where}.{key}")
        elif len(values) not in {0, count}:
            yield Finding(f"found {len(values)} of them, allowed: {count}", about=f"{where}.{key}")
    if is_user and len(joint.motion) != 9:
        allowed = "9: of m, n and a three each"
        yield Finding(f"found {len(joint.motion)} functions, allowed: {allowed}", about=where)
    if not is_user:
        yield from _validate_numbers(f"{where}.start", joint.start)
        yield from _validate_numbers(f"{where}.pitch", (joint.pitch,))
    yield from _validate_frames(where, joint)


def _validate_frames(where: str, joint: Joint) -> Iterator[Finding]:
    """Yield frames whose axes are not orthonormal, one error if both are the same."""
    is_same = joint.frames[0] == joint.frames[1]
    for frame, body in zip(joint.frames[: 1 if is_same else 2], ("first", "second"), strict=False):
        m, n, k = frame.columns
        errors = math.sqrt(dot(m, m)) - 1.0, math.sqrt(dot(n, n)) - 1.0, dot(m, n)
        of = "" if is_same else f" in the {body} body"
        is_unit_m, is_unit_n, is_perpendicular = (abs(error) <= AXES_TOLERANCE for error in errors)
        if is_unit_m and is_unit_n and abs(errors[2]) > AXES_TOLERANCE:
            allowed = f"{AXES_TOLERANCE:g} at most, or no m: then one perpendicular to n is taken"
            message = f"m is not perpendicular to n{of}: m . n = {errors[2]:.3g}; allowed: {allowed}"
            yield Finding(message, about=f"{where}.m")
        elif not (is_unit_m and is_unit_n and is_perpendicular):
            key = "m" if is_unit_n and is_perpendicular else "n"
            yield Finding(_format_axes_error(errors, of), about=f"{where}.{key}")
        elif not all(abs(error) <= AXES_TOLERANCE for error in subtract(cross(m, n), k)):
            yield Finding(f"the third axis{of} is not m x n", about=where)
        yield from _validate_numbers(f"{where}.a", frame.translation)


def _format_axes_error(errors: Sequence[float] | FloatArray, place: str) -> str:
    """Return the message of axes with the errors |m| - 1, |n| - 1 and m . n [-] at a place."""
    m, n, product = errors
    values = f"|m| - 1 = {m:.3g}, |n| - 1 = {n:.3g}, m . n = {product:.3g}"
    return f"m and n are not orthonormal{place}: {values}; allowed: {AXES_TOLERANCE:g} at most"


def _validate_limits(where: str, joint: Joint) -> Iterator[Finding]:
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


def _validate_element(where: str, element: ConstraintElement) -> Iterator[Finding]:
    kinds = get_args(ElementKind)
    if element.kind not in kinds:
        yield Finding(format_unknown_name(element.kind, kinds), about=f"{where}.kind")
        return
    normals: tuple[Vector, ...] = {"gg": (), "crc": element.normals}.get(element.kind, element.normals[:1])
    for n in dict.fromkeys(normals):
        error = math.sqrt(dot(n, n)) - 1.0
        if not abs(error) <= AXES_TOLERANCE:
            message = f"is not a unit vector: |n| - 1 = {error:.3g}; allowed: {AXES_TOLERANCE:g} at most"
            yield Finding(message, about=f"{where}.n")
    for point in element.points[element.kind == "eg" :]:
        yield from _validate_numbers(f"{where}.a", point)


# --- higher pairs


def _validate_pair(where: str, element: ConstraintElement, parts: Parts) -> Iterator[Finding]:
    yield from _validate_coupled(where, element, parts)
    if element.kind == "gear":
        teeth = element.teeth
        if len(teeth) != 2 or not all(0.0 < abs(count) <= MAX_VALUE for count in teeth) or max(teeth) < 0.0:
            counts = ", ".join(f"{count:g}" for count in teeth)
            allowed = "two numbers other than 0, at most one of them negative: that of an internal wheel"
            yield Finding(f"found {counts}, allowed: {allowed}", about=f"{where}.teeth")
    elif element.kind == "rack" and not 0.0 < abs(element.radius) <= MAX_VALUE:
        allowed = f"a radius other than 0, {MAX_VALUE:g} m at most; its sign is that of the motion"
        yield Finding(f"found {element.radius:g} m, allowed: {allowed}", about=f"{where}.radius")
    elif element.kind == "cam":
        yield from _validate_profile(f"{where}.profile", element.profile)


def _validate_coupled(where: str, element: ConstraintElement, parts: Parts) -> Iterator[Finding]:
    """Yield unknown joints, joints of the wrong kind, and a joint that is named twice."""
    place, joints = f"{where}.joints", {joint.name: joint for joint in parts.joints}
    if len(element.joints) != 2:
        yield Finding(f"found {len(element.joints)}, allowed: the names of two joints", about=place)
        return
    if element.joints[0] == element.joints[1]:
        yield Finding(f"found {element.joints[0]} twice, allowed: two joints", about=place)
    kinds = PAIR_JOINTS[element.kind]
    for name, allowed, order in zip(element.joints, kinds, ("first", "second"), strict=True):
        if name not in joints:
            yield Finding(f"joint {format_unknown_name(name, joints)}", about=place, kind="coupled")
        elif joints[name].kind not in allowed:
            message = f"found {name}, a {joints[name].kind} joint, allowed as the {order} of a {element.kind}"
            yield Finding(f"{message}: {', '.join(allowed)}", about=place, kind="coupled")
    known = [joints[name] for name in element.joints if name in joints]
    if len(known) == 2 and element.bodies != (ends := pair_bodies(*known)):
        message = f"found {', '.join(element.bodies)}, allowed: those of its joints, {', '.join(ends)}"
        yield Finding(message, about=f"{where}.bodies")


def _validate_profile(where: str, profile: Profile) -> Iterator[Finding]:
    """Yield a number of points, numbers and angles that do not define a periodic spline."""
    if not MIN_POINTS <= len(profile) <= MAX_POINTS:
        yield Finding(f"found {len(profile)} points, allowed: {MIN_POINTS} to {MAX_POINTS}", about=where)
    for k, row in enumerate(profile):
        if not all(abs(number) <= MAX_VALUE for number in row):  # NaN is not, either
            text = ", ".join(f"{number:g}" for number in row)
            yield Finding(f"found {text}, allowed: finite numbers of a mechanism", about=f"{where}[{k}]")
    for k, ((before, _), (angle, _)) in enumerate(pairwise(profile), 1):
        if angle <= before:
            message = f"found the angle {angle:g} rad after {before:g} rad"
            yield Finding(f"{message}, allowed: angles that increase", about=f"{where}[{k}]")
    if profile and profile[-1][0] - profile[0][0] >= TURN - 1e-9:
        span = f"found angles over {profile[-1][0] - profile[0][0]:.6g} rad"
        reason = "the first point repeats after it"
        yield Finding(f"{span}, allowed: less than a full turn: {reason}", about=where)


# --- controls


def _validate_controls(parts: Parts) -> Iterator[Finding]:
    """Yield errors of controls, and unknown names in functions of them."""
    for control in parts.controls:
        yield from _validate_control(f"controls.{control.name}", control)
    names = sorted({control.name for control in parts.controls})
    driving = (*parts.joint_functions, *parts.length_functions)
    unknown: set[str] = set()
    for where, function in (*parts.control_functions, *driving):
        for name in sorted(function.names.difference(names)):
            unknown.add(name)
            yield Finding(f"control {format_unknown_name(name, names)}", about=where)
    for cycle in _iter_cycles(parts.controls):
        way = " -> ".join((*cycle, cycle[0]))
        message = f"is a function of itself: {way}; allowed: functions of other controls"
        yield Finding(message, about=f"controls.{cycle[0]}.value")
    yield from _validate_use(parts.controls, driving, unknown)


def _validate_control(where: str, control: Control) -> Iterator[Finding]:
    if not is_control_name(control.name):
        allowed = "a letter, then letters, digits, _; not pi, a function or a word of Python"
        yield Finding(f"found {format_value(control.name)} as a name, allowed: {allowed}", about=where)
    if control.value is not None:
        return
    lower, start, upper = control.lower, control.start, control.upper
    if not lower <= upper:
        message = f"found {lower:g}, above upper, {upper:g}; allowed: at most upper"
        yield Finding(message, about=f"{where}.lower")
    elif not math.isfinite(start):
        yield Finding(f"found {start:g}, allowed: a finite number", about=f"{where}.start")
    elif not lower <= start <= upper:
        yield Finding(f"found {start:g}, allowed: {lower:g} to {upper:g}", about=f"{where}.start")


def _iter_cycles(controls: tuple[Control, ...]) -> Iterator[list[str]]:
    """Yield the names of controls that are functions of each other, in a ring."""
    names = {control.name for control in controls}
    needs = {
        control.name: control.value.names & names if control.value else frozenset() for control in controls
    }
    while needs:
        while ready := [name for name, needed in needs.items() if not needed & needs.keys()]:
            for name in ready:
                del needs[name]
        if needs:  # each of these needs another of these
            way = [next(iter(needs))]
            while (following := min(needs[way[-1]] & needs.keys())) not in way:
                way.append(following)
            cycle = way[way.index(following) :]
            yield cycle
            for name in cycle:
                del needs[name]


def _validate_use(
    controls: tuple[Control, ...], driving: Sequence[PlacedExpression], unknown: set[str]
) -> Iterator[Finding]:
    """Yield controls that drive nothing, except those for which an unknown name may stand."""
    names = [control.name for control in controls]
    functions = {control.name: control.value.names for control in controls if control.value is not None}
    added = {name for _, function in driving for name in function.names}
    added |= {closest_name(name, names) or "" for name in unknown}
    used: set[str] = set()
    while added:
        used |= added
        added = {name for user in added for name in functions.get(user, ())} - used
    for name in names:
        if name not in used:
            message = "drives nothing; allowed: controls that drive a joint or an element"
            yield Finding(message, about=f"controls.{name}", kind="idle")


# --- values


def validate_values(parts: Parts, at: str = "where controls start") -> Iterator[Finding]:
    """Yield errors of the values of functions, at the starts of controls and over their ranges.

    Args:
        parts: The parts.
        at: The values of the controls, as messages name them.
    """
    values = _control_values(parts.controls, {})
    finite = {name: float(value) for name, value in values.items() if math.isfinite(value)}
    for where, function in (*parts.control_functions, *parts.joint_functions, *parts.length_functions):
        value = float(function.value(finite)) if function.names <= finite.keys() else 0.0
        if not abs(value) <= MAX_VALUE:
            allowed = f"{MAX_VALUE:g} at most, in m or rad" if math.isfinite(value) else "a finite number"
            yield Finding(f"found {value:g} {at}, allowed: {allowed}", about=where)
    yield from _validate_lengths(parts, finite, at)
    for joint in parts.joints:
        if len(joint.motion) == 9 and all(entry.names <= finite.keys() for entry in joint.motion):
            yield from _validate_motion(joint, parts.controls, at)


def _control_values(controls: tuple[Control, ...], settings: Mapping[str, Element]) -> dict[str, Element]:
    """Return the value of each control, by `settings` or its start, except those of a cycle."""
    values: dict[str, Element] = {}
    for control in sort_controls(controls):
        if control.value is None:
            values[control.name] = settings.get(control.name, control.start)
        else:
            values[control.name] = control.value.value(values)
    return values


def _validate_lengths(parts: Parts, values: Mapping[str, float], at: str) -> Iterator[Finding]:
    """Yield lengths that are too small; h and offsets may be less than 0."""
    for element, (where, function) in zip(parts.elements, parts.length_functions, strict=True):
        if element.length_key == "d" and function.names <= values.keys():
            length, lines = float(function.value(values)), element.kind == "crc"
            if length < 0.0 or (length == 0.0 and not lines):
                allowed = "0 or more" if lines else "more than 0"
                yield Finding(f"found {length:g} m {at}, allowed: {allowed}", about=where)


def _validate_motion(joint: Joint, controls: tuple[Control, ...], at: str) -> Iterator[Finding]:
    """Yield a user joint whose m and n are not orthonormal at the start, else along each control."""
    where = f"joints.{joint.name}.n"
    errors = _worst_axes(joint, _control_values(controls, {}))[1]
    if not np.max(np.abs(errors)) <= AXES_TOLERANCE:
        yield Finding(_format_axes_error(errors, f" {at}"), about=where)
        return
    for control in controls:
        if control.value is None:
            samples = np.linspace(*sample_range(control), SAMPLES)
            k, errors = _worst_axes(joint, _control_values(controls, {control.name: samples}))
            if not np.max(np.abs(errors)) <= AXES_TOLERANCE:
                place = f" at {control.name} = {samples[k]:.6g}"
                yield Finding(_format_axes_error(errors, place), about=where)


def _worst_axes(joint: Joint, values: Mapping[str, Element]) -> tuple[int, FloatArray]:
    """Return the sample with the largest of the errors |m| - 1, |n| - 1 and m . n, and these.

    Args:
        joint: A user joint.
        values: Of each control a number, or numbers of shape (n,).
    """
    entries = (np.asarray(entry.value(values), float) for entry in joint.motion[:6])
    m, n = np.stack(np.broadcast_arrays(*entries)).reshape(2, 3, -1)
    with np.errstate(all="ignore"):  # NaN is the worst
        errors = np.array(
            [np.linalg.norm(m, axis=0) - 1.0, np.linalg.norm(n, axis=0) - 1.0, np.sum(m * n, axis=0)]
        )
    k = int(np.argmax(np.max(np.abs(np.nan_to_num(errors, nan=np.inf)), axis=0)))
    return k, errors[:, k]


def _validate_lines(parts: Parts) -> Iterator[Finding]:
    """Yield crc elements whose lines are parallel at the start of assembly; all else must be valid."""
    elements = [element for element in parts.elements if element.kind == "crc"]
    if not elements:
        return
    mechanism = build_mechanism(parts)
    with np.errstate(all="ignore"):  # starts as large as 1e300
        poses = mechanism.poses(mechanism.start.tolist())  # constants: right angles are exact
    for element in elements:
        first, second = (
            poses[name].rotate(n) for name, n in zip(element.bodies, element.normals, strict=True)
        )
        normal = cross(first, second)
        sine = math.sqrt(dot(normal, normal))
        if not sine >= MIN_SINE:
            message = f"the lines are parallel where assembly starts: |n1 x n2| = {sine:.3g}; allowed: more"
            yield Finding(message, about=f"elements.{element.name}.n", kind="parallel")
