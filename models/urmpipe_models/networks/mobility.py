"""What is found of a network: assemblies, what does not close, and how much moves.

Mobility: how many ways a network moves, which constraints are redundant, and whether only here.

A network as tables in m and rad that need no other file: the inverse of `load_network`.

Arms and Denavit-Hartenberg elements are in them as joints and bodies. Functions of
controls stay as they are, with the factors that their file's units gave them; so do the values of controls.
The third axis of a frame is not stored, since it is m x n: read back, it may differ in the last digit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from urmpipe_models.elementwise import FloatArray, IndexArray, Vector
from urmpipe_models.networks.closure import descend, released, scaled_closure, spinning_parts
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.parts import (
    POSE_UNITS,
    Body,
    ConstraintElement,
    Control,
    Expression,
    Joint,
    exceeded_limits,
)

NetworkKind = Literal["mechanism", "structure"]


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """A configuration in which everything closes, or one that comes as near to that as was found.

    Attributes:
        values: The values of each control, joint (driven ones, too) and body with freedoms of its own, by its
            name, in [rad] and [m] by `Joint.units` and `POSE_UNITS`, of a control as it is given.
        poses: The bodies in the ground, the ground first, in the order of `Network.body_names`, as matrices
            [-] and [m], shape (bodies, 4, 4).
        residual: The largest gap in [m] and [rad].
        mobility: Variables less the rank of the Jacobian.
    """

    values: dict[str, tuple[float, ...]]
    poses: FloatArray
    residual: float
    mobility: int


@dataclass(frozen=True, slots=True)
class Gap:
    """What does not close.

    Attributes:
        name: The cut joint, or the element.
        loop: The names of the joints of its loop; of an element its own.
        metres: How far apart it is in [m]; what an element is too long or too short by.
        radians: By which angle it is turned away in [rad]; what a gear or a rocker is off by.
    """

    name: str
    loop: tuple[str, ...]
    metres: float
    radians: float


@dataclass(frozen=True, slots=True)
class Redundant:
    """A constraint that forbids what others forbid already.

    Attributes:
        joint: The joint or the element.
        constraint: Which of its constraints, such as "rotation about m".
    """

    joint: str
    constraint: str


@dataclass(frozen=True, slots=True)
class Mobility:
    """How much of an assembled network moves.

    Attributes:
        variables: How many there are: controls that can be set, free variables of joints, six of each body
            that no joint ties to the ground.
        rank: Of the Jacobian.
        kutzbach: 6 (bodies - 1) - sum of (6 - f) - elements - what controls take.
        redundant: Constraints whose loss would set nothing free; mobility less kutzbach of them.
        idle: Bodies that spin about the line through two global joints and move nothing else; those that spin
            together joined by " + ".
        nearby: The mobility at configurations near to this one, that are assembled, too.
    """

    variables: int
    rank: int
    kutzbach: int
    redundant: tuple[Redundant, ...]
    idle: tuple[str, ...]
    nearby: int

    @property
    def mobility(self) -> int:
        """Variables less rank."""
        return self.variables - self.rank

    @property
    def special(self) -> bool:
        """Whether the rank falls here against assembled configurations nearby."""
        return self.nearby < self.mobility

    @property
    def kind(self) -> NetworkKind:
        """A mechanism if anything but idle spins moves, else a structure."""
        return "mechanism" if self.nearby > len(self.idle) else "structure"


RANK = 1e-7
"""Singular values below this part of the largest count as 0: a configuration closes to about 1e-13, one at
which the rank falls to the root of that."""

NEARBY = 1e-2
"""How far configurations nearby are, in lengths of the mechanism and [rad]."""

PROBES = 8
"""How many of them are looked at."""

MOVED = 0.3
"""Share of `NEARBY` that a configuration nearby must be away: of a structure that only seems to move each
comes back."""

ALIKE = 0.999
"""Redundant constraints that raise the rank this much as clearly as the clearest are equal."""


def mobility_at(mechanism: Mechanism, x: FloatArray, columns: IndexArray) -> int:
    """Return how many of some variables are left over by the rank of the Jacobian.

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
        columns: The numbers of those that may change, shape (k,) [-].
    """
    return len(columns) - _rank(scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, columns, 0])


def mobility_of(mechanism: Mechanism, x: FloatArray) -> Mobility:
    """Return how an assembled network moves; controls are variables.

    Args:
        mechanism: The network.
        x: The variables of an assembly, shape (variables,), in [m], [rad] and as controls are given.
    """
    variables = len(mechanism.variables)
    jacobian = scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, :, 0]
    rank = _rank(jacobian)
    return Mobility(
        variables,
        rank,
        variables - mechanism.rows,
        tuple(_redundant(mechanism, x, jacobian, mechanism.rows - rank)),
        spinning_parts(mechanism, x),
        mobility_nearby(mechanism, x, np.arange(variables)),
    )


def stuck_controls(mechanism: Mechanism, x: FloatArray) -> tuple[str, ...]:
    """Return the controls that cannot be moved at an assembly, each with those before it held.

    Args:
        mechanism: The network.
        x: The variables of an assembly, shape (variables,), in [m], [rad] and as controls are given.
    """
    ways = _null_space(scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, :, 0])[mechanism.controls]
    stuck = []
    for k, row in enumerate(mechanism.controls):
        if _rank(ways[: k + 1], least=RANK) == _rank(ways[:k], least=RANK):
            stuck.append(mechanism.variables[row].owner)
    return tuple(stuck)


def _rank(jacobian: FloatArray, least: float = 0.0) -> int:
    """Return the rank of a scaled Jacobian; singular values of `least` or less count as 0, too."""
    if not (jacobian.size and np.isfinite(jacobian).all()):
        return 0
    values = np.linalg.svd(jacobian, compute_uv=False)
    return int((values > max(RANK * values[0], least)).sum()) if values[0] > 0.0 else 0


def _null_space(jacobian: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what a scaled Jacobian [-] maps to 0, shape (variables, mobility)."""
    if not len(jacobian):
        return np.eye(jacobian.shape[1])
    return np.asarray(np.linalg.svd(jacobian)[2][_rank(jacobian) :].T)


