"""The figures of a report as files of their own: SVG to print and edit, PNG to show anywhere."""

from __future__ import annotations

import re
import struct
import unicodedata
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

from urmpipe_models.errors import Finding, OptionError, OutputError, for_each
from urmpipe_pipeline.outputs import guarded_output, refuse_output
from urmpipe_pipeline.placing import all_or_none
from urmpipe_pipeline.report.headless import FigureFormat, draw
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.text import unique

FORMATS: tuple[FigureFormat, ...] = get_args(FigureFormat)

LONGEST_NAME = 60
"""Letters of a part's or a figure's name in the name of its file."""

PNG_HEAD = 33
"""Bytes of a PNG before its first free chunk: the signature and the chunk IHDR."""

UNWRITABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff\ufffe\uffff]")
"""Characters of a text that XML and PNG have no room for."""


@dataclass(frozen=True, slots=True)
class FigureOptions:
    """Which files of figures are wanted.

    Attributes:
        folder: Where they go; it is made if it is missing.
        formats: svg, png or both.
    """

    folder: Path
    formats: tuple[FigureFormat, ...] = FORMATS

    def __post_init__(self) -> None:
        unknown = [name for name in self.formats if name not in FORMATS]
        if unknown or not self.formats:
            found = ", ".join(unknown) or "nothing"
            raise OptionError(Finding(parameter="formats", found=found, allowed="svg, png, both"))


@dataclass(frozen=True, slots=True)
class FigureFile:
    """A file of a figure.

    Attributes:
        path: Where it is.
        title: The figure's heading.
        part: The heading of the part of the report that it stands in.
    """

    path: Path
    title: str
    part: str

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {"file": str(self.path), "title": self.title, "part": self.part}


def figure_stem(title: str, part: str) -> str:
    """Return the name of a figure's file: its part's and its own, in a-z, 0-9 and hyphens."""
    return "-".join(name for name in map(_plain_name, (part, title)) if name) or "figure"


def write_figures(
    figures: Sequence[tuple[str, Figure]],
    options: FigureOptions,
    inputs: Sequence[Path] = (),
    progress: Callable[[float], None] | None = None,
) -> tuple[FigureFile, ...]:
    """Write figures, each behind the heading of its part, in every format: all files or none.

    Only figures that urmpipe wrote are replaced, never an input. Progress is the share of the files, 0..1.

    Raises:
        OutputError: If they may not be written there, or there is nothing to draw them with.
    """
    stems = unique([figure_stem(figure.title, part) for part, figure in figures])
    wanted = [
        (figure, suffix, FigureFile(options.folder / f"{stem}.{suffix}", figure.title, part))
        for stem, (part, figure) in zip(stems, figures, strict=True)
        for suffix in options.formats
    ]
    with _made_folder(options.folder), all_or_none():
        for_each(lambda one: refuse_output(one[2].path, inputs, "figure"), wanted)

        def write(number: int, drawn: bytes) -> None:
            """Put our mark into a drawn figure and write it to its place."""
            figure, suffix, file = wanted[number]
            marked = _marked_svg(drawn, figure) if suffix == "svg" else _marked_png(drawn, figure)
            with guarded_output(file.path, inputs, "figure") as part:
                part.write_bytes(marked)
            if progress:
                progress((number + 1) / len(wanted))

        if wanted:
            draw([(figure, suffix) for figure, suffix, _ in wanted], write)
    return tuple(file for _, _, file in wanted)


@contextmanager
def _made_folder(folder: Path) -> Iterator[None]:
    """Make a folder with those above it, which stay only if the body succeeds."""
    new = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        said = "found a file, allowed: a folder" if folder.is_file() else error.strerror or str(error)
        raise OutputError(Finding(said, str(folder), parameter="figures")) from error
    try:
        yield
    except BaseException:
        for one in new:
            with suppress(OSError):  # somebody else put a file there meanwhile
                one.rmdir()
        raise


def _plain_name(text: str) -> str:
    """Return a text in letters that every file system takes."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", plain)[:LONGEST_NAME].strip("-")


def _marked_svg(drawn: bytes, figure: Figure) -> bytes:
    """Return an SVG that says who drew it, and what it shows for who does not see it."""
    tag, _, rest = drawn.decode("utf-8").partition(">")
    title, alt = (escape(UNWRITABLE.sub("", said)) for said in (figure.title, figure.alt))
    told = f"<title>{title}</title><desc>{alt}</desc>"
    mark = f"<!-- Generator: urmpipe {version('urmpipe')} -->"
    return f'{mark}\n{tag} role="img">{told}{rest}'.encode()


def _marked_png(drawn: bytes, figure: Figure) -> bytes:
    """Return a PNG with chunks of text that say who drew it and what it shows."""
    chunks = _chunk(b"tEXt", f"Software\0urmpipe {version('urmpipe')}".encode())
    for key, said in (("Title", figure.title), ("Description", figure.alt)):
        chunks += _chunk(b"iTXt", f"{key}\0\0\0\0\0{UNWRITABLE.sub('', said)}".encode())
    return drawn[:PNG_HEAD] + chunks + drawn[PNG_HEAD:]


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG: length, kind, data, checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
