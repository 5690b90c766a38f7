"""Arrays as tables: those of a file by name, of a NumPy file, and those that Python code gives.

1. `make_array_table`: the arrays of one length of a file (`array_choice` decides which) as columns.
   `read_numpy` loads them from .npy and .npz; `matlab` has those of MAT and HDF5 files.
2. `find_even_times`: the clock of a single number that is named like the time between samples.
3. `arrays_to_table`: times, joint values and a recorded tool centre point of Python code.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import IO, Any, TypeAlias
from zipfile import ZipFile

import numpy as np
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
from urmpipe_pipeline.array_choice import Choice, Name, Question, choose_arrays
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.files import choice_error
from urmpipe_pipeline.logs.formats.memory import ROLE, UNIT, MemoryTable, arrow_column
from urmpipe_pipeline.logs.formats.parquet import is_table
from urmpipe_pipeline.logs.formats.row_form import spread_names
from urmpipe_pipeline.logs.formats.text import check_unpacked_size, check_width
from urmpipe_pipeline.logs.formats.urmpipe_tables import FORM, GIVEN
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import SURELY_SECONDS, key, split_unit, vocabulary

MAX_LISTED = 9  # arrays that are not read, in a message
MAX_JOINT_ROWS = 16  # rows of an array without others that may have its joints as rows, if it is wider

Array: TypeAlias = NDArray[Any]
ArrayColumn: TypeAlias = tuple[Name, str, Array]  # groups and name, unit or "", values of shape (n,)

_NUMBERED = re.compile(r"\[\d+\]$")
_IN_ORDER = re.compile(r"(arr_\d+)?")  # the names of numpy.savez(file, t, q)
_NPY = b"\x93NUMPY"

# Arrays of a file


def make_array_table(
    path: Path,
    choice: Choice,
    columns: Iterable[ArrayColumn],
    scalars: Mapping[str, float],
    separator: str,
    options: LogMap,
    not_read: Sequence[str] = (),
    *,
    is_named: bool | None = None,
) -> MemoryTable:
    """Return the columns of some arrays as a table.

    A column is called by its groups, without those that all columns share. A clock is called by its name
    alone, if no other one is called so.

    Args:
        path: The file.
        choice: Which arrays of the file they are.
        columns: The columns.
        scalars: Single numbers of the file, of which one may be the time between samples.
        separator: Sign between groups in names.
        options: Of these `time` and `period`.
        not_read: The other arrays of the file, as a message lists them.
        is_named: Whether the columns have names; None: unless all are entries of one array.
    """
    columns = list(columns)
    check_width(len(columns), str(path))
    shared = 0
    if "topic" not in choice.applied:
        groups = zip(*(name[:-1] for name, _, _ in columns), strict=False)
        shared = sum(1 for _ in takewhile(lambda same: len(set(same)) == 1, groups))
    clocks = [k for k, (name, _, _) in enumerate(columns) if has_clock(name[-1:])]
    is_unique = all(np.array_equal(columns[k][2], columns[clocks[0]][2]) for k in clocks)
    named: dict[str, tuple[str, Array]] = {}
    for k, (name, unit, values) in enumerate(columns):
        if is_unique and k in clocks[1:]:
            continue
        label = name[-1] if is_unique and k in clocks else separator.join(name[shared:])
        named[label if label not in named else separator.join(name)] = unit, values
    numbers = {} if is_named is False else scalars
    times, reasons = find_even_times(path, numbers, named, choice.rows, options)
    named = {name: ("", values) for name, values in times.items()} | named
    fields, arrays = [], []
    for column, (unit, values) in named.items():
        arrays.append(pa.array(values.tolist()) if values.dtype == object else arrow_column(values))
        fields.append(pa.field(column, arrays[-1].type, metadata={UNIT: unit} if unit else None))
    if not_read:
        more = f" and {len(not_read) - MAX_LISTED} more" if len(not_read) > MAX_LISTED else ""
        rows = f"they have no column of {choice.rows} rows"
        reasons.append(Inference("arrays", f"{', '.join(not_read[:MAX_LISTED])}{more} are not read", rows))
    if is_named is None:
        patterns = vocabulary().joint["position"]
        is_named = len(choice.names) > 1 or not all(map(_NUMBERED.search, named))
        is_named = is_named or any(pattern.search(key([*named][-1])) for pattern in patterns)
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    return MemoryTable(path.stem, table, is_named, path, tuple(reasons), choice.applied)


def spread_array(name: Name, values: Array, rows: int) -> Iterator[ArrayColumn]:
    """Yield the columns of an array with samples along one of its axes: NAME, or NAME_1, NAME_2, ..."""
    matrix = (values if len(values) == rows else values.T).reshape(rows, -1)
    count = matrix.shape[1]
    labels = spread_names([name[-1]], [count if count > 1 or not name[-1] else 0])
    for label, column in zip(labels, matrix.T, strict=True):
        yield (*name[:-1], label if name[-1] else label[1:]), "", np.ascontiguousarray(column)


def settle_choice(path: Path, choice: Choice | Question) -> Choice:
    """Return the arrays of a table; raise the question which episode, or which of several lengths, it is."""
    if isinstance(choice, Choice):
        return choice
    what = "episodes" if choice.option == "episode" else "arrays, each of another length"
    raise choice_error(path, choice.option, choice.requested, dict(choice.choices), what)


# The clock of a number


def has_clock(names: Iterable[str]) -> bool:
    """Return whether a column is named like a time."""
    return any(pattern.search(key(split_unit(name)[0])) for name in names for pattern in vocabulary().time)


def find_even_times(
    path: Path, scalars: Mapping[str, float], names: Iterable[str], rows: int, options: LogMap
) -> tuple[dict[str, Array], list[Inference]]:
    """Return the column of even times in [ns], shape (rows,), of the number that is the time between samples.

    Args:
        path: The file.
        scalars: Its single numbers by name; one of more than 0.05 without a unit may be in s or in ms.
        names: Of its columns: if one is named like a time, it is the clock.
        rows: Number of rows.
        options: Of these `time` and `period`, which come first.

    Raises:
        LogError: With the question which time it is, if several numbers may be, or the unit is not clear.
    """
    if options.time is not None or options.period is not None or has_clock(names):
        return {}, []
    patterns = vocabulary().period
    periods = {
        name: value
        for name, value in scalars.items()
        if 0.0 < value < math.inf and any(pattern.search(key(split_unit(name)[0])) for pattern in patterns)
    }
    readings = [
        (seconds, f"{name} in {unit}")
        for name, value in periods.items()
        for seconds, unit in _in_seconds(name, value)
    ]
    if not readings:
        return {}, []
    period = readings[0][0]
    evidence = " and ".join(f"{name} = {value:g}" for name, value in periods.items())
    if any(not math.isclose(period, seconds, rel_tol=1e-9) for seconds, _ in readings):
        hints = tuple(Hint("period", float(f"{seconds:.12g}"), f"reads {what}") for seconds, what in readings)
        allowed = "one time between rows in s"
        raise LogError(Finding(file=str(path), found=evidence, allowed=allowed, hints=hints))
    times = np.rint(np.arange(rows) * (period * 1e9)).astype(np.int64)
    inference = Inference(
        "period", f"{period:g} s", f"{evidence} in the file", hints=(Hint("period"),), basis="named"
    )
    return {"t [ns]": times}, [inference]


def _in_seconds(name: str, value: float) -> list[tuple[float, str]]:
    """Return a time between samples in [s] by the unit in its name, or as it is small; else in each unit."""
    unit = vocabulary().unit(split_unit(name)[1] or "")
    if unit is not None and unit.quantity == "time":
        return [(value * unit.factor, unit.name)]
    return [(value, "s")] if value <= SURELY_SECONDS else [(value, "s"), (value / 1e3, "ms")]


# NumPy files


def read_numpy(path: Path, options: LogMap) -> MemoryTable:
    """Return the table of a .npy or .npz file. Objects are not loaded: that would run code of the file.

    Raises:
        LogError: If the file is damaged or has no table; with a question if it has several episodes, or
            arrays of several lengths.
    """
    try:
        stored = dict(_iter_stored(path))
    except LogError:
        raise
    except Exception as error:  # of damaged bytes NumPy and zipfile raise anything
        reason = (str(error) or type(error).__name__).splitlines()[0].rstrip(".")
        raise LogError(Finding(f"cannot be read: {reason}", file=str(path))) from None
    arrays = dict[Name, Array]()
    for name, array in stored.items():
        place = tuple(name.split("/"))
        if array is not None and array.dtype.names:
            arrays |= {(*place[:-1], field): array[field] for field in array.dtype.names}
        elif array is not None:
            arrays[place] = array
    tables = {
        name: array
        for name, array in arrays.items()
        if array.dtype.kind in "biufmM" and array.ndim in (1, 2) and array.size > 1
    }
    shapes = {name: array.shape for name, array in tables.items()}
    read = choose_arrays(shapes, options.episode, options.topic, separator="/", by_rows=True)
    choice = settle_choice(path, read)
    if not choice.names:
        raise LogError(_describe_no_table(path, stored))
    in_order = all(len(name) == 1 and _IN_ORDER.fullmatch(name[0]) for name in tables)
    wide = [a for a in tables.values() if a.ndim == 2 and len(a) <= MAX_JOINT_ROWS < a.shape[1]]
    is_named = not in_order and not len(tables) == len(wide) == 1  # joints as rows: a question
    depth = len(choice.group)
    spread = (spread_array(name[depth:], tables[name], choice.rows) for name in choice.names)
    scalars = {
        "/".join(name): float(array.item())
        for name, array in arrays.items()
        if array.size == 1 and array.dtype.kind in "uif"
    }
    left_out = [f"{'/'.join(name)} {tables[name].shape}" for name in choice.left_out]
    columns = (column for part in spread for column in part)
    return make_array_table(path, choice, columns, scalars, "/", options, left_out, is_named=is_named)


def _iter_stored(path: Path) -> Iterator[tuple[str, Array | None]]:
    """Yield the arrays of a file by name, "" if it is no archive; None instead of an array of objects."""
    with path.open("rb") as file:
        if file.read(len(_NPY)) == _NPY:
            file.seek(0)
            yield "", _read_array(file, file, path.stat().st_size)
            return
    with ZipFile(path) as archive:
        members = archive.infolist()
        check_width(len(members), str(path))
        check_unpacked_size(path, sum(member.file_size for member in members))
        for member in members:
            with archive.open(member) as header, archive.open(member) as data:
                yield member.filename.removesuffix(".npy"), _read_array(header, data, member.file_size)


def _read_array(header: IO[bytes], data: IO[bytes], size: int) -> Array | None:
    """Return an array whose header is read first, from the same bytes; None of one of objects.

    Raises:
        ValueError: If the header states more numbers than the bytes can hold.
    """
    version = np.lib.format.read_magic(header)
    is_old = version == (1, 0)
    read_header = np.lib.format.read_array_header_1_0 if is_old else np.lib.format.read_array_header_2_0
    shape, _, kind = read_header(header)
    if kind.hasobject:
        return None
    if not 0 <= math.prod(shape) * max(kind.itemsize, 1) <= size:
        raise ValueError(f"{kind} {shape} is more than {size} bytes hold")
    if data is header:
        data.seek(0)
    return np.asarray(np.lib.format.read_array(data, allow_pickle=False))


def _describe_no_table(path: Path, arrays: Mapping[str, Array | None]) -> Finding:
    """Return the finding about a file without a table; about a Python object with a command."""
    shapes = (f"{name or 'an array'} {array.shape}" for name, array in arrays.items() if array is not None)
    if (shown := ", ".join(shapes)) or "" not in arrays:
        allowed = "numbers in one or two dimensions, one row per sample"
        return Finding(file=str(path), found=shown or "no array of numbers", allowed=allowed)
    output = "log.npz" if path.name != "log.npz" else "table.npz"
    command = python_command(
        f"import numpy; numpy.savez({output!r},"
        f" **dict(numpy.load({path.as_posix()!r}, allow_pickle=True).item()))"
    )
    hint = Hint("", effect=f"only if you trust it, since loading it runs its code: {command}")
    return Finding(file=str(path), found="a Python object", allowed="arrays of numbers", hints=(hint,))


# Arrays of Python code

TIMES = "n times in s, or datetime64 or timedelta64"
JOINTS = "an array of shape (n, joints), in rad or m; a table is a log"
POSES = "an array of shape (n, 3), in m, (n, 7), with quaternions x, y, z, w after them, or (n, 4, 4)"
POSITION, QUATERNION = ("tcp_x", "tcp_y", "tcp_z"), ("tcp_qx", "tcp_qy", "tcp_qz", "tcp_qw")


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
        recorded_tcp: The recorded tool centre point in [m], shape (n, 3), with quaternions x, y, z, w, shape
            (n, 7), or as matrices, shape (n, 4, 4); None without one.
        names: Of the joints; by default q1, q2, ...
        name: What to call the log.
        robot: The arm: its prismatic joints have values in m.
        units: Columns by name whose unit is an option; "" for every angle.

    Raises:
        OptionError: With each array of another shape, or if they do not have one length.
    """
    parts = ((_times, t), (_joints, q), (_poses, recorded_tcp))
    times, values, poses = map_collecting_errors(
        lambda part: None if part[1] is None else part[0](part[1]), parts
    )
    if values is None and poses is None:
        raise OptionError(Finding(parameter="q", found="none", allowed=JOINTS))
    arrays = {"t": times, "q": values, "recorded_tcp": poses}
    lengths = {parameter: len(array) for parameter, array in arrays.items() if array is not None}
    if len(set(lengths.values())) > 1:
        fault = ", ".join(f"{rows} rows of {parameter}" for parameter, rows in lengths.items())
        raise OptionError(f"found {fault}, allowed: as many of each")
    columns: list[tuple[str, str, str, Any]] = []
    if times is not None:
        columns.append(("t", "" if times.dtype.kind in "mM" else "s", "time 0", times))
    if values is not None:
        count = values.shape[1]
        labels = names or [f"q{k + 1}" for k in range(count)]
        if len(labels) != count or len(set(labels)) < count:
            allowed = f"a name for each of the {count} joints, each once"
            raise OptionError(Finding(parameter="names", found=", ".join(names), allowed=allowed))
        moving = robot.moving if robot is not None and len(robot.moving) == count else [None] * count
        for k, (label, joint) in enumerate(zip(labels, moving, strict=True)):
            angle = "" if "" in units else "rad"
            unit = "m" if joint is not None and joint.kind != "revolute" else angle
            columns.append((label, unit, f"joint {k}", values[:, k]))
    if poses is not None:
        labels = [*POSITION, *QUATERNION][: poses.shape[1]]
        roles = [("m", f"position {k}") for k in range(3)] + [("", f"rotation {k}") for k in range(4)]
        columns += [
            (label, *role, poses[:, k]) for k, (label, role) in enumerate(zip(labels, roles, strict=False))
        ]
    arrow = [arrow_column(array) for *_, array in columns]
    fields = [
        pa.field(label, array.type, metadata={UNIT: "" if label in units else unit, ROLE: role})
        for (label, unit, role, _), array in zip(columns, arrow, strict=True)
    ]
    schema = pa.schema(fields, {GIVEN: "", FORM: "quat_xyzw"})
    return MemoryTable(name, pa.Table.from_arrays(arrow, schema=schema))


