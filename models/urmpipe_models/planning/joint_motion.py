"""The joints along a planned path: how they change with arc length, exactly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.targets import Targets, misses
from urmpipe_models.kinematics.forward import bias_over_log, jacobian_over_log
from urmpipe_models.planning.line_arc import LineArcPath

NUDGE = 1e-6
"""Step of the fastest joint, in [rad] or [m], for a difference of Jacobians: error 1e-12, rounding 1e-10."""

NEAR = 1e-14
"""The tool within this of its path, in [m] and [rad], is on it: rounding."""

STEPS = 4
"""Newton steps at most: three square an error of 1e-2 down to rounding."""

SINGULAR = 1e-9
"""Singular values of a Jacobian below this share of the largest are 0 for a step onto the path: rounding."""

ROUNDING = 1e-15
"""Below this share they are 0 for slopes, which shall grow near a singular pose."""

PLAIN = 1e-5
"""A Jacobian whose pivots are all above this share of the largest is far from singular."""


@dataclass(frozen=True, slots=True, eq=False)
class JointSlopes:
    """Joint values by arc length.

    Attributes:
        q: In [rad] or [m], shape (n, joints).
        dq: dq/ds in [rad/m] or [-], shape (n, joints).
        ddq: d2q/ds2 in [rad/m2] or [1/m], shape (n, joints).
    """

    q: FloatArray
    dq: FloatArray
    ddq: FloatArray

    def rates(self, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return q' = dq s' and q'' = ddq s'^2 + dq s'', each of shape (n, joints), in SI.

        Args:
            v: s' in [m/s], shape (n,).
            a: s'' in [m/s2], shape (n,).
        """
        return self.dq * v[:, None], self.ddq * (v * v)[:, None] + self.dq * a[:, None]


def targets_at(path: LineArcPath, s: FloatArray) -> Targets:
    """Return where the tool shall be at arc lengths in [m], shape (n,)."""
    rotation = None if path.turning is None else path.turning.matrices(s)
    return Targets(path.points(s).position, rotation)


def joint_slopes(
    chain: Chain, path: LineArcPath, q: FloatArray, s: FloatArray, moves: BoolArray, *, before: bool = False
) -> JointSlopes:
    """Return the slopes of joint values that lead the tool along a path with the least motion.

    With x' = (t, turn rate) and x'' = (curvature, 0): q' = J+ x', and differentiated once more, with
    y = J+^T q', q'' = J+ (x'' - J' q') + (1 - J+ J) J'^T y; the last term is 0 where J is square. Joints
    that do not move have no column in J.

    Args:
        chain: The arm.
        path: The path.
        q: Joint values along it in [rad] or [m], shape (n, joints); a row of NaN has slopes of NaN.
        s: Arc lengths in [m], shape (n,).
        moves: Which joints move, shape (n, joints).
        before: Whether slopes that jump, where two segments meet, are those before it; else after it.
    """
    points = path.points(s, before=before)
    first, second = points.tangent, points.curvature
    if path.turning is not None:
        first = np.hstack((first, path.turning.rates(s, before=before)))
        second = np.hstack((second, np.zeros_like(second)))
    dq, ddq = np.full(q.shape, np.nan), np.full(q.shape, np.nan)
    known = np.isfinite(q).all(axis=1)
    for rows in _alike(moves, np.flatnonzero(known)):
        dq[rows], ddq[rows] = _slopes(chain, q[rows], first[rows], second[rows], moves[rows[0]])
    return JointSlopes(q, dq, ddq)


