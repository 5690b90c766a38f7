"""Variables of MATLAB, Octave and SciPy as a table: vectors, matrices and signals of Simulink.

MAT files of version 5 are read here; files of version 7.3 are HDF5 (`hdf5_file`).

HDF5 files: datasets of one length, variables of MATLAB 7.3 and Octave, tables of pandas.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline import mat_variables
from urmpipe_pipeline.array_choice import Name, Question, choose_arrays
from urmpipe_pipeline.logs.formats.arrays import ArrayColumn, ask_for_arrays, make_array_table
from urmpipe_pipeline.logs.formats.arrow_columns import decimals
from urmpipe_pipeline.logs.formats.form import spread_names
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.numbers import UNIT, arrow_column
from urmpipe_pipeline.logs.formats.own import ORDERS, RECORDED, with_roles
from urmpipe_pipeline.logs.formats.text import refuse_unpacked, refuse_wide, unpacked_limit
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.outputs import EXPORT_HEADER
from urmpipe_pipeline.subprocess_reader import ReaderCrashError, read_in_subprocess

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Powers of ten from a unit of times to [ns]."""

TO_CSV = {"table": "writetable(NAME", "timetable": "writetimetable(NAME"}
SIGNALS = ("timeseries", "Simulink.")
"""Classes of MATLAB and what to write in their place: a MAT file stores their numbers in another form."""

HEADER, COMPRESSED = 128, 15
"""Bytes before the first variable of a file; the kind of a variable that is packed."""


def read_mat(path: Path, head: bytes, options: LogMap) -> MemoryTable:
    """Return the table of a MAT file of version 5.

    Raises:
        LogError: If it is damaged, and as `make_variable_table`.
    """
    return make_variable_table(path, _loaded(path), options, exported=EXPORT_HEADER.encode() in head)


def make_variable_table(
    path: Path, variables: Mapping[str, Any], options: LogMap, *, exported: bool = False
) -> MemoryTable:
    """Return the table of the variables of MATLAB, Octave or SciPy.

    Its columns are vectors, and matrices with a row or a column per sample, also those of structs.

    Args:
        path: The file.
        variables: Variables by name, structs as dictionaries.
        options: Which episode or which length is read, if there are several.
        exported: Whether `urmpipe export` wrote the file.

    Raises:
        LogError: If there are no such numbers, or with the question which of them are read.
    """
    run, simulated = (variables.get(name) if exported else None for name in ("run", "simulation"))
    if isinstance(run, Mapping) and "rows" in run:
        return MemoryTable(path.stem, _grid(run) if run["rows"] == "grid" else _file(run), path=path)
    if isinstance(simulated, Mapping) and "values" in simulated:
        return MemoryTable(path.stem, _signals(simulated), path=path)
    arrays = dict(_iter_arrays(read_signals(variables)))
    shapes = {name: values.shape for name, values in arrays.items()}
    choice = choose_arrays(shapes, options.episode, options.topic, separator=".", by_rows=False)
    if isinstance(choice, Question):
        ask_for_arrays(path, choice)
    columns = [
        column
        for name in choice.names
        for column in _columns(name[len(choice.group) :], arrays[name], choice.rows)
    ]
    objects = dict(_iter_objects(variables))
    if choice.rows < 2 or not columns:
        raise LogError(_no_numbers(path, variables, objects))
    scalars = {name: value for name, value in variables.items() if isinstance(value, (int, float))}
    left_out = [
        ".".join(name) + f" {arrays[name].shape}" for name in choice.left_out if arrays[name].size > 1
    ]
    left_out += [f"{name} ({kind})" for name, kind in objects.items() if _command(name, kind)]
    return make_array_table(path, choice, columns, scalars, ".", left_out)


def _no_numbers(path: Path, variables: Mapping[str, Any], objects: Mapping[str, str]) -> Finding:
    """Return the finding about a file without numbers, and what to save instead of objects of a class."""
    shown = (f"{name} ({objects[name]})" if name in objects else name for name in [*variables][:8])
    command = next(filter(None, map(_command, objects, objects.values())), "")
    command = command or f'writetable(T, "log.csv") of a table, or save("{path.name}", "t", "q")'
    hint = Hint("", effect=f"in MATLAB: {command}")
    fault = f"found no numbers with one row per sample in {', '.join(shown) or 'it'}"
    return Finding(f"{fault}, allowed: such as t (n x 1), q (n x joints)", str(path), hints=(hint,))


