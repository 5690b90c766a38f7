"""A table as a file in an FMU's resources, which the native runtime reads as well (native/runtime/table.c).

All of it little-endian: 8 bytes "URMTABLE", then as 64-bit integers the version of the layout, the number of
rows n and of columns; the n times in [ns] as int64; n rows of float64.
"""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np

from urmpipe_fmus.table import Table
from urmpipe_models.errors import Finding, FmuError, UnitError

TABLE_FILE = "resources/table.bin"
"""Where the file belongs in an FMU."""

_HEADER = struct.Struct("<8sQQQ")
_MAGIC = b"URMTABLE"
_VERSION = 1


def table_bytes(table: Table) -> bytes:
    """Return the content of a table's file."""
    header = _HEADER.pack(_MAGIC, _VERSION, *table.values.shape)
    return header + table.t_ns.astype("<i8").tobytes() + table.values.astype("<f8").tobytes()


def read_table(path: Path) -> Table:
    """Read a table's file.

    Raises:
        FmuError: If it cannot be read, or is another kind of file.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FmuError(Finding(f"cannot be read: {error.strerror}", file=str(path))) from error
    if len(content) < _HEADER.size or not content.startswith(_MAGIC):
        raise FmuError(Finding("found another kind of file, allowed: a table of urmpipe", file=str(path)))
    _, version, rows, columns = _HEADER.unpack_from(content)
    length = _HEADER.size + 8 * rows * (columns + 1)
    if version != _VERSION or len(content) != length:
        raise FmuError(
            Finding(
                f"found version {version}, {len(content)} bytes, allowed: version {_VERSION}, {length} bytes",
                file=str(path),
            )
        )
    times = np.frombuffer(content, "<i8", rows, _HEADER.size)
    values = np.frombuffer(content, "<f8", rows * columns, _HEADER.size + 8 * rows)
    try:
        return Table(times.astype(np.int64), values.reshape(rows, columns).astype(np.float64))
    except UnitError as error:
        raise FmuError(*(replace(one, file=str(path)) for one in error.findings)) from error
