"""The bytes of a text file: what is no log, how it is packed, which encoding, where lines begin, its hash.

1. Limits: columns, the length of a line, and what packed bytes may unpack to. A file beyond these is broken
   or hostile, and would take memory and time that its size does not announce.
2. Compression: gzip, bzip2, xz and Zstandard, known by their first bytes, unpacked into memory.
3. `open_text`: a file as one `Segment`, whose head has enough lines to show how a table is written.
"""

from __future__ import annotations

import codecs
import hashlib
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import IO, Any, BinaryIO, NamedTuple

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.files import suggest_path
from urmpipe_pipeline.joint_log import Inference, SourceFile
from urmpipe_pipeline.logs.vocabulary import Container, vocabulary

MAX_TABLE_COLUMNS = 10_000  # of a table: a hundred times those of the widest recorders of robots
MAX_LINE_BYTES = 8 << 20  # bytes of a line of text: 800,000 times in one row
UNPACKED = 64 << 20  # bytes that any file may unpack to
RATIO = 50  # x its size, that a larger file may unpack to: logs of doubles unpack to 2 to 10 times theirs
MEMORY_LIMIT = 4 << 30  # bytes that a compressed text may unpack to: they are kept in memory
HEAD_BYTES = 64 * 1024  # that show how a file is written
MAX_HEAD_BYTES = (
    1 << 20
)  # bytes of the head where that holds few lines: they are long, or below many comments
MIN_LINES = 4  # without comments: they show a header, units and rows
COMMENTS = ("#", "%", "//")
LOGS = (".csv", ".txt", ".tsv", ".dat", ".log", ".rrd")  # how most logs are called, and their recordings

_BLOCK = 1 << 20  # bytes that are unpacked at once, before the limit is checked again
_WRITTEN = ("csv", "npz")  # what the commands write that make tables of containers
_TITLE_LINES = 2  # a binary file may begin with as many lines of text
_CONTROL = bytes(set(range(32)) - set(b"\t\n\v\f\r\x1a\x1b"))
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_ROW_PER_SAMPLE = Hint("", effect="write one row per sample, one column per joint")


def check_width(columns: int, file: str, line: int | None = None) -> None:
    """Raise a `LogError` if a table has more columns than it may have."""
    if columns > MAX_TABLE_COLUMNS:
        fault, allowed = f"more than {MAX_TABLE_COLUMNS} columns", "as many as that"
        raise LogError(Finding(file=file, line=line, found=fault, allowed=allowed, hints=(_ROW_PER_SAMPLE,)))


def unpacked_limit(size: int) -> int:
    """Return how many bytes a file of this size may unpack to."""
    return max(UNPACKED, RATIO * size)


