"""What a file is: a recording at all, and one of ours."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rerun.chunk import RrdReader, StoreEntry

APPLICATION_ID = "urmpipe"
"""The viewer's name for the program that made a recording."""

MAGIC = b"RRF"
"""Every .rrd starts so."""


def load_rerun(*, without_pandas: bool = False) -> None:
    """Import all of Rerun that is used, in the thread of the caller.

    It must be there before other threads work: two threads that import at once can see each other's
    packages half initialized.

    Args:
        without_pandas: Keep pandas out of this process, which takes as long again to import. Only for a
            process that is a command of its own: pyarrow converts nothing to pandas in it any more.
    """
    if without_pandas:
        _keep_pandas_out()
    import rerun.blueprint
    import rerun.chunk  # noqa: F401


def is_recording(path: Path) -> bool:
    """Tell whether a file is a Rerun recording, whoever wrote it and whether it is whole or not."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def is_ours(path: Path) -> bool:
    """Tell whether a file is a recording that urmpipe wrote; one that cannot be read is not known to be."""
    if not is_recording(path):
        return False
    try:
        return bool(our_entries(open_reader(path)))
    except (RuntimeError, ValueError):
        return False


def open_reader(path: Path) -> RrdReader:
    """Return Rerun's reader of a file.

    Raises:
        RuntimeError: If the file was cut off within a message, or is no recording.
    """
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        # It warns of a missing footer; we say so ourselves, in one line.
        warnings.simplefilter("ignore")
        return RrdReader(path)


def our_entries(reader: RrdReader) -> list[StoreEntry]:
    """Return the recordings in a file that urmpipe wrote."""
    return [entry for entry in reader.recordings() if entry.application_id == APPLICATION_ID]


class _NoPandas:
    """An import finder that does not find pandas."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        """Raise for pandas, and leave all else to the other finders."""
        if name == "pandas":
            raise ModuleNotFoundError("pandas is kept out of this process", name=name)


def _keep_pandas_out() -> None:
    """Let pyarrow find that pandas is not there, once and for all.

    Otherwise it imports pandas (0.4 s, 32 MB) to see whether the first list that it converts is a Series.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa

    sys.meta_path.insert(0, _NoPandas)
    try:
        pa.array([0])
    finally:
        sys.meta_path.remove(_NoPandas)
