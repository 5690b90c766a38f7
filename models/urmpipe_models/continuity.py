"""Continuity of recorded orientations: the same rotation has many names, and a record jumps between them.

A quaternion q and -q are one rotation, so are a rotation vector v and v (1 + 2 pi k / |v|), and Euler angles
(a, b, c), (a + pi, pi - b, c + pi) - of one axis twice (a + pi, -b, c + pi) - and any turns more. Each
function goes on with the name nearest to the one before, so that values can be interpolated and
differentiated. The first sample keeps its own; a missing one (NaN) is passed over. What they need is that
less than a quarter turn of the axis and half a turn of the angle lie between two samples.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.orientation import RotationForm
from urmpipe_models.repolarizer import FULL_TURN

SMALL_STEP = np.pi / 4.0
"""If no angle steps by more in [rad], no sample needs another name: two angles of the other one are at least
three times as far off."""

OTHER_SIGNS = np.array([1.0, -1.0, 1.0])
"""What the angles are multiplied by in the other name of a rotation."""


def continuous_quaternions(quat_xyzw: FloatArray) -> FloatArray:
    """Return quaternions with the sign that is nearest to the one before.

    Args:
        quat_xyzw: Shape (n, 4) [-]; NaN where a sample is missing.

    Returns:
        Quaternions [-], shape (n, 4).
    """
    return _of_present(quat_xyzw, lambda q: q * _signs(q)[:, np.newaxis])


def continuous_vectors(vectors: FloatArray) -> FloatArray:
    """Return rotation vectors whose angle goes on past pi instead of flipping to the other side.

    The axis keeps the direction that is nearest to the one before, and the angle about it goes on by the
    nearest whole turns: v (1 + 2 pi k / |v|). Without an angle the axis stays what it was.

    Args:
        vectors: Axis times angle in [rad], shape (n, 3); NaN where a sample is missing.

    Returns:
        Axis times angle in [rad], shape (n, 3).
    """
    return _of_present(vectors, _vectors)


def continuous_euler(angles: FloatArray, *, proper: bool = False) -> FloatArray:
    """Return Euler angles of the family, and with the turns, that are nearest to those before.

    Args:
        angles: Three angles about axes in turn in [rad], shape (n, 3); NaN where a sample is missing.
        proper: Whether the first and the last axis are the same, as in Z-Y-Z; else all three differ.

    Returns:
        Angles in [rad], shape (n, 3).
    """
    middle = 0.0 if proper else np.pi
    return _of_present(angles, lambda present: _euler(present, np.array([np.pi, middle, np.pi])))


def continuous_rotations(rotation: FloatArray, form: RotationForm) -> FloatArray:
    """Return recorded orientations in their own form, without jumps between the names of one rotation.

    Args:
        rotation: As recorded, in [rad] or [-], shape (n, width); NaN where a sample is missing.
        form: What its columns are. A matrix is the only name of its rotation and stays.

    Returns:
        In [rad] or [-], shape (n, width).
    """
    if form == "matrix":
        return rotation
    if form in ("quat_xyzw", "quat_wxyz"):
        return continuous_quaternions(rotation)
    if form == "vector":
        return continuous_vectors(rotation)
    return continuous_euler(rotation, proper=form in ("zyz", "zxz"))


def _of_present(values: FloatArray, work: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return a record worked on without its missing samples."""
    present = ~np.isnan(values).any(axis=1)
    if present.all():
        return work(values)
    result = np.full_like(values, np.nan)
    result[present] = work(values[present])
    return result


def _signs(directions: FloatArray) -> FloatArray:
    """Return the sign, 1 or -1, with which each direction is nearest to the one before; 1 for the first."""
    along = np.einsum("ij,ij->i", directions[1:], directions[:-1])
    return np.cumprod(np.append(1.0, np.where(along < 0.0, -1.0, 1.0)))[: len(directions)]


def _nearest_turns(angles: FloatArray) -> FloatArray:
    """Return the whole turns to add so that no step is above half a turn, shape as the angles', (n, ...)."""
    turns = np.zeros_like(angles)
    turns[1:] = -np.cumsum(np.rint(np.diff(angles, axis=0) / FULL_TURN), axis=0)
    return turns


def _vectors(v: FloatArray) -> FloatArray:
    """Return rotation vectors in [rad], shape (n, 3), each of its names the nearest to the one before."""
    largest = np.abs(v).max(axis=1)
    turning = np.flatnonzero(largest > 0.0)
    if not len(turning):
        return v
    known = np.maximum.accumulate(np.where(largest > 0.0, np.arange(len(v)), turning[0]))
    along = v[known] / largest[known, np.newaxis]  # squares of tiny components are no numbers any more
    lengths = np.linalg.norm(along, axis=1)
    axis, angle = along / lengths[:, np.newaxis], largest * lengths
    signs = _signs(axis)
    turns = _nearest_turns(signs * angle)
    return np.asarray(v + axis * (signs * turns * FULL_TURN)[:, np.newaxis])


def _euler(angles: FloatArray, apart: FloatArray) -> FloatArray:
    """Return Euler angles in [rad], shape (n, 3), of both families the one nearest to the sample before.

    Between two samples that step little, neither the family nor the turns change.
    """
    steps = (np.abs(np.diff(column)) > SMALL_STEP for column in angles.T)  # column by column: little memory
    steep = np.flatnonzero(np.logical_or.reduce([*steps])) + 1
    if not len(steep):
        return angles + 0.0
    before, after = angles[steep - 1], angles[steep]
    own, across = (_distance(one, before) for one in (after, _other(after, apart)))
    lengths = np.diff(steep, prepend=0, append=len(angles))
    swapped = np.append(False, np.cumsum(across < own) % 2 == 1)
    swaps = np.repeat(swapped, lengths)
    result = angles.copy()
    for column, sign, half in zip(result.T, OTHER_SIGNS, apart, strict=True):
        if swapped.any():
            column[swaps] = column[swaps] * sign + half
        turns = np.cumsum(np.rint((column[steep] - column[steep - 1]) / FULL_TURN))
        column[:] -= np.repeat(FULL_TURN * np.append(0.0, turns), lengths)
    return result


def _other(angles: FloatArray, apart: FloatArray) -> FloatArray:
    """Return the other Euler angles in [rad] of the same rotations, shape (n, 3)."""
    return np.asarray(angles * OTHER_SIGNS + apart)


def _distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the squared distance of angles, whole turns apart counted as none, shape (n,)."""
    step = a - b
    step = step - FULL_TURN * np.rint(step / FULL_TURN)
    return np.asarray(np.einsum("ij,ij->i", step, step))
