"""Rows of a recorded orientation that a linear resampling left between the two ends of a jump.

One orientation has several spellings: a rotation vector u a is u (a - 2 pi) as well, an Euler angle goes on
from +pi at -pi, and q is -q. Where a log goes from one to the other, its numbers x jump by the length

    T = 2 pi (360 in deg) of a vector or of angles,    T = 2 of a quaternion,

and the orientation hardly changes. A row that was interpolated across it lies on the straight line between,
x = a + s (b - a) with |b - a| = T and 0 < s < 1, and is no orientation of the motion: a vector of nearly no
length, angles half-way, a quaternion shorter than 1.

The recorded orientation: its form and unit, by names, the arm's kinematics or the values.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import (
    FORMS,
    RotationForm,
    column_count,
    conjugate,
    is_angular,
    quaternion_product,
    rotation_angle,
    to_quaternions,
)
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.columns import OTHER_UNIT, Column, unit_hints
from urmpipe_pipeline.logs.proofs import (
    MARGIN,
    ONE_TURN,
    TWO_TURNS,
    count_wraps,
    mean_turn,
    peak,
    rotation_distances,
    spread,
    usual_peak,
)
from urmpipe_pipeline.logs.units import GIVEN, StatedUnit, doubt_warning
from urmpipe_pipeline.logs.vocabulary import Unit, vocabulary

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


PURE = Unit("1", "ratio", 1.0)
"""The unit of quaternions and of matrices."""

CLOSE_ROTATION = 0.03
"""Median angle in [rad] (1.7 deg) within which orientations agree with the kinematics, `MARGIN` times better
than in any other form."""

UNIT_LENGTH = 0.02
"""The length of a quaternion may differ from 1 by this: they are printed with two digits or more."""

BY_COLUMNS = (0, 3, 6, 1, 4, 7, 2, 5, 8)
"""The entries of a matrix that is written column by column, in the order of its rows."""


@dataclass(frozen=True, slots=True)
class Choice:
    """What the columns of an orientation may be.

    Attributes:
        form: Their form.
        units: The unit of each.
        by_columns: Whether they are those of a matrix column by column.
    """

    form: RotationForm
    units: tuple[Unit, ...]
    by_columns: bool = False

    @property
    def order(self) -> tuple[int, ...]:
        """The places of the columns in the order of the form."""
        return BY_COLUMNS if self.by_columns else tuple(range(len(self.units)))

    def quaternions(self, values: FloatArray) -> FloatArray:
        """Return values of the columns, shape (n, columns), as unit quaternions x, y, z, w [-]."""
        return to_quaternions((values * [unit.factor for unit in self.units])[:, self.order], self.form)

    def __str__(self) -> str:
        if is_angular(self.form):
            return f"{self.form} in {self.units[0].name}"
        return f"{self.form} by columns" if self.by_columns else self.form


@dataclass(frozen=True, slots=True)
class Settled:
    """What a recorded orientation is.

    Attributes:
        form: Its form; None if nothing shows it, and then it is not used.
        units: The unit of each column.
        order: The places of the columns in the order of the form.
        inferences: Form and unit with their evidence.
        warnings: What is assumed or contradicted.
        doubt: Why its unit is only assumed; empty where it is given or proved.
    """

    form: RotationForm | None = None
    units: tuple[Unit, ...] = ()
    order: tuple[int, ...] = ()
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()
    doubt: str = ""


def settle_rotation(
    columns: Sequence[Column],
    forms: Sequence[RotationForm],
    values: FloatArray,
    stated: Sequence[StatedUnit | None],
    arm: tuple[Chain, FloatArray] | None,
    base: FloatArray | None = None,
    *,
    form_given: bool = False,
) -> Settled:
    """Return form and units of the columns of a recorded orientation.

    Where the arm's kinematics agree in another form or unit than those that are stated, they decide, unless
    the user gave them. Without, a unit is compared with wraps and size of the values.

    Args:
        columns: The columns.
        forms: The forms that their names allow, or the one that the user gave.
        values: Their values in the file's own units, shape (n, columns).
        stated: The stated unit of each column, if there is one.
        arm: The robot and the joint values in SI, shape (n, joints); None without a robot.
        base: Rotation from the recorded frame to the robot's [-], shape (3, 3); None for the same frame.
        form_given: Whether the user gave the form.
    """
    if not columns or np.isnan(values).any(axis=1).all():
        return Settled()
    names = ", ".join(column.name for column in columns)
    sound = [form for form in forms if _is_sound(values, form)]
    if not sound:
        return Settled(warnings=(_length_warning(names, np.linalg.norm(values, axis=1)),))
    choices = [Choice(form, units) for form in sound for units in _possible_units(form, stated)]
    if arm is not None:
        others = _others(choices, [form for form in FORMS if column_count(form) == len(columns)])
        every = [c for c in dict.fromkeys((*choices, *others)) if _is_sound(values, c.form)]
        found = _by_kinematics(every, choices, values, arm, base)
        if found is not None and found.proved:
            given = any(item and item.is_given for item in stated)
            return _settled_by_kinematics(columns, choices, found, unit_given=given, form_given=form_given)
        choices = [found.choice] if found else choices
    if len({choice.form for choice in choices}) > 1:
        message = f"{names} may be of several forms: the recorded orientation is not used"
        hints = tuple(Hint("rotation", form, "specifies it") for form in sound)
        return Settled(warnings=(LogWarning("orientation", message, hints=hints),))
    by = [item for item in stated if item and item.by != "urmpipe"]
    if len(choices) > 1:
        return _without_unit(columns, choices, values)
    return _with_unit(columns, choices[0], values, by)


def form_inference(names: Sequence[str], form: RotationForm, unit: Unit, evidence: str) -> Inference:
    """Return what is said of the form of an orientation: of columns with some names, in a unit, and why."""
    what, shown = f"form of {', '.join(names)}", f"{form}{'' if unit == PURE else f' in {unit.name}'}"
    return Inference(what, shown, evidence, "form", tuple(names), (Hint("rotation"),))


def _is_sound(values: FloatArray, form: RotationForm) -> bool:
    """Return whether values can be of a form: quaternions have length 1."""
    if not form.startswith("quat"):
        return True
    length = np.linalg.norm(values, axis=1)
    return bool(np.nanmax(np.abs(length - 1.0)) <= UNIT_LENGTH)


def _length_warning(names: str, length: FloatArray) -> LogWarning:
    """Return what is said of quaternions that are none, by their lengths; with the first row if few are."""
    off = np.abs(length - 1.0) > UNIT_LENGTH
    count, row = int(np.count_nonzero(off)), int(np.argmax(off))
    few = 2 * count < len(off)
    typical = length[row] if few else np.nanmedian(length)
    where = f" in {format_count(count, 'row')} of {len(off)}, first in this one" if few else ""
    said = f"{names} hold quaternions of length {typical:.4g}{where}, allowed: 1; they are not used"
    return LogWarning("orientation", said, row + 1 if few else None)


def _possible_units(form: RotationForm, stated: Sequence[StatedUnit | None]) -> list[tuple[Unit, ...]]:
    """Return the units that the columns may have: stated, or rad or deg."""
    if not is_angular(form):
        return [(PURE,) * len(stated)]
    known = [item.unit for item in stated if item is not None]
    if known:
        return [tuple(item.unit if item else known[0] for item in stated)]
    return [(vocabulary().units[name],) * len(stated) for name in ("rad", "deg")]


def _others(choices: Sequence[Choice], forms: Sequence[RotationForm]) -> Iterator[Choice]:
    """Yield what the columns may be against their names: other forms, units and orders of a matrix."""
    for form in forms:
        if is_angular(form):
            yield Choice(form, choices[0].units)
            yield from (
                Choice(form, units) for units in _possible_units(form, [None] * len(choices[0].units))
            )
        else:
            yield Choice(form, (PURE,) * len(choices[0].units))
            if form == "matrix":
                yield Choice(form, (PURE,) * len(choices[0].units), by_columns=True)


def _settled(
    columns: Sequence[Column], choice: Choice, evidence: str, *warnings: LogWarning, given: bool = False
) -> Settled:
    inference = form_inference([column.name for column in columns], choice.form, choice.units[0], evidence)
    doubt = next((warning.message for warning in warnings if warning.assumption and not given), "")
    return Settled(choice.form, choice.units, choice.order, (inference,), warnings, doubt)


class _Found(NamedTuple):
    """The choice with which the kinematics agree, the nearest stated choice, and the evidence."""

    choice: Choice
    stated: Choice
    evidence: str
    proved: bool


def _settled_by_kinematics(
    columns: Sequence[Column], stated: Sequence[Choice], found: _Found, *, unit_given: bool, form_given: bool
) -> Settled:
    """Return what the kinematics prove, or what the user gave, with a warning if they differ."""
    best, first = found.choice, found.stated if unit_given or form_given else stated[0]
    if best in stated:
        return _settled(columns, best, found.evidence)
    is_same_form = any((choice.form, choice.by_columns) == (best.form, best.by_columns) for choice in stated)
    if best.by_columns:
        was, now = "matrix by rows", "matrix by columns"
    elif is_same_form:
        was, now = first.units[0].name, best.units[0].name
    else:
        was, now = str(first), str(best)
    names = ", ".join(column.name for column in columns)
    message = f"{names}: {was} contradicts the kinematics: taken as"
    if unit_given if is_same_form else form_given:
        message = f"{message} {was}, though as {now} it would fit: {found.evidence}"
        hints = unit_hints(columns, now) if is_same_form else (Hint("rotation", best.form, "overrides this"),)
        taken = f"the orientation is {'in ' if is_same_form else ''}{was}"
        warning = LogWarning("unit-contradiction", message, hints=hints, assumption=taken, role="rotation")
        return _settled(columns, first, GIVEN, warning, given=True)
    hints = unit_hints(columns, was) if is_same_form else (Hint("rotation", first.form, "overrides this"),)
    if best.by_columns:
        hints = (Hint("rotation", "matrix", "reads it by rows"),)
    warning = LogWarning("unit-contradiction", f"{message} {now}: {found.evidence}", hints=hints)
    return _settled(columns, best, found.evidence, warning)


def _by_kinematics(
    every: Sequence[Choice],
    stated: Sequence[Choice],
    values: FloatArray,
    arm: tuple[Chain, FloatArray],
    base: FloatArray | None,
) -> _Found | None:
    """Return the choice with which the kinematics agree; None if none stands out.

    As they are, else with a turned tool, else with a turned base as well. Of several that agree it is the
    only stated one.
    """
    robot, q = arm
    rows = spread(len(q))
    q, values = q[rows], values[rows]
    known = np.isfinite(q).all(axis=1) & np.isfinite((values**2).sum(axis=1))  # huge ones have no direction
    if not known.any() or len(every) < 2:
        return None
    rotation = poses_over_log(robot, q[known])[1]
    rotation = rotation if base is None else base.T @ rotation
    computed = to_quaternions(rotation.reshape(-1, 9), "matrix")
    each = [rotation_distances(computed, choice.quaternions(values[known])) for choice in every]
    for distances in np.array(each).T:
        best = distances.min()
        worse = (distances >= MARGIN * best) & (distances >= best + CLOSE_ROTATION)
        rivals = [choice for choice, excluded in zip(every, worse, strict=True) if not excluded]
        chosen = [choice for choice in rivals if choice in stated] or rivals
        if best <= CLOSE_ROTATION and worse.any() and len(chosen) == 1:
            own = every.index(chosen[0])
            beaten = range(len(stated)) if chosen[0] not in stated else np.flatnonzero(worse).tolist()
            second = min(beaten, key=distances.__getitem__)  # every choice begins with the stated ones
            evidence = f"with it the arm's orientation agrees within {np.degrees(distances[own]):.2f} deg"
            evidence += f", as {every[second]} within {np.degrees(distances[second]):.2f} deg"
            nearest = every[min(range(len(stated)), key=distances.__getitem__)]
            proved = all(choice.units == chosen[0].units for choice in rivals)
            return _Found(chosen[0], nearest, evidence, proved)
    return None


def _without_unit(columns: Sequence[Column], choices: Sequence[Choice], values: FloatArray) -> Settled:
    """Return angles of one form, in rad or in deg by their wraps or size, or in rad as nothing tells.

    A controller writes no orientation of two turns. Values are in the file's own units, shape (n, 3).
    """
    rad, deg = choices
    size = usual_peak(values)
    wrapped, why = _unit_by_wraps(values, rad.form) or ("", f"values of {size:.6g}")
    choice = deg if wrapped == "deg" or (not wrapped and size > ONE_TURN) else rad
    if wrapped or size > TWO_TURNS:
        return _settled(columns, choice, why)
    unit, names = choice.units[0].name, ", ".join(column.name for column in columns)
    said = f"no unit is given for {names}: they are taken as {unit}"
    hints, taken = unit_hints(columns, OTHER_UNIT[unit]), f"the orientation is in {unit}"
    warning = LogWarning("assumed-unit", said, hints=hints, assumption=taken, role="rotation")
    return _settled(columns, choice, "their names", warning)


def _with_unit(
    columns: Sequence[Column], choice: Choice, values: FloatArray, by: Sequence[StatedUnit]
) -> Settled:
    """Return columns in their stated unit, doubted where wraps or size of angles contradict it.

    No verdict rests on one that they exclude, unless the user gave it. Values are in the file's own units,
    shape (n, columns).
    """
    unit, size = choice.units[0].name, usual_peak(values)
    wrapped, why = _unit_by_wraps(values, choice.form) or ("", "")
    is_large = size > ONE_TURN
    is_likely = wrapped == unit if wrapped else is_large == (unit == "deg")
    is_likely |= not wrapped and any(item.is_confirmed for item in by)
    if not by or is_likely or not peak(values) > 0:
        return _settled(columns, choice, "their names")
    if not wrapped:
        why = f"values of {size:.6g} {'are more than a turn as rad' if is_large else 'may be rad as well'}"
    warning = doubt_warning(columns, by, unit, why, "the orientation is", "rotation")
    given = by[0].is_given
    warning = replace(warning, blocks_verdict=not given and (bool(wrapped) or size > TWO_TURNS))
    return _settled(columns, choice, "their names", warning, given=given)


def _unit_by_wraps(values: FloatArray, form: RotationForm) -> tuple[str, str] | None:
    """Return the unit of which angles step by whole turns, and how often; a vector flips by one in length."""
    known = values[np.isfinite(values).all(axis=1)]
    if form == "vector":
        lengths = np.linalg.norm(np.diff(known, axis=0), axis=1)
        known = np.concatenate(([0.0], np.cumsum(lengths)))[:, np.newaxis]
    likely, turn = ("deg", "360") if peak(values) > ONE_TURN else ("rad", "6.28")
    count = int(count_wraps(known, likely).sum())
    return (
        (likely, f"{format_count(count, 'step')} of about {turn} from one row to the next") if count else None
    )
