"""NumPy files: a table of two dimensions, or arrays of one length by name."""

from __future__ import annotations

import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any, TypeAlias
from zipfile import BadZipFile, ZipFile

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from urmpipe_models.errors import Finding, Hint, LogError, python_command
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.tables.held import MemoryTable
from urmpipe_pipeline.logs.tables.limits import refuse_unpacked, refuse_wide
from urmpipe_pipeline.logs.tables.numpy_columns import column
from urmpipe_pipeline.logs.vocabulary import SURELY_SECONDS, key, split_unit, vocabulary

_NPY = b"\x93NUMPY"
_IN_ORDER = re.compile(r"(arr_\d+)?")
ROWS = 16
"""An array alone with so few rows, and more columns, may have joints as rows."""

_SHOWN = 6
"""Arrays that are named where their lengths differ."""

_DAMAGED = (
    OSError,
    ValueError,
    TypeError,
    EOFError,
    BadZipFile,
    NotImplementedError,
    RuntimeError,
    zlib.error,
    SyntaxError,
    TokenError,
    OverflowError,
    struct.error,
)
"""What NumPy and zipfile raise of files that are damaged, or packed as Python does not unpack them."""

Array: TypeAlias = npt.NDArray[Any]


def read_numpy(path: Path) -> MemoryTable:
    """Return the table of a .npy or .npz file. Objects are not loaded: that would run code of the file.

    Raises:
        LogError: If the file is damaged, holds no table, or arrays of different lengths.
    """
    try:
        arrays = dict(_arrays(path))
    except _DAMAGED as error:
        reason = (str(error) or type(error).__name__).splitlines()[0].rstrip(".")
        raise LogError(Finding(f"cannot be read: {reason}", file=str(path))) from None
    tables = {name: array for name, array in arrays.items() if array is not None and _is_table(array)}
    if not tables:
        raise LogError(_no_table(path, arrays))
    tables = _upright(tables)
    _refuse_lengths(path, tables)
    in_order = all(_IN_ORDER.fullmatch(name) for name in tables)  # of numpy.savez(file, t, q)
    wide = [array for array in tables.values() if array.ndim == 2 and len(array) <= ROWS < array.shape[1]]
    in_order = in_order or len(tables) == len(wide) == 1  # joints as rows, which are asked about
    named = not in_order or bool(tables.get("", np.empty(0)).dtype.names)
    values = dict(_columns(tables))
    single = {name: float(one.item()) for name, one in arrays.items() if one is not None and _is_number(one)}
    times, said = even_times(single, values) if named else ({}, ())
    columns = pa.table({name: column(one) for name, one in (times | values).items()})
    return MemoryTable(path.stem, columns, named=named, path=path, inferences=said)


def even_times(
    single: Mapping[str, float], columns: Mapping[str, Array]
) -> tuple[dict[str, Array], tuple[Inference, ...]]:
    """Return the times that a single number between samples gives, if no column is named like a time.

    One of more than 0.05 may be in ms: it says nothing.
    """
    words = vocabulary()
    if any(pattern.search(key(split_unit(name)[0])) for name in columns for pattern in words.time):
        return {}, ()
    periods = {
        name: value
        for name, value in single.items()
        if 0.0 < value <= SURELY_SECONDS and any(pattern.search(key(name)) for pattern in words.period)
    }
    if len(periods) != 1:
        return {}, ()
    ((name, period),) = periods.items()
    rows = len(next(iter(columns.values())))
    times = np.rint(np.arange(rows) * (period * 1e9)).astype(np.int64)
    said = Inference("period", f"{period:g} s", f"{name} = {period:g} in the file", hints=(Hint("period"),))
    return {"t [ns]": times}, (said,)


def _is_number(array: Array) -> bool:
    return array.size == 1 and array.dtype.kind in "uif"


def _upright(tables: Mapping[str, Array]) -> dict[str, Array]:
    """Return arrays with a row a sample: joints as rows are turned where an array of one dimension tells."""
    alone = {len(array) for array in tables.values() if array.ndim == 1}
    rows = alone.pop() if len(alone) == 1 else None
    return {
        name: array.T if array.ndim == 2 and len(array) != rows == array.shape[1] else array
        for name, array in tables.items()
    }


def _arrays(path: Path) -> Iterator[tuple[str, Array | None]]:
    """Yield the arrays of a file by name, without one if it is no archive; None of one of objects."""
    with path.open("rb") as file:
        if file.read(len(_NPY)) == _NPY:
            file.seek(0)
            yield "", _array(file, file, path.stat().st_size)
            return
    with ZipFile(path) as archive:
        members = archive.infolist()
        refuse_wide(len(members), str(path))
        refuse_unpacked(path, sum(one.file_size for one in members))
        for one in members:
            with archive.open(one) as header, archive.open(one) as data:
                yield one.filename.removesuffix(".npy"), _array(header, data, one.file_size)


