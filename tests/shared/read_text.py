"""Calls for cases of reading: a text becomes log.csv, and lines show what is read of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.errors import Message, UrmpipeError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, format_map, map_of, read_log, read_map
from urmpipe_pipeline.logs.log_map import read_options

Texts = str | bytes | Mapping[str, str | bytes]
Robot = Chain | str | int | None


def arm(count: int, *kinds: str, names: Iterable[str] = ()) -> Chain:
    """Return an arm of so many joints: phi1, phi2, ... by default, and revolute."""
    called = tuple(names) or tuple(f"phi{k + 1}" for k in range(count))
    pairs = zip(called, kinds or ("revolute",) * count, strict=True)
    return Chain("arm", tuple(Joint(name, kind=kind) for name, kind in pairs))  # type: ignore[arg-type]


def csv(names: str, *columns: Any, decimals: int = 6, sign: str = ",") -> str:
    """Return a table of columns, each an array of one or two dimensions; without names it has no header."""
    rows = np.column_stack([np.asarray(column, dtype=float) for column in columns]).tolist()
    lines = [sign.join(f"{value:.{decimals}f}" for value in row) for row in rows]
    return "\n".join([*([names] if names else []), *lines, ""])


def log_of(
    texts: Texts, robot: Robot = None, name: str = "log.csv", encoding: str = "utf-8", **options: Any
) -> JointLog:
    """Write a text, or several by their names, and read them; an int is an arm of so many joints."""
    files = texts if isinstance(texts, Mapping) else {name: texts}
    for file, text in files.items():
        Path(file).write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    chain = arm(robot) if isinstance(robot, int) else load_robot(robot) if isinstance(robot, str) else robot
    return read_log([Path(file) for file in files], LogMap(**options), chain)


def read(texts: Texts, robot: Robot = None, **options: Any) -> str:
    """Return lines of a log: its rows, each column that is used, in SI, and the kinds of its warnings."""
    return shown(log_of(texts, robot, **options))


def shown(log: JointLog) -> str:
    """Return lines of a log."""
    marks = [f"{log.rows} {'rows' if log.timed else 'poses'}"]
    marks += [log.source] if log.source != "table" else []
    marks += [f"{log.digits} digits"] if log.digits else []
    marks += ["measured from outside"] if log.externally_measured else []
    if log.timed:
        clock = [f"{column.name} [{column.unit}]" for column in log.columns if column.role == "time"]
        marks.append(f"{', '.join(clock) or 'no clock'}: {_some(log.t_ns)} ns from {log.clock_start_ns}")
    lines = ["; ".join(marks)]
    if log.joints:
        joints = zip(log.joints, log.q.T, strict=True)
        lines.append("; ".join(f"{name} [{log.units.get(name)}] {_some(values)}" for name, values in joints))
    for what in ("qd", "qdd", "tcp_position", "tcp_rotation", "tcp_quat_xyzw"):
        if (rows := getattr(log, what)) is not None:
            form = f" {log.rotation_form}" if what == "tcp_rotation" else ""
            lines.append(f"{what}{form}: {'; '.join(map(_some, rows.T))}")
    kinds = [one.kind + (f" {one.row}" if one.row else "") for one in log.warnings]
    return "\n".join([*lines, *([f"warnings: {', '.join(kinds)}"] if kinds else [])])


def _some(values: Any) -> str:
    """Return the numbers of a column: all of four, else the first two, the last, and their mean."""
    if len(values) <= 4:
        return " ".join(map(_short, values.tolist()))
    first, second, last = map(_short, values[[0, 1, -1]].tolist())
    return f"{first} {second} ... {last}, mean {_short(float(np.nanmean(values)))}"


def _short(value: float) -> str:
    return f"{round(value, 9) + 0.0:.6g}" if isinstance(value, float) else str(value)


def complaints(texts: Texts, robot: Robot = None, **options: Any) -> str:
    """Return the warnings in whole."""
    warnings = log_of(texts, robot, **options).warnings
    return "\n".join(f"{one.kind}{f' {one.row}' if one.row else ''}: {one}" for one in warnings)


def evidence(what: str, texts: Texts, robot: Robot = None, **options: Any) -> str:
    """Return what was inferred by a name, with its evidence."""
    inferred = [one for one in log_of(texts, robot, **options).inferences if one.what == what]
    return "\n".join(f"{one.value}: {one.evidence}" for one in inferred)


def follow(texts: Texts, robot: Robot = None, **options: Any) -> str:
    """Return what each answer that a question or a warning prints leads to: a log without this complaint."""
    lines = []
    for message in _messages(texts, robot, options):
        for hint in message.hints:
            if not hint.parameter or hint.value is None:
                continue
            try:
                log = log_of(texts, robot, **_with(options, hint.parameter, hint.value))
                assert message.message not in [one.message for one in log.warnings], str(hint)
                columns = [f"{column.name} [{column.unit}]" for column in log.columns]
                lines.append(f"{hint}: {log.rows} rows, {' '.join(columns)}")
            except UrmpipeError as error:
                lines.append(f"{hint}: {error}")
    return "\n".join(lines)


def _messages(texts: Texts, robot: Robot, options: dict[str, Any]) -> list[Message]:
    try:
        return list(log_of(texts, robot, **options).warnings)
    except UrmpipeError as error:
        return list(error.findings)


def _with(options: dict[str, Any], parameter: str, value: Any) -> dict[str, Any]:
    answered = read_options({parameter: value}, LogMap(**options))
    return options | {parameter: getattr(answered, parameter)}


def again(texts: Texts, robot: Robot = None, **options: Any) -> str:
    """Return the map of a log, after it read the log alike without the robot, with the same assumptions."""
    log = log_of(texts, robot, **options)
    Path("map.toml").write_text(text := format_map(map_of(log, LogMap(**options))), encoding="utf-8")
    files = [Path(file) for file in (texts if isinstance(texts, Mapping) else ["log.csv"])]
    same = read_log(files, read_map(Path("map.toml")))
    assert (same.joints, same.units, same.columns) == (log.joints, log.units, log.columns)
    for name in ("t_ns", "q", "qd", "tcp_position", "tcp_rotation"):
        np.testing.assert_array_equal(getattr(same, name), getattr(log, name))
    assumed = [[one.assumption for one in each.warnings if one.assumption] for each in (log, same)]
    assert assumed[0] == assumed[1], assumed
    return "\n".join(line for line in text.splitlines() if line and not line.startswith("#"))
