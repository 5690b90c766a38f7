"""Files that describe something, read whole up to a size; and permissions of files."""

from __future__ import annotations

import stat
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from urmpipe_models.errors import Finding, UrmpipeError, shown
from urmpipe_models.files.missing import meant_by

LARGEST = 10e6
"""Bytes of a description: the largest arms that are published take a hundredth of it."""


def read_contents(path: Path, error: type[UrmpipeError], suffixes: Collection[str]) -> bytes:
    """Return what stands in a file.

    Args:
        path: The file.
        error: What to raise.
        suffixes: How files of its kind end, to say which may be meant by one that is not there.

    Raises:
        UrmpipeError: `error`, if there is no such file, it cannot be read, it is a pipe or a device, on which
            reading may never end, or it is larger than `LARGEST`.
    """
    if "\0" in str(path):
        raise error(f"found {shown(str(path))}, allowed: the name of a file")
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
            raise error(Finding("found a pipe or a device, allowed: a file", str(path)))
        if found.st_size > LARGEST:
            size = f"found {found.st_size / 1e6:.4g} MB, allowed: {LARGEST / 1e6:g} MB at most"
            raise error(Finding(size, str(path)))
        return path.read_bytes()
    except OSError as fault:
        meant = meant_by(path, suffixes) if isinstance(fault, FileNotFoundError) else ""
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


def is_there(path: Path) -> bool:
    """Tell whether a file is there; of a name that no file can have, that it is not."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
