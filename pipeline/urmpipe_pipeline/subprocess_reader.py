"""Read a file that may crash its reader in a separate process first.

Libraries in C and Rust end the whole process, by SIGSEGV or SIGABRT, where they meet unexpected bytes, and
`except` does not catch that. A file that ended the separate process is not read in this one. A file that this
process has written and read back, or that was read before, is read directly as long as it is not changed.

The separate process runs `python -m urmpipe_pipeline.subprocess_reader READER PATH ARGUMENTS`. A reader is a
module with a function `read_through(path, *arguments)`, which reads everything that is needed of a file.
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

READ_TIMEOUT = 15.0  # [s] for reading, plus the size of the file at
MIN_READ_RATE = 5e6  # [bytes/s], far below any disk

FileState: TypeAlias = tuple[int, int, int, int]  # device, inode, size, time of the last change in [ns]

_safe: deque[FileState] = deque(maxlen=256)  # the last files that can be read in this process


class ReaderCrashError(Exception):
    """Reading a file ended the process that read it."""


def find_crash(path: Path, reader: str, meanwhile: Sequence[str] = ()) -> str:
    """Return how reading a file ends the process that reads it; empty if it does not.

    Arguments as of `read_in_subprocess`. An unchanged file is tried once.

    Raises:
        OSError: If there is no such file.
    """
    if _file_state(path) in _safe:
        return ""
    try:
        read_in_subprocess(path, reader, meanwhile)
    except ReaderCrashError as error:
        return str(error)
    mark_safe(path)
    return ""


def read_in_subprocess(
    path: Path, reader: str, meanwhile: Sequence[str] = (), arguments: Sequence[str] = ()
) -> Any:
    """Return the result of a reader of a file, from a separate process; from this one of a safe file.

    Args:
        path: The file.
        reader: Name of the module whose `read_through` reads everything in a file.
        meanwhile: Modules that are needed afterwards, imported while the other process runs.
        arguments: Further arguments of `read_through`.

    Raises:
        ReaderCrashError: With how that process ended.
        OSError: If there is no such file.
    """
    if _file_state(path) in _safe:
        return import_module(reader).read_through(str(path), *arguments)
    timeout = READ_TIMEOUT + path.stat().st_size / MIN_READ_RATE
    with TemporaryFile() as output:
        command = module_command(__name__, reader, str(path), *arguments)
        process = Popen(command, stdin=DEVNULL, stdout=output, stderr=DEVNULL, env=module_environment())
        try:
            for name in meanwhile:
                import_module(name)
            code = process.wait(timeout)
        except TimeoutExpired:
            raise ReaderCrashError(f"took more than {timeout:.0f} s") from None
        finally:
            process.kill()
            process.wait()
        if code:
            raise ReaderCrashError(describe_exit(code))
        output.seek(0)
        return pickle.load(output)


def mark_safe(path: Path) -> None:
    """Mark a file as one that can be read in this process, as long as it is not changed."""
    _safe.append(_file_state(path))


def _file_state(path: Path) -> FileState:
    state = path.stat()
    return state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns


if __name__ == "__main__":
    limit_memory()
    result = import_module(sys.argv[1]).read_through(*sys.argv[2:])
    pickle.dump(result, sys.stdout.buffer, protocol=pickle.HIGHEST_PROTOCOL)
