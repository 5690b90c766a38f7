"""The tables of a test after ISO 9283: criteria over all and by place, and the cycles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.criteria import ANGLES, UNITS, Criterion
from urmpipe_pipeline.iso9283.result import CutPath, Cycle, FailedCycle, IsoTest
from urmpipe_pipeline.iso9283.wording import meaning, names_of, tolerance_of, value_of, where, worst_first
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
