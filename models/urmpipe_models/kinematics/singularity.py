"""Singularity: singular values, manipulability and determinant of the Jacobian over a log.

Singular values of a Jacobian in metres and radians depend on the unit of length. They are those of
diag(1/L, 1) J diag(1 or L), with the arm's characteristic length L = sum |a_i| + sum |d_i|
(`characteristic_length`), which is the same for an arm and its scale model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import chain_to_screws, jacobian_over_log

# Sine of the angle between two axes up to which they are parallel. Axes of a calibrated arm that are parallel
# by design deviate by 1e-4 rad: their common normal, some hundred metres away, is not part of its size.
MAX_PARALLEL_SINE = 0.1

# Smallest singular value [-] below which a pose is nearly singular: a spherical wrist is aligned within some
# 0.05 deg, and joints move ten thousand times as fast as the tool.
NEAR_SINGULAR = 1e-4

Line: TypeAlias = tuple[FloatArray, FloatArray]  # a point [m] and the unit vector of an axis


@dataclass(frozen=True, slots=True, eq=False)
class SingularityLog:
    """Distance of an arm from singular poses over a log; all 0 in a singular pose, NaN where q is NaN.

    Attributes:
        smallest: Smallest singular value of the scaled Jacobian [-], shape (n,): the least speed of the tool,
            over all directions, at joint rates of norm 1, in characteristic lengths and radians. For an arm
            with fewer joints than rows, over the directions in which it can move.
        manipulability: sqrt(det(J J^T)) of the Jacobian in SI units, shape (n,): the volume of the velocity
            ellipsoid except for a constant; sqrt(det(J^T J)) for an arm with fewer joints than rows.
        determinant: det J in SI units, shape (n,); None if J is not square.
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
    """Return the distance of an arm from singular poses at every row of q.

    The rows of the velocity are divided by a characteristic length L, and the columns of prismatic joints
    multiplied by it: diag(1/L, 1) J diag(1 or L) has no unit, and is the same for an arm and its scale model.

    A joint whose limits are equal cannot move: J has no column for it, unless no joint can move.

    Args:
        chain: The arm, its tool included.
        q: Joint values in [rad] or [m], shape (n, joints).
        orientation: False if the orientation of the tool is free: then J has the three rows of the velocity.
        length: L in [m]; `characteristic_length` by default.
    """
    unit = characteristic_length(chain) if length is None else length
    rows = 6 if orientation else 3
    valid = np.asarray(np.isfinite(q).all(axis=1))
    free = np.array([joint.lower != joint.upper for joint in chain.moving])
    free |= not free.any()
    jacobians = jacobian_over_log(chain, q[valid])[:, :rows, free]
    row_scale = np.array([1.0 / unit] * 3 + [1.0] * (rows - 3))
    column_scale = np.array([unit if joint.kind == "prismatic" else 1.0 for joint in chain.moving])
    scaled = row_scale[:, None] * jacobians * column_scale[free]
    # The product of the singular values by QR, as J J^T would lose half the digits.
    square = jacobians.shape[1] == jacobians.shape[2]
    tall = jacobians if jacobians.shape[1] >= jacobians.shape[2] else jacobians.transpose(0, 2, 1)
    triangular = np.linalg.qr(tall, mode="r")
    volume = np.asarray(np.abs(np.diagonal(triangular, axis1=1, axis2=2).prod(axis=1)))

    def at_all_rows(values: FloatArray) -> FloatArray:
        result = np.full(len(valid), np.nan)
        result[valid] = values
        return result

    return SingularityLog(
        at_all_rows(np.linalg.svd(scaled, compute_uv=False)[:, -1]),
        at_all_rows(volume),
        at_all_rows(np.linalg.det(jacobians)) if square else None,
        unit,
    )


@lru_cache(maxsize=32)
def characteristic_length(chain: Chain) -> float:
    """Return the length of an arm in [m] from its first axis along its links to the tool centre point.

    The path follows the common normal from each axis to the next, and the axis from one normal to the next:
    sum |a_i| + sum |d_i| of its Denavit-Hartenberg parameters. It depends on the axes alone: not on the base,
    on q, or on the choice of frames in a description. The axis of a prismatic joint has no position, so the
    joint adds nothing; for an arm without any length it is 1 m.
    """
    independent = tuple(replace(joint, mimic=None) for joint in chain.joints)
    screws = chain_to_screws(replace(chain, joints=independent, start=()))
    assert screws is not None  # no joint is a mimic
    lines = list(zip(screws.point[screws.revolute], screws.direction[screws.revolute], strict=True))
    if not lines:
        return 1.0
    total, foot = 0.0, None
    for line, next_line in pairwise(lines):
        normal = _common_normal(line, next_line)
        if normal is None:
            shift = _perpendicular(line, next_line[0])
            total += float(np.linalg.norm(shift))
            foot = None if foot is None else foot + shift
        else:
            leave, reach = normal
            total += float(np.linalg.norm(reach - leave))
            total += 0.0 if foot is None else float(np.linalg.norm(leave - foot))
            foot = reach
    last = _perpendicular(lines[-1], screws.position) if foot is None else screws.position - foot
    return total + float(np.linalg.norm(last)) or 1.0


def _perpendicular(line: Line, point: FloatArray) -> FloatArray:
    """Return the vector to a point from the nearest point of a line."""
    offset = point - line[0]
    return np.asarray(offset - (offset @ line[1]) * line[1])


def _common_normal(line: Line, other: Line) -> tuple[FloatArray, FloatArray] | None:
    """Return both ends of the common normal of two lines; None if they are parallel."""
    (point, axis), (target, direction) = line, other
    normal = np.cross(axis, direction)
    square = float(normal @ normal)
    if square < MAX_PARALLEL_SINE**2:
        return None
    offset = target - point
    return (
        point + (np.cross(offset, direction) @ normal) / square * axis,
        target + (np.cross(offset, axis) @ normal) / square * direction,
    )
