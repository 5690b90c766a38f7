"""A network in numbers: its variables, the poses of its bodies, what does not close, and the Jacobian of that."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.elementwise import Element, Vector, add, cross, dot, scale, subtract
from urmpipe_models.networks.expressions import Expression, Slopes
from urmpipe_models.networks.graph import Branch, Graph, graph_of
from urmpipe_models.networks.joint_motion import Screws, forbidden, joint_frame, joint_screws
from urmpipe_models.networks.network import (
    POSE_UNITS,
    ConstraintElement,
    Joint,
    Network,
    ordered_controls,
)
from urmpipe_models.networks.rotations import rotation_of, turning_of, untwisted
from urmpipe_models.orientation import quaternions, rotation_vectors
from urmpipe_models.transform import Transform


MEASURES = {"gg": "length", "eg": "height", "crc": "distance", "gc": "radius"}
"""What an element of a kind holds."""


class Variable(NamedTuple):
    """A variable of a network.

    Attributes:
        owner: The control, the joint or the body that it is of.
        kind: What that is.
        index: Its number among those of its owner.
        unit: m, rad, or "" of a control.
    """

    owner: str
    kind: Literal["control", "joint", "body"]
    index: int
    unit: str


@dataclass(frozen=True, slots=True)
class Given:
    """A value that is a variable or a function of controls.

    Attributes:
        value: The value, any element.
        slopes: Its derivatives by the number of each variable.
    """

    value: Element
    slopes: dict[int, Element] = field(default_factory=dict)


class Pose(NamedTuple):
    """A body's pose and which joints move it.

    Attributes:
        frame: The body in the ground.
        movers: The sign with which the motion of each joint, or body with freedoms of its own, moves it.
    """

    frame: Transform
    movers: dict[str, int]


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """What does not close at n configurations, and how that changes.

    Rows: of each cut joint the gap x, y, z in [m] and its rotation vector in [rad], both seen from where the
    joint should be; then of each element what it is too long by in [m].

    Attributes:
        residual: In [m] and [rad], shape (rows, n).
        jacobian: In these a unit of each variable, shape (rows, variables, n).
    """

    residual: FloatArray
    jacobian: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Equation:
    """Rows of a closure.

    Attributes:
        rows: Which they are.
        residual: What does not close in [m] and [rad], shape (k, n).
        carrier: What turns a twist in the ground into the rates of that, shape (k, 6, n).
        movers: The sign with which each mover's twist counts.
        slopes: What the rows fall by a unit of variables.
    """

    rows: slice
    residual: FloatArray
    carrier: FloatArray
    movers: dict[str, int]
    slopes: dict[int, Element]


@dataclass(frozen=True)
class Mechanism:
    """A network whose loops are cut, ready to be computed.

    Attributes:
        network: The network.
        graph: Its graph.
    """

    network: Network
    graph: Graph

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Controls that can be set, the free variables of joints, and the poses of bodies that none ties."""
        controls = [
            Variable(one.name, "control", 0, "") for one in self.network.controls if one.value is None
        ]
        joints = [
            Variable(joint.name, "joint", k, unit)
            for joint in self.network.joints
            for k, (unit, drive) in enumerate(zip(joint.units, joint.drives, strict=True))
            if drive is None
        ]
        bodies = [
            Variable(name, "body", k, unit)
            for name in self.graph.roots[1:]
            for k, unit in enumerate(POSE_UNITS)
        ]
        return (*controls, *joints, *bodies)

    @cached_property
    def places(self) -> dict[tuple[str, int], int]:
        """The number of each variable by its owner and its number there."""
        return {(one.owner, one.index): k for k, one in enumerate(self.variables)}

    @cached_property
    def controls(self) -> IndexArray:
        """The numbers of the variables that are controls."""
        return np.array([k for k, one in enumerate(self.variables) if one.kind == "control"], dtype=np.intp)

    @cached_property
    def free(self) -> IndexArray:
        """The numbers of the variables that assembly finds: all but the controls."""
        return np.arange(len(self.controls), len(self.variables))

    @cached_property
    def rotations(self) -> tuple[slice, ...]:
        """Where three variables after each other are a rotation vector that nothing drives."""
        firsts = [
            k
            for k, one in enumerate(self.variables)
            if (one.kind == "body" and one.index == 3) or (one.index == 0 and self._is_global(one))
        ]
        return tuple(slice(k, k + 3) for k in firsts)

    @cached_property
    def angles(self) -> IndexArray:
        """The numbers of the free variables that are the same after a full turn: not those of a helix."""
        kinds = {one.name: one.kind for one in self.network.joints}
        turning = ("revolute", "cylindrical")
        found = [
            k
            for k in self.free
            if self.variables[k].unit == "rad" and kinds.get(self.variables[k].owner) in turning
        ]
        return np.array(found, dtype=np.intp)

    def _is_global(self, one: Variable) -> bool:
        joints = {joint.name: joint for joint in self.network.joints}
        joint = joints.get(one.owner) if one.kind == "joint" else None
        return joint is not None and joint.kind == "global" and not any(joint.drives)

    @cached_property
    def start(self) -> FloatArray:
        """The values from where assembly starts, in [m], [rad] and as controls are given, shape (variables,)."""
        given: dict[str, Sequence[float]] = {one.name: (one.start,) for one in self.network.controls}
        given |= {one.name: one.start or (0.0,) * len(one.units) for one in self.network.joints}
        given |= {
            one.name: one.start or (0.0,) * 6 for one in self.network.bodies if one.name in self.graph.roots
        }
        return np.array([given[one.owner][one.index] for one in self.variables], dtype=np.float64)

    @property
    def rows(self) -> int:
        """How many equations close it."""
        return 6 * len(self.graph.cuts) + len(self.network.elements)

    @cached_property
    def length(self) -> float:
        """The mechanism's length in [m]: the largest between two joints of a body, or of an element; 1 if 0."""
        spans = [abs(float(one.value)) for one in self.lengths(self.start)]
        points: dict[str, list[Vector]] = {name: [] for name in self.network.body_names}
        for joint in self.network.joints:
            for name, frame in zip(joint.bodies, joint.frames, strict=True):
                points[name].append(frame.translation)
        for element in self.network.elements:
            for name, point in zip(element.bodies, element.points, strict=True):
                points[name].append(point)
        for some in points.values():
            spans += [float(np.linalg.norm(subtract(a, b))) for a, b in combinations(some, 2)]
        return max(spans, default=0.0) or 1.0

    @cached_property
    def row_scales(self) -> FloatArray:
        """What makes each row one of [-] and [rad], shape (rows,): 1 / length of those in [m]."""
        loop = [1.0 / self.length] * 3 + [1.0] * 3
        return np.array(loop * len(self.graph.cuts) + [1.0 / self.length] * len(self.network.elements))

    @cached_property
    def column_scales(self) -> FloatArray:
        """A step of each variable, shape (variables,): the length, 1 rad, of a control what moves so much."""
        scales = np.array([self.length if one.unit == "m" else 1.0 for one in self.variables])
        moved = np.zeros(len(self.variables))
        driven = [(given, one) for one in self.network.joints for given, one in self._driven(one)]
        driven += [(given, "m") for given in self.lengths(self.start)]
        for given, unit in driven:
            for k, slope in given.slopes.items():
                moved[k] += (float(slope) / (self.length if unit == "m" else 1.0)) ** 2
        at = self.controls
        scales[at] = np.where(moved[at] > 0.0, 1.0 / np.sqrt(np.where(moved[at] > 0.0, moved[at], 1.0)), 1.0)
        return scales

    def _driven(self, joint: Joint) -> Iterator[tuple[Given, str]]:
        """Yield what controls make of a joint at the start, and the unit."""
        controls = self.control_slopes(self.start)
        for drive, unit in zip(joint.drives, joint.units, strict=True):
            if drive is not None:
                yield _of_controls(drive, controls), unit
        for k, part in enumerate(joint.motion):
            yield _of_controls(part, controls), "m" if k >= 6 else "rad"

    def control_slopes(self, x: Sequence[Element] | FloatArray) -> dict[str, Given]:
        """Return the value of each control, and its derivatives by the variables.

        Args:
            x: The variables, one element each.
        """
        found: dict[str, Given] = {}
        for one in ordered_controls(self.network.controls):
            if one.value is None:
                k = self.places[one.name, 0]
                found[one.name] = Given(x[k], {k: 1.0})
            else:
                found[one.name] = _of_controls(one.value, found)
        return found

    def lengths(self, x: Sequence[Element] | FloatArray) -> list[Given]:
        """Return the length of each element in [m], and its derivatives."""
        controls = self.control_slopes(x)
        return [_of_controls(one.length, controls) for one in self.network.elements]

    def joint_values(self, joint: Joint, x: Sequence[Element] | FloatArray) -> list[Given]:
        """Return the value of each variable of a joint, free or driven, and its derivatives."""
        return self._values(joint, x, self.control_slopes(x))

    def _values(self, joint: Joint, x: Sequence[Element] | FloatArray, of: dict[str, Given]) -> list[Given]:
        """Return those of a joint at the values of controls."""
        found = []
        for index, drive in enumerate(joint.drives):
            if drive is None:
                k = self.places[joint.name, index]
                found.append(Given(x[k], {k: 1.0}))
            else:
                found.append(_of_controls(drive, of))
        return found or [_of_controls(one, of) for one in joint.motion]

    def poses(self, x: Sequence[Element] | FloatArray) -> dict[str, Transform]:
        """Return the pose of each body in the ground.

        Args:
            x: The variables, one element each: floats, arrays of shape (n,), or symbols.
        """
        return {name: one.frame for name, one in self._posed(x).items()}

    def _posed(self, x: Sequence[Element] | FloatArray) -> dict[str, Pose]:
        """Return the pose of each body, and what moves it."""
        controls = self.control_slopes(x)
        posed = {self.network.ground: Pose(Transform(), {})}
        for name in self.graph.roots[1:]:
            first = self.places[name, 0]
            position, vector = (
                (x[first], x[first + 1], x[first + 2]),
                (x[first + 3], x[first + 4], x[first + 5]),
            )
            posed[name] = Pose(Transform(rotation_of(vector).rotation, position), {name: 1})
        for branch in self.graph.branches:
            joint, parent = self.network.joints[branch.joint], posed[branch.parent]
            moved = joint_frame(joint, [one.value for one in self._values(joint, x, controls)])
            posed[branch.child] = Pose(
                _across(parent.frame, joint, moved, branch), {**parent.movers, joint.name: branch.sign}
            )
        return posed

    def closure(self, x: FloatArray) -> Closure:
        """Return what does not close, and its Jacobian.

        The gap of a cut joint is p and the rotation vector of E = (G_1 A_1 T)^-1 G_2 A_2, which is the
        identity where its loop closes. A change of the variables moves E by the twist of the second body
        against the first, minus the joint's own. An element's length changes by the scalar product of that
        twist and the element's wrench.

        Args:
            x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        """
        n = x.shape[1]
        posed, controls = self._posed(x), self.control_slopes(x)
        screws = self._screws(x, posed, controls)
        residual = np.zeros((self.rows, n))
        jacobian = np.zeros((self.rows, len(self.variables), n))
        for equation in self._equations(x, posed, controls):
            residual[equation.rows] = equation.residual
            for mover, sign in equation.movers.items():
                places, twists = screws[mover]
                jacobian[equation.rows, places] += sign * np.einsum("ijn,jkn->ikn", equation.carrier, twists)
            for place, slope in equation.slopes.items():
                jacobian[equation.rows, place] -= slope
        return Closure(residual, jacobian)

    def released(self, x: FloatArray) -> Iterator[tuple[str, str, FloatArray]]:
        """Yield what each constraint forbids: its joint or element, its name, and what it would add to J.

        That is a column in [m] and [rad], shape (rows,), of a joint in [m] along or [rad] about an axis of its
        frame, of a driven variable in its unit, of an element in [m].

        Args:
            x: The variables, shape (variables,), in [m], [rad] and as controls are given.
        """
        at = x[:, np.newaxis]
        posed, controls = self._posed(at), self.control_slopes(at)
        equations = list(self._equations(at, posed, controls))
        for joint in self.network.joints:
            values = [one.value for one in self._values(joint, at, controls)]
            frame = posed[joint.bodies[0]].frame @ joint.frames[0]
            for constraint, (w, v) in forbidden(joint, values, frame):
                twist = _stacked((*w, *v), 1)[:, 0]
                column = np.zeros(self.rows)
                for one in equations:
                    column[one.rows] += one.movers.get(joint.name, 0) * (one.carrier[:, :, 0] @ twist)
                yield joint.name, constraint, column
        for row, element in enumerate(self.network.elements, 6 * len(self.graph.cuts)):
            yield element.name, MEASURES[element.kind], np.eye(self.rows)[row]

    def _equations(
        self, x: FloatArray, posed: dict[str, Pose], controls: dict[str, Given]
    ) -> Iterator[_Equation]:
        """Yield what closes each loop, and what holds each element."""
        n = x.shape[1]
        for k, cut in enumerate(self.graph.cuts):
            joint = self.network.joints[cut]
            moved = joint_frame(joint, [one.value for one in self._values(joint, x, controls)])
            here = posed[joint.bodies[0]].frame @ joint.frames[0] @ moved
            gap = gap_of(here.inverse() @ posed[joint.bodies[1]].frame @ joint.frames[1], n)
            movers = _between(posed, joint.bodies, joint.name)
            yield _Equation(slice(6 * k, 6 * k + 6), gap, _carrier(here, gap), movers, {})
        first = 6 * len(self.graph.cuts)
        for row, element in enumerate(self.network.elements, first):
            length = _of_controls(element.length, controls)
            measured = measure(element, *(posed[name].frame for name in element.bodies))
            wrench = _stacked((*measured.moment, *measured.force), n)[np.newaxis]
            excess = _stacked((measured.distance - length.value,), n)
            movers = _between(posed, element.bodies)
            yield _Equation(slice(row, row + 1), excess, wrench, movers, length.slopes)

    def _screws(
        self, x: FloatArray, posed: dict[str, Pose], controls: dict[str, Given]
    ) -> dict[str, tuple[IndexArray, FloatArray]]:
        """Return of each mover the numbers of variables that move it, and their twists.

        A twist is the angular velocity in [rad] and the velocity in [m] of the point at the ground's origin, a
        unit of the variable, shape (6, k, n).
        """
        n = x.shape[1]
        found = {}
        for joint in self.network.joints:
            values = self._values(joint, x, controls)
            at = posed[joint.bodies[0]].frame @ joint.frames[0]
            found[joint.name] = _combined(joint_screws(joint, [one.value for one in values], at), values, n)
        for name in self.graph.roots[1:]:
            first = self.places[name, 0]
            values = [Given(None, {first + k: 1.0}) for k in range(6)]
            vector = (x[first + 3], x[first + 4], x[first + 5])
            p = posed[name].frame.translation
            turning = [(axis, cross(p, axis)) for axis in turning_of(vector)]
            found[name] = _combined([*_SLIDING, *turning], values, n)
        return found


