"""The map of a log, saved for the next ones."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from urmpipe.arm_placing import offset_of
from urmpipe.parameters import kinds
from urmpipe.public_functions import PathLike, as_paths, public_function
from urmpipe_models.robots.catalogue import robot_names
from urmpipe_pipeline.logs import LogMap, format_map, map_of, read_map
from urmpipe_pipeline.outputs import safe_output
from urmpipe_pipeline.runs.run import Run


@public_function(run=kinds.RUN, output=kinds.MAP_FILE, robot=kinds.ROBOT_FILE, inputs=kinds.PATHS)
def write_map(
    run: Run, output: PathLike, *, robot: str | None = None, inputs: Sequence[PathLike] = ()
) -> Path:
    """Write the map (TOML) by which further logs read as this one was read.

    Args:
        run: An ingested log.
        output: The file to write; only another map of ours is replaced.
        robot: Name or file of the arm; default: its name, if it is one of the catalogue.
        inputs: Files that are never replaced.

    Raises:
        UrmpipeError: If it may not be written there.
    """
    path = Path(output)
    with safe_output(path, as_paths(inputs), "map") as part:
        write_map_part(run, part, path, robot)
    return path


def write_map_part(run: Run, part: Path, path: Path, robot: str | None) -> None:
    """Write the map of a run to a part of a file, and read it back."""
    part.write_text(format_map(map_of_run(run, path, robot)), encoding="utf-8", newline="\n")
    read_map(part)


def map_of_run(run: Run, path: Path, robot: str | None) -> LogMap:
    """Return the map of the log of a run, for a file; `robot` as in `write_map`."""
    arm = run.robot
    if robot is None:
        robot = arm.name if arm and arm.name in robot_names() else None
    elif Path(robot).suffix:
        robot = os.path.relpath(robot, path.parent)
    frames = (arm.base, arm.tool) if arm else ()
    log_map = LogMap(**(run.provenance.options.get("read") or {}))
    return map_of(run.log, log_map, robot, *(offset_of(frame) for frame in frames))
