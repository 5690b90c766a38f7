"""The tables of a test after ISO 9283, and its criteria as text: the same in each medium.

1. Values: `to_value` and `to_tolerance` of a criterion; `meaning`, `criteria_of_part`, `find_worst_place`.
2. Text: `format_criterion` and others, for headlines, checks and messages.
3. Tables: criteria over all and by place, and the cycles.
"""

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

COLUMNS = tuple(field.name for field in fields(Criterion))  # of a row per criterion and place
PAIR_CRITERIA = ("AD", "RD", "vAP")  # of several poses together
MAX_NAMED = 3  # criteria, and failed cycles, in a headline; more are only counted

PARTS = {
    "Poses": ("AP", "RP", "AD", "RD", "vAP", "PSt", "OV", "dAP", "dRP"),
    "Path": ("AT", "RT"),
    "Corners": ("CR", "CO"),
    "Speed": ("AV", "RV", "FV"),
}
"""The criteria of each part of a test; those of an angle belong to that of the position."""


def meaning(name: str) -> str:
    """Return the full name of a criterion: "pose accuracy, rz"."""
    base, _, angle = name.partition("_")
    return f"{MEANING[base]}, {angle}" if angle else MEANING[base]


def criteria_of_part(part: str) -> list[str]:
    """Return the criteria of a part of a test, including those of angles, in the order of `UNITS`."""
    return [name for name in UNITS if name.partition("_")[0] in PARTS[part]]


def overall_of_part(test: IsoTest, part: str) -> list[Criterion]:
    """Return the criteria of a part of a test over all its places."""
    names = criteria_of_part(part)
    return [criterion for criterion in test.overall if criterion.name in names]


def _display_unit(unit: str) -> str:
    return "%" if unit == "1" else unit


def to_value(criterion: Criterion | None) -> Value | None:
    """Return a criterion as a value with its tolerance."""
    if criterion is None:
        return None
    return Value(
        criterion.value, _display_unit(criterion.unit), criterion.tolerance, criterion.verdict,
        criterion.utilisation, signed=criterion.name == "AV",
    )  # fmt: skip


def to_tolerance(criterion: Criterion) -> Value:
    """Return the tolerance of a criterion as a value."""
    return Value(criterion.tolerance, _display_unit(criterion.unit), given=True)


def sort_worst_first(criteria: Iterable[Criterion]) -> list[Criterion]:
    """Return criteria by falling utilisation of their tolerance, those without one last."""
    return sorted(criteria, key=lambda c: -1.0 if c.utilisation is None else c.utilisation, reverse=True)


def find_decisive(test: IsoTest, part: str = "") -> Criterion | None:
    """Return the criterion with the largest utilisation, of all or of a part; None without a verdict."""
    criteria = sort_worst_first(overall_of_part(test, part) if part else test.overall)
    return next((criterion for criterion in criteria if criterion.verdict is not None), None)


def find_worst_place(test: IsoTest, criterion: Criterion) -> str:
    """Return where a criterion is largest, such as "pose 3"; empty if it has no value."""
    return "" if criterion.value is None else test.worst_of(criterion.name).at or ""


def format_amount(value: float | None, unit: str, *, signed: bool = False) -> str:
    """Return a value in an SI unit as text: "0.1234 mm", "+1.5 %"."""
    return written(Value(value, _display_unit(unit), signed=signed), unit=True)


def format_criterion(criterion: Criterion) -> str:
    """Return a criterion with its tolerance: "AP 0.1234 mm of 0.4 mm allowed"."""
    value = to_value(criterion)
    return criterion.name if value is None else f"{criterion.name} {held(value)}"


def format_failure(test: IsoTest, criterion: Criterion) -> str:
    """Return why a criterion fails: its value, its tolerance, and where it is largest."""
    return f"{format_criterion(criterion)} at {find_worst_place(test, criterion)}"


def format_criteria(criteria: Sequence[Criterion]) -> str:
    """Return some criteria with their tolerances; of many the first, and the number of the others."""
    more = f" and {len(criteria) - MAX_NAMED} more" if len(criteria) > MAX_NAMED else ""
    return ", ".join(map(format_criterion, criteria[:MAX_NAMED])) + more


