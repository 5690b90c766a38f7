"""Files of a user: reading and replacing them, and what to suggest for those that do not exist.

1. Suggestions: a name like the missing one, or the first folder that does not exist.
2. Reading a description up to a maximum size.
3. Line numbers: where in a TOML file a table or key is, such as `blocks.load.file` in line 12.
4. Writing: permissions, atomic replacement, and robot files that urmpipe marks and replaces.
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

MAX_SCANNED = 2000  # files of a folder that are compared with a name
MAX_SUGGESTED = 3  # files in a suggestion
MAX_BYTES = 10e6  # of a description; the largest published arms take a hundredth of it
COMPRESSED = (".gz", ".bz2", ".xz", ".zst")  # suffixes of compressed files
EXPORT_MARK = "urmpipe robot export"  # in a comment at the top of every robot file that urmpipe wrote

_HEADER = re.compile(r"\s*\[([^\[\]]+)\]")
_KEY = re.compile(r"\s*((?:\"[^\"]*\"|'[^']*'|[\w-]+)(?:\s*\.\s*(?:\"[^\"]*\"|'[^']*'|[\w-]+))*)\s*=")


def suggest_path(path: Path, suffixes: Collection[str] = ()) -> str:
    """Return ` (did you mean FILE?)` for a file that does not exist, or an empty string.

    If a folder is missing, it is named instead, with the existing one that should contain it.

    Args:
        path: The file.
        suffixes: Suffixes of files of its kind; of several candidates, these are preferred.
    """
    missing = next((folder for folder in reversed(path.parents) if folder.name and not folder.is_dir()), None)
    if missing is not None:
        above = Path.cwd() if missing.parent == Path() else missing.parent
        folders = [folder for folder in map(missing.with_name, _similar_names(missing)) if folder.is_dir()]
        return f": {above} has no folder {missing.name}{_format_paths(folders)}"
    exists = path.exists() or path.is_symlink()  # a broken link exists
    similar = [] if exists else [path.with_name(name) for name in _similar_names(path)]
    of_kind = [candidate for candidate in similar if candidate.suffix.lower() in suffixes]
    return _format_paths(of_kind or similar)


def _format_paths(paths: list[Path]) -> str:
    return f" (did you mean {' or '.join(map(str, paths[:MAX_SUGGESTED]))}?)" if paths else ""


def _similar_names(path: Path) -> list[str]:
    """Return the names in the folder that differ in case, else in suffixes, else the most similar ones."""
    try:
        names = sorted(entry.name for entry in islice(path.parent.iterdir(), MAX_SCANNED))
    except OSError:  # a folder that may not be read
        return []
    names = [name for name in names if not name.startswith(".")]
    equal = [name for name in names if name.casefold() == path.name.casefold()]
    stem = _stem(path.name)
    equal = equal or [name for name in names if _stem(name) == stem]
    if equal:
        return equal
    closest = closest_name(stem, {_stem(name) for name in names})
    return [name for name in names if _stem(name) == closest]


def _stem(name: str) -> str:
    """Return a name without its suffixes, in lower case: log of LOG.csv.gz."""
    return name.casefold().split(".", 1)[0]


def log_stem(path: Path) -> str:
    """Return the name of a log's file without its suffixes: log of log.csv and of log.csv.gz."""
    return Path(path.stem).stem if path.suffix.lower() in COMPRESSED else path.stem


