"""The repolarizer as a unit: joint angles without the jumps of limited joints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.units.options import whole_number
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Memory, Output, Parameter, ValueType, Variable
from urmpipe_models.elementwise import Element
from urmpipe_models.wraps import State, step

OPTIONS: Mapping[str, str] = {"joints": "the number of joints, such as 6"}

POINT = 1.0
"""Time is counted in communication points: what lies between two of them, `max_step` tells."""


def repolarizer(joints: int) -> Unit:
    """Return the unit that adds whole periods to angles, so that they go on where they were.

    What `urmpipe_models.wraps.step` gives sample by sample, the samples being the communication points
    and max_step in place of a largest speed.

    Args:
        joints: The number of joints.

    Raises:
        UnitError: If it is no integer from 1 to 1000.

    Source: [UrmArm2021]_ eq. 15-18 with the corrections of the errata.
    """
    whole_number("repolarizer", "joints", joints)
    return Unit(
        name="repolarizer",
        description="Joint angles without the jumps of joints that are limited to one period",
        variables=(*_parameters(), *_signals(joints), *_memories(joints)),
        outputs=_outputs,
        update=_update,
        equations=(
            "q = raw + period turns (eq. 15)",
            "turns changes by -sign(d) where a step d of raw meets ||d| - period| <= max_step (eq. 17, 18),",
            "or where two steps of one sign do so only together",
            "max_step counts as at least period / 100 and at most period / 4",
        ),
        source="UrmArm2021, eq. 15-18, with the sign of eq. 17 corrected and whole turns counted",
        recipe=Recipe(__name__, "repolarizer", {"joints": joints}),
    )


def _parameters() -> tuple[Parameter, ...]:
    return (
        Parameter(
            name="period",
            description="What a joint jumps by where its environment limits it",
            unit="rad",
            display_unit="deg",
            start=2.0 * math.pi,
            minimum=1e-6,
        ),
        Parameter(
            name="max_step",
            description="How far a joint can move from one communication point to the next",
            unit="rad",
            display_unit="deg",
            start=math.pi / 2.0,
            minimum=1e-9,
        ),
    )


def _signals(joints: int) -> tuple[Variable, ...]:
    return (
        Input(
            name="raw",
            description="Joint angles as their environment limits them",
            unit="rad",
            display_unit="deg",
            size=joints,
        ),
        Output(name="q", description="Repolarized joint angles", unit="rad", display_unit="deg", size=joints),
        Output(name="turns", description="Whole periods added", size=joints, type="Integer"),
    )


def _memories(joints: int) -> tuple[Memory, ...]:
    def memory(name: str, description: str, unit: str = "", kind: ValueType = "Real") -> Memory:
        """Return a memory of every joint."""
        return Memory(name=name, description=description, unit=unit, type=kind, size=joints)

    return (
        memory("last", "Raw angles of the communication point before", "rad"),
        memory("residual", "Step to them, less a period if it was a repolarization", "rad"),
        memory("lasted", "Communication points that this step took"),
        memory("turns_before", "Whole periods added there", kind="Integer"),
        memory("elapsed", "Communication points without a value since then"),
        memory("seen", "Whether there was one before", kind="Boolean"),
    )


def _steps(v: Values) -> Iterator[tuple[State, Element]]:
    """Yield what `step` gives of each joint: the state to remember and the repolarized angle."""
    remembered = zip(v.last, v.residual, v.lasted, v.turns_before, v.elapsed, v.seen, strict=True)
    for fields, raw in zip(remembered, v.raw, strict=True):
        state, q, _ = step(State(*fields), raw, POINT, period=v.period, max_speed=v.max_step)
        yield state, q


def _outputs(v: Values) -> Mapping[str, Sequence[Element]]:
    states, q = zip(*_steps(v), strict=True)
    return {"q": q, "turns": tuple(state.turns for state in states)}


def _update(v: Values) -> Mapping[str, Sequence[Element]]:
    states = [state for state, _ in _steps(v)]
    fields = dict(zip(State._fields, zip(*states, strict=True), strict=True))
    fields["turns_before"] = fields.pop("turns")
    return fields
