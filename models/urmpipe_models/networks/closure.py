"""What does not close of a network whose loops are cut, and its Jacobian by twists and wrenches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.elementwise import Element, add, cross
from urmpipe_models.networks.element_measures import MEASURES, measure
from urmpipe_models.networks.joint_motion import Screws, forbidden, joint_frame, joint_screws
from urmpipe_models.networks.mechanism import Given, Mechanism, Pose, Posed, of_controls
from urmpipe_models.networks.parts import ConstraintElement, Joint
from urmpipe_models.networks.rotations import turning_of, untwisted
from urmpipe_models.orientation import quaternions, rotation_vectors
from urmpipe_models.transform import Transform


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
    posed, controls = mechanism.posed(x), mechanism.control_slopes(x)
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
    posed, controls = mechanism.posed(at), mechanism.control_slopes(at)
    equations = list(_equations(mechanism, at, posed, controls))
    for joint in mechanism.network.joints:
        values = [one.value for one in mechanism.values(joint, at, controls)]
        frame = posed.joints[joint.name]
        driven = iter([k for k, drive in enumerate(joint.drives) if drive is not None])
        for constraint, unit, (w, v) in forbidden(joint, values, frame):
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
        yield element.name, MEASURES[element.kind], np.eye(mechanism.rows)[row]


def _equations(
    mechanism: Mechanism, x: FloatArray, posed: Posed, controls: dict[str, Given]
) -> Iterator[_Equation]:
    """Yield what closes each loop, and what holds each element."""
    n = x.shape[1]
    for k, cut in enumerate(mechanism.graph.cuts):
        joint = mechanism.network.joints[cut]
        moved = joint_frame(joint, [one.value for one in mechanism.values(joint, x, controls)])
        here = posed.joints[joint.name] @ moved
        gap = gap_of(here.inverse() @ posed.bodies[joint.bodies[1]].frame @ joint.frames[1], n)
        movers = relative_movers(posed.bodies, joint.bodies, joint.name)
        yield _Equation(slice(6 * k, 6 * k + 6), gap, _carrier(here, gap), movers, {})
    first = 6 * len(mechanism.graph.cuts)
    for row, element in enumerate(mechanism.network.elements, first):
        if element.is_pair:
            error, rates = mechanism.pair_error(element, x, controls)
            slopes = {place: -slope for place, slope in error.slopes.items()}
            values, no_wrench = _stacked((error.value,), n), np.zeros((1, 6, n))
            yield _Equation(slice(row, row + 1), values, no_wrench, {}, slopes, rates)
            continue
        length = of_controls(element.length, controls)
        measured = measure(element, *(posed.bodies[name].frame for name in element.bodies))
        wrench = _stacked((*measured.moment, *measured.force), n)[np.newaxis]
        excess = _stacked((measured.distance - length.value,), n)
        movers = relative_movers(posed.bodies, element.bodies)
        yield _Equation(slice(row, row + 1), excess, wrench, movers, length.slopes)


def _screws(
    mechanism: Mechanism, x: FloatArray, posed: Posed, controls: dict[str, Given]
) -> dict[str, tuple[IndexArray, FloatArray]]:
    """Return of each mover the numbers of variables that move it, and their twists.

    A twist is the angular velocity in [rad] and the velocity in [m] of the point at the ground's origin, a
    unit of the variable, shape (6, k, n).
    """
    n = x.shape[1]
    found = {}
    for joint in mechanism.network.joints:
        values = mechanism.values(joint, x, controls)
        twists = joint_screws(joint, [one.value for one in values], posed.joints[joint.name])
        found[joint.name] = _combined(twists, values, n)
    for name in mechanism.graph.roots[1:]:
        first = mechanism.places[name, 0]
        values = [Given(None, {first + k: 1.0}) for k in range(6)]
        vector = (x[first + 3], x[first + 4], x[first + 5])
        p = posed.bodies[name].frame.translation
        turning = [(axis, cross(p, axis)) for axis in turning_of(vector)]
        found[name] = _combined([*SLIDING_SCREWS, *turning], values, n)
    return found


SLIDING_SCREWS: Screws = [
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
]
"""The twists of a body that slides along the axes of the ground."""


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


def relative_movers(posed: dict[str, Pose], bodies: tuple[str, str], cut: str = "") -> dict[str, int]:
    """Return the sign with which each mover moves the second body against the first; -1 of the cut joint."""
    first, second = (posed[name].movers for name in bodies)
    signs = {name: second.get(name, 0) - first.get(name, 0) for name in {**first, **second}}
    if cut:
        signs[cut] = -1
    return {name: sign for name, sign in signs.items() if sign}


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


def body_twists(mechanism: Mechanism, x: FloatArray) -> dict[str, FloatArray]:
    """Return the twist of each body in the ground per unit of each variable, shape (6, variables, n).

    Angular velocity in [rad], then the velocity in [m] of the point at the origin of the ground.

    Args:
        mechanism: The network.
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
    """
    posed, controls = mechanism.posed(x), mechanism.control_slopes(x)
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
    equations = _equations(mechanism, x, mechanism.posed(x), mechanism.control_slopes(x))
    for tie, equation in zip(ties, equations, strict=True):
        yield tie, equation.rows, equation.carrier
