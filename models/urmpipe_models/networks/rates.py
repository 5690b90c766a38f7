"""The closure of a network elementwise: Newton steps that can be traced to C, and rates along a motion.

`closure` solves many configurations by arrays and stops where each is closed. Here floats, columns, symbols
and Taylor series pass through the same lines, the number of steps is fixed and nothing branches on a value.

1. `closure_residual`: e, what does not close. Of a cut joint, whose frames are R_1, p_1 and R_2, p_2 from its
   two sides, p_2 - p_1 and the skew part of R_2 R_1^T; of an element its excess length.
2. `closure_jacobian`: J = de/dx of the free variables, by the twists of joints and the wrenches of elements.
   It is exact where the network is closed, which is enough for steps that converge quadratically.
3. `damped_normal_step`: (J^T J + mu I) dx = -J^T e by an L D L^T factor without pivots. Redundant rows add
   up; along an idle spin, which no row determines, mu keeps dx small.
4. `close_network`: a number of such steps; rotation vectors are kept within half a turn. `predict_variables`:
   where steps begin: on the line through the last two configurations, so that a motion continues straight
   through a special configuration, where several branches meet.
5. `Taylor`: a value with two derivatives by time, as an element: (f(u))' = f' u', (f(u))'' = f'' u'^2 + f'
   u''. So velocity and acceleration of the outputs of a model come from the same lines as the outputs.
6. `compute_rates`: with the prescribed variables d and those that follow y, the closure F(y, d) = 0 gives

       J_y y' = -J_d d'                         velocities
       J_y y'' = -J_d d'' - J' x'               accelerations
       T = dy/dd = -J_y^+ J_d                   transmission

   J' x' is the second derivative of F for y'' = d'' = 0: `Taylor` carries it exactly through the lines that
   compute F. `point_motion`: position, velocity and acceleration of points of bodies likewise.

Residual rows and columns of J are in lengths of the mechanism and [rad]; J is a list of columns.

Source: Griewank and Walther 2008, Evaluating Derivatives, chapter 13 (`Taylor`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, TypeAlias

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from urmpipe_models.elementwise import (
    Element,
    FloatArray,
    IndexArray,
    Vector,
    add,
    cross,
    dot,
    minus,
    plus,
    scale,
    subtract,
    times,
)
from urmpipe_models.ik.numeric import damped_step
from urmpipe_models.ik.task import product
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.closure import (
    MIN_DAMPING,
    TRANSLATION_SCREWS,
    MechanismState,
    evaluate_scaled_closure,
    evaluate_state,
    iter_chunks,
    relative_movers,
    stack_elements,
)
from urmpipe_models.networks.continuation import BranchDerivatives
from urmpipe_models.networks.joint_motion import (
    Twists,
    joint_frame,
    joint_twists,
    left_jacobian,
    wrap_rotation_vector,
)
from urmpipe_models.networks.mechanism import Mechanism, evaluate_expression
from urmpipe_models.networks.mobility import IdleSpin, find_idle_spins, spin_angles

Column: TypeAlias = list[Element]  # one element per row

MAX_STEP = 0.5  # rad or lengths that a Newton step changes a variable by: beyond, the tangent leads astray
MAX_RATIO = 2.0  # steps ahead in steps of the past: farther on, a line is no better than Newton's tangent
MIN_SQUARE = 1e-24  # of a past step in rad or lengths: a shorter one is rounding and has no direction


# ---------------------------------------------------------------------------------------- closure


def closure_residual(mechanism: Mechanism, x: Sequence[Element]) -> Column:
    """Return the residual in lengths of the mechanism and [rad].

    Rows: of each cut joint its gap along x, y, z of the ground and the skew part of its rotation about them,
    which is sin(a) u of a rotation by a about u; then of each element its error, of a pair in its own unit.
    The variables x are in [m], [rad] and as controls are given, one element each.
    """
    return _residual(evaluate_state(mechanism, x))


def largest_residual(mechanism: Mechanism, x: Sequence[Element]) -> Element:
    """Return the largest absolute entry of `closure_residual`; 0 of a network without loops."""
    sizes = [np.abs(row) for row in closure_residual(mechanism, x)]
    return reduce(np.maximum, sizes) if sizes else 0.0


def closure_jacobian(mechanism: Mechanism, x: Sequence[Element]) -> list[Column]:
    """Return the derivatives of `closure_residual` by free variables, exact where the network is closed."""
    return _jacobian(evaluate_state(mechanism, x))


def _residual(state: MechanismState) -> Column:
    mechanism, per_length = state.mechanism, 1.0 / state.mechanism.length
    rows: Column = []
    for first, second in _cut_frames(state):
        rows += scale(per_length, subtract(second.translation, first.translation))
        # of small turns d the sum over the axes c of c x (c + d x c) is 2 d
        pairs = zip(first.columns, second.columns, strict=True)
        rows += scale(0.5, reduce(add, (cross(before, after) for before, after in pairs)))
    scales = mechanism.row_scales[len(rows) :].tolist()
    for element, per_unit in zip(mechanism.network.elements, scales, strict=True):
        if element.is_pair:
            rows.append(times(per_unit, mechanism.pair_error(element, state.x, state.controls)[0].value))
            continue
        length = evaluate_expression(element.length, state.controls).value
        rows.append(times(per_length, minus(state.measure(element).distance, length)))
    return rows


def _jacobian(state: MechanismState) -> list[Column]:
    mechanism, bodies = state.mechanism, state.placements.bodies
    per_length, scales = 1.0 / mechanism.length, mechanism.column_scales
    twists = _free_twists(state)
    first_free = len(mechanism.controls)
    columns: list[Column] = [[0.0] * mechanism.rows for _ in mechanism.free]
    cut_joints = [mechanism.network.joints[cut] for cut in mechanism.graph.cuts]
    for row, (joint, (here, _)) in enumerate(zip(cut_joints, _cut_frames(state), strict=True)):
        for mover, sign in relative_movers(bodies, joint.bodies, joint.name).items():
            for k, w, v in twists[mover]:
                factor = sign * float(scales[k])
                velocity = add(v, cross(w, here.translation))
                entries = (*scale(factor * per_length, velocity), *scale(factor, w))
                columns[k - first_free][6 * row : 6 * row + 6] = entries
    for row, element in enumerate(mechanism.network.elements, 6 * len(cut_joints)):
        if element.is_pair:
            error, _ = mechanism.pair_error(element, state.x, state.controls)
            for k in error.gradient.keys() & set(mechanism.free.tolist()):
                factor = float(scales[k] * mechanism.row_scales[row])
                columns[k - first_free][row] = times(factor, error.gradient[k])
            continue
        measured = state.measure(element)
        for mover, sign in relative_movers(bodies, element.bodies).items():
            for k, w, v in twists[mover]:
                rate = plus(dot(measured.moment, w), dot(measured.force, v))
                columns[k - first_free][row] = times(sign * float(scales[k]) * per_length, rate)
    return columns


def _cut_frames(state: MechanismState) -> Iterator[tuple[Transform, Transform]]:
    """Yield the frame of each cut joint in the ground, once from each of its two bodies."""
    for cut in state.mechanism.graph.cuts:
        joint = state.mechanism.network.joints[cut]
        here = state.placements.joints[joint.name] @ joint_frame(joint, state.joint_elements(joint))
        yield here, state.placements.bodies[joint.bodies[1]].frame @ joint.frames[1]


def _free_twists(state: MechanismState) -> dict[str, list[tuple[int, Vector, Vector]]]:
    """Return the free variables of each mover by number, with the twist in the ground of one unit of each."""
    mechanism, x, placements, _ = state
    twists: dict[str, list[tuple[int, Vector, Vector]]] = {}
    for joint in mechanism.network.joints:
        screws: Twists = []
        if any(drive is None for drive in joint.drives):
            screws = joint_twists(joint, state.joint_elements(joint), placements.joints[joint.name])
        twists[joint.name] = [
            (mechanism.variable_index[joint.name, index], *screw)
            for index, (drive, screw) in enumerate(zip(joint.drives, screws, strict=False))
            if drive is None
        ]
    for name in mechanism.graph.roots[1:]:
        first = mechanism.variable_index[name, 0]
        p = placements.bodies[name].frame.translation
        axes = left_jacobian((x[first + 3], x[first + 4], x[first + 5]))
        screws = [*TRANSLATION_SCREWS, *((axis, cross(p, axis)) for axis in axes)]
        twists[name] = [(first + index, *screw) for index, screw in enumerate(screws)]
    return twists


def _vector(x: Sequence[Element], part: slice) -> Vector:
    return x[part.start], x[part.start + 1], x[part.start + 2]


def _wrap_rotations(mechanism: Mechanism, x: list[Element]) -> None:
    """Wrap rotation vectors to half a turn at most, in place."""
    for part in mechanism.rotations:
        x[part] = wrap_rotation_vector(_vector(x, part))


# ---------------------------------------------------------------------------------------- Newton steps


def close_network(mechanism: Mechanism, x: Sequence[Element], steps: int) -> list[Element]:
    """Return the variables after Newton steps with the controls held.

    From a distance h to the closed configuration, in rad or lengths of the mechanism, a step leads to one of
    the order of h^2. Where nothing closes nearby, it is where the steps ended: see `largest_residual`.

    Args:
        mechanism: The network.
        x: The variables in [m], [rad] and as controls are given, one element each: floats, arrays of shape
            (n,), or symbols.
        steps: Their number.
    """
    closed = list(x)
    scales = mechanism.column_scales
    for _ in range(steps if len(mechanism.free) else 0):
        state = evaluate_state(mechanism, closed)
        residual = _residual(state)
        step = damped_normal_step(_jacobian(state), residual)
        longest = reduce(np.maximum, (np.abs(change) for change in step))
        part_taken = MAX_STEP / np.maximum(longest, MAX_STEP)
        for k, change in zip(mechanism.free, step, strict=True):
            closed[k] = plus(closed[k], times(float(scales[k]), times(part_taken, change)))
        _wrap_rotations(mechanism, closed)
    return closed


def damped_normal_step(columns: Sequence[Column], residual: Column, damping: float = MIN_DAMPING) -> Column:
    """Return dx of (J^T J + mu I) dx = -J^T e.

    J^T J is positive semidefinite, so no pivot is less than mu; a smaller one is rounding and raised to mu.

    Args:
        columns: J, a list of columns.
        residual: e.
        damping: mu, above 0.
    """
    count = len(columns)
    lower: list[Column] = [[] for _ in columns]  # L below its diagonal of ones, row by row
    scaled: list[Column] = [[] for _ in columns]  # L D
    inverse: Column = []
    for j in range(count):
        pivot = minus(_product(columns[j], columns[j]), _product(lower[j], scaled[j]))
        inverse.append(1.0 / np.maximum(plus(pivot, damping), damping))
        for i in range(j + 1, count):
            entry = minus(_product(columns[i], columns[j]), _product(lower[i][:j], scaled[j]))
            scaled[i].append(entry)
            lower[i].append(times(entry, inverse[j]))
    step: Column = []
    for j in range(count):
        right = times(-1.0, _product(columns[j], residual))
        step.append(minus(right, _product(lower[j], step)))
    step = [times(entry, factor) for entry, factor in zip(step, inverse, strict=True)]
    for j in range(count - 1, -1, -1):
        below = [lower[i][j] for i in range(j + 1, count)]
        step[j] = minus(step[j], _product(below, step[j + 1 :]))
    return step


def _product(first: Sequence[Element], second: Sequence[Element]) -> Element:
    """Return the scalar product of two lists; constants that are 0 cost nothing."""
    total: Element = 0.0
    for a, b in zip(first, second, strict=True):
        total = plus(total, times(a, b))
    return total


def predict_variables(
    mechanism: Mechanism, x: Sequence[Element], change: Sequence[Element], ahead: Sequence[Element]
) -> list[Element]:
    """Return the variables on the line through the last two configurations, at other values of the controls.

    The change of the free variables counts as often as the step of the controls projected on the step before
    has the length of that, at most MAX_RATIO times; not at all if the controls stood still.

    Args:
        mechanism: The network.
        x: The variables at the last configuration in [m], [rad] and as controls are given, one element each.
        change: How they have changed from the configuration before, see `variable_changes`.
        ahead: The controls that can be set, as they are given.
    """
    scales = mechanism.column_scales
    past = [change[k] / float(scales[k]) for k in mechanism.controls]
    step = [(value - x[k]) / float(scales[k]) for k, value in zip(mechanism.controls, ahead, strict=True)]
    square = _product(past, past)
    ratio = _product(past, step) / np.maximum(square, MIN_SQUARE)
    ratio = np.maximum(np.minimum(ratio, MAX_RATIO), -MAX_RATIO)
    predicted = [*ahead, *(x[k] + ratio * change[k] for k in mechanism.free)]
    _wrap_rotations(mechanism, predicted)
    return predicted


def variable_changes(mechanism: Mechanism, before: Sequence[Element], x: Sequence[Element]) -> list[Element]:
    """Return how variables have changed: of a rotation vector as if it had not been wrapped on the way.

    Args:
        mechanism: The network.
        before: The variables of the configuration before in [m], [rad] and as controls are given.
        x: Those of a configuration.
    """
    start = list(before)
    for part in mechanism.rotations:
        vector = _vector(start, part)
        difference = subtract(_vector(x, part), vector)
        angle = np.sqrt(dot(vector, vector))
        other = 1.0 - 2.0 * np.pi / np.maximum(angle, 1.0)  # the same rotation, the other way round
        start[part] = scale(np.where(dot(difference, difference) > np.pi**2, other, 1.0), vector)
    return [now - then for now, then in zip(x, start, strict=True)]


# ---------------------------------------------------------------------------------------- Taylor series


class Taylor(NDArrayOperatorsMixin):
    """A value and its derivatives.

    Attributes:
        value: In its unit, a float or an array of shape (n,).
        first: Its derivative by time, likewise.
        second: Its second derivative by time, likewise.
    """

    __slots__ = ("first", "second", "value")

    def __init__(self, value: Element, first: Element = 0.0, second: Element = 0.0) -> None:
        self.value, self.first, self.second = value, first, second

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply one of NumPy's functions; comparisons are of the values."""
        if method != "__call__" or options:
            return NotImplemented
        terms = [term if isinstance(term, Taylor) else Taylor(term) for term in inputs]
        if ufunc.__name__ in _COMPARISONS:
            return ufunc(*(term.value for term in terms))
        rule = _RULES.get(ufunc.__name__)
        return NotImplemented if rule is None else rule(*terms)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        """Apply `np.where`."""
        if function is not np.where or options:
            return NotImplemented
        condition, *choices = arguments
        return _where(condition, *(term if isinstance(term, Taylor) else Taylor(term) for term in choices))


