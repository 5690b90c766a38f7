"""Files whose columns have types: read as tables in memory."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.logs.formats.bag import MAGIC, is_bag_folder, is_packed
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.log_map import LogMap

HEAD = 128
"""Bytes at the start of a file that show its format."""


def read_typed(path: Path, options: LogMap) -> MemoryTable | None:
    """Return the table of a file of typed columns; None of any other file, which may be text.

    Args:
        path: The file.
        options: Which part of a file of several to read: `episode`, `sheet`, `topic`.

    Raises:
        LogError: If the file is damaged, or holds no table of columns.
    """
    head = _head(path)
    if head.startswith((b"PAR1", b"PARE")):
        from urmpipe_pipeline.logs.formats.parquet import read_parquet

        return read_parquet(path, head, options)
    if head.startswith(b"ARROW1"):
        from urmpipe_pipeline.logs.formats.parquet import read_feather

        return read_feather(path)
    if head.startswith(b"MATLAB 5.0 MAT-file"):
        from urmpipe_pipeline.logs.formats.matlab import read_mat

        return read_mat(path, head, options)
    if head.startswith((b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file")):
        import_optional("h5py", path, "an HDF5 file")
        from urmpipe_pipeline.logs.formats.matlab import read_hdf5

        return read_hdf5(path, options)
    if head.startswith(b"\x93NUMPY") or (head.startswith(b"PK\x03\x04") and path.suffix.lower() == ".npz"):
        from urmpipe_pipeline.logs.formats.arrays import read_numpy

        return read_numpy(path)
    is_recording = head.startswith(tuple(MAGIC)) or is_packed(path) or is_bag_folder(path)
    return _read_messages(path, options) if is_recording else None


def _read_messages(path: Path, options: LogMap) -> MemoryTable:
    for library in ("mcap.reader", "rosbags.typesys"):
        import_optional(library, path, "a recording of messages")
    from urmpipe_pipeline.logs.formats.bag_table import read_bag

    return read_bag(path, options)


def import_optional(library: str, path: Path, what: str) -> Any:
    """Return a library of the extra `logs`.

    Args:
        library: Its module.
        path: The file to be read.
        what: What the file is: "an HDF5 file".

    Raises:
        LogError: If the library is not installed.
    """
    try:
        return import_module(library)
    except ImportError:
        package = library.partition(".")[0].replace("_", "-")
        hint = Hint("", effect='install it: pip install "urmpipe[logs]"')
        finding = Finding(
            file=str(path), found=what, allowed=f"{what} with {package} installed", hints=(hint,)
        )
        raise LogError(finding) from None


def _head(path: Path) -> bytes:
    """Return how a file begins; nothing of one that cannot be read, of which its reader as text tells."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD)
    except OSError:
        return b""
