"""The path that a plan is given: a file, a test cube, or rows."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from urmpipe_models.planning.path import PathRows
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.planned_paths.cube_text import CUBE, read_cube
from urmpipe_pipeline.planned_paths.path_file import GivenPath, read_path
from urmpipe_pipeline.planned_paths.row_checks import checked_rows

PathLike: TypeAlias = str | Path | PathRows
"""A file, a test cube (cube:wall,a=0.6,...), or rows."""


def given_path(given: PathLike, options: LogMap | None = None) -> GivenPath:
    """Return the rows of a path.

    Args:
        given: A file; a text that begins with cube:, a test cube; or rows.
        options: How to read a file where it does not show it.

    Raises:
        LogError: With all that is wrong with the file, its rows, and the curve that they would make.
        OptionError: With all that is wrong with a cube, or with rows that are given as arrays.
        PathError: With all that is wrong with the curve that rows given as arrays would make.
    """
    if isinstance(given, PathRows):
        return GivenPath("path", checked_rows(given))
    if isinstance(given, str) and given.startswith(CUBE):
        return GivenPath(*read_cube(given))
    return read_path(Path(given), options)
