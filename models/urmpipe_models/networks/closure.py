"""Closure of a network: the equations of its loops and elements, and configurations that satisfy them.

1. `evaluate_closure`: the residual e of all equations and its Jacobian J = de/dx, at n configurations x side
   by side. Each cut joint has six equations: the translation p and the rotation vector of the pose error E =
   (G_1 A_1 T)^-1 G_2 A_2 of its loop, where G are the poses of its bodies, A its frames in them and T is its
   motion. Each element has one: its distance less its length; of a pair q_2 - f(q_1) - offset.
2. The Jacobian by twists and wrenches: a variable moves each body with a twist (w, v) in the ground, and each
   equation has a matrix, its twist map, from the twist of the second body against the first to e'. Of a cut
   joint this is p' = v + w x p and the rate of the rotation vector (inverse of its left Jacobian); of an
   element the scalar product with its wrench. Lengths that are functions of controls add their derivatives.
3. `evaluate_scaled_closure`: the same in lengths of the mechanism and [rad].
4. `solve_closure`: Levenberg-Marquardt from many starts side by side; `close_by_newton` from configurations
   that nearly close.

Mobility, redundant constraints and idle spins follow from the same Jacobian: `mobility`. For FMUs, `rates`
has Newton steps of a fixed number that can be traced to C.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, Element, FloatArray, IndexArray, add, cross
from urmpipe_models.ik.numeric import FIRST_GAIN, GAINS, MIN_GAIN_RATIO, STATIONARY, damped_step
from urmpipe_models.ik.task import column_squares, dot_product, product, transposed_product
from urmpipe_models.math3d import Transform, to_quaternions, to_rotation_vectors
from urmpipe_models.networks.joint_motion import (
    MEASURED_QUANTITIES,
    ElementMeasurement,
    Twists,
    constraint_twists,
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
    evaluate_expression,
)
from urmpipe_models.networks.parts import ConstraintElement, Joint

MAX_STEPS = 300  # of a start
ROUNDING_ERROR = 1e-14  # norm of the scaled residual from which on it is rounding
MIN_DAMPING = 1e-13  # singular directions, as of redundant constraints, must not amplify rounding
# Times the root of |e|: if the cosine between e and its change by each variable is smaller, e cannot be made
# 0 nearby. On the way to a singular assembly |e| falls as the square of the distance, the cosine as the
# distance.
MIN_COSINE = 1e-3
CHUNK_SIZE = 4096  # configurations solved side by side: their Jacobians fit the cache
TRANSLATION_SCREWS: Twists = [  # twists (w, v) of a body that translates along the axes of the ground
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
]


class MechanismState(NamedTuple):
    """A mechanism at a configuration: variables, poses of bodies, values of controls with gradients."""

    mechanism: Mechanism
    x: Configuration
    placements: Placements
    controls: dict[str, ValueWithGradient]

    def joint_values(self, joint: Joint) -> list[ValueWithGradient]:
        """Return the value of each variable of a joint; of a user joint the entries of m, n and a."""
        return self.mechanism.joint_values(joint, self.x, self.controls)

    def joint_elements(self, joint: Joint) -> list[Element]:
        """Return the same without gradients."""
        return [value.value for value in self.joint_values(joint)]

    def measure(self, element: ConstraintElement) -> ElementMeasurement:
        """Return what an element that is no pair measures between its bodies."""
        return measure_element(element, *(self.placements.bodies[name].frame for name in element.bodies))


def evaluate_state(mechanism: Mechanism, x: Configuration) -> MechanismState:
    """Return a mechanism at a configuration of any elements."""
    return MechanismState(mechanism, x, mechanism.placements(x), mechanism.control_values(x))


# ---------------------------------------------------------------------------------------- residual, Jacobian


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Residual and Jacobian of all equations at n configurations.

    Rows: of each cut joint the pose error, x, y, z in [m] and its rotation vector in [rad], both seen from
        where
    the joint should be; then of each element its excess length in [m], of a pair the error of its second
    variable in [m] or [rad].

    Attributes:
        residual: In [m] and [rad], shape (rows, n).
        jacobian: Its derivative per unit of each variable, shape (rows, variables, n).
    """

    residual: FloatArray
    jacobian: FloatArray


