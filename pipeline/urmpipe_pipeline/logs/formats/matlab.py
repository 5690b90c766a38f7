"""Variables of MATLAB, Octave and SciPy as tables, and other HDF5 files.

1. `read_mat`: MAT 5. `read_hdf5`: MAT 7.3 and Octave's HDF5, whose variables are read alike, or datasets.
2. `_make_variable_table`: vectors and matrices of one length, also of structs and of signals of Simulink.
3. Files of urmpipe's own export: a run on its grid, the rows of a log's file, a simulation.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.array_choice import Name, choose_arrays
from urmpipe_pipeline.logs.formats.arrays import make_array_table, settle_choice, spread_array
from urmpipe_pipeline.logs.formats.clock_forms import EXPONENTS
from urmpipe_pipeline.logs.formats.files import read_separately
from urmpipe_pipeline.logs.formats.memory import UNIT, MemoryTable, arrow_column
from urmpipe_pipeline.logs.formats.text import check_unpacked_size, unpacked_limit
from urmpipe_pipeline.logs.formats.urmpipe_tables import ORDERS, POINT, RECORDED, decimals, with_roles
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.outputs import EXPORT_HEADER

# What writes objects of classes as CSV: a MAT file stores their numbers in another form.
_COMMANDS = {"table": "writetable(NAME", "timetable": "writetimetable(NAME"}
_SIGNAL_CLASSES = ("timeseries", "Simulink.")
_HEADER, _COMPRESSED = 128, 15  # bytes before the first variable; the kind of a variable that is packed


def read_mat(path: Path, head: bytes, options: LogMap) -> MemoryTable:
    """Return the table of a MAT file of version 5.

    Raises:
        LogError: If it is damaged, or has no numbers with one row per sample; with a question if it has
            several episodes, or arrays of several lengths.
    """
    check_unpacked_size(path, _unpacked_size(path))
    variables = read_separately(path, "a MAT file", "mat")
    if EXPORT_HEADER.encode() in head:
        run, simulated = variables.get("run"), variables.get("simulation")
        if isinstance(run, Mapping) and "rows" in run:
            table = _grid_table(run) if run["rows"] == "grid" else _file_table(run)
            return MemoryTable(path.stem, table, path=path)
        if isinstance(simulated, Mapping) and "values" in simulated:
            return MemoryTable(path.stem, _simulation_table(simulated), path=path)
    return _make_variable_table(path, variables, options)


def read_hdf5(path: Path, options: LogMap) -> MemoryTable:
    """Return the table of an HDF5 file; errors as those of `read_mat`."""
    most = str(unpacked_limit(path.stat().st_size))
    arguments = (most, options.episode or "", options.topic or "")
    contents = read_separately(path, "an HDF5 file", "hdf5", *arguments)
    check_unpacked_size(path, contents.size)
    if contents.variables is not None:
        return _make_variable_table(path, contents.variables, options)
    assert contents.choice is not None
    choice = settle_choice(path, contents.choice)
    not_read = [f"{name} {shape}" for name, shape in contents.not_read]
    if not contents.columns:
        shown = ", ".join(not_read[:8]) or "no dataset"
        allowed = "datasets of numbers with one row per sample, such as t (n,) and q (n, joints)"
        raise LogError(Finding(file=str(path), found=shown, allowed=allowed))
    return make_array_table(path, choice, contents.columns, contents.scalars, "/", options, not_read)


def _unpacked_size(path: Path) -> int:
    """Return the bytes that the variables of a MAT 5 file state that they unpack to."""
    total = 0
    with path.open("rb") as file:
        order = "<" if file.read(_HEADER)[-2:] == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            start = file.tell()
            if kind == _COMPRESSED:
                with suppress(zlib.error):  # damaged: reading reports it
                    tag = zlib.decompressobj().decompress(file.read(256), 8)
            total += struct.unpack(f"{order}II", tag)[1] if len(tag) == 8 else 0
            file.seek(start + length)
    return total


# Variables


def _make_variable_table(path: Path, variables: Mapping[str, Any], options: LogMap) -> MemoryTable:
    arrays = dict(_iter_arrays({name: _read_signals(name, value) for name, value in variables.items()}))
    shapes = {name: values.shape for name, values in arrays.items()}
    read = choose_arrays(shapes, options.episode, options.topic, separator=".", by_rows=False)
    choice = settle_choice(path, read)
    objects = {name: (kind, _csv_command(name, kind)) for name, kind in _iter_objects(variables)}
    if choice.rows < 2:
        shown = (f"{name} ({objects[name][0]})" if name in objects else name for name in [*variables][:8])
        command = next((command for _, command in objects.values() if command), "")
        command = command or f'writetable(T, "log.csv") of a table, or save("{path.name}", "t", "q")'
        hint = Hint("", effect=f"in MATLAB: {command}")
        fault = f"found no numbers with one row per sample in {', '.join(shown) or 'it'}"
        allowed = "such as t (n x 1), q (n x joints)"
        raise LogError(Finding(f"{fault}, allowed: {allowed}", str(path), hints=(hint,)))
    depth = len(choice.group)
    columns = (
        column for name in choice.names for column in spread_array(name[depth:], arrays[name], choice.rows)
    )
    scalars = {name: value for name, value in variables.items() if isinstance(value, (int, float))}
    left_out = [".".join(name) + f" {arrays[name].shape}" for name in choice.left_out]
    left_out += [f"{name} ({kind})" for name, (kind, command) in objects.items() if command]
    return make_array_table(path, choice, columns, scalars, ".", options, left_out, is_named=True)


def _csv_command(name: str, kind: str) -> str:
    """Return the command of MATLAB that writes an object of a class as CSV; empty for other objects."""
    is_signal = kind.startswith(_SIGNAL_CLASSES)
    start = "writetimetable(extractTimetable(NAME)" if is_signal else _COMMANDS.get(kind)
    return f'{start.replace("NAME", name)}, "log.csv")' if start else ""


def _iter_arrays(value: Any, name: Name = ()) -> Iterator[tuple[Name, NDArray[Any]]]:
    """Yield vectors and matrices of numbers by name, those of structs and of arrays of structs as well."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and value.ndim <= 2 and value.size > 1:
        yield name, value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _iter_arrays(inner, (*name, key))
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        for k, inner in enumerate(np.ravel(value) if isinstance(value, np.ndarray) else value, start=1):
            yield from _iter_arrays(inner, (*name[:-1], f"{name[-1]}({k})"))


