"""Newton steps that keep a network closed, element by element: floats, columns and symbols pass alike.

`closure.py` and `descent.py` solve many configurations by arrays and stop where each is closed. Here the
number of steps is fixed and nothing branches on a value, so that the steps can be traced to C:

1. `closure_residual`: e, what does not close. Of a cut joint, whose frames are R_1, p_1 and R_2, p_2 from its
   two sides, p_2 - p_1 and the skew part of R_2 R_1^T; of an element what it is too long by.
2. `closure_jacobian`: J = de/dx of the free variables, by the twists of joints and the wrenches of elements.
   It is exact where the network is closed, which is enough for steps that converge quadratically.
3. `damped_normal_step`: (J^T J + mu I) dx = -J^T e by an L D L^T factor without pivots. Redundant rows add
   up; along an idle spin, which no row determines, mu keeps dx small.
4. `close_network`: a number of such steps; rotation vectors are kept within half a turn.
5. `predict_variables`: where steps begin: on the line through the last two configurations, so that a motion
   goes straight on through a special configuration, where several branches meet.

Rows are in lengths of the mechanism and [rad], and so are columns: J is a list of columns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import Element, Vector, add, cross, dot, minus, plus, scale, subtract, times
from urmpipe_models.networks.closure import SLIDING_SCREWS, relative_movers
from urmpipe_models.networks.descent import FLOOR
from urmpipe_models.networks.element_measures import measure
from urmpipe_models.networks.joint_motion import Screws, joint_frame, joint_screws
from urmpipe_models.networks.mechanism import Given, Mechanism, Posed, of_controls
from urmpipe_models.networks.rotations import turning_of, wrap_rotation_vector
from urmpipe_models.transform import Transform

Column: TypeAlias = list[Element]
"""One element per row."""

MAX_STEP = 0.5  # rad or lengths that a Newton step changes a variable by: beyond, the tangent leads astray
MAX_RATIO = 2.0  # steps ahead in steps of the past: farther on, a line is no better than Newton's tangent
MIN_SQUARE = 1e-24  # of a past step in rad or lengths: a shorter one is rounding and has no direction


def close_network(mechanism: Mechanism, x: Sequence[Element], steps: int) -> list[Element]:
    """Return the variables after Newton steps with the controls held.

    From a distance h to the closed configuration, in rad or lengths of the mechanism, a step leads to one of
    the order of h^2. Where nothing closes nearby, it is where the steps ended: see `largest_residual`.

    Args:
        mechanism: The network.
        x: The variables in [m], [rad] and as controls are given, one element each: floats, arrays of shape
            (n,), or symbols.
        steps: How many.
    """
    closed = list(x)
    scales = mechanism.column_scales
    for _ in range(steps if len(mechanism.free) else 0):
        posed, controls = mechanism.posed(closed), mechanism.control_slopes(closed)
        residual = _residual(mechanism, closed, posed, controls)
        columns = _jacobian(mechanism, closed, posed, controls)
        step = damped_normal_step(columns, residual)
        longest = reduce(np.maximum, (np.abs(change) for change in step))
        part_taken = MAX_STEP / np.maximum(longest, MAX_STEP)
        for k, change in zip(mechanism.free, step, strict=True):
            closed[k] = plus(closed[k], times(float(scales[k]), times(part_taken, change)))
        for part in mechanism.rotations:
            closed[part] = wrap_rotation_vector(_vector(closed, part))
    return closed


def predict_variables(
    mechanism: Mechanism, x: Sequence[Element], change: Sequence[Element], ahead: Sequence[Element]
) -> list[Element]:
    """Return the variables on the line through the last two configurations, at other values of the controls.

    The change of the free variables counts as often as the step of the controls projected on the step before
    has the length of that, at most MAX_RATIO times; not at all if the controls stood still.

    Args:
        mechanism: The network.
        x: The variables at the last configuration in [m], [rad] and as controls are given, one element each.
        change: How they have changed from the configuration before, see `changes`.
        ahead: The controls that can be set, as they are given.
    """
    scales = mechanism.column_scales
    past = [change[k] / float(scales[k]) for k in mechanism.controls]
    step = [(value - x[k]) / float(scales[k]) for k, value in zip(mechanism.controls, ahead, strict=True)]
    square = _product(past, past)
    ratio = _product(past, step) / np.maximum(square, MIN_SQUARE)
    ratio = np.maximum(np.minimum(ratio, MAX_RATIO), -MAX_RATIO)
    predicted = [*ahead, *(x[k] + ratio * change[k] for k in mechanism.free)]
    for part in mechanism.rotations:
        predicted[part] = wrap_rotation_vector(_vector(predicted, part))
    return predicted


def changes(mechanism: Mechanism, before: Sequence[Element], x: Sequence[Element]) -> list[Element]:
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


def closure_residual(mechanism: Mechanism, x: Sequence[Element]) -> Column:
    """Return what does not close, in lengths of the mechanism and [rad].

    Rows: of each cut joint its gap along x, y, z of the ground and the skew part of its rotation about them,
    which is sin(a) u of a rotation by a about u; then of each element its error, of a pair in its own unit.

    Args:
        mechanism: The network.
        x: The variables in [m], [rad] and as controls are given, one element each.
    """
    return _residual(mechanism, x, mechanism.posed(x), mechanism.control_slopes(x))


def largest_residual(mechanism: Mechanism, x: Sequence[Element]) -> Element:
    """Return the largest absolute entry of `closure_residual`; 0 of a network without loops."""
    sizes = [np.abs(row) for row in closure_residual(mechanism, x)]
    return reduce(np.maximum, sizes) if sizes else 0.0


def closure_jacobian(mechanism: Mechanism, x: Sequence[Element]) -> list[Column]:
    """Return the derivatives of `closure_residual` by each free variable, exact where the network is closed.

    Args:
        mechanism: The network.
        x: The variables in [m], [rad] and as controls are given, one element each.
    """
    return _jacobian(mechanism, x, mechanism.posed(x), mechanism.control_slopes(x))


def damped_normal_step(columns: Sequence[Column], residual: Column, damping: float = FLOOR) -> Column:
    """Return dx of (J^T J + mu I) dx = -J^T e.

    As J^T J is positive semidefinite, no pivot is less than mu; rounding may not make it
    so.

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