_SLIDING: Screws = [
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
]
"""The twists of a body that slides along the axes of the ground."""


def mechanism_of(network: Network) -> Mechanism:
    """Return a network in numbers."""
    return Mechanism(network, graph_of(network))


class Measured(NamedTuple):
    """What an element measures between its bodies.

    Attributes:
        distance: In [m].
        moment: Moment about the ground's origin in [m] of the unit force along the element: with it the wrench
            whose product with the twist of the second body against the first is the distance's rate.
        force: The unit force [-].
    """

    distance: Element
    moment: Vector
    force: Vector


def measure(element: ConstraintElement, first: Transform, second: Transform) -> Measured:
    """Return what an element measures: the distance of its points, of a point from its plane or line, of its lines.

    gg: |p_2 - p_1|. eg: n . (p_2 - g_1). crc: |(p_2 - p_1) . u|, u the unit vector of n_1 x n_2. gc: the
    length of what p_2 - p_1 has across n_1. Of crc whose length is the constant 0 the sign stays.

    Args:
        element: The element.
        first: Its first body in the ground.
        second: Its second.

    Source: [KinematicSystems]_ section 3.2.3, with its errata.
    """
    p, q = first.point(element.points[0]), second.point(element.points[1])
    apart = subtract(q, p)
    n = first.rotate(element.normals[0])
    if element.kind == "eg":
        return Measured(dot(n, subtract(q, first.translation)), cross(q, n), n)
    if element.kind == "gg":
        distance, u = _length_and_unit(apart)
        return Measured(distance, cross(p, u), u)
    if element.kind == "gc":
        distance, u = _length_and_unit(subtract(apart, scale(dot(apart, n), n)))
        return Measured(distance, cross(q, u), u)
    return _between_lines(element, p, apart, n, second.rotate(element.normals[1]))


