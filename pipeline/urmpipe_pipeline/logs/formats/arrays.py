"""Arrays of NumPy as columns of an Arrow table.

NumPy files: a table of two dimensions, or arrays of one length by name.

Arrays of a file as a table in memory: names of columns, a clock of even times, what the user chooses.

Arrays in Python as a table in memory: times, joint values and a recorded tool centre point.
"""

from __future__ import annotations

import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any, NoReturn, TypeAlias
from zipfile import BadZipFile, ZipFile

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import (
    Finding,
    Hint,
    LogError,
    OptionError,
    format_value,
    map_collecting_errors,
    python_command,
)
from urmpipe_pipeline.array_choice import Choice, Name, Question
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.numbers import ROLE, UNIT, arrow_column
from urmpipe_pipeline.logs.formats.own import FORM, GIVEN
from urmpipe_pipeline.logs.formats.parquet import is_table
from urmpipe_pipeline.logs.formats.text import refuse_unpacked, refuse_wide
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
    columns = pa.table({name: arrow_column(one) for name, one in (times | values).items()})
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


SHOWN = 9  # choices of a question, or arrays that are not read, which a message lists

_NUMBERED = re.compile(r"\[\d+\]$")

ArrayColumn = tuple[Name, str, NDArray[Any]]
"""The groups and the name of a column, its unit or an empty text, and its values, shape (n,)."""


def make_array_table(
    path: Path,
    choice: Choice,
    columns: Sequence[ArrayColumn],
    scalars: Mapping[str, float],
    separator: str,
    not_read: Sequence[str] = (),
) -> MemoryTable:
    """Return the columns of some arrays as a table.

    A column is called by its groups, without those that all columns share. A clock is called by its own name,
    if no other one is called so.

    Args:
        path: The file.
        choice: Which arrays of the file they are.
        columns: The columns.
        scalars: Single numbers of the file, of which one may be the time between samples.
        separator: Sign between groups in names.
        not_read: The other arrays of the file, as a message lists them.
    """
    shared = 0
    if "topic" not in choice.applied:
        groups = zip(*(name[:-1] for name, _, _ in columns), strict=False)
        shared = sum(1 for _ in takewhile(lambda same: len(set(same)) == 1, groups))
    clocks = {k: values for k, (name, _, values) in enumerate(columns) if _is_clock(name[-1])}
    first = next(iter(clocks.values()), None)
    same = [k for k, values in clocks.items() if first is not None and np.array_equal(values, first)]
    is_unique = len(same) == len(clocks)
    named: dict[str, tuple[str, NDArray[Any]]] = {}
    for k, (name, unit, values) in enumerate(columns):
        if is_unique and k in same[1:]:
            continue
        label = name[-1] if is_unique and k in same else separator.join(name[shared:])
        named[label if label not in named else separator.join(name)] = unit, values
    times, reasons = even_times(scalars, {name: values for name, (_, values) in named.items()})
    arrays = [arrow_column(values) for values in times.values()]
    arrays += [
        pa.array(values.tolist()) if values.dtype == object else arrow_column(values)
        for _, values in named.values()
    ]
    names, units = [*times, *named], [""] * len(times) + [unit for unit, _ in named.values()]
    fields = [
        pa.field(name, array.type, metadata={UNIT: unit} if unit else None)
        for name, array, unit in zip(names, arrays, units, strict=True)
    ]
    inferences = [*reasons]
    if not_read:
        more = f" and {len(not_read) - SHOWN} more" if len(not_read) > SHOWN else ""
        rows = f"they have no column of {choice.rows} rows"
        inferences.append(Inference("arrays", f"{', '.join(not_read[:SHOWN])}{more} are not read", rows))
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    patterns = vocabulary().joint["position"]
    says = len(choice.names) > 1 or not all(map(_NUMBERED.search, named))
    says = says or any(pattern.search(key(names[-1])) for pattern in patterns)
    return MemoryTable(path.stem, table, says, path, tuple(inferences), choice.applied)


