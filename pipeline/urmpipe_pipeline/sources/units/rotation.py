"""The recorded orientation: its form and unit, by names, the arm's kinematics or the values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint
from urmpipe_models.hand_eye import rotation_residual, solve_hand_eye
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import FORMS, RotationForm, column_count, is_angular, to_matrices, to_quaternions
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.units.evidence import spread, turned_apart
from urmpipe_pipeline.sources.units.told import Told
from urmpipe_pipeline.sources.units.unit_evidence import ONE_TURN, TWO_TURNS, peak, usual_peak, wraps
from urmpipe_pipeline.sources.units.unit_hints import OTHER_UNIT, unit_hints, which_unit
from urmpipe_pipeline.sources.vocabulary import Unit, vocabulary

PURE = Unit("1", "ratio", 1.0)
"""The unit of quaternions and of matrices."""

CLOSE = 0.03
"""Orientations agree with the kinematics within this angle in [rad] (1.7 deg) ..."""

CLEARLY = 5.0
"""... and so many times better than in any other form."""

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
        form: Its form; None if it cannot be told, and then it is not used.
        units: The unit of each column.
        order: The places of the columns in the order of the form.
        inferences: What was found out.
        warnings: What a person should know.
    """

    form: RotationForm | None = None
    units: tuple[Unit, ...] = ()
    order: tuple[int, ...] = ()
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()

    @property
    def doubt(self) -> str:
        """Why its unit is only assumed; empty where it is given or proved."""
        return next((one.message for one in self.warnings if one.assumption), "")


def settle_rotation(
    columns: Sequence[Column],
    forms: Sequence[RotationForm],
    values: FloatArray,
    told: Sequence[Told | None],
    arm: tuple[Chain, FloatArray] | None,
    *,
    given: bool = False,
    measured: FloatArray | None = None,
) -> Settled:
    """Return form and units of the columns of a recorded orientation.

    Where the arm's kinematics agree in another form or unit than those that are told, they decide, unless the
    user gave them. Without, a unit is held against wraps and size of the values.

    Args:
        columns: The columns.
        forms: The forms that their names allow.
        values: Their values in the file's own units, shape (n, columns).
        told: The unit that is told of each column, if one is.
        arm: The robot and the joint values in SI, shape (n, joints); None without a robot.
        given: Whether the user told the form.
        measured: Where the tool was measured from outside in [m], shape (n, 3): the orientations stand in a
            frame of their own as well.
    """
    if not columns or np.isnan(values).any(axis=1).all():
        return Settled()
    names = ", ".join(column.name for column in columns)
    sound = [form for form in forms if _is_sound(values, form)]
    if not sound:
        return Settled(warnings=(_about_lengths(names, np.linalg.norm(values, axis=1)),))
    choices = [Choice(form, units) for form in sound for units in _possible_units(form, told)]
    fixed = any(one and one.by == "column" for one in told)
    if arm is not None:
        forms = [one for one in FORMS if column_count(one) == len(columns) and _is_sound(values, one)]
        others = _others(choices, sound if given else forms, units=not fixed, order=not given)
        found = _by_kinematics(list(dict.fromkeys((*choices, *others))), choices, values, arm, measured)
        if found is not None and found.proved:
            return _settled_by_kinematics(columns, choices, found)
        choices = [found.choice] if found else choices
    if len({one.form for one in choices}) > 1:
        said = f"{names} may be of several forms: the recorded orientation is not used"
        hints = tuple(Hint("rotation", form, "specifies it") for form in sound)
        return Settled(warnings=(LogWarning("orientation", said, hints=hints),))
    if len(choices) > 1:
        return _without_unit(columns, choices, values)
    teller = next((one for one in told if one and not fixed), None)
    return _with_unit(columns, choices[0], values, teller)


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


def _about_lengths(names: str, length: FloatArray) -> LogWarning:
    """Return what is said of quaternions that are none, by their lengths; with the first row if few are."""
    off = np.abs(length - 1.0) > UNIT_LENGTH
    count, row = int(np.count_nonzero(off)), int(np.argmax(off))
    few = 2 * count < len(off)
    typical = length[row] if few else np.nanmedian(length)
    where = f" in {format_count(count, 'row')} of {len(off)}, first in this one" if few else ""
    said = f"{names} hold quaternions of length {typical:.4g}{where}, allowed: 1; they are not used"
    return LogWarning("orientation", said, row + 1 if few else None)


def _possible_units(form: RotationForm, told: Sequence[Told | None]) -> list[tuple[Unit, ...]]:
    """Return the units that the columns may have: told, or rad or deg."""
    if not is_angular(form):
        return [(PURE,) * len(told)]
    known = [one.unit for one in told if one is not None]
    if known:
        return [tuple(one.unit if one else known[0] for one in told)]
    return [(vocabulary().units[name],) * len(told) for name in ("rad", "deg")]


def _others(
    choices: Sequence[Choice], forms: Sequence[RotationForm], *, units: bool, order: bool
) -> Iterator[Choice]:
    """Yield what the columns may be against their names: other forms, units and orders of a matrix."""
    told = choices[0].units
    for form in forms:
        if not is_angular(form):
            yield Choice(form, (PURE,) * len(told))
            if form == "matrix" and order:
                yield Choice(form, (PURE,) * len(told), by_columns=True)
            continue
        yield Choice(form, told)
        if units:
            yield from (Choice(form, (vocabulary().units[name],) * len(told)) for name in ("rad", "deg"))


def _settled(columns: Sequence[Column], choice: Choice, evidence: str, *warnings: LogWarning) -> Settled:
    said = form_inference([column.name for column in columns], choice.form, choice.units[0], evidence)
    return Settled(choice.form, choice.units, choice.order, (said,), warnings)


@dataclass(frozen=True, slots=True)
class _Found:
    """The choice with which the kinematics agree, by how much, and whether they do in no other unit."""

    choice: Choice
    evidence: str
    proved: bool


def _settled_by_kinematics(columns: Sequence[Column], told: Sequence[Choice], found: _Found) -> Settled:
    """Return what the kinematics single out, with a warning if it is none of what is told."""
    best, first = found.choice, told[0]
    hints: tuple[Hint, ...]
    if best in told:
        return _settled(columns, best, found.evidence)
    if best.by_columns:
        was, now, hints = (
            "matrix by rows",
            "matrix by columns",
            (Hint("rotation", "matrix", "reads it by rows"),),
        )
    elif any(one.form == best.form for one in told):
        was, now = first.units[0].name, best.units[0].name
        hints = unit_hints(columns, was)
    else:
        was, now, hints = str(first), str(best), (Hint("rotation", first.form, "overrides this"),)
    names = ", ".join(column.name for column in columns)
    said = f"{names}: {was} contradicts the kinematics: taken as {now}: {found.evidence}"
    return _settled(columns, best, found.evidence, LogWarning("unit-contradiction", said, hints=hints))


def _by_kinematics(
    every: Sequence[Choice],
    told: Sequence[Choice],
    values: FloatArray,
    arm: tuple[Chain, FloatArray],
    measured: FloatArray | None,
) -> _Found | None:
    """Return the choice with which the kinematics agree; None if none stands out.

    Of several that cannot be told apart it is the only one that is told.
    """
    robot, q = arm
    rows = spread(len(q))
    q, values = q[rows], values[rows]
    known = np.isfinite(q).all(axis=1) & np.isfinite((values**2).sum(axis=1))  # huge ones have no direction
    if not known.any() or len(every) < 2:
        return None
    position, rotation = poses_over_log(robot, q[known])
    recorded = [one.quaternions(values[known]) for one in every]
    for apart in _apart(position, rotation, None if measured is None else measured[rows][known]):
        distances = np.array([apart(one) for one in recorded])
        best = distances.min()
        worse = (distances >= CLEARLY * best) & (distances >= best + CLOSE)
        rivals = [one for one, excluded in zip(every, worse, strict=True) if not excluded]
        chosen = [one for one in rivals if one in told] or rivals
        if best <= CLOSE and worse.any() and len(chosen) == 1:
            own = every.index(chosen[0])
            beaten = range(len(told)) if chosen[0] not in told else np.flatnonzero(worse).tolist()
            second = min(beaten, key=distances.__getitem__)  # every choice begins with what is told
            said = f"with it the arm's orientation agrees within {np.degrees(distances[own]):.2f} deg"
            said += f", as {every[second]} within {np.degrees(distances[second]):.2f} deg"
            return _Found(chosen[0], said, all(one.units == chosen[0].units for one in rivals))
    return None


def _apart(
    position: FloatArray, rotation: FloatArray, measured: FloatArray | None
) -> Iterator[Callable[[FloatArray], float]]:
    """Yield what tells how far orientations stay from those of the kinematics in [rad], the strictest first.

    In the frame of the base as they are, then with a tool that is turned; of those that were measured from
    outside, at positions in [m], shape (n, 3), with the frames of base and tool that fit best.
    """
    if measured is None:
        computed = to_quaternions(rotation.reshape(-1, 9), "matrix")
        yield partial(turned_apart, computed, tool=False)
        yield partial(turned_apart, computed, tool=True)
    elif np.isfinite(measured).all(axis=1).any():
        base = solve_hand_eye(position, rotation, measured).base_rotation
        yield lambda recorded: rotation_residual(rotation, to_matrices(recorded), base)


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


def _with_unit(columns: Sequence[Column], choice: Choice, values: FloatArray, told: Told | None) -> Settled:
    """Return columns in the unit that is told, doubted where wraps or size of angles speak against it.

    No verdict rests on one that they exclude. Values are in the file's own units, shape (n, columns).
    """
    if told is None:
        return _settled(columns, choice, "their names")
    unit, size = choice.units[0].name, usual_peak(values)
    wrapped, why = _unit_by_wraps(values, choice.form) or ("", "")
    large = size > ONE_TURN
    if wrapped == unit or (not wrapped and large == (unit == "deg")) or not peak(values) > 0:
        return _settled(columns, choice, "their names")
    if not wrapped:
        likely = "are more than a turn as rad" if large else "may be rad as well"
        why = f"values of {size:.6g} {likely}"
    names = ", ".join(column.name for column in columns)
    said, taken = f"{names}: {unit} ({told.evidence}) is doubted: {why}", f"the orientation is in {unit}"
    asks, hints = bool(wrapped) or size > TWO_TURNS, which_unit(columns, unit, every=False)
    warning = LogWarning(
        "doubted-unit", said, hints=hints, assumption=taken, role="rotation", blocks_verdict=asks
    )
    return _settled(columns, choice, "their names", warning)


def _unit_by_wraps(values: FloatArray, form: RotationForm) -> tuple[str, str] | None:
    """Return the unit of which angles step by whole turns, and how often; a vector flips by one in length."""
    known = values[np.isfinite(values).all(axis=1)]
    if form == "vector":
        lengths = np.linalg.norm(np.diff(known, axis=0), axis=1)
        known = np.concatenate(([0.0], np.cumsum(lengths)))[:, np.newaxis]
    likely, turn = ("deg", "360") if peak(values) > ONE_TURN else ("rad", "6.28")
    count = int(wraps(known, likely).sum())
    return (
        (likely, f"{format_count(count, 'step')} of about {turn} from one row to the next") if count else None
    )
