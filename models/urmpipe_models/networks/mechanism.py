"""The graph of a network: bodies as nodes, joints and constraint elements as edges.

A network in numbers: its variables with their scales, and the poses of its bodies, elementwise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import Element, FloatArray, IndexArray, Vector, subtract
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.elements import transmission
from urmpipe_models.networks.joint_motion import exp3, joint_frame
from urmpipe_models.networks.parts import (
    POSE_UNITS,
    ConstraintElement,
    Expression,
    Gradient,
    Joint,
    Parts,
    sample_range,
    sort_controls,
)

Structure = Literal["tree", "loops", "closed chain"]


@dataclass(frozen=True, slots=True)
class Branch:
    """A joint of the spanning forest.

    Attributes:
        joint: Its number among the joints.
        parent: The body nearer to the root.
        child: The body that the joint moves.
        sign: 1 where the child is the joint's second body, -1 where it is its first.
    """

    joint: int
    parent: str
    child: str
    sign: int


@dataclass(frozen=True)
class Graph:
    """What hangs on what.

    Attributes:
        network: The network.
        roots: The ground, and of each part that no joint ties to it the body that has its freedoms.
        branches: The joints of the spanning forest, each after those that its parent hangs on.
        cuts: The numbers of the joints that close loops: there these are cut.
        clusters: Names of the bodies of each part that joints hold together, that of the ground first.
    """

    network: Parts
    roots: tuple[str, ...]
    branches: tuple[Branch, ...]
    cuts: tuple[int, ...]
    clusters: tuple[tuple[str, ...], ...]

    @cached_property
    def loops(self) -> tuple[tuple[str, ...], ...]:
        """Names of the joints and elements of each loop: of a cut joint the way between its bodies, and it.

        Then, elements one by one, those that close a loop with what ties the parts already.
        """
        edges = [(one.name, *one.bodies) for one in self.network.joints]
        tree = [edges[one.joint] for one in self.branches]
        found = [(*_way(tree, *edges[k][1:]), edges[k][0]) for k in self.cuts]
        for element in self.network.elements:
            way = _way(tree, *element.bodies)
            if way:
                found.append((*way, element.name))
            else:
                tree.append((element.name, *element.bodies))
        return tuple(found)

    @property
    def structure(self) -> Structure:
        """Tree, closed chain (loops, and at each body two joints or elements or more), or loops."""
        if not self.loops:
            return "tree"
        ends = [name for _, one in self.network.constraints for name in one.bodies]
        least = min(ends.count(name) for name in self.network.body_names)
        return "closed chain" if least >= 2 else "loops"


def build_graph(network: Parts) -> Graph:
    """Return the graph of a network, its spanning forest grown joint by joint in breadth."""
    placed = [one.name for one in network.bodies if one.start]
    roots: list[str] = []
    branches: list[Branch] = []
    clusters: list[tuple[str, ...]] = []
    seen: set[str] = set()
    for root in (network.ground, *placed, *network.body_names):
        if root not in seen:
            grown = _grown(network, root, seen)
            roots.append(root)
            branches += grown
            clusters.append((root, *(one.child for one in grown)))
    used = {one.joint for one in branches}
    cuts = tuple(k for k in range(len(network.joints)) if k not in used)
    return Graph(network, tuple(roots), tuple(branches), cuts, tuple(clusters))


def _grown(network: Parts, root: str, seen: set[str]) -> list[Branch]:
    """Return the branches of the part that a body is in; its bodies become seen."""
    branches: list[Branch] = []
    seen.add(root)
    edge = [root]
    while edge:
        body = edge.pop(0)
        for k, joint in enumerate(network.joints):
            for parent, child, sign in ((*joint.bodies, 1), (*joint.bodies[::-1], -1)):
                if parent == body and child not in seen:
                    seen.add(child)
                    edge.append(child)
                    branches.append(Branch(k, parent, child, sign))
    return branches


def _way(tree: Sequence[tuple[str, str, str]], start: str, end: str) -> tuple[str, ...]:
    """Return the names of the edges on the way from a node to another; none if no way leads there."""
    ways: dict[str, tuple[str, ...]] = {start: ()}
    edge = [start]
    while edge and end not in ways:
        node = edge.pop(0)
        for name, first, second in tree:
            for here, there in ((first, second), (second, first)):
                if here == node and there not in ways:
                    ways[there] = (*ways[node], name)
                    edge.append(there)
    return ways.get(end, ())


def components_without(network: Parts, left_out: Iterable[str]) -> list[set[str]]:
    """Return the sets of bodies that hang together by joints and elements without some of these, by name."""
    out = set(left_out)
    edges = [one.bodies for _, one in network.constraints if one.name not in out]
    parts: list[set[str]] = [{name} for name in network.body_names]
    for first, second in edges:
        a, b = (next(part for part in parts if name in part) for name in (first, second))
        if a is not b:
            parts.remove(b)
            a |= b
    return parts


Configuration: TypeAlias = Sequence[Element] | FloatArray
"""The variables, one element each, in [m], [rad] and as controls are given."""

SAMPLES = 11
"""At so many values of a control its effect is looked at."""


@dataclass(frozen=True, slots=True)
class Variable:
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
class ValueWithGradient:
    """A value that is a variable or a function of controls.

    Attributes:
        value: The value, any element.
        gradient: Its derivatives by the number of each variable.
    """

    value: Element
    gradient: dict[int, Element] = field(default_factory=dict)


class Pose(NamedTuple):
    """A body's pose and which joints move it.

    Attributes:
        frame: The body in the ground.
        movers: The sign with which the motion of each joint, or body with freedoms of its own, moves it.
    """

    frame: Transform
    movers: dict[str, int]


class Placements(NamedTuple):
    """Where everything is.

    Attributes:
        bodies: The pose of each body.
        joints: Of each joint the frame a of its first body, in the ground.
    """

    bodies: dict[str, Pose]
    joints: dict[str, Transform]


@dataclass(frozen=True)
class Mechanism:
    """A network whose loops are cut, ready to be computed.

    Attributes:
        network: The network.
        graph: Its graph.
    """

    network: Parts
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
    def variable_index(self) -> dict[tuple[str, int], int]:
        """The number of each variable by its owner and its number there."""
        return {(one.owner, one.index): k for k, one in enumerate(self.variables)}

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """A name per variable: that of its owner, with its number from 1 if the owner has several."""
        owners = [variable.owner for variable in self.variables]
        return tuple(
            owner if owners.count(owner) == 1 else f"{owner}[{variable.index + 1}]"
            for owner, variable in zip(owners, self.variables, strict=True)
        )

    @cached_property
    def controls(self) -> IndexArray:
        """The numbers of the variables that are controls, shape (controls,) [-]."""
        return np.array([k for k, one in enumerate(self.variables) if one.kind == "control"], dtype=np.intp)

    @cached_property
    def free(self) -> IndexArray:
        """The numbers of the variables that assembly finds: all but the controls, shape (free,) [-]."""
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
        """The numbers of free variables that are the same after a full turn, shape (angles,) [-]."""
        coupled = self.network.coupled_joints
        kinds = {one.name: one.kind for one in self.network.joints if one.name not in coupled}
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
        """Where assembly starts, in [m], [rad] and as controls are given, shape (variables,)."""
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
        """The largest distance in [m] between two joints of a body, or length of an element; 1 if it is 0."""
        pairs = zip(self.network.elements, self.lengths(self.start), strict=True)
        spans = [abs(float(length.value)) for one, length in pairs if one.length_key == "d"]
        for some in self.points.values():
            spans += [float(np.linalg.norm(subtract(a, b))) for a, b in combinations(some, 2)]
        return max(spans, default=0.0) or 1.0

    @cached_property
    def points(self) -> dict[str, list[Vector]]:
        """Of each body the points in [m] where joints and elements tie it; a plane or a pair has none."""
        found: dict[str, list[Vector]] = {name: [] for name in self.network.body_names}
        for joint in self.network.joints:
            for name, frame in zip(joint.bodies, joint.frames, strict=True):
                found[name].append(frame.translation)
        for element in (one for one in self.network.elements if not one.is_pair):
            skipped = int(element.kind == "eg")
            for name, point in [*zip(element.bodies, element.points, strict=True)][skipped:]:
                found[name].append(point)
        return found

    @cached_property
    def row_scales(self) -> FloatArray:
        """What makes each row one of [-] and [rad], shape (rows,): 1 / length of those in [m]."""
        loop = [1.0 / self.length] * 3 + [1.0] * 3
        elements = [1.0 / self.length if unit == "m" else 1.0 for unit in self.network.element_units]
        return np.array(loop * len(self.graph.cuts) + elements)

    @cached_property
    def column_scales(self) -> FloatArray:
        """A step of each variable, shape (variables,): the length, 1 rad, of a control what moves so much.

        What moves by a control is the root of its squared slopes, the largest of some values of the control:
        where it starts, its effect may stand still.
        """
        scales = np.array([self.length if one.unit == "m" else 1.0 for one in self.variables])
        for k in self.controls:
            x = np.repeat(self.start[:, np.newaxis], SAMPLES, axis=1)
            x[k] = self._sampled(self.variables[k].owner)
            moved = np.zeros(SAMPLES)
            for given, unit in self._driven(x):
                slope = np.nan_to_num(np.asarray(given.gradient.get(k, 0.0)), posinf=0.0, neginf=0.0)
                moved += (slope / (self.length if unit == "m" else 1.0)) ** 2
            scales[k] = 1.0 / np.sqrt(moved.max()) if moved.max() > 0.0 else 1.0
        return scales

    def _sampled(self, name: str) -> FloatArray:
        """Return values of a control, shape (SAMPLES,): over its range, else from its start - 1 to + 1."""
        (one,) = (one for one in self.network.controls if one.name == name)
        return np.linspace(*sample_range(one), SAMPLES)

    def _driven(self, x: FloatArray) -> Iterator[tuple[ValueWithGradient, str]]:
        """Yield what controls make of joints and elements, and the unit."""
        controls = self.control_values(x)
        for joint in self.network.joints:
            for drive, unit in zip(joint.drives, joint.units, strict=True):
                if drive is not None:
                    yield evaluate_expression(drive, controls), unit
            for k, part in enumerate(joint.motion):
                yield evaluate_expression(part, controls), "m" if k >= 6 else "rad"
        yield from zip(self.lengths(x), self.network.element_units, strict=True)

    def control_values(self, x: Configuration) -> dict[str, ValueWithGradient]:
        """Return the value of each control, and its derivatives by the variables.

        Args:
            x: The variables, one element each.
        """
        found: dict[str, ValueWithGradient] = {}
        for one in sort_controls(self.network.controls):
            if one.value is None:
                k = self.variable_index[one.name, 0]
                found[one.name] = ValueWithGradient(x[k], {k: 1.0})
            else:
                found[one.name] = evaluate_expression(one.value, found)
        return found

    def lengths(self, x: Configuration) -> list[ValueWithGradient]:
        """Return the length of each element in [m] or [rad], and its derivatives."""
        controls = self.control_values(x)
        return [evaluate_expression(one.length, controls) for one in self.network.elements]

    def joint_values(
        self, joint: Joint, x: Configuration, controls: dict[str, ValueWithGradient] | None = None
    ) -> list[ValueWithGradient]:
        """Return the value of each variable of a joint, and its derivatives; of a user joint m, n and a.

        Args:
            joint: The joint.
            x: The variables, one element each.
            controls: The result of `control_values`, if it is known.
        """
        controls = self.control_values(x) if controls is None else controls
        found = []
        for index, drive in enumerate(joint.drives):
            if drive is None:
                k = self.variable_index[joint.name, index]
                found.append(ValueWithGradient(x[k], {k: 1.0}))
            else:
                found.append(evaluate_expression(drive, controls))
        return found or [evaluate_expression(one, controls) for one in joint.motion]

    def pair_error(
        self, element: ConstraintElement, x: Configuration, controls: dict[str, ValueWithGradient]
    ) -> tuple[ValueWithGradient, dict[tuple[str, int], Element]]:
        """Return q_2 - f(q_1) - offset of a pair, in [rad] or [m], see `higher_pairs`.

        Then, its derivatives by the values of its joints: by the joint and the value's number.

        Args:
            element: The pair.
            x: The variables, one element each.
            controls: What `control_values` returns.
        """
        (first, j), (second, k) = self.network.pair_variables(element)
        angle, follower = self.joint_values(first, x, controls)[j], self.joint_values(second, x, controls)[k]
        offset = evaluate_expression(element.length, controls)
        value, rate = transmission(element, angle.value)
        slopes: dict[int, Element] = {}
        for factor, given in ((-rate, angle), (1.0, follower), (-1.0, offset)):
            for place, slope in given.gradient.items():
                slopes[place] = slopes.get(place, 0.0) + factor * slope
        error = ValueWithGradient(follower.value - value - offset.value, slopes)
        return error, {(first.name, j): -rate, (second.name, k): 1.0}

    def poses(self, x: Configuration) -> dict[str, Transform]:
        """Return the pose of each body in the ground.

        Args:
            x: The variables, one element each: floats, arrays of shape (n,), or symbols.
        """
        return {name: one.frame for name, one in self.placements(x).bodies.items()}

    def placements(self, x: Configuration) -> Placements:
        """Return the pose of each body, what moves it, and where the joints are."""
        controls, joints = self.control_values(x), {}
        bodies = {self.network.ground: Pose(Transform(), {})}
        for name in self.graph.roots[1:]:
            first = self.variable_index[name, 0]
            position, vector = (
                (x[first], x[first + 1], x[first + 2]),
                (x[first + 3], x[first + 4], x[first + 5]),
            )
            bodies[name] = Pose(Transform(exp3(vector).rotation, position), {name: 1})
        for branch, back in zip(self.graph.branches, self._backs, strict=True):
            joint, parent = self.network.joints[branch.joint], bodies[branch.parent]
            moved = joint_frame(joint, [one.value for one in self.joint_values(joint, x, controls)])
            if branch.sign > 0:
                at = parent.frame @ joint.frames[0]
                child = at @ moved @ back
            else:
                at = parent.frame @ joint.frames[1] @ moved.inverse()
                child = at @ back
            joints[joint.name] = at
            bodies[branch.child] = Pose(child, {**parent.movers, joint.name: branch.sign})
        for joint in (self.network.joints[cut] for cut in self.graph.cuts):
            joints[joint.name] = bodies[joint.bodies[0]].frame @ joint.frames[0]
        return Placements(bodies, joints)

    @cached_property
    def _backs(self) -> list[Transform]:
        """Of each branch the child's frame in that of its joint."""
        frames = [self.network.joints[one.joint].frames for one in self.graph.branches]
        return [pair[one.sign > 0].inverse() for pair, one in zip(frames, self.graph.branches, strict=True)]


def build_mechanism(network: Parts) -> Mechanism:
    """Return a network in numbers."""
    return Mechanism(network, build_graph(network))


def evaluate_expression(expression: Expression, controls: dict[str, ValueWithGradient]) -> ValueWithGradient:
    """Return the value of a function of controls, and its derivatives by the variables."""
    value, slopes = expression.value_and_gradient({name: one.value for name, one in controls.items()})
    return ValueWithGradient(value, _chained(slopes, controls))


def _chained(slopes: Gradient, controls: dict[str, ValueWithGradient]) -> dict[int, Element]:
    """Return derivatives by variables from those by controls."""
    found: dict[int, Element] = {}
    for name, slope in slopes.items():
        for k, inner in controls[name].gradient.items():
            found[k] = found.get(k, 0.0) + slope * inner
    return found
