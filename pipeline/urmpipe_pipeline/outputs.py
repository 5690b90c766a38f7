"""Writing files so that they are whole or not there: beside their places first, then renamed, all or none."""

from __future__ import annotations

import atexit
import os
import re
import signal
import threading
import uuid
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from urmpipe_models.errors import Finding, OutputError
from urmpipe_models.files import keep_permissions
from urmpipe_pipeline.text import encodable


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


OutputKind = Literal[
    "recording", "report", "map", "export", "audit", "junit", "statistics", "figure", "drawing", "fmu",
    "joints", "plan", "motion", "system",
]  # fmt: skip

NOUNS: dict[str, str] = {
    "junit": "JUnit file", "statistics": "table of statistics", "fmu": "FMU", "joints": "joint log",
    "motion": "motion log",
    "system": "system file",
}  # fmt: skip
"""What people call a kind, where that is not its name."""

SUFFIXES: dict[OutputKind, tuple[str, ...]] = {
    "recording": (".rrd",), "report": (".html", ".htm"), "map": (".toml",), "audit": (".csv",),
    "junit": (".xml",), "statistics": (".csv",), "drawing": (".svg",), "fmu": (".fmu",), "joints": (".csv",),
    "plan": (".csv",), "motion": (".csv",), "system": (".toml",),
}  # fmt: skip
"""How a file of a kind is called; exports and figures say it by their formats."""

OPENED: tuple[OutputKind, ...] = ("recording", "report")
"""What viewer and browser open by its suffix; of the other kinds a name without one will do."""

OTHERS = {".parquet", ".mat", ".tum", ".txt", ".xlsx", ".json", ".png", ".pdf", ".jpg", ".webp"}
"""Suffixes of what urmpipe writes as exports and figures, or not at all."""

_KNOWN_SUFFIXES = OTHERS.union(*SUFFIXES.values())

TABLES = (".csv", ".parquet", ".mat", ".tum")
"""Suffixes of what `export` makes of a recording."""

AUDIT_COLUMNS = ("joint", "row", "t", "kind", "step", "from", "to")
"""The header of an audit, by which one of ours is known."""

GENERATOR = re.compile(rb"<meta\s+name=\"generator\"\s+content=\"urmpipe\b", re.IGNORECASE)
"""How a report of ours tells where it comes from."""

MAP_HEADER = "# How urmpipe reads these logs: urmpipe ingest LOG --log-map THIS"
"""The first line of a map of ours."""

STATISTICS_HEADER = "run,sync_offset,quantity,kind,unit,max,"
"""How the first line of a table of statistics of ours begins; a later version may have more columns."""

JUNIT_HEADER = '<?xml version="1.0" encoding="UTF-8"?><!-- urmpipe: verdict of a comparison -->'
"""The first line of a JUnit file of ours."""

DRAWING_HEADER = "<!-- Generator: urmpipe "
"""How a drawing of ours (SVG) begins."""

FIGURE = re.compile(rb"\A<!-- Generator: urmpipe |\A\x89PNG.{29}.{4}tEXtSoftware\0urmpipe ", re.DOTALL)
"""How a figure of ours (SVG, PNG) tells where it comes from."""

PDF_HEAD, PDF_CREATOR = b"%PDF-", b"/Creator (urmpipe "
"""How a PDF begins, and how one of ours tells near its end where it comes from."""

TARGET_ROW = "urmpipe_target_row"
"""The last column of a joint log of ours: the data row of each target. A log of anybody else has none of this
name; a remark above the header would tell as well, but not every reader of CSV passes over it."""

PATH_ROW = "urmpipe_path_row"
"""The last column of a plan of ours, likewise: the data row of the path that each sample belongs to."""

MOTION_ROW = "urmpipe_motion_row"
"""The last column of the motion of a network, likewise: the number of each row."""

GENERATION_TOOL = re.compile(rb"<fmiModelDescription\s[^>]*\sgenerationTool=\"urmpipe\b")
"""How the model description of an FMU of ours tells where it comes from."""

EXPORT_HEADER = "urmpipe export"
"""Stands at the start of every export of ours that has room for it; Parquet has it in its metadata."""

FIRST_LINES = {
    "map": MAP_HEADER, "audit": ",".join(AUDIT_COLUMNS), "statistics": STATISTICS_HEADER,
    "junit": JUNIT_HEADER, "drawing": DRAWING_HEADER,
}  # fmt: skip
_MARKS: dict[str, re.Pattern[bytes]] = {
    **{
        kind: re.compile(rb"\A[^\n]*," + last.encode() + rb"\r?\n")
        for kind, last in (("joints", TARGET_ROW), ("plan", PATH_ROW), ("motion", MOTION_ROW))
    },
    **{kind: re.compile(re.escape(first.encode())) for kind, first in FIRST_LINES.items()},
}
"""How the head of an output of ours matches, by kind."""

HEAD, TAIL = 4096, 65536
"""The mark of an output stands within so many bytes of its start, that of a PDF of its end."""


