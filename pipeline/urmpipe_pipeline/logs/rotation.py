"""The recorded orientation of the tool: its form and unit, and rows that hold no orientation of the motion.

1. Rows without an orientation become NaN: quaternions of another length than 1, matrices without R R^T = I;
   rows between the ends of a jump (`find_interpolated_rows`). One orientation has several spellings: a
   rotation vector u a is u (a - 2 pi) as well, an Euler angle continues from +pi at -pi, and q is -q. Where
   a log goes from one to the other, its numbers x jump by the length T, 2 pi (360 in deg) of a vector or
   of angles, 2 of a quaternion, and the orientation nearly stays. A linear resampling puts rows on the
   straight line between, x = a + s (b - a) with |b - a| = T and 0 < s < 1. Where an arm is known to turn
   there, it is no jump.
2. Form and unit (`settle_rotation`): the names allow some choices. With an arm the one counts that turns
   as it does, `MARGIN` times nearer than the others (`proofs.rotation_distances`). Else wraps prove a
   unit, and size is a reason to assume it; several forms are not read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import (
    FORMS,
    RotationForm,
    column_count,
    is_angular,
    to_quaternions,
)
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import Basis, Inference, LogWarning
from urmpipe_pipeline.logs.columns import OTHER_UNIT, Column, unit_hints
from urmpipe_pipeline.logs.pose_columns import holds_orientation
from urmpipe_pipeline.logs.proofs import (
    MARGIN,
    ONE_TURN,
    TWO_TURNS,
    format_wraps,
    peak,
    rotation_distances,
    spread,
    usual_peak,
)
from urmpipe_pipeline.logs.units import (
    ASSUMED_UNIT,
    GIVEN,
    UNIT_CONTRADICTION,
    StatedUnit,
    UnitFinder,
)
from urmpipe_pipeline.logs.vocabulary import Unit, vocabulary

ORIENTATION = "orientation"  # of several forms, or no quaternions: not used
INTERPOLATED = "interpolated-orientation"  # rows that hold no orientation of the motion

MIN_ROWS = 5  # fewer have no usual step
MAX_BETWEEN = 24  # rows between two samples: a log of 50 Hz resampled to 1 kHz has 19 or 20
MAX_JUMP_DEVIATION = 0.1  # share of T: the ends of a jump are samples of a motion near it
MIN_STEP_RATIO = (
    3.0  # a step of a jump over those next to it and the usual one; nearer rows are as good as the end
)
MAX_ANGLE = 0.03  # [rad] (1.7 deg), median within which orientations agree with the arm
MIN_TURN_BETWEEN = 1.0  # [rad], of an arm within a jump; from one sample to the next it turns less

Arm: TypeAlias = tuple[Chain, FloatArray]  # robot, and its joint values in SI, shape (n, joints)

PURE = Unit("1", "ratio", 1.0)  # of quaternions and matrices
BY_COLUMNS = (0, 3, 6, 1, 4, 7, 2, 5, 8)  # entries of a matrix that is written column by column


def find_interpolated_rows(values: FloatArray, arm: Arm | None = None) -> BoolArray:
    """Return which rows of an orientation were interpolated across a jump, shape (n,).

    All steps of a jump are larger than those around it, and add up to its length: they lie on a line.

    Args:
        values: In the file's own units, shape (n, 3) of a vector or angles, (n, 4) of a quaternion.
        arm: The robot and its joint values, if there is one: it turns where the tool does.
    """
    is_between = np.zeros(len(values), dtype=bool)
    turn = 360.0 if peak(values) > ONE_TURN else FULL_TURN
    jump = {3: turn, 4: 2.0}.get(values.shape[1])
    if jump is None or len(values) < MIN_ROWS:
        return is_between
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
        known = steps[np.isfinite(steps)]
        usual = float(np.median(known)) if len(known) else 0.0
        is_large = steps > MIN_STEP_RATIO * usual
        starts = np.flatnonzero(is_large[:-1] & is_large[1:])  # a jump has two such steps or more
        for width in range(2, min(MAX_BETWEEN + 1, len(steps)) + 1):
            starts = starts[starts + width <= len(steps)]
            lengths = np.linalg.norm(values[starts + width] - values[starts], axis=1)
            for k in np.flatnonzero(np.abs(lengths - jump) <= MAX_JUMP_DEVIATION * jump).tolist():
                first, last = int(starts[k]), int(starts[k]) + width
                within = steps[first:last]
                around = [float(steps[i]) for i in (first - 1, last) if 0 <= i < len(steps)]
                is_straight = within.sum() <= (1 + MAX_JUMP_DEVIATION / 2) * lengths[k]
                is_large_step = within.min() > MIN_STEP_RATIO * max(usual, *around)
                if is_straight and is_large_step and not (arm and _turns_between(*arm, first, last)):
                    is_between[first + 1 : last] = True
    return is_between


def _turns_between(robot: Chain, q: FloatArray, first: int, last: int) -> bool:
    """Return whether an arm turns away from the orientation of two rows between them."""
    rotation = poses_over_log(robot, q[[first, (first + last) // 2]])[1]
    cosine = (np.trace(rotation[0].T @ rotation[1]) - 1) / 2
    return bool(cosine < np.cos(MIN_TURN_BETWEEN))


@dataclass(frozen=True, slots=True)
class Choice:
    """What the columns of an orientation may be: form and units; a matrix also column by column."""

    form: RotationForm
    units: tuple[Unit, ...]
    by_columns: bool = False

    @property
    def order(self) -> tuple[int, ...]:
        """The places of the columns in the order of the form."""
        return BY_COLUMNS if self.by_columns else tuple(range(len(self.units)))

    def in_si(self, values: FloatArray) -> FloatArray:
        """Return values of the columns, shape (n, columns), in [rad] or [-] and in the order of the form."""
        return (values * [unit.factor for unit in self.units])[:, self.order]

    def __str__(self) -> str:
        if is_angular(self.form):
            return f"{self.form} in {self.units[0].name}"
        return f"{self.form} by columns" if self.by_columns else self.form


class Orientation(NamedTuple):
    """A recorded orientation.

    Attributes:
        form: Its form; None if nothing shows it, and then it is not used.
        columns: The columns in the order of the form.
        units: The unit of each.
        values: In [rad] or [-], shape (n, columns); NaN in rows without an orientation.
    """

    form: RotationForm | None = None
    columns: tuple[Column, ...] = ()
    units: tuple[Unit, ...] = ()
    values: FloatArray = np.empty((0, 0))


class _Decision(NamedTuple):
    """The choice, and how and why it is known."""

    choice: Choice
    why: str
    basis: Basis = "named"


def settle_rotation(
    finder: UnitFinder,
    columns: Sequence[Column],
    forms: Sequence[RotationForm],
    values: FloatArray,
    arm: Arm | None,
    *,
    form_given: bool = False,
) -> Orientation:
    """Return a recorded orientation in SI; the finder keeps the evidence of its form and unit, and warnings.

    Where the arm's kinematics agree in another form or unit than those that are stated, they decide, unless
    the user gave them.

    Args:
        finder: The units of joints and positions, which are settled before.
        columns: The columns.
        forms: The forms that their names allow, or the one that the user gave.
        values: Their values in the file's own units, shape (n, columns).
        arm: The robot and the joint values in SI, shape (n, joints); None without a robot.
        form_given: Whether the user gave the form.
    """
    if not columns:
        return Orientation()
    names, stated = [column.name for column in columns], finder.sources.of_rotation(columns, forms)
    values, warnings = _without_odd_rows(", ".join(names), values, arm)
    finder.warnings += warnings
    if np.isnan(values).any(axis=1).all():
        return Orientation()
    choices = [Choice(form, units) for form in forms for units in _possible_units(form, stated)]
    decision = None
    if arm is not None:
        fit = _fit_arm(choices, values, arm, finder.kinematic.base if finder.kinematic else np.eye(3))
        if fit is not None and fit.is_proof:
            unit_given = any(item and item.by == "user" for item in stated)
            decision = _decide_by_arm(
                finder, columns, choices, fit, unit_given=unit_given, form_given=form_given
            )
        elif fit is not None:
            choices = [fit.choice]
    if decision is None and len({choice.form for choice in choices}) > 1:
        message = f"{', '.join(names)} may be of several forms: the recorded orientation is not used"
        hints = tuple(Hint("rotation", form, "specifies it") for form in forms)
        finder.warnings.append(LogWarning(ORIENTATION, message, hints=hints))
        return Orientation()
    choice, why, basis = decision or _decide_by_values(finder, columns, choices, values, stated)
    finder.noted.append(form_inference(names, choice.form, choice.units[0], why, basis))
    finder.warn_not_reached(columns, stated, choice.units, "rotation")
    ordered = tuple(columns[k] for k in choice.order)
    return Orientation(choice.form, ordered, choice.units, choice.in_si(values))


def form_inference(
    names: Sequence[str], form: RotationForm, unit: Unit, evidence: str, basis: Basis = "named"
) -> Inference:
    """Return the inference of the form of an orientation: of columns with some names, in a unit, and why."""
    what, shown = f"form of {', '.join(names)}", f"{form}{'' if unit == PURE else f' in {unit.name}'}"
    return Inference(what, shown, evidence, "form", tuple(names), (Hint("rotation"),), basis)


def _without_odd_rows(names: str, values: FloatArray, arm: Arm | None) -> tuple[FloatArray, list[LogWarning]]:
    """Return the values with NaN in rows without an orientation, in all if these are most, and warnings."""
    is_known, is_between = np.isfinite(values).all(axis=1), find_interpolated_rows(values, arm)
    is_odd = is_known & ~is_between & ~holds_orientation(values)
    is_useless, warnings = 2 * np.count_nonzero(is_odd) > np.count_nonzero(is_known), []

    def where(rows: BoolArray) -> str:
        return f"in {format_count(int(np.count_nonzero(rows)), 'row')} of {len(values)}, first in this one"

    if is_between.any():
        ends = "+180 and -180 deg" if values.shape[1] == 3 else "q and -q"
        message = f"{names} were interpolated between {ends} {where(is_between)}"
        message += ": no orientation of the motion; it is not used there"
        warnings.append(LogWarning(INTERPOLATED, message, int(np.argmax(is_between)) + 1))
    if is_odd.any():
        row, law = int(np.argmax(is_odd)), "matrices have R R^T = I and det R = 1"
        if values.shape[1] == 4:
            law = f"quaternions have length 1, not {np.linalg.norm(values[row]):.3g}"
        message = f"{names} hold no orientation {where(is_odd)}: {law}; it is not used"
        warnings.append(LogWarning(ORIENTATION, message if is_useless else f"{message} there", row + 1))
    is_wrong = is_between | is_odd | is_useless
    return np.where(is_wrong[:, np.newaxis], np.nan, values) if is_wrong.any() else values, warnings


def _possible_units(form: RotationForm, stated: Sequence[StatedUnit | None]) -> list[tuple[Unit, ...]]:
    if not is_angular(form):
        return [(PURE,) * len(stated)]
    known = [item.unit for item in stated if item is not None]
    if known:
        return [tuple(item.unit if item else known[0] for item in stated)]
    return [(vocabulary().units[name],) * len(stated) for name in ("rad", "deg")]


def _other_choices(units: tuple[Unit, ...]) -> Iterator[Choice]:
    """Yield what columns with some units may be against their names: all forms, units, orders of a matrix."""
    for form in FORMS:
        if column_count(form) != len(units):
            continue
        if is_angular(form):
            yield Choice(form, units)
        yield from (Choice(form, other) for other in _possible_units(form, [None] * len(units)))
        if form == "matrix":
            yield Choice(form, (PURE,) * len(units), by_columns=True)


class _ArmFit(NamedTuple):
    """The choice that agrees with an arm, the nearest stated one, why, and whether it proves the unit."""

    choice: Choice
    stated: Choice
    evidence: str
    is_proof: bool


def _fit_arm(stated: Sequence[Choice], values: FloatArray, arm: Arm, base: FloatArray) -> _ArmFit | None:
    """Return the choice with which the arm agrees; None if none stands out.

    As it is, else with a turned tool, else with a turned base as well. Of several that agree it is the only
    stated one. The base is the rotation from the recorded frame to the robot's [-], shape (3, 3).
    """
    (robot, q), rows = arm, spread(len(values))
    every = list(dict.fromkeys((*stated, *_other_choices(stated[0].units))))
    q, values = q[rows], values[rows]
    known = np.isfinite(q).all(axis=1) & np.isfinite((values**2).sum(axis=1))  # huge ones have no direction
    if not known.any() or len(every) < 2:
        return None
    rotation = base.T @ poses_over_log(robot, q[known])[1]
    computed = to_quaternions(rotation.reshape(-1, 9), "matrix")
    recorded = [to_quaternions(choice.in_si(values[known]), choice.form) for choice in every]
    for distances in np.array([rotation_distances(computed, quat) for quat in recorded]).T:
        best = distances.min()
        is_worse = (distances >= MARGIN * best) & (distances >= best + MAX_ANGLE)
        rivals = [choice for choice, excluded in zip(every, is_worse, strict=True) if not excluded]
        chosen = [choice for choice in rivals if choice in stated] or rivals
        if best <= MAX_ANGLE and is_worse.any() and len(chosen) == 1:
            (choice,) = chosen
            beaten = np.flatnonzero(is_worse).tolist() if choice in stated else range(len(stated))
            second = min(beaten, key=distances.__getitem__)
            evidence = "with it the arm's orientation agrees within"
            evidence += f" {np.degrees(distances[every.index(choice)]):.2f} deg"
            evidence += f", as {every[second]} within {np.degrees(distances[second]):.2f} deg"
            nearest = every[min(range(len(stated)), key=distances.__getitem__)]
            return _ArmFit(choice, nearest, evidence, all(rival.units == choice.units for rival in rivals))
    return None


def _decide_by_arm(
    finder: UnitFinder,
    columns: Sequence[Column],
    stated: Sequence[Choice],
    fit: _ArmFit,
    *,
    unit_given: bool,
    form_given: bool,
) -> _Decision:
    """Return what the arm proves, or what the user gave, with a warning if they differ."""
    best, first = fit.choice, fit.stated if unit_given or form_given else stated[0]
    if best in stated:
        return _Decision(best, fit.evidence, "proved")
    is_same_form = best.form in {choice.form for choice in stated} and not best.by_columns
    by_user = unit_given if is_same_form else form_given
    other = best if by_user else first
    hints = unit_hints(columns, other.units[0].name)
    hints = hints if is_same_form else (Hint("rotation", other.form, "overrides this"),)
    names = ", ".join(column.name for column in columns)
    message = f"{names}: {first} contradicts the kinematics: taken as"
    if by_user:
        message, taken = f"{message} {first}, though as {best} it would fit", f"the orientation is {first}"
        message += f": {fit.evidence}"
        warning = LogWarning(UNIT_CONTRADICTION, message, hints=hints, assumption=taken, role="rotation")
        finder.warn(columns, warning, by_user=True)
        return _Decision(first, GIVEN, "given")
    message = f"{message} {best}: {fit.evidence}"
    finder.warnings.append(LogWarning(UNIT_CONTRADICTION, message, hints=hints))
    return _Decision(best, fit.evidence, "proved")


def _decide_by_values(
    finder: UnitFinder,
    columns: Sequence[Column],
    choices: Sequence[Choice],
    values: FloatArray,
    stated: Sequence[StatedUnit | None],
) -> _Decision:
    """Return one form in its stated unit, with a warning if wraps or size contradict it, or by these.

    A controller writes no orientation of two turns.
    """
    choice, why = choices[0], "their names"
    by = [item for item in stated if item and item.by != "urmpipe"]
    if len(choices) == 1 and not by:
        return _Decision(choice, why)
    size = usual_peak(values)
    is_large, wrapped = size > ONE_TURN, _unit_by_wraps(values, choice.form)
    likely = wrapped[0] if wrapped else "deg" if is_large else "rad"
    if len(choices) > 1:  # in rad and in deg
        choice = choices[likely == "deg"]
        if wrapped or size > TWO_TURNS:
            return _Decision(choice, wrapped[1] if wrapped else f"values of {size:.6g}", "proved")
        names = ", ".join(column.name for column in columns)
        message = f"no unit is given for {names}: they are taken as {likely}"
        hints, assumption = unit_hints(columns, OTHER_UNIT[likely]), f"the orientation is in {likely}"
        warning = LogWarning(ASSUMED_UNIT, message, hints=hints, assumption=assumption, role="rotation")
        finder.warn(columns, warning)
        return _Decision(choice, why)
    unit = choice.units[0].name
    is_confirmed = not wrapped and any(item.is_confirmed for item in by)
    if likely == unit or is_confirmed or not peak(values) > 0:
        return _Decision(choice, why)
    reason = f"values of {size:.6g} {'are more than a turn as rad' if is_large else 'may be rad as well'}"
    is_excluded = bool(wrapped) or size > TWO_TURNS
    reason = wrapped[1] if wrapped else reason
    finder.warn_uncertain(columns, by, unit, reason, "rotation", is_excluded=is_excluded)
    return _Decision(choice, why, "given" if by[0].by == "user" else "named")


def _unit_by_wraps(values: FloatArray, form: RotationForm) -> tuple[str, str] | None:
    """Return the unit of which angles step by whole turns, and how often; a vector flips by one in length."""
    known = values[np.isfinite(values).all(axis=1)]
    if form == "vector":
        lengths = np.linalg.norm(np.diff(known, axis=0), axis=1)
        known = np.concatenate(([0.0], np.cumsum(lengths)))[:, np.newaxis]
    likely = "deg" if peak(values) > ONE_TURN else "rad"
    why = format_wraps(known, likely)
    return (likely, why) if why else None
