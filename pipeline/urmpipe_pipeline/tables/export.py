"""Export a result as CSV, Parquet, MAT or TUM: written with new names, read back, then renamed, all or none.

1. `ExportOptions`, `format_of`: the format, and which rows or poses; options that contradict each other are
   errors.
2. `export_result` takes what the kind of the result can export (`presentation.exports`) and the writer of the
   format, and returns `Exported`.
3. `write_all` gives the files their names when all of them read back as they were written.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.errors import (
    Finding,
    Hint,
    OptionError,
    OutputError,
    check_choice,
    map_collecting_errors,
)
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import (
    EXPORT_HEADER,
    atomic_group,
    check_output,
    register_owner_check,
    safe_output,
)
from urmpipe_pipeline.presentation.exports import Exports, ExportTable, Poses
from urmpipe_pipeline.tables.csv_files import write_csv, write_tum
from urmpipe_pipeline.tables.typed_files import is_our_parquet, write_mat, write_parquet
from urmpipe_pipeline.text import make_unique, to_json_value

if TYPE_CHECKING:
    import pandas as pd

Format = Literal["csv", "parquet", "mat", "tum"]
FORMATS: tuple[Format, ...] = get_args(Format)

# grid: the run on its grid, in SI; file: the rows of the file, its columns in its own units; of an accuracy
# velocities: the errors of each; samples: those of all its motions; criteria: those of a test after ISO 9283.
RowNames = Literal["grid", "file", "compared", "criteria", "velocities", "samples", "simulated"]

PoseNames = Literal["fk", "recorded"]  # by forward kinematics, or as the log recorded them

HEAD = 128  # bytes at the start of a MAT or TUM file with the mark of an export
PARQUET = b"PAR1"  # start of a Parquet file

POSE_COLUMNS = (
    ("t", "s"), ("x", "m"), ("y", "m"), ("z", "m"), ("qx", ""), ("qy", ""), ("qz", ""), ("qw", ""),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """Options of an export.

    Attributes:
        to: Format.
        rows: Which rows to export, such as grid or file; None for the usual ones.
        tcp: Which poses a trajectory has, such as fk or recorded; None for the usual ones.
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
            value = f"{self.tcp} with a table ({self.to})"
            raise _option_error("tcp", value, "with trajectories", Hint("to", "tum", "writes them"))

    def choose(self, exports: Exports) -> tuple[str, str]:
        """Return the names of the rows and of the poses to export of a result.

        Raises:
            OptionError: If the result has no such rows or poses.
        """
        _check_known("rows", self.rows, exports.rows, exports.kind)
        _check_known("tcp", self.tcp, exports.poses, exports.kind)
        poses = self.tcp or next(iter(exports.poses), "")
        pose_rows = exports.pose_rows.get(poses) if self.tcp else None
        if pose_rows and self.rows not in (None, pose_rows):
            value = f"{self.rows} with {poses} poses, which are at other rows"
            raise _option_error("rows", value, pose_rows)
        return self.rows or pose_rows or next(iter(exports.rows)), poses


def _check_known(parameter: str, value: str | None, known: Iterable[str], kind: str) -> None:
    if value is not None and value not in known:
        article = "an" if kind[0] in "aeiou" else "a"
        raise _option_error(
            parameter, f"{value} with {article} {kind}", ", ".join(filter(None, known)) or "none"
        )


def _option_error(parameter: str, value: str, allowed: str, *hints: Hint) -> OptionError:
    return OptionError(Finding(parameter=parameter, found=value, allowed=allowed, hints=hints))


def format_of(to: Format | None, output: Path | None) -> Format:
    """Return the stated format, or else that of the output's suffix; CSV without both.

    Raises:
        OptionError: If the output has the suffix of no format.
    """
    if to is not None or output is None:
        return to or "csv"
    suffix = output.suffix.lower().lstrip(".")
    for known in FORMATS:
        if suffix == known:
            return known
    allowed = f"{', '.join(FORMATS)}, or an output with that suffix"
    raise _option_error("to", f"the output {output}", allowed)


@dataclass(frozen=True, slots=True)
class ExportedFile:
    """A file that was written.

    Attributes:
        path: Path of the file.
        rows: Rows of numbers in it.
    """

    path: Path
    rows: int


@dataclass(frozen=True, slots=True, repr=False)
class Exported(Displayable):
    """What was exported.

    Attributes:
        files: The files: one; of trajectories two per log of a comparison, one per arm of a simulation.
        to: Their format.
        rows: Which rows they have: grid, file, compared (of a comparison) or simulated.
        columns: Name and unit of each column.
        left_out: Rows without a pose, which a trajectory cannot have.
        warnings: What could not be exported.
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
        more = f"and {format_count(len(self.files) - 1, 'other file')}" if len(self.files) > 1 else ""
        rows = format_count(sum(file.rows for file in self.files), "row")
        return format_headline(str(self.path), more, self.to, rows, format_count(len(self.columns), "column"))

    def to_frame(self) -> pd.DataFrame:
        """Return one row per file: its path and its rows."""
        import pandas as pd

        return pd.DataFrame([(str(file.path), file.rows) for file in self.files], columns=["file", "rows"])

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe export --json` prints."""
        return {
            "schema": 1,
            "files": [{"file": str(file.path), "samples": file.rows} for file in self.files],
            "to": self.to,
            "rows": self.rows,
            "columns": [{"name": name, "unit": unit} for name, unit in self.columns],
            "left_out": self.left_out,
            "warnings": [warning.to_dict() for warning in self.warnings],
        }