def _residual(mechanism: Mechanism, x: Sequence[Element], posed: Posed, controls: dict[str, Given]) -> Column:
    per_length = 1.0 / mechanism.length
    rows: Column = []
    for first, second in cut_frames(mechanism, x, posed, controls):
        rows += scale(per_length, subtract(second.translation, first.translation))
        # of small turns d the sum over the axes c of c x (c + d x c) is 2 d
        pairs = zip(first.columns, second.columns, strict=True)
        rows += scale(0.5, reduce(add, (cross(before, after) for before, after in pairs)))
    scales = mechanism.row_scales[len(rows) :].tolist()
    for element, per_unit in zip(mechanism.network.elements, scales, strict=True):
        if element.is_pair:
            rows.append(times(per_unit, mechanism.pair_error(element, x, controls)[0].value))
            continue
        frames = (posed.bodies[name].frame for name in element.bodies)
        length = of_controls(element.length, controls).value
        rows.append(times(per_length, minus(measure(element, *frames).distance, length)))
    return rows


def _jacobian(
    mechanism: Mechanism, x: Sequence[Element], posed: Posed, controls: dict[str, Given]
) -> list[Column]:
    per_length, scales = 1.0 / mechanism.length, mechanism.column_scales
    screws = _free_screws(mechanism, x, posed, controls)
    first_free = len(mechanism.controls)
    columns: list[Column] = [[0.0] * mechanism.rows for _ in mechanism.free]
    cut_joints = [mechanism.network.joints[cut] for cut in mechanism.graph.cuts]
    frames = cut_frames(mechanism, x, posed, controls)
    for row, (joint, (here, _)) in enumerate(zip(cut_joints, frames, strict=True)):
        for mover, sign in relative_movers(posed.bodies, joint.bodies, joint.name).items():
            for k, w, v in screws[mover]:
                factor = sign * float(scales[k])
                velocity = add(v, cross(w, here.translation))
                entries = (*scale(factor * per_length, velocity), *scale(factor, w))
                columns[k - first_free][6 * row : 6 * row + 6] = entries
    for row, element in enumerate(mechanism.network.elements, 6 * len(cut_joints)):
        if element.is_pair:
            error, _ = mechanism.pair_error(element, x, controls)
            for k in error.slopes.keys() & set(mechanism.free.tolist()):
                factor = float(scales[k] * mechanism.row_scales[row])
                columns[k - first_free][row] = times(factor, error.slopes[k])
            continue
        measured = measure(element, *(posed.bodies[name].frame for name in element.bodies))
        for mover, sign in relative_movers(posed.bodies, element.bodies).items():
            for k, w, v in screws[mover]:
                rate = plus(dot(measured.moment, w), dot(measured.force, v))
                columns[k - first_free][row] = times(sign * float(scales[k]) * per_length, rate)
    return columns


def cut_frames(
    mechanism: Mechanism, x: Sequence[Element], posed: Posed, controls: dict[str, Given]
) -> Iterator[tuple[Transform, Transform]]:
    """Yield the frame of each cut joint in the ground, once from each of its two bodies."""
    for cut in mechanism.graph.cuts:
        joint = mechanism.network.joints[cut]
        moved = joint_frame(joint, [value.value for value in mechanism.values(joint, x, controls)])
        yield posed.joints[joint.name] @ moved, posed.bodies[joint.bodies[1]].frame @ joint.frames[1]


def _free_screws(
    mechanism: Mechanism, x: Sequence[Element], posed: Posed, controls: dict[str, Given]
) -> dict[str, list[tuple[int, Vector, Vector]]]:
    """Return the free variables of each mover by number, with the twist in the ground of one unit of each."""
    twists: dict[str, list[tuple[int, Vector, Vector]]] = {}
    for joint in mechanism.network.joints:
        drives = joint.drives
        screws: Screws = []
        if any(drive is None for drive in drives):
            values = [value.value for value in mechanism.values(joint, x, controls)]
            screws = joint_screws(joint, values, posed.joints[joint.name])
        twists[joint.name] = [
            (mechanism.places[joint.name, index], *screw)
            for index, (drive, screw) in enumerate(zip(drives, screws, strict=False))
            if drive is None
        ]
    for name in mechanism.graph.roots[1:]:
        first = mechanism.places[name, 0]
        p = posed.bodies[name].frame.translation
        axes = turning_of((x[first + 3], x[first + 4], x[first + 5]))
        screws = [*SLIDING_SCREWS, *((axis, cross(p, axis)) for axis in axes)]
        twists[name] = [(first + index, *screw) for index, screw in enumerate(screws)]
    return twists


def _vector(x: Sequence[Element], part: slice) -> Vector:
    """Return the three variables that are a rotation vector in [rad]."""
    return x[part.start], x[part.start + 1], x[part.start + 2]


def _product(first: Sequence[Element], second: Sequence[Element]) -> Element:
    """Return the scalar product of two lists; constants that are 0 cost nothing."""
    total: Element = 0.0
    for a, b in zip(first, second, strict=True):
        total = plus(total, times(a, b))
    return total
