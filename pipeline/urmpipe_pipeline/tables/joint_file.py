"""Joint values as a log that `ingest` reads, and any other reader of CSV: a row a solved target."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.outputs import TARGET_ROW
from urmpipe_pipeline.presentation.exports import Times
from urmpipe_pipeline.sources.cells.cell import printable
from urmpipe_pipeline.tables.lines import write_columns


def write_joint_log(
    part: Path,
    path: Path,
    *,
    joints: Sequence[str],
    units: Sequence[str],
    q: FloatArray,
    row: IntArray,
    t_ns: IntArray | None = None,
) -> int:
    """Write joint values as a CSV file and read it back: t (s), each joint with its unit, the target's row.

    Commas, decimal points, UTF-8. Times are exact, and joint values have the shortest decimal text that
    gives the same double, neither wrapped nor unwrapped. A row without a value is left out, and the others
    keep their times.

    Args:
        part: Where to write it, as `guarded_output` gives it for the kind "joints".
        path: The name it is to have, for messages.
        joints: Names of the joints, in the robot's order.
        units: Of each: rad or m.
        q: In `units`, shape (n, joints); NaN in a row that has none.
        row: Data row of each target in its own file, shape (n,).
        t_ns: Times in integer [ns], shape (n,); None writes no time.

    Returns:
        How many rows were written.

    Raises:
        OutputError: If there is no row to write, or it did not read back as it was written.
    """
    solved = np.isfinite(q).all(axis=1)
    if not solved.any():
        said = f"found no joint values for any of {len(q)} targets, allowed: at least one for a log"
        raise OutputError(Finding(said, str(path)))
    names = [f"{printable(name)} ({unit})" for name, unit in zip(joints, units, strict=True)]
    columns = [np.ascontiguousarray(values) for values in q[solved].T]
    timed = [] if t_ns is None else [Times(t_ns[solved], "s")]
    head = [*(["t (s)"] if timed else []), *names, TARGET_ROW]
    if wrong := write_columns(part, head, [*timed, *columns, row[solved]]):
        raise OutputError(Finding(f"reads back otherwise than written: {', '.join(wrong)}", str(path)))
    return int(solved.sum())
