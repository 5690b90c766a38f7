"""Writing files so that they are whole or not there: beside their places first, then renamed, all or none."""

from __future__ import annotations

import atexit
import os
import signal
import threading
import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from urmpipe_models.errors import Finding, OutputError
from urmpipe_models.files import keep_permissions


@dataclass(frozen=True, slots=True)
class Pending:
    """A file that is being written.

    Attributes:
        part: Where it is written.
        path: Its own place.
    """

    part: Path
    path: Path


_together: ContextVar[list[Pending] | None] = ContextVar("files that get their names together", default=None)

_parts: set[Path] = set()
"""Files that are being written now, by any thread: what is left of them at the end of Python is removed."""


@contextmanager
def placed(path: Path) -> Iterator[Path]:
    """Give a place to write a file to, and put it in its own place once it is written.

    The place is a new name with the suffix .part in the same folder, and nothing is there yet. It is renamed
    to `path` if the body succeeds, and removed if it fails; an existing file is untouched until the rename,
    and gives its permissions to the new one.
    Within `all_or_none` it is renamed at the end of that.

    Raises:
        OutputError: If it could not be written.
    """
    with all_or_none() as pending:
        part = _beside(path)
        pending.append(Pending(part, path))
        with _named(path):
            yield part
            keep_permissions(part, path)
            part.stat()


@contextmanager
def all_or_none() -> Iterator[list[Pending]]:
    """Put the files that are written in the body in their places together, once all of them are written.

    All or none: what stood in their places is moved aside before the first of several is put there, so that
    no new file ever stands beside an old one, and back if one cannot be put there.

    Raises:
        OutputError: If one cannot be put in its place.
    """
    outer = _together.get()
    if outer is not None:
        yield outer
        return
    pending: list[Pending] = []
    token = _together.set(pending)
    try:
        yield pending
        with interrupts_held_back():
            _place(pending)
    finally:
        with interrupts_held_back():
            _together.reset(token)
            _remove(one.part for one in pending)


def _beside(path: Path) -> Path:
    """Return a new name in the same folder."""
    part = path.with_name(f"{path.stem[:40]}.{uuid.uuid4().hex[:12]}.part")
    _parts.add(part)
    return part


def _place(pending: Sequence[Pending]) -> None:
    """Give files their names: a single one replaces what is there at once, several do so all or none."""
    aside: list[Pending] = []
    done: list[Pending] = []
    try:
        for path in (one.path for one in pending if len(pending) > 1 and one.path.exists()):
            aside.append(Pending(_beside(path), path))
            with _named(path):
                path.rename(aside[-1].part)
        for one in pending:
            with _named(one.path):
                one.part.replace(one.path)
            done.append(one)
    except OutputError:
        for one in done:
            one.path.replace(one.part)
        for one in aside:
            with suppress(FileNotFoundError):  # the one that could not be moved
                one.part.replace(one.path)
        raise
    finally:
        _remove(one.part for one in aside)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Turn what the system says against writing into an `OutputError` that names the file."""
    try:
        yield
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)  # libraries add words of their own
        raise OutputError(Finding(f"cannot be written: {why}", str(path))) from error


def _remove(parts: Iterable[Path]) -> None:
    """Remove files that were being written."""
    for part in parts:
        with suppress(OSError):  # the folder is gone, or may not be written any more
            part.unlink(missing_ok=True)
        _parts.discard(part)


atexit.register(lambda: _remove(list(_parts)))


@contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait until the body is done, which must be short."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    if threading.current_thread() is not threading.main_thread() or None in before.values():
        yield
        return
    came: list[int] = []
    for number in before:
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])
