"""The recorded orientation: its form and unit, by the names of its columns or by the arm's kinematics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.hand_eye import hand_eye, rotation_miss
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.messages import Hint
from urmpipe_models.orientation import RotationForm, angles, matrices, quaternions
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.units.evidence import spread, turned_apart
from urmpipe_pipeline.sources.units.unit_evidence import peak
from urmpipe_pipeline.sources.units.unit_hints import OTHER_UNIT, unit_hints
from urmpipe_pipeline.sources.vocabulary import Unit, vocabulary
from urmpipe_pipeline.text import counted

PURE = Unit("1", "ratio", 1.0)
"""The unit of quaternions and of matrices."""

CLOSE = 0.03
"""Orientations agree with the kinematics within this angle in [rad] (1.7 deg) ..."""

CLEARLY = 5.0
"""... and so many times better than in any other form."""

UNIT_LENGTH = 0.02
"""The length of a quaternion may differ from 1 by this: they are printed with two digits or more."""

Choice: TypeAlias = tuple[RotationForm, tuple[Unit, ...]]
"""A form of an orientation, and the unit of each of its columns."""


@dataclass(frozen=True, slots=True)
class Settled:
    """What a recorded orientation is.

    Attributes:
        form: Its form; None if it cannot be told, and then it is not used.
        units: The unit of each column.
        inferences: What was found out.
        warnings: What a person should know.
    """

    form: RotationForm | None = None
    units: tuple[Unit, ...] = ()
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()


def settle_rotation(
    columns: Sequence[Column],
    forms: Sequence[RotationForm],
    values: FloatArray,
    told: Sequence[Unit | None],
    arm: tuple[Chain, FloatArray] | None,
    *,
    given: bool = False,
    measured: FloatArray | None = None,
) -> Settled:
    """Return form and units of the columns of a recorded orientation.

    Where the arm's kinematics agree in another unit than the one that is told, they decide, unless the user
    gave it.

    Args:
        columns: The columns.
        forms: The forms that their names allow.
        values: Their values in the file's own units, shape (n, columns).
        told: The unit that each column tells, if it does.
        arm: The robot and the joint values in SI, shape (n, joints); None without a robot.
        given: Whether the user told the units.
        measured: Where the tool was measured from outside in [m], shape (n, 3): the orientations stand in a
            frame of their own as well.
    """
    if not columns or np.isnan(values).any(axis=1).all():
        return Settled()
    names = ", ".join(column.name for column in columns)
    sound = [form for form in forms if _is_sound(values, form)]
    if not sound:
        return Settled(warnings=(_about_lengths(names, np.linalg.norm(values, axis=1)),))
    choices = [(form, units) for form in sound for units in _possible_units(form, values, told)]
    found = _settled_by_kinematics(columns, choices, values, arm, measured, given=given) if arm else None
    if found is not None:
        return found
    if len(choices) == 1:
        return _settled(columns, choices[0], "their names")
    if len(sound) == 1:
        taken = choices[0][1][0].name
        said = f"no unit is given for {names}: they are taken as {taken}"
        hints = unit_hints(columns[:1], OTHER_UNIT[taken])
        taken_for = f"the orientation is in {taken}"
        doubt = LogWarning("assumed-unit", said, hints=hints, assumption=taken_for, role="rotation")
        return _settled(columns, choices[0], "their names", doubt)
    said = f"{names} may be of several forms: the recorded orientation is not used"
    hints = tuple(Hint("rotation", form, "says which") for form in sound)
    return Settled(warnings=(LogWarning("orientation", said, hints=hints),))


def _settled(columns: Sequence[Column], choice: Choice, evidence: str, *warnings: LogWarning) -> Settled:
    form, units = choice
    said = form_inference([column.name for column in columns], form, units[0], evidence)
    return Settled(form, units, (said,), warnings)


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
    where = f" in {counted(count, 'row')} of {len(off)}, first in this one" if few else ""
    said = f"{names} hold quaternions of length {typical:.4g}{where}, allowed: 1; they are not used"
    return LogWarning("orientation", said, row + 1 if few else None)


def _possible_units(
    form: RotationForm, values: FloatArray, told: Sequence[Unit | None]
) -> list[tuple[Unit, ...]]:
    """Return the units that the columns may have: told, or deg and rad, or deg alone beyond two turns."""
    if not angles(form):
        return [(PURE,) * len(told)]
    known = [unit for unit in told if unit is not None]
    if known:
        return [tuple(unit or known[0] for unit in told)]
    units = vocabulary().units
    likely = ("deg",) if peak(values) > 2 * np.pi * 1.01 else ("rad", "deg")
    return [(units[name],) * len(told) for name in likely]


def _settled_by_kinematics(
    columns: Sequence[Column],
    choices: Sequence[Choice],
    values: FloatArray,
    arm: tuple[Chain, FloatArray],
    measured: FloatArray | None,
    *,
    given: bool,
) -> Settled | None:
    """Return what the kinematics single out, with a warning if it is none of the choices; else None."""
    others = [] if given else [one for one in _in_other_units(choices) if one not in choices]
    if len(choices) + len(others) == 1:
        return None
    best = _by_kinematics([*choices, *others], values, arm, measured)
    if best is None or best[0] in choices:
        return best and _settled(columns, *best)
    told, better = choices[0][1][0].name, best[0][1][0].name
    names = ", ".join(column.name for column in columns)
    said = f"{names}: {told} contradicts the kinematics: taken as {better}: {best[1]}"
    hints = unit_hints(columns[:1], told)
    return _settled(columns, *best, LogWarning("unit-contradiction", said, hints=hints))


def _in_other_units(choices: Sequence[Choice]) -> list[Choice]:
    """Return the same forms with their angles in the other of rad and deg."""
    units = vocabulary().units
    return [
        (form, (units[OTHER_UNIT[told[0].name]],) * len(told))
        for form, told in choices
        if told[0].name in OTHER_UNIT
    ]


def _by_kinematics(
    choices: Sequence[Choice],
    values: FloatArray,
    arm: tuple[Chain, FloatArray],
    measured: FloatArray | None,
) -> tuple[Choice, str] | None:
    """Return the choice with which the kinematics agree, and by how much; None if none stands out."""
    robot, q = arm
    rows = spread(len(q))
    q, values = q[rows], values[rows]
    known = np.isfinite(q).all(axis=1) & np.isfinite(values).all(axis=1)
    if not known.any():
        return None
    position, rotation = poses_over_log(robot, q[known])
    recorded = [quaternions(values[known] * [unit.factor for unit in units], form) for form, units in choices]
    for apart in _apart(position, rotation, None if measured is None else measured[rows][known]):
        distances = [apart(one) for one in recorded]
        order = np.argsort(distances)
        best, second = (distances[k] for k in order[:2])
        if best <= CLOSE and second >= CLEARLY * best and second >= best + CLOSE:
            form, units = choices[order[1]]
            said = f"with it the arm's orientation agrees within {np.degrees(best):.2f} deg"
            said += f", as {form} in {units[0].name} within {np.degrees(second):.2f} deg"
            return choices[order[0]], said
    return None


def _apart(
    position: FloatArray, rotation: FloatArray, measured: FloatArray | None
) -> Iterator[Callable[[FloatArray], float]]:
    """Yield what tells how far orientations stay from those of the kinematics in [rad], the strictest first.

    In the frame of the base as they are, then with a tool that is turned; of those that were measured from
    outside, at positions in [m], shape (n, 3), with the frames of base and tool that fit best.
    """
    if measured is None:
        computed = quaternions(rotation.reshape(-1, 9), "matrix")
        yield partial(turned_apart, computed, tool=False)
        yield partial(turned_apart, computed, tool=True)
    elif np.isfinite(measured).all(axis=1).any():
        base = hand_eye(position, rotation, measured).base_rotation
        yield lambda recorded: rotation_miss(rotation, matrices(recorded), base)
