"""`urmpipe.report`: one self-contained page about recordings or results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe.keyword_checks import PathLike, one_or_many, paths, public, refuse_foreign, refuse_others
from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.errors import map_collecting_errors
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.presentation.section import Cell, Value
from urmpipe_pipeline.results import enclosing_result, present, read_recording

if TYPE_CHECKING:
    import pandas as pd

    from urmpipe_pipeline.figures import FigureFile
    from urmpipe_pipeline.figures.files import FigureFormat


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Report(Displayable):
    """A report that was written.

    Attributes:
        path: The HTML file.
        results: What it shows.
        figures: The files of its figures; none unless they were asked for.
    """

    path: Path
    results: tuple[Result, ...]
    figures: tuple[FigureFile, ...] = ()

    def _headline(self) -> str:
        """Return the file, and what it shows."""
        figures = format_count(len(self.figures), "figure file") if self.figures else ""
        return format_headline(str(self.path), format_count(len(self.results), "result"), figures)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a compared log and quantity, as `Comparison.to_frame`, for all comparisons in it."""
        import pandas as pd

        shown = (present(one) for one in self.results)
        tables = [one.rows() for one in shown if one.verdict is not None and one.rows is not None]
        frames = [
            pd.DataFrame({one.key: [*map(_plain, one.cells)] for one in table.columns}) for table in tables
        ]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe report --json` prints."""
        return {
            "schema": 1,
            "report": str(self.path),
            "recordings": [{"name": one.name, "verdict": present(one).verdict} for one in self.results],
            "figures": [figure.to_dict() for figure in self.figures],
        }


def _plain(cell: Cell) -> Any:
    """Return what a table for programs holds of a cell."""
    return cell.number if isinstance(cell, Value) else cell


SHOWN = (
    "a recording, a Run, a Comparison, a Diagnosis or a Simulation; ik(..., output=FILE.rrd) writes a"
    " recording"
)


@public
def report(
    results: PathLike | Result | Sequence[PathLike | Result],
    output: PathLike,
    *,
    figures: PathLike | None = None,
    formats: FigureFormat | Sequence[FigureFormat] = ("pdf", "png"),
    figure_names: str | Sequence[str] = (),
    figure_width: str | float = "page",
    figure_font: float = 8.0,
    figure_dpi: int = 300,
    inputs: Sequence[PathLike] = (),
    progress: Callable[[float], None] | None = None,
) -> Report:
    """Write one self-contained HTML file about recordings or results, and its figures as files: all or none.

    Args:
        results: Recordings (.rrd), what `ingest`, `compare`, `diagnose` and `simulate` returned, or
            one of them.
        output: The HTML file to write.
        figures: A folder to write the figures to as files; needs the extra `figures`. Drawings, such as
            that of a simulated system, are SVG in any case.
        formats: pdf, svg, png, or several of them.
        figure_names: Titles of the figures to write, or patterns of them such as "Deviation*"; with the
            heading of their part before them, such as "log-2/Deviation over time". By default all.
        figure_width: column (88 mm), page (180 mm), a text such as "85mm" or "3.5in", or a number in [m].
        figure_font: Size of the text in figures in [pt].
        figure_dpi: Dots an inch of a PNG.
        inputs: Files besides the recordings that are never replaced.
        progress: Told the share that is done, 0..1.

    Raises:
        UrmpipeError: With everything that is wrong with the recordings or the output.
    """
    from urmpipe_pipeline.figures import FigureOptions
    from urmpipe_pipeline.report import write_report

    def wanted(folder: PathLike) -> FigureOptions:
        """Return which figures are written, all checked."""
        chosen = tuple(one_or_many(formats)), tuple(one_or_many(figure_names))
        return FigureOptions(Path(folder), *chosen, figure_width, figure_font, figure_dpi)

    of_figures = None if figures is None else wanted(figures)
    given = one_or_many(results)
    refuse_others("results", given, (Result,), SHOWN)
    files = [Path(one) for one in given if isinstance(one, (str, Path))]
    refuse_foreign(files)
    reading, writing = _halves(progress)

    def read(numbered: tuple[int, PathLike | Result]) -> Result:
        """Return a result, read if it is a recording, and tell how far it is."""
        number, one = numbered
        found = read_recording(Path(one), lazy=True) if isinstance(one, (str, Path)) else one
        reading(number / len(given))
        return enclosing_result(found)

    found = map_collecting_errors(read, enumerate(given, start=1))
    shown = [present(one) for one in found]
    written = write_report(shown, Path(output), [*files, *paths(inputs)], of_figures, writing)
    return Report(written.path, tuple(found), written.figures)


def _halves(progress: Callable[[float], None] | None) -> tuple[Callable[[float], None], ...]:
    """Return what to tell the progress of the first and of the second half of some work."""
    tell = progress or (lambda share: None)
    return lambda share: tell(share / 2), lambda share: tell((1 + share) / 2)
