"""What does not close of a network whose loops are cut, and its Jacobian by twists and wrenches.

From rough configurations to such that close: Levenberg-Marquardt on many at once.

Idle spins: a part that only two global joints hold spins about the line through their centres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from urmpipe_models.elementwise import (
    BoolArray,
    Element,
    FloatArray,
    IndexArray,
    Vector,
    add,
    cross,
    dot,
    scale,
    subtract,
)
from urmpipe_models.ik.numeric import FIRST_GAIN, GAINS, MIN_GAIN_RATIO, STATIONARY, damped_step
from urmpipe_models.ik.task import column_squares, dot_product, product, transposed_product
from urmpipe_models.math3d import Transform, to_quaternions, to_rotation_vectors
from urmpipe_models.networks.joint_motion import (
    MEASURED_QUANTITIES,
    SMALL_ANGLE_SQUARED,
    Twists,
    constraint_twists,
    exp3,
    joint_frame,
    joint_twists,
    left_jacobian,
    left_jacobian_inverse,
    measure_element,
    wrap_rotation_vector,
)
from urmpipe_models.networks.mechanism import (
    Configuration,
    Mechanism,
    Placements,
    Pose,
    ValueWithGradient,
    components_without,
    evaluate_expression,
)
from urmpipe_models.networks.parts import ConstraintElement, Joint


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """What does not close at n configurations, and how that changes.

    Rows: of each cut joint the gap x, y, z in [m] and its rotation vector in [rad], both seen from where the
    joint should be; then of each element what it is too long by in [m], of a pair what its second variable is
    off by in [m] or [rad].

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
        values: What the rows rise by a unit of values of joints: by the joint and the value's number.
    """

    rows: slice
    residual: FloatArray
    carrier: FloatArray
    movers: dict[str, int]
    slopes: dict[int, Element]
    values: dict[tuple[str, int], Element] = field(default_factory=dict)


def closure_of(mechanism: Mechanism, x: FloatArray) -> Closure:
    """Return what does not close, and its Jacobian.

    The gap of a cut joint is p and the rotation vector of E = (G_1 A_1 T)^-1 G_2 A_2, which is the
    identity where its loop closes. A change of the variables moves E by the twist of the second body
    against the first, minus the joint's own. An element's length changes by the scalar product of that
    twist and the element's wrench; a pair has slopes alone.

    Args:
        mechanism: The network.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
    """
    n = x.shape[1]
    posed, controls = mechanism.placements(x), mechanism.control_values(x)
    screws = _screws(mechanism, x, posed, controls)
    residual = np.zeros((mechanism.rows, n))
    jacobian = np.zeros((mechanism.rows, len(mechanism.variables), n))
    for equation in _equations(mechanism, x, posed, controls):
        residual[equation.rows] = equation.residual
        for mover, sign in equation.movers.items():
            places, twists = screws[mover]
            jacobian[equation.rows, places] += sign * np.einsum("ijn,jkn->ikn", equation.carrier, twists)
        for place, slope in equation.slopes.items():
            jacobian[equation.rows, place] -= slope
    return Closure(residual, jacobian)


def scaled_closure(mechanism: Mechanism, x: FloatArray) -> Closure:
    """Return what `closure_of` does, in lengths of the mechanism and [rad], so that m and rad compare.

    Args:
        mechanism: The network.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
    """
    found, rows = closure_of(mechanism, x), mechanism.row_scales[:, np.newaxis]
    scales = (rows * mechanism.column_scales)[:, :, np.newaxis]
    return Closure(found.residual * rows, found.jacobian * scales)


def released(mechanism: Mechanism, x: FloatArray) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield what each constraint forbids: its joint or element, its name, and what it would add to J.

    That is a column [-], scaled as `row_scales` and `column_scales` do, shape (rows,).

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
    """
    at = x[:, np.newaxis]
    posed, controls = mechanism.placements(at), mechanism.control_values(at)
    equations = list(_equations(mechanism, at, posed, controls))
    for joint in mechanism.network.joints:
        values = [one.value for one in mechanism.joint_values(joint, at, controls)]
        frame = posed.joints[joint.name]
        driven = iter([k for k, drive in enumerate(joint.drives) if drive is not None])
        for constraint, unit, (w, v) in constraint_twists(joint, values, frame):
            size = mechanism.length if unit == "m" else 1.0
            twist = _stacked((*w, *v), 1)[:, 0] * size
            column, value = np.zeros(mechanism.rows), -1
            if constraint == "drive":
                value = next(driven)
            for one in equations:
                column[one.rows] += one.movers.get(joint.name, 0) * (one.carrier[:, :, 0] @ twist)
                column[one.rows] += one.values.get((joint.name, value), 0.0) * size
            yield joint.name, constraint, column * mechanism.row_scales
    for row, element in enumerate(mechanism.network.elements, 6 * len(mechanism.graph.cuts)):
        yield element.name, MEASURED_QUANTITIES[element.kind], np.eye(mechanism.rows)[row]


