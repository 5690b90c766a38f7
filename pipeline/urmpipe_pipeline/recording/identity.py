"""What a file is: a recording at all, and one of ours."""

from __future__ import annotations

import re
import warnings
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from urmpipe_pipeline.outputs import know_own
from urmpipe_pipeline.recording.trial import recording_abort

if TYPE_CHECKING:
    from rerun.chunk import RrdReader, StoreEntry

APPLICATION_ID = "urmpipe"
"""The viewer's name for the program that made a recording."""

MAGIC = b"RRF"
"""Every .rrd starts so."""

FIRST_STORE = re.compile(
    rb"RRF2.{8}\x01\0{7}.{8}.{0,64}\x08\x01\x12.[\x20-\x7e]{1,99}\x1a\x09\x0a\x07urmpipe", re.DOTALL
)
"""How a recording begins that urmpipe wrote and nobody changed: the head of the file, that of its first
message, SetStoreInfo (1), and in it the store's kind, a recording (1), its identity and the application's."""

WHOLE = b"RRF2FOOT\x01\0\0\0"
"""How a whole .rrd ends that has one footer."""


def import_ahead() -> None:
    """Import what writes recordings in a thread of its own: most of a second, while a log is read.

    pandas is imported by pyarrow with the first array that it is given. Nobody waits for the thread: Ctrl-C
    may leave a lock of an import behind, for which it would wait forever.
    """
    names = ("rerun.blueprint", "pandas")
    Thread(target=lambda: [import_module(name) for name in names], daemon=True).start()


def is_recording(path: Path) -> bool:
    """Tell whether a file is a Rerun recording, whoever wrote it and whether it is whole or not."""
    if not path.is_file():  # opening a named pipe would wait for a writer
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def is_ours(path: Path) -> bool:
    """Tell whether a file is a recording that urmpipe wrote; one that cannot be read is not known to be."""
    if not is_recording(path):
        return False
    if _begins_as_ours(path):
        return True
    try:
        return not recording_abort(path) and bool(our_entries(open_reader(path)))
    except (RuntimeError, ValueError):
        return False


know_own("recording", is_ours)


def _begins_as_ours(path: Path) -> bool:
    """Tell whether the first bytes of a file and its last say already that it is ours.

    Rerun tells it of any file, but takes half a second to import, before the work of a command begins.
    """
    with path.open("rb") as file:
        head = file.read(256)
        file.seek(max(path.stat().st_size - len(WHOLE), 0))
        return file.read() == WHOLE and FIRST_STORE.match(head) is not None


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
