"""A diagnosis in words: the same in the terminal, the recording and the report."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from urmpipe_pipeline import text

if TYPE_CHECKING:
    from urmpipe_pipeline.diagnosis.result import Alternative, Cause, Diagnosis, Remainder

KINDS: Mapping[str, str] = {
    "joint_sign": "sense of a joint",
    "joints_swapped": "exchanged joints",
    "half_turn": "half a turn",
    "mirrored": "mirrored joint",
    "turns": "whole turns",
    "joint_offset": "zero of a joint",
    "joint_scale": "scale of a joint",
    "compliance": "compliance of a joint",
    "link_length": "length of a link",
    "tilt": "tilt of a link",
    "base_shift": "place of the base",
    "base_rotation": "orientation of the base",
    "tool_shift": "tool centre point",
    "tool_rotation": "orientation of the tool",
    "path_unit": "unit of the path",
    "time_lag": "lag of the clock",
    "clock_drift": "drift of the clock",
    "other_robot": "another robot",
}
"""What each kind of cause is called."""

MODULE = re.compile(r"phi([1-9]\d*)")
"""How the joints of URM arms are called, a module each."""

SHOWN = {"m": ("mm", 1e3), "rad": ("deg", 57.29577951308232), "s": ("ms", 1e3), "s/s": ("ms/s", 1e3)}
"""The units that people read, and how many of them one of the SI unit is."""

DIGITS = 4
"""Digits after the point at most, as of lengths and angles elsewhere."""

MAIN = 3
"""So many causes stand in a sentence at most; a table has all of them."""

SMALL = 1e-3
"""Share of the mean square below which a cause stands in the table alone."""

SAID = 2
"""So many explanations that are not told apart stand in a sentence; a table has all of them."""


def sentence(result: Diagnosis) -> str:
    """Return the answer in one sentence: the main causes, of several with their shares, and what they change.

    Where something is not decided, it stands behind them. Different motions have no causes worth a sentence.
    """
    before, after = (amount(one, result.unit) for one in (result.rms, result.remainder.rms))
    causes, alternatives = result.causes, result.undecided
    if result.remainder.different:
        found = f"the causes found leave {after} of it" if causes or alternatives else "no cause found"
        return f"probably different motions: rms {before}, {found}"
    if not causes and not alternatives:
        taken = f" ({result.remainder.words})" if result.remainder.words else ""
        return f"no cause found: rms {before} remains{taken}"
    said = [f"{cause_words(one)}: {change_words(one, result.unit)}" for one in causes]
    said += [f"{_either(alternatives)} ({_deciding(alternatives)})"] if alternatives else []
    return "; ".join(said)


def change_words(one: Cause, unit: str) -> str:
    """Return what taking a cause away changes, after those before it: "rms 1.61 mm -> 0.002 mm"."""
    return f"rms {amount(one.rms_before, unit)} -> {amount(one.rms_after, unit)}"


def undecided_words(alternatives: Sequence[Alternative]) -> str:
    """Return between what a log does not decide: "either A or B: a motion of phi5 would decide"."""
    return f"{_either(alternatives)}: {_deciding(alternatives)}"


def _either(alternatives: Sequence[Alternative]) -> str:
    said = [explanation_words(one) for one in alternatives[:SAID]]
    more = len(alternatives) - SAID
    said += [f"{more} more" if more > 1 else "another"] if more > 0 else []
    return f"either {' or '.join(said)}"


def _deciding(alternatives: Sequence[Alternative]) -> str:
    """Return what would decide between some explanations."""
    needs = list(dict.fromkeys(one.needs for one in alternatives if one.needs))
    return f"a motion of {text.enumerated(needs)} would decide" if needs else "this log cannot decide"


def explanation_words(one: Alternative) -> str:
    """Return the causes that one explanation takes."""
    return text.enumerated([cause_words(cause) for cause in one.causes]) or "none of these"


def cause_words(one: Cause) -> str:
    """Return a cause in a few words: what of robot or reading needs what, and from where on."""
    from_row = "" if one.from_sample is None else f" from row {one.from_sample + 1} on"
    return f"{_CLAUSES[one.kind](one)}{from_row}"


def explained(one: Cause) -> str:
    """Return a cause in a sentence: its value with its interval, twins, and what positions cannot tell."""
    interval = interval_words(one)
    said = [f"{cause_words(one)}{f' (95 %: {interval})' if interval else ''}"]
    said += [f"or its twin {' or '.join(one.twins)}"] if one.twins else []
    if one.kind == "joint_sign":
        said.append("or its column has the opposite sign: positions cannot distinguish these")
    return ", ".join(said)


def remainder_words(one: Remainder, unit: str) -> str:
    """Return what stays, and what it is taken for."""
    said = f"rms {amount(one.rms, unit)}, {share_words(one.share)} of the mean square"
    return f"{said}: {one.words}" if one.words else said


def share_words(share: float) -> str:
    """Return a share of the mean square in [%]: what explains next to nothing has no digits."""
    if 0.0 < abs(share) < 1e-4:
        return "under 0.01 %"
    return f"-{text.percent(-share)}" if share < 0.0 else text.percent(share)


def amount(value: float, unit: str) -> str:
    """Return a root mean square with the unit that people read: five digits, four after the point at most."""
    shown, factor = SHOWN[unit]
    scaled = value * factor
    rounded = float(f"{round(scaled, DIGITS):.5g}")
    return f"{rounded if rounded or not scaled else float(f'{scaled:.1e}'):.5g} {shown}"


def value_words(one: Cause) -> str:
    """Return what a cause adds, signed, with its unit; a factor as it is; nothing of a sign."""
    return f"{_numbers(one, one.value)} {_unit(one)}".strip()


def interval_words(one: Cause) -> str:
    """Return the interval of the numbers of a cause: "+1.1990 to +1.2010 deg"; nothing without one."""
    return f"{_numbers(one, one.low)} to {_numbers(one, one.high)} {_unit(one)}".strip() if one.low else ""


def _unit(one: Cause) -> str:
    return SHOWN.get(one.unit, (one.unit,))[0]


def _numbers(one: Cause, numbers: tuple[float, ...]) -> str:
    """Return numbers in the unit of a cause, as people read them, without it."""
    factor = SHOWN[one.unit][1] if one.unit in SHOWN else 1.0
    others = {"turns": "+.0f", "s2": "+.4g", "": ".6g"}
    digits = f"+.{DIGITS}f" if one.unit in SHOWN else others[one.unit]
    said = ", ".join(f"{factor * value:{digits}}" for value in numbers)
    return f"({said})" if len(numbers) > 1 else said


def joint_names(one: Cause) -> tuple[str, ...]:
    """Return the joints of a cause as the arm calls them; none of other causes."""
    return tuple(one.name.split(" and ")) if one.joints else ()


def joints_words(names: Sequence[str]) -> str:
    """Return what joints are called: "module 3 (phi3)" of a URM arm, "joints q1 and q2" or "elbow_joint"."""
    modules = [found for found in map(MODULE.fullmatch, names) if found]
    urm = len(modules) == len(names)
    said = text.enumerated([f"{one[1]} ({one[0]})" for one in modules] if urm else list(names))
    if not urm and all("joint" in name.lower() for name in names):
        return said  # a name says it already
    return f"{'module' if urm else 'joint'}{'s' if len(names) > 1 else ''} {said}"


def _needs(of: str = "") -> Callable[[Cause], str]:
    """Return a function that writes "d_1 needs -9.3 mm", with a given name or else that of the cause."""
    return lambda one: f"{of or one.name} needs {value_words(one)}"


def _offset(one: Cause) -> str:
    """Return by how much a joint reads too high or too low: the opposite of what it needs."""
    size = replace(one, value=(abs(one.value[0]),))
    way = "high" if one.value[0] < 0.0 else "low"
    return f"{joints_words(joint_names(one))} reads {value_words(size).removeprefix('+')} too {way}"


def _sign(one: Cause) -> str:
    module = MODULE.fullmatch(one.name)
    return f"{joints_words(joint_names(one))} {'counter-rotates' if module else 'rotates in reverse'}"


def _path_unit(one: Cause) -> str:
    side, unit = one.name.split(" in ")
    return f"the positions of the {side} are in {unit}, read as m"


def _lag(one: Cause) -> str:
    late = "late" if one.value[0] < 0.0 else "early"
    return f"the log is {abs(one.value[0]) * 1e3:.4g} ms {late}"


_CLAUSES: Mapping[str, Callable[[Cause], str]] = {
    "joint_sign": _sign,
    "joints_swapped": lambda one: f"{joints_words(joint_names(one))} are exchanged",
    "half_turn": lambda one: f"{joints_words(joint_names(one))} needs half a turn",
    "mirrored": lambda one: f"{joints_words(joint_names(one))} is mirrored",
    "turns": lambda one: f"{joints_words(joint_names(one))} needs {value_words(one)}",
    "joint_offset": _offset,
    "joint_scale": lambda one: f"{joints_words(joint_names(one))} needs a factor of {value_words(one)}",
    "compliance": lambda one: (
        f"{joints_words(joint_names(one))} is compliant: {value_words(one)} of its acceleration"
    ),
    "link_length": _needs(),
    "tilt": _needs(),
    "base_shift": _needs("the base"),
    "base_rotation": _needs("the base"),
    "tool_shift": _needs("the tool centre point"),
    "tool_rotation": _needs("the tool"),
    "path_unit": _path_unit,
    "time_lag": _lag,
    "clock_drift": _needs("the log's clock"),
    "other_robot": lambda one: f"another arm fits: {one.name}",
}
"""What each kind of cause is, in a few words."""