def mobility_nearby(mechanism: Mechanism, x: FloatArray, columns: IndexArray) -> int:
    """Return the mobility at assembled configurations near one; 0 if there are none.

    They are looked for along ways in which the Jacobian lets it move: without one it only seems to move.

    Args:
        mechanism: The network.
        x: The variables of an assembly, shape (variables,), in [m], [rad] and as controls are given.
        columns: The numbers of those that may change, shape (k,) [-].
    """
    ways = _null_space(scaled_closure(mechanism, x[:, np.newaxis]).jacobian[:, columns, 0])
    if not ways.size:
        return 0
    steps = np.random.default_rng(0).normal(size=(ways.shape[1], PROBES))
    scales = mechanism.column_scales[columns, np.newaxis]
    starts = np.repeat(x[:, np.newaxis], PROBES, axis=1)
    starts[columns] += scales * NEARBY * (ways @ (steps / np.linalg.norm(steps, axis=0)))
    near = descend(mechanism, starts, columns)
    away = np.linalg.norm((near.x[columns] - x[columns, np.newaxis]) / scales, axis=0)
    there = np.flatnonzero((away > MOVED * NEARBY) & (near.gap < RANK))
    ranks = [
        _rank(one)
        for one in scaled_closure(mechanism, near.x[:, there]).jacobian[:, columns].transpose(2, 0, 1)
    ]
    return min((len(columns) - rank for rank in ranks), default=0)


def _redundant(mechanism: Mechanism, x: FloatArray, jacobian: FloatArray, count: int) -> Iterator[Redundant]:
    """Yield redundant constraints, `count` of them: set free one after the other, each raises the rank.

    The one is taken that does so most clearly; of equal ones the last in the file.
    """
    if count <= 0:
        return
    unreached = np.linalg.svd(jacobian)[0][:, mechanism.rows - count :]
    constraints = list(released(mechanism, x))
    reach = np.array([column @ unreached for _, _, column in constraints])
    for _ in range(count):
        size = np.linalg.norm(reach, axis=1)
        best = int(np.flatnonzero(size >= ALIKE * size.max())[-1])
        yield Redundant(*constraints[best][:2])
        along = reach[best] / size[best]
        reach = reach - np.outer(reach @ along, along)


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
        "bodies": {body.name: _body_table(body) for body in network.bodies},
        "joints": {joint.name: _joint_table(joint) for joint in network.joints},
        "elements": {element.name: _element_table(element) for element in network.elements},
    }
    return {key: value for key, value in tables.items() if value not in ("", {})}


def with_start(network: Network, x: Sequence[float]) -> Network:
    """Return a network that starts at a configuration.

    Args:
        network: The network.
        x: The variables of its mechanism in [m], [rad] and as controls are given, shape (variables,).
    """
    mechanism = build_mechanism(network)
    places = mechanism.variable_index

    def start_of(owner: str, old: Sequence[float], count: int) -> tuple[float, ...]:
        """Return the variables of an owner, and the old start of those that are driven."""
        filled = old or (0.0,) * count
        return tuple(float(x[places[owner, k]]) if (owner, k) in places else filled[k] for k in range(count))

    roots = mechanism.graph.roots[1:]
    return replace(
        network,
        controls=tuple(
            replace(control, start=start_of(control.name, (control.start,), 1)[0])
            for control in network.controls
        ),
        joints=tuple(
            replace(joint, start=start_of(joint.name, joint.start, len(joint.units)))
            for joint in network.joints
        ),
        bodies=tuple(
            replace(body, start=start_of(body.name, body.start, len(POSE_UNITS)))
            if body.name in roots
            else body
            for body in network.bodies
        ),
    )


def _control_table(control: Control) -> dict[str, Any]:
    if control.value is not None:
        return {"value": control.value.text}
    limits = {"lower": control.lower, "upper": control.upper}
    return {
        "start": float(control.start),
        **{key: float(limit) for key, limit in limits.items() if math.isfinite(limit)},
    }


def _body_table(body: Body) -> dict[str, Any]:
    return {"start": _numbers(body.start)} if body.start else {}


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
        texts = [_text(value) for value in joint.values]
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
        own: dict[str, Any] = {"gear": {"teeth": _numbers(element.teeth)}, "rack": {"radius": element.radius}}
        profile: dict[str, Any] = {"profile": [_numbers(point) for point in element.profile]}
        table = {"kind": element.kind, "joints": list(element.joints), "offset": element.length.text}
        return {**table, **own.get(element.kind, profile)}
    points, normals = [_numbers(point) for point in element.points], [_numbers(n) for n in element.normals]
    table = {"kind": element.kind, "bodies": list(element.bodies)}
    if element.kind == "eg":
        return {**table, "a": points[1], "n": normals[0], "h": element.length.text}
    if element.kind != "gg":
        table["n"] = normals if element.kind == "crc" else normals[0]
    return {**table, "a": points, "d": element.length.text}


def _text(drive: Expression | None) -> str:
    """Return what drives a variable as files have it: "" where it is free."""
    return "" if drive is None else drive.text


def _numbers(values: Sequence[float] | Vector) -> list[float]:
    return [float(value) for value in values]