def _command(name: str, kind: str) -> str:
    """Return the command of MATLAB that writes an object as CSV; an empty text of other objects."""
    start = "writetimetable(extractTimetable(NAME)" if kind.startswith(SIGNALS) else TO_CSV.get(kind)
    return f'{start.replace("NAME", name)}, "log.csv")' if start else ""


def _loaded(path: Path) -> dict[str, Any]:
    """Return the variables of a file, structs as dictionaries: damaged bytes can end SciPy's process."""
    refuse_unpacked(path, _unpacked(path))
    try:
        variables, reason = read_in_subprocess(path, mat_variables.__name__)
    except ReaderCrashError as error:
        variables, reason = {}, str(error)
    if reason:
        fault = f"found a MAT file that cannot be read ({reason}), allowed: a whole one"
        raise LogError(Finding(fault, str(path)))
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _unpacked(path: Path) -> int:
    """Return the bytes that the variables of a file say that they unpack to."""
    total = 0
    with path.open("rb") as file:
        order = "<" if file.read(HEADER)[-2:] == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            begun = file.tell()
            if kind == COMPRESSED:
                with suppress(zlib.error):  # damaged, as reading tells
                    tag = zlib.decompressobj().decompress(file.read(256), 8)
            total += struct.unpack(f"{order}II", tag)[1] if len(tag) == 8 else 0
            file.seek(begun + length)
    return total


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


def _iter_objects(value: Any, name: Name = ()) -> Iterator[tuple[str, str]]:
    """Yield name and class of each object of a class."""
    if isinstance(value, tuple):
        yield ".".join(name), value[1]
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _iter_objects(inner, (*name, key))


def _columns(name: Name, values: NDArray[Any], rows: int) -> Iterator[ArrayColumn]:
    """Yield a column for a vector, and NAME_1, NAME_2, ... of a matrix with this number of samples."""
    by_row = values if len(values) == rows else values.T
    names = spread_names([name[-1]], [by_row.shape[1] if values.ndim == 2 else 0])
    matrix = np.ascontiguousarray(by_row.T).reshape(-1, rows)
    yield from (((*name[:-1], label), "", column) for label, column in zip(names, matrix, strict=True))