def read_contents(path: Path, error: type[UrmpipeError], suffixes: Collection[str]) -> bytes:
    """Return the bytes of a file.

    Args:
        path: The file.
        error: Class of the error to raise.
        suffixes: Suffixes of files of its kind, for the suggestion if the file does not exist.

    Raises:
        UrmpipeError: `error`, if the file does not exist, cannot be read, is a pipe or a device (reading may
            never end), or is larger than `MAX_BYTES`.
    """
    if "\0" in str(path):
        raise error(f"found {format_value(str(path))}, allowed: the name of a file")
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) and not stat.S_ISDIR(status.st_mode):
            raise error(Finding("found a pipe or a device, allowed: a file", str(path)))
        if status.st_size > MAX_BYTES:
            size = f"found {status.st_size / 1e6:.4g} MB, allowed: {MAX_BYTES / 1e6:g} MB at most"
            raise error(Finding(size, str(path)))
        return path.read_bytes()
    except OSError as fault:
        suggestion = suggest_path(path, suffixes) if isinstance(fault, FileNotFoundError) else ""
        raise error(Finding(f"cannot be read: {fault.strerror}{suggestion}", str(path))) from fault


def is_existing_file(path: Path) -> bool:
    """Return whether a file exists; an invalid name does not."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def add_line_numbers(path: Path, name: str, findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings with file and line, each once.

    Args:
        path: The file.
        name: Its name as the user wrote it.
        findings: Those without a file are about a table or key of this one, such as `blocks.load`.
    """
    lines: dict[str, int] = {}
    for key, number in _iter_key_lines(path.read_text(encoding="utf-8-sig").split("\n")):
        lines.setdefault(key, number)
    return tuple(
        finding if finding.file else replace(finding, file=name, line=_find_line(lines, finding.about or ""))
        for finding in dict.fromkeys(findings)
    )


def _iter_key_lines(lines: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Yield the full name and the line of each table and key."""
    table = ""
    for number, line in enumerate(lines, 1):
        if header := _HEADER.match(line):
            table = _unquote(header[1])
            yield table, number
        elif key := _KEY.match(line):
            name = table
            for part in _unquote(key[1]).split("."):  # a key `drive.start.C` is a table `drive`, too
                name = f"{name}.{part}" if name else part
                yield name, number


def _unquote(name: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in name.split("."))


def _find_line(lines: dict[str, int], name: str) -> int | None:
    """Return the line of a table or key; of an item, that of its list; else that of the enclosing table."""
    while name not in lines and ("." in name or name.endswith("]")):
        name = name.rpartition("[" if name.endswith("]") else ".")[0]
    return lines.get(name)


def keep_permissions(part: Path, path: Path) -> None:
    """Give a file the permissions of the one that it will replace; if there is none, it keeps its own.

    Raises:
        OSError: If they cannot be set.
    """
    with suppress(FileNotFoundError):
        permissions = stat.S_IMODE(path.stat().st_mode)
        if permissions != stat.S_IMODE(part.stat().st_mode):
            part.chmod(permissions)


def is_robot_export(path: Path) -> bool:
    """Return whether a file is a robot file that urmpipe wrote."""
    try:
        with path.open("rb") as file:
            return EXPORT_MARK.encode() in file.read(200)
    except OSError:
        return False


def write_export(path: Path, text: str, source: Path) -> None:
    """Write a robot export. It replaces only another export, and never the robot it was made from.

    Args:
        path: The file to write.
        text: Its contents, with `EXPORT_MARK` near the start.
        source: The robot's file, or its name in the catalogue.

    Raises:
        OutputError: If the path is another file or a folder, or cannot be written to.
    """
    if path.is_dir():
        raise OutputError(Finding("found a folder, allowed: the name of a file", str(path)))
    if path.exists() and source.exists() and path.samefile(source):
        raise OutputError(Finding("found the input of this command, allowed: any other name", str(path)))
    if path.exists() and not is_robot_export(path):
        allowed = "a new name, or such an export to replace"
        message = f"found a file that is not a robot export of urmpipe, allowed: {allowed}"
        raise OutputError(Finding(message, str(path)))
    write_text_atomic(path, text)


def write_text_atomic(path: Path, text: str) -> None:
    """Write a text to a temporary file and move it to its place, so that no reader ever sees half of it.

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
        with suppress(OSError):  # the original error is already raised
            part.unlink(missing_ok=True)
