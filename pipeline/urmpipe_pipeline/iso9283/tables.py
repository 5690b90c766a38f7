"""The tables of a test after ISO 9283: criteria over all and by place, and the cycles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding
from urmpipe_pipeline.iso9283.criteria import ANGLES, MEANING, UNITS, Criterion, min_cycles
from urmpipe_pipeline.iso9283.result import CutPath, Cycle, FailedCycle, IsoTest
from urmpipe_pipeline.presentation.digits import allowed_words, held, written
from urmpipe_pipeline.presentation.parts import Heads, columns_of, rows_table, spot_at
from urmpipe_pipeline.presentation.section import Cell, Column, Judged, Place, Table, Value

COLUMNS = tuple(field.name for field in fields(Criterion))
"""Of a row a criterion and place: name, at, value, unit, cycles, tolerance, verdict."""

PAIRED = ("AD", "RD", "vAP")
"""Criteria of several poses together."""


def criteria_tables(test: IsoTest) -> Iterator[Table]:
    """Yield the criteria over all that are judged, the worst first, and those that have no tolerance."""
    judged = [one for one in worst_first(test.overall) if one.tolerance is not None]
    others = [one for one in test.overall if one.tolerance is None]
    heads: Heads[Criterion] = {
        "name": ("Criterion", lambda one: one.name),
        "verdict": ("Verdict", lambda one: Judged(one.verdict)),
        "value": ("value", value_of),
        "tolerance": ("tolerance", tolerance_of),
        "where": ("where", lambda one: where(test, one)),
        "meaning": ("Meaning", lambda one: meaning(one.name)),
        "cycles": ("cycles", lambda one: Value(one.cycles)),
    }
    if judged:
        note = "After ISO 9283. The criterion that uses up most of its tolerance stands first."
        columns = _brief(columns_of(judged, heads), {"cycles"})
        yield Table("Criteria and their tolerances", columns, note, worst_first=True)
    if others:
        free = {key: head for key, head in heads.items() if key not in ("verdict", "tolerance")}
        note = "After ISO 9283, each at the place where it is largest."
        title = "Other criteria" if judged else "Criteria"
        yield Table(title, _brief(columns_of(others, free), {"cycles"}), note)


def _brief(columns: Sequence[Column], less: set[str]) -> tuple[Column, ...]:
    """Return columns, some of which need not be shown where there is little room."""
    return tuple(replace(one, brief=one.key not in less) for one in columns)


def criteria_rows(test: IsoTest) -> Table:
    """Return what `--csv` writes: a row a criterion and place, then a failed cycle, in SI units."""
    return rows_table("Criteria", COLUMNS, test.rows())


def cycles_table(test: IsoTest) -> Table:
    """Return the cycles: their rows, and how their clocks stand to the reference's."""
    heads: Heads[Cycle] = {
        "name": ("Cycle", lambda one: one.name),
        "row": ("first row", lambda one: Value(one.row)),
        "last_row": ("last row", lambda one: Value(one.last_row)),
        "sync_offset": ("offset", lambda one: Value(one.sync_offset, "s", signed=True)),
    }
    note = "Offset: time of the reference minus time of the cycle."
    return Table("Cycles", columns_of(test.cycles, heads), note, brief=False, folded=len(test.cycles) > 1)


def failed_table(test: IsoTest) -> Table:
    """Return the cycles that failed: their rows, how far from the command they are, and why."""
    heads: Heads[FailedCycle] = {
        "name": ("Cycle", lambda one: one.name),
        "row": ("first row", lambda one: Value(one.row)),
        "last_row": ("last row", lambda one: Value(one.last_row)),
        "distance": ("largest distance", lambda one: Value(one.distance, "m")),
        "reason": ("Reason", lambda one: one.reason),
    }
    note = "Distance: from the path of the command. No criterion is of these cycles."
    return Table("Failed cycles", columns_of(test.failed_cycles, heads), note)