def _equations(
    mechanism: Mechanism, x: FloatArray, posed: Placements, controls: dict[str, ValueWithGradient]
) -> Iterator[_Equation]:
    """Yield what closes each loop, and what holds each element."""
    n = x.shape[1]
    for k, cut in enumerate(mechanism.graph.cuts):
        joint = mechanism.network.joints[cut]
        moved = joint_frame(joint, [one.value for one in mechanism.joint_values(joint, x, controls)])
        here = posed.joints[joint.name] @ moved
        gap = gap_of(here.inverse() @ posed.bodies[joint.bodies[1]].frame @ joint.frames[1], n)
        movers = relative_movers(posed.bodies, joint.bodies, joint.name)
        yield _Equation(slice(6 * k, 6 * k + 6), gap, _carrier(here, gap), movers, {})
    first = 6 * len(mechanism.graph.cuts)
    for row, element in enumerate(mechanism.network.elements, first):
        if element.is_pair:
            error, rates = mechanism.pair_error(element, x, controls)
            slopes = {place: -slope for place, slope in error.gradient.items()}
            values, no_wrench = _stacked((error.value,), n), np.zeros((1, 6, n))
            yield _Equation(slice(row, row + 1), values, no_wrench, {}, slopes, rates)
            continue
        length = evaluate_expression(element.length, controls)
        measured = measure_element(element, *(posed.bodies[name].frame for name in element.bodies))
        wrench = _stacked((*measured.moment, *measured.force), n)[np.newaxis]
        excess = _stacked((measured.distance - length.value,), n)
        movers = relative_movers(posed.bodies, element.bodies)
        yield _Equation(slice(row, row + 1), excess, wrench, movers, length.gradient)


def _screws(
    mechanism: Mechanism, x: FloatArray, posed: Placements, controls: dict[str, ValueWithGradient]
) -> dict[str, tuple[IndexArray, FloatArray]]:
    """Return of each mover the numbers of variables that move it, and their twists.

    A twist is the angular velocity in [rad] and the velocity in [m] of the point at the ground's origin, a
    unit of the variable, shape (6, k, n).
    """
    n = x.shape[1]
    found = {}
    for joint in mechanism.network.joints:
        values = mechanism.joint_values(joint, x, controls)
        twists = joint_twists(joint, [one.value for one in values], posed.joints[joint.name])
        found[joint.name] = _combined(twists, values, n)
    for name in mechanism.graph.roots[1:]:
        first = mechanism.variable_index[name, 0]
        values = [ValueWithGradient(None, {first + k: 1.0}) for k in range(6)]
        vector = (x[first + 3], x[first + 4], x[first + 5])
        p = posed.bodies[name].frame.translation
        turning = [(axis, cross(p, axis)) for axis in left_jacobian(vector)]
        found[name] = _combined([*SLIDING_SCREWS, *turning], values, n)
    return found


SLIDING_SCREWS: Twists = [
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
]
"""The twists of a body that slides along the axes of the ground."""


def gap_of(error: Transform, n: int) -> FloatArray:
    """Return the translation in [m] and the rotation vector in [rad] of n frames, shape (6, n)."""
    rows = _stacked(tuple(entry for row in error.rotation for entry in row), n)
    vector = to_rotation_vectors(to_quaternions(rows.T, "matrix"))
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
    carried[3:, :3] = np.einsum("ijn,jkn->ikn", left_jacobian_inverse(gap[3:]), R)
    return carried


def relative_movers(posed: dict[str, Pose], bodies: tuple[str, str], cut: str = "") -> dict[str, int]:
    """Return the sign with which each mover moves the second body against the first; -1 of the cut joint."""
    first, second = (posed[name].movers for name in bodies)
    signs = {name: second.get(name, 0) - first.get(name, 0) for name in {**first, **second}}
    if cut:
        signs[cut] = -1
    return {name: sign for name, sign in signs.items() if sign}


