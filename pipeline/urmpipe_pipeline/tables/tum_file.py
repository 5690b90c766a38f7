"""TUM trajectories, as evo reads them: `t x y z qx qy qz qw`, parted by spaces."""

from __future__ import annotations

from pathlib import Path

from urmpipe_pipeline.presentation.exports import Poses, Times
from urmpipe_pipeline.tables.lines import differences, texts, write_lines
from urmpipe_pipeline.tables.metadata import MARK

HEAD = f"# {MARK}: t [s] x y z [m] qx qy qz qw\n"


def write_tum(poses: Poses, path: Path) -> list[str]:
    """Write a trajectory and return how the file differs from it, read back.

    Times are those of the log's clock in [s], exact in decimals.
    """
    values = texts([Times(poses.clock_ns, "s"), *poses.position.T, *poses.quat_xyzw.T])
    write_lines(path, HEAD, values, " ")
    return differences(path, HEAD, values, " ")