def format_tolerance(tolerance: Mapping[str, float]) -> str:
    """Return the tolerance of each criterion: "AP 0.4 mm, AV 5 %"."""
    limits = [(name, limit) for name, limit in tolerance.items() if name in UNITS]
    return ", ".join(
        f"{name} {allowed_words(Value(None, _display_unit(UNITS[name]), limit))}" for name, limit in limits
    )


def format_failed_cycle(cycle: FailedCycle) -> str:
    """Return the rows of a failed cycle, its distance from the command, and why it failed."""
    return f"{_rows_and_distance(cycle)}: {cycle.reason}"


def format_failed_cycles(cycles: Sequence[FailedCycle]) -> str:
    """Return which cycles failed; of many the first, and the number of the others."""
    more = f" and {len(cycles) - MAX_NAMED} more" if len(cycles) > MAX_NAMED else ""
    return ", ".join(f"{cycle.name} ({_rows_and_distance(cycle)})" for cycle in cycles[:MAX_NAMED]) + more


def _rows_and_distance(cycle: FailedCycle) -> str:
    rows = f"rows {cycle.row} to {cycle.last_row}"
    if cycle.distance is None:
        return rows
    return f"{rows}, up to {format_amount(cycle.distance, 'm')} off the path"


def not_judged_findings(test: IsoTest) -> list[Finding]:
    """Return why criteria with a tolerance have no verdict: they need more cycles than there are."""
    return [
        Finding(
            parameter="tolerance",
            found=f"{criterion.name} of {test.cycle_count}: not judged",
            allowed=f"{criterion.name} of {min_cycles(criterion.name)} cycles or more",
        )
        for criterion in test.not_judged
    ]


def criteria_tables(test: IsoTest) -> Iterator[Table]:
    """Yield the criteria over all with a verdict, the worst first, and those without a tolerance."""
    with_tolerance = [c for c in sort_worst_first(test.overall) if c.tolerance is not None]
    without = [criterion for criterion in test.overall if criterion.tolerance is None]
    heads: Heads[Criterion] = {
        "name": ("Criterion", lambda criterion: criterion.name),
        "verdict": ("Verdict", lambda criterion: Judged(criterion.verdict)),
        "value": ("value", to_value),
        "tolerance": ("tolerance", to_tolerance),
        "where": ("where", lambda criterion: find_worst_place(test, criterion)),
        "meaning": ("Meaning", lambda criterion: meaning(criterion.name)),
        "cycles": ("cycles", lambda criterion: Value(criterion.cycles)),
    }
    if with_tolerance:
        note = "After ISO 9283. The criterion that uses up most of its tolerance stands first."  # plain: ok
        columns = _without_cycles_in_brief(columns_of(with_tolerance, heads))
        yield Table("Criteria and their tolerances", columns, note, worst_first=True)
    if without:
        heads = {key: head for key, head in heads.items() if key not in ("verdict", "tolerance")}
        note = "After ISO 9283, each at the place where it is largest."
        title = "Other criteria" if with_tolerance else "Criteria"
        yield Table(title, _without_cycles_in_brief(columns_of(without, heads)), note)


def _without_cycles_in_brief(columns: Sequence[Column]) -> tuple[Column, ...]:
    return tuple(replace(column, brief=column.key != "cycles") for column in columns)


def criteria_rows(test: IsoTest) -> Table:
    """Return the table of `--csv`: one row per criterion and place, then per failed cycle, in SI units."""
    return rows_table("Criteria", COLUMNS, test.rows())


def cycles_table(test: IsoTest) -> Table:
    """Return the cycles: their rows, and the offsets of their clocks from the reference's."""
    heads: Heads[Cycle] = {
        "name": ("Cycle", lambda cycle: cycle.name),
        "row": ("first row", lambda cycle: Value(cycle.row)),
        "last_row": ("last row", lambda cycle: Value(cycle.last_row)),
        "sync_offset": ("offset", lambda cycle: Value(cycle.sync_offset, "s", signed=True)),
    }
    note = "Offset: time of the reference minus time of the cycle."
    return Table("Cycles", columns_of(test.cycles, heads), note, brief=False, folded=len(test.cycles) > 1)