def _combined(screws: Twists, values: Sequence[ValueWithGradient], n: int) -> tuple[IndexArray, FloatArray]:
    """Return the twists a unit of each variable from those a unit of each value."""
    places = list(dict.fromkeys(k for one in values for k in one.gradient))
    twists = np.zeros((6, len(places), n))
    for (w, v), one in zip(screws, values, strict=True):
        twist = _stacked((*w, *v), n)
        for k, slope in one.gradient.items():
            twists[:, places.index(k)] += slope * twist
    return np.array(places, dtype=np.intp), twists


def _stacked(elements: Sequence[Element], n: int) -> FloatArray:
    """Return elements as rows, shape (k, n), in their unit."""
    rows = np.empty((len(elements), n))
    for k, one in enumerate(elements):
        rows[k] = one
    return rows


def body_twists(mechanism: Mechanism, x: FloatArray) -> dict[str, FloatArray]:
    """Return the twist of each body in the ground per unit of each variable, shape (6, variables, n).

    Angular velocity in [rad], then the velocity in [m] of the point at the origin of the ground.

    Args:
        mechanism: The network.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
    """
    posed, controls = mechanism.placements(x), mechanism.control_values(x)
    screws = _screws(mechanism, x, posed, controls)
    twists = {}
    for name, pose in posed.bodies.items():
        twists[name] = np.zeros((6, len(mechanism.variables), x.shape[1]))
        for mover, sign in pose.movers.items():
            places, own = screws[mover]
            twists[name][:, places] += sign * own
    return twists


def wrench_carriers(
    mechanism: Mechanism, x: FloatArray
) -> Iterator[tuple[Joint | ConstraintElement, slice, FloatArray]]:
    """Yield of each cut joint and element its rows, and the matrix from twists in the ground to their rates.

    The transpose turns multipliers of the rows, in [N] and [N.m], into the moment and force, about the
    origin of the ground, on the second body. Shape (rows, 6, n).

    Args:
        mechanism: The network.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
    """
    cuts = [mechanism.network.joints[cut] for cut in mechanism.graph.cuts]
    ties: list[Joint | ConstraintElement] = [*cuts, *mechanism.network.elements]
    equations = _equations(mechanism, x, mechanism.placements(x), mechanism.control_values(x))
    for tie, equation in zip(ties, equations, strict=True):
        yield tie, equation.rows, equation.carrier


STEPS = 300
"""The most steps of a start."""

ENOUGH = 1e-14
"""The length of the residual, in lengths of the mechanism and [rad], from which on it is rounding."""

STUCK = 1e-3
"""Where the cosine between e and what each variable can change of it is less than this times the root of |e|,
e cannot be made 0 near by: on the way to a singular assembly, where |e| falls as the square of the distance,
the cosine falls as the distance."""

