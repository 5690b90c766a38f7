"""Files that are not there: which one may have been meant, or how far the folders go.

Files that describe something, read whole up to a size; and permissions of files.

Where in a TOML file a table or key stands: `blocks.load.file` in line 12.

Robot files that urmpipe wrote: how they are marked, and how they are replaced.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path

from urmpipe_models.errors import Finding, OutputError, UrmpipeError, closest_name, format_value

MAX_SCANNED = 2000
"""So many files of a folder are looked at."""

MAX_SUGGESTED = 3
"""So many that may be meant are named."""


def suggest_path(path: Path, suffixes: Collection[str] = ()) -> str:
    """Return which file may be meant by one that is not there, as ` (did you mean FILE?)`; else nothing.

    Where a folder is missing, that is returned, with the one above it, which is there.

    Args:
        path: The file.
        suffixes: How files of its kind end; of several that may be meant, only such are named, if any is.
    """
    missing = next((one for one in reversed(path.parents) if one.name and not one.is_dir()), None)
    if missing is not None:
        above = Path.cwd() if missing.parent == Path() else missing.parent
        folders = [one for one in map(missing.with_name, _like(missing)) if one.is_dir()]
        return f": {above} has no folder {missing.name}{_asked(folders[:MAX_SUGGESTED])}"
    there = path.exists() or path.is_symlink()  # a link to what is not there
    alike = [] if there else [path.with_name(name) for name in _like(path)]
    of_kind = [one for one in alike if one.suffix.lower() in suffixes]
    return _asked((of_kind or alike)[:MAX_SUGGESTED])


def _asked(meant: list[Path]) -> str:
    """Return the question for some files."""
    return f" (did you mean {' or '.join(map(str, meant))}?)" if meant else ""


def _like(path: Path) -> list[str]:
    """Return the names beside a path that are its own in other letters, of its stem, or like its stem."""
    try:
        names = sorted(one.name for one in islice(path.parent.iterdir(), MAX_SCANNED))
    except OSError:  # a folder that may not be read
        return []
    names = [name for name in names if not name.startswith(".")]
    same = [name for name in names if name.casefold() == path.name.casefold()]
    stem = _stem(path.name)
    near = same or [name for name in names if _stem(name) == stem]
    if near:
        return near
    others = closest_name(stem, {_stem(name) for name in names})
    return [name for name in names if _stem(name) == others]


def _stem(name: str) -> str:
    """Return a name without its suffixes, in small letters: log of LOG.csv.gz."""
    return name.casefold().split(".", 1)[0]


MAX_BYTES = 10e6
"""Bytes of a description: the largest arms that are published take a hundredth of it."""


def read_contents(path: Path, error: type[UrmpipeError], suffixes: Collection[str]) -> bytes:
    """Return what stands in a file.

    Args:
        path: The file.
        error: What to raise.
        suffixes: How files of its kind end, to say which may be meant by one that is not there.

    Raises:
        UrmpipeError: `error`, if there is no such file, it cannot be read, it is a pipe or a device, on which
            reading may never end, or it is larger than `MAX_BYTES`.
    """
    if "\0" in str(path):
        raise error(f"found {format_value(str(path))}, allowed: the name of a file")
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
            raise error(Finding("found a pipe or a device, allowed: a file", str(path)))
        if found.st_size > MAX_BYTES:
            size = f"found {found.st_size / 1e6:.4g} MB, allowed: {MAX_BYTES / 1e6:g} MB at most"
            raise error(Finding(size, str(path)))
        return path.read_bytes()
    except OSError as fault:
        meant = suggest_path(path, suffixes) if isinstance(fault, FileNotFoundError) else ""
        raise error(Finding(f"cannot be read: {fault.strerror}{meant}", str(path))) from fault


def keep_permissions(part: Path, path: Path) -> None:
    """Give a file the permissions of the one that it is to replace; without one it keeps those it has.

    Raises:
        OSError: If they cannot be set.
    """
    with suppress(FileNotFoundError):
        wanted = stat.S_IMODE(path.stat().st_mode)
        if wanted != stat.S_IMODE(part.stat().st_mode):
            part.chmod(wanted)


def is_existing_file(path: Path) -> bool:
    """Tell whether a file is there; of a name that no file can have, that it is not."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


