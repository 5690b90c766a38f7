"""Where a measuring device stands, and what it measures on an arm: both frames at once, from poses.

A device that stands anywhere (laser tracker, camera) measures a body that the tool carries (probe, board).
With Z, the arm's base in the device's frame, and X, the body in the tool's frame, a pose C computed from the
joints is measured as

    M = Z C X        R_M = R_Z R_C R_X,    p_M = R_Z (p_C + R_C d) + p_Z,    d = p_X

(robot-world and hand-eye calibration). Positions decide: (R_Z, p_Z, d) has the least mean |miss|^2 of them,
and R_X then that of orientations, which a file may write in a form that was taken for another. What positions
alone leave open is found from both together, by the mean of |miss|^2 + (l angle)^2 with l = `TURN_LENGTH`.

The R_Z that orientations tell in closed form, the one of positions without a tool, and rotations all around
are starts of a descent (Levenberg-Marquardt); d is linear. About the middle of the positions p_Z is none of
the unknowns. Misses are linear in the numbers of a pose, so that the triangular factor of all poses has the
same sum of squares in a few rows: thousands of poses cost as much as these.

Source: [Shah2013]_ (both rotations in closed form); [DornaikaHoraud1998]_ (both frames at once).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from math import prod
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IndexArray
from urmpipe_models.math3d import fit_rotation, to_matrices, to_quaternions

TURN_LENGTH = 0.01
"""What a radian counts as in [m] where positions leave something open: so little that orientations hardly
move what positions tell."""

OPEN = 1e-4
"""What moves positions by less, in [m] for each metre or radian of it, is open: joint angles of four digits
do as much. The least of it is taken."""

HARDLY = float(np.radians(1.0))
"""What moves them by less is hardly told: of 1 mm of a tool that turns by a degree, 0.02 mm are seen, as much
as the best arms repeat to."""

BETTER = 0.99
"""A later start is better if it leaves less than this share of what an earlier one left, by more than
`NOTHING`: where several frames explain few poses alike, that of the orientations stands."""

NOTHING = 1e-9
"""Root mean square miss in [m] that rounding leaves."""

NOWHERE = 1e15
"""A coordinate of so many [m] is a fault of its file, and its square would drown all others."""

STEPS = 100
"""A descent takes about ten steps."""

ROUGH = 1e-3
"""Starts are told apart by descents that end where a step takes less than this share of the squares away."""

SHORT = 1e-12
"""A step of this length, in [m] and [rad], is the last one."""

LEAST_DAMPING = 1e-16
"""What is seen by less than its root is not followed: rounding would lead anywhere."""

SHARE = 0.3
"""A direction that is open is named after the first part that has this share of it."""

BASE_ALONE = 1e-3
"""Of what is open the tool has the least; a turn of the base that moves no tool counts this share of it."""

PULLS = (*[1.0] * 20, 0.0, 0.0, 0.0)
"""Steps to the least of what is open take all of the way; the last ones only keep what is told."""

Part = Literal["tool offset", "tool turn", "base turn"]

_CROSS = np.cross(np.eye(3)[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)
"""[e]x of the three axes: [e]x v = e x v."""


@dataclass(frozen=True, slots=True)
class Untold:
    """Something about the frames that poses do not tell, or hardly.

    Attributes:
        part: tool offset (an offset of the base does the same), tool turn (a turn of the base does the same)
            or base turn (about the middle of the positions).
        axis: Unit vector along or about which [-]: of the tool in its own frame, of the base in the device's.
        seen: How far a metre or a radian of it moves positions in [m] or turns orientations in [rad], root
            mean square. Below `OPEN` the frames have the least of it.
    """

    part: Part
    axis: tuple[float, float, float]
    seen: float


@dataclass(frozen=True, slots=True, eq=False)
class HandEye:
    """Both frames of M = Z C X.

    Attributes:
        base_rotation: R_Z [-], shape (3, 3).
        base_position: p_Z in [m], shape (3,).
        tool_rotation: R_X [-], shape (3, 3); the identity without measured orientations.
        tool_position: d = p_X in [m], shape (3,).
        untold: What the poses do not tell, or hardly.
    """

    base_rotation: FloatArray
    base_position: FloatArray
    tool_rotation: FloatArray
    tool_position: FloatArray
    untold: tuple[Untold, ...]


def solve_hand_eye(
    position: FloatArray,
    rotation: FloatArray,
    measured: FloatArray,
    measured_rotation: FloatArray | None = None,
) -> HandEye:
    """Return the frames of base and tool that bring computed poses nearest to measured ones.

    Args:
        position: p_C, computed positions in [m], shape (n, 3).
        rotation: R_C, computed rotation matrices [-], shape (n, 3, 3).
        measured: p_M, measured positions in [m], shape (n, 3). Rows with a NaN on a side, or beyond
            `NOWHERE`, are left out; at least one is neither.
        measured_rotation: R_M, measured rotation matrices [-], shape (n, 3, 3), NaN where there is none; or
            None.
    """
    known = (np.abs(position) + np.abs(measured) < NOWHERE).all(axis=1) & np.isfinite(rotation).all(
        axis=(1, 2)
    )
    sides = [side[known] for side in (position, rotation, measured)]
    middle, rotation_middle, target = (side.mean(axis=0) for side in sides)
    alone = _Rows(*_condensed([side - side.mean(axis=0) for side in sides]))
    both = _with_turns(alone, rotation, measured_rotation)
    length = 0.0
    found = _best(alone, length, [*_by_orientations(both), _rigid(alone), *_ALL_AROUND])
    if len(both.turn):
        if _seen(alone, found)[0][0] < HARDLY:
            length = TURN_LENGTH
            found = _best(both, length, [*_by_orientations(both), found.base, *_ALL_AROUND])
        else:
            found = _with_tool_turn(both, found)
    found = _least(both, found, length)
    shift = target - found.base @ (middle + rotation_middle @ found.offset)
    return HandEye(found.base, shift, found.tool, found.offset, tuple(_untold(both, found)))


def rotation_residual(
    rotation: FloatArray, measured_rotation: FloatArray, base: FloatArray | None = None
) -> float:
    """Return how far measured orientations stay from computed ones with the best base and tool between them.

    It tells in which form and unit a file writes them: of each that is possible, call this with the matrices
    that it makes of the columns; the right one leaves the least by far. Some forms differ by a constant base
    and tool alone, such as angles about z, y, z and about z, x, z: give the base that positions tell
    (`hand_eye` without measured orientations) to tell these as well.

    Args:
        rotation: R_C, computed rotation matrices [-], shape (n, 3, 3).
        measured_rotation: R_M, measured ones [-], shape (n, 3, 3); rows with a NaN are left out.
        base: R_Z where it is known [-], shape (3, 3).

    Returns:
        Root mean square angle in [rad]; NaN without a row.
    """
    known = np.isfinite(rotation + measured_rotation).all(axis=(1, 2))
    computed, wanted = rotation[known], measured_rotation[known]
    if not len(computed):
        return float("nan")
    nowhere = np.zeros((0, 3))
    rows = _with_turns(_Rows(nowhere, np.zeros((0, 3, 3)), nowhere), computed, wanted)
    if base is None:
        found = _best(rows, 1.0, [*_by_orientations(rows), *_ALL_AROUND])
    else:
        found = _with_tool_turn(rows, _Frames(base, np.zeros(3), np.eye(3)))
    chord = np.linalg.norm(wanted - found.base @ computed @ found.tool, axis=(1, 2))
    angle = 2 * np.arcsin(np.minimum(chord / np.sqrt(8), 1.0))  # |R - R'|^2 = 8 sin^2(angle / 2)
    return float(np.sqrt(np.mean(angle**2)))


class _Rows(NamedTuple):
    """Poses, or the few rows that stand for them: positions about their middle, and orientations."""

    position: FloatArray
    rotation: FloatArray
    measured: FloatArray
    turn: FloatArray = np.zeros((0, 3, 3))
    measured_turn: FloatArray = np.zeros((0, 3, 3))


class _Frames(NamedTuple):
    """R_Z, d and R_X, or those of several starts along a first axis."""

    base: FloatArray
    offset: FloatArray
    tool: FloatArray

    def stepped(self, step: FloatArray) -> _Frames:
        """Return frames after a turn of the base, an offset and, of nine numbers, a turn of the tool."""
        tool = self.tool @ _turned(step[..., 6:]) if step.shape[-1] > 6 else self.tool
        return _Frames(_turned(step[..., :3]) @ self.base, self.offset + step[..., 3:6], tool)

    def of(self, start: IndexArray | int) -> _Frames:
        """Return those of some of several starts, or of one."""
        return _Frames(self.base[start], self.offset[start], self.tool[start])


_ALL_AROUND = [
    np.eye(3)[list(order)] * signs
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(np.eye(3)[list(order)] * signs) > 0.0
]
"""The 24 rotations of a cube."""


def _turned(vector: FloatArray) -> FloatArray:
    """Return the matrices of rotation vectors, shape (..., 3)."""
    turned = to_matrices(to_quaternions(vector.reshape(-1, 3), "vector"))
    return turned.reshape(*vector.shape, 3)


def _vector(rotation: FloatArray) -> FloatArray:
    """Return the rotation vector of a matrix."""
    quat = to_quaternions(rotation.reshape(1, 9), "matrix")[0]
    imaginary = quat[:3] * (1.0 if quat[3] >= 0.0 else -1.0)
    size = float(np.linalg.norm(imaginary))
    angle = 2 * np.arctan2(size, abs(quat[3]))
    return np.asarray(imaginary * (angle / size if size else 0.0))


def _with_turns(rows: _Rows, rotation: FloatArray, measured: FloatArray | None) -> _Rows:
    """Return rows with the orientations that both sides have."""
    if measured is None:
        return rows
    known = np.isfinite(rotation + measured).all(axis=(1, 2))
    turn, measured_turn = _condensed([rotation[known], measured[known]])
    return rows._replace(turn=turn, measured_turn=measured_turn)


def _condensed(sides: Sequence[FloatArray]) -> list[FloatArray]:
    """Return few rows whose products of two columns have the sums that those of all rows have as means."""
    columns = [side.reshape(len(side), prod(side.shape[1:])) for side in sides]
    factor = np.linalg.qr(np.hstack(columns), mode="r") / np.sqrt(max(len(sides[0]), 1))
    parts = np.split(factor, np.cumsum([column.shape[1] for column in columns])[:-1], axis=1)
    return [part.reshape(-1, *side.shape[1:]) for part, side in zip(parts, sides, strict=True)]


def _misses(rows: _Rows, frames: _Frames, length: float) -> tuple[FloatArray, FloatArray]:
    """Return all misses in [m] and their Jacobian of a step; |R_M - R|^2 / 2 is the squared angle.

    Shapes (..., misses) and (..., misses, 6 or 9), with the first axis of the frames if they have one.
    """
    base, tool = (each[..., np.newaxis, :, :] for each in (frames.base, frames.tool))
    starts = frames.offset.shape[:-1]
    computed = rows.position + np.einsum("nij,...j->...ni", rows.rotation, frames.offset)
    moved = computed @ frames.base.swapaxes(-1, -2)
    of_base = -np.einsum("kij,...nj->...nik", _CROSS, moved)
    jacobian = np.concatenate((of_base, -base @ rows.rotation), axis=-1).reshape(*starts, -1, 6)
    miss = (rows.measured - moved).reshape(*starts, -1)
    if not len(rows.turn):
        return miss, jacobian
    weight = length / np.sqrt(2.0)
    turned = base @ rows.turn @ tool
    turning = np.zeros((*starts, rows.turn.size, 9))
    turning[..., :3] = -weight * _last(np.einsum("kij,...njl->...nilk", _CROSS, turned))
    turning[..., 6:] = -weight * _last(np.einsum("...nij,kjl->...nilk", turned, _CROSS))
    standing = np.concatenate((jacobian, np.zeros((*jacobian.shape[:-1], 3))), axis=-1)
    apart = weight * (rows.measured_turn - turned).reshape(*starts, -1)
    return np.concatenate((miss, apart), axis=-1), np.concatenate((standing, turning), axis=-2)


def _last(changes: FloatArray) -> FloatArray:
    """Return changes of matrices, shape (..., n, 3, 3, k), a row an entry, shape (..., 9 n, k)."""
    return changes.reshape(*changes.shape[:-4], -1, changes.shape[-1])


def _by_orientations(rows: _Rows) -> Iterator[FloatArray]:
    """Yield the R_Z that orientations tell: the first left singular vector of K = sum(R_M kron R_C).

    R_M R_X^T R_C^T = R_Z makes K vec(R_X^T) = n vec(R_Z), and no unit vector grows more.
    """
    if len(rows.turn):
        k = np.einsum("nij,nkl->ikjl", rows.measured_turn, rows.turn).reshape(9, 9)
        first = np.linalg.svd(k)[0][:, 0].reshape(3, 3)
        yield fit_rotation(first * (1.0 if np.linalg.det(first) >= 0.0 else -1.0))[0]


def _rigid(rows: _Rows) -> FloatArray:
    """Return the R_Z of positions without a tool."""
    return fit_rotation(rows.measured.T @ rows.position)[0]


def _with_tool_turn(rows: _Rows, frames: _Frames) -> _Frames:
    """Return frames with the R_X of the least squared angles."""
    turned = frames.base[..., np.newaxis, :, :] @ rows.turn
    crossed = np.einsum("...nji,njk->...ik", turned, rows.measured_turn)
    return frames._replace(tool=fit_rotation(crossed)[0]) if len(rows.turn) else frames


def _best(rows: _Rows, length: float, bases: Iterable[FloatArray]) -> _Frames:
    """Return the frames with the least misses that a descent from any of some R_Z reaches."""
    found, left = _descended(rows, _starts(rows, np.array([*bases])), length, ROUGH)
    best = 0
    for k, miss in enumerate(left):
        if miss < BETTER * left[best] - NOTHING:
            best = k
    return _descended(rows, found.of(np.array([best])), length)[0].of(0)


def _starts(rows: _Rows, bases: FloatArray) -> _Frames:
    """Return the frames with given R_Z, shape (starts, 3, 3); d is linear."""
    count = len(bases)
    alone = _Frames(bases, np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)))
    columns = (bases[:, np.newaxis] @ rows.rotation).reshape(count, -1, 3)
    right = (rows.measured - rows.position @ bases.transpose(0, 2, 1)).reshape(count, -1)
    offset = _damped(columns, right, np.full(count, OPEN**2))
    return _with_tool_turn(rows, alone)._replace(offset=offset)


def _damped(columns: FloatArray, right: FloatArray, damping: FloatArray) -> FloatArray:
    """Return the x of the least |columns x - right|^2 + damping |x|^2 of several starts, (starts, k)."""
    starts, _, count = columns.shape
    least = np.sqrt(damping)[:, np.newaxis, np.newaxis] * np.eye(count)
    Q, R = np.linalg.qr(np.concatenate((columns, least), axis=1))
    whole = np.concatenate((right, np.zeros((starts, count))), axis=1)[:, :, np.newaxis]
    return np.asarray(np.linalg.solve(R, Q.transpose(0, 2, 1) @ whole)[:, :, 0])


def _descended(
    rows: _Rows, starts: _Frames, length: float, least_share: float = 0.0
) -> tuple[_Frames, FloatArray]:
    """Return frames at the foot of a descent from each start, and their root mean square misses.

    All descend side by side (Levenberg-Marquardt); misses of shape (starts,).
    """
    found = starts.of(np.arange(len(starts.base)))
    damping, going = np.full(len(found.base), 1e-6), np.arange(len(found.base))
    miss, jacobian = _misses(rows, found, length)
    for _ in range(STEPS):
        step = _damped(jacobian[going], -miss[going], damping[going])
        there = found.of(going).stepped(step)
        miss_there, jacobian_there = _misses(rows, there, length)
        before, after = (np.square(each).sum(axis=1) for each in (miss[going], miss_there))
        better = after < before
        damping[going] = np.where(better, np.maximum(damping[going] / 10, LEAST_DAMPING), damping[going] * 10)
        taken = going[better]
        for part, own in zip((*found, miss, jacobian), (*there, miss_there, jacobian_there), strict=True):
            part[taken] = own[better]
        ends = better & (before - after < least_share * before)
        going = going[~ends & (np.linalg.norm(step, axis=1) >= SHORT)]
        if not len(going):
            break
    return found, np.linalg.norm(miss, axis=1)


def _seen(rows: _Rows, frames: _Frames) -> tuple[FloatArray, FloatArray]:
    """Return by how much orthogonal steps are seen, the least first, and these as columns."""
    jacobian = _misses(rows, frames, 1.0)[1]
    squares, steps = np.linalg.eigh(jacobian.T @ jacobian)
    return np.sqrt(np.maximum(squares, 0.0)), steps


def _least(rows: _Rows, frames: _Frames, length: float) -> _Frames:
    """Return the frames with the least of all that is open: no tool where none is told."""
    for pull in PULLS:
        seen, steps = _seen(rows, frames)
        told, free = steps[:, seen >= OPEN], steps[:, seen < OPEN]
        if not free.shape[1]:
            break
        miss, jacobian = _misses(rows, frames, length)
        there = np.concatenate((BASE_ALONE * _vector(frames.base), frames.offset, _vector(frames.tool)))
        weights = np.array([BASE_ALONE] * 3 + [1.0] * 6)[: len(steps), np.newaxis]
        back = free @ np.linalg.lstsq(weights * free, -pull * there[: len(steps)])[0]
        frames = frames.stepped(told @ np.linalg.lstsq(jacobian @ told, -miss)[0] + back)
    return frames


def _untold(rows: _Rows, frames: _Frames) -> Iterator[Untold]:
    """Yield what is open, then what is hardly told."""
    jacobian = _misses(rows, frames, 1.0)[1]
    seen, steps = _seen(rows, frames)
    parts: tuple[tuple[Part, slice], ...] = (
        ("tool offset", slice(3, 6)),
        ("tool turn", slice(6, 9)),  # none without orientations
        ("base turn", slice(0, 3)),
    )
    for among in (seen < OPEN, (seen >= OPEN) & (seen < HARDLY)):
        rest = steps[:, among]
        for part, where in parts:
            axes, shares, mixed = np.linalg.svd(rest[where])
            count = int(np.count_nonzero(shares > SHARE))
            named = rest @ mixed[:count].T / shares[:count]
            for axis, step in zip(axes.T, named.T, strict=False):
                x, y, z = (axis * np.sign(axis[np.argmax(np.abs(axis))])).tolist()
                yield Untold(part, (x, y, z), float(np.linalg.norm(jacobian @ step)))
            rest = rest @ mixed[count:].T