_COMPARISONS = {"less", "less_equal", "greater", "greater_equal", "equal", "not_equal"}


def _where(condition: Any, u: Taylor, v: Taylor) -> Taylor:
    pairs = ((u.value, v.value), (u.first, v.first), (u.second, v.second))
    return Taylor(*(np.where(condition, *pair) for pair in pairs))


def _chain(u: Taylor, value: Element, slope: Element, curvature: Element) -> Taylor:
    return Taylor(value, slope * u.first, curvature * u.first * u.first + slope * u.second)


def _add(u: Taylor, v: Taylor) -> Taylor:
    return Taylor(u.value + v.value, u.first + v.first, u.second + v.second)


def _negative(u: Taylor) -> Taylor:
    return Taylor(-u.value, -u.first, -u.second)


def _multiply(u: Taylor, v: Taylor) -> Taylor:
    return Taylor(
        u.value * v.value,
        u.first * v.value + u.value * v.first,
        u.second * v.value + 2.0 * u.first * v.first + u.value * v.second,
    )


def _reciprocal(u: Taylor) -> Taylor:
    inverse = np.divide(1.0, u.value)
    return _chain(u, inverse, -inverse * inverse, 2.0 * inverse * inverse * inverse)


def _power(u: Taylor, v: Taylor) -> Taylor:
    """u^v, also of negative u where v is constant: then ln(u) is not computed."""
    if not (np.any(v.first) or np.any(v.second)):
        n = v.value
        factors = n, n * (n - 1.0)
        slope, curvature = (  # of 0^0 and 0^1, too
            factor * np.power(u.value, np.where(factor == 0.0, 0.0, n - order))
            for order, factor in enumerate(factors, 1)
        )
        return _chain(u, np.power(u.value, n), slope, curvature)
    return _exp(_multiply(v, _log(u)))