class _Equation(NamedTuple):
    """Rows of a closure.

    Attributes:
        rows: Their numbers.
        residual: In [m] and [rad], shape (k, n).
        twist_map: From a twist in the ground to the derivative of the residual, shape (k, 6, n).
        movers: The sign with which the twist of each mover counts.
        slopes: What the residual falls by per unit of variables.
        values: What it rises by per unit of values of joints, by the joint and the number of the value.
    """

    rows: slice
    residual: FloatArray
    twist_map: FloatArray
    movers: dict[str, int]
    slopes: dict[int, Element]
    values: dict[tuple[str, int], Element]


def evaluate_closure(mechanism: Mechanism, x: FloatArray) -> Closure:
    """Return residual and Jacobian at configurations x, shape (variables, n), in [m] and [rad]."""
    n, state = x.shape[1], evaluate_state(mechanism, x)
    twists = _mover_twists(state, n)
    residual = np.zeros((mechanism.rows, n))
    jacobian = np.zeros((mechanism.rows, len(mechanism.variables), n))
    for equation in _equations(state, n):
        residual[equation.rows] = equation.residual
        for mover, sign in equation.movers.items():
            places, mover_twists = twists[mover]
            jacobian[equation.rows, places] += sign * np.einsum(
                "ijn,jkn->ikn", equation.twist_map, mover_twists
            )
        for place, slope in equation.slopes.items():
            jacobian[equation.rows, place] -= slope
    return Closure(residual, jacobian)


def evaluate_scaled_closure(mechanism: Mechanism, x: FloatArray) -> Closure:
    """Return `evaluate_closure`, alike in shape, in lengths of the mechanism and [rad]; m and rad compare."""
    closure, rows = evaluate_closure(mechanism, x), mechanism.row_scales[:, np.newaxis]
    scales = (rows * mechanism.column_scales)[:, :, np.newaxis]
    return Closure(closure.residual * rows, closure.jacobian * scales)


def _equations(state: MechanismState, n: int) -> Iterator[_Equation]:
    """Yield the equations of each cut joint, then of each element."""
    mechanism, bodies = state.mechanism, state.placements.bodies
    for k, cut in enumerate(mechanism.graph.cuts):
        joint = mechanism.network.joints[cut]
        expected = state.placements.joints[joint.name] @ joint_frame(joint, state.joint_elements(joint))
        error = pose_error(expected.inverse() @ bodies[joint.bodies[1]].frame @ joint.frames[1], n)
        movers = relative_movers(bodies, joint.bodies, joint.name)
        yield _Equation(slice(6 * k, 6 * k + 6), error, _pose_twist_map(expected, error), movers, {}, {})
    for row, element in enumerate(mechanism.network.elements, 6 * len(mechanism.graph.cuts)):
        rows = slice(row, row + 1)
        if element.is_pair:
            pair, rates = mechanism.pair_error(element, state.x, state.controls)
            slopes = {place: -slope for place, slope in pair.gradient.items()}
            residual, no_wrench = stack_elements((pair.value,), n), np.zeros((1, 6, n))
            yield _Equation(rows, residual, no_wrench, {}, slopes, rates)
            continue
        measured, length = state.measure(element), evaluate_expression(element.length, state.controls)
        wrench = stack_elements((*measured.moment, *measured.force), n)[np.newaxis]
        excess = stack_elements((measured.distance - length.value,), n)
        yield _Equation(rows, excess, wrench, relative_movers(bodies, element.bodies), length.gradient, {})


