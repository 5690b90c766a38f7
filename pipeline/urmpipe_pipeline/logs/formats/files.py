"""Access to files: they stay as they are while they are read, and libraries that read them may crash.

1. `unchanged`: each file is read several times, so what a pipe of this process brings is kept first. A pipe
   in the place of a file, as a shell makes for `<(command)`, is open here under the number in its name: its
   bytes go into a file without a name that takes over that number. Other pipes and devices are no logs.
2. `import_optional`: a library of the extra `logs`, or the error that names it.
3. `read_separately`: the contents of a file whose library may crash, from a separate process.
4. `choose_part`: which of several tables of a file is read.
"""

from __future__ import annotations

import os
import re
import stat
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from pathlib import Path
from select import select
from tempfile import TemporaryFile
from typing import Any

from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.file_contents import PASSWORD
from urmpipe_pipeline.subprocess_reader import ReaderCrashError, read_in_subprocess

PIPE_TIMEOUTS = (5.0, 55.0)  # [s] without a byte until a silent pipe is named, and after that until it fails
MAX_CHOICES = 9  # of a question
MAX_PIPED = 4 << 30  # bytes of a pipe that are kept: one that never ends would fill the disk

_OWN_PIPE = re.compile(r"/(?:dev|proc/self)/fd/(\d{1,9})|/dev/stdin")
_KINDS = {
    stat.S_IFIFO: "a pipe with a name",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


@contextmanager
def unchanged(files: Collection[object]) -> Iterator[None]:
    """Hold that files stay as they are while they are read.

    Args:
        files: The files; what is no path is in memory.

    Raises:
        LogError: If one changed meanwhile, whatever else is wrong with it; if one cannot be read, or is a
            pipe that brings nothing or too much, or a device.
    """
    paths = [file for file in files if isinstance(file, Path)]
    for path in paths:
        _keep_piped(path)
    before = [_file_state(path) for path in paths]
    raised: Exception | None = None
    try:
        yield
    except Exception as error:
        raised = error
    changed = [path for path, state in zip(paths, before, strict=True) if _file_state(path) != state]
    if changed:
        fault = "changed while it was read, allowed: a file that no program still writes"
        raise LogError(*(Finding(fault, str(path)) for path in changed)) from raised
    if isinstance(raised, OSError):
        raise LogError(Finding(f"cannot be read: {raised.strerror or raised}", raised.filename)) from raised
    if raised is not None:
        raise raised


def _keep_piped(path: Path) -> None:
    """Keep what a pipe of this process brings, so that its name can be opened again and again."""
    state = _file_state(path)
    kind = None if state is None else stat.S_IFMT(state[0])
    if kind not in _KINDS:
        return
    pipe = _OWN_PIPE.fullmatch(str(path))
    if pipe is None or kind not in (stat.S_IFIFO, stat.S_IFSOCK):
        fault = f"found {_KINDS[kind]}, allowed: a file, which can be read more than once"
        raise LogError(Finding(fault, str(path)))
    number = int(pipe[1] or 0)
    try:
        with TemporaryFile() as copy:
            while block := _read_pipe(path, number):
                copy.write(block)
                if copy.tell() > MAX_PIPED:
                    fault = f"found more than {MAX_PIPED >> 30} GiB in a pipe, allowed: a file"
                    raise LogError(Finding(fault, str(path)))
            copy.flush()
            os.dup2(copy.fileno(), number, inheritable=False)
    except OSError as error:
        raise LogError(Finding(f"cannot be read: {error.strerror}", str(path))) from error


def _read_pipe(path: Path, number: int) -> bytes:
    """Return what a pipe brings next, nothing at its end."""
    for attempt, timeout in enumerate(PIPE_TIMEOUTS):
        if select([number], [], [], timeout)[0]:
            return os.read(number, 1 << 20)
        if not attempt:
            print(f"waiting for {path}, a pipe that brings nothing so far", file=sys.stderr, flush=True)
    fault = f"found a pipe that brings nothing for {sum(PIPE_TIMEOUTS):g} s, allowed: a log"
    raise LogError(Finding(fault, str(path)))


def _file_state(path: Path) -> tuple[int, ...] | None:
    """Return kind, identity, size and time of a file, which writing changes; None without a file."""
    try:
        state = path.stat()
    except OSError:
        return None
    except ValueError:
        raise LogError(f"found {format_value(str(path))}, allowed: the name of a file") from None
    if stat.S_ISDIR(state.st_mode):
        parts = (part.stat() for part in sorted(path.iterdir()))
        values = (value for part in parts for value in (part.st_ino, part.st_size, part.st_mtime_ns))
        return state.st_mode, *values
    return state.st_mode, state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns


def import_optional(library: str, path: Path, what: str) -> Any:
    """Return a library of the extra `logs`.

    Args:
        library: Its module.
        path: The file to be read.
        what: What the file is: "an HDF5 file".

    Raises:
        LogError: If the library is not installed.
    """
    try:
        return import_module(library)
    except ImportError:
        package = library.partition(".")[0].replace("_", "-")
        hint = Hint("", effect='install it: pip install "urmpipe[logs]"')
        allowed = f"{what} with {package} installed"
        raise LogError(Finding(file=str(path), found=what, allowed=allowed, hints=(hint,))) from None


def read_separately(path: Path, what: str, form: str, *arguments: str, hints: Sequence[Hint] = ()) -> Any:
    """Return the contents of a file, of which damaged bytes may end the process that reads them.

    Args:
        path: The file.
        what: What it is: "an HDF5 file".
        form: Its reader in `file_contents`.
        arguments: Further arguments of the reader.
        hints: Remedies if it is damaged.

    Raises:
        LogError: If it cannot be read, or needs a password.
    """
    try:
        contents, reason = read_in_subprocess(
            path, "urmpipe_pipeline.file_contents", arguments=(form, *arguments)
        )
    except ReaderCrashError as error:
        contents, reason = None, str(error)
    if reason == PASSWORD:
        raise password_error(path)
    if reason:
        fault = f"{what} that cannot be read ({reason})"
        raise LogError(Finding(file=str(path), found=fault, allowed="a whole one", hints=tuple(hints)))
    return contents


def password_error(path: Path) -> LogError:
    """Return the error about an encrypted workbook."""
    save = Hint("", effect="open it in a spreadsheet program and save it without a password, or as CSV")
    fault, allowed = "a workbook with a password", "a workbook without one"
    return LogError(Finding(file=str(path), found=fault, allowed=allowed, hints=(save,)))


def first_bytes(path: Path, count: int) -> bytes:
    """Return how a file begins; nothing of one that cannot be opened, which its reader as text reports."""
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError:
        return b""


def choose_part(path: Path, option: str, requested: str | None, choices: Mapping[str, str], what: str) -> str:
    """Return the part of a file that is read: the one that an option requests, or the only one.

    Args:
        path: The file.
        option: The option that selects one, such as "episode".
        requested: Its value, or None.
        choices: What each value reads, by value.
        what: What the parts are: "episodes".

    Raises:
        OptionError: If there is no such part.
        LogError: With the question which of several parts is read.
    """
    if requested in choices or (requested is None and len(choices) == 1):
        return requested or next(iter(choices))
    raise choice_error(path, option, requested, choices, what)


def choice_error(
    path: Path, option: str, requested: str | None, choices: Mapping[str, str], what: str
) -> LogError | OptionError:
    """Return the error that there is no requested part, or the question which is read; see `choose_part`."""
    shown = ", ".join([*choices][:MAX_CHOICES]) + ", ..." * (len(choices) > MAX_CHOICES)
    if requested is None:
        return question(path, f"{len(choices)} {what}: {shown}", option, choices.items())
    fault = format_value(requested)
    return OptionError(Finding(file=str(path), parameter=option, found=fault, allowed=shown))


def question(path: Path, fault: str, option: str, choices: Iterable[tuple[Any, str]]) -> LogError:
    """Return the question which table of a file is read: values of an option, each with what that reads."""
    hints = (Hint(option, value, f"reads {what}") for value, what in islice(choices, MAX_CHOICES))
    return LogError(Finding(file=str(path), found=fault, allowed="one", hints=tuple(hints)))