def check_unpacked_size(path: Path, unpacked: int) -> None:
    """Raise a `LogError` if a file unpacks to more bytes than its size lets expect."""
    size = path.stat().st_size
    limit = unpacked_limit(size)
    if unpacked > limit:
        fault = f"{size} bytes that unpack to {unpacked}"
        raise LogError(Finding(file=str(path), found=fault, allowed=f"{limit} at most"))


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
    errors = (
        OSError,
        EOFError,
        ValueError,
        import_module("lzma").LZMAError,
        import_module("zlib").error,
    )
    try:
        with path.open("rb") as file, compression.open(file) as unpacked:
            while length <= limit and (block := unpacked.read(_BLOCK)):
                length += content.write(block)
    except errors as error:
        fault = f"a {compression.name} archive that is damaged or cut ({str(error).rstrip('.')})"
        hint = Hint("", effect=f"copy it again, or keep what can be read: {command}")
        raise LogError(Finding(file=str(path), found=fault, allowed="a whole one", hints=(hint,))) from None
    if length > limit:
        fault, hint = (
            f"{size} bytes that unpack to more",
            Hint("", effect=f"unpack it if it is a log: {command}"),
        )
        raise LogError(Finding(file=str(path), found=fault, allowed=f"{limit} bytes", hints=(hint,)))
    return content.getvalue()


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of a text file that holds one table.

    Attributes:
        path: The file, as the user named it.
        encoding: Python's name of its encoding.
        start: Offset of the first byte, after a byte order mark.
        end: Offset after the last byte.
        first_line: Line of the file that the segment begins with, from 1.
        head: Its beginning as text, cut at the end of a line.
        data: The bytes of the text, if they are not those of the file: unpacked, or the cells of a sheet.
        delimiter: Sign between cells, if the reader of the file put it there; else empty.
        inferences: What was found out about the file.
    """

    path: Path
    encoding: str
    start: int
    end: int
    first_line: int
    head: str = ""
    data: bytes | None = field(default=None, repr=False)
    delimiter: str = ""
    inferences: tuple[Inference, ...] = ()

    def open(self) -> BinaryIO:
        """Return the bytes of the text as an open file."""
        return self.path.open("rb") if self.data is None else io.BytesIO(self.data)

    @property
    def errors(self) -> str:
        """What becomes of bytes that are no text: in UTF-8 they come back, so that lengths stay."""
        return "surrogateescape" if self.encoding == "utf-8" else "replace"

    @property
    def newline(self) -> str:
        """What ends a line: a line feed, or a carriage return in files that have no line feeds."""
        return "\r" if "\r" in self.head and "\n" not in self.head else "\n"

    @property
    def has_more(self) -> bool:
        """Whether the text continues after its head."""
        return len(self.head.encode(self.encoding, self.errors)) < self.end - self.start

    def cut(self, start: int, end: int, first_line: int) -> Segment:
        """Return a stretch of the same file, with its own head."""
        return replace(self, start=start, end=end, first_line=first_line).with_head()

    def with_head(self) -> Segment:
        """Return the segment with its head: its first lines, enough of them to show what they are."""
        head, size, length = "", HEAD_BYTES, self.end - self.start
        with self.open() as file:
            while size <= MAX_HEAD_BYTES:
                file.seek(self.start)
                decoder = codecs.getincrementaldecoder(self.encoding)(self.errors)
                head = decoder.decode(file.read(min(size, length)))
                if size < length:  # without the last, cut line
                    cut = (head.rfind("\n") + 1) or (head.rfind("\r") + 1)
                    head = head[:cut] if cut else head
                lines = (line.lstrip() for line in head.splitlines())
                content = (line for line in lines if line and not line.startswith(COMMENTS))
                if size >= length or len([*islice(content, MIN_LINES)]) == MIN_LINES:
                    return replace(self, head=head)
                size *= 4
        return replace(self, head=head if "\n" in head or "\r" in head else head[:HEAD_BYTES])

    def text(self) -> str:
        """Return all of it."""
        with self.open() as file:
            file.seek(self.start)
            return file.read(self.end - self.start).decode(self.encoding, self.errors)

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield each line with its number in the file, without its end."""
        with self.open() as file:
            to_end = self.end == file.seek(0, io.SEEK_END)
            file.seek(self.start)
            text = io.TextIOWrapper(file, self.encoding, self.errors, newline=self.newline)
            remaining = self.end - self.start
            for number, line in enumerate(text, start=self.first_line):
                if remaining <= 0:
                    return
                remaining -= 0 if to_end else len(line.encode(self.encoding, self.errors))
                yield number, line.rstrip("\r\n")


@dataclass(frozen=True, slots=True)
class HeadLine:
    """A line of a segment's head: its number in the file, where it begins in bytes, its text."""

    number: int
    offset: int
    text: str

    @property
    def is_comment(self) -> bool:
        """Whether it is a comment."""
        return self.text.lstrip().startswith(COMMENTS)


def head_lines(segment: Segment) -> Iterator[HeadLine]:
    """Yield the lines of the head that are not blank."""
    offset, newline = segment.start, segment.newline
    for number, line in enumerate(segment.head.split(newline), start=segment.first_line):
        if line.strip():
            yield HeadLine(number, offset, line.strip("\r"))
        offset += len((line + newline).encode(segment.encoding, segment.errors))


def open_text(path: Path, *, any_suffix: bool = False) -> Segment:
    """Return a file as one segment, having made sure that it is text.

    Args:
        path: The file.
        any_suffix: Read it as text even if its suffix is that of another kind (.mat from `save -ascii`).

    Raises:
        LogError: If it is missing, a folder, empty, a known container (with the command that exports
            it), or binary.
    """
    size = _check_readable(path)
    with path.open("rb") as file:
        raw = file.read(HEAD_BYTES)
    container, compression, data = _find_container(path, raw, any_suffix), find_compression(raw), None
    if container is None and compression is not None:
        data = unpack(path, compression)
        size, raw = len(data), data[:HEAD_BYTES]
        name = path.with_suffix(".tar" if raw[257:262] == b"ustar" else "")
        container = _find_container(name, raw, any_suffix)
    if size == 0:
        fault = "found an empty file, allowed: a table with one row per sample"
        raise LogError(Finding(fault, file=str(path)))
    mark, encoding = _find_encoding(raw)
    if data is not None and compression is not None and (container or encoding is None):
        content = f"{container.what if container else 'a binary file'} in a {compression.name} archive"
        hint = Hint("", effect=f'unpack it: {compression.program} -dk "{path.as_posix()}"')
        raise LogError(Finding(file=str(path), found=content, allowed="a text table in it", hints=(hint,)))
    if container is not None:
        raise LogError(_export_advice(container, path))
    if encoding is None:
        raise LogError(_no_text(path, raw))
    evidence = "its first bytes"
    inferences = () if compression is None else (Inference("compression", compression.name, evidence),)
    return Segment(path, encoding, mark, size, 1, data=data, inferences=inferences).with_head()