def pose_error(error: Transform, n: int) -> FloatArray:
    """Return translation in [m] and rotation vector in [rad] of n frames, shape (6, n)."""
    rows = stack_elements([entry for row in error.rotation for entry in row], n)
    vector = to_rotation_vectors(to_quaternions(rows.T, "matrix"))
    return np.concatenate((stack_elements(error.translation, n), vector.T))


def _pose_twist_map(expected: Transform, error: FloatArray) -> FloatArray:
    """Return the matrix from a twist in the ground to the derivative of a pose error, shape (6, 6, n)."""
    n = error.shape[1]
    turned = stack_elements([entry for row in expected.rotation for entry in row], n).reshape(3, 3, n)
    R = turned.transpose(1, 0, 2)  # from the ground into the joint's frame
    x, y, z = stack_elements(add(expected.translation, expected.rotate((error[0], error[1], error[2]))), n)
    zero = np.zeros(n)
    lever = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]])  # w x o = lever w
    twist_map = np.zeros((6, 6, n))
    twist_map[:3, :3] = np.einsum("ijn,jkn->ikn", R, lever)
    twist_map[:3, 3:] = R
    twist_map[3:, :3] = np.einsum("ijn,jkn->ikn", left_jacobian_inverse(error[3:]), R)
    return twist_map


def relative_movers(posed: dict[str, Pose], bodies: tuple[str, str], cut: str = "") -> dict[str, int]:
    """Return the sign with which each mover moves the second body against the first; -1 of the cut joint."""
    first, second = (posed[name].movers for name in bodies)
    signs = {name: second.get(name, 0) - first.get(name, 0) for name in {**first, **second}}
    if cut:
        signs[cut] = -1
    return {name: sign for name, sign in signs.items() if sign}


def _mover_twists(state: MechanismState, n: int) -> dict[str, tuple[IndexArray, FloatArray]]:
    """Return for each joint and free body the numbers of the variables that move it, and their twists.

    A twist is the angular velocity in [rad] and the velocity in [m] of the point at the ground's origin, per
    unit of the variable, shape (6, k, n).
    """
    mechanism, x, placements, _ = state
    twists = {}
    for joint in mechanism.network.joints:
        values = state.joint_values(joint)
        screws = joint_twists(joint, [value.value for value in values], placements.joints[joint.name])
        twists[joint.name] = _twists_by_variable(screws, values, n)
    for name in mechanism.graph.roots[1:]:
        first = mechanism.variable_index[name, 0]
        values = [ValueWithGradient(None, {first + k: 1.0}) for k in range(6)]
        vector = (x[first + 3], x[first + 4], x[first + 5])
        p = placements.bodies[name].frame.translation
        turning = [(axis, cross(p, axis)) for axis in left_jacobian(vector)]
        twists[name] = _twists_by_variable([*TRANSLATION_SCREWS, *turning], values, n)
    return twists


def _twists_by_variable(
    screws: Twists, values: Sequence[ValueWithGradient], n: int
) -> tuple[IndexArray, FloatArray]:
    """Return variables and their twists from the twists per unit of each value."""
    places = list(dict.fromkeys(k for value in values for k in value.gradient))
    twists = np.zeros((6, len(places), n))
    for (w, v), value in zip(screws, values, strict=True):
        twist = stack_elements((*w, *v), n)
        for k, slope in value.gradient.items():
            twists[:, places.index(k)] += slope * twist
    return np.array(places, dtype=np.intp), twists


def stack_elements(elements: Sequence[Element], n: int) -> FloatArray:
    """Return elements as rows, shape (k, n), in their unit."""
    rows = np.empty((len(elements), n))
    for k, element in enumerate(elements):
        rows[k] = element
    return rows


# ---------------------------------------------------------------------------------------- its parts


