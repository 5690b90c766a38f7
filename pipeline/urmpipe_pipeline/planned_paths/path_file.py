"""The rows of a planned path from a file: points, the radii of arcs, and how the tool is turned."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray
from urmpipe_models.errors import Finding, LogError
from urmpipe_models.messages import Hint
from urmpipe_models.planning.rows import PROPER, PathRows
from urmpipe_pipeline.joint_log import Inference, LogWarning, SourceFile
from urmpipe_pipeline.planned_paths.row_checks import VARIANTS, curve_faults
from urmpipe_pipeline.sources.clocks.clock_columns import time_columns
from urmpipe_pipeline.sources.columns.columns import Column, listed
from urmpipe_pipeline.sources.options import ReadOptions
from urmpipe_pipeline.sources.tables.numbers import capped
from urmpipe_pipeline.sources.tables.row_reader import lines_of_rows
from urmpipe_pipeline.sources.tables.text import fingerprint
from urmpipe_pipeline.sources.targets.pose_table import PoseTable, read_pose_table
from urmpipe_pipeline.sources.targets.row_faults import Further
from urmpipe_pipeline.sources.vocabulary import vocabulary

MEANINGS = {
    "r": "the first tangent point of the arc of radius r",
    "corner_r": "the corner that an arc of radius corner_r rounds",
}
"""What a row with a radius is, by the name of the column."""

NAMING = "name the columns in a header: x,y,z,r or x,y,z,corner_r"


@dataclass(frozen=True, slots=True, eq=False)
class PathFile:
    """The rows of a path in a file.

    Attributes:
        file: The file.
        rows: The points with their radii, in SI.
        inferences: What was found out about the file.
        warnings: What a person should know about it.
    """

    file: SourceFile
    rows: PathRows
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()


def read_path(file: Path, options: ReadOptions | None = None) -> PathFile:
    """Return the rows of a path: x, y, z, where it has one the orientation, r or corner_r, and variant.

    The table is read as one of targets is. A radius whose own name tells no unit is in that of x, y, z; an
    empty cell is 0, a stop, and that of a variant 2. Without a radius every row is a stop.

    Args:
        file: A text table, as a log may be.
        options: What the user says where the file need not, or cannot, tell; those about joints and times
            are not used.

    Raises:
        LogError: With all that is wrong with the file, its rows, and the curve that they would make.
        OptionError: If an option's value makes no sense.

    Source: [Iso9283]_ section 2, section 4 step 1.
    """
    asked = options or ReadOptions()
    table = read_pose_table(Path(file), replace(asked, time="none"), _further(), NAMING)
    rows = _rows(table)
    findings = [*_faults(table, curve_faults(rows))]
    if findings:
        raise LogError(*capped(findings, str(file)))
    said = (one for one in table.inferences if one.what != "time column")  # a path has none
    return PathFile(
        file=fingerprint(Path(file)),
        rows=rows,
        inferences=(*said, _meaning(table)),
        warnings=(*table.warnings, *_not_used(table)),
    )


def _further() -> dict[str, Further]:
    """Return the columns that a path has beside its points."""
    names = vocabulary().path
    radius = Further((), "0 or more, or an empty cell", _are_radii, empty=0.0, length=True)
    variant = Further((), "1, 2 or an empty cell", _are_variants, empty=PROPER, length=False)
    return {
        "r": replace(radius, patterns=names["r"]),
        "corner_r": replace(radius, patterns=names["corner_r"]),
        "variant": replace(variant, patterns=names["variant"]),
    }


def _are_radii(values: FloatArray) -> BoolArray:
    return np.asarray((values >= 0.0) & (values < np.inf))


def _are_variants(values: FloatArray) -> BoolArray:
    return np.isin(values, VARIANTS)


def _radius_column(table: PoseTable) -> str | None:
    """Return r or corner_r, whichever there is."""
    return next((name for name in MEANINGS if name in table.further), None)


def _rows(table: PoseTable) -> PathRows:
    """Return the rows of a table; of a radius or a variant that is none 0 and 2."""
    name, count = _radius_column(table), len(table)
    radius = np.zeros(count) if name is None else table.further[name]
    variant = table.further.get("variant", np.full(count, PROPER))
    return PathRows(
        position=table.position,
        radius=np.where(_are_radii(radius), radius, 0.0),
        corner=name == "corner_r",
        variant=np.where(_are_variants(variant), variant, PROPER).astype(np.int64),
        rotation=table.rotation,
    )


def _faults(table: PoseTable, of_curve: Iterable[Finding]) -> Iterator[Finding]:
    """Yield all that is wrong with a file, and with the curve of its rows, in the order of its lines."""
    layout, columns = table.plan.tables.layouts[table.plan.main], table.plan.roles.further
    if MEANINGS.keys() <= columns.keys():
        both = listed([columns[name] for name in MEANINGS])
        allowed = ", or ".join(f"{name} where a row is {meaning}" for name, meaning in MEANINGS.items())
        yield Finding(file=layout.file, line=layout.header, found=both, allowed=f"one of them: {allowed}")
    found = [
        Finding(fault.said, row=row, column=", ".join(fault.columns) or None)
        for row, faults in table.faults.items()
        for fault in faults
    ]
    found += [replace(one, column=columns[one.column].header if one.column else None) for one in of_curve]
    lines = lines_of_rows(layout, [one.row for one in found if one.row])
    for one in sorted(found, key=lambda one: one.row or 0):
        yield replace(one, file=layout.file, line=lines.get(one.row or 0))


def _meaning(table: PoseTable) -> Inference:
    """Return what is taken for what a row is."""
    name = _radius_column(table)
    if name is None:
        return Inference("rows", "every row is a stop", "there is no column r or corner_r")
    column = table.plan.roles.further[name]
    return Inference("rows", f"a row is {MEANINGS[name]}", f"column {column.name}", columns=(column.name,))


def _not_used(table: PoseTable) -> Iterator[LogWarning]:
    """Yield a warning about a time, and one about other columns of numbers that are no part of a path."""
    times = _times(table)
    if times:
        said = f"{listed(times)} {'is' if len(times) == 1 else 'are'} not used: a plan makes its own time"
        yield LogWarning("time-not-used", said)
    others = [column for column in table.unused_numbers if column not in times]
    if others:
        said = f"{listed(others, most=8)} {'is' if len(others) == 1 else 'are'} not used"
        parts = "x, y, z, an orientation, r or corner_r, variant"
        hint = Hint("", does=f"name what a path has so in the header: {parts}")
        yield LogWarning("columns-not-used", said, hints=(hint,))


def _times(table: PoseTable) -> tuple[Column, ...]:
    """Return the columns that hold a time, if a header tells."""
    layout, unused = table.plan.tables.layouts[table.plan.main], table.unused
    if layout.header is None or not unused:
        return ()
    return time_columns(unused, layout, ReadOptions(), None)[0]
