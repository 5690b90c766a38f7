"""Which files are exports of ours: those that say so. A CSV cannot."""

from __future__ import annotations

from pathlib import Path

from urmpipe_pipeline.tables.metadata import MARK

HEAD = 128
"""The mark of a MAT or TUM file stands within so many bytes of its start."""

PARQUET = b"PAR1"
"""Every Parquet file starts so."""


def is_export(path: Path) -> bool:
    """Tell whether a file is a MAT, TUM or Parquet file that urmpipe exported."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.startswith(PARQUET):
        from urmpipe_pipeline.tables.parquet_file import is_ours

        return is_ours(path)
    return MARK.encode() in head and head.startswith((b"# ", b"MATLAB 5.0"))
