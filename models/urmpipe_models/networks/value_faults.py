"""What is wrong with a network at values of its controls: numbers, lengths, user joints, parallel lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.elementwise import Element, cross, dot
from urmpipe_models.errors import Finding
from urmpipe_models.networks.mechanism import mechanism_of
from urmpipe_models.networks.parts import ORTHONORMAL, Control, Joint, Parts, ordered_controls, ranged

LARGEST = 1e9
"""No length in [m] or angle in [rad] of a mechanism is larger: rounding would leave nothing of it."""

PARALLEL = 1e-9
"""Below this sine of their angle two lines have no common normal."""

SAMPLES = 11
"""At so many values of a control, from its least to its largest, a user joint is looked at."""


def value_faults(parts: Parts, at: str = "where controls start") -> Iterator[Finding]:
    """Yield what is wrong with the values of functions, where controls start and over their ranges.

    Args:
        parts: The parts.
        at: Where controls start, in words.
    """
    values = control_values(parts.controls, {})
    finite = {name: float(value) for name, value in values.items() if math.isfinite(value)}
    for where, one in (*parts.between_controls, *parts.functions, *parts.lengths):
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
    for one in ordered_controls(controls):
        found[one.name] = given.get(one.name, one.start) if one.value is None else one.value.value(found)
    return found


def _length_faults(parts: Parts, values: Mapping[str, float], at: str) -> Iterator[Finding]:
    """Yield lengths that are too small where controls start; h and offsets may be less than 0."""
    for element, (where, function) in zip(parts.elements, parts.lengths, strict=True):
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
    if not np.max(np.abs(worst)) <= ORTHONORMAL:
        yield Finding(not_orthonormal(worst, f" {at}"), about=where)
        return
    for one in controls:
        if one.value is None:
            low, high = ranged(one)
            sampled = np.linspace(low, high, SAMPLES)
            k, worst = _worst(joint, control_values(controls, {one.name: sampled}))
            if not np.max(np.abs(worst)) <= ORTHONORMAL:
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
    return f"m and n are not orthonormal{place}: {found}; allowed: {ORTHONORMAL:g} at most"


def lines_faults(parts: Parts) -> Iterator[Finding]:
    """Yield crc elements whose lines are parallel where assembly starts; nothing else may be wrong."""
    skew = [one for one in parts.elements if one.kind == "crc"]
    if not skew:
        return
    mechanism = mechanism_of(parts)
    with np.errstate(all="ignore"):  # starts as large as 1e300
        poses = mechanism.poses(mechanism.start)
    for element in skew:
        first, second = (
            poses[name].rotate(n) for name, n in zip(element.bodies, element.normals, strict=True)
        )
        normal = cross(first, second)
        sine = math.sqrt(dot(normal, normal))
        if not sine >= PARALLEL:
            message = f"the lines are parallel where assembly starts: |n1 x n2| = {sine:.3g}; allowed: more"
            yield Finding(message, about=f"elements.{element.name}.n", kind="parallel")