@contextmanager
def guarded_output(path: Path, inputs: Sequence[Path], kind: OutputKind) -> Iterator[Path]:
    """Give a place to write an output to, and put it in its own place once it is written, see `placed`.

    Only another one of the same kind is replaced, never an input; inputs that are no files are passed over.

    Raises:
        OutputError: If it may not be written there, or could not be.
    """
    refuse_output(path, inputs, kind)
    with placed(path) as part:
        yield part


def is_report(path: Path) -> bool:
    """Tell whether a file is a report that urmpipe wrote: its head names urmpipe as the generator."""
    with path.open("rb") as file:
        return GENERATOR.search(file.read(HEAD)) is not None


def is_fmu(path: Path) -> bool:
    """Tell whether a file is an FMU that urmpipe wrote: its model description names urmpipe as the tool."""
    import struct
    from zipfile import BadZipFile, ZipFile

    try:
        with ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
            return GENERATION_TOOL.search(file.read(HEAD)) is not None
    except (BadZipFile, EOFError, KeyError, RuntimeError, ValueError, struct.error, zlib.error):
        return False  # no archive, none with a model description, or packed in a way that zipfile cannot read


def is_figure(path: Path) -> bool:
    """Tell whether a file is a figure that urmpipe drew: an SVG or PNG by its head, a PDF by its creator."""
    with path.open("rb") as file:
        head = file.read(HEAD)
        if not head.startswith(PDF_HEAD):
            return FIGURE.match(head) is not None
        file.seek(max(path.stat().st_size - TAIL, 0))
        return PDF_CREATOR in file.read()


_known: dict[OutputKind, Callable[[Path], bool]] = {
    "report": is_report, "fmu": is_fmu, "figure": is_figure,
}  # fmt: skip


def know_own(kind: OutputKind, is_ours: Callable[[Path], bool]) -> None:
    """Let a function tell which files of a kind are ours: called where the kind is written."""
    _known[kind] = is_ours


def refuse_output(path: Path, inputs: Sequence[Path], kind: OutputKind) -> None:
    """Raise an `OutputError` if an output may not be written there: for who works long before it writes."""
    name = os.fspath(path.absolute())
    if kind == "recording" and encodable(name) != name:  # on Linux a name may hold any bytes
        said = "found a name that is not UTF-8 text, which Rerun cannot open, allowed: one that is"
        raise OutputError(Finding(said, str(path)))
    try:
        trouble = _trouble(path, inputs, kind)
    except OSError as error:
        trouble = f"cannot be written: {error.strerror or error}"
    if trouble:
        raise OutputError(Finding(trouble, str(path)))


def _trouble(path: Path, inputs: Sequence[Path], kind: OutputKind) -> str | None:
    """Return what speaks against writing there, or None."""
    noun = NOUNS.get(kind, kind)
    if path.is_dir():
        return f"found a folder, allowed: the name of a file for the {noun}"
    if path.exists() and any(one.exists() and path.samefile(one) for one in inputs):
        return f"found an input of this command, allowed: any other name for the {noun}"
    if _is_of_another_kind(path, kind):
        tables = kind == "recording" and path.suffix.lower() in TABLES
        hint = "; urmpipe export writes tables" if tables else ""
        return f"found a name that does not fit a {noun}, allowed: {_own_name(path, kind)}{hint}"
    if not path.parent.is_dir():
        return f"found no folder {path.parent}, allowed: a folder that exists"
    return _taken(path, kind, noun) if path.exists() else None


def _taken(path: Path, kind: OutputKind, noun: str) -> str | None:
    """Return what speaks against replacing the file that is there, or None."""
    if kind == "system":  # it was written to be changed: what it holds now may be somebody's work
        return "found a file, allowed: a new name"
    if path.is_file() and _is_ours(path, kind):
        return None
    one = f"{'an' if kind in ('audit', 'export', 'fmu') else 'a'} {noun}"
    return f"found a file that is not {one} of urmpipe, allowed: a new name, or such {one} to replace"


def _is_of_another_kind(path: Path, kind: OutputKind) -> bool:
    """Tell whether a name ends as those of other files do, or not as one must that is opened by it."""
    suffix = path.suffix.lower()
    if kind in OPENED and (path.is_file() or not path.exists()):
        return suffix not in SUFFIXES[kind]
    return kind in SUFFIXES and suffix in _KNOWN_SUFFIXES.difference(SUFFIXES[kind])


def _own_name(path: Path, kind: OutputKind) -> str:
    """Return a name with the suffix of its kind, by which it is opened: run.rrd of run.csv or run."""
    stem = path.stem if path.suffix.lower() in _KNOWN_SUFFIXES else path.name
    return f"{stem}{SUFFIXES[kind][0]}"


def _is_ours(path: Path, kind: OutputKind) -> bool:
    if kind in _known:
        return _known[kind](path)
    with path.open("rb") as file:
        return _MARKS[kind].match(file.read(HEAD)) is not None
