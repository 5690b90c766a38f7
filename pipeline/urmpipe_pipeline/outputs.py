"""Outputs that no error damages: written completely or not at all, and never in place of anything else.

1. `check_output` decides whether an output may be written at a path: the name fits its kind (`OUTPUT_RULES`),
   the file is no input of the command, and an existing one is an output of the same kind that urmpipe wrote,
   which its first bytes show (`mark`) or a function that its writer registers (`register_owner_check`).
2. `safe_output` gives the writer a new name in the same folder. The file is renamed when the body succeeds,
   and removed when it fails; until then an existing file is untouched.
3. In an `atomic_group`, several files are renamed together: all or none.
"""

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
from pathlib import Path
from typing import Literal, NamedTuple

from urmpipe_models.errors import Finding, OutputError
from urmpipe_models.files import keep_permissions
from urmpipe_pipeline.text import drop_surrogates

OutputKind = Literal[
    "recording", "report", "map", "export", "audit", "junit", "statistics", "figure", "drawing", "fmu",
    "joints", "plan", "motion", "system",
]  # fmt: skip

AUDIT_COLUMNS = ("joint", "row", "t", "kind", "step", "turns_before", "turns_after")  # header of an audit
MAP_MARK = "# How urmpipe reads these logs: "  # start of a map
MAP_HEADER = f"{MAP_MARK}urmpipe ingest LOG --map THIS"  # its first line
STATISTICS_HEADER = "run,sync_offset,quantity,kind,unit,max,"  # a later version may have more columns
CRITERIA_HEADER = "name,at,value,unit,cycles,tolerance,verdict"  # of a test after ISO 9283, likewise
JUNIT_HEADER = '<?xml version="1.0" encoding="UTF-8"?><!-- urmpipe: verdict of a comparison -->'  # first line
DRAWING_HEADER = "<!-- Generator: urmpipe "  # start of a drawing (SVG)
EXPORT_HEADER = "urmpipe export"  # at the start of an export; in the metadata of Parquet

# Last columns of joint logs: the row of the target, of the path, or the number of each row. Only our files
# have these names. A comment above the header would do as well, but some readers of CSV do not skip it.
TARGET_ROW, PATH_ROW, MOTION_ROW = "urmpipe_target_row", "urmpipe_path_row", "urmpipe_motion_row"

_GENERATOR = re.compile(rb"<meta\s+name=\"generator\"\s+content=\"urmpipe\b", re.IGNORECASE)  # report
_FIGURE = re.compile(rb"\A<!-- Generator: urmpipe |\A\x89PNG.{29}.{4}tEXtSoftware\0urmpipe ", re.DOTALL)
_PDF_HEAD, _PDF_CREATOR = b"%PDF-", b"/Creator (urmpipe "  # start of a PDF; near the end of one of ours
_GENERATION_TOOL = re.compile(rb"<fmiModelDescription\s[^>]*\sgenerationTool=\"urmpipe\b")  # FMU

HEAD = 4096  # bytes at the start of a file with its mark
_TAIL = 65536  # bytes at the end of a PDF with its mark


def _first_line(*starts: str) -> re.Pattern[bytes]:
    return re.compile(rb"\A(?:" + b"|".join(re.escape(start.encode()) for start in starts) + rb")")


def _last_column(name: str) -> re.Pattern[bytes]:
    return re.compile(rb"\A[^\n]*," + name.encode() + rb"\r?\n")


class OutputRule(NamedTuple):
    """Where outputs of a kind may be written.

    Attributes:
        noun: Name of the kind in messages.
        suffixes: Allowed ends of names; empty for exports and figures, whose formats decide.
        mark: Is in the first bytes of a file of this kind that urmpipe wrote; None if a function finds out.
    """

    noun: str
    suffixes: tuple[str, ...] = ()
    mark: re.Pattern[bytes] | None = None