def _is_clock(name: str) -> bool:
    return any(pattern.search(key(split_unit(name)[0])) for pattern in vocabulary().time)


def ask_for_arrays(path: Path, question: Question) -> NoReturn:
    """Raise the question which episode, or which arrays of one length, are read."""
    values = [value for value, _ in question.choices]
    shown = ", ".join(values[:SHOWN]) + ", ..." * (len(values) > SHOWN)
    parts = f"{len(values)} episodes" if question.option == "episode" else f"arrays of {len(values)} lengths"
    if question.requested is not None:
        parts = f"no {question.option} {question.requested} among {parts}"
    hints = (Hint(question.option, value, f"reads {rows}") for value, rows in question.choices[:SHOWN])
    raise LogError(Finding(file=str(path), found=f"{parts}: {shown}", allowed="one", hints=tuple(hints)))


TIMES = "n times in s, or datetime64 or timedelta64"
JOINTS = "an array of shape (n, joints), in rad or m; a table is a log"
POSES = "an array of shape (n, 3), in m, (n, 7), with quaternions x, y, z, w behind, or (n, 4, 4)"

POSITION, QUATERNION = ("tcp_x", "tcp_y", "tcp_z"), ("tcp_qx", "tcp_qy", "tcp_qz", "tcp_qw")

Array_given_arrays = NDArray[Any]


def arrays_to_table(
    t: Any,
    q: Any,
    recorded_tcp: Any,
    names: Sequence[str],
    name: str,
    robot: Chain | None,
    units: Collection[str],
) -> MemoryTable:
    """Return arrays as a table in memory: t, the joints, and x, y, z and the orientation of the tool.

    Args:
        t: Times in [s], or as datetime64 or timedelta64, shape (n,); None without times.
        q: Joint values in [rad] or [m], shape (n, joints); None for a path.
        recorded_tcp: The recorded tool centre point in [m], shape (n, 3), with quaternions x, y, z, w behind,
            shape (n, 7), or as matrices, shape (n, 4, 4); None without one.
        names: Of the joints; by default q1, q2, ...
        name: What to call the log.
        robot: The arm: it tells which joints slide.
        units: Columns by name of which a unit is given apart; "" for every angle.

    Raises:
        OptionError: With each array of another shape, or if they do not have one length.
    """
    parts: tuple[Callable[[], Array_given_arrays | None], ...] = (
        lambda: _times(t),
        lambda: _joints(q),
        lambda: _poses(recorded_tcp),
    )
    times, values, poses = map_collecting_errors(lambda make: make(), parts)
    if values is None and poses is None:
        raise OptionError(Finding(parameter="q", found="none", allowed=JOINTS))
    _refuse_lengths_given_arrays({"t": times, "q": values, "recorded_tcp": poses})
    columns: list[tuple[str, str, str, Any]] = []
    if times is not None:
        columns.append(("t", "" if times.dtype.kind in "mM" else "s", "time 0", times))
    if values is not None:
        joints = _names(names, values.shape[1])
        columns += [
            (label, unit, f"joint {k}", values[:, k])
            for k, (label, unit) in enumerate(zip(joints, _units(joints, robot, units), strict=True))
        ]
    if poses is not None:
        wide = [(label, "m", f"position {k}") for k, label in enumerate(POSITION)]
        wide += [(label, "", f"rotation {k}") for k, label in enumerate(QUATERNION[: poses.shape[1] - 3])]
        columns += [(*told, poses[:, k]) for k, told in enumerate(wide)]
    arrays = [arrow_column(array) for *_, array in columns]
    fields = [
        pa.field(label, array.type, metadata={UNIT: "" if label in units else unit, ROLE: role})
        for (label, unit, role, _), array in zip(columns, arrays, strict=True)
    ]
    return MemoryTable(
        name, pa.Table.from_arrays(arrays, schema=pa.schema(fields, {GIVEN: "", FORM: "quat_xyzw"}))
    )


