"""What a file may hold: columns, the length of a line, and what comes of packed bytes.

A file beyond these is no log but a broken or a hostile one, and would take memory and time that its size does
not announce.
"""

from __future__ import annotations

from pathlib import Path

from urmpipe_models.errors import Finding, Hint, LogError

MOST_COLUMNS = 10_000
"""Columns of a table: a hundred times those of the widest recorders of robots."""

LONGEST_LINE = 8 << 20
"""Bytes of a line of text: 800,000 times in one row."""

UNPACKED = 64 << 20
"""Bytes that any file may unpack to."""

RATIO = 50
"""A larger file may unpack to so many times its size: logs of doubles unpack to 2 to 10 times theirs."""

MEMORY_LIMIT = 4 << 30
"""Bytes that a compressed text may unpack to: they are kept in memory."""

_ROW_A_SAMPLE = Hint("", effect="write one row per sample, one column per joint")


def refuse_wide(columns: int, file: str, line: int | None = None) -> None:
    """Raise a `LogError` if a table has more columns than it may have."""
    if columns > MOST_COLUMNS:
        found, allowed = f"more than {MOST_COLUMNS} columns", "as many as that"
        raise LogError(Finding(file=file, line=line, found=found, allowed=allowed, hints=(_ROW_A_SAMPLE,)))


def long_line(file: str, line: int) -> LogError:
    """Return the error about a line that is longer than it may be."""
    found, allowed = f"a line of more than {LONGEST_LINE >> 20} MiB", "shorter lines"
    return LogError(Finding(file=file, line=line, found=found, allowed=allowed, hints=(_ROW_A_SAMPLE,)))


def unpacked_limit(size: int) -> int:
    """Return how many bytes a file of this size may unpack to."""
    return max(UNPACKED, RATIO * size)


def refuse_unpacked(path: Path, unpacked: int) -> None:
    """Raise a `LogError` if a file unpacks to more bytes than its size lets expect."""
    size = path.stat().st_size
    limit = unpacked_limit(size)
    if unpacked > limit:
        fault = f"{size} bytes that unpack to {unpacked}"
        raise LogError(Finding(file=str(path), found=fault, allowed=f"{limit} at most"))
