"""Where an output may be written: it replaces only one of its own kind that urmpipe wrote, never an input."""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.placing import placed
from urmpipe_pipeline.text import encodable

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
