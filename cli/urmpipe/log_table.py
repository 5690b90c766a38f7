"""A log as a unit takes it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from urmpipe_fmus.block import Table
from urmpipe_pipeline.joint_log import LogWarning


class Quantity(NamedTuple):
    """Columns of a table that are one variable.

    Attributes:
        name: The variable.
        unit: Its unit; SI, spelled as FMI does.
        size: How many columns it has; None for a variable that is no array.
    """

    name: str
    unit: str
    size: int | None = None


class LogTable(NamedTuple):
    """A log as a unit takes it.

    Attributes:
        table: Its rows.
        columns: What the columns of the table are, from the left.
        files: Its files.
        warnings: What a person should know of it.
    """

    table: Table
    columns: tuple[Quantity, ...]
    files: tuple[Path, ...]
    warnings: tuple[LogWarning, ...]