def is_export(path: Path) -> bool:
    """Return whether a file is a MAT, TUM or Parquet file that urmpipe exported."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.startswith(PARQUET):
        return is_our_parquet(path)
    return EXPORT_HEADER.encode() in head and head.startswith((b"# ", b"MATLAB 5.0"))


register_owner_check("export", is_export)


def export_result(
    exports: Exports,
    recording: Path | None,
    output: Path | None,
    options: ExportOptions,
    inputs: Sequence[Path] = (),
) -> Exported:
    """Write a result as tables or trajectories.

    Args:
        exports: What can be exported of it.
        recording: Its recording, which gives the output its name; None without one.
        output: The file; None names it after the recording or the result, in the working folder. Of several
            trajectories, each has its name after that of the file.
        options: Format, rows and poses.
        inputs: Files that are never replaced.

    Raises:
        OptionError: If the options do not fit the result.
        RecordingError: If the result does not have these rows or poses.
        OutputError: If a file may not be written there, or did not read back as it was written.
    """
    rows, poses = options.choose(exports)
    ending = f"-{rows}" if len(exports.rows) > 1 else ""
    name = recording.stem if recording else _file_name(exports.about["name"])
    target = output or Path(f"{name}{ending}.{options.to}")
    if options.to == "tum":
        return _export_poses(exports, exports.poses[poses](rows), target, rows, inputs)
    table = exports.rows[rows].table()
    write_all([target], [_table_writer(exports, table, options.to, rows, target)], options.to, inputs)
    columns = tuple((column.name, column.unit) for column in table.columns)
    warnings = (*table.warnings, *(table.unsaid if options.to == "csv" else ()))
    return Exported((ExportedFile(target, table.rows),), options.to, rows, columns, 0, warnings)


def _table_writer(
    exports: Exports, table: ExportTable, to: Format, rows: str, target: Path
) -> Callable[[Path], list[str]]:
    """Return the function that writes a table to a path."""
    if to == "csv":
        return partial(write_csv, table)
    head = {"mark": EXPORT_HEADER, "schema": 1, "name": exports.about["name"], "rows": rows}
    about = json.dumps(to_json_value({**head, **exports.about}))  # ASCII, which every encoding has
    if to == "parquet":
        return partial(write_parquet, table, about)
    fields = {**exports.rows[rows].fields(table), "metadata": about}
    return partial(write_mat, exports.kind, fields, target=target)


def _export_poses(
    exports: Exports, trajectories: Sequence[Poses], target: Path, rows: str, inputs: Sequence[Path]
) -> Exported:
    stems = [
        f"{target.stem}-{_file_name(poses.name)}" if poses.name else target.stem for poses in trajectories
    ]
    targets = [target.with_name(name + target.suffix) for name in make_unique(stems)]
    write_all(targets, [partial(write_tum, poses) for poses in trajectories], "tum", inputs)
    files = tuple(
        ExportedFile(path, len(poses.clock_ns)) for path, poses in zip(targets, trajectories, strict=True)
    )
    left_out = sum(poses.left_out for poses in trajectories)
    warnings = (*exports.warnings, *_missing_pose_warnings(trajectories))
    return Exported(files, "tum", rows, POSE_COLUMNS, left_out, warnings)


def _missing_pose_warnings(trajectories: Sequence[Poses]) -> Iterator[LogWarning]:
    for poses in trajectories:
        if poses.left_out:
            rows = poses.left_out + len(poses.clock_ns)
            message = f"{poses.left_out} of {rows} rows have no pose: left out"
            yield LogWarning("left-out", message, about=poses.name or None)


def write_all(
    targets: Sequence[Path],
    writers: Sequence[Callable[[Path], list[str]]],
    to: Format,
    inputs: Sequence[Path],
) -> None:
    """Write all files, and give them their names when all were read back as written.

    Args:
        targets: Names of the files.
        writers: Functions, each of which writes a file to a path and returns how it differs, read back.
        to: Format of the files.
        inputs: Files that are never replaced.

    Raises:
        OutputError: If a file may not be written there, or did not read back as it was written.
    """
    if to == "csv" and targets[0].is_file():
        message = "found a file, allowed: a new name; an existing CSV file is never replaced"
        raise OutputError(Finding(message, str(targets[0])))
    map_collecting_errors(lambda path: check_output(path, inputs, "export"), targets)
    with atomic_group():
        for path, write in zip(targets, writers, strict=True):
            with safe_output(path, inputs, "export") as part:
                differences = write(part)
            if differences:
                message = f"differs when read back: {', '.join(differences)}"
                raise OutputError(Finding(message, str(path)))


def _file_name(name: str) -> str:
    """Return a name without the characters that have a meaning to folders and shells."""
    return re.sub(r'[\s/\\:*?"<>|]+', "_", name).strip("._") or "export"