def polished(chain: Chain, path: LineArcPath, q: FloatArray, s: FloatArray, moves: BoolArray) -> FloatArray:
    """Return joint values with the tool on the path to the last digits, by Newton steps q + J+ (x - FK(q)).

    Each step leaves the square of what it finds. What is nearer than `NEAR` stays, and so does, in a singular
    pose, what no step removes.

    Args:
        chain: The arm.
        path: The path.
        q: Joint values near it in [rad] or [m], shape (n, joints), NaN where there are none.
        s: Arc lengths in [m], shape (n,).
        moves: Which joints move, shape (n, joints).

    Returns:
        In [rad] or [m], shape (n, joints).
    """
    better, off = q.copy(), np.flatnonzero(np.isfinite(q).all(axis=1))
    for _ in range(STEPS):
        miss = np.hstack(misses(chain, better[off], targets_at(path, s[off])))
        miss = miss[:, : 3 if path.turning is None else 6]
        far = np.abs(miss).max(axis=1) > NEAR
        off, miss = off[far], miss[far]
        for chosen in _alike(moves[off], np.arange(len(off))):
            rows, pattern = off[chosen], moves[off[chosen[0]]]
            J = jacobian_over_log(chain, better[rows])[:, : miss.shape[1], pattern]
            better[np.ix_(rows, pattern)] += _times(_inverses(J, SINGULAR), miss[chosen])
    return better


def _slopes(
    chain: Chain, q: FloatArray, first: FloatArray, second: FloatArray, moves: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return dq/ds and d2q/ds2 where the same joints move, both of shape (m, joints)."""
    rows = first.shape[1]
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    J = jacobian_over_log(chain, q)[:, :rows, moves]
    inverse = _inverses(J, ROUNDING)
    dq[:, moves] = _times(inverse, first)
    ddq[:, moves] = _times(inverse, second - bias_over_log(chain, q, dq)[:, :rows])
    if J.shape[2] > rows:
        changed = _jacobian_along(chain, q, dq)[:, :rows, moves]
        pull = _times(changed.transpose(0, 2, 1), _times(inverse.transpose(0, 2, 1), dq[:, moves]))
        ddq[:, moves] += pull - _times(inverse, _times(J, pull))
    return dq, ddq


def _alike(moves: BoolArray, rows: IndexArray) -> Iterator[IndexArray]:
    """Yield the rows, of some, in which the same joints move."""
    while len(rows):
        same = (moves[rows] == moves[rows[0]]).all(axis=1)
        yield rows[same]
        rows = rows[~same]


def _inverses(J: FloatArray, cutoff: float) -> FloatArray:
    """Return pseudo-inverses, shape (n, k, j), of matrices, shape (n, j, k).

    A tall matrix is Q R, and its pseudo-inverse R^-1 Q^T. Only those that are nearly singular, as the
    pivots of R show, need their singular values, which cost three times as much.

    Args:
        J: In any unit.
        cutoff: Singular values below this share of the largest count as 0.
    """
    tall = J if J.shape[1] > J.shape[2] else J.transpose(0, 2, 1)
    Q, R = np.linalg.qr(tall)
    pivots = np.abs(np.diagonal(R, axis1=1, axis2=2))
    regular = pivots.min(axis=1) > PLAIN * pivots.max(axis=1)
    inverse = np.empty(tall.shape)
    inverse[regular] = Q[regular] @ np.linalg.inv(R[regular]).transpose(0, 2, 1)
    inverse[~regular] = np.linalg.pinv(tall[~regular], rcond=cutoff).transpose(0, 2, 1)
    return inverse if tall is not J else inverse.transpose(0, 2, 1)


def _times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the products of matrices, shape (n, j, k), and vectors, shape (n, k)."""
    return np.asarray(np.einsum("njk,nk->nj", matrix, vector))


def _jacobian_along(chain: Chain, q: FloatArray, dq: FloatArray) -> FloatArray:
    """Return the derivative of the Jacobian along a motion, by a central difference, shape (n, 6, joints)."""
    step = NUDGE / np.maximum(np.abs(dq).max(axis=1, keepdims=True), 1e-12)
    change = jacobian_over_log(chain, q + step * dq) - jacobian_over_log(chain, q - step * dq)
    return np.asarray(change / (2.0 * step)[:, :, None])
