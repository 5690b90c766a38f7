"""A network as tables in m and rad that need no other file: the inverse of `load_network`.

`network_tables` writes arms and Denavit-Hartenberg elements as joints and bodies. Functions of controls keep
their text, with the factors of the units in their file; so do the values of controls. The third axis of a
frame is not stored, since it is m x n: read back, it may differ in the last digit. `with_start` changes where
a network starts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from urmpipe_models.elementwise import Vector
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.parts import (
    POSE_UNITS,
    ConstraintElement,
    Control,
    Joint,
    exceeded_limits,
)


def network_tables(network: Network) -> dict[str, Any]:
    """Return the tables of a network, of texts, finite numbers, lists and dictionaries alone.

    `load_network` makes an equal network of them; docs/networks.md has the keys.

    Args:
        network: The network.
    """
    tables: dict[str, Any] = {
        "name": network.name,
        "description": network.description,
        "source": network.source,
        "length_unit": "m",
        "angle_unit": "rad",
        "ground": network.ground,
        "controls": {control.name: _control_table(control) for control in network.controls},
        "bodies": {
            body.name: {"start": _numbers(body.start)} if body.start else {} for body in network.bodies
        },
        "joints": {joint.name: _joint_table(joint) for joint in network.joints},
        "elements": {element.name: _element_table(element) for element in network.elements},
    }
    return {key: value for key, value in tables.items() if value not in ("", {})}


def _control_table(control: Control) -> dict[str, Any]:
    if control.value is not None:
        return {"value": control.value.text}
    limits = {"lower": control.lower, "upper": control.upper}
    finite = {key: float(limit) for key, limit in limits.items() if math.isfinite(limit)}
    return {"start": float(control.start), **finite}


def _joint_table(joint: Joint) -> dict[str, Any]:
    table: dict[str, Any] = {"kind": joint.kind, "bodies": list(joint.bodies)}
    if joint.kind == "user":
        texts = [expression.text for expression in joint.motion]
        return {**table, "m": texts[:3], "n": texts[3:6], "a": texts[6:]}
    axes = [frame.columns for frame in joint.frames]
    table["m"], table["n"] = [_numbers(m) for m, _, _ in axes], [_numbers(n) for _, n, _ in axes]
    table["a"] = [_numbers(frame.translation) for frame in joint.frames]
    if joint.start:
        table["start"] = _numbers(joint.start)
    if joint.values:
        texts = ["" if value is None else value.text for value in joint.values]  # "" of a free variable
        table["value"] = texts if len(texts) > 1 else texts[0]
    if joint.kind == "helical":
        table["pitch"] = float(joint.pitch)
    starts = joint.start or (0.0,) * len(joint.units)
    if not any(exceeded_limits(joint, starts, is_coupled=False)):  # files refuse a start beyond limits
        for key, limits in zip(("lower", "upper"), zip(*joint.limits, strict=True), strict=False):
            table[key] = _numbers(limits) if len(limits) > 1 else float(limits[0])
    return table


def _element_table(element: ConstraintElement) -> dict[str, Any]:
    table: dict[str, Any]
    if element.is_pair:
        table = {"kind": element.kind, "joints": list(element.joints), "offset": element.length.text}
        if element.kind == "gear":
            return {**table, "teeth": _numbers(element.teeth)}
        if element.kind == "rack":
            return {**table, "radius": element.radius}
        return {**table, "profile": [_numbers(point) for point in element.profile]}
    points, normals = [_numbers(point) for point in element.points], [_numbers(n) for n in element.normals]
    table = {"kind": element.kind, "bodies": list(element.bodies)}
    if element.kind == "eg":
        return {**table, "a": points[1], "n": normals[0], "h": element.length.text}
    if element.kind != "gg":
        table["n"] = normals if element.kind == "crc" else normals[0]
    return {**table, "a": points, "d": element.length.text}


def _numbers(values: Sequence[float] | Vector) -> list[float]:
    return [float(value) for value in values]


def with_start(network: Network, x: Sequence[float]) -> Network:
    """Return a network that starts at a configuration.

    Args:
        network: The network.
        x: The variables of its mechanism in [m], [rad] and as controls are given, shape (variables,).
    """
    mechanism = build_mechanism(network)
    places, roots = mechanism.variable_index, mechanism.graph.roots[1:]

    def start_of(owner: str, old: Sequence[float], count: int) -> tuple[float, ...]:
        """Return the variables of an owner, and the old start of those that are driven."""
        filled = old or (0.0,) * count
        return tuple(float(x[places[owner, k]]) if (owner, k) in places else filled[k] for k in range(count))

    controls = (
        replace(control, start=start_of(control.name, (control.start,), 1)[0]) for control in network.controls
    )
    joints = (
        replace(joint, start=start_of(joint.name, joint.start, len(joint.units))) for joint in network.joints
    )
    bodies = (
        replace(body, start=start_of(body.name, body.start, len(POSE_UNITS))) if body.name in roots else body
        for body in network.bodies
    )
    return replace(network, controls=tuple(controls), joints=tuple(joints), bodies=tuple(bodies))
