"""A way from Rerun to the file on which an error is an error.

Rerun's own file sink waits forever for its writing thread once that has failed, for example on a full
disk: the process never ends. So Rerun writes into a named pipe, and the file is written here.
"""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

PIECE = 2**20
"""Bytes copied at a time, at most."""


@contextmanager
def piped(path: Path) -> Iterator[Path]:
    """Give Rerun a place to write to; what it writes stands in `path` at the end.

    Where there are no named pipes (Windows), the place is the path itself.

    Args:
        path: The file to write; nothing may be there yet.

    Yields:
        What to hand to Rerun, once.

    Raises:
        OSError: If the file cannot be written.
    """
    if not hasattr(os, "mkfifo"):
        yield path
        return
    failed: list[Exception] = []
    with path.open("xb") as file, TemporaryDirectory(prefix="urmpipe-") as folder:
        pipe = Path(folder) / "pipe"
        os.mkfifo(pipe)
        source = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        os.set_blocking(source, True)
        # The pipe ends when nobody has it open for writing: not before Rerun has come, and if it never comes.
        held = os.open(pipe, os.O_WRONLY)
        copier = threading.Thread(target=_copy, args=(source, file, failed), name="write recording")
        copier.start()
        try:
            yield pipe
        finally:
            os.close(held)
            copier.join()
    if failed:
        raise failed[0]


def _copy(pipe: int, file: BinaryIO, failed: list[Exception]) -> None:
    """Copy all that comes out of the pipe; after an error drop it, for Rerun must not get stuck."""
    with open(pipe, "rb", buffering=0) as source:
        try:
            shutil.copyfileobj(source, file, PIECE)
        except Exception as error:
            failed.append(error)
            while source.read(PIECE):
                pass
