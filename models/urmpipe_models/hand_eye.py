"""Hand-eye and robot-world calibration: the frames of a measuring device and of what it measures on an arm.

A device in the world (laser tracker, camera) measures a body that the tool carries (probe, board). With Z,
the arm's base in the device's frame, and X, the body in the tool's frame, a pose C computed from the joints
is measured as

    M = Z C X        R_M = R_Z R_C R_X,    p_M = R_Z (p_C + R_C d) + p_Z,    d = p_X

1. Positions decide: (R_Z, p_Z, d) has the minimum mean |residual|^2 of them, and R_X then that of
   orientations, which a file may write in another form than assumed. Unknowns that positions do not
   determine are found from both, by the mean of |residual|^2 + (l angle)^2 with l = `RADIAN_LENGTH`.
2. Starts: the R_Z of orientations in closed form, that of positions without a tool, and 24 rotations; for
   each of them d is linear. A Levenberg-Marquardt descent starts at each. With positions relative to their
   mean, p_Z is not an unknown. Residuals are linear in the numbers of a pose, so the triangular factor of
   all poses has the same sum of squares in a few rows: thousands of poses cost as much as these.
3. Unobservable frames: of the frames with the same residual, the ones with the smallest tool; and a report
   of each direction that poses do not determine, or only weakly.

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

# [m], weight of a radian where positions do not determine a frame: too small to shift positions.
RADIAN_LENGTH = 0.01

# [m] or [rad] per unit of an unknown, below which it is unobservable: accuracy of four-digit joint angles.
MIN_SENSITIVITY = 1e-4

# Likewise, below which an unknown is weakly observable: of 1 mm of a tool that rotates by a degree, 0.02 mm
# are measured, the repeatability of the best arms.
WEAK_SENSITIVITY = float(np.radians(1.0))

# A later start is better if its residual is below this share of an earlier one by more than ROUNDING: if
# several frames explain few poses equally well, that of the orientations is kept.
BETTER_SHARE = 0.99
ROUNDING = 1e-9  # [m], root mean square residual of rounding

MAX_COORDINATE = 1e15  # [m]; a larger one is an error of its file, and its square would outweigh all others
MAX_STEPS = 100  # of a descent, which takes about ten
ROUGH_REDUCTION = 1e-3  # of the squares in a step: the descents that compare starts end below it
MIN_STEP = 1e-12  # [m] and [rad]: a descent ends below it
MIN_DAMPING = 1e-16  # directions with a sensitivity below its root are not followed: only rounding is left
MIN_SHARE = 0.3  # of an unobservable direction, from which it is named after a part
BASE_WEIGHT = 1e-3  # of a rotation of the base without a tool, relative to the tool, if both are unobservable
PULLS = (*[1.0] * 20, *[0.0] * 3)  # share of the way to the smallest tool; the last steps only fit poses

Part = Literal["tool offset", "tool turn", "base turn"]

_CROSS = np.cross(np.eye(3)[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)  # [e]x of the axes: [e]x v = e x v
_CUBE_ROTATIONS = [
    np.eye(3)[list(order)] * signs
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(np.eye(3)[list(order)] * signs) > 0.0
]


@dataclass(frozen=True, slots=True)
class UnobservableDirection:
    """A direction of the frames that poses do not determine, or only weakly.

    Attributes:
        part: tool offset (equivalent to one of the base), tool turn (equivalent to one of the base) or base
            turn (about the mean of the positions).
        axis: Unit vector of the offset or rotation [-]: of the tool in its frame, of the base in
            the device's.
        sensitivity: How much one metre or radian of it moves positions in [m] or rotates orientations in
            [rad], root mean square. Below `MIN_SENSITIVITY` the frames have the minimum of it.
    """

    part: Part
    axis: tuple[float, float, float]
    sensitivity: float


@dataclass(frozen=True, slots=True, eq=False)
class HandEye:
    """Both frames of M = Z C X.

    Attributes:
        base_rotation: R_Z [-], shape (3, 3).
        base_position: p_Z in [m], shape (3,).
        tool_rotation: R_X [-], shape (3, 3); the identity without measured orientations.
        tool_position: d = p_X in [m], shape (3,).
        unobservable: Unobservable and weakly observable directions.
    """

    base_rotation: FloatArray
    base_position: FloatArray
    tool_rotation: FloatArray
    tool_position: FloatArray
    unobservable: tuple[UnobservableDirection, ...]


def solve_hand_eye(
    position: FloatArray,
    rotation: FloatArray,
    measured: FloatArray,
    measured_rotation: FloatArray | None = None,
) -> HandEye:
    """Return the frames of base and tool that bring computed poses closest to measured ones.

    Args:
        position: p_C, computed positions in [m], shape (n, 3).
        rotation: R_C, computed rotation matrices [-], shape (n, 3, 3).
        measured: p_M, measured positions in [m], shape (n, 3). Rows with a NaN, or a coordinate
            beyond `MAX_COORDINATE`, are ignored; at least one is valid.
        measured_rotation: R_M, measured rotation matrices [-], shape (n, 3, 3), NaN where missing, or
            None.
    """
    is_valid = (np.abs(position) + np.abs(measured) < MAX_COORDINATE).all(axis=1)
    is_valid &= np.isfinite(rotation).all(axis=(1, 2))
    sides = [side[is_valid] for side in (position, rotation, measured)]
    middle, rotation_middle, target = (side.mean(axis=0) for side in sides)
    positions = _Rows(*_condense([side - side.mean(axis=0) for side in sides]))
    rows = _with_orientations(positions, rotation, measured_rotation)
    rigid = fit_rotation(positions.measured.T @ positions.position)[0]  # without a tool
    length = 0.0
    frames = _find_best(positions, length, [*_bases_by_orientations(rows), rigid, *_CUBE_ROTATIONS])
    if len(rows.turn):
        if _sensitivities(positions, frames)[0][0] < WEAK_SENSITIVITY:
            length = RADIAN_LENGTH
            bases = [*_bases_by_orientations(rows), frames.base, *_CUBE_ROTATIONS]
            frames = _find_best(rows, length, bases)
        else:
            frames = _fit_tool_rotation(rows, frames)
    frames = _minimise_unobservable(rows, frames, length)
    shift = target - frames.base @ (middle + rotation_middle @ frames.offset)
    return HandEye(frames.base, shift, frames.tool, frames.offset, tuple(_iter_unobservable(rows, frames)))


def rotation_residual(
    rotation: FloatArray, measured_rotation: FloatArray, base: FloatArray | None = None
) -> float:
    """Return the residual of measured orientations after the best base and tool rotations.

    It identifies the form and unit of orientations in a file: of all candidates, the matrices of the correct
    one have by far the smallest residual. Some forms, such as angles about z, y, z and about z, x, z, differ
    only by a constant base and tool: with the base that positions determine (`solve_hand_eye` without
    measured orientations) these differ as well.

    Args:
        rotation: R_C, computed rotation matrices [-], shape (n, 3, 3).
        measured_rotation: R_M, measured ones [-], shape (n, 3, 3); rows with a NaN are ignored.
        base: R_Z [-], shape (3, 3), if known.

    Returns:
        Root mean square angle in [rad]; NaN without a row.
    """
    is_valid = np.isfinite(rotation + measured_rotation).all(axis=(1, 2))
    computed, measured = rotation[is_valid], measured_rotation[is_valid]
    if not len(computed):
        return float("nan")
    empty = np.zeros((0, 3))
    rows = _with_orientations(_Rows(empty, np.zeros((0, 3, 3)), empty), computed, measured)
    if base is None:
        frames = _find_best(rows, 1.0, [*_bases_by_orientations(rows), *_CUBE_ROTATIONS])
    else:
        frames = _fit_tool_rotation(rows, _Frames(base, np.zeros(3), np.eye(3)))
    chord = np.linalg.norm(measured - frames.base @ computed @ frames.tool, axis=(1, 2))
    angle = 2 * np.arcsin(np.minimum(chord / np.sqrt(8), 1.0))  # |R - R'|^2 = 8 sin^2(angle / 2)
    return float(np.sqrt(np.mean(angle**2)))


class _Rows(NamedTuple):
    """Poses, or the few rows that replace them: positions relative to their mean, and orientations."""

    position: FloatArray
    rotation: FloatArray
    measured: FloatArray
    turn: FloatArray = np.zeros((0, 3, 3))
    measured_turn: FloatArray = np.zeros((0, 3, 3))


class _Frames(NamedTuple):
    """R_Z, d and R_X; of several starts, stacked along a first axis."""

    base: FloatArray
    offset: FloatArray
    tool: FloatArray

    def add_step(self, step: FloatArray) -> _Frames:
        """Return frames after a step: base rotation, offset, and of nine numbers the tool rotation."""
        tool = self.tool @ _to_matrix(step[..., 6:]) if step.shape[-1] > 6 else self.tool
        return _Frames(_to_matrix(step[..., :3]) @ self.base, self.offset + step[..., 3:6], tool)

    def take(self, start: IndexArray | int) -> _Frames:
        """Return the frames of some starts, or of one."""
        return _Frames(self.base[start], self.offset[start], self.tool[start])


def _to_matrix(vector: FloatArray) -> FloatArray:
    """Return the matrices of rotation vectors, shape (..., 3)."""
    matrix = to_matrices(to_quaternions(vector.reshape(-1, 3), "vector"))
    return matrix.reshape(*vector.shape, 3)


def _to_vector(rotation: FloatArray) -> FloatArray:
    """Return the rotation vector of a matrix."""
    quat = to_quaternions(rotation.reshape(1, 9), "matrix")[0]
    imaginary = quat[:3] * (1.0 if quat[3] >= 0.0 else -1.0)
    size = float(np.linalg.norm(imaginary))
    angle = 2 * np.arctan2(size, abs(quat[3]))
    return np.asarray(imaginary * (angle / size if size else 0.0))


def _with_orientations(rows: _Rows, rotation: FloatArray, measured: FloatArray | None) -> _Rows:
    """Return rows with the orientations that both sides have."""
    if measured is None:
        return rows
    is_valid = np.isfinite(rotation + measured).all(axis=(1, 2))
    turn, measured_turn = _condense([rotation[is_valid], measured[is_valid]])
    return rows._replace(turn=turn, measured_turn=measured_turn)


def _condense(sides: Sequence[FloatArray]) -> list[FloatArray]:
    """Return a few rows whose products of two columns sum up to the means of those over all rows."""
    columns = [side.reshape(len(side), prod(side.shape[1:])) for side in sides]
    factor = np.linalg.qr(np.hstack(columns), mode="r") / np.sqrt(max(len(sides[0]), 1))
    parts = np.split(factor, np.cumsum([column.shape[1] for column in columns])[:-1], axis=1)
    return [part.reshape(-1, *side.shape[1:]) for part, side in zip(parts, sides, strict=True)]


def _bases_by_orientations(rows: _Rows) -> Iterator[FloatArray]:
    """Yield the R_Z of orientations: the first left singular vector of K = sum(R_M kron R_C).

    R_M R_X^T R_C^T = R_Z makes K vec(R_X^T) = n vec(R_Z), and K lengthens no other unit vector more.
    """
    if len(rows.turn):
        k = np.einsum("nij,nkl->ikjl", rows.measured_turn, rows.turn).reshape(9, 9)
        first = np.linalg.svd(k)[0][:, 0].reshape(3, 3)
        yield fit_rotation(first * (1.0 if np.linalg.det(first) >= 0.0 else -1.0))[0]


def _fit_tool_rotation(rows: _Rows, frames: _Frames) -> _Frames:
    """Return frames with the R_X of the least sum of squared angles."""
    rotated = frames.base[..., np.newaxis, :, :] @ rows.turn
    crossed = np.einsum("...nji,njk->...ik", rotated, rows.measured_turn)
    return frames._replace(tool=fit_rotation(crossed)[0]) if len(rows.turn) else frames


def _find_best(rows: _Rows, length: float, bases: Iterable[FloatArray]) -> _Frames:
    """Return the frames with the smallest residual of the descents from all R_Z."""
    frames, residuals = _descend(rows, _starts(rows, np.array([*bases])), length, ROUGH_REDUCTION)
    best = 0
    for k, residual in enumerate(residuals):
        if residual < BETTER_SHARE * residuals[best] - ROUNDING:
            best = k
    return _descend(rows, frames.take(np.array([best])), length)[0].take(0)


def _starts(rows: _Rows, bases: FloatArray) -> _Frames:
    """Return the frames with given R_Z, shape (starts, 3, 3); d is linear."""
    count = len(bases)
    without_tool = _Frames(bases, np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)))
    columns = (bases[:, np.newaxis] @ rows.rotation).reshape(count, -1, 3)
    right = (rows.measured - rows.position @ bases.transpose(0, 2, 1)).reshape(count, -1)
    offset = _solve_damped(columns, right, np.full(count, MIN_SENSITIVITY**2))
    return _fit_tool_rotation(rows, without_tool)._replace(offset=offset)


def _descend(
    rows: _Rows, starts: _Frames, length: float, min_reduction: float = 0.0
) -> tuple[_Frames, FloatArray]:
    """Return the frames at the end of a Levenberg-Marquardt descent from each start, and their residuals.

    All starts are computed together; root mean square residuals of shape (starts,).
    """
    frames = starts.take(np.arange(len(starts.base)))
    damping, active = np.full(len(frames.base), 1e-6), np.arange(len(frames.base))
    residual, jacobian = _residuals(rows, frames, length)
    for _ in range(MAX_STEPS):
        step = _solve_damped(jacobian[active], -residual[active], damping[active])
        trial = frames.take(active).add_step(step)
        trial_residual, trial_jacobian = _residuals(rows, trial, length)
        before, after = (np.square(values).sum(axis=1) for values in (residual[active], trial_residual))
        better = after < before
        damping[active] = np.where(
            better, np.maximum(damping[active] / 10, MIN_DAMPING), damping[active] * 10
        )
        accepted = active[better]
        trials = (*trial, trial_residual, trial_jacobian)
        for current, values in zip((*frames, residual, jacobian), trials, strict=True):
            current[accepted] = values[better]
        ends = better & (before - after < min_reduction * before)
        active = active[~ends & (np.linalg.norm(step, axis=1) >= MIN_STEP)]
        if not len(active):
            break
    return frames, np.linalg.norm(residual, axis=1)


def _residuals(rows: _Rows, frames: _Frames, length: float) -> tuple[FloatArray, FloatArray]:
    """Return all residuals in [m] and their Jacobian of a step; |R_M - R|^2 / 2 is the squared angle.

    Shapes (..., residuals) and (..., residuals, 6 or 9), with the first axis of the frames if they have one.
    """
    base, tool = (matrix[..., np.newaxis, :, :] for matrix in (frames.base, frames.tool))
    starts = frames.offset.shape[:-1]
    computed = rows.position + np.einsum("nij,...j->...ni", rows.rotation, frames.offset)
    moved = computed @ frames.base.swapaxes(-1, -2)
    of_base = -np.einsum("kij,...nj->...nik", _CROSS, moved)
    jacobian = np.concatenate((of_base, -base @ rows.rotation), axis=-1).reshape(*starts, -1, 6)
    residual = (rows.measured - moved).reshape(*starts, -1)
    if not len(rows.turn):
        return residual, jacobian
    weight = length / np.sqrt(2.0)
    rotated = base @ rows.turn @ tool
    of_rotation = np.zeros((*starts, rows.turn.size, 9))
    of_rotation[..., :3] = -weight * _flatten(np.einsum("kij,...njl->...nilk", _CROSS, rotated))
    of_rotation[..., 6:] = -weight * _flatten(np.einsum("...nij,kjl->...nilk", rotated, _CROSS))
    of_position = np.concatenate((jacobian, np.zeros((*jacobian.shape[:-1], 3))), axis=-1)
    difference = weight * (rows.measured_turn - rotated).reshape(*starts, -1)
    return (
        np.concatenate((residual, difference), axis=-1),
        np.concatenate((of_position, of_rotation), axis=-2),
    )


def _flatten(changes: FloatArray) -> FloatArray:
    """Return changes of matrices, shape (..., n, 3, 3, k), with one row per entry, shape (..., 9 n, k)."""
    return changes.reshape(*changes.shape[:-4], -1, changes.shape[-1])


def _solve_damped(columns: FloatArray, right: FloatArray, damping: FloatArray) -> FloatArray:
    """Return the x of the least |columns x - right|^2 + damping |x|^2 of several starts, (starts, k)."""
    starts, _, count = columns.shape
    damped = np.sqrt(damping)[:, np.newaxis, np.newaxis] * np.eye(count)
    Q, R = np.linalg.qr(np.concatenate((columns, damped), axis=1))
    extended = np.concatenate((right, np.zeros((starts, count))), axis=1)[:, :, np.newaxis]
    return np.asarray(np.linalg.solve(R, Q.transpose(0, 2, 1) @ extended)[:, :, 0])


def _sensitivities(rows: _Rows, frames: _Frames) -> tuple[FloatArray, FloatArray]:
    """Return the sensitivities to orthogonal steps, the smallest first, and these as columns."""
    jacobian = _residuals(rows, frames, 1.0)[1]
    squares, steps = np.linalg.eigh(jacobian.T @ jacobian)
    return np.sqrt(np.maximum(squares, 0.0)), steps


def _minimise_unobservable(rows: _Rows, frames: _Frames, length: float) -> _Frames:
    """Return the frames with the smallest unobservable parts: without a tool if it is unobservable."""
    for pull in PULLS:
        sensitivity, steps = _sensitivities(rows, frames)
        fitted, free = steps[:, sensitivity >= MIN_SENSITIVITY], steps[:, sensitivity < MIN_SENSITIVITY]
        if not free.shape[1]:
            break
        residual, jacobian = _residuals(rows, frames, length)
        current = np.concatenate(
            (BASE_WEIGHT * _to_vector(frames.base), frames.offset, _to_vector(frames.tool))
        )
        weights = np.array([BASE_WEIGHT] * 3 + [1.0] * 6)[: len(steps), np.newaxis]
        back = free @ np.linalg.lstsq(weights * free, -pull * current[: len(steps)])[0]
        frames = frames.add_step(fitted @ np.linalg.lstsq(jacobian @ fitted, -residual)[0] + back)
    return frames


def _iter_unobservable(rows: _Rows, frames: _Frames) -> Iterator[UnobservableDirection]:
    """Yield the unobservable directions, then the weakly observable ones."""
    jacobian = _residuals(rows, frames, 1.0)[1]
    sensitivity, steps = _sensitivities(rows, frames)
    parts: tuple[tuple[Part, slice], ...] = (
        ("tool offset", slice(3, 6)),
        ("tool turn", slice(6, 9)),  # empty without orientations
        ("base turn", slice(0, 3)),
    )
    is_open = sensitivity < MIN_SENSITIVITY
    for selected in (is_open, ~is_open & (sensitivity < WEAK_SENSITIVITY)):
        rest = steps[:, selected]
        for part, where in parts:
            axes, shares, mixed = np.linalg.svd(rest[where])
            count = int(np.count_nonzero(shares > MIN_SHARE))
            named = rest @ mixed[:count].T / shares[:count]
            for axis, step in zip(axes.T, named.T, strict=False):
                x, y, z = (axis * np.sign(axis[np.argmax(np.abs(axis))])).tolist()
                yield UnobservableDirection(part, (x, y, z), float(np.linalg.norm(jacobian @ step)))
            rest = rest @ mixed[count:].T
