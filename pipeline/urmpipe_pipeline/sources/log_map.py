"""Maps: what a lab says once about its logs - columns, units, order, signs, offsets, clock, base, tool.

docs/logs.md has an example: "Maps and defaults".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, OptionError, escape_line, format_value
from urmpipe_models.math3d import FORMS
from urmpipe_models.toml_tables import CheckedTable, format_toml, quote_toml, read_toml
from urmpipe_pipeline.joint_log import JointLog, LogColumn, Role
from urmpipe_pipeline.outputs import MAP_HEADER
from urmpipe_pipeline.sources.clocks.time_file import TIME_FILE, named_file
from urmpipe_pipeline.sources.options import GivenInterval, ReadOptions, is_interval
from urmpipe_pipeline.sources.units.rotation import PURE
from urmpipe_pipeline.sources.vocabulary import split_unit, vocabulary

T = TypeVar("T")

CORRECTIONS = (
    "# Where the file counts a joint otherwise: sign = -1, offset = 90 (q = sign * value + offset).",
    "# What the environment limits it to: interval = [-180, 180].",
)
"""What may be added to the joints of a map by hand."""

TURNING = ("rad", "deg")
"""Units of joints that turn: they alone have an interval."""


@dataclass(frozen=True, slots=True)
class LogMap:
    """What a map says.

    Attributes:
        read: How to read a log.
        robot: Name or file of the arm, or None.
        base: Where it stands: X, Y, Z[, RX, RY, RZ] in [m] and [rad], or nothing.
        tool: Its tool centre point, in the same form.
    """

    read: ReadOptions = field(default_factory=ReadOptions)
    robot: str | None = None
    base: tuple[float, ...] = ()
    tool: tuple[float, ...] = ()


def read_map(path: Path) -> LogMap:
    """Return what a map says.

    Raises:
        OptionError: With everything that is wrong with it.
    """
    faults: list[Finding] = []
    table = CheckedTable(read_toml(path, OptionError), faults, str(path))
    clock, tcp = table.table("clock"), table.table("tcp")
    joints = table.tables("joints") if table.has("joints") else []
    units = table.mapping("units")
    columns = [_joint(joint, units) for joint in joints]
    names = tuple(name for _, name, _, _ in columns)
    intervals = zip(names, (_interval(joint) for joint in joints), strict=True)
    time = _time_beside(path, _given(clock, "column", clock.text))
    apart = named_file(time)
    _note_unit(clock, apart[1] if apart else time or None, units)
    robot = _given(table, "robot", table.text)
    position = _given(tcp, "position", tcp.texts) or ()
    orientation = _given(tcp, "orientation", tcp.texts) or ()
    outside = tcp.flag("measured")
    result = LogMap(
        ReadOptions(
            source=_given(table, "source", table.text),
            delimiter=_given(table, "delimiter", table.text),
            decimal=_given(table, "decimal", table.text),
            layout=_given(table, "layout", table.text),
            time=time,
            period=_given(clock, "period", partial(clock.number, si="s")),
            joints=tuple(column for column, _, _, _ in columns),
            names=names,
            signs=tuple(sign for _, _, sign, _ in columns),
            offsets=tuple(offset for _, _, _, offset in columns),
            position=() if outside else position,
            orientation=() if outside else orientation,
            measured=(*position, *orientation) if outside else (),
            rotation=tcp.choice("form", FORMS) if tcp.has("form") else None,  # type: ignore[arg-type]
            unit=units,
            interval={name: interval for name, interval in intervals if interval},
            poses=clock.flag("poses"),
        ),
        robot=_beside(path, robot) if robot else None,
        base=_frame(table, "base"),
        tool=_frame(table, "tool"),
    )
    for part in (table, clock, tcp, *joints):
        part.report_unknown_keys()
    if faults:
        raise OptionError(*faults)
    return result


def map_of(
    log: JointLog,
    robot: str | None = None,
    base: Sequence[float] = (),
    tool: Sequence[float] = (),
    *,
    given: Mapping[str, Any] | None = None,
) -> str:
    """Return the map by which a log reads as it was read, as TOML.

    Args:
        log: The log.
        robot: Name or file of the arm.
        base: Where it stands, in [m] and [rad]; nothing for the origin.
        tool: Its tool centre point, in the same form; nothing for the tip.
        given: Fields of the `ReadOptions` it was read with; the intervals and the units of the clock stand
            nowhere else.
    """
    asked = given or {}
    intervals = asked.get("interval", {})
    found = {inference.kind: inference.value for inference in log.inferences}
    top = {
        "source": log.source,
        "delimiter": found.get("delimiter"),
        "decimal": {"point": ".", "comma": ","}.get(found.get("decimal sign", "")),
        "layout": found.get("layout"),
        "robot": robot,
        "base": list(base) or None,
        "tool": list(tool) or None,
    }
    clock = _clock(log, found, asked.get("time"))
    lines = [MAP_HEADER, "", *format_toml(top), "", "[clock]", *format_toml(clock)]
    lines += ["", *CORRECTIONS] if log.joints else []
    for column, name in zip(_of(log, "joint"), log.joints, strict=True):
        said: dict[str, Any] = {"column": _called(log, column), "name": name}
        said |= {} if column.uncertainty else {"unit": column.unit}
        corrected = {"sign": column.sign, "offset": column.offset}
        said |= corrected if corrected != {"sign": 1, "offset": 0.0} else {}
        interval = intervals.get(name, intervals.get(""))
        said |= {"interval": list(interval)} if interval and column.unit in TURNING else {}
        lines += ["", "[[joints]]", *format_toml(said)]
        lines += [_assumed("unit", column.unit, column.uncertainty)] if column.uncertainty else []
    position, orientation = _of(log, "position"), _of(log, "rotation")
    if position:
        said = {"position": [_called(log, column) for column in position]}
        turned = {"orientation": [_called(log, column) for column in orientation], "form": log.rotation_form}
        said |= turned if orientation else {}
        lines += ["", "[tcp]", *format_toml(said | ({"measured": True} if log.externally_measured else {}))]
    measured = [column for column in (*position, *orientation) if column.unit != PURE.name]
    units = {_called(log, column): column.unit for column in measured if not column.uncertainty}
    timed = {name for c in _of(log, "time") for name in (c.name, c.header, str(c.number)) if name}
    units |= {name: unit for name, unit in asked.get("unit", {}).items() if name in timed}
    told = [f"{quote_toml(one)} = {quote_toml(unit)}" for one, unit in units.items()]
    told += [_assumed(quote_toml(_called(log, c)), c.unit, c.uncertainty) for c in measured if c.uncertainty]
    lines += ["", "[units]", *told] if told else []
    return "\n".join(lines) + "\n"


def _joint(table: CheckedTable, units: dict[str, str]) -> tuple[str, str, int, float]:
    """Return column, name, sign and offset of a joint, and note its unit."""
    column = table.text("column")
    sign = table.number("sign", 1.0)
    if sign not in (1.0, -1.0):
        table.add_error("sign", f"found {sign:g}, allowed: 1 or -1")
    _note_unit(table, column, units)
    return column, table.text("name", column), int(sign), table.number("offset", 0.0)


def _interval(table: CheckedTable) -> GivenInterval | None:
    """Return the interval of a joint, if the table has one."""
    if not table.has("interval"):
        return None
    given = table.value("interval")
    if is_interval(given):
        return given[0], given[1]
    table.add_error(
        "interval", f"found {format_value(given)}, allowed: 2 finite numbers, or two angles with units"
    )
    return None


def _note_unit(table: CheckedTable, column: str | None, units: dict[str, str]) -> None:
    """Note the unit of a column, if the table has both."""
    unit = _given(table, "unit", table.text)
    if column is not None and unit is not None:
        units[column] = unit


def _given(table: CheckedTable, key: str, get: Callable[[str], T]) -> T | None:
    """Return what is got of a table under a key, if it is there."""
    return get(key) if table.has(key) else None


def _frame(table: CheckedTable, key: str) -> tuple[float, ...]:
    """Return three or six numbers, or nothing."""
    if not table.has(key):
        return ()
    values = table.numbers(key, None, si=("m", "m", "m", "rad", "rad", "rad"))
    if len(values) not in (3, 6):
        count = format_count(len(values), "number")
        table.add_error(key, f"found {count}, allowed: X, Y, Z or X, Y, Z, RX, RY, RZ in m and rad")
    return values


def _beside(path: Path, robot: str) -> str:
    """Return a robot's name, or its file as seen from the map's folder."""
    return str(path.parent / robot) if Path(robot).suffix else robot


def _time_beside(path: Path, time: str | None) -> str | None:
    """Return a time column; of FILE:COLUMN the file as seen from the map's folder."""
    beside = f"{path.parent / time}" if time else None
    return beside if named_file(beside) else time


