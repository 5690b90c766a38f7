"""Robot files that urmpipe wrote: how they are marked, and how they are replaced."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from urmpipe_models.errors import Finding, OutputError
from urmpipe_models.files.contents import keep_permissions

EXPORT_MARK = "urmpipe robot export"
"""Stands in a comment at the top of every robot file that urmpipe wrote."""


def is_export(path: Path) -> bool:
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
    if path.exists() and not is_export(path):
        allowed = "a new name, or such an export to replace"
        raise OutputError(
            Finding(f"found a file that is not a robot export of urmpipe, allowed: {allowed}", str(path))
        )
    replace_text(path, text)


def replace_text(path: Path, text: str) -> None:
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
