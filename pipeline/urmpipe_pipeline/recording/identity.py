"""What a file is: a recording at all, and one of ours."""

from __future__ import annotations

import sys
import threading
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rerun.chunk import RrdReader, StoreEntry

APPLICATION_ID = "urmpipe"
"""The viewer's name for the program that made a recording."""

MAGIC = b"RRF"
"""Every .rrd starts so."""


def warm_up(*, without_pandas: bool = False) -> threading.Thread:
    """Start to import Rerun in the background, so that it is there when it is needed.

    Importing it takes about half a second, which a command can spend on reading its input.

    Args:
        without_pandas: Keep pandas out of this process, which takes as long again. Only for a process
            that is a command of its own: pyarrow converts nothing to pandas in it any more.

    Returns:
        The thread at work; nobody needs to wait for it.
    """
    thread = threading.Thread(target=_import_rerun, args=(without_pandas,), name="import rerun")
    thread.start()
    return thread


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


def _import_rerun(without_pandas: bool) -> None:
    if without_pandas:
        _keep_pandas_out()
    import rerun.blueprint
    import rerun.chunk  # noqa: F401


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