def _of(log: JointLog, role: Role) -> list[LogColumn]:
    return [column for column in log.columns if column.role == role]


def _called(log: JointLog, column: LogColumn) -> str:
    """Return what tells a column from all others: its header, or its number where that does not."""
    twins = [other for other in log.columns if other.header == column.header]
    return column.header if column.header and len(twins) == 1 else str(column.number)


def _assumed(key: str, unit: str, doubt: str) -> str:
    """Return the comment that stands for a unit that is only assumed: read by a map it would be given."""
    return f"# {key} = {quote_toml(unit)}  # {escape_line(doubt)}"


def _clock(log: JointLog, found: Mapping[str, str], given: str | None = None) -> dict[str, Any]:
    """Return what the table of the clock says; a stamp in halves and a file of times are found by themselves.

    A file whose column was named as the time stands there with its whole path.

    The unit is left out where the cells or the name of the column say it, and where it or the period is only
    assumed: read by a map that would be given.
    """
    assumed = any(one.assumption and one.role == "time" for one in log.warnings)
    columns = _of(log, "time")
    if not log.timed:
        labels = next((one.columns for one in log.inferences if one.what == "time column"), ())
        return {"column": labels[0] if len(labels) == 1 else None if labels else "none", "poses": True}
    if not columns:
        return {"column": "none", "period": None if assumed else log.period or None}
    apart = any(one.kind == TIME_FILE for one in log.inferences)
    file = named_file(given)
    if len(columns) > 1 or (apart and not file):
        return {}
    named = vocabulary().unit(split_unit(columns[0].header)[1] or "") is not None
    unit = None if named or assumed else found.get("unit of the time")
    column = f"{file[0].resolve()}:{file[1]}" if apart and file else _called(log, columns[0])
    return {"column": column, "unit": unit}