def iter_release_columns(mechanism: Mechanism, x: FloatArray) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield each constraint: its joint or element, its name, and the column that its release adds to J.

    The column [-] is scaled by `row_scales` and `column_scales`, shape (rows,). The variables x have the
    shape (variables,), in [m], [rad] and as controls are given.
    """
    state = evaluate_state(mechanism, x[:, np.newaxis])
    equations = list(_equations(state, 1))
    for joint in mechanism.network.joints:
        values, frame = state.joint_elements(joint), state.placements.joints[joint.name]
        driven = iter([k for k, drive in enumerate(joint.drives) if drive is not None])
        for constraint, unit, (w, v) in constraint_twists(joint, values, frame):
            size = mechanism.length if unit == "m" else 1.0
            twist = stack_elements((*w, *v), 1)[:, 0] * size
            column = np.zeros(mechanism.rows)
            value = next(driven) if constraint == "drive" else -1
            for equation in equations:
                sign = equation.movers.get(joint.name, 0)
                column[equation.rows] += sign * (equation.twist_map[:, :, 0] @ twist)
                column[equation.rows] += equation.values.get((joint.name, value), 0.0) * size
            yield joint.name, constraint, column * mechanism.row_scales
    for row, element in enumerate(mechanism.network.elements, 6 * len(mechanism.graph.cuts)):
        yield element.name, MEASURED_QUANTITIES[element.kind], np.eye(mechanism.rows)[row]


def body_twists(mechanism: Mechanism, x: FloatArray) -> dict[str, FloatArray]:
    """Return the twist of each body in the ground per unit of each variable, shape (6, variables, n).

    Angular velocity in [rad], then the velocity in [m] of the point at the origin of the ground. The
    variables x have the shape (variables, n), in [m], [rad] and as controls are given.
    """
    state = evaluate_state(mechanism, x)
    mover_twists = _mover_twists(state, x.shape[1])
    twists = {}
    for name, pose in state.placements.bodies.items():
        twists[name] = np.zeros((6, len(mechanism.variables), x.shape[1]))
        for mover, sign in pose.movers.items():
            places, unit_twists = mover_twists[mover]
            twists[name][:, places] += sign * unit_twists
    return twists


def iter_twist_maps(
    mechanism: Mechanism, x: FloatArray
) -> Iterator[tuple[Joint | ConstraintElement, slice, FloatArray]]:
    """Yield for each cut joint and element its rows, and the matrix from twists in the ground to their rates.

    The transpose turns multipliers of the rows, in [N] and [N.m], into the moment and force, about the
    origin of the ground, on the second body. Shape (rows, 6, n), of variables x of the shape (variables, n).
    """
    cuts = [mechanism.network.joints[cut] for cut in mechanism.graph.cuts]
    constraints: list[Joint | ConstraintElement] = [*cuts, *mechanism.network.elements]
    equations = _equations(evaluate_state(mechanism, x), x.shape[1])
    for constraint, equation in zip(constraints, equations, strict=True):
        yield constraint, equation.rows, equation.twist_map


# ---------------------------------------------------------------------------------------- solution


@dataclass(frozen=True, slots=True, eq=False)
class DescentResult:
    """The configurations that starts lead to.

    Attributes:
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        gap: The largest entry of the residual, in lengths of the mechanism and [rad], shape (n,); NaN where x
            is no configuration.
    """

    x: FloatArray
    gap: FloatArray


def solve_closure(
    mechanism: Mechanism, x: FloatArray, free: IndexArray, *, to_minimum: bool = True
) -> DescentResult:
    """Return nearby configurations that close, or have the least residual.

    Levenberg-Marquardt: each step solves (J^T J + mu I) dx = -J^T e, in lengths of the mechanism and [rad],
    with mu in proportion to |e|^2. So it ends in Gauss-Newton steps, and moves nothing that need not move.

    Args:
        mechanism: The network.
        x: The starts, shape (variables, n), in [m], [rad] and as controls are given.
        free: The numbers of the variables that may change, shape (free,) [-].
        to_minimum: Whether a start at which nothing closes continues to the least residual; else it is given
            up.
    """
    best = np.array(x, dtype=np.float64)
    rows = np.arange(best.shape[1])
    gain = np.full(len(rows), FIRST_GAIN)
    now = _free_closure(mechanism, best, free)
    error = np.array(now.residual)
    for _ in range(MAX_STEPS):
        active = _is_active(now, gain, to_minimum)
        if not active.any():
            break
        rows, gain = rows[active], gain[active]
        now = Closure(now.residual[:, active], now.jacobian[:, :, active])
        square = dot_product(now.residual, now.residual)
        step = damped_step(now.jacobian, -now.residual, gain * square + MIN_DAMPING)
        moved = np.array(best[:, rows])
        moved[free] += step * mechanism.column_scales[free, np.newaxis]
        for part in mechanism.rotations:
            moved[part] = wrap_rotation_vector(tuple(moved[part]))
        new = _free_closure(mechanism, moved, free)
        linear = now.residual + product(now.jacobian, step)
        predicted = square - dot_product(linear, linear)
        gained = square - dot_product(new.residual, new.residual)
        taken = (gained > MIN_GAIN_RATIO * predicted) & (gained > 0.0)
        good, poor = taken & (gained > 0.75 * predicted), ~taken | (gained < 0.25 * predicted)
        gain = np.clip(gain * np.where(good, 0.125, np.where(poor, 4.0, 1.0)), *GAINS)
        best[:, rows[taken]], error[:, rows[taken]] = moved[:, taken], new.residual[:, taken]
        now = Closure(
            np.where(taken, new.residual, now.residual), np.where(taken, new.jacobian, now.jacobian)
        )
    return DescentResult(best, np.abs(error).max(axis=0, initial=0.0))


def _free_closure(mechanism: Mechanism, x: FloatArray, free: IndexArray) -> Closure:
    """Return the scaled closure with the columns of the free variables."""
    closure = evaluate_scaled_closure(mechanism, x)
    return Closure(closure.residual, closure.jacobian[:, free])


def _is_active(now: Closure, gain: FloatArray, to_minimum: bool) -> BoolArray:
    """Return which starts continue: those that are finite, not closed, and not at a least residual."""
    square = dot_product(now.residual, now.residual)
    slope = transposed_product(now.jacobian, now.residual)
    min_cosine = np.maximum(STATIONARY, 0.0 if to_minimum else MIN_COSINE * square**0.25)
    can_descend = slope * slope > min_cosine**2 * square * column_squares(now.jacobian)
    is_open = (square > ROUNDING_ERROR**2) & (square < np.inf) & (gain < GAINS[1])
    return np.asarray(is_open & can_descend.any(axis=0))


def close_by_newton(
    mechanism: Mechanism, x: FloatArray, free: IndexArray, *, wrap: bool = False
) -> FloatArray:
    """Return configurations that close next to others, by Newton's method with some variables free.

    All have the shape (variables, n), in [m], [rad] and as controls are given.

    Args:
        mechanism: The network.
        x: Configurations nearby.
        free: The numbers of the variables that may change, shape (free,) [-].
        wrap: Whether rotation vectors are wrapped to pi at most.
    """
    x, scales = np.array(x), mechanism.column_scales[free, np.newaxis]
    for _ in range(10):
        closure = evaluate_scaled_closure(mechanism, x)
        step = damped_step(closure.jacobian[:, free], -closure.residual, MIN_DAMPING)
        x[free] += step * scales
        for part in mechanism.rotations if wrap else ():
            x[part] = wrap_rotation_vector(tuple(x[part]))
        if not (np.sqrt(np.einsum("kn,kn->n", step, step)) > 1e-13).any():
            break
    return x


def iter_chunks(count: int) -> Iterator[slice]:
    """Yield slices of at most CHUNK configurations, in their order."""
    for start in range(0, count, CHUNK_SIZE):
        yield slice(start, min(start + CHUNK_SIZE, count))
