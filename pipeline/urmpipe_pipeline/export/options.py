"""What can be asked of an export, and what makes no sense together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.messages import Hint
from urmpipe_pipeline.comparison.compare import Tcp
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation

Format = Literal["csv", "parquet", "mat", "tum"]
FORMATS: tuple[Format, ...] = get_args(Format)

Rows = Literal["grid", "file"]
"""grid: the run on its grid, in SI; file: the rows of the file, its columns in its own units."""


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What leaves, and how.

    Attributes:
        to: The format.
        rows: Rows of the grid or of the file; None takes the grid, or of a recorded pose the file.
        tcp: Of a trajectory: by forward kinematics, or as the log recorded it; None takes fk.
    """

    to: Format
    rows: Rows | None = None
    tcp: Tcp | None = None

    def __post_init__(self) -> None:
        for parameter, value, allowed in (
            ("to", self.to, FORMATS),
            ("rows", self.rows, get_args(Rows)),
            ("tcp", self.tcp, get_args(Tcp)),
        ):
            if value is not None and value not in allowed:
                raise OptionError(Finding(parameter=parameter, found=value, allowed=", ".join(allowed)))
        if self.tcp is not None and self.to != "tum":
            found = f"{self.tcp} with the format {self.to}, which has both poses"
            hint = Hint("to", "tum", "has one of them")
            raise OptionError(Finding(parameter="tcp", found=found, hints=(hint,)))
        if self.tcp == "recorded" and self.rows == "grid":
            found = "grid with recorded poses, whose orientations stand at the file's rows only"
            raise OptionError(Finding(parameter="rows", found=found, allowed="file"))

    @property
    def chosen_rows(self) -> Rows:
        """The rows that leave of a run."""
        return self.rows or ("file" if self.tcp == "recorded" else "grid")

    def check(self, result: Result) -> None:
        """Raise an `OptionError` if a comparison or a simulation is asked for what only a run has."""
        if isinstance(result, Run):
            return
        has = "a comparison, which has the samples that it compared"
        if isinstance(result, Simulation):
            has = "a simulation, which has the samples that it recorded"
        for parameter, value in (("rows", self.rows), ("tcp", self.tcp)):
            if value is not None:
                found = f"{value} with {has}"
                raise OptionError(Finding(parameter=parameter, found=found, allowed="with a run"))


def format_of(to: Format | None, output: Path | None) -> Format:
    """Return the format that is asked for, or else that of the output's suffix; CSV without both.

    Raises:
        OptionError: If the output's suffix tells none.
    """
    if to is not None or output is None:
        return to or "csv"
    suffix = output.suffix.lower().lstrip(".")
    for known in FORMATS:
        if suffix == known:
            return known
    allowed = f"{', '.join(FORMATS)}, or an output that ends so"
    raise OptionError(Finding(parameter="to", found=f"the output {output}", allowed=allowed))
