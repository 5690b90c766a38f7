"""Rows of a recorded orientation that a linear resampling left between the two ends of a jump.

One orientation has several spellings: a rotation vector u a is u (a - 2 pi) as well, an Euler angle goes on
from +pi at -pi, and q is -q. Where a log goes from one to the other, its numbers x jump by the length

    T = 2 pi (360 in deg) of a vector or of angles,    T = 2 of a quaternion,

and the orientation hardly changes. A row that was interpolated across it lies on the straight line between,
x = a + s (b - a) with |b - a| = T and 0 < s < 1, and is no orientation of the motion: a vector of nearly no
length, angles half-way, a quaternion shorter than 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import (
    RotationForm,
    conjugate,
    quaternion_product,
    rotation_angle,
    to_quaternions,
)
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.units.proofs import ONE_TURN, mean_turn, peak, spread

MOST_BETWEEN = 8
"""Rows between two samples: a log of 125 Hz resampled to 1 kHz has 7 or 8."""

NEAR = 0.1
"""The way along the rows may differ from T by this share: the ends are samples of a motion near the jump."""

USUAL = 3.0
"""A step is part of a jump if it is so many times the steps beside it, and the usual one: a row nearer to an
end is as good as the end."""

LEAST_ROWS = 5
"""Fewer rows have no usual step."""

CLOSE = 0.03
"""Orientations agree with the kinematics within this median angle in [rad] (1.7 deg)."""

FAR, CLEARLY = 0.17, 5.0
"""Rows contradict them from this angle in [rad] (10 deg), and so many times that of the others."""

LATE = 3.0
"""A controller may record an orientation so many rows late: it is off by as many steps of the arm."""

FEW = 0.1
"""More rows than this share that contradict them are no fault of single rows."""

KIND = "interpolated-orientation"


def without_interpolated(values: FloatArray, names: Sequence[str]) -> tuple[FloatArray, list[LogWarning]]:
    """Return a recorded orientation with NaN in the rows that were interpolated across a jump, and say which.

    Args:
        values: In the file's own units, shape (n, columns).
        names: Of the columns.

    Returns:
        The values in the same units, shape (n, columns), as they are if no row is; and the warning.
    """
    between = interpolated_rows(values)
    count = int(np.count_nonzero(between))
    if not count:
        return values, []
    kept, row = values.copy(), int(np.argmax(between)) + 1
    kept[between] = np.nan
    what = {3: "+180 and -180 deg", 4: "q and -q"}[values.shape[1]]
    rows = f"{format_count(count, 'row')} of {len(values)}"
    said = f"{', '.join(names)} were interpolated between {what} in {rows}, first in this one"
    said = f"{said}: no orientation of the motion; it is not used there"
    return kept, [LogWarning(KIND, said, row)]


def interpolated_rows(values: FloatArray) -> BoolArray:
    """Return which rows of an orientation were interpolated across a jump, shape (n,).

    Args:
        values: In the file's own units, shape (n, 3) of a vector or angles, (n, 4) of a quaternion.
    """
    found = np.zeros(len(values), dtype=bool)
    jump = _jump(values)
    if not jump or len(values) < LEAST_ROWS:
        return found
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
        known = steps[np.isfinite(steps)]
        usual = float(np.median(known)) if len(known) else 0.0
        large = steps > USUAL * usual
        starts = np.flatnonzero(large[:-1] & large[1:])  # a jump has two such steps or more
        for width in range(2, min(MOST_BETWEEN + 1, len(steps)) + 1):
            starts = starts[starts + width <= len(steps)]
            ends = np.linalg.norm(values[starts + width] - values[starts], axis=1)
            for k in np.flatnonzero(np.abs(ends - jump) <= NEAR * jump).tolist():
                first = int(starts[k])
                if _is_straight(steps, first, width, float(ends[k]), usual):
                    found[first + 1 : first + width] = True
    return found


def without_contradicted(
    rotation: FloatArray,
    form: RotationForm | None,
    arm: tuple[Chain, FloatArray] | None,
    names: Sequence[str],
) -> tuple[FloatArray, list[LogWarning]]:
    """Return an orientation with NaN in the few rows that alone contradict the kinematics, and say which.

    What goes in small steps, with a turn of the tool that is the same in all rows, is an orientation of the
    arm; beside large steps there may be rows that are none, however many there are between two samples.

    Args:
        rotation: In [rad] or [-], shape (n, width of the form).
        form: Its form; None if it is not known.
        arm: The robot and the joint values in SI, shape (n, joints); None without one.
        names: Of the columns.

    Returns:
        The orientation in [rad] or [-], shape (n, width of the form); and the warning.
    """
    if form is None or arm is None or len(rotation) < LEAST_ROWS:
        return rotation, []
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.linalg.norm(np.diff(rotation, axis=0), axis=1)
        large = steps > max(USUAL * float(np.nanmedian(steps)), CLOSE)
    beside = np.append(large, False) | np.append(False, large)
    known = np.isfinite(arm[1]).all(axis=1) & np.isfinite(rotation).all(axis=1)
    doubtful, usual = np.flatnonzero(beside & known), np.flatnonzero(known)[spread(int(known.sum()))]
    if not len(doubtful) or not len(usual):
        return rotation, []
    miss, typical = _misses(rotation, form, arm, usual, doubtful)
    off = miss > np.maximum(max(FAR, CLEARLY * typical), LATE * _turned(arm, doubtful))
    count = int(np.count_nonzero(off))
    if typical > CLOSE or not 0 < count <= FEW * len(rotation):
        return rotation, []
    kept, rows = rotation.copy(), doubtful[off]
    kept[rows] = np.nan
    said = f"{', '.join(names)} contradict the kinematics by up to {np.degrees(miss.max()):.0f} deg"
    said = (
        f"{said} in {format_count(count, 'row')} of {len(rotation)}, first in this one, and agree elsewhere"
    )
    said = f"{said}, as where an orientation is interpolated across a jump: it is not used there"
    return kept, [LogWarning(KIND, said, int(rows[0]) + 1)]


def _turned(arm: tuple[Chain, FloatArray], rows: IntArray) -> FloatArray:
    """Return the larger angle by which an arm turns its tip to and from some rows in [rad], shape (k,)."""
    robot, q = arm
    around = np.clip(rows + np.array([[-1], [0], [1]]), 0, len(q) - 1)
    before, here, behind = (
        to_quaternions(poses_over_log(robot, q[at])[1].reshape(-1, 9), "matrix") for at in around
    )
    return np.fmax(rotation_angle(before, here), rotation_angle(here, behind))


def _misses(
    rotation: FloatArray, form: RotationForm, arm: tuple[Chain, FloatArray], usual: IntArray, rows: IntArray
) -> tuple[FloatArray, float]:
    """Return how far some rows are from the kinematics in [rad], shape (k,), and the median of usual rows.

    The tool is turned as it is in most of the usual rows.
    """

    def both(at: IntArray) -> tuple[FloatArray, FloatArray]:
        _, computed = poses_over_log(arm[0], arm[1][at])
        return to_quaternions(computed.reshape(-1, 9), "matrix"), to_quaternions(rotation[at], form)

    def apart(pair: tuple[FloatArray, FloatArray], turn: FloatArray) -> FloatArray:
        relative = quaternion_product(conjugate(pair[0]), pair[1])
        return rotation_angle(np.broadcast_to(turn, relative.shape), relative)

    own = both(usual)
    first = apart(own, mean_turn(*own))
    near = first <= np.median(first)
    turn = mean_turn(own[0][near], own[1][near])
    return apart(both(rows), turn), float(np.median(apart(own, turn)))


def _jump(values: FloatArray) -> float:
    """Return T in the unit of the values; 0 of a form that does not jump."""
    if values.shape[1] == 4:
        return 2.0
    return (360.0 if peak(values) > ONE_TURN else FULL_TURN) if values.shape[1] == 3 else 0.0


def _is_straight(steps: FloatArray, first: int, width: int, length: float, usual: float) -> bool:
    """Return whether all of some steps are parts of one jump of a length, and no step beside them is.

    They lie on a line if they add up to it.
    """
    within = steps[first : first + width]
    beside = [steps[k] for k in (first - 1, first + width) if 0 <= k < len(steps)]
    small = USUAL * max(usual, *beside)
    return bool(within.min() > small and within.sum() <= (1 + NEAR / 2) * length)