def _sin(u: Taylor) -> Taylor:
    sine = np.sin(u.value)
    return _chain(u, sine, np.cos(u.value), -sine)


def _cos(u: Taylor) -> Taylor:
    cosine = np.cos(u.value)
    return _chain(u, cosine, -np.sin(u.value), -cosine)


def _tan(u: Taylor) -> Taylor:
    tangent = np.tan(u.value)
    slope = 1.0 + tangent * tangent
    return _chain(u, tangent, slope, 2.0 * tangent * slope)


def _exp(u: Taylor) -> Taylor:
    value = np.exp(u.value)
    return _chain(u, value, value, value)


def _log(u: Taylor) -> Taylor:
    inverse = np.divide(1.0, u.value)
    return _chain(u, np.log(u.value), inverse, -inverse * inverse)


def _sqrt(u: Taylor) -> Taylor:
    root = np.sqrt(u.value)
    inverse = np.divide(0.5, root)
    return _chain(u, root, inverse, -np.divide(inverse, 2.0 * u.value))


def _arctan2(y: Taylor, x: Taylor) -> Taylor:
    """The angle of (x, y): its rate is (x y' - y x') / (x^2 + y^2), differentiated as a product."""
    rate = Taylor(x.value * y.first - y.value * x.first, x.value * y.second - y.value * x.second)
    square = _add(_multiply(x, x), _multiply(y, y))
    first = rate.value / square.value
    second = (rate.first - first * square.first) / square.value
    return Taylor(np.arctan2(y.value, x.value), first, second)