def _between_lines(
    element: ConstraintElement, p: Vector, apart: Vector, n: Vector, other: Vector
) -> Measured:
    """Return the distance of two lines: p + n a, and the line through p + apart along other."""
    sine, u = _length_and_unit(cross(n, other))
    distance = dot(apart, u)
    along = dot(cross(apart, other), u) / sine  # where on the first line the second is nearest
    if not element.meeting:
        sign = np.where(distance < 0.0, -1.0, 1.0)
        distance, u = sign * distance, scale(sign, u)
    return Measured(distance, cross(add(p, scale(along, n)), u), u)


def _length_and_unit(vector: Vector) -> tuple[Element, Vector]:
    """Return the length of a vector and its direction; of a vector of length 0 none in particular."""
    length = np.sqrt(dot(vector, vector))
    return length, scale(1.0 / np.maximum(length, 1e-300), vector)


def gap_of(error: Transform, n: int) -> FloatArray:
    """Return the translation in [m] and the rotation vector in [rad] of n frames, shape (6, n)."""
    rows = _stacked(tuple(entry for row in error.rotation for entry in row), n)
    vector = rotation_vectors(quaternions(rows.T, "matrix"))
    return np.concatenate((_stacked(error.translation, n), vector.T))


def _carrier(here: Transform, gap: FloatArray) -> FloatArray:
    """Return what turns a twist in the ground into the rates of a gap, shape (6, 6, n).

    With the twist (w, v) seen from where the joint should be: p' = v + w x p, and the rotation vector's rate.

    Args:
        here: Where the joint should be.
        gap: Translation in [m] and rotation vector in [rad], shape (6, n).
    """
    n = gap.shape[1]
    turned = _stacked(tuple(entry for row in here.rotation for entry in row), n).reshape(3, 3, n)
    R = turned.transpose(1, 0, 2)  # from the ground into the joint's frame
    origin = _stacked(add(here.translation, here.rotate((gap[0], gap[1], gap[2]))), n)
    x, y, z = origin
    zero = np.zeros(n)
    lever = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]])  # w x o = lever w
    carried = np.zeros((6, 6, n))
    carried[:3, :3] = np.einsum("ijn,jkn->ikn", R, lever)
    carried[:3, 3:] = R
    carried[3:, :3] = np.einsum("ijn,jkn->ikn", untwisted(gap[3:]), R)
    return carried