FLOOR = 1e-13
"""The least damping: singular directions, as of redundant constraints, must not amplify rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Reached:
    """Where starts have come to.

    Attributes:
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        gap: The largest entry of the residual, in lengths of the mechanism and [rad], shape (n,); NaN where x
            is no configuration.
    """

    x: FloatArray
    gap: FloatArray


def descend(mechanism: Mechanism, x: FloatArray, free: IndexArray, *, patient: bool = True) -> Reached:
    """Return the configurations nearby that close, or come nearest to it.

    Each step is the least of (J^T J + mu I) dx = -J^T e, in lengths of the mechanism and [rad], with mu in
    proportion to |e|^2: so it ends in steps of Gauss and Newton, and moves nothing that need not move.

    Args:
        mechanism: The network.
        x: The starts, shape (variables, n), in [m], [rad] and as controls are given.
        free: The numbers of the variables that may change, shape (free,) [-].
        patient: Whether the least gap is sought where nothing closes; else a start is given up there.
    """
    found = np.array(x, dtype=np.float64)
    rows = np.arange(found.shape[1])
    gain = np.full(len(rows), FIRST_GAIN)
    now = _scaled(mechanism, found, free)
    error = np.array(now.error)
    for _ in range(STEPS):
        going = _going(now, gain, patient)
        if not going.any():
            break
        rows, gain, now = rows[going], gain[going], now.kept(going)
        x_now = found[:, rows]
        square = dot_product(now.error, now.error)
        step = damped_step(now.jacobian, -now.error, gain * square + FLOOR)
        moved = np.array(x_now)
        moved[free] += step * mechanism.column_scales[free, np.newaxis]
        for some in mechanism.rotations:
            moved[some] = wrap_rotation_vector(tuple(moved[some]))
        new = _scaled(mechanism, moved, free)
        left = now.error + product(now.jacobian, step)
        foreseen = square - dot_product(left, left)
        gained = square - dot_product(new.error, new.error)
        taken = (gained > MIN_GAIN_RATIO * foreseen) & (gained > 0.0)
        good, poor = taken & (gained > 0.75 * foreseen), ~taken | (gained < 0.25 * foreseen)
        gain = np.clip(gain * np.where(good, 0.125, np.where(poor, 4.0, 1.0)), *GAINS)
        found[:, rows[taken]], error[:, rows[taken]] = moved[:, taken], new.error[:, taken]
        now = new.or_else(taken, now)
    return Reached(found, np.abs(error).max(axis=0, initial=0.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Scaled:
    """Residual and Jacobian in lengths of the mechanism and [rad], shape (rows, n) and (rows, free, n)."""

    error: FloatArray
    jacobian: FloatArray

    def kept(self, which: BoolArray) -> _Scaled:
        """Return those of some starts."""
        return _Scaled(self.error[:, which], self.jacobian[:, :, which])

    def or_else(self, taken: BoolArray, other: _Scaled) -> _Scaled:
        """Return these where they are taken, else those of another."""
        return _Scaled(
            np.where(taken, self.error, other.error), np.where(taken, self.jacobian, other.jacobian)
        )


def _scaled(mechanism: Mechanism, x: FloatArray, free: IndexArray) -> _Scaled:
    """Return residual and Jacobian at configurations, scaled."""
    closure = scaled_closure(mechanism, x)
    return _Scaled(closure.residual, closure.jacobian[:, free])


def _going(now: _Scaled, gain: FloatArray, patient: bool) -> BoolArray:
    """Return which starts go on: those that are finite, not closed, and not at a least residual."""
    square = dot_product(now.error, now.error)
    slope = transposed_product(now.jacobian, now.error)
    least = np.maximum(STATIONARY, 0.0 if patient else STUCK * square**0.25)
    moves = slope * slope > least**2 * square * column_squares(now.jacobian)
    under_way = (square > ENOUGH**2) & (square < np.inf) & (gain < GAINS[1])
    return np.asarray(under_way & moves.any(axis=0))


COAXIAL = 1e-7
"""Share of the mechanism's length by which points may be beside an axis that they are on: see `RANK`."""


@dataclass(frozen=True, slots=True)
class IdleSpin:
    """A part that spins and moves nothing else.

    Attributes:
        joints: The two global joints.
        bodies: Its bodies, in the order of the network.
    """

    joints: tuple[Joint, Joint]
    bodies: tuple[str, ...]


def idle_spins(mechanism: Mechanism) -> tuple[IdleSpin, ...]:
    """Return the idle spins of a network; a part within which another spins is none itself."""
    network = mechanism.network
    free = [one for one in network.joints if one.kind == "global" and not any(one.drives)]
    found: list[IdleSpin] = []
    for pair in combinations(free, 2):
        for part in components_without(network, [one.name for one in pair]):
            hangs = all(len(part & set(one.bodies)) == 1 for one in pair)
            if hangs and network.ground not in part:
                found.append(IdleSpin(pair, tuple(name for name in network.body_names if name in part)))
    return tuple(one for one in found if not any(set(other.bodies) < set(one.bodies) for other in found))


def spinning_parts(mechanism: Mechanism, x: FloatArray) -> tuple[str, ...]:
    """Return the names of the bodies that spin together, joined, of each idle spin at a configuration.

    Bodies of a part spin apart where the joint between them lets them turn about the line.

    Args:
        mechanism: The network.
        x: The variables, shape (variables,), in [m], [rad] and as controls are given.
    """
    frames = mechanism.poses([float(value) for value in x])
    joints, found = mechanism.network.joints, []
    for spin in idle_spins(mechanism):
        ends = [_part_frame(joint, spin, frames).translation for joint in spin.joints]
        loose = (one for one in joints if one.name not in mechanism.network.coupled_joints)
        apart = [one.name for one in loose if _turns_about(one, frames, ends, mechanism.length)]
        pieces = components_without(mechanism.network, [one.name for one in spin.joints] + apart)
        inner = (piece for piece in pieces if piece <= set(spin.bodies))
        found += [" + ".join(name for name in spin.bodies if name in piece) for piece in inner]
    return tuple(found)


def _turns_about(joint: Joint, frames: dict[str, Transform], ends: Sequence[Vector], length: float) -> bool:
    """Return whether a joint turns freely about the line through two points [m].

    Args:
        joint: The joint.
        frames: The bodies in the ground.
        ends: The points.
        length: That of the mechanism in [m].
    """
    if joint.kind not in ("revolute", "cylindrical") or joint.drives[0] is not None:
        return False
    at = frames[joint.bodies[0]] @ joint.frames[0]
    off = [np.linalg.norm(cross(subtract(end, at.translation), at.columns[1])) for end in ends]
    return bool(max(off) <= COAXIAL * length)