def _array(header: IO[bytes], data: IO[bytes], size: int) -> Array | None:
    """Return an array, its header read before from the same bytes of some size; None of one of objects.

    Raises:
        ValueError: If the header tells of more numbers than the bytes can hold.
    """
    version = np.lib.format.read_magic(header)
    read_header = (
        np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    )
    shape, _, kind = read_header(header)
    if kind.hasobject:
        return None
    if not 0 <= math.prod(shape) * max(kind.itemsize, 1) <= size:
        raise ValueError(f"{kind} {shape} is more than {size} bytes hold")
    if data is header:
        data.seek(0)
    return np.asarray(np.lib.format.read_array(data, allow_pickle=False))


def _no_table(path: Path, arrays: Mapping[str, Array | None]) -> Finding:
    """Return what is said of a file without a table; of one of Python's objects with a command."""
    shapes = (f"{name or 'an array'} {array.shape}" for name, array in arrays.items() if array is not None)
    if (shown := ", ".join(shapes)) or "" not in arrays:
        allowed = "numbers in one or two dimensions, one row per sample"
        return Finding(file=str(path), found=shown or "no array of numbers", allowed=allowed)
    command = python_command(
        f"import numpy; numpy.savez({_written(path)!r},"
        f" **dict(numpy.load({path.as_posix()!r}, allow_pickle=True).item()))"
    )
    hint = Hint("", effect=f"only if you trust it, since loading it runs its code: {command}")
    return Finding(file=str(path), found="a Python object", allowed="arrays of numbers", hints=(hint,))


def _written(path: Path) -> str:
    return "log.npz" if path.name != "log.npz" else "table.npz"


def _is_table(array: Array) -> bool:
    """Return whether an array is rows: of numbers, dates or lengths of time, or of fields by name."""
    rows = array.dtype.names is not None or array.dtype.kind in "biufmM"
    return rows and array.ndim in (1, 2) and array.size > 1


def _refuse_lengths(path: Path, tables: Mapping[str, Array]) -> None:
    """Raise if arrays have different lengths, with a command that keeps those of one."""
    lengths = Counter[int]()
    for array in tables.values():
        lengths[len(array)] += array.size
    if len(lengths) == 1:
        return
    shown = ", ".join(f"{name} {array.shape}" for name, array in list(tables.items())[:_SHOWN])
    more = f" and {len(tables) - _SHOWN} more" if len(tables) > _SHOWN else ""
    keep = f"len(f[k]) == {lengths.most_common(1)[0][0]}"
    wide = next((name for name, array in tables.items() if array.ndim == 2 and "/" in name), "")
    folder = next((one for one in _folders(wide) if len(_lengths_in(one, tables)) == 1), None)
    keep = keep if folder is None else f"k.startswith({folder!r})"
    if folder is None:
        keep = f"f[k].ndim and {keep}"
    command = python_command(
        f"import numpy; f = numpy.load({path.as_posix()!r});"
        f" numpy.savez({_written(path)!r}, **{{k: f[k] for k in f if {keep}}})"
    )
    hint = Hint("", effect=f"to keep those of one length: {command}")
    raise LogError(Finding(file=str(path), found=shown + more, allowed="arrays of one length", hints=(hint,)))


def _folders(name: str) -> Iterator[str]:
    """Yield the folders that a name stands in, the outermost first."""
    parts = name.split("/")[:-1]
    yield from ("/".join(parts[: k + 1]) + "/" for k in range(len(parts)))


def _lengths_in(folder: str, tables: Mapping[str, Array]) -> set[int]:
    return {len(array) for name, array in tables.items() if name.startswith(folder)}


def _columns(tables: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    """Yield the columns by name; those of an array of several are numbered from 1, as the reader has them."""
    last = [name.split("/")[-1] for name in tables]
    for name, array in tables.items():
        short = name.split("/")[-1] if len(set(last)) == len(last) else name
        if array.dtype.names is not None:
            fields = {field: array[field].reshape(len(array), -1) for field in array.dtype.names}
            yield from _columns({field: one for field, one in fields.items() if _is_table(one)})
            continue
        matrix = array.reshape(len(array), -1)
        for k, values in enumerate(matrix.T, start=1):
            alone = matrix.shape[1] == 1
            yield short if alone and short else f"{short}_{k}".removeprefix("_"), values
