"""`urmpipe.report`: one self-contained page about recordings or results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from urmpipe.parameters import kinds
from urmpipe.parameters.outputs import Report as ReportParameters
from urmpipe.public_functions import PathLike, as_list, check_types, public_function, require_recordings
from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.errors import map_collecting_errors
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.presentation.section import Cell, Value
from urmpipe_pipeline.results import enclosing_result, present, read_recording

if TYPE_CHECKING:
    import pandas as pd

    from urmpipe_pipeline.figures import FigureFile


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Report(Displayable):
    """A report that was written.

    Attributes:
        path: The HTML file.
        results: What it shows.
        figures: The files of its figures, if they were written.
    """

    path: Path
    results: tuple[Result, ...]
    figures: tuple[FigureFile, ...] = ()

    def _headline(self) -> str:
        """Return the file, and what it shows."""
        figures = format_count(len(self.figures), "figure file") if self.figures else ""
        return format_headline(str(self.path), format_count(len(self.results), "result"), figures)

    def to_frame(self) -> pd.DataFrame:
        """Return one row per compared log and quantity, as `Comparison.to_frame`, of all comparisons."""
        import pandas as pd

        shown = (present(result) for result in self.results)
        tables = [view.rows() for view in shown if view.verdict is not None and view.rows is not None]
        frames = [
            pd.DataFrame({column.key: [*map(_plain, column.cells)] for column in table.columns})
            for table in tables
        ]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe report --json` prints."""
        return {
            "schema": 1,
            "report": str(self.path),
            "recordings": [
                {"name": result.name, "verdict": present(result).verdict} for result in self.results
            ],
            "figures": [figure.to_dict() for figure in self.figures],
        }


def _plain(cell: Cell) -> Any:
    """Return what a table for programs holds of a cell."""
    return cell.number if isinstance(cell, Value) else cell


SHOWN = (
    "a recording, a Run, a Comparison, a Diagnosis or a Simulation; ik(..., output=FILE.rrd) writes a"
    " recording"
)


@public_function(ReportParameters, output=kinds.ANY_FILE)
def report(
    results: PathLike | Result | Sequence[PathLike | Result],
    output: PathLike,
    **options: Unpack[ReportParameters],
) -> Report:
    """Write one self-contained HTML file about recordings or results, and its figures as files: all or none.

    Args:
        results: Recordings (.rrd), what `ingest`, `compare`, `diagnose` and `simulate` returned, or one of
            them.
        output: The HTML file to write.
        **options: The folder, the formats and the titles of figures as files, their size: the options of
            `urmpipe report`, by their names. Figures need the extra `figures`; drawings, such as that of a
            simulated system, are SVG in any case. A number as `figure_width` is in [m].

    Raises:
        UrmpipeError: With everything that is wrong with the recordings or the output.
    """
    from urmpipe_pipeline.figures import FigureOptions
    from urmpipe_pipeline.report import write_report

    values: Mapping[str, Any] = options  # as their kinds read them
    progress = values["progress"] or (lambda share: None)
    figures: FigureOptions | None = None
    if values["figures"] is not None:
        size = (values[f"figure_{name}"] for name in ("width", "font", "dpi"))
        figures = FigureOptions(values["figures"], values["formats"], values["figure_names"], *size)
    operands = as_list(results)
    check_types("results", operands, (Result,), SHOWN)
    files = [Path(operand) for operand in operands if isinstance(operand, (str, Path))]
    require_recordings(files)

    def read(numbered: tuple[int, PathLike | Result]) -> Result:
        """Return a result, read if it is a recording."""
        number, operand = numbered
        result = read_recording(Path(operand), lazy=True) if isinstance(operand, (str, Path)) else operand
        progress(number / len(operands) / 2)
        return enclosing_result(result)

    shown = map_collecting_errors(read, enumerate(operands, start=1))
    written = write_report(
        [present(result) for result in shown], Path(output), [*files, *values["inputs"]], figures,
        lambda share: progress((1 + share) / 2),
    )  # fmt: skip
    return Report(written.path, tuple(shown), written.figures)
