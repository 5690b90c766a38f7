"""What a file is: a recording, one that urmpipe wrote, and one that can be read without a crash.

Of a file that urmpipe wrote and nobody changed, the first and the last bytes show it. Rerun shows it of any
file, but takes half a second to import, and a damaged file may abort the process that reads it: so a file
that this process did not write is first read in a separate process (`find_crash`).
"""

from __future__ import annotations

import re
import sys
import warnings
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from urmpipe_pipeline import subprocess_reader
from urmpipe_pipeline.outputs import register_owner_check

if TYPE_CHECKING:
    from rerun.chunk import RrdReader, StoreEntry

APPLICATION_ID = "urmpipe"  # the viewer's name for the program that made a recording

MAGIC = b"RRF"  # first bytes of every .rrd
END_MARKER = b"RRF2FOOT\x01\0\0\0"  # last bytes of a complete .rrd with one footer

# First bytes of a recording that urmpipe wrote: the head of the file, that of its first message, SetStoreInfo
# (1), and in it the kind of the store, a recording (1), its identity and that of the application.
FIRST_STORE = re.compile(
    rb"RRF2.{8}\x01\0{7}.{8}.{0,64}\x08\x01\x12.[\x20-\x7e]{1,99}\x1a\x09\x0a\x07urmpipe", re.DOTALL
)


def is_recording(path: Path) -> bool:
    """Return whether a file is a Rerun recording, of any program, complete or not."""
    if not path.is_file():  # opening a named pipe would wait for a writer
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def is_ours(path: Path) -> bool:
    """Return whether a file is a recording that urmpipe wrote; False for one that cannot be read."""
    if not is_recording(path):
        return False
    with path.open("rb") as file:
        head = file.read(256)
        file.seek(max(path.stat().st_size - len(END_MARKER), 0))
        if file.read() == END_MARKER and FIRST_STORE.match(head):
            return True
    try:
        return not find_crash(path) and bool(own_entries(open_reader(path)))
    except (RuntimeError, ValueError):
        return False


register_owner_check("recording", is_ours)


def open_reader(path: Path) -> RrdReader:
    """Return Rerun's reader of a file.

    Raises:
        RuntimeError: If the file was cut off within a message, or is no recording.
    """
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Rerun warns of a missing footer; our error says so in one line
        return RrdReader(path)


def own_entries(reader: RrdReader) -> list[StoreEntry]:
    """Return the recordings in a file that urmpipe wrote."""
    return [entry for entry in reader.recordings() if entry.application_id == APPLICATION_ID]


def find_crash(path: Path) -> str:
    """Return how reading a recording ends the process that reads it; empty if it does not."""
    return subprocess_reader.find_crash(path, __name__, meanwhile=("rerun.chunk",))


def read_through(path: str) -> None:
    """Read everything in a recording, in a separate process; errors that its reader raises are no crash.

    Rerun's classes for readers take half a second to import, its bindings do not.
    """
    from rerun_bindings import RrdReaderInternal

    try:
        reader = RrdReaderInternal(path)
        for entry in reader.store_entries():
            store = reader.store(store=entry)
            store.summary()
            for chunk in store.stream().to_chunks():
                chunk.to_record_batch()
    except (RuntimeError, ValueError):
        pass


def preload_writer(*, pandas: bool = True) -> None:
    """Import what writes recordings in another thread: most of a second, while a log is read.

    pyarrow imports pandas with the first array that it is given. Nothing waits for the thread: Ctrl-C may
    leave a lock of an import, for which it would wait forever.

    Args:
        pandas: Whether pyarrow can convert to pandas afterwards. Without that, recordings are written as they
            are with it, and 300 modules are not imported.
    """
    if not pandas and "pandas" not in sys.modules:
        _hide_pandas()
    names = ("rerun.blueprint", "pandas") if pandas else ("rerun.blueprint",)
    Thread(target=lambda: [import_module(name) for name in names], daemon=True).start()


def _hide_pandas() -> None:
    """Let pyarrow look for pandas while it cannot be found: once for arrays and once for other values."""
    import numpy as np
    import pyarrow as pa

    class Finder:
        @staticmethod
        def find_spec(name: str, path: object = None, target: object = None) -> None:
            if name == "pandas":
                raise ModuleNotFoundError(name)

    sys.meta_path.insert(0, Finder)
    try:
        pa.array(np.zeros(1))
        pa.scalar(0)
    finally:
        sys.meta_path.remove(Finder)
