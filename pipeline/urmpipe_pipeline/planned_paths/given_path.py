"""The path that a plan is given: a file, a test cube, or rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from urmpipe_models.planning.rows import PathRows
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.planned_paths.cube_text import CUBE, read_cube
from urmpipe_pipeline.planned_paths.path_file import read_path
from urmpipe_pipeline.planned_paths.row_checks import checked_rows
from urmpipe_pipeline.sources.options import ReadOptions

PathLike: TypeAlias = str | Path | PathRows
"""A file, a test cube (cube:wall,a=0.6,...), or rows."""


@dataclass(frozen=True, slots=True, eq=False)
class GivenPath:
    """A path as it was given.

    Attributes:
        name: What to call it.
        rows: Its rows, in SI.
        file: Where they came from; None of a cube and of arrays.
        warnings: What a person should know of the file.
    """

    name: str
    rows: PathRows
    file: SourceFile | None = None
    warnings: tuple[LogWarning, ...] = ()

    @property
    def source(self) -> str:
        """Where its rows stand, as messages name it: the file, or the path's own name."""
        return self.name if self.file is None else self.file.name


def given_path(given: PathLike, options: ReadOptions | None = None) -> GivenPath:
    """Return the rows of a path.

    Args:
        given: A file; a text that begins with cube:, a test cube; or rows.
        options: How to read a file where it cannot tell by itself.

    Raises:
        LogError: With all that is wrong with the file, its rows, and the curve that they would make.
        OptionError: With all that is wrong with a cube, or with rows that are given as arrays.
        PathError: With all that is wrong with the curve that rows given as arrays would make.
    """
    if isinstance(given, PathRows):
        return GivenPath("path", checked_rows(given))
    if isinstance(given, str) and given.startswith(CUBE):
        return GivenPath(*read_cube(given))
    path = Path(given)
    found = read_path(path, options)
    return GivenPath(path.stem, found.rows, found.file, found.warnings)
