"""What a file is: a recording at all, and one of ours."""

from __future__ import annotations

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


def warm_up() -> threading.Thread:
    """Start to import Rerun in the background, so that it is there when it is needed.

    Importing it, and what it imports when it is first used, takes long enough to do it while a command
    reads its input.

    Returns:
        The thread at work; nobody needs to wait for it.
    """
    thread = threading.Thread(target=_import_rerun, name="import rerun")
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


def _import_rerun() -> None:
    import pandas  # noqa: F401  pyarrow does so itself with the first list that Rerun hands to it
    import rerun.blueprint
    import rerun.chunk  # noqa: F401