def _choose(larger: bool) -> Callable[[Taylor, Taylor], Taylor]:
    def rule(u: Taylor, v: Taylor) -> Taylor:
        condition = u.value >= v.value if larger else u.value <= v.value
        return _where(condition, u, v)

    return rule


_RULES: dict[str, Callable[..., Taylor]] = {
    "add": _add,
    "subtract": lambda u, v: _add(u, _negative(v)),
    "negative": _negative,
    "multiply": _multiply,
    "divide": lambda u, v: _multiply(u, _reciprocal(v)),
    "square": lambda u: _multiply(u, u),
    "power": _power,
    "sin": _sin,
    "cos": _cos,
    "tan": _tan,
    "exp": _exp,
    "log": _log,
    "sqrt": _sqrt,
    "arctan2": _arctan2,
    "floor": lambda u: Taylor(np.floor(u.value)),
    "remainder": lambda u, period: Taylor(np.remainder(u.value, period.value), u.first, u.second),
    "absolute": lambda u: _where(u.value < 0.0, _negative(u), u),
    "maximum": _choose(larger=True),
    "minimum": _choose(larger=False),
}


# ---------------------------------------------------------------------------------------- rates


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Rates of all variables at n configurations.

    Attributes:
        xd: Velocities in [m/s], [rad/s] and as controls are given per [s], shape (variables, n).
        xdd: Accelerations, likewise per [s2].
        transmission: dy/dd of the variables that follow by the prescribed ones, in their units, shape
            (variables, driven, n); the unit matrix for the prescribed ones.
        distance: Smallest singular value of the scaled J_y without idle spins [-], shape (n,): 0 at a
            singular pose.
    """

    xd: FloatArray
    xdd: FloatArray
    transmission: FloatArray
    distance: FloatArray


def compute_rates(
    mechanism: Mechanism,
    x: FloatArray,
    xd: FloatArray,
    xdd: FloatArray,
    driven: IndexArray,
    free: IndexArray,
    spins: int,
    slopes: Sequence[BranchDerivatives] = (),
) -> Rates:
    """Return the rates of the variables that follow.

    Args:
        mechanism: The network.
        x: Configurations that close, shape (variables, n), in [m], [rad] and as controls are given.
        xd: Velocities of the prescribed variables per [s], shape (driven, n).
        xdd: Their accelerations per [s2], shape (driven, n).
        driven: Their numbers, shape (driven,) [-].
        free: The numbers of the variables that follow, shape (free,) [-].
        spins: The number of idle spins: they stay as they are.
        slopes: Derivatives along the line of the drives at samples where branches meet: x' = x_s s' and
            x'' = x_ss s'^2 + x_s s'' there. The transmission by each of several drives is NaN there.
    """
    velocity, acceleration = np.zeros_like(x), np.zeros_like(x)
    velocity[driven], acceleration[driven] = xd, xdd
    transmission = np.zeros((len(x), len(driven), x.shape[1]))
    transmission[driven, np.arange(len(driven))] = 1.0
    distance = np.full(x.shape[1], np.inf)
    idle_spins = find_idle_spins(mechanism) if spins else ()
    for rows in iter_chunks(x.shape[1]) if len(free) else ():
        jacobian = evaluate_scaled_closure(mechanism, x[:, rows]).jacobian
        followers = jacobian[:, free]
        scales = mechanism.column_scales[:, np.newaxis]
        for k, place in enumerate(driven.tolist()):
            unit = _solve(followers, -jacobian[:, place] / scales[place]) * scales[free]
            transmission[free, k, rows] = unit
            velocity[free, rows] += unit * xd[k, rows]
        terms = (x[:, rows], velocity[:, rows], acceleration[:, rows])
        if idle_spins:
            _hold_spins(mechanism, idle_spins, followers, free, spins, terms[:2])
        rest = np.zeros_like(terms[0])
        rest[driven] = xdd[:, rows]
        residual = closure_residual(mechanism, _taylor(*terms[:2], rest))
        second = _in_joint_frames(mechanism, terms[0], _stack_derivatives(residual, 2, rest.shape[1]))
        acceleration[free, rows] = _solve(followers, -second) * scales[free]
        if idle_spins:
            _hold_spins(mechanism, idle_spins, followers, free, spins, terms)
        values = np.linalg.svd(followers.transpose(2, 0, 1), compute_uv=False)
        if (place := len(free) - spins - 1) < values.shape[1] and place >= 0:
            distance[rows] = values[:, place]
    for near, first, second in slopes:
        along = first[driven] / np.einsum("dk,dk->k", first[driven], first[driven])
        speed, change = (np.einsum("dk,dk->k", along, rates[:, near]) for rates in (xd, xdd))
        velocity[:, near], acceleration[:, near] = first * speed, second * speed**2 + first * change
        is_single = len(driven) == 1
        ratios = first[free] / first[driven[0]] if is_single else np.full_like(first[free], np.nan)
        for k in range(len(driven)):
            transmission[free[:, np.newaxis], k, near] = ratios
    return Rates(velocity, acceleration, transmission, distance)


def _in_joint_frames(mechanism: Mechanism, x: FloatArray, rows: FloatArray) -> FloatArray:
    """Return rows of `closure_residual`, along the axes of the ground, in those of the joints."""
    turned = np.array(rows)
    frames = _cut_frames(evaluate_state(mechanism, x))
    for k, (here, _) in enumerate(frames):
        for first in (6 * k, 6 * k + 3):
            for axis, column in enumerate(here.columns):
                turned[first + axis] = dot(column, tuple(rows[first : first + 3]))
    return turned


def _solve(jacobian: FloatArray, load: FloatArray) -> FloatArray:
    """Return the least squares solution, refined twice: normal equations alone lose twice the digits."""
    solution = damped_step(jacobian, load, MIN_DAMPING)
    for _ in range(2):
        solution = solution + damped_step(jacobian, load - product(jacobian, solution), MIN_DAMPING)
    return solution


def _hold_spins(
    mechanism: Mechanism,
    spins: Sequence[IdleSpin],
    followers: FloatArray,
    free: IndexArray,
    count: int,
    terms: tuple[FloatArray, ...],
) -> None:
    """Add to the last term of x, x', x'' what keeps the angles of idle spins, along their directions."""
    x, target, order = terms[0], terms[-1], len(terms) - 1
    n = x.shape[1]
    directions = np.linalg.svd(followers.transpose(2, 0, 1))[2][:, len(free) - count :]
    scales = mechanism.column_scales[free, np.newaxis]
    rates = _stack_derivatives(spin_angles(mechanism, spins, _taylor(*terms)), order, n)
    by_direction = np.empty((len(spins), count, n))
    for k in range(count):
        unit = np.zeros_like(x)
        unit[free] = directions[:, k].T * scales
        by_direction[:, k] = _stack_derivatives(spin_angles(mechanism, spins, _taylor(x, unit)), 1, n)
    shares = np.einsum("nks,sn->kn", np.linalg.pinv(by_direction.transpose(2, 0, 1)), -rates)
    target[free] += np.einsum("nkf,kn->fn", directions, shares) * scales


