"""How far an arm is from a singular pose: singular values, manipulability and determinant over a log."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import chain_to_screws, jacobian_over_log

MAX_PARALLEL_SINE = 0.1
"""Sine of the angle between two axes below which they count as parallel.

A calibrated arm has axes that were meant to be parallel and are not by 1e-4 rad: where their common normal
stands, some hundred metres away, says nothing about its size.
"""

NEAR_SINGULAR = 1e-4
"""Smallest singular value [-] below which a pose counts as nearly singular: a spherical wrist is aligned
within some 0.05 deg, and joints turn ten thousand times as far as the tool."""

Line: TypeAlias = tuple[FloatArray, FloatArray]
"""A point [m] and the unit vector of an axis."""


@dataclass(frozen=True, slots=True, eq=False)
class SingularityLog:
    """How far an arm is from losing a freedom, over a log; all 0 in a singular pose.

    Attributes:
        smallest: Smallest singular value of the scaled Jacobian [-], shape (n,): how fast joint rates of
            length 1 move the tool in the direction in which they move it least, in characteristic lengths
            and radians. Of an arm with fewer joints than rows, among the directions that it has. NaN where
            q is.
        manipulability: sqrt(det(J J^T)), the volume of the velocity ellipsoid but for a constant, of the
            Jacobian in SI units, shape (n,); sqrt(det(J^T J)) of an arm with fewer joints than rows.
        determinant: det J in SI units, shape (n,); None where J is not square.
        length: The characteristic length in [m].

    Source: [Yoshikawa1985]_ (manipulability).
    """

    smallest: FloatArray
    manipulability: FloatArray
    determinant: FloatArray | None
    length: float


def singularity_over_log(
    chain: Chain, q: FloatArray, *, orientation: bool = True, length: float | None = None
) -> SingularityLog:
    """Return how far an arm is from a singular pose at every row of q.

    Singular values of a Jacobian in metres and radians would depend on the unit of length. So the rows of
    the velocity are divided by a characteristic length L, and the columns of prismatic joints multiplied
    by it: diag(1/L, 1) J diag(1 or L) has no unit, and is the same for an arm and its scale model.

    A joint whose limits are equal cannot move: J has no column of it, unless none of the joints can.

    Args:
        chain: The arm, its tool included.
        q: Joint values in [rad] or [m], shape (n, joints).
        orientation: False if the tool may turn as it likes: then J has the three rows of the velocity.
        length: L in [m]; `characteristic_length` by default.
    """
    unit = characteristic_length(chain) if length is None else length
    rows = 6 if orientation else 3
    whole = np.asarray(np.isfinite(q).all(axis=1))
    free = np.array([joint.lower != joint.upper for joint in chain.moving])
    free |= not free.any()
    jacobians = jacobian_over_log(chain, q[whole])[:, :rows, free]
    across = np.array([1.0 / unit] * 3 + [1.0] * (rows - 3))
    along = np.array([unit if joint.kind == "prismatic" else 1.0 for joint in chain.moving])
    scaled = across[:, None] * jacobians * along[free]
    square = jacobians.shape[1] == jacobians.shape[2]
    return SingularityLog(
        _filled(np.linalg.svd(scaled, compute_uv=False)[:, -1], whole),
        _filled(_volume(jacobians), whole),
        _filled(np.linalg.det(jacobians), whole) if square else None,
        unit,
    )


@lru_cache(maxsize=32)
def characteristic_length(chain: Chain) -> float:
    """Return the length of an arm in [m] from its first axis along its links to the tool centre point.

    The way goes along the common normal from each axis to the next, and along the axis from one normal to
    the next: sum |a_i| + sum |d_i| of its Denavit-Hartenberg parameters. It depends on the axes alone: not
    on the base, on q, or on where a description puts its frames. A prismatic joint has no axis of its own
    place, and adds nothing; of an arm without any length it is 1 m.
    """
    alone = replace(chain, joints=tuple(replace(joint, mimic=None) for joint in chain.joints), start=())
    found = chain_to_screws(alone)
    assert found is not None  # there is no mimic left
    lines = list(zip(found.point[found.revolute], found.direction[found.revolute], strict=True))
    if not lines:
        return 1.0
    total, foot = 0.0, None
    for one, other in pairwise(lines):
        normal = _common_normal(one, other)
        if normal is None:
            shift = _across(one, other[0])
            total += float(np.linalg.norm(shift))
            foot = None if foot is None else foot + shift
        else:
            leave, reach = normal
            total += float(np.linalg.norm(reach - leave))
            total += 0.0 if foot is None else float(np.linalg.norm(leave - foot))
            foot = reach
    last = _across(lines[-1], found.position) if foot is None else found.position - foot
    return total + float(np.linalg.norm(last)) or 1.0


def _across(line: Line, point: FloatArray) -> FloatArray:
    """Return the way to a point from the nearest point of a line."""
    away = point - line[0]
    return np.asarray(away - (away @ line[1]) * line[1])


def _common_normal(one: Line, other: Line) -> tuple[FloatArray, FloatArray] | None:
    """Return where the common normal of two lines leaves the one and reaches the other; None if parallel."""
    (point, axis), (target, direction) = one, other
    normal = np.cross(axis, direction)
    square = float(normal @ normal)
    if square < MAX_PARALLEL_SINE**2:
        return None
    away = target - point
    return (
        point + (np.cross(away, direction) @ normal) / square * axis,
        target + (np.cross(away, axis) @ normal) / square * direction,
    )


def _volume(jacobians: FloatArray) -> FloatArray:
    """Return the product of the singular values, shape (n,), by QR: J J^T would lose half the digits."""
    tall = jacobians if jacobians.shape[1] >= jacobians.shape[2] else jacobians.transpose(0, 2, 1)
    triangular = np.linalg.qr(tall, mode="r")
    return np.asarray(np.abs(np.diagonal(triangular, axis1=1, axis2=2).prod(axis=1)))


def _filled(values: FloatArray, whole: NDArray[np.bool_]) -> FloatArray:
    """Return values at the rows that are whole, NaN at the others."""
    result = np.full(len(whole), np.nan)
    result[whole] = values
    return result