def unspun(mechanism: Mechanism, spins: Sequence[IdleSpin], x: FloatArray, start: FloatArray) -> FloatArray:
    """Return the same configurations with their idle spins as they are at the start.

    The part turns about the line u until the twist of its first joint about u is that of the start; both
    joints take that up: T' = T exp(phi [u]x), u in the frame a of the part.

    Args:
        mechanism: The network.
        spins: Its idle spins.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        start: Those of the start, shape (variables,), likewise.

    Returns:
        The variables in [m], [rad] and as controls are given, shape (variables, n).
    """
    x = np.array(x)
    for spin in spins:
        frames = mechanism.poses(x)
        centres = [_part_frame(joint, spin, frames) for joint in spin.joints]
        apart = subtract(centres[1].translation, centres[0].translation)
        length = np.sqrt(sum(np.square(entry) for entry in apart))
        line: Vector = scale(1.0 / np.maximum(length, 1e-300), apart)
        turn: FloatArray | None = None
        for joint, frame in zip(spin.joints, centres, strict=True):
            first = mechanism.variable_index[joint.name, 0]
            inverted = joint.bodies[0] in spin.bodies
            own = _turned(joint, x[first : first + 3], inverted)
            along = Transform(frame.columns).rotate(line)
            if turn is None:
                before = _turned(joint, start[first : first + 3, np.newaxis], inverted)
                turn = _twist(before, along, x.shape[1]) - _twist(own, along, x.shape[1])
            held = own @ exp3(scale(turn, along))
            x[first : first + 3] = gap_of(held.inverse() if inverted else held, x.shape[1])[3:]
    return x


def spin_angles(mechanism: Mechanism, spins: Sequence[IdleSpin], x: Configuration) -> list[Element]:
    """Return the angles of idle spins in [rad], which `unspun` keeps: twists of first joints about the lines.

    phi = 2 atan2(q . u sin(a / 2) / a, cos(a / 2)), a = |q|: q is the rotation vector of the joint, u the
    line.

    Args:
        mechanism: The network.
        spins: Its idle spins.
        x: The variables, one element each.
    """
    angles: list[Element] = []
    frames = mechanism.poses(x)
    for spin in spins:
        first, second = (_part_frame(joint, spin, frames) for joint in spin.joints)
        joint, distance = spin.joints[0], subtract(second.translation, first.translation)
        line = scale(1.0 / np.maximum(np.sqrt(dot(distance, distance)), 1e-300), distance)
        place = mechanism.variable_index[joint.name, 0]
        q: Vector = (x[place], x[place + 1], x[place + 2])
        square = dot(q, q)
        angle = np.sqrt(np.where(square < SMALL_ANGLE_SQUARED, 1.0, square))
        sine = np.where(square < SMALL_ANGLE_SQUARED, 0.5 - square / 48.0, np.sin(0.5 * angle) / angle)
        cosine = np.where(square < SMALL_ANGLE_SQUARED, 1.0 - square / 8.0, np.cos(0.5 * angle))
        along = dot(q, Transform(first.columns).rotate(line))
        sign = -1.0 if joint.bodies[0] in spin.bodies else 1.0
        angles.append(2.0 * np.arctan2(sign * sine * along, cosine))
    return angles


def _part_frame(joint: Joint, spin: IdleSpin, frames: dict[str, Transform]) -> Transform:
    """Return the frame a of the part at a joint, in the ground."""
    side = 0 if joint.bodies[0] in spin.bodies else 1
    return frames[joint.bodies[side]] @ joint.frames[side]


def _turned(joint: Joint, q: FloatArray, inverted: bool) -> Transform:
    """Return how the part is turned at a joint against what it hangs on: T, or its inverse."""
    frame = joint_frame(joint, list(q))
    return frame.inverse() if inverted else frame


def _twist(turned: Transform, axis: Vector, n: int) -> FloatArray:
    """Return by which angles rotations turn about axes, 2 atan2(v . axis, w), in [rad], shape (n,)."""
    rows = np.empty((9, n))
    for k, entry in enumerate(entry for row in turned.rotation for entry in row):
        rows[k] = entry
    quat = to_quaternions(rows.T, "matrix")
    along = sum(quat[:, k] * axis[k] for k in range(3))
    return np.asarray(2.0 * np.arctan2(along, quat[:, 3]))
