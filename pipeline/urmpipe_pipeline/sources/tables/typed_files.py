"""Files whose columns have types: read as tables in memory."""

from __future__ import annotations

from pathlib import Path

from urmpipe_pipeline.sources.tables.held import MemoryTable

HEAD = 128
"""Bytes at the start of a file that tell what it is."""


def read_typed(path: Path) -> MemoryTable | None:
    """Return the table of a file of typed columns; None of any other file, which may be text.

    Raises:
        LogError: If the file is damaged, or holds no table of columns.
    """
    head = _head(path)
    if head.startswith((b"PAR1", b"PARE")):
        from urmpipe_pipeline.sources.tables.parquet_file import read_parquet

        return read_parquet(path, head)
    if head.startswith(b"ARROW1"):
        from urmpipe_pipeline.sources.tables.parquet_file import read_feather

        return read_feather(path)
    if head.startswith(b"MATLAB 5.0 MAT-file"):
        from urmpipe_pipeline.sources.tables.mat_file import read_mat

        return read_mat(path, head)
    if head.startswith(b"\x93NUMPY") or (head.startswith(b"PK\x03\x04") and path.suffix.lower() == ".npz"):
        from urmpipe_pipeline.sources.tables.numpy_file import read_numpy

        return read_numpy(path)
    return None


def _head(path: Path) -> bytes:
    """Return how a file begins; nothing of one that cannot be read, of which its reader as text tells."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD)
    except OSError:
        return b""