def _iter_objects(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """Yield name and class of each object of a class."""
    if isinstance(value, tuple):
        yield name, value[1]
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _iter_objects(inner, f"{name}.{key}" if name else key)


def _read_signals(name: str, value: Any) -> Any:
    """Return a variable with the signals of Simulink as arrays by their labels.

    Structures with time have `time` and `signals`, with `values` of shape (n, k) or (i, j, n), `label` and
    `blockName`. Timeseries as structs have `Time`, `Data` and `Name`, those of a Dataset in `Values`.
    """
    if isinstance(value, list):
        return [_read_signals(name, item) for item in value]
    if not isinstance(value, Mapping):
        return value
    name = _text(value.get("Name")) or name
    if isinstance(value.get("Values"), Mapping):
        return _read_signals(name, value["Values"])
    signals = value.get("signals", ())
    signals = signals if isinstance(signals, list) else [signals]
    if signals and all(isinstance(item, Mapping) and "values" in item for item in signals):
        blocks = [_text(item.get("blockName")).rpartition("/")[2] * (len(signals) > 1) for item in signals]
        labels = [_text(item.get("label")) or block for item, block in zip(signals, blocks, strict=True)]
        arrays = [item["values"] for item in signals]
    elif {"Time", "Data"} <= value.keys():
        labels, arrays = [name], [value["Data"]]
    else:
        return {key: _read_signals(key, inner) for key, inner in value.items()}
    labels = [label or name for label in labels]
    numbered = [f"{label}_{k}" for k, label in enumerate(labels, start=1)]
    read = {"time": value.get("time", value.get("Time"))}
    for label, other, values in zip(labels, numbered, arrays, strict=True):
        by_last_axis = isinstance(values, np.ndarray) and values.ndim == 3
        rows = values.reshape(-1, values.shape[2], order="F").T if by_last_axis else values
        read[label if labels.count(label) == 1 else other] = rows
    return read


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""  # an empty text is an empty array


# Files of urmpipe's own export


def _grid_table(run: Mapping[str, Any]) -> pa.Table:
    """Return a run on its grid under the names that it has as a table."""
    joints, units = _texts(run["joints"]), _texts(run["units"]["q"])
    clock = np.asarray(run["clock_ns"]).ravel()
    rows = len(clock) or len(np.atleast_2d(run["q"]).reshape(-1, max(1, len(joints))))
    columns: dict[str, Any] = {"row": np.arange(1, rows + 1)}
    if len(clock):
        columns = {"t [s]": decimals(clock.astype(np.int64), 9)}
    for key, (before, after) in zip(("q", "qd", "qdd"), ORDERS.values(), strict=True):
        names = [f"{before}{name} [{unit}{after}]" for name, unit in zip(joints, units, strict=True)]
        columns |= dict(zip(names, _matrix(run[key], rows).T, strict=False))
    if not len(clock):
        point = np.column_stack([_matrix(run[key], rows) for key in ("p", "euler_zyx")])
        columns |= dict(zip((f"{name} [{unit}]" for name, unit in POINT), point.T, strict=False))
    recorded = (f"{RECORDED}tcp_{axis} [m]" for axis in "xyz")
    columns |= dict(zip(recorded, _matrix(run["p_recorded"], rows).T, strict=False))
    return _table([(name, "", values) for name, values in columns.items()])


def _file_table(run: Mapping[str, Any]) -> pa.Table:
    """Return the rows of a log's file under the names that it has, with its exact clock in front."""
    clock = np.asarray(run["clock_ns"]).ravel().astype(np.int64)
    names, units = _texts(run["clock_names"]), _texts(run["clock_units"])
    columns: list[tuple[str, str, Any]] = []
    if len(clock):
        unit = units[0] if len(units) == 1 else "ns"
        exponent = EXPONENTS.get(unit)
        times = clock.astype("datetime64[ns]") if exponent is None else decimals(clock, exponent)
        columns.append((names[0] if len(names) == 1 else "t", unit, times))
    labels, units = _texts(run["names"]), _texts(run["units"])
    values = np.asarray(run["values"], dtype=np.float64).reshape(-1, len(labels))
    columns += zip(labels, units, values.T, strict=True)
    return with_roles(_table(columns), json.loads(run["metadata"]))


def _simulation_table(simulated: Mapping[str, Any]) -> pa.Table:
    """Return the signals of a simulation under their names, after their clock."""
    clock, names = np.asarray(simulated["clock_ns"]).ravel(), _texts(simulated["names"])
    values = np.asarray(simulated["values"], dtype=np.float64).reshape(len(clock), -1)
    signals = ((name, "", column) for name, column in zip(names, values.T, strict=True))
    return _table([("t [s]", "", decimals(clock.astype(np.int64), 9)), *signals])


def _table(columns: Sequence[tuple[str, str, Any]]) -> pa.Table:
    """Return columns of name, unit and values as an Arrow table."""
    arrays = [a if isinstance(a, pa.Array) else arrow_column(np.ascontiguousarray(a)) for *_, a in columns]
    fields = [
        pa.field(name, array.type, metadata={UNIT: unit.encode()} if unit else None)
        for (name, unit, _), array in zip(columns, arrays, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def _matrix(values: Any, rows: int) -> NDArray[np.float64]:
    """Return what loading made a vector as a matrix again, shape (rows, k)."""
    array = np.asarray(values, dtype=np.float64)
    return array.reshape(rows, -1) if array.size else np.empty((rows, 0))


def _texts(cells: Any) -> list[str]:
    """Return the texts of a row of cells; loading makes a single one a text."""
    return [cells] if isinstance(cells, str) else [str(cell) for cell in cells]