def _times(t: Any) -> Array_given_arrays | None:
    """Return times as an array of shape (n,)."""
    if t is None:
        return None
    try:
        array = np.asarray(np.ma.filled(t, np.nan) if isinstance(t, np.ma.MaskedArray) else t)
        array = array if array.dtype.kind != "O" else array.astype("datetime64[ns]")
        array = array if array.dtype.kind in "mMiuc" else array.astype(np.float64)
    except (TypeError, ValueError):
        raise _unfit("t", t, TIMES) from None
    if array.ndim != 1 or not len(array) or array.dtype.kind == "c":
        raise _unfit("t", t, TIMES)
    return array


def _joints(q: Any) -> FloatArray | None:
    """Return joint values as an array of shape (n, joints)."""
    if q is None:
        return None
    array = _numbers("q", q, JOINTS)
    if array.ndim != 2 or not array.size:
        raise _unfit("q", q, JOINTS)
    return array


def _poses(given: Any) -> FloatArray | None:
    """Return positions, and quaternions where there are orientations, of shape (n, 3) or (n, 7)."""
    if given is None:
        return None
    array = _numbers("recorded_tcp", given, POSES)
    if array.ndim == 2 and len(array) and array.shape[1] in (3, 7):
        return array
    if array.ndim != 3 or not len(array) or array.shape[1:] != (4, 4):
        raise _unfit("recorded_tcp", given, POSES)
    from urmpipe_models.math3d import to_quaternions

    turned = to_quaternions(array[:, :3, :3].reshape(-1, 9), "matrix")
    return np.column_stack([array[:, :3, 3], turned])


def _numbers(parameter: str, given: Any, allowed: str) -> FloatArray:
    """Return numbers as an array, NaN where they are masked."""
    try:
        array = np.ma.asanyarray(given)
        if is_table(given) or array.dtype.kind == "c":
            raise _unfit(parameter, given, allowed)
        return np.asarray(np.ma.filled(array.astype(np.float64), np.nan), dtype=np.float64)
    except (TypeError, ValueError):
        raise _unfit(parameter, given, allowed) from None


def _unfit(parameter: str, given: Any, allowed: str) -> OptionError:
    """Return the error about what is no array of a shape."""
    shape = getattr(given, "shape", None)
    text = format_value(given)
    if isinstance(given, np.ndarray):
        text = "a complex array" if given.dtype.kind == "c" else "an array"
    if shape is not None:
        text += f" of shape {tuple(shape)}"
    return OptionError(Finding(parameter=parameter, found=text, allowed=allowed))


def _refuse_lengths_given_arrays(arrays: dict[str, Array_given_arrays | None]) -> None:
    """Raise an `OptionError` if some arrays do not have one length."""
    lengths = {name: len(array) for name, array in arrays.items() if array is not None}
    if len(set(lengths.values())) > 1:
        found = ", ".join(f"{rows} rows of {name}" for name, rows in lengths.items())
        raise OptionError(f"found {found}, allowed: as many of each")


def _names(names: Sequence[str], joints: int) -> Sequence[str]:
    """Return the names of the joints, by default q1, q2, ..."""
    if not names:
        return [f"q{k + 1}" for k in range(joints)]
    if len(names) != joints or len(set(names)) < joints:
        allowed = f"a name for each of the {joints} joints, each once"
        raise OptionError(Finding(parameter="names", found=", ".join(names), allowed=allowed))
    return names


def _units(joints: Sequence[str], robot: Chain | None, given: Collection[str]) -> Iterator[str]:
    """Yield the unit of each joint: m where it slides; none of an angle where that is given apart."""
    moving = robot.moving if robot is not None and len(robot.moving) == len(joints) else [None] * len(joints)
    for joint in moving:
        slides = joint is not None and joint.kind != "revolute"
        yield "m" if slides else "" if "" in given else "rad"
