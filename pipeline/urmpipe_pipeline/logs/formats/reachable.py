"""Files that stay: each is read several times, so what a pipe of ours brings is kept first.

A pipe in the place of a file, as a shell makes for `<(command)`, is open here under the number in its name:
its bytes go into a file without a name that takes over that number. Other pipes, sockets and devices are no
logs.
"""

from __future__ import annotations

import os
import re
import stat
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from select import select
from tempfile import TemporaryFile

from urmpipe_models.errors import Finding, LogError, format_value

WAITS_S = (5.0, 55.0)
"""Seconds without a byte after which a pipe that brings nothing is named, and those until it is given up."""

MOST_PIPED = 4 << 30
"""Bytes of a pipe that are kept: one that never ends would fill the disk."""

_OWN = re.compile(r"/(?:dev|proc/self)/fd/(\d{1,9})|/dev/stdin")
_KINDS = {
    stat.S_IFIFO: "a pipe with a name",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}

State = tuple[int, ...]


def made_regular(path: Path) -> None:
    """Keep what a pipe of this process brings, so that its name can be opened again and again.

    Raises:
        LogError: If it is neither such a pipe nor a file or folder, or brings nothing, or too much.
    """
    state = _state(path)
    if state is None or stat.S_IFMT(state[0]) not in _KINDS:
        return
    own = _OWN.fullmatch(str(path))
    if own is None or stat.S_IFMT(state[0]) not in (stat.S_IFIFO, stat.S_IFSOCK):
        found = f"found {_KINDS[stat.S_IFMT(state[0])]}, allowed: a file, which can be read more than once"
        raise LogError(Finding(found, str(path)))
    number = int(own[1] or 0)
    try:
        with TemporaryFile() as kept:
            for block in _blocks(path, number):
                kept.write(block)
            kept.flush()
            os.dup2(kept.fileno(), number, inheritable=False)
    except OSError as error:
        raise LogError(Finding(f"cannot be read: {error.strerror}", str(path))) from error


def _blocks(path: Path, number: int) -> Iterator[bytes]:
    """Yield what a pipe brings until it ends."""
    left = MOST_PIPED
    while block := _block(path, number):
        left -= len(block)
        if left < 0:
            raise LogError(
                Finding(f"found more than {MOST_PIPED >> 30} GiB in a pipe, allowed: a file", str(path))
            )
        yield block


def _block(path: Path, number: int) -> bytes:
    """Return what a pipe brings next, nothing at its end."""
    for told, wait in enumerate(WAITS_S):
        if select([number], [], [], wait)[0]:
            return os.read(number, 1 << 20)
        if not told:
            print(f"waiting for {path}, a pipe that brings nothing so far", file=sys.stderr, flush=True)
    raise LogError(
        Finding(f"found a pipe that brings nothing for {sum(WAITS_S):g} s, allowed: a log", str(path))
    )


@contextmanager
def unchanged(files: Collection[object]) -> Iterator[None]:
    """Hold that files stay as they are while they are read.

    Args:
        files: The files; what is no path is in memory.

    Raises:
        LogError: If one changed meanwhile, whatever else was found wrong with it; or cannot be read.
    """
    paths = [file for file in files if isinstance(file, Path)]
    for path in paths:
        made_regular(path)
    before = [_state(path) for path in paths]
    try:
        yield
    except Exception as error:
        _refuse_changed(paths, before)
        if isinstance(error, OSError):
            raise LogError(Finding(f"cannot be read: {error.strerror or error}", error.filename)) from error
        raise
    _refuse_changed(paths, before)


def _refuse_changed(paths: Sequence[Path], before: Sequence[State | None]) -> None:
    """Raise with each file that is another than before."""
    found = "changed while it was read, allowed: a file that no program still writes"
    changed = [path for path, state in zip(paths, before, strict=True) if _state(path) != state]
    if changed:
        raise LogError(*(Finding(found, str(path)) for path in changed))


def _state(path: Path) -> State | None:
    """Return kind, identity, size and time of a file, which writing changes; None if it is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    except ValueError:
        raise LogError(f"found {format_value(str(path))}, allowed: the name of a file") from None
    if stat.S_ISDIR(found.st_mode):
        parts = (part.stat() for part in sorted(path.iterdir()))
        return (
            found.st_mode,
            *(value for part in parts for value in (part.st_ino, part.st_size, part.st_mtime_ns)),
        )
    return found.st_mode, found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns
