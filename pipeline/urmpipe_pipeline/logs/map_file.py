"""Maps of logs as TOML: what was found of one log, or is known of a lab's logs, reads the next ones.

- `read_map`: the map of a file.
- `map_of`: the map by which a log reads as it was read, with the evidence of each entry.
- `format_map`: a map as TOML with the evidence as comments; a unit that is only assumed is a comment.

docs/logs.md has an example: "The map".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from urmpipe_models.errors import Finding, OptionError, escape_line
from urmpipe_models.toml_tables import CheckedTable, format_toml, quote_toml, read_toml
from urmpipe_pipeline.joint_log import Basis, Inference, JointLog, LogColumn, Role
from urmpipe_pipeline.logs.clock import TIME_FILE, split_file_column
from urmpipe_pipeline.logs.formats.opening import PATH, TABLE
from urmpipe_pipeline.logs.formats.shape import ROWS_READ
from urmpipe_pipeline.logs.log_map import KEYS, READING, TABLES, Evidence, LogMap
from urmpipe_pipeline.logs.rotation import PURE
from urmpipe_pipeline.logs.vocabulary import split_unit, vocabulary
from urmpipe_pipeline.outputs import MAP_HEADER

FRAME_UNITS = ("m", "m", "m", "rad", "rad", "rad")

CORRECTIONS = (
    "# signs = [1, -1, ...] and offsets = [0, 90, ...] correct the joints: q = sign * value + offset.",
    "# interval.q1 = [-180, 180] is the interval to which the program limits a joint.",
)
"""What may be added to a map by hand."""

NOTES = (
    *("encoding", "header", "labels", "arrays", "program", ROWS_READ),
    *("clock", "form of the time", "columns not used"),
)
"""Kinds of inferences that are no entries of a map."""


UNITS = ("unit", "form", "unit of the time")
"""Kinds of inferences about units."""

ENTRIES = {
    **{"delimiter": "delimiter", "decimal": "decimal sign", "layout": "layout", "source": "source"},
    **{"time": "time column", "period": "period", "poses": "rows", "joints": "joint columns"},
    **{"position": "{tcp} TCP", "measured": "{tcp} TCP", "orientation": "{tcp} orientation"},
    **{"rotation": "form", "robot": "robot"},
}
"""Entries, and the kinds of inferences that state their evidence."""


def read_map(path: Path) -> LogMap:
    """Return the map of a file.

    Raises:
        OptionError: With everything that is wrong with it.
    """
    faults: list[Finding] = []
    table = CheckedTable(read_toml(path, OptionError), faults, str(path))
    values: dict[str, Any] = {}
    for key in (*KEYS, *TABLES):
        if not table.has(key):
            continue
        if key == "period":
            values[key] = table.number(key, si="s")
        elif key in ("base", "tool"):
            values[key] = [*table.numbers(key, None, si=FRAME_UNITS)]
        else:
            values[key] = table.value(key)
        try:
            LogMap(**{key: values[key]})
        except OptionError as error:
            del values[key]
            for finding in error.findings:
                table.add_error(key, f"found {finding.found}, allowed: {finding.allowed}")
    table.report_unknown_keys()
    if faults:
        raise OptionError(*faults)
    result = LogMap(**values)
    time, file = f"{path.parent / str(result.time)}", result.robot and Path(result.robot)
    return replace(
        result,
        time=time if result.time and split_file_column(time) else result.time,
        robot=str(path.parent / file) if file and file.suffix else result.robot,
    )


def map_of(
    log: JointLog,
    options: LogMap | None = None,
    robot: str | None = None,
    base: Sequence[float] = (),
    tool: Sequence[float] = (),
) -> LogMap:
    """Return the map by which a log reads as it was read, with the evidence of its entries.

    Args:
        log: The log.
        options: The map with which it was read.
        robot: Name or file of the arm.
        base: Its frame: X, Y, Z[, RX, RY, RZ] in [m] and [rad]; nothing for the origin.
        tool: Its tool centre point, in the same form; nothing for the tip.
    """
    options = options or LogMap()
    by_kind = {inference.kind: inference for inference in log.inferences}
    values: dict[str, Any] = {
        name: getattr(options, name) for name in READING if name not in ("shared", "pair")
    }
    values |= {"robot": robot, "base": tuple(base), "tool": tuple(tool)}
    values["source"] = log.source if options.source or log.source != TABLE else None
    values |= file_entries(log.inferences)
    values |= _clock_entries(log, by_kind, options)
    joints, position, rotation = (_columns(log, role) for role in ("joint", "position", "rotation"))
    signs, offsets = tuple(c.sign for c in joints), tuple(c.offset for c in joints)
    values |= {"signs": signs if -1 in signs else (), "offsets": offsets if any(offsets) else ()}
    values |= {"joints": _names(log, joints), "rotation": log.rotation_form if rotation else None}
    numbered = tuple(f"q{k}" for k in range(1, len(joints) + 1))
    if joints and not joints[0].header and log.joints != numbered:
        values["names"] = log.joints  # those of the robot
    place, turn, outside = _names(log, position), _names(log, rotation), log.externally_measured
    values |= {"measured": place + turn if outside else ()}
    values |= {"position": () if outside else place, "orientation": () if outside else turn}
    values["unit"] = _unit_entries(log, by_kind, options, values["time"])
    intervals = {name: options.interval.get(name, options.interval.get("")) for name in log.joints}
    values["interval"] = {
        name: ends
        for (name, ends), unit in zip(intervals.items(), log.joint_units, strict=False)
        if ends and unit == "rad"
    }
    return LogMap(**values, evidence=dict(_evidence(log, by_kind, options)))


def file_entries(inferences: Sequence[Inference]) -> dict[str, Any]:
    """Return delimiter, decimal sign and layout of the files, and the notes, of what was inferred."""
    by_kind = {inference.kind: inference for inference in inferences}
    kinds = {field: ENTRIES[field] for field in ("delimiter", "decimal", "layout")}
    entries: dict[str, Any] = {
        field: by_kind[kind].value if kind in by_kind else None for field, kind in kinds.items()
    }
    notes = (by_kind[kind] for kind in NOTES if kind in by_kind)
    return entries | {"notes": tuple(f"{note.what}: {note.value} ({note.evidence})" for note in notes)}


def _clock_entries(log: JointLog, by_kind: Mapping[str, Inference], options: LogMap) -> dict[str, Any]:
    """Return time, period and poses; a stamp in halves and a file of times are found again.

    A file whose column was given as the time is entered with its whole path.
    """
    columns = _columns(log, "time")
    if not log.timed:
        labels = by_kind["time column"].columns if "time column" in by_kind else ()
        time = labels[0] if len(labels) == 1 else None if labels else "none"
        return {"time": time, "period": None, "poses": True}
    if not columns:
        return {"time": "none", "period": log.period or None, "poses": False}
    file = split_file_column(options.time)
    if len(columns) > 1 or (TIME_FILE in by_kind and not file):
        return {"time": None, "period": None, "poses": False}
    time = f"{file[0].resolve()}:{file[1]}" if file else _name(log, columns[0])
    return {"time": time, "period": None, "poses": False}


def _unit_entries(
    log: JointLog, by_kind: Mapping[str, Inference], options: LogMap, time: str | None
) -> dict[str, str]:
    """Return the units of the columns; of the clock where it is one column of numbers, or options."""
    clock, file = _columns(log, "time"), split_file_column(time)
    names = {name for c in clock for name in (c.name, c.header, str(c.number)) if name}
    units = {name: unit for name, unit in options.unit.items() if name in names}
    named = any(vocabulary().unit(split_unit(column.header)[1] or "") for column in clock)
    if len(clock) == 1 and "unit of the time" in by_kind and time and not named:
        units = {file[1] if file else time: clock[0].unit}
    used = [column for column in log.columns if column.role in ("joint", "position", "rotation")]
    return units | {_name(log, column): column.unit for column in used if column.unit != PURE.name}


def _evidence(
    log: JointLog, by_kind: Mapping[str, Inference], options: LogMap
) -> Iterator[tuple[str, Evidence]]:
    """Yield the evidence of the entries, by field or "unit.COLUMN"."""
    tcp = "measured" if log.externally_measured else "recorded"
    kinds = {field: kind.format(tcp=tcp) for field, kind in ENTRIES.items()}
    kinds |= {"source": "path"} if log.source == PATH and not options.source else {}
    for field, kind in kinds.items():
        if inference := by_kind.get(kind):
            basis: Basis = "given" if getattr(options, field) else inference.basis
            yield field, Evidence(basis, inference.evidence)
    units = {name: each for each in log.inferences if each.kind in UNITS for name in each.columns}
    assumed_time = [
        warning.message for warning in log.warnings if warning.assumption and warning.role == "time"
    ]
    for column in log.columns:
        unit = units.get(column.name)
        basis, why = (unit.basis, unit.evidence) if unit else ("named", "its name")
        if {column.name, column.header, str(column.number)} & (options.unit.keys() - {""}):
            basis = "given"
        if column.role == "time" and assumed_time:
            basis, why = "assumed", assumed_time[0]
        elif column.uncertainty:
            basis, why = "assumed", column.uncertainty
        yield f"unit.{_name(log, column)}", Evidence(basis, why)


def _columns(log: JointLog, role: Role) -> list[LogColumn]:
    return [column for column in log.columns if column.role == role]


def _names(log: JointLog, columns: Sequence[LogColumn]) -> tuple[str, ...]:
    return tuple(_name(log, column) for column in columns)


def _name(log: JointLog, column: LogColumn) -> str:
    """Return what distinguishes a column: its header, or its number where several share that."""
    duplicates = [other for other in log.columns if other.header == column.header]
    return column.header if column.header and len(duplicates) == 1 else str(column.number)


def format_map(log_map: LogMap) -> str:
    """Return a map as TOML: each entry with its evidence after it, what is only assumed as a comment."""
    lines = [MAP_HEADER, *(f"# {note}" for note in log_map.notes), ""]
    for key in KEYS:
        value = getattr(log_map, key)
        if value not in (None, (), False):
            lines += _lines(key, value, log_map.evidence.get(key))
    lines += ["", *CORRECTIONS] if log_map.joints and not (log_map.signs or log_map.offsets) else []
    for table in TABLES:
        entries = getattr(log_map, table)
        lines += ["", f"[{table}]"] if entries else []
        for name, value in entries.items():
            lines += _lines(quote_toml(name), value, log_map.evidence.get(f"{table}.{name}"))
    for question in log_map.questions:
        lines += ["", f"# open: {replace(question, hints=())}"]
        lines += [f"#   {hint}  # {hint.effect}" for hint in question.hints if str(hint)]
    return "\n".join(lines) + "\n"


def _lines(key: str, value: Any, evidence: Evidence | None) -> Iterator[str]:
    (text,) = format_toml({"": list(value) if isinstance(value, tuple) else value})
    text = f"{key}{text}"
    if evidence is None:
        yield text
        return
    open_entry = evidence.basis == "assumed" and (key in ("period", "joints") or key.startswith('"'))
    why = evidence.basis if evidence.basis == "given" else f"{evidence.basis}: {evidence.why}"
    yield f"{'# ' if open_entry else ''}{text}  # {escape_line(why)}"
