"""What a file may hold: columns, the length of a line, and what comes of packed bytes.

A file beyond these is no log but a broken or a hostile one, and would take memory and time that its size does
not announce.

Compressed files: gzip, bzip2, xz and Zstandard, known by their first bytes, unpacked into memory.

Files as text: what is no log at all, which encoding, where lines begin, and the hash of the bytes.
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


HEAD_BYTES = 64 * 1024
"""What is looked at to find out how a file is written."""

MOST_HEAD = 1 << 20
"""What is looked at where that holds few lines: they are long, or below many comments."""

FEWEST_LINES = 4
"""So many lines, but for comments, show a header, units and rows."""

_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
LOGS = (".csv", ".txt", ".tsv", ".dat", ".log", ".rrd")
"""How most logs are called, and their recordings."""

_WRITTEN = ("csv", "npz")  # what the commands write that make tables of containers

COMMENTS = ("#", "%", "//")
_TITLE_LINES = 2  # a binary file may begin with as many lines of text
_CONTROL = bytes(set(range(32)) - set(b"\t\n\v\f\r\x1a\x1b"))


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
    head: str
    data: bytes | None = field(default=None, repr=False)
    delimiter: str = ""
    inferences: tuple[Inference, ...] = ()

    def open(self) -> BinaryIO:
        """Return the bytes of the text as an open file."""
        return self.path.open("rb") if self.data is None else io.BytesIO(self.data)

    @property
    def newline(self) -> str:
        """What ends a line: a line feed, or a carriage return in files that have no line feeds."""
        return "\r" if "\r" in self.head and "\n" not in self.head else "\n"

    @property
    def has_more(self) -> bool:
        """Whether the text continues after its head."""
        return len(self.head.encode(self.encoding, _errors(self.encoding))) < self.end - self.start

    def cut(self, start: int, end: int, first_line: int) -> Segment:
        """Return a stretch of the same file, with its own head."""
        cut = replace(self, start=start, end=end, first_line=first_line)
        return replace(cut, head=_head(cut))

    def text(self) -> str:
        """Return all of it."""
        with self.open() as file:
            file.seek(self.start)
            return file.read(self.end - self.start).decode(self.encoding, _errors(self.encoding))

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield each line with its number in the file, without its end."""
        with self.open() as file:
            whole = self.end == file.seek(0, io.SEEK_END)
            file.seek(self.start)
            text = io.TextIOWrapper(file, self.encoding, _errors(self.encoding), newline=self.newline)
            left = self.end - self.start
            for number, line in enumerate(text, start=self.first_line):
                if left <= 0:
                    return
                left -= 0 if whole else len(line.encode(self.encoding, _errors(self.encoding)))
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
    offset, newline, errors = segment.start, segment.newline, _errors(segment.encoding)
    for number, line in enumerate(segment.head.split(newline), start=segment.first_line):
        if line.strip():
            yield HeadLine(number, offset, line.strip("\r"))
        offset += len((line + newline).encode(segment.encoding, errors))


def open_text(path: Path, *, any_suffix: bool = False) -> Segment:
    """Return a file as one segment, having made sure that it is text.

    Args:
        path: The file.
        any_suffix: Read it as text even if its suffix says that it is none (.mat from `save -ascii`).

    Raises:
        LogError: If it is missing, a folder, empty, a known container (with the command that exports
            it), or binary.
    """
    size = _size(path)
    with path.open("rb") as file:
        raw = file.read(HEAD_BYTES)
    container, compression, data = _container(path, raw, any_suffix), find_compression(raw), None
    if container is None and compression is not None:
        data = unpack(path, compression)
        size, raw = len(data), data[:HEAD_BYTES]
        name = path.with_suffix(".tar" if raw[257:262] == b"ustar" else "")
        container = _container(name, raw, any_suffix)
    if size == 0:
        raise LogError(
            Finding("found an empty file, allowed: a table with one row per sample", file=str(path))
        )
    mark, encoding = _encoding(raw)
    if data is not None and compression is not None and (container or encoding is None):
        raise LogError(_about_packed(container, compression, path))
    if container is not None:
        raise LogError(_about(container, path))
    if encoding is None:
        raise LogError(_no_text(path, raw))
    inferences = (
        () if compression is None else (Inference("compression", compression.name, "its first bytes"),)
    )
    segment = Segment(path, encoding, mark, size, 1, "", data, inferences=inferences)
    return replace(segment, head=_head(segment))


def text_segment(path: Path, text: str, delimiter: str, inferences: tuple[Inference, ...]) -> Segment:
    """Return the content of a file that is no text as one segment: text that its reader wrote.

    Args:
        path: The file.
        text: Its content as lines.
        delimiter: Sign between the cells of a line.
        inferences: What was found out about the file.
    """
    data = text.encode("utf-8", "surrogatepass")
    segment = Segment(path, "utf-8", 0, len(data), 1, "", data, delimiter, inferences)
    return replace(segment, head=_head(segment))