OUTPUT_RULES: dict[OutputKind, OutputRule] = {
    "recording": OutputRule("recording", (".rrd",)),
    "report": OutputRule("report", (".html", ".htm"), _GENERATOR),
    "map": OutputRule("map", (".toml",), _first_line(MAP_MARK)),
    "export": OutputRule("export"),
    "audit": OutputRule("audit", (".csv",), _first_line(",".join(AUDIT_COLUMNS))),
    "junit": OutputRule("JUnit file", (".xml",), _first_line(JUNIT_HEADER)),
    "statistics": OutputRule(
        "table of statistics", (".csv",), _first_line(STATISTICS_HEADER, CRITERIA_HEADER)
    ),
    "figure": OutputRule("figure"),
    "drawing": OutputRule("drawing", (".svg",), _first_line(DRAWING_HEADER)),
    "fmu": OutputRule("FMU", (".fmu",)),
    "joints": OutputRule("joint log", (".csv",), _last_column(TARGET_ROW)),
    "plan": OutputRule("plan", (".csv",), _last_column(PATH_ROW)),
    "motion": OutputRule("motion log", (".csv",), _last_column(MOTION_ROW)),
    "system": OutputRule("system file", (".toml",)),
}

_OPENED_BY_SUFFIX: tuple[OutputKind, ...] = ("recording", "report")  # the others need no suffix
_TABLES = {".csv", ".parquet", ".mat", ".tum"}  # suffixes of `export`
_OTHER_SUFFIXES = {".txt", ".xlsx", ".json", ".png", ".pdf", ".jpg", ".webp"}  # of figures, and of no output
_KNOWN_SUFFIXES = _OTHER_SUFFIXES.union(_TABLES, *(rule.suffixes for rule in OUTPUT_RULES.values()))


@contextmanager
def safe_output(path: Path, inputs: Sequence[Path], kind: OutputKind) -> Iterator[Path]:
    """Yield a path to write an output to, and give the file its name once it is written.

    The path is a new name with the suffix .part in the same folder; there is no such file. The file is
    renamed to `path` if the body succeeds, and removed if it fails. An existing file is untouched until then,
    and gives its permissions to the new one. In an `atomic_group` the file is renamed at the end of that.

    Args:
        path: Name of the output. Only another output of the same kind is replaced.
        inputs: Files that are never replaced; names of no file are ignored.
        kind: Kind of the output.

    Raises:
        OutputError: If it may not be written there, or could not be.
    """
    check_output(path, inputs, kind)
    with atomic_group() as pending:
        part = _new_part(path)
        pending.append(_Pending(part, path))
        with _naming_file(path):
            yield part
            keep_permissions(part, path)
            part.stat()


def check_output(path: Path, inputs: Sequence[Path], kind: OutputKind) -> None:
    """Raise an `OutputError` if an output may not be written there: before long work whose result it is."""
    name = os.fspath(path.absolute())
    if kind == "recording" and drop_surrogates(name) != name:  # in Linux a name may contain any bytes
        message = "found a name that is not UTF-8 text, which Rerun cannot open, allowed: one that is"
        raise OutputError(Finding(message, str(path)))
    try:
        problem = _find_problem(path, inputs, kind)
    except OSError as error:
        problem = f"cannot be written: {error.strerror or error}"
    if problem:
        raise OutputError(Finding(problem, str(path)))


def _find_problem(path: Path, inputs: Sequence[Path], kind: OutputKind) -> str | None:
    noun = OUTPUT_RULES[kind].noun
    if path.is_dir():
        return f"found a folder, allowed: the name of a file for the {noun}"
    if path.exists() and any(file.exists() and path.samefile(file) for file in inputs):
        return f"found an input of this command, allowed: any other name for the {noun}"
    if _has_wrong_suffix(path, kind):
        stem = path.stem if path.suffix.lower() in _KNOWN_SUFFIXES else path.name
        hint = (
            "; urmpipe export writes tables" if kind == "recording" and path.suffix.lower() in _TABLES else ""
        )
        allowed = f"{stem}{OUTPUT_RULES[kind].suffixes[0]}{hint}"
        return f"found a name that does not fit a {noun}, allowed: {allowed}"
    if not path.parent.is_dir():
        return f"found no folder {path.parent}, allowed: a folder that exists"
    return _find_owner_problem(path, kind) if path.exists() else None


def _find_owner_problem(path: Path, kind: OutputKind) -> str | None:
    if kind == "system":  # a user is meant to change it: it may contain work
        return "found a file, allowed: a new name"
    if path.is_file() and _is_ours(path, kind):
        return None
    output = f"{'an' if kind in ('audit', 'export', 'fmu') else 'a'} {OUTPUT_RULES[kind].noun}"
    return f"found a file that is not {output} of urmpipe, allowed: a new name, or such {output} to replace"


