"""How the criteria after ISO 9283 are said: the same in the terminal, JUnit, the recording and the report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from urmpipe_models.errors import Finding
from urmpipe_pipeline.iso9283.criteria import MEANING, UNITS, Criterion, fewest_cycles
from urmpipe_pipeline.iso9283.result import FailedCycle, IsoTest
from urmpipe_pipeline.presentation.digits import allowed_words, held, written
from urmpipe_pipeline.presentation.section import Value

PARTS = {
    "Poses": ("AP", "RP", "AD", "RD", "vAP", "PSt", "OV", "dAP", "dRP"),
    "Path": ("AT", "RT"),
    "Corners": ("CR", "CO"),
    "Speed": ("AV", "RV", "FV"),
}
"""The parts of a test, and the criteria of each; those of an angle belong to that of the position."""

NAMED = 3
"""Criteria, and failed cycles, that a headline names; more are only counted."""


def meaning(name: str) -> str:
    """Return what a criterion is called in words: "pose accuracy, rz"."""
    base, _, angle = name.partition("_")
    return f"{MEANING[base]}, {angle}" if angle else MEANING[base]


def names_of(part: str) -> list[str]:
    """Return the criteria of a part of a test, those of angles among them, in the order of `UNITS`."""
    return [name for name in UNITS if name.partition("_")[0] in PARTS[part]]


def overall_of(test: IsoTest, part: str) -> list[Criterion]:
    """Return the criteria of a part of a test over all its places."""
    names = names_of(part)
    return [one for one in test.overall if one.name in names]


def shown_unit(unit: str) -> str:
    """Return the unit of a criterion as a `Value` has it: a share is shown in percent."""
    return "%" if unit == "1" else unit


def value_of(one: Criterion | None) -> Value | None:
    """Return the value of a criterion with what is allowed of it."""
    if one is None:
        return None
    return Value(
        one.value, shown_unit(one.unit), one.tolerance, one.verdict, one.used, signed=one.name == "AV"
    )


def tolerance_of(one: Criterion) -> Value:
    """Return what is allowed of a criterion."""
    return Value(one.tolerance, shown_unit(one.unit), given=True)


def worst_first(criteria: Iterable[Criterion]) -> list[Criterion]:
    """Return criteria by the share of their tolerance that they use up; those without one stand behind."""
    return sorted(criteria, key=lambda one: -1.0 if one.used is None else one.used, reverse=True)


def decisive(test: IsoTest, part: str = "") -> Criterion | None:
    """Return the criterion that uses up most of its tolerance, of all or of a part; None without one."""
    criteria = worst_first(overall_of(test, part) if part else test.overall)
    return next((one for one in criteria if one.verdict is not None), None)


def where(test: IsoTest, one: Criterion) -> str:
    """Return where a criterion is largest, such as "pose 3"; empty where it has no value."""
    return "" if one.value is None else test.worst_of(one.name).at or ""


def amount_words(one: Criterion) -> str:
    """Return how much of how much a criterion is: "AP 0.1234 mm of 0.4 mm allowed"."""
    value = value_of(one)
    return one.name if value is None else f"{one.name} {held(value)}"


def check_words(test: IsoTest, one: Criterion) -> str:
    """Return why a criterion fails: how much it is of how much, and where."""
    return f"{amount_words(one)} at {where(test, one)}"


def criteria_words(criteria: Sequence[Criterion]) -> str:
    """Return how much some criteria are of how much; of many the first, and how many more there are."""
    more = f" and {len(criteria) - NAMED} more" if len(criteria) > NAMED else ""
    return ", ".join(map(amount_words, criteria[:NAMED])) + more


def tolerance_words(tolerance: Mapping[str, float]) -> str:
    """Return what is allowed of each criterion: "AP 0.4 mm, AV 5 %"."""
    allowed = (
        (name, Value(None, shown_unit(UNITS[name]), limit))
        for name, limit in tolerance.items()
        if name in UNITS
    )
    return ", ".join(f"{name} {allowed_words(value)}" for name, value in allowed)


def failed_words(cycle: FailedCycle) -> str:
    """Return which rows a failed cycle has, how far from the command it is, and why it failed."""
    return f"{_rows_and_distance(cycle)}: {cycle.reason}"


def failed_cycles_words(cycles: Sequence[FailedCycle]) -> str:
    """Return which cycles failed; of many the first, and how many more there are."""
    more = f" and {len(cycles) - NAMED} more" if len(cycles) > NAMED else ""
    return ", ".join(f"{one.name} ({_rows_and_distance(one)})" for one in cycles[:NAMED]) + more


def _rows_and_distance(cycle: FailedCycle) -> str:
    rows = f"rows {cycle.row} to {cycle.last_row}"
    return rows if cycle.distance is None else f"{rows}, up to {amount(cycle.distance, 'm')} off the path"


def not_judged_findings(test: IsoTest) -> list[Finding]:
    """Return why criteria with a tolerance have no verdict: they need more cycles than there are."""
    return [
        Finding(
            parameter="tolerance",
            found=f"{one.name} of {test.cycle_count}: not judged",
            allowed=f"{one.name} of {fewest_cycles(one.name)} cycles or more",
        )
        for one in test.not_judged
    ]


def amount(value: float | None, unit: str, *, signed: bool = False) -> str:
    """Return a value in an SI unit as people read it: "0.1234 mm", "+1.5 %"."""
    return written(Value(value, shown_unit(unit), signed=signed), unit=True)
