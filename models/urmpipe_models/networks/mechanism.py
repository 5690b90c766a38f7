"""Mechanism: a network with its loops cut, its variables, and the poses of its bodies, elementwise.

1. `build_graph`: bodies are nodes, joints and elements edges. A spanning forest of joints grows from the
   ground, and from one body of each cluster that no joint connects to it; the other joints are cut.
2. `Mechanism`: the variables, which are the controls, the free variables of joints, and the poses of bodies
   without a joint; their start; the scales of variables (columns) and of equations (rows), with which all are
   of [-] or [rad].
3. Functions of the variables x, each with its derivatives: `control_values`, `lengths`, `joint_values`,
   `pair_error`.
4. `placements`: the pose of each body along the branches of the forest. A joint has R = A_1 T(q) A_2^-1, or
   the inverse of it if its first body is the child.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import Element, FloatArray, IndexArray, Vector, subtract
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.joint_motion import exp3, joint_frame, transmission
from urmpipe_models.networks.parts import (
    POSE_UNITS,
    ConstraintElement,
    Expression,
    Joint,
    Parts,
    sample_range,
    sort_controls,
)

Structure = Literal["tree", "loops", "closed chain"]
Configuration: TypeAlias = Sequence[Element] | FloatArray  # variables in [m], [rad] and units of controls
SAMPLES = 11  # values of a control at which its effect is computed


# --- graph


class Branch(NamedTuple):
    """A joint of the spanning forest.

    Attributes:
        joint: Its index among the joints.
        parent: The body nearer to the root.
        child: The body that the joint moves.
        sign: 1 if the child is the joint's second body, -1 if it is its first.
    """

    joint: int
    parent: str
    child: str
    sign: int


@dataclass(frozen=True)
class Graph:
    """Spanning forest and loops of a network.

    Attributes:
        network: The network.
        roots: The ground, and of each cluster that no joint connects to it the body that has its freedoms.
        branches: The joints of the spanning forest, each after those of its parent.
        cuts: The indices of the joints that close loops: there these are cut.
        clusters: Names of the bodies of each part that joints connect, that of the ground first.
    """

    network: Parts
    roots: tuple[str, ...]
    branches: tuple[Branch, ...]
    cuts: tuple[int, ...]
    clusters: tuple[tuple[str, ...], ...]

    @cached_property
    def loops(self) -> tuple[tuple[str, ...], ...]:
        """Names of the joints and elements of each loop: of a cut joint the path between its bodies, and it.

        Then, elements one by one, those that close a loop with the edges before them.
        """
        edges = [(joint.name, *joint.bodies) for joint in self.network.joints]
        tree = [edges[branch.joint] for branch in self.branches]
        loops = [(*_path(tree, *edges[k][1:]), edges[k][0]) for k in self.cuts]
        for element in self.network.elements:
            path = _path(tree, *element.bodies)
            if path:
                loops.append((*path, element.name))
            else:
                tree.append((element.name, *element.bodies))
        return tuple(loops)

    @property
    def structure(self) -> Structure:
        """Tree, closed chain (loops, and at each body two joints or elements or more), or loops."""
        if not self.loops:
            return "tree"
        ends = [name for _, constraint in self.network.constraints for name in constraint.bodies]
        degree = min(ends.count(name) for name in self.network.body_names)
        return "closed chain" if degree >= 2 else "loops"


def build_graph(network: Parts) -> Graph:
    """Return the graph of a network, its spanning forest grown joint by joint, breadth first."""
    started = [body.name for body in network.bodies if body.start]
    roots: list[str] = []
    branches: list[Branch] = []
    clusters: list[tuple[str, ...]] = []
    seen: set[str] = set()
    for root in (network.ground, *started, *network.body_names):
        if root not in seen:
            tree = _grow_tree(network, root, seen)
            roots.append(root)
            branches += tree
            clusters.append((root, *(branch.child for branch in tree)))
    used = {branch.joint for branch in branches}
    cuts = tuple(k for k in range(len(network.joints)) if k not in used)
    return Graph(network, tuple(roots), tuple(branches), cuts, tuple(clusters))


def _grow_tree(network: Parts, root: str, seen: set[str]) -> list[Branch]:
    """Return the branches from a root; their bodies become seen."""
    branches: list[Branch] = []
    seen.add(root)
    queue = [root]
    while queue:
        body = queue.pop(0)
        for k, joint in enumerate(network.joints):
            for parent, child, sign in ((*joint.bodies, 1), (*joint.bodies[::-1], -1)):
                if parent == body and child not in seen:
                    seen.add(child)
                    queue.append(child)
                    branches.append(Branch(k, parent, child, sign))
    return branches


def _path(tree: Sequence[tuple[str, str, str]], start: str, end: str) -> tuple[str, ...]:
    """Return the names of the edges of the path between two nodes; empty if there is none."""
    paths: dict[str, tuple[str, ...]] = {start: ()}
    queue = [start]
    while queue and end not in paths:
        node = queue.pop(0)
        for name, first, second in tree:
            for here, there in ((first, second), (second, first)):
                if here == node and there not in paths:
                    paths[there] = (*paths[node], name)
                    queue.append(there)
    return paths.get(end, ())


def components_without(network: Parts, omitted: Iterable[str]) -> list[set[str]]:
    """Return the sets of bodies that are connected without some joints and elements, given by name."""
    names = set(omitted)
    components: list[set[str]] = [{name} for name in network.body_names]
    for _, constraint in network.constraints:
        if constraint.name not in names:
            a, b = (next(part for part in components if name in part) for name in constraint.bodies)
            if a is not b:
                components.remove(b)
                a |= b
    return components


# --- mechanism


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a network.

    Attributes:
        owner: The name of its control, joint or body.
        kind: The kind of its owner.
        index: Its index among those of its owner.
        unit: m, rad, or "" of a control.
    """

    owner: str
    kind: Literal["control", "joint", "body"]
    index: int
    unit: str


