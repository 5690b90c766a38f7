"""CSV and TUM: text that reads back bit for bit.

1. Times in integer [ns] are exact text (`format_times`), other numbers the shortest decimal text that gives
   the same double. Texts that a spreadsheet would run as a formula follow an apostrophe.
2. Columns are written in slices of rows (`write_lines`), and the file is read back: its head, number of rows,
   first and last row (`find_line_differences`).
3. The files: tables of an export (`write_csv`), trajectories (`write_tum`), joint values as a log that
   `ingest` reads (`write_joint_log`), tables of a presentation (`write_table`).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.logs.formats.cells import printable
from urmpipe_pipeline.logs.vocabulary import key
from urmpipe_pipeline.outputs import EXPORT_HEADER, TARGET_ROW
from urmpipe_pipeline.presentation.exports import DATE, DAY, TIME_OF_DAY, ExportTable, Poses, Times
from urmpipe_pipeline.presentation.section import Advice, Cell, Judged, Place, Ref, Table, Value
from urmpipe_pipeline.text import format_exact, to_csv_text

SLICE = 65_536  # rows written at a time: memory stays low
MAX_LAST_LINE = 1 << 16  # bytes of the last line

# Names and units of the columns of a trajectory, by which it is read back; a unit has no space before it.
TUM_HEAD = f"# {EXPORT_HEADER}\n# t[s] x[m] y[m] z[m] qx qy qz qw\n"

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}  # powers of ten from a unit to [ns]
HOUR = 3_600 * 10**9  # [ns]
_STEPS = ((10**9, "s"), (10**6, "ms"), (10**3, "us"), (1, "ns"))  # [ns], the coarsest first


def write_csv(table: ExportTable, path: Path) -> list[str]:
    """Write a table in UTF-8 with commas, and return how the file differs, read back.

    Numbers have the shortest decimal text that gives the same double, NaN is an empty cell; times are exact.
    """
    columns = table.columns
    return _write_columns(path, [column.name for column in columns], [column.values for column in columns])


def write_tum(poses: Poses, path: Path) -> list[str]:
    """Write a trajectory as evo reads it, `t x y z qx qy qz qw`, and return how the file differs, read back.

    Times are those of the log's clock in [s], exact in decimals.
    """
    columns = [Times(poses.clock_ns, "s"), *poses.position.T, *poses.quat_xyzw.T]
    return _write_and_compare(path, TUM_HEAD, columns, " ")


def write_joint_log(
    part: Path,
    path: Path,
    *,
    joints: Sequence[str],
    units: Sequence[str],
    q: FloatArray,
    row: IntArray,
    t_ns: IntArray | None = None,
    position: FloatArray | None = None,
    quat_xyzw: FloatArray | None = None,
    row_column: str = TARGET_ROW,
) -> int:
    """Write joint values as a CSV file and read it back.

    The columns are t (s), each joint with its unit, the tool centre point x (m), y (m), z (m), its
    orientation qx, qy, qz, qw, and the row that each sample belongs to; those of the tool begin with tcp_ if
    a joint has the name of one. Commas, decimal points, UTF-8. Times are exact, and other values have the
    shortest decimal text that gives the same double, joints neither wrapped nor unwrapped. A row without a
    value of a joint is left out, and the others keep their times.

    Args:
        part: Path to write to, of `safe_output` for the kind "joints", "plan" or "motion".
        path: Name of the file, for messages.
        joints: Names of the joints, in the robot's order; none for a path alone.
        units: Unit of each joint: rad or m.
        q: Joint values in `units`, shape (n, joints); NaN in a row without.
        row: Data row of each target or path row in its file, shape (n,).
        t_ns: Times in integer [ns], shape (n,); None writes no time.
        position: Position of the tool centre point in [m], shape (n, 3); None writes none.
        quat_xyzw: Orientation as unit quaternions [-], shape (n, 4); None writes none.
        row_column: Name of the last column: `TARGET_ROW`, `PATH_ROW` of a plan, or `MOTION_ROW` of a network.

    Returns:
        Number of rows that were written.

    Raises:
        OutputError: If there is no row to write, or it did not read back as it was written.
    """
    solved = np.isfinite(q).all(axis=1)
    if not solved.any():
        message = f"found no joint values for any of {len(q)} targets, allowed: at least one for a log"
        raise OutputError(Finding(message, str(path)))
    times = [] if t_ns is None else [Times(t_ns[solved], "s")]
    prefix = "tcp_" if {*map(key, joints)} & {*POSITION, *QUATERNION} else ""
    names = [
        *(["t (s)"] if times else []),
        *(f"{printable(name)} ({unit})" for name, unit in zip(joints, units, strict=True)),
        *([] if position is None else [f"{prefix}{axis} (m)" for axis in POSITION]),
        *([] if quat_xyzw is None else [f"{prefix}{name}" for name in QUATERNION]),
        row_column,
    ]
    parts = [values for values in (q, position, quat_xyzw) if values is not None]
    columns = [np.ascontiguousarray(column) for values in parts for column in values[solved].T]
    if differences := _write_columns(part, names, [*times, *columns, row[solved]]):
        raise OutputError(Finding(f"differs when read back: {', '.join(differences)}", str(path)))
    return int(solved.sum())


def write_table(table: Table, part: Path, path: Path) -> None:
    """Write a table of a presentation and read it back.

    The header has the keys of the columns. Numbers are in SI, in the shortest text that gives the same
    double; a cell is empty if it has no value.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    cells = zip(*(map(_format_cell, column.cells) for column in table.columns), strict=True)
    rows = [[to_csv_text(column.key) for column in table.columns], *map(list, cells)]
    with part.open("w", encoding="utf-8", errors="surrogateescape", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    with part.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
        if list(csv.reader(file)) != rows:
            raise OutputError(Finding("differs when read back", str(path)))


def _format_cell(cell: Cell) -> str:
    match cell:
        case Value():
            return format_exact(cell.number)
        case Judged():
            return cell.verdict or ""
        case Ref():
            return to_csv_text(cell.title)
        case Place():
            return " ".join(map(format_exact, cell.position))
        case Advice():
            return to_csv_text(cell.words)
        case _:
            return to_csv_text(cell or "")


# Lines


def _write_columns(path: Path, names: Sequence[str], columns: Sequence[Any]) -> list[str]:
    return _write_and_compare(path, ",".join(map(_quote, names)) + "\n", columns, ",")


def _write_and_compare(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> list[str]:
    cells = to_text_columns(columns)
    write_lines(path, head, cells, delimiter)
    return find_line_differences(path, head, cells, delimiter)


def to_text_columns(columns: Sequence[Any]) -> list[Any]:
    """Return columns as they are written: times as Arrow arrays of their text, all others as they are."""
    return [format_times(column) if isinstance(column, Times) else column for column in columns]


def write_lines(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> None:
    """Write a head and one line per row.

    Args:
        path: The file.
        head: Text above the rows, with its line end.
        columns: What `to_text_columns` returned, each of shape (n,); NaN is an empty cell.
        delimiter: Character between cells.
    """
    rows = len(columns[0])
    with path.open("wb") as file:
        file.write(head.encode())
        for start in range(0, rows, SLICE):
            file.write(_encode_lines([column[start : start + SLICE] for column in columns], delimiter))


def find_line_differences(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> list[str]:
    """Return what of a file differs from the lines written: head, number of rows, first and last row."""
    rows = len(columns[0])
    with path.open("rb") as file:
        differences = [] if file.read(len(head.encode())) == head.encode() else ["the head"]
        first = file.readline().decode(errors="replace")
        count = bool(first) + sum(block.count(b"\n") for block in iter(lambda: file.read(1 << 20), b""))
        file.seek(max(0, file.tell() - MAX_LAST_LINE))
        last = file.read().decode(errors="replace").rstrip("\n").rpartition("\n")[2]
    if count != rows:
        differences.append(f"{count} rows of {rows}")
    ends = {0: first.rstrip("\n"), rows - 1: last} if rows else {}
    return differences + [
        f"row {row + 1}" for row, line in ends.items() if not _has_values(line, columns, row, delimiter)
    ]


def _quote(cell: str) -> str:
    """Return a text as a cell of CSV, see `to_csv_text`, in quotes if it needs them."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([to_csv_text(cell)])
    return text.getvalue()


def _encode_lines(columns: Sequence[Any], delimiter: str) -> memoryview:
    import pyarrow.compute as pc

    missing = "" if len(columns) > 1 else '""'  # most readers skip an empty line
    cells = pc.binary_join_element_wise(*(_to_arrow_texts(column, missing) for column in columns), delimiter)
    lines = pc.binary_join_element_wise(cells, "", "\n")
    _, offsets, content = lines.buffers()
    ends = np.frombuffer(offsets, dtype=np.int32)[lines.offset : lines.offset + len(lines) + 1]
    return memoryview(content)[int(ends[0]) : int(ends[-1])]


def _to_arrow_texts(column: Any, missing: str) -> Any:
    import pyarrow as pa

    if not isinstance(column, np.ndarray):
        return column  # times are text already
    if column.dtype.kind == "U":
        names, numbers = np.unique(column, return_inverse=True)
        return pa.array(list(map(_quote, names.tolist())), pa.string()).take(pa.array(numbers))
    return pa.array(column, from_pandas=True).cast(pa.string()).fill_null(missing)


def _has_values(line: str, columns: Sequence[Any], row: int, delimiter: str) -> bool:
    """Return whether a line has the values of a row: the same numbers, all else the same characters."""
    cells = next(csv.reader([line], delimiter=delimiter), [])
    values = [column[row] if isinstance(column, np.ndarray) else column[row].as_py() for column in columns]
    return len(cells) == len(values) and all(map(_is_same, cells, values))


def _is_same(cell: str, value: Any) -> bool:
    if isinstance(value, np.str_):
        return cell == to_csv_text(value)
    if isinstance(value, str):  # a time, as it was written
        return cell == value
    try:
        return float(cell or "nan") == value or (cell == "" and bool(np.isnan(value)))
    except ValueError:
        return False


# Times


def format_times(times: Times) -> Any:
    """Return the exact text of times as an Arrow array, with the decimals that the finest of them needs."""
    common = int(np.gcd.reduce(times.ns)) if len(times.ns) else 0
    if times.unit == DATE:
        return _format_dates(times.ns, common)
    if times.unit == TIME_OF_DAY:
        return _format_times_of_day(times.ns, common)
    return _format_decimals(times.ns, EXPONENTS[times.unit], common)


def _format_decimals(ns: IntArray, decimals: int, common: int) -> Any:
    """Return ns / 10^decimals, multiples of `common`, as decimal text without common zeros at the end."""
    import pyarrow as pa
    import pyarrow.compute as pc

    while decimals and common % 10 == 0:
        common, ns, decimals = common // 10, ns // 10, decimals - 1
    if not decimals:
        return pa.array(ns).cast(pa.string())
    integers, fractions = np.divmod(np.abs(ns), 10**decimals)
    digits = pc.utf8_lpad(pa.array(fractions).cast(pa.string()), width=decimals, padding="0")
    return pc.binary_join_element_wise(_with_sign(ns, pa.array(integers).cast(pa.string())), digits, ".")


def _with_sign(ns: IntArray, texts: Any) -> Any:
    import pyarrow as pa
    import pyarrow.compute as pc

    return pc.binary_join_element_wise(pc.if_else(pa.array(ns < 0), "-", ""), texts, "")


def _format_dates(ns: IntArray, common: int) -> Any:
    """Return times from 1970 as ISO 8601; only the date if all are at midnight."""
    import pyarrow as pa
    import pyarrow.compute as pc

    stamps = pa.array(ns).cast(pa.timestamp("ns"))
    if common % DAY == 0:
        return stamps.cast(pa.date32()).cast(pa.string())
    return pc.replace_substring(stamps.cast(pa.timestamp(_coarsest_unit(common))).cast(pa.string()), " ", "T")


def _format_times_of_day(ns: IntArray, common: int) -> Any:
    """Return times from midnight as hh:mm:ss, with more hours or decimals where needed."""
    import pyarrow as pa
    import pyarrow.compute as pc

    unit = _coarsest_unit(common)
    kind = pa.time32(unit) if unit in ("s", "ms") else pa.time64(unit)
    hours, rest = np.divmod(np.abs(ns), HOUR)
    minutes = pa.array(rest).cast(pa.time64("ns")).cast(kind).cast(pa.string())  # 00:mm:ss
    texts = _with_sign(ns, pc.utf8_lpad(pa.array(hours).cast(pa.string()), width=2, padding="0"))
    return pc.binary_join_element_wise(texts, pc.utf8_slice_codeunits(minutes, 2), "")


def _coarsest_unit(common: int) -> str:
    return next(unit for step, unit in _STEPS if common % step == 0)