def _taylor(*terms: FloatArray) -> list[Taylor]:
    """Return one series per variable of x, x', x'', shape (variables, n) each."""
    return [Taylor(*row) for row in zip(*terms, strict=True)]


def _stack_derivatives(elements: Sequence[Element], order: int, n: int) -> FloatArray:
    """Return first or second derivatives of elements as rows, shape (k, n); 0 of constants."""
    series = [element if isinstance(element, Taylor) else Taylor(element) for element in elements]
    return stack_elements([term.first if order == 1 else term.second for term in series], n)


def point_motion(
    mechanism: Mechanism,
    x: FloatArray,
    xd: FloatArray,
    xdd: FloatArray,
    body: str,
    point: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position [m], velocity [m/s] and acceleration [m/s2] of a point of a body, shape (n, 3) each.

    Args:
        mechanism: The network.
        x: Configurations, shape (variables, n), in [m], [rad] and as controls are given.
        xd: Their velocities per [s], likewise.
        xdd: Their accelerations per [s2], likewise.
        body: Name of the body.
        point: The point in the frame of the body in [m].
    """
    parts = np.zeros((3, x.shape[1], 3))
    for rows in iter_chunks(x.shape[1]):
        motion = _taylor(x[:, rows], xd[:, rows], xdd[:, rows])
        for k, coordinate in enumerate(mechanism.poses(motion)[body].point(point)):
            term = coordinate if isinstance(coordinate, Taylor) else Taylor(coordinate)
            parts[0, rows, k], parts[1, rows, k], parts[2, rows, k] = term.value, term.first, term.second
    return parts[0], parts[1], parts[2]