def read_signals(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Return variables with the signals of Simulink as arrays by their labels.

    Structures with time have `time` and `signals`, with `values` of shape (n, k) or (i, j, n), `label` and
    `blockName`. Timeseries as structs have `Time`, `Data` and `Name`, those of a Dataset in `Values`.
    """
    return {name: _read_signals(name, value) for name, value in variables.items()}


def _read_signals(name: str, value: Any) -> Any:
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
    labels = [
        label if labels.count(label) == 1 else f"{label}_{k}" for k, label in enumerate(labels, start=1)
    ]
    values = zip(labels, map(_with_rows, arrays), strict=True)
    return {"time": value.get("time", value.get("Time")), **dict(values)}


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""  # an empty text is an empty array


def _with_rows(values: Any) -> Any:
    """Return the values of a signal with one row per sample; matrices are stored along the last axis."""
    if isinstance(values, np.ndarray) and values.ndim == 3:
        return values.reshape(-1, values.shape[2], order="F").T
    return values


def _grid(run: Mapping[str, Any]) -> pa.Table:
    """Return a run on its grid under the names that it has as a table."""
    joints = _list(run["joints"])
    clock = np.asarray(run["clock_ns"]).ravel()
    rows = len(clock) or len(np.atleast_2d(run["q"]).reshape(-1, max(1, len(joints))))
    columns: dict[str, Any] = {"t [s]": decimals(clock.astype(np.int64), 9)} if len(clock) else {}
    if not columns:
        columns["row"] = np.arange(1, rows + 1)
    units = {"q": _list(run["units"]["q"])}
    for key, (before, behind) in zip(("q", "qd", "qdd"), ORDERS.values(), strict=True):
        values = _matrix(run[key], rows)
        names = [f"{before}{name} [{unit}{behind}]" for name, unit in zip(joints, units["q"], strict=True)]
        columns |= dict(zip(names, values.T, strict=False))
    if not len(clock):
        point = np.column_stack([_matrix(run[key], rows) for key in ("p", "euler_zyx")])
        names = ["px [m]", "py [m]", "pz [m]", "rz [rad]", "ry [rad]", "rx [rad]"]
        columns |= dict(zip(names, point.T, strict=False))
    recorded = (f"{RECORDED}tcp_{axis} [m]" for axis in "xyz")
    return _table(columns | dict(zip(recorded, _matrix(run["p_recorded"], rows).T, strict=False)))


def _file(run: Mapping[str, Any]) -> pa.Table:
    """Return the rows of a log's own file under its own names, with its exact clock in front."""
    clock = np.asarray(run["clock_ns"]).ravel().astype(np.int64)
    names, units = _list(run["clock_names"]), _list(run["clock_units"])
    columns: list[tuple[str, str, Any]] = []
    if len(clock):
        unit = units[0] if len(units) == 1 else "ns"
        times: Any = decimals(clock, EXPONENTS[unit]) if unit in EXPONENTS else clock.astype("datetime64[ns]")
        columns.append((names[0] if len(names) == 1 else "t", unit, times))
    labels, units = _list(run["names"]), _list(run["units"])
    values = np.asarray(run["values"], dtype=np.float64).reshape(-1, len(labels))
    columns += [(name, unit, values[:, k]) for k, (name, unit) in enumerate(zip(labels, units, strict=True))]
    arrays = [_column(array) for _, _, array in columns]
    fields = [
        pa.field(name, array.type, metadata={UNIT: unit.encode()})
        for (name, unit, _), array in zip(columns, arrays, strict=True)
    ]
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    return with_roles(table, json.loads(run["metadata"]))


def _signals(simulated: Mapping[str, Any]) -> pa.Table:
    """Return the signals of a simulation under their names, behind their clock."""
    clock, names = np.asarray(simulated["clock_ns"]).ravel(), _list(simulated["names"])
    values = np.asarray(simulated["values"], dtype=np.float64).reshape(len(clock), -1)
    columns = dict(zip(names, values.T, strict=True))
    return _table({"t [s]": decimals(clock.astype(np.int64), 9), **columns})


def _table(columns: Mapping[str, Any]) -> pa.Table:
    return pa.Table.from_arrays([_column(array) for array in columns.values()], names=list(columns))


def _column(values: Any) -> pa.Array:
    return values if isinstance(values, pa.Array) else arrow_column(values)


def _matrix(values: Any, rows: int) -> NDArray[np.float64]:
    """Return what loading made a vector as a matrix again, shape (rows, k)."""
    array = np.asarray(values, dtype=np.float64)
    return array.reshape(rows, -1) if array.size else np.empty((rows, 0))


def _list(cells: Any) -> list[str]:
    """Return the texts of a row of cells; loading makes a single one a text."""
    return [cells] if isinstance(cells, str) else [str(cell) for cell in cells]


READER = "urmpipe_pipeline.hdf5_contents"  # it is imported with h5py, which may be missing


def read_hdf5(path: Path, options: LogMap) -> MemoryTable:
    """Return the table of an HDF5 file.

    Raises:
        LogError: If the file is damaged, or has no arrays of numbers with one row per
            sample; with a question if it has several episodes, or arrays of several lengths.
    """
    arguments = (str(unpacked_limit(path.stat().st_size)), options.episode or "", options.topic or "")
    try:
        contents, reason = read_in_subprocess(path, READER, arguments=arguments)
    except ReaderCrashError as error:
        contents, reason = None, str(error)
    if reason:
        raise LogError(
            Finding(f"found an HDF5 file that cannot be read ({reason}), allowed: a whole one", str(path))
        )
    refuse_unpacked(path, contents.size)
    if contents.variables is not None:
        return make_variable_table(path, contents.variables, options)
    if isinstance(contents.choice, Question):
        ask_for_arrays(path, contents.choice)
    not_read = [f"{name} {shape}" for name, shape in contents.not_read]
    if not contents.columns:
        shown = ", ".join(not_read[:8]) or "no dataset"
        allowed = "datasets of numbers with one row per sample, such as t (n,) and q (n, joints)"
        raise LogError(Finding(file=str(path), found=shown, allowed=allowed))
    refuse_wide(len(contents.columns), str(path))
    return make_array_table(path, contents.choice, contents.columns, contents.scalars, "/", not_read)
