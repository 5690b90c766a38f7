"""What can leave of a result: tables of named columns, a struct of arrays, trajectories of poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.joint_log import LogWarning

DATE, TIME_OF_DAY = "date", "time of day"
"""Units of clocks that are text."""

DAY = 24 * 3_600 * 10**9
"""A day in [ns]."""


@dataclass(frozen=True, slots=True, eq=False)
class Times:
    """A column of times.

    Attributes:
        ns: In integer [ns], shape (n,).
        unit: How the column counts them: s, ms, us, ns, date (ISO 8601) or time of day (hh:mm:ss).
    """

    ns: IntArray
    unit: str

    def __len__(self) -> int:
        return len(self.ns)


Values: TypeAlias = FloatArray | IntArray | NDArray[np.str_] | Times


@dataclass(frozen=True, slots=True, eq=False)
class ExportColumn:
    """A column that leaves.

    Attributes:
        name: Its name, unique in the table.
        unit: Its unit; empty for counts and names.
        values: In the column's own unit, shape (n,); NaN where a sample is missing.
    """

    name: str
    unit: str
    values: Values


def columns_of(names: Sequence[str], units: Sequence[str], values: FloatArray) -> list[ExportColumn]:
    """Return a column for each of some values in these units, shape (n, columns), the unit in its name."""
    return [
        ExportColumn(f"{name} [{unit}]", unit, values[:, k])
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
    ]


@dataclass(frozen=True, slots=True, eq=False)
class ExportTable:
    """What leaves, as a table.

    Attributes:
        columns: Its columns, at least one.
        clock_ns: The file's own clock at every row in integer [ns], shape (n,); None if it has none.
        warnings: What could not leave.
        unsaid: Units that the names do not tell: a warning where the format does not keep them beside these.
    """

    columns: tuple[ExportColumn, ...]
    clock_ns: IntArray | None
    warnings: tuple[LogWarning, ...] = ()
    unsaid: tuple[LogWarning, ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.columns[0].values)


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """A trajectory of poses without missing samples.

    Attributes:
        name: What it is, for a file's name; empty if there is no other.
        clock_ns: The file's own clock in integer [ns], shape (n,).
        position: In [m], shape (n, 3).
        quat_xyzw: Unit quaternions x, y, z, w [-], neighbours in one hemisphere, shape (n, 4).
        left_out: Rows without a pose.
    """

    name: str
    clock_ns: IntArray
    position: FloatArray
    quat_xyzw: FloatArray
    left_out: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """One choice of rows.

    Attributes:
        table: Returns the columns.
        fields: Returns the struct of MATLAB's MAT, of the table: numbers, arrays, texts, structs, and lists
            (cells).
    """

    table: Callable[[], ExportTable]
    fields: Callable[[ExportTable], Mapping[str, Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Exports:
    """All that can leave of a result.

    Attributes:
        kind: What MATLAB's struct is called.
        about: What a reader of a file needs to know, as JSON has it.
        rows: The choices of rows by their names, the usual one first.
        poses: Returns trajectories, by what their poses are called (fk, recorded), the usual ones first;
            told the name of the rows.
        pose_rows: Rows that the poses of a name stand at, where they are not those asked for.
        warnings: What is to be said of trajectories.
    """

    kind: str
    about: Mapping[str, Any]
    rows: Mapping[str, Rows]
    poses: Mapping[str, Callable[[str], list[Poses]]]
    pose_rows: Mapping[str, str]
    warnings: tuple[LogWarning, ...] = ()
