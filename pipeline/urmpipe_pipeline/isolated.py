"""What a damaged file can abort is tried in its own process first: `python -m urmpipe_pipeline.isolated`.

Libraries in C and Rust end the whole process, by SIGSEGV or SIGABRT, where they meet bytes that they did not
expect, and no `except` catches that. A file that ended such a process is not read in this one.
"""

from __future__ import annotations

import pickle
import sys
from collections import deque
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from subprocess import DEVNULL, Popen, TimeoutExpired
from tempfile import TemporaryFile
from typing import Any, TypeAlias

from urmpipe_models.processes import describe_exit, limit_memory, module_command, module_environment

PATIENCE, RATE = 15.0, 5e6
"""Time in [s] that reading may take, and the bytes a second that give it more, far below any disk."""

Mark: TypeAlias = tuple[int, int, int, int]

_whole: deque[Mark] = deque(maxlen=256)
"""Files that this process has written and read back, or that have been read before: the last of them."""


def abort_of(path: Path, reader: str, meanwhile: Sequence[str] = ()) -> str:
    """Return how reading a file ends the process that does it; empty if it does not, see `read_apart`.

    What a process has read once, or written, is not tried again as long as it stays as it is.

    Raises:
        OSError: If there is no such file.
    """
    if _mark(path) in _whole:
        return ""
    try:
        read_apart(path, reader, meanwhile)
    except AbortError as error:
        return str(error)
    believe(path)
    return ""


class AbortError(Exception):
    """Reading a file ended the process that did it."""


def read_apart(path: Path, reader: str, meanwhile: Sequence[str] = ()) -> Any:
    """Return what a reader returns of a file, in a process of its own; in this one of a file known as whole.

    Args:
        path: The file.
        reader: The module whose `read_through` reads all of a file.
        meanwhile: Modules that are needed afterwards, imported while the other process runs.

    Raises:
        AbortError: With how that process ended.
        OSError: If there is no such file.
    """
    if _mark(path) in _whole:
        return import_module(reader).read_through(str(path))
    limit = PATIENCE + path.stat().st_size / RATE
    with TemporaryFile() as found:
        line = module_command(__name__, reader, str(path))
        process = Popen(line, stdin=DEVNULL, stdout=found, stderr=DEVNULL, env=module_environment())
        try:
            for name in meanwhile:
                import_module(name)
            code = process.wait(limit)
        except TimeoutExpired:
            raise AbortError(f"took more than {limit:.0f} s") from None
        finally:
            process.kill()
            process.wait()
        if code:
            raise AbortError(describe_exit(code))
        found.seek(0)
        return pickle.load(found)


def believe(path: Path) -> None:
    """Take a file as one that can be read in this process, as long as it stays as it is."""
    _whole.append(_mark(path))


def _mark(path: Path) -> Mark:
    """Return what changes when a file is written: its place on the disk, size and time."""
    state = path.stat()
    return state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns


if __name__ == "__main__":
    limit_memory()
    found = import_module(sys.argv[1]).read_through(sys.argv[2])
    pickle.dump(found, sys.stdout.buffer, protocol=pickle.HIGHEST_PROTOCOL)
