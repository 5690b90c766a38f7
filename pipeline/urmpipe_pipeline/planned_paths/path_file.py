"""The rows of a planned path from a file: points, the radii of arcs, and how the tool is turned."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.planning.path import PROPER, PathRows
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.logs.clock_columns import find_time_columns
from urmpipe_pipeline.logs.columns import Column, listed
from urmpipe_pipeline.logs.formats.log_table import capped
from urmpipe_pipeline.logs.formats.text import fingerprint
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.targets import ExtraColumn, PoseTable, read_pose_table
from urmpipe_pipeline.logs.vocabulary import vocabulary
from urmpipe_pipeline.planned_paths.row_checks import are_radii, are_variants, curve_faults

MEANINGS = {
    "r": "the first tangent point of the arc of radius r",
    "corner_r": "the corner that an arc of radius corner_r rounds",
}
"""What a row with a radius is, by the name of the column."""

NAMING = "name the columns in a header: x,y,z,r or x,y,z,corner_r"


@dataclass(frozen=True, slots=True, eq=False)
class GivenPath:
    """The rows of a path, and where they come from.

    Attributes:
        name: The name of the path.
        rows: Its rows, in SI.
        file: Their file; None for a cube and for arrays.
        warnings: What a person should know about the file.
        lines: The line of the file of each row, both from 1.
        place: The file as it was given, as messages name it; empty for a cube and for arrays.
    """

    name: str
    rows: PathRows
    file: SourceFile | None = None
    warnings: tuple[LogWarning, ...] = ()
    lines: Mapping[int, int] = field(default_factory=dict)
    place: str = ""

    def finding(self, row: int, found: str, allowed: str) -> Finding:
        """Return a finding about a row, counted from 1, at its line of the file."""
        place = self.place or self.name
        return Finding(file=place, line=self.lines.get(row), row=row, found=found, allowed=allowed)


def read_path(file: Path, options: LogMap | None = None) -> GivenPath:
    """Return the rows of a path: x, y, z, where it has one the orientation, r or corner_r, and variant.

    The table is read as a table of targets. A radius without a unit in its own name has the unit of x, y, z;
    an empty cell is 0, a stop, and an empty variant 2. Without a radius every row is a stop.

    Args:
        file: A text table, as a log may be.
        options: How to read the file where it does not show it; those about joints and times are not used.

    Raises:
        LogError: With all that is wrong with the file, its rows, and the curve that they would make.
        OptionError: If an option's value makes no sense.

    Source: [Iso9283]_ section 2, section 4 step 1.
    """
    timeless = replace(options or LogMap(), time="none")
    table = read_pose_table(file, timeless, _extra_columns(), NAMING)
    rows = _rows(table)
    findings = [*_faults(table, curve_faults(rows))]
    if findings:
        raise LogError(*capped(findings, str(file)))
    warnings = (*table.warnings, *_not_used(table))
    lines = table.plan.table.lines_of(range(1, len(rows) + 1))
    return GivenPath(file.stem, rows, fingerprint(file), warnings, lines, str(file))


def _extra_columns() -> dict[str, ExtraColumn]:
    """Return the columns that a path may have beside its points."""
    names, radius, variant = vocabulary().path, "0 or more, or an empty cell", "1, 2 or an empty cell"
    return {
        **{name: ExtraColumn(names[name], radius, are_radii, empty=0.0, length=True) for name in MEANINGS},
        "variant": ExtraColumn(names["variant"], variant, are_variants, empty=PROPER, length=False),
    }


def _rows(table: PoseTable) -> PathRows:
    """Return the rows of a table, with NaN in place of a wrong radius and 2 in place of a wrong variant."""
    name = next((name for name in MEANINGS if name in table.further), None)
    radius = table.further[name] if name else np.zeros(())
    variant = table.further.get("variant", np.array(PROPER))
    return PathRows(
        position=table.position,
        radius=np.where(are_radii(radius), radius, np.nan),
        corner=name == "corner_r",
        variant=np.where(are_variants(variant), variant, PROPER),
        rotation=table.rotation,
    )


def _faults(table: PoseTable, of_curve: Iterable[Finding]) -> Iterator[Finding]:
    """Yield all that is wrong with a file, and with the curve of its rows, in the order of its lines."""
    log_table, columns = table.plan.table, table.plan.roles.further
    if MEANINGS.keys() <= columns.keys():
        both = listed([columns[name] for name in MEANINGS])
        allowed = ", or ".join(f"{name} where a row is {meaning}" for name, meaning in MEANINGS.items())
        yield Finding(
            file=log_table.file, line=log_table.header, found=both, allowed=f"one of them: {allowed}"
        )
    found = [
        Finding(fault.message, row=row, column=", ".join(fault.columns) or None)
        for row, faults in table.faults.items()
        for fault in faults
    ]
    found += [replace(one, column=columns[one.column].header if one.column else None) for one in of_curve]
    lines = log_table.lines_of([one.row for one in found if one.row])
    for one in sorted(found, key=lambda one: one.row or 0):
        yield replace(one, file=log_table.file, line=lines.get(one.row or 0))


def _not_used(table: PoseTable) -> Iterator[LogWarning]:
    """Yield a warning about a time, and one about other columns of numbers that are no part of a path."""
    times = _times(table)
    if times:
        words = f"{listed(times)} {'is' if len(times) == 1 else 'are'} not used: a plan makes its own time"
        yield LogWarning("time-not-used", words)
    others = [column for column in table.unused_numbers if column not in times]
    if others:
        words = f"{listed(others, most=8)} {'is' if len(others) == 1 else 'are'} not used"
        parts = "x, y, z, an orientation, r or corner_r, variant"
        hint = Hint("", effect=f"a path uses columns named {parts}")
        yield LogWarning("columns-not-used", words, hints=(hint,))


def _times(table: PoseTable) -> tuple[Column, ...]:
    """Return the columns that hold a time, if a header names them."""
    log_table, unused = table.plan.table, table.unused
    if log_table.header is None or not unused:
        return ()
    return find_time_columns(unused, log_table, LogMap(), None)[0]
