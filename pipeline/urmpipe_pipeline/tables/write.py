"""Write an export: beside its place, read back, renamed; of several files all or none."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.errors import Finding, OutputError, map_collecting_errors
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import (
    EXPORT_HEADER,
    atomic_group,
    check_output,
    register_owner_check,
    safe_output,
)
from urmpipe_pipeline.presentation.exports import Exports, ExportTable, Poses
from urmpipe_pipeline.tables.lines import write_csv, write_tum
from urmpipe_pipeline.tables.mat_file import write_mat
from urmpipe_pipeline.tables.options import ExportOptions, Format
from urmpipe_pipeline.tables.parquet_file import is_ours, write_parquet
from urmpipe_pipeline.text import to_json_value, unique

if TYPE_CHECKING:
    import pandas as pd

HEAD = 128
"""The mark of a MAT or TUM file stands within so many bytes of its start."""

PARQUET = b"PAR1"
"""Every Parquet file starts so."""


def is_export(path: Path) -> bool:
    """Tell whether a file is a MAT, TUM or Parquet file that urmpipe exported."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.startswith(PARQUET):
        return is_ours(path)
    return EXPORT_HEADER.encode() in head and head.startswith((b"# ", b"MATLAB 5.0"))


register_owner_check("export", is_export)

POSE_COLUMNS = (
    ("t", "s"), ("x", "m"), ("y", "m"), ("z", "m"), ("qx", ""), ("qy", ""), ("qz", ""), ("qw", ""),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ExportedFile:
    """A file that was written.

    Attributes:
        path: Where it is.
        rows: Rows of numbers in it.
    """

    path: Path
    rows: int


@dataclass(frozen=True, slots=True, repr=False)
class Exported(Displayable):
    """What left.

    Attributes:
        files: The files: one, or as trajectories two a log of a comparison, one an arm of a simulation.
        to: Their format.
        rows: Which rows they hold: grid, file, compared (of a comparison) or simulated.
        columns: Name and unit of each column.
        left_out: Rows without a pose, which a trajectory cannot hold.
        warnings: What could not leave.
    """

    files: tuple[ExportedFile, ...]
    to: Format
    rows: str
    columns: tuple[tuple[str, str], ...]
    left_out: int = 0
    warnings: tuple[LogWarning, ...] = ()

    @property
    def path(self) -> Path:
        """The file; of several trajectories the first."""
        return self.files[0].path

    def _headline(self) -> str:
        """Return the file, and what it holds."""
        more = f"and {format_count(len(self.files) - 1, 'other file')}" if len(self.files) > 1 else ""
        rows = format_count(sum(one.rows for one in self.files), "row")
        return format_headline(str(self.path), more, self.to, rows, format_count(len(self.columns), "column"))

    def to_frame(self) -> pd.DataFrame:
        """Return one row a file: its path and its rows."""
        import pandas as pd

        return pd.DataFrame([(str(one.path), one.rows) for one in self.files], columns=["file", "rows"])

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe export --json` prints."""
        return {
            "schema": 1,
            "files": [{"file": str(one.path), "samples": one.rows} for one in self.files],
            "to": self.to,
            "rows": self.rows,
            "columns": [{"name": name, "unit": unit} for name, unit in self.columns],
            "left_out": self.left_out,
            "warnings": [one.to_dict() for one in self.warnings],
        }


def export_result(
    exports: Exports,
    recording: Path | None,
    output: Path | None,
    options: ExportOptions,
    inputs: Sequence[Path] = (),
) -> Exported:
    """Write a result as tables or trajectories.

    Args:
        exports: What can leave of it.
        recording: Its recording, by which the output is named; None without one.
        output: The file; None names it after the recording or the result, in the working folder. Of
            several trajectories each has its own name behind that of the file.
        options: What leaves, and how.
        inputs: Files that are never replaced.

    Raises:
        OptionError: If the options make no sense for the result.
        RecordingError: If the result does not hold what is asked for.
        OutputError: If a file may not be written there, or did not read back as it was written.
    """
    rows, poses = options.chosen(exports)
    ending = f"-{rows}" if len(exports.rows) > 1 else ""
    name = recording.stem if recording else _file_name(exports.about["name"])
    target = output or Path(f"{name}{ending}.{options.to}")
    if options.to == "tum":
        return _export_poses(exports, exports.poses[poses](rows), target, rows, inputs)
    table = exports.rows[rows].table()
    write_all([target], [_writer(exports, table, options.to, rows, target)], options.to, inputs)
    names = tuple((column.name, column.unit) for column in table.columns)
    told = (*table.warnings, *(table.unsaid if options.to == "csv" else ()))
    return Exported((ExportedFile(target, table.rows),), options.to, rows, names, 0, told)


def _writer(
    exports: Exports, table: ExportTable, to: Format, rows: str, target: Path
) -> Callable[[Path], list[str]]:
    """Return what writes a table to a path."""
    if to == "csv":
        return partial(write_csv, table)
    named = {"mark": EXPORT_HEADER, "schema": 1, "name": exports.about["name"], "rows": rows}
    about = json.dumps(to_json_value({**named, **exports.about}))  # JSON: every encoding can hold it
    if to == "parquet":
        return partial(write_parquet, table, about)
    fields = {**exports.rows[rows].fields(table), "metadata": about}
    return partial(write_mat, exports.kind, fields, target=target)


def _export_poses(
    exports: Exports, found: Sequence[Poses], target: Path, rows: str, inputs: Sequence[Path]
) -> Exported:
    stems = [f"{target.stem}-{_file_name(one.name)}" if one.name else target.stem for one in found]
    targets = [target.with_name(name + target.suffix) for name in unique(stems)]
    write_all(targets, [partial(write_tum, poses) for poses in found], "tum", inputs)
    files = tuple(ExportedFile(path, len(poses.clock_ns)) for path, poses in zip(targets, found, strict=True))
    left_out = sum(poses.left_out for poses in found)
    return Exported(files, "tum", rows, POSE_COLUMNS, left_out, (*exports.warnings, *_left_out(found)))


def _left_out(found: Sequence[Poses]) -> Iterator[LogWarning]:
    """Yield a warning for each trajectory that lacks rows."""
    for poses in found:
        if poses.left_out:
            said = f"{poses.left_out} of {poses.left_out + len(poses.clock_ns)} rows have no pose: left out"
            yield LogWarning("left-out", said, about=poses.name or None)


def write_all(
    targets: Sequence[Path],
    writers: Sequence[Callable[[Path], list[str]]],
    to: Format,
    inputs: Sequence[Path],
) -> None:
    """Write all files beside their places, and rename them only when all were read back as written.

    Args:
        targets: Where they are to stand.
        writers: What writes each to a path and returns how the file differs from what it wrote.
        to: Their format.
        inputs: Files that are never replaced.

    Raises:
        OutputError: If one may not be written there, or did not read back as it was written.
    """
    if to == "csv" and targets[0].is_file():
        found = "found a file, allowed: a new name; an existing CSV file is never replaced"
        raise OutputError(Finding(found, str(targets[0])))
    map_collecting_errors(lambda path: check_output(path, inputs, "export"), targets)
    with atomic_group():
        for path, write in zip(targets, writers, strict=True):
            with safe_output(path, inputs, "export") as part:
                wrong = write(part)
            if wrong:
                said = f"differs when read back: {', '.join(wrong)}"
                raise OutputError(Finding(said, str(path)))


def _file_name(name: str) -> str:
    """Return a name without the signs that folders and shells take for their own."""
    return re.sub(r'[\s/\\:*?"<>|]+', "_", name).strip("._") or "export"