HEADER = re.compile(r"\s*\[([^\[\]]+)\]")
KEY = re.compile(r"\s*((?:\"[^\"]*\"|'[^']*'|[\w-]+)(?:\s*\.\s*(?:\"[^\"]*\"|'[^']*'|[\w-]+))*)\s*=")


def add_line_numbers(path: Path, name: str, faults: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return faults with file and line, each once.

    Args:
        path: The file.
        name: What the user called it.
        faults: Those without a file are about a table or key of this one, such as `blocks.load`.
    """
    lines: dict[str, int] = {}
    for full, number in _named_lines(path.read_text(encoding="utf-8-sig").split("\n")):
        lines.setdefault(full, number)
    return tuple(
        one if one.file else replace(one, file=name, line=_line_of(lines, one.about or ""))
        for one in dict.fromkeys(faults)
    )


def _named_lines(text: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Yield the full name and the line of each table and key."""
    table = ""
    for number, line in enumerate(text, 1):
        if header := HEADER.match(line):
            table = _plain(header[1])
            yield table, number
        elif key := KEY.match(line):
            name = table
            for part in _plain(key[1]).split("."):  # a key `drive.start.C` is a table `drive`, too
                name = f"{name}.{part}" if name else part
                yield name, number


def _plain(name: str) -> str:
    """Return a name of TOML without quotes and spaces."""
    return ".".join(part.strip().strip("\"'") for part in name.split("."))


def _line_of(lines: dict[str, int], name: str) -> int | None:
    """Return the line of a table or key, of an item that of its list; else that of the table around."""
    while name not in lines and ("." in name or name.endswith("]")):
        name = name.rpartition("[" if name.endswith("]") else ".")[0]
    return lines.get(name)


EXPORT_MARK = "urmpipe robot export"
"""Stands in a comment at the top of every robot file that urmpipe wrote."""


def is_robot_export(path: Path) -> bool:
    """Tell whether a file is a robot file that urmpipe wrote."""
    try:
        with path.open("rb") as file:
            return EXPORT_MARK.encode() in file.read(200)
    except OSError:
        return False


def write_export(path: Path, text: str, source: Path) -> None:
    """Write a robot export; only another export is replaced, and never the robot it was made from.

    Args:
        path: The file to write.
        text: Its contents, which hold `EXPORT_MARK` near their start.
        source: The robot's own file, or its name in the catalogue.

    Raises:
        OutputError: If something else stands there, or the place cannot be written to.
    """
    if path.is_dir():
        raise OutputError(Finding("found a folder, allowed: the name of a file", str(path)))
    if path.exists() and source.exists() and path.samefile(source):
        raise OutputError(Finding("found the input of this command, allowed: any other name", str(path)))
    if path.exists() and not is_robot_export(path):
        allowed = "a new name, or such an export to replace"
        raise OutputError(
            Finding(f"found a file that is not a robot export of urmpipe, allowed: {allowed}", str(path))
        )
    write_text_atomic(path, text)


def write_text_atomic(path: Path, text: str) -> None:
    """Write a text beside a file and put it in its place, so that no reader ever sees half of it.

    Raises:
        OutputError: If the place cannot be written to.
    """
    part = path.with_name(f"{path.name}.part")
    try:
        part.write_bytes(text.encode())
        keep_permissions(part, path)
        part.replace(path)
    except OSError as error:
        raise OutputError(Finding(f"cannot be written: {error.strerror}", str(path))) from error
    finally:
        with suppress(OSError):  # why it cannot be written is told
            part.unlink(missing_ok=True)
