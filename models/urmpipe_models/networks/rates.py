"""Rates along a motion of a network: velocities, accelerations, transmission, distance to a singular pose.

With the prescribed variables d and those that follow y, the closure F(y, d) = 0 gives

    J_y y' = -J_d d'                         velocities
    J_y y'' = -J_d d'' - J' x'               accelerations
    T = dy/dd = -J_y^+ J_d                   transmission

J' x' is the second derivative of F for y'' = d'' = 0: `taylor.Taylor` carries it exactly through the lines
that compute F. Points of bodies get their velocity and acceleration likewise from those that compute their
place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_models.elementwise import Element, dot
from urmpipe_models.inverse.iterative.descent import damped_step
from urmpipe_models.inverse.iterative.small_systems import product
from urmpipe_models.networks.closure import scaled_closure
from urmpipe_models.networks.descent import FLOOR
from urmpipe_models.networks.idle_spins import idle_spins, spin_angles
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.motion import Slopes, iter_chunks
from urmpipe_models.networks.newton import closure_residual, cut_frames
from urmpipe_models.taylor import Taylor


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
    slopes: Sequence[Slopes] = (),
) -> Rates:
    """Return the rates of the variables that follow.

    Args:
        mechanism: The network.
        x: Configurations that close, shape (variables, n), in [m], [rad] and as controls are given.
        xd: Velocities of the prescribed variables per [s], shape (driven, n).
        xdd: Their accelerations per [s2], shape (driven, n).
        driven: Their numbers, shape (driven,) [-].
        free: The numbers of the variables that follow, shape (free,) [-].
        spins: How many idle spins there are: they stay as they are.
        slopes: Derivatives along the line of the drives at samples where branches meet: x' = x_s s' and
            x'' = x_ss s'^2 + x_s s'' there. The transmission by each of several drives is NaN there.
    """
    velocity, acceleration = np.zeros_like(x), np.zeros_like(x)
    velocity[driven], acceleration[driven] = xd, xdd
    transmission = np.zeros((len(x), len(driven), x.shape[1]))
    transmission[driven, np.arange(len(driven))] = 1.0
    distance = np.full(x.shape[1], np.inf)
    for rows in iter_chunks(x.shape[1]) if len(free) else ():
        jacobian = scaled_closure(mechanism, x[:, rows]).jacobian
        followers = jacobian[:, free]
        scales = mechanism.column_scales[:, np.newaxis]
        for k, place in enumerate(driven.tolist()):
            unit = _solve(followers, -jacobian[:, place] / scales[place]) * scales[free]
            transmission[free, k, rows] = unit
            velocity[free, rows] += unit * xd[k, rows]
        _hold_spins(mechanism, followers, free, spins, x[:, rows], velocity[:, rows], None)
        rest = np.zeros_like(x[:, rows])
        rest[driven] = xdd[:, rows]
        motion = [Taylor(*terms) for terms in zip(x[:, rows], velocity[:, rows], rest, strict=True)]
        second = _stack([_derivative(row, 2) for row in closure_residual(mechanism, motion)], rest.shape[1])
        second = _in_joint_frames(mechanism, x[:, rows], second)
        acceleration[free, rows] = _solve(followers, -second) * scales[free]
        _hold_spins(mechanism, followers, free, spins, x[:, rows], velocity[:, rows], acceleration[:, rows])
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
        motion = [Taylor(*terms) for terms in zip(x[:, rows], xd[:, rows], xdd[:, rows], strict=True)]
        place = mechanism.poses(motion)[body].point(point)
        for k, coordinate in enumerate(place):
            term = coordinate if isinstance(coordinate, Taylor) else Taylor(coordinate)
            parts[0, rows, k], parts[1, rows, k], parts[2, rows, k] = term.value, term.first, term.second
    return parts[0], parts[1], parts[2]


def _in_joint_frames(mechanism: Mechanism, x: FloatArray, rows: FloatArray) -> FloatArray:
    """Return rows of `closure_residual`, along the axes of the ground, along those of `scaled_closure`."""
    turned = np.array(rows)
    frames = cut_frames(mechanism, list(x), mechanism.posed(x), mechanism.control_slopes(x))
    for k, (here, _) in enumerate(frames):
        for first in (6 * k, 6 * k + 3):
            for axis, column in enumerate(here.columns):
                turned[first + axis] = dot(column, tuple(rows[first : first + 3]))
    return turned


def _solve(jacobian: FloatArray, load: FloatArray) -> FloatArray:
    """Return the least squares solution, refined twice: normal equations alone lose twice the digits."""
    solution = damped_step(jacobian, load, FLOOR)
    for _ in range(2):
        solution = solution + damped_step(jacobian, load - product(jacobian, solution), FLOOR)
    return solution


def _hold_spins(
    mechanism: Mechanism,
    followers: FloatArray,
    free: IndexArray,
    count: int,
    x: FloatArray,
    xd: FloatArray,
    xdd: FloatArray | None,
) -> None:
    """Add to velocities, or to accelerations, what keeps the angles of idle spins, along their directions."""
    spins = idle_spins(mechanism)
    if not (count and spins):
        return
    n = x.shape[1]
    directions = np.linalg.svd(followers.transpose(2, 0, 1))[2][:, len(free) - count :]
    scales = mechanism.column_scales[free, np.newaxis]
    target = xd if xdd is None else xdd
    motion = [Taylor(*terms) for terms in zip(x, xd, np.zeros_like(x) if xdd is None else xdd, strict=True)]
    angles = spin_angles(mechanism, spins, motion)
    rates = _stack([_derivative(angle, 1 if xdd is None else 2) for angle in angles], n)
    by_direction = np.empty((len(spins), count, n))
    for k in range(count):
        unit = np.zeros_like(x)
        unit[free] = directions[:, k].T * scales
        motion = [Taylor(*terms) for terms in zip(x, unit, strict=True)]
        by_direction[:, k] = _stack([_derivative(one, 1) for one in spin_angles(mechanism, spins, motion)], n)
    shares = np.einsum("nks,sn->kn", np.linalg.pinv(by_direction.transpose(2, 0, 1)), -rates)
    target[free] += np.einsum("nkf,kn->fn", directions, shares) * scales


def _derivative(element: Element, order: int) -> Element:
    if not isinstance(element, Taylor):
        return 0.0
    return element.first if order == 1 else element.second


def _stack(elements: Sequence[Element], n: int) -> FloatArray:
    rows = np.zeros((len(elements), n))
    for k, element in enumerate(elements):
        rows[k] = element
    return rows
