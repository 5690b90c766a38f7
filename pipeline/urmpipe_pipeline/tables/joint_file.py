"""Joint values as a log that `ingest` reads, and any other reader of CSV: a row a target, or a sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.outputs import TARGET_ROW
from urmpipe_pipeline.presentation.exports import Times
from urmpipe_pipeline.sources.cells.cell import printable
from urmpipe_pipeline.sources.vocabulary import key
from urmpipe_pipeline.tables.lines import write_columns

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")


def write_joint_log(
    part: Path,
    path: Path,
    *,
    joints: Sequence[str],
    units: Sequence[str],
    q: FloatArray,
    row: IntArray,
    t_ns: IntArray | None = None,
    position: FloatArray | None = None,
    quat_xyzw: FloatArray | None = None,
    row_column: str = TARGET_ROW,
) -> int:
    """Write joint values as a CSV file and read it back.

    The columns are t (s), each joint with its unit, the tool centre point x (m), y (m), z (m), its
    orientation qx, qy, qz, qw, and the row that each sample is of; those of the tool begin with tcp_ where a
    joint has the name of one. Commas, decimal points, UTF-8. Times are exact, and other values have the
    shortest decimal text that gives the same double, joints neither wrapped nor unwrapped. A row without a
    value of a joint is left out, and the others keep their times.

    Args:
        part: Where to write it, as `safe_output` gives it for the kind "joints", "plan" or "motion".
        path: The name it is to have, for messages.
        joints: Names of the joints, in the robot's order; none for a path alone.
        units: Of each: rad or m.
        q: In `units`, shape (n, joints); NaN in a row that has none.
        row: Data row of each target or path row in its own file, shape (n,).
        t_ns: Times in integer [ns], shape (n,); None writes no time.
        position: Of the tool centre point in [m], shape (n, 3); None writes none.
        quat_xyzw: Its orientation as unit quaternions [-], shape (n, 4); None writes none.
        row_column: Name of the last column: `TARGET_ROW`, `PATH_ROW` of a plan, or `MOTION_ROW` of a network.

    Returns:
        How many rows were written.

    Raises:
        OutputError: If there is no row to write, or it did not read back as it was written.
    """
    solved = np.isfinite(q).all(axis=1)
    if not solved.any():
        said = f"found no joint values for any of {len(q)} targets, allowed: at least one for a log"
        raise OutputError(Finding(said, str(path)))
    timed = [] if t_ns is None else [Times(t_ns[solved], "s")]
    names = [f"{printable(name)} ({unit})" for name, unit in zip(joints, units, strict=True)]
    head = [*(["t (s)"] if timed else []), *names, *_tool_names(joints, position, quat_xyzw), row_column]
    parts = [some for some in (q, position, quat_xyzw) if some is not None]
    columns = [np.ascontiguousarray(values) for some in parts for values in some[solved].T]
    if wrong := write_columns(part, head, [*timed, *columns, row[solved]]):
        raise OutputError(Finding(f"differs when read back: {', '.join(wrong)}", str(path)))
    return int(solved.sum())


def _tool_names(
    joints: Sequence[str], position: FloatArray | None, quat_xyzw: FloatArray | None
) -> list[str]:
    """Return what the columns of the tool are called."""
    before = "tcp_" if {*map(key, joints)} & {*POSITION, *QUATERNION} else ""
    names = [] if position is None else [f"{before}{axis} (m)" for axis in POSITION]
    return names + ([] if quat_xyzw is None else [f"{before}{part}" for part in QUATERNION])