def _across(parent: Transform, joint: Joint, moved: Transform, branch: Branch) -> Transform:
    """Return the child's frame: that of the second body from the first, or of the first from the second."""
    first, second = joint.frames
    if branch.sign > 0:
        return parent @ first @ moved @ second.inverse()
    return parent @ second @ moved.inverse() @ first.inverse()


def _between(posed: dict[str, Pose], bodies: tuple[str, str], cut: str = "") -> dict[str, int]:
    """Return the sign with which each mover moves the second body against the first, without a cut joint's own."""
    first, second = (posed[name].movers for name in bodies)
    signs = {name: second.get(name, 0) - first.get(name, 0) for name in {**first, **second}}
    if cut:
        signs[cut] = -1
    return {name: sign for name, sign in signs.items() if sign}


def _of_controls(expression: Expression, controls: dict[str, Given]) -> Given:
    """Return the value of a function of controls, and its derivatives by the variables."""
    value, slopes = expression.with_slopes({name: one.value for name, one in controls.items()})
    return Given(value, _chained(slopes, controls))


def _chained(slopes: Slopes, controls: dict[str, Given]) -> dict[int, Element]:
    """Return derivatives by variables from those by controls."""
    found: dict[int, Element] = {}
    for name, slope in slopes.items():
        for k, inner in controls[name].slopes.items():
            found[k] = found.get(k, 0.0) + slope * inner
    return found


def _combined(screws: Screws, values: Sequence[Given], n: int) -> tuple[IndexArray, FloatArray]:
    """Return the twists a unit of each variable from those a unit of each value."""
    places = list(dict.fromkeys(k for one in values for k in one.slopes))
    twists = np.zeros((6, len(places), n))
    for (w, v), one in zip(screws, values, strict=True):
        twist = _stacked((*w, *v), n)
        for k, slope in one.slopes.items():
            twists[:, places.index(k)] += slope * twist
    return np.array(places, dtype=np.intp), twists


def _stacked(elements: Sequence[Element], n: int) -> FloatArray:
    """Return elements as rows, shape (k, n), in their unit."""
    rows = np.empty((len(elements), n))
    for k, one in enumerate(elements):
        rows[k] = one
    return rows