def text_segment(path: Path, text: str, delimiter: str, inferences: tuple[Inference, ...]) -> Segment:
    """Return the content of a file that is no text as one segment: text that its reader wrote.

    Args:
        path: The file.
        text: Its content as lines.
        delimiter: Sign between the cells of a line.
        inferences: What was found out about the file.
    """
    data = text.encode("utf-8", "surrogatepass")
    return Segment(path, "utf-8", 0, len(data), 1, "", data, delimiter, inferences).with_head()


def check_line_lengths(segment: Segment) -> None:
    """Raise a `LogError` if a line is too long for a table.

    Such a line spans blocks of which the next holds no end of a line, as is quickly seen.
    """
    if segment.end <= MAX_LINE_BYTES:
        return
    sign, length, read = segment.newline.encode(), 0, 0
    with segment.open() as file:
        while block := file.read(MAX_LINE_BYTES // 8):
            first = block.find(sign)
            if length + (len(block) if first < 0 else first) > MAX_LINE_BYTES:
                fault, allowed = f"a line of more than {MAX_LINE_BYTES >> 20} MiB", "shorter lines"
                with segment.open() as before:
                    line = 1 + before.read(read - length).count(sign)
                hints, name = (_ROW_PER_SAMPLE,), str(segment.path)
                raise LogError(Finding(file=name, line=line, found=fault, allowed=allowed, hints=hints))
            length = length + len(block) if first < 0 else len(block) - 1 - block.rfind(sign)
            read += len(block)


def fingerprint(path: Path) -> SourceFile:
    """Return name, hash and length of a file, or of the files of a folder in the order of their names."""
    digest, length = hashlib.sha256(), 0
    for part in sorted(path.iterdir()) if path.is_dir() else [path]:
        if part.is_file():
            with part.open("rb") as file:
                hashlib.file_digest(file, lambda: digest)
                length += file.tell()
    return SourceFile(path.name, digest.hexdigest(), length)


def _check_readable(path: Path) -> int:
    try:
        if path.is_dir():
            raise LogError(Finding("found a folder, allowed: a file", file=str(path)))
        with path.open("rb"):
            return path.stat().st_size
    except FileNotFoundError:
        raise LogError(Finding(f"found no such file{suggest_path(path, LOGS)}", file=str(path))) from None
    except OSError as error:
        raise LogError(Finding(f"cannot be read: {error.strerror}", file=str(path))) from error


def _find_container(path: Path, raw: bytes, any_suffix: bool) -> Container | None:
    """Return what a file is if it is no text: by suffix and first bytes, by its suffix, or by its bytes."""
    containers, name = vocabulary().containers, path.name.lower()
    lengths = [max((len(end) for end in c.suffixes if name.endswith(end)), default=0) for c in containers]
    longest = 0 if any_suffix else max(lengths)
    by_suffix = [c for c, length in zip(containers, lengths, strict=True) if length == longest > 0]
    by_bytes = [container for container in containers if raw.startswith(container.magic)]
    by_both = [container for container in by_suffix if container in by_bytes]
    return next(iter((*by_both, *by_suffix, *by_bytes)), None)


def _export_advice(container: Container, path: Path) -> Finding:
    """Return the finding about a container: what it is, and the command that writes its table."""
    advice = container.advice.replace("{file}", path.as_posix())
    for kind in _WRITTEN:
        name = f"log.{kind}" if path.name != f"log.{kind}" else f"table.{kind}"
        advice = advice.replace(f"{{{kind}}}", name)
    hints = [Hint(name, None, effect) for name, effect in container.parameters.items()]
    hints[:0] = [Hint("", effect=advice)] if advice else []
    return Finding(f"found {container.what}, allowed: a text table", str(path), hints=tuple(hints))


def _no_text(path: Path, raw: bytes) -> Finding:
    """Return the finding about bytes that no text has: with their line if there is text above it."""
    place = next(k for k, byte in enumerate(raw) if byte in _CONTROL)
    line = raw.count(b"\n", 0, place) + 1
    if line <= _TITLE_LINES:
        return Finding("found a binary file, allowed: a text table (CSV)", file=str(path))
    fault = f"the byte 0x{raw[place]:02x}"
    return Finding(file=str(path), line=line, found=fault, allowed="text, as in the lines above")


def _find_encoding(raw: bytes) -> tuple[int, str | None]:
    """Return the length of the byte order mark and the encoding, None for a binary file.

    Source: the marks of the Unicode standard; without one, text of mostly Latin letters in UTF-16 has
    a zero in every second byte. Latin-1 is what remains: every byte is a letter in it.
    """
    for mark, encoding in _BYTE_ORDER_MARKS:
        if raw.startswith(mark):
            return len(mark), encoding
    odd, even = raw[1::2].count(0), raw[0::2].count(0)
    if max(odd, even) > 0.5 * (len(raw) // 2) and min(odd, even) == 0:
        return 0, "utf-16-le" if odd else "utf-16-be"
    if len(raw.translate(None, _CONTROL)) < len(raw):
        return 0, None
    try:
        codecs.getincrementaldecoder("utf-8")().decode(raw)
    except UnicodeDecodeError:
        return 0, "latin-1"
    return 0, "utf-8"
