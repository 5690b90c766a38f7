"""What `urmpipe.ik` writes: a joint log that `ingest` reads, or a recording with branches as ghost arms."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from urmpipe.inverse.result import InverseResult
from urmpipe_models.errors import OptionError, shown
from urmpipe_models.inverse.solutions import Solutions
from urmpipe_pipeline.inverse.joint_file import write_joint_log
from urmpipe_pipeline.inverse.solved import row_times, solved_run
from urmpipe_pipeline.inverse.verdict import path_warnings
from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.runs.ghosts import ghosts_of, goals_of
from urmpipe_pipeline.runs.results import Run

Written = Literal["joints", "recording"]
"""Kinds of outputs."""

KINDS: dict[str, Written] = {".csv": "joints", ".rrd": "recording"}


def output_kind(output: Path | None) -> Written | None:
    """Return what an output is by its suffix; None without one.

    Raises:
        OptionError: If the suffix is another.
    """
    if output is None:
        return None
    kind = KINDS.get(output.suffix.lower())
    if kind is None:
        allowed = "a name that ends in .csv (a joint log) or .rrd (a recording)"
        raise OptionError(f"-o: found {shown(str(output))}, allowed: {allowed}")
    return kind


def run_of_solutions(
    result: InverseResult, branches: Solutions | None, file: SourceFile | None, options: dict[str, Any]
) -> Run:
    """Return the run of the solutions nearest to the start, with the others as ghosts.

    Args:
        result: What was found.
        branches: The solutions that are to be ghosts; None for no ghosts.
        file: Where the targets came from.
        options: The options that were given, by name.
    """
    t_ns = row_times(len(result)) if result.t_ns is None else result.t_ns
    return solved_run(
        result.name,
        result.robot,
        result.t_ns,
        result.q,
        goals=goals_of(result.targets, t_ns, result.reasons, result.branch),
        ghosts=() if branches is None else ghosts_of(branches, t_ns),
        files=() if file is None else (file,),
        warnings=(*result.warnings, *(path_warnings(result.path) if result.path else ())),
        options=options,
    )


def write_joints(result: InverseResult, path: Path, inputs: Sequence[Path]) -> None:
    """Write the solutions nearest to the start as a joint log; rows that have none are left out.

    Raises:
        OutputError: If it may not be written there, or did not read back as it was written.
    """
    joints = result.robot.moving
    with guarded_output(path, inputs, "joints") as part:
        write_joint_log(
            part,
            path,
            joints=result.robot.coordinates,
            units=["rad" if joint.kind == "revolute" else "m" for joint in joints],
            q=result.q,
            row=result.row,
            t_ns=result.t_ns,
        )