def refuse_long_lines(segment: Segment) -> None:
    """Raise a `LogError` if a line is so long that it is none of a table.

    Such a line spans blocks of which the next holds no end of a line, as is quickly seen.
    """
    if segment.end <= LONGEST_LINE:
        return
    sign, since = segment.newline.encode(), 0
    with segment.open() as file:
        while block := file.read(LONGEST_LINE // 8):
            first = block.find(sign)
            if since + (len(block) if first < 0 else first) > LONGEST_LINE:
                raise long_line(str(segment.path), _lines_before(segment, file.tell() - len(block) - since))
            since = since + len(block) if first < 0 else len(block) - 1 - block.rfind(sign)


def _lines_before(segment: Segment, offset: int) -> int:
    """Return the line, from 1, that begins at an offset in bytes."""
    sign, line = segment.newline.encode(), 1
    with segment.open() as file:
        while offset > 0 and (block := file.read(min(offset, LONGEST_LINE))):
            line, offset = line + block.count(sign), offset - len(block)
    return line


def fingerprint(path: Path) -> SourceFile:
    """Return name, hash and length of a file, or of the files of a folder in the order of their names."""
    digest, length = hashlib.sha256(), 0
    for part in sorted(path.iterdir()) if path.is_dir() else [path]:
        if part.is_file():
            with part.open("rb") as file:
                hashlib.file_digest(file, lambda: digest)
                length += file.tell()
    return SourceFile(path.name, digest.hexdigest(), length)


def _size(path: Path) -> int:
    try:
        if path.is_dir():
            raise LogError(Finding("found a folder, allowed: a file", file=str(path)))
        with path.open("rb"):
            return path.stat().st_size
    except FileNotFoundError:
        raise LogError(Finding(f"found no such file{suggest_path(path, LOGS)}", file=str(path))) from None
    except OSError as error:
        raise LogError(Finding(f"cannot be read: {error.strerror}", file=str(path))) from error


def _container(path: Path, raw: bytes, any_suffix: bool) -> Container | None:
    """Return what a file is if it is no text: by suffix and first bytes, by its suffix, or by its bytes."""
    known, name = vocabulary().containers, path.name.lower()
    ends = [max((len(end) for end in one.suffixes if name.endswith(end)), default=0) for one in known]
    longest = 0 if any_suffix else max(ends)
    suffixed = [one for one, end in zip(known, ends, strict=True) if end == longest > 0]
    begun = [one for one in known if raw.startswith(one.magic)]
    both = [one for one in suffixed if one in begun]
    return next(iter((*both, *suffixed, *begun)), None)


def _about(container: Container, path: Path) -> Finding:
    """Return what is said of a container: what it is, and the command that writes its table."""
    names = {"{file}": path.as_posix()}
    names |= {
        f"{{{kind}}}": f"log.{kind}" if path.name != f"log.{kind}" else f"table.{kind}" for kind in _WRITTEN
    }
    advice = container.advice
    for sign, name in names.items():
        advice = advice.replace(sign, name)
    hints = (Hint(name, None, does) for name, does in container.parameters.items())
    found = f"found {container.what}, allowed: a text table"
    return Finding(found, str(path), hints=(*([Hint("", effect=advice)] if advice else []), *hints))


def _about_packed(container: Container | None, compression: Compression, path: Path) -> Finding:
    """Return the finding about a compressed file that holds no text."""
    content = f"{container.what if container else 'a binary file'} in a {compression.name} archive"
    hint = Hint("", effect=f'unpack it: {compression.program} -dk "{path.as_posix()}"')
    return Finding(file=str(path), found=content, allowed="a text table in it", hints=(hint,))


def _no_text(path: Path, raw: bytes) -> Finding:
    """Return what is said of bytes that no text has: with their line if text stands above it."""
    place = next(k for k, byte in enumerate(raw) if byte in _CONTROL)
    line = raw.count(b"\n", 0, place) + 1
    if line <= _TITLE_LINES:
        return Finding("found a binary file, allowed: a text table (CSV)", file=str(path))
    found = f"the byte 0x{raw[place]:02x}"
    return Finding(file=str(path), line=line, found=found, allowed="text, as in the lines above")


def _encoding(raw: bytes) -> tuple[int, str | None]:
    """Return the length of the byte order mark and the encoding, None for a binary file.

    Source: the marks of the Unicode standard; without one, text of mostly Latin letters in UTF-16 has
    a zero in every second byte. Latin-1 is what remains: every byte is a letter in it.
    """
    for mark, encoding in _BYTE_ORDER_MARKS:
        if raw.startswith(mark):
            return len(mark), encoding
    half = len(raw) // 2
    odd, even = raw[1::2].count(0), raw[0::2].count(0)
    if max(odd, even) > 0.5 * half and min(odd, even) == 0:
        return 0, "utf-16-le" if odd else "utf-16-be"
    if len(raw.translate(None, _CONTROL)) < len(raw):
        return 0, None
    try:
        codecs.getincrementaldecoder("utf-8")().decode(raw)
    except UnicodeDecodeError:
        return 0, "latin-1"
    return 0, "utf-8"


def _errors(encoding: str) -> str:
    """Return what becomes of bytes that are no text: in UTF-8 they come back, so that lengths stay."""
    return "surrogateescape" if encoding == "utf-8" else "replace"


def _head(segment: Segment) -> str:
    """Return the beginning of a segment as text: enough lines to show what they are."""
    head, size, length = "", HEAD_BYTES, segment.end - segment.start
    with segment.open() as file:
        while size <= MOST_HEAD:
            file.seek(segment.start)
            head = _decoded_head(file.read(min(size, length)), segment.encoding, whole=size >= length)
            if size >= length or _shows_rows(head):
                return head
            size *= 4
    return head if "\n" in head or "\r" in head else head[:HEAD_BYTES]


def _shows_rows(head: str) -> bool:
    """Return whether there are enough lines with content, but for comments."""
    lines = (line.lstrip() for line in head.splitlines())
    content = (line for line in lines if line and not line.startswith(COMMENTS))
    return len([*islice(content, FEWEST_LINES)]) == FEWEST_LINES


def _decoded_head(raw: bytes, encoding: str, *, whole: bool) -> str:
    """Return the text of the first bytes; unless they are the whole, without the last, cut line."""
    text = codecs.getincrementaldecoder(encoding)(_errors(encoding)).decode(raw)
    if whole:
        return text
    cut = (text.rfind("\n") + 1) or (text.rfind("\r") + 1)
    return text[:cut] if cut else text
