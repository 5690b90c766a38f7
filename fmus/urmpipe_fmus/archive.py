"""An FMU as a file: a zip that is the same bytes for the same content, and a GUID of that content."""

from __future__ import annotations

import hashlib
import uuid
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from urmpipe_models.files import keep_permissions

EARLIEST = (1980, 1, 1, 0, 0, 0)
"""The time of every entry: zip knows none before."""

UNIX = 3
"""Who made the entry, so that its permissions are read as those of a file."""


def content_guid(files: Mapping[str, bytes]) -> str:
    """Return the GUID of some files: the first 128 bits of the SHA-256 of their names and contents."""
    digest = hashlib.sha256()
    for name in sorted(files):
        for part in (name.encode(), files[name]):
            digest.update(len(part).to_bytes(8, "little") + part)
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def write_fmu(path: Path, files: Mapping[str, bytes]) -> None:
    """Write an FMU, beside its place first, then renamed: it is whole or not there.

    Args:
        path: Where it shall stand; what stands there is replaced.
        files: Contents by their path in the FMU.

    Raises:
        OSError: If it cannot be written.
    """
    part = path.with_name(f"{path.stem[:40]}.{uuid.uuid4().hex[:12]}.part")
    try:
        with zipfile.ZipFile(part, "x") as archive:
            for name in sorted(files):
                archive.writestr(_entry(name), files[name])
        keep_permissions(part, path)
        part.replace(path)
    finally:
        with suppress(OSError):  # why it cannot be written is told
            part.unlink()


def _entry(name: str) -> zipfile.ZipInfo:
    """Return an entry without a trace of when, where and by whom it was made."""
    entry = zipfile.ZipInfo(name, EARLIEST)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.create_system = UNIX
    entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
    return entry