def _times(t: Any) -> Array:
    """Return times as an array of shape (n,)."""
    try:
        array = np.asarray(np.ma.filled(t, np.nan) if isinstance(t, np.ma.MaskedArray) else t)
        array = array if array.dtype.kind != "O" else array.astype("datetime64[ns]")
        array = array if array.dtype.kind in "mMiuc" else array.astype(np.float64)
    except (TypeError, ValueError):
        raise _shape_error("t", t, TIMES) from None
    if array.ndim != 1 or not len(array) or array.dtype.kind == "c":
        raise _shape_error("t", t, TIMES)
    return array


def _joints(q: Any) -> FloatArray:
    """Return joint values as an array of shape (n, joints)."""
    return _numbers("q", q, JOINTS, lambda array: array.ndim == 2)


def _poses(poses: Any) -> FloatArray:
    """Return positions, and quaternions where there are orientations, of shape (n, 3) or (n, 7)."""
    shapes = (3,), (7,), (4, 4)
    array = _numbers("recorded_tcp", poses, POSES, lambda array: array.shape[1:] in shapes)
    if array.ndim == 2:
        return array
    from urmpipe_models.math3d import to_quaternions

    quaternions = to_quaternions(array[:, :3, :3].reshape(-1, 9), "matrix")
    return np.column_stack([array[:, :3, 3], quaternions])


def _numbers(parameter: str, value: Any, allowed: str, fits: Callable[[FloatArray], bool]) -> FloatArray:
    """Return numbers of a shape that fits as an array, NaN where they are masked."""
    try:
        array = np.ma.asanyarray(value)
        if not is_table(value) and array.dtype.kind != "c":
            numbers = np.asarray(np.ma.filled(array.astype(np.float64), np.nan))
            if numbers.size and fits(numbers):
                return numbers
    except (TypeError, ValueError):
        pass
    raise _shape_error(parameter, value, allowed)


def _shape_error(parameter: str, value: Any, allowed: str) -> OptionError:
    shape = getattr(value, "shape", None)
    text = format_value(value)
    if isinstance(value, np.ndarray):
        text = "a complex array" if value.dtype.kind == "c" else "an array"
    if shape is not None:
        text += f" of shape {tuple(shape)}"
    return OptionError(Finding(parameter=parameter, found=text, allowed=allowed))
