"""The figures of a report as files of their own: PDF to print, SVG to edit, PNG to show anywhere."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from urmpipe_models.errors import Finding, OptionError, OutputError, format_value, map_collecting_errors
from urmpipe_pipeline.figures.listing import Listed, Plot, chosen, listed
from urmpipe_pipeline.figures.size import COARSEST, FINEST, Size, size_of
from urmpipe_pipeline.outputs import DRAWING_HEADER, atomic_group, check_output, safe_output
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.text import make_unique

if TYPE_CHECKING:
    from urmpipe_pipeline.figures.sheet import Sheet

FigureFormat = Literal["pdf", "svg", "png"]
FORMATS: tuple[FigureFormat, ...] = get_args(FigureFormat)

LONGEST_NAME = 60
"""Letters of a part's or a figure's name in the name of its file."""

UNWRITABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff\ufffe\uffff]")
"""Characters of a text that XML and PNG have no room for."""

NO_MATPLOTLIB = Finding(
    parameter="figures", found="no matplotlib, which draws them", allowed="pip install 'urmpipe[figures]'"
)


@dataclass(frozen=True, slots=True)
class FigureOptions:
    """Which files of figures are wanted, and how large.

    Attributes:
        folder: Where they go; it is made if it is missing.
        formats: pdf, svg, png.
        names: Titles or patterns of the figures that are wanted; none for all.
        width: column, page, a length with its unit, or a number in [m].
        font: Size of the text in [pt].
        dpi: Dots an inch of a PNG.

    Raises:
        OptionError: With all that is not allowed.
    """

    folder: Path
    formats: tuple[FigureFormat, ...] = FORMATS
    names: tuple[str, ...] = ()
    width: str | float = "page"
    font: float = 8.0
    dpi: int = 300

    def __post_init__(self) -> None:
        map_collecting_errors(
            lambda check: check(), (self._check_formats, lambda: self.size, self._check_dpi)
        )

    @property
    def size(self) -> Size:
        """How large they are."""
        return size_of(self.width, self.font, "figure_")

    def _check_formats(self) -> None:
        unknown = [name for name in self.formats if name not in FORMATS]
        if unknown or not self.formats:
            found = ", ".join(unknown) or "nothing"
            raise OptionError(Finding(parameter="formats", found=found, allowed=", ".join(FORMATS)))

    def _check_dpi(self) -> None:
        if not FINEST <= self.dpi <= COARSEST:
            allowed = f"{FINEST} to {COARSEST}"
            raise OptionError(Finding(parameter="figure_dpi", found=format_value(self.dpi), allowed=allowed))


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
    presentations: Sequence[Presentation],
    options: FigureOptions,
    inputs: Sequence[Path] = (),
    progress: Callable[[float], None] | None = None,
) -> tuple[FigureFile, ...]:
    """Write the figures of presentations in every format that is wanted: all files or none.

    A drawing that is ready, such as that of a simulated system, is SVG in any case, as it is. Only figures
    that urmpipe wrote are replaced, never an input. Progress is the share of the files, 0..1.

    Raises:
        OptionError: If a name stands for no figure.
        OutputError: If they may not be written there, or there is no matplotlib to draw them.
    """
    figures = chosen(list(listed(presentations)), options.names, "figure_names")
    stems = make_unique([figure_stem(one.title, one.part) for one in figures])
    wanted = [
        (one, [FigureFile(options.folder / f"{stem}.{suffix}", one.title, one.part) for suffix in suffixes])
        for stem, one in zip(stems, figures, strict=True)
        for suffixes in [("svg",) if isinstance(one.content, Drawing) else options.formats]
    ]
    files = [file for _, some in wanted for file in some]
    with _made_folder(options.folder), atomic_group():
        map_collecting_errors(lambda file: check_output(file.path, inputs, "figure"), files)
        done = 0
        for one, some in wanted:
            save = _saver(one, options)
            for file in some:
                with safe_output(file.path, inputs, "figure") as part:
                    save(part, file.path.suffix[1:])
                done += 1
                if progress:
                    progress(done / len(files))
    return tuple(files)


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


def _saver(one: Listed, options: FigureOptions) -> Callable[[Path, str], None]:
    """Return what writes a figure to a file in a format; it is drawn once for all of them."""
    if isinstance(one.content, Drawing):
        svg = one.content.svg
        return lambda path, suffix: _write_svg(path, svg, one)
    sheet = drawn(one.content, options.size)
    sheet.settle()
    title, alt = _writable(one)
    ours = f"urmpipe {version('urmpipe')}"
    metadata: dict[str, dict[str, str | None]] = {
        "pdf": {"Creator": ours, "Title": title, "Subject": alt, "CreationDate": None},
        "svg": dict.fromkeys(("Creator", "Date", "Format", "Type")),
        "png": {"Software": ours, "Title": title, "Description": alt},
    }

    def save(path: Path, suffix: str) -> None:
        """Write the figure in the format of a suffix."""
        sheet.savefig(path, format=suffix, dpi=options.dpi, metadata=metadata[suffix])
        if suffix == "svg":
            _write_svg(path, path.read_text(encoding="utf-8"), one)

    return save


def drawn(content: Plot | SpaceFigure, size: Size) -> Sheet:
    """Return a figure drawn by matplotlib.

    Raises:
        OutputError: If that is missing.
    """
    try:
        import matplotlib  # noqa: F401 - the extra may be missing
    except ImportError as error:
        raise OutputError(NO_MATPLOTLIB) from error
    from urmpipe_pipeline.figures import drawing

    return drawing.drawn(content, size)


def _writable(one: Listed) -> tuple[str, str]:
    """Return the title of a figure and what it shows, without characters that no file has room for."""
    return UNWRITABLE.sub("", one.title), UNWRITABLE.sub("", one.alt)


def _write_svg(path: Path, svg: str, one: Listed) -> None:
    """Write an SVG that says who drew it, and what it shows for who does not see it."""
    tag, _, rest = svg[svg.index("<svg") :].partition(">")
    title, alt = map(escape, _writable(one))
    told = f"<title>{title}</title><desc>{alt}</desc>"
    mark = f"{DRAWING_HEADER}{version('urmpipe')} -->"
    role = "" if " role=" in tag else ' role="img"'
    path.write_text(f"{mark}\n{tag}{role}>{told}{rest}", encoding="utf-8")