def pose_tables(test: IsoTest) -> Iterator[Table]:
    """Yield the criteria of each pose, and those of several poses together."""
    names = [name for name in names_of("Poses") if name not in PAIRED]
    if test.poses is not None:
        places = _places(test.poses.command)
        yield Table("By pose", _by_place("Pose", test, names, {"place": ("x, y, z", places)}))
    columns = _by_place("Poses", test, PAIRED, {})
    if len(columns[0].cells):
        yield Table("Between poses", columns, brief=False, folded=True)


def corner_table(test: IsoTest, path: CutPath) -> Table:
    """Return the criteria of each corner."""
    places: list[Cell] = [Place(spot_at(one.point)) for one in path.corners]
    return Table("By corner", _by_place("Corner", test, names_of("Corners"), {"place": ("x, y, z", places)}))


def leg_table(test: IsoTest, path: CutPath) -> Table:
    """Return the speed on each leg."""
    more: Mapping[str, tuple[str, Sequence[Cell]]] = {
        "begins": ("from s", [Value(one.begins, "m") for one in path.legs]),
        "ends": ("to s", [Value(one.ends, "m") for one in path.legs]),
        "commanded": ("v_c", [Value(one.commanded, "m/s") for one in path.legs]),
        "mean": ("mean v", [Value(one.mean, "m/s") for one in path.legs]),
    }
    return Table(
        "By leg", _by_place("Leg", test, names_of("Speed"), more), "The middle half of each leg counts."
    )


def plane_table(test: IsoTest, path: CutPath) -> Table:
    """Return the criteria at each plane that cuts the path."""
    more: Mapping[str, tuple[str, Sequence[Cell]]] = {
        "s": ("s", [Value(float(s), "m") for s in path.s]),
        "place": ("x, y, z", _places(path.command)),
    }
    return Table("By plane", _by_place("Plane", test, names_of("Path"), more), brief=False, folded=True)


def _places(position: FloatArray) -> list[Cell]:
    """Return places in [m], shape (n, 3), as cells."""
    return [Place(spot_at(one)) for one in position]


def _by_place(
    title: str, test: IsoTest, names: Sequence[str], more: Mapping[str, tuple[str, Sequence[Cell]]]
) -> tuple[Column, ...]:
    """Return a row a place that has one of some criteria, and a column each of those that are told.

    Args:
        title: What the places are.
        test: The test.
        names: The criteria.
        more: Further columns, a cell a place.
    """
    found = {(one.at, one.name): one for one in test.criteria if one.at is not None and one.name in names}
    at = list(dict.fromkeys(at for at, _ in found))
    told = [name for name in UNITS if name in names and any(name == known for _, known in found)]
    cells = {name: [value_of(found.get((place, name))) for place in at] for name in told}
    return (
        Column("at", title, at),
        *(Column(name, name, cells[name], brief=name.rpartition("_")[2] not in ANGLES) for name in told),
        *(Column(key, head, values, brief=key != "place") for key, (head, values) in more.items()),
    )


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
        one.value, shown_unit(one.unit), one.tolerance, one.verdict, one.utilisation, signed=one.name == "AV"
    )


def tolerance_of(one: Criterion) -> Value:
    """Return what is allowed of a criterion."""
    return Value(one.tolerance, shown_unit(one.unit), given=True)


def worst_first(criteria: Iterable[Criterion]) -> list[Criterion]:
    """Return criteria by the share of their tolerance that they use up; those without one stand behind."""
    return sorted(
        criteria, key=lambda one: -1.0 if one.utilisation is None else one.utilisation, reverse=True
    )


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


def format_failed_cycle(cycle: FailedCycle) -> str:
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
            allowed=f"{one.name} of {min_cycles(one.name)} cycles or more",
        )
        for one in test.not_judged
    ]


def amount(value: float | None, unit: str, *, signed: bool = False) -> str:
    """Return a value in an SI unit as people read it: "0.1234 mm", "+1.5 %"."""
    return written(Value(value, shown_unit(unit), signed=signed), unit=True)