def failed_table(test: IsoTest) -> Table:
    """Return the failed cycles: their rows, their distances from the command, and the reasons."""
    heads: Heads[FailedCycle] = {
        "name": ("Cycle", lambda cycle: cycle.name),
        "row": ("first row", lambda cycle: Value(cycle.row)),
        "last_row": ("last row", lambda cycle: Value(cycle.last_row)),
        "distance": ("largest distance", lambda cycle: Value(cycle.distance, "m")),
        "reason": ("Reason", lambda cycle: cycle.reason),
    }
    note = "Distance: from the path of the command. No criterion is of these cycles."
    return Table("Failed cycles", columns_of(test.failed_cycles, heads), note)


def pose_tables(test: IsoTest) -> Iterator[Table]:
    """Yield the criteria of each pose, and those of several poses together."""
    names = [name for name in criteria_of_part("Poses") if name not in PAIR_CRITERIA]
    if test.poses is not None:
        positions = _places(test.poses.command)
        yield Table("By pose", _by_place("Pose", test, names, {"place": ("x, y, z", positions)}))
    columns = _by_place("Poses", test, PAIR_CRITERIA, {})
    if len(columns[0].cells):
        yield Table("Between poses", columns, brief=False, folded=True)


def corner_table(test: IsoTest, path: CutPath) -> Table:
    """Return the criteria of each corner."""
    more = {"place": ("x, y, z", [Place(spot_at(corner.point)) for corner in path.corners])}
    return Table("By corner", _by_place("Corner", test, criteria_of_part("Corners"), more))


def leg_table(test: IsoTest, path: CutPath) -> Table:
    """Return the speed on each leg."""
    more = {
        "begins": ("from s", [Value(leg.begins, "m") for leg in path.legs]),
        "ends": ("to s", [Value(leg.ends, "m") for leg in path.legs]),
        "commanded": ("v_c", [Value(leg.commanded, "m/s") for leg in path.legs]),
        "mean": ("mean v", [Value(leg.mean, "m/s") for leg in path.legs]),
    }
    columns = _by_place("Leg", test, criteria_of_part("Speed"), more)
    return Table("By leg", columns, "The middle half of each leg counts.")


def plane_table(test: IsoTest, path: CutPath) -> Table:
    """Return the criteria at each plane that cuts the path."""
    more: Mapping[str, tuple[str, Sequence[Cell]]] = {
        "s": ("s", [Value(float(s), "m") for s in path.s]),
        "place": ("x, y, z", _places(path.command)),
    }
    columns = _by_place("Plane", test, criteria_of_part("Path"), more)
    return Table("By plane", columns, brief=False, folded=True)


def _places(position: FloatArray) -> list[Cell]:
    """Return positions in [m], shape (n, 3), as cells."""
    return [Place(spot_at(point)) for point in position]


def _by_place(
    title: str, test: IsoTest, names: Sequence[str], more: Mapping[str, tuple[str, Sequence[Cell]]]
) -> tuple[Column, ...]:
    """Return one row per place of some criteria, and one column per criterion that has a value there.

    Args:
        title: The kind of the places.
        test: The test.
        names: The criteria.
        more: Further columns, one cell per place.
    """
    by_place = {(c.at, c.name): c for c in test.criteria if c.at is not None and c.name in names}
    places = list(dict.fromkeys(at for at, _ in by_place))
    known = [name for name in UNITS if name in names and any(name == other for _, other in by_place)]
    cells = {name: [to_value(by_place.get((place, name))) for place in places] for name in known}
    return (
        Column("at", title, places),
        *(Column(name, name, cells[name], brief=name.rpartition("_")[2] not in ANGLES) for name in known),
        *(Column(key, head, values, brief=key != "place") for key, (head, values) in more.items()),
    )