def _has_wrong_suffix(path: Path, kind: OutputKind) -> bool:
    """Return whether a name has the suffix of other files, or lacks the one by which its kind is opened."""
    suffix, allowed = path.suffix.lower(), OUTPUT_RULES[kind].suffixes
    if kind in _OPENED_BY_SUFFIX and (path.is_file() or not path.exists()):
        return suffix not in allowed
    return bool(allowed) and suffix in _KNOWN_SUFFIXES.difference(allowed)


def _is_ours(path: Path, kind: OutputKind) -> bool:
    mark = OUTPUT_RULES[kind].mark
    if mark is None:
        return _owner_checks[kind](path)
    with path.open("rb") as file:
        return mark.search(file.read(HEAD)) is not None


def _is_our_fmu(path: Path) -> bool:
    import struct
    from zipfile import BadZipFile, ZipFile

    try:
        with ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
            return _GENERATION_TOOL.search(file.read(HEAD)) is not None
    except (BadZipFile, EOFError, KeyError, RuntimeError, ValueError, struct.error, zlib.error):
        return False  # no archive, none with a model description, or packed in a way that zipfile cannot read


def _is_our_figure(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(HEAD)
        if not head.startswith(_PDF_HEAD):
            return _FIGURE.match(head) is not None
        file.seek(max(path.stat().st_size - _TAIL, 0))
        return _PDF_CREATOR in file.read()


_owner_checks: dict[OutputKind, Callable[[Path], bool]] = {"fmu": _is_our_fmu, "figure": _is_our_figure}


def register_owner_check(kind: OutputKind, is_ours: Callable[[Path], bool]) -> None:
    """Register the function that returns whether urmpipe wrote a file of a kind; its writer calls this."""
    _owner_checks[kind] = is_ours


class _Pending(NamedTuple):
    part: Path  # where a file is written
    path: Path  # its name once it is written


_group: ContextVar[list[_Pending] | None] = ContextVar("files that are renamed together", default=None)
_parts: set[Path] = set()  # files being written by any thread; the exit of Python removes them


@contextmanager
def atomic_group() -> Iterator[list[_Pending]]:
    """Rename the files that are written in the body once all of them are written: all or none.

    Existing files are renamed, too, before the first of several new ones gets its name, so that there is
    never a new file next to an old one; and back if a new one cannot be renamed.

    Raises:
        OutputError: If a file cannot be renamed.
    """
    outer = _group.get()
    if outer is not None:
        yield outer
        return
    pending: list[_Pending] = []
    token = _group.set(pending)
    try:
        yield pending
        with defer_interrupts():
            _rename(pending)
    finally:
        with defer_interrupts():
            _group.reset(token)
            _remove(file.part for file in pending)


def _new_part(path: Path) -> Path:
    part = path.with_name(f"{path.stem[:40]}.{uuid.uuid4().hex[:12]}.part")
    _parts.add(part)
    return part


def _rename(pending: Sequence[_Pending]) -> None:
    """Rename files: a single one replaces the existing one in one step, several all or none."""
    previous: list[_Pending] = []
    renamed: list[_Pending] = []
    try:
        for path in (file.path for file in pending if len(pending) > 1 and file.path.exists()):
            previous.append(_Pending(_new_part(path), path))
            with _naming_file(path):
                path.rename(previous[-1].part)
        for file in pending:
            with _naming_file(file.path):
                file.part.replace(file.path)
            renamed.append(file)
    except OutputError:
        for file in renamed:
            file.path.replace(file.part)
        for file in previous:
            with suppress(FileNotFoundError):  # the one that could not be renamed
                file.part.replace(file.path)
        raise
    finally:
        _remove(file.part for file in previous)


@contextmanager
def _naming_file(path: Path) -> Iterator[None]:
    """Raise an error of the file system as an `OutputError` that names the file."""
    try:
        yield
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)  # libraries add text to the system's
        raise OutputError(Finding(f"cannot be written: {why}", str(path))) from error


def _remove(parts: Iterable[Path]) -> None:
    for part in parts:
        with suppress(OSError):  # the folder is gone, or may not be written any more
            part.unlink(missing_ok=True)
        _parts.discard(part)


atexit.register(lambda: _remove(list(_parts)))


@contextmanager
def defer_interrupts() -> Iterator[None]:
    """Defer Ctrl-C and SIGTERM until the end of the body, which must be short."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    if threading.current_thread() is not threading.main_thread() or None in handlers.values():
        yield
        return
    received: list[int] = []
    for number in handlers:
        signal.signal(number, lambda number, frame: received.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if received:
            signal.raise_signal(received[0])
