"""What a damaged file can abort is tried in its own process first: `python -m urmpipe_pipeline.isolated`.

Libraries in C and Rust end the whole process, by SIGSEGV or SIGABRT, where they meet bytes that they did not
expect, and no `except` catches that. A file that ended such a process is not read in this one.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from subprocess import DEVNULL, Popen, TimeoutExpired
from typing import TypeAlias

from urmpipe_models.processes import command, ending, environment, limit_memory

PATIENCE, RATE = 60.0, 5e6
"""Time in [s] that reading may take, and the bytes a second that give it more, far below any disk."""

Mark: TypeAlias = tuple[int, int, int, int]

_whole: deque[Mark] = deque(maxlen=256)
"""Files that this process has written and read back, or that have been read before: the last of them."""


def abort_of(path: Path, reader: str, meanwhile: Sequence[str] = ()) -> str:
    """Return how reading a file ends the process that does it; empty if it does not.

    Args:
        path: The file.
        reader: The module whose `read_through` reads all of a file.
        meanwhile: Modules that are needed afterwards, imported while the other process runs.

    Raises:
        OSError: If there is no such file.
    """
    mark = _mark(path)
    if mark in _whole:
        return ""
    process = Popen(
        command(__name__, reader, str(path)), stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL, env=environment()
    )
    limit = PATIENCE + mark[2] / RATE
    try:
        for name in meanwhile:
            import_module(name)
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


if __name__ == "__main__":
    limit_memory()
    import_module(sys.argv[1]).read_through(sys.argv[2])
