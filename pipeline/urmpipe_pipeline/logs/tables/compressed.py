"""Compressed files: gzip, bzip2, xz and Zstandard, known by their first bytes, unpacked into memory."""

from __future__ import annotations

import io
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import IO, Any, NamedTuple

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.logs.tables.limits import MEMORY_LIMIT, unpacked_limit

_BLOCK = 1 << 20  # bytes that are unpacked at once, before the limit is checked again


class Compression(NamedTuple):
    """A way to compress a file: how it begins, the program that unpacks it, and the library."""

    name: str
    magic: bytes
    program: str
    open: Callable[[IO[bytes]], Any]


COMPRESSIONS = (
    Compression("gzip", b"\x1f\x8b", "gzip", lambda file: import_module("gzip").open(file)),
    Compression("bzip2", b"BZh", "bzip2", lambda file: import_module("bz2").open(file)),
    Compression("xz", b"\xfd7zXZ\x00", "xz", lambda file: import_module("lzma").open(file)),
    Compression(
        "Zstandard",
        b"(\xb5/\xfd",
        "zstd",
        lambda file: import_module("pyarrow").input_stream(file, compression="zstd"),
    ),
)


def find_compression(head: bytes) -> Compression | None:
    """Return how a file is compressed that begins with these bytes; None if it is not."""
    return next((known for known in COMPRESSIONS if head.startswith(known.magic)), None)


def unpack(path: Path, compression: Compression) -> bytes:
    """Return the content of a compressed file.

    Raises:
        LogError: If it is damaged or cut, or unpacks to more than its size suggests.
    """
    size = path.stat().st_size
    limit = min(unpacked_limit(size), MEMORY_LIMIT)
    content, length = io.BytesIO(), 0
    command = f'{compression.program} -dc "{path.as_posix()}" > log.csv'
    lzma_error: type[Exception] = import_module("lzma").LZMAError
    zlib_error: type[Exception] = import_module("zlib").error
    try:
        with path.open("rb") as file, compression.open(file) as unpacked:
            while block := unpacked.read(_BLOCK):
                length += content.write(block)
                if length > limit:
                    raise _error(
                        path,
                        f"{size} bytes that unpack to more",
                        f"{limit} bytes",
                        f"unpack it if it is a log: {command}",
                    )
    except (OSError, EOFError, ValueError, zlib_error, lzma_error) as error:
        fault = f"a {compression.name} archive that is damaged or cut ({str(error).rstrip('.')})"
        raise _error(
            path, fault, "a whole one", f"copy it again, or keep what can be read: {command}"
        ) from None
    return content.getvalue()


def _error(path: Path, fault: str, allowed: str, advice: str) -> LogError:
    return LogError(Finding(file=str(path), found=fault, allowed=allowed, hints=(Hint("", effect=advice),)))
