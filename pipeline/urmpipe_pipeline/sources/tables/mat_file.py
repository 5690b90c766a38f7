"""MAT files (version 5) of MATLAB, Octave and SciPy: vectors and matrices with a row a sample."""

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
from urmpipe_pipeline.outputs import EXPORT_HEADER
from urmpipe_pipeline.sources.tables import numpy_columns
from urmpipe_pipeline.sources.tables.column_facts import UNIT
from urmpipe_pipeline.sources.tables.exact_clock import decimals
from urmpipe_pipeline.sources.tables.form import spread_names
from urmpipe_pipeline.sources.tables.held import MemoryTable
from urmpipe_pipeline.sources.tables.limits import refuse_unpacked
from urmpipe_pipeline.sources.tables.own_tables import ORDERS, RECORDED, with_roles
from urmpipe_pipeline.subprocess_reader import ReaderCrashError, read_in_subprocess

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Powers of ten from a unit of times to [ns]."""

LONG = 3
"""A matrix that is so many times wider than high has its samples side by side."""

HEADER, COMPRESSED = 128, 15
"""Bytes before the first variable of a file; the kind of a variable that is packed."""

Arrays = Mapping[str, NDArray[Any]]


def read_mat(path: Path, head: bytes) -> MemoryTable:
    """Return the table of a MAT file of version 5.

    Of variables, and of the fields of structs, those are its columns that have a value a sample: vectors, and
    matrices with a row or a column a sample.

    Raises:
        LogError: If it is damaged, or holds no such numbers.
    """
    found = _loaded(path)
    run = found.get("run")
    if EXPORT_HEADER.encode() in head and isinstance(run, Mapping) and "rows" in run:
        return MemoryTable(path.stem, _grid(run) if run["rows"] == "grid" else _file(run), path=path)
    simulated = found.get("simulation")
    if EXPORT_HEADER.encode() in head and isinstance(simulated, Mapping) and "values" in simulated:
        return MemoryTable(path.stem, _signals(simulated), path=path)
    arrays = dict(_numeric(found))
    rows = _rows(arrays)
    columns = dict(_columns(arrays, rows))
    if rows < 2 or not columns:
        names = ", ".join(list(found)[:8]) or "it"
        hint = Hint(
            "", effect=f'in MATLAB: writetable(T, "log.csv") of a table, or save("{path.name}", "t", "q")'
        )
        said = (
            f"found no numbers with one row per sample in {names}, allowed: such as t (n x 1), q (n x joints)"
        )
        raise LogError(Finding(said, str(path), hints=(hint,)))
    return MemoryTable(path.stem, _table(columns), path=path)


def _loaded(path: Path) -> dict[str, Any]:
    """Return the variables of a file, structs as dictionaries: damaged bytes can end SciPy's process."""
    refuse_unpacked(path, _unpacked(path))
    try:
        found, reason = read_in_subprocess(path, mat_variables.__name__)
    except ReaderCrashError as error:
        found, reason = {}, str(error)
    if reason:
        found_out = f"found a MAT file that cannot be read ({reason}), allowed: a whole one"
        raise LogError(Finding(found_out, str(path)))
    return {name: value for name, value in found.items() if not name.startswith("__")}


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


def _numeric(found: Mapping[str, Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield vectors and matrices of numbers by name, those of a struct as well."""
    fields = [
        (name if name not in found else f"{struct}.{name}", value)
        for struct, inner in found.items()
        if isinstance(inner, Mapping)
        for name, value in inner.items()
    ]
    for name, value in (*found.items(), *fields):
        if isinstance(value, np.ndarray) and value.dtype.kind in "iuf" and value.ndim <= 2 and value.size > 1:
            yield name, value


def _rows(arrays: Arrays) -> int:
    """Return the number of samples: the length of the longest vector, else the rows of the highest matrix."""
    vectors = [len(array) for array in arrays.values() if array.ndim == 1]
    if vectors:
        return max(vectors)
    return max((_height(*array.shape) for array in arrays.values()), default=0)


def _height(rows: int, columns: int) -> int:
    return columns if columns >= LONG * rows else rows


def _columns(arrays: Arrays, rows: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield a column for each vector and each column of a matrix with so many samples: NAME_1, NAME_2, ..."""
    for name, array in arrays.items():
        by_row = array if len(array) == rows else array.T
        if len(by_row) == rows:
            names = spread_names([name], [by_row.shape[1] if array.ndim == 2 else 0])
            yield from zip(names, np.ascontiguousarray(by_row.T).reshape(-1, rows), strict=True)


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
    own, told = _list(run["names"]), _list(run["units"])
    values = np.asarray(run["values"], dtype=np.float64).reshape(-1, len(own))
    columns += [(name, unit, values[:, k]) for k, (name, unit) in enumerate(zip(own, told, strict=True))]
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
    return values if isinstance(values, pa.Array) else numpy_columns.column(values)


def _matrix(values: Any, rows: int) -> NDArray[np.float64]:
    """Return what loading made a vector as a matrix again, shape (rows, k)."""
    array = np.asarray(values, dtype=np.float64)
    return array.reshape(rows, -1) if array.size else np.empty((rows, 0))


def _list(cells: Any) -> list[str]:
    """Return the texts of a row of cells; loading makes a single one a text."""
    return [cells] if isinstance(cells, str) else [str(cell) for cell in cells]
