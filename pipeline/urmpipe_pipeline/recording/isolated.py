"""A recording is read in a process of its own before it is read here: a damaged one can abort Rerun's reader.

Rerun is written in Rust and aborts the whole process where it meets bytes that it did not expect, which no
`except` catches. What ended that process is not read in this one.
"""

from __future__ import annotations

import sys
from collections import deque
from pathlib import Path
from subprocess import DEVNULL, Popen, TimeoutExpired
from typing import TypeAlias

from urmpipe_models.processes import command, ending, environment, limit_memory

PATIENCE, RATE = 60.0, 5e6
"""Time in [s] that reading may take, and the bytes a second that give it more, far below any disk."""

Mark: TypeAlias = tuple[int, int, int, int]

_whole: deque[Mark] = deque(maxlen=256)
"""Files that this process has written and read back, or that have been read before: the last of them."""


def abort_of(path: Path) -> str:
    """Return how reading a recording ends the process that does it; empty if it does not.

    Raises:
        OSError: If the file cannot be read.
    """
    mark = _mark(path)
    if mark in _whole:
        return ""
    process = Popen(
        command(__name__, str(path)), stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL, env=environment()
    )
    limit = PATIENCE + mark[2] / RATE
    try:
        import rerun.chunk  # noqa: F401 - takes half a second, meanwhile

        code = process.wait(limit)
    except TimeoutExpired:
        return f"took more than {limit:.0f} s"
    finally:
        process.kill()
        process.wait()
    if code:
        return ending(code)
    believe(path)
    return ""


def believe(path: Path) -> None:
    """Take a file as one that can be read in this process, as long as it stays as it is."""
    _whole.append(_mark(path))


def _mark(path: Path) -> Mark:
    """Return what changes when a file is written: its place on the disk, size and time."""
    state = path.stat()
    return state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns


def read_all(path: str) -> None:
    """Read all that stands in a recording; what its reader refuses in an orderly way is told elsewhere.

    Rerun's own classes round these take half a second to import.
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


if __name__ == "__main__":
    limit_memory()
    read_all(sys.argv[1])