class ValueWithGradient(NamedTuple):
    """A value that is a variable or a function of controls.

    Attributes:
        value: The value, any element.
        gradient: Its derivatives by the index of each variable.
    """

    value: Element
    gradient: dict[int, Element]


class Pose(NamedTuple):
    """A body's pose and the joints that move it.

    Attributes:
        frame: The body in the ground.
        movers: The sign with which the motion of each joint, or of a body with freedoms, moves it.
    """

    frame: Transform
    movers: dict[str, int]


class Placements(NamedTuple):
    """The frames of bodies and joints.

    Attributes:
        bodies: The pose of each body.
        joints: Of each joint the frame a of its first body, in the ground.
    """

    bodies: dict[str, Pose]
    joints: dict[str, Transform]


def build_mechanism(network: Parts) -> Mechanism:
    """Return the mechanism of a network."""
    return Mechanism(network, build_graph(network))


@dataclass(frozen=True)
class Mechanism:
    """A network whose loops are cut, with its variables and equations.

    Attributes:
        network: The network.
        graph: Its graph.
    """

    network: Parts
    graph: Graph

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Controls that can be set, the free variables of joints, and the poses of bodies without a joint."""
        controls = [
            Variable(control.name, "control", 0, "")
            for control in self.network.controls
            if control.value is None
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
        """The index of each variable by its owner and its index there."""
        return {(variable.owner, variable.index): k for k, variable in enumerate(self.variables)}

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
        """The indices of the variables that are controls, shape (controls,) [-]."""
        kinds = [variable.kind for variable in self.variables]
        return np.array([k for k, kind in enumerate(kinds) if kind == "control"], dtype=np.intp)

    @cached_property
    def free(self) -> IndexArray:
        """The indices of the variables that assembly solves for: all except controls, shape (free,) [-]."""
        return np.arange(len(self.controls), len(self.variables))

    @cached_property
    def rotations(self) -> tuple[slice, ...]:
        """The slices of three variables that are a rotation vector that nothing drives."""
        free = {
            joint.name for joint in self.network.joints if joint.kind == "global" and not any(joint.drives)
        }
        firsts = [
            k
            for k, variable in enumerate(self.variables)
            if (variable.kind == "body" and variable.index == 3)
            or (variable.kind == "joint" and variable.index == 0 and variable.owner in free)
        ]
        return tuple(slice(k, k + 3) for k in firsts)

    @cached_property
    def angles(self) -> IndexArray:
        """The indices of free variables that are the same after a full turn, shape (angles,) [-]."""
        coupled = self.network.coupled_joints
        kinds = {joint.name: joint.kind for joint in self.network.joints if joint.name not in coupled}
        variables = ((k, self.variables[k]) for k in self.free)
        angles = [
            k
            for k, variable in variables
            if variable.unit == "rad" and kinds.get(variable.owner) in ("revolute", "cylindrical")
        ]
        return np.array(angles, dtype=np.intp)

    @cached_property
    def start(self) -> FloatArray:
        """The start of assembly, in [m], [rad] and the units of controls, shape (variables,)."""
        starts: dict[str, Sequence[float]] = {
            control.name: (control.start,) for control in self.network.controls
        }
        starts |= {joint.name: joint.start or (0.0,) * len(joint.units) for joint in self.network.joints}
        starts |= {
            body.name: body.start or (0.0,) * 6
            for body in self.network.bodies
            if body.name in self.graph.roots
        }
        values = [starts[variable.owner][variable.index] for variable in self.variables]
        return np.array(values, dtype=np.float64)

    @property
    def rows(self) -> int:
        """Number of equations that close it."""
        return 6 * len(self.graph.cuts) + len(self.network.elements)

    @cached_property
    def length(self) -> float:
        """The largest distance in [m] between two joints of a body, or length of an element; 1 if it is 0."""
        pairs = zip(self.network.elements, self.lengths(self.start), strict=True)
        lengths = [abs(float(length.value)) for element, length in pairs if element.length_key == "d"]
        for points in self.points.values():
            lengths += [float(np.linalg.norm(subtract(a, b))) for a, b in combinations(points, 2)]
        return max(lengths, default=0.0) or 1.0

    @cached_property
    def points(self) -> dict[str, list[Vector]]:
        """The points of the joints and elements of each body, in [m]; a plane or a pair has none."""
        points: dict[str, list[Vector]] = {name: [] for name in self.network.body_names}
        for joint in self.network.joints:
            for name, frame in zip(joint.bodies, joint.frames, strict=True):
                points[name].append(frame.translation)
        for element in (element for element in self.network.elements if not element.is_pair):
            first = int(element.kind == "eg")
            for name, point in [*zip(element.bodies, element.points, strict=True)][first:]:
                points[name].append(point)
        return points

    @cached_property
    def row_scales(self) -> FloatArray:
        """The factor that makes each row one of [-] and [rad], shape (rows,): 1 / length of those in [m]."""
        loop = [1.0 / self.length] * 3 + [1.0] * 3
        elements = [1.0 / self.length if unit == "m" else 1.0 for unit in self.network.element_units]
        return np.array(loop * len(self.graph.cuts) + elements)

    @cached_property
    def column_scales(self) -> FloatArray:
        """A step of each variable, shape (variables,): the length, 1 rad, of a control one of equal effect.

        The effect of a control is the root of the sum of its squared derivatives, the largest at `SAMPLES` of
        its values: at its start, the effect may be 0.
        """
        scales = np.array([self.length if variable.unit == "m" else 1.0 for variable in self.variables])
        ranges = {control.name: sample_range(control) for control in self.network.controls}
        for k in self.controls:
            x = np.repeat(self.start[:, np.newaxis], SAMPLES, axis=1)
            x[k] = np.linspace(*ranges[self.variables[k].owner], SAMPLES)
            effect = np.zeros(SAMPLES)
            for driven, unit in self._driven_values(x):
                slope = np.nan_to_num(np.asarray(driven.gradient.get(k, 0.0)), posinf=0.0, neginf=0.0)
                effect += (slope / (self.length if unit == "m" else 1.0)) ** 2
            scales[k] = 1.0 / np.sqrt(effect.max()) if effect.max() > 0.0 else 1.0
        return scales

    def _driven_values(self, x: FloatArray) -> Iterator[tuple[ValueWithGradient, str]]:
        """Yield the values of joints and elements that are functions of controls, each with its unit."""
        controls = self.control_values(x)
        for joint in self.network.joints:
            for drive, unit in zip(joint.drives, joint.units, strict=True):
                if drive is not None:
                    yield evaluate_expression(drive, controls), unit
            for k, entry in enumerate(joint.motion):
                yield evaluate_expression(entry, controls), "m" if k >= 6 else "rad"
        yield from zip(self.lengths(x), self.network.element_units, strict=True)

    def control_values(self, x: Configuration) -> dict[str, ValueWithGradient]:
        """Return the value of each control, and its derivatives by the variables.

        Args:
            x: The variables, one element each.
        """
        values: dict[str, ValueWithGradient] = {}
        for control in sort_controls(self.network.controls):
            if control.value is None:
                k = self.variable_index[control.name, 0]
                values[control.name] = ValueWithGradient(x[k], {k: 1.0})
            else:
                values[control.name] = evaluate_expression(control.value, values)
        return values

    def lengths(self, x: Configuration) -> list[ValueWithGradient]:
        """Return the length of each element in [m] or [rad], and its derivatives."""
        controls = self.control_values(x)
        return [evaluate_expression(element.length, controls) for element in self.network.elements]

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
        values = []
        for index, drive in enumerate(joint.drives):
            if drive is None:
                k = self.variable_index[joint.name, index]
                values.append(ValueWithGradient(x[k], {k: 1.0}))
            else:
                values.append(evaluate_expression(drive, controls))
        return values or [evaluate_expression(entry, controls) for entry in joint.motion]

    def pair_error(
        self, element: ConstraintElement, x: Configuration, controls: dict[str, ValueWithGradient]
    ) -> tuple[ValueWithGradient, dict[tuple[str, int], Element]]:
        """Return q_2 - f(q_1) - offset of a pair, in [rad] or [m], see `joint_motion.transmission`.

        Then, its derivatives by the values of its joints: by the joint and the value's index.

        Args:
            element: The pair.
            x: The variables, one element each.
            controls: The result of `control_values`.
        """
        (first, j), (second, k) = self.network.pair_variables(element)
        angle, follower = self.joint_values(first, x, controls)[j], self.joint_values(second, x, controls)[k]
        offset = evaluate_expression(element.length, controls)
        value, rate = transmission(element, angle.value)
        gradient: dict[int, Element] = {}
        for factor, term in ((-rate, angle), (1.0, follower), (-1.0, offset)):
            for index, slope in term.gradient.items():
                gradient[index] = gradient.get(index, 0.0) + factor * slope
        error = ValueWithGradient(follower.value - value - offset.value, gradient)
        return error, {(first.name, j): -rate, (second.name, k): 1.0}

    def poses(self, x: Configuration) -> dict[str, Transform]:
        """Return the pose of each body in the ground.

        Args:
            x: The variables, one element each: floats, arrays of shape (n,), or symbols.
        """
        return {name: pose.frame for name, pose in self.placements(x).bodies.items()}

    def placements(self, x: Configuration) -> Placements:
        """Return the pose of each body with the joints that move it, and the frames of joints.

        Args:
            x: As in `poses`.
        """
        controls, joints = self.control_values(x), {}
        bodies = {self.network.ground: Pose(Transform(), {})}
        for name in self.graph.roots[1:]:
            first = self.variable_index[name, 0]
            position = (x[first], x[first + 1], x[first + 2])
            vector = (x[first + 3], x[first + 4], x[first + 5])
            bodies[name] = Pose(Transform(exp3(vector).rotation, position), {name: 1})
        for branch, child_frame in zip(self.graph.branches, self._child_frames, strict=True):
            joint, parent = self.network.joints[branch.joint], bodies[branch.parent]
            T = joint_frame(joint, [value.value for value in self.joint_values(joint, x, controls)])
            if branch.sign > 0:
                at = parent.frame @ joint.frames[0]
                child = at @ T @ child_frame
            else:
                at = parent.frame @ joint.frames[1] @ T.inverse()
                child = at @ child_frame
            joints[joint.name] = at
            bodies[branch.child] = Pose(child, {**parent.movers, joint.name: branch.sign})
        for joint in (self.network.joints[cut] for cut in self.graph.cuts):
            joints[joint.name] = bodies[joint.bodies[0]].frame @ joint.frames[0]
        return Placements(bodies, joints)

    @cached_property
    def _child_frames(self) -> list[Transform]:
        """The child in the frame of its joint, for each branch: A^-1."""
        return [
            self.network.joints[branch.joint].frames[branch.sign > 0].inverse()
            for branch in self.graph.branches
        ]


def evaluate_expression(expression: Expression, controls: dict[str, ValueWithGradient]) -> ValueWithGradient:
    """Return the value of a function of controls, and its derivatives by the variables."""
    values = {name: control.value for name, control in controls.items()}
    value, slopes = expression.value_and_gradient(values)
    gradient: dict[int, Element] = {}
    for name, slope in slopes.items():
        for k, inner in controls[name].gradient.items():
            gradient[k] = gradient.get(k, 0.0) + slope * inner
    return ValueWithGradient(value, gradient)
