"""What can be asked of an export, and what makes no sense together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from urmpipe_models.errors import Finding, Hint, OptionError, check_choice
from urmpipe_pipeline.presentation.exports import Exports

Format = Literal["csv", "parquet", "mat", "tum"]
FORMATS: tuple[Format, ...] = get_args(Format)

RowNames = Literal["grid", "file", "velocities", "samples", "criteria"]
"""grid: the run on its grid, in SI; file: the rows of the file, its columns in its own units; of an accuracy
velocities: the errors of each; samples: those of all its motions; criteria: those of a test
after ISO 9283."""

PoseNames = Literal["fk", "recorded"]
"""By forward kinematics, or as the log recorded them."""


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What leaves, and how.

    Attributes:
        to: The format.
        rows: Which rows leave, such as grid or file; None takes the usual ones.
        tcp: Of a trajectory: which poses, such as fk or recorded; None takes the usual ones.
    """

    to: Format
    rows: str | None = None
    tcp: str | None = None

    def __post_init__(self) -> None:
        for parameter, value, allowed in (
            ("to", self.to, FORMATS),
            ("rows", self.rows, get_args(RowNames)),
            ("tcp", self.tcp, get_args(PoseNames)),
        ):
            if value is not None:
                check_choice(parameter, value, allowed)
        if self.tcp is not None and self.to != "tum":
            found = f"{self.tcp} with a table ({self.to})"
            raise _refused("tcp", found, "with trajectories", Hint("to", "tum", "writes them"))

    def chosen(self, exports: Exports) -> tuple[str, str]:
        """Return the names of the rows and of the poses that leave of a result.

        Raises:
            OptionError: If the result has no such rows or poses.
        """
        _refuse_unknown("rows", self.rows, exports.rows, exports.kind)
        _refuse_unknown("tcp", self.tcp, exports.poses, exports.kind)
        poses = self.tcp or next(iter(exports.poses), "")
        held = exports.pose_rows.get(poses) if self.tcp else None
        if held and self.rows not in (None, held):
            found = f"{self.rows} with {poses} poses, which stand at other rows"
            raise _refused("rows", found, held)
        return self.rows or held or next(iter(exports.rows)), poses


def _refuse_unknown(parameter: str, value: str | None, known: Iterable[str], kind: str) -> None:
    """Raise an `OptionError` if a result of a kind does not have what is asked for by name."""
    if value is not None and value not in known:
        raise _refused(parameter, f"{value} with a {kind}", ", ".join(filter(None, known)) or "none")


def _refused(parameter: str, found: str, allowed: str, *hints: Hint) -> OptionError:
    return OptionError(Finding(parameter=parameter, found=found, allowed=allowed, hints=hints))


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
    raise _refused("to", f"the output {output}", f"{', '.join(FORMATS)}, or an output with that suffix")
