"""`urmpipe.iso`: the cycles of a test after ISO 9283, and its criteria."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from urmpipe.api.compare import Operand, run_comparison
from urmpipe.arm_placing import Robot
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Iso
from urmpipe.public_functions import public_function, reject_recording
from urmpipe_models.errors import Finding, LogError
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.iso import IsoOptions
from urmpipe_pipeline.iso9283.poses import Poses
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.planned_paths.command_marks import find_rounded_corners, find_stops
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.results import read_recording
from urmpipe_pipeline.solved_targets.given_targets import TargetsLike, given_targets


@public_function(Iso, robot=kinds.ROBOT)
def iso(
    reference: Operand | Comparison,
    logs: Operand | Sequence[Operand] = (),
    robot: Robot | None = None,
    **options: Unpack[Iso],
) -> Comparison:
    """Evaluate a test after ISO 9283: accuracy and repeatability of poses, paths and speed. See docs/iso.md.

    Args:
        reference: The commanded motion, as of `compare`. With a `baseline` alone: the comparison of a test.
        logs: One log per cycle of the test, or a log in which the motion repeats.
        robot: The arm; a recording or a run with another one is computed again with it.
        **options: What is judged, how logs are read, what is written: the options of `urmpipe iso`, by their
            names.

    Returns:
        The comparison; its `iso` has the `criteria`, each with its value and verdict, and the cycles.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.

    Source: [Iso9283]_ section 7.
    """
    values: Mapping[str, Any] = options  # as their kinds read them

    def judge(operand: object, read: LogMap) -> IsoOptions:
        """Return how the test is judged."""
        tolerance = values["tolerance"]
        plan = _find_plan(operand)
        return IsoOptions(
            tolerance={} if tolerance is None else tolerance.by_kind,
            targets=None if values["targets"] is None else _read_targets(values["targets"], read),
            corners=() if plan is None else find_rounded_corners(plan),
            stops=() if plan is None else find_stops(plan),
            from_text=tolerance is not None and tolerance.from_text,
            **{name: values[name] for name in ("tcp", "sync", "cycles", "planes", "band", "defaults")},
        )

    return run_comparison(reference, logs, robot, values, judge)


def _find_plan(reference: object) -> PlannedPath | None:
    """Return the plan that a reference is, or is the recording of; None if it is anything else."""
    if isinstance(reference, (str, Path)) and Path(reference).suffix == ".rrd" and Path(reference).exists():
        reference = read_recording(Path(reference), lazy=True)
    return reference if isinstance(reference, PlannedPath) else None


def _read_targets(targets: TargetsLike, read: LogMap) -> Poses:
    """Return targets as the poses of a test; raise a `LogError` with the faults of all rows."""
    reject_recording(targets, "a table (CSV) of targets")
    rows = given_targets(targets, None, None, read)
    faults = [(row, fault) for row, fault in zip(rows.row.tolist(), rows.faults, strict=True) if fault]
    if faults:
        raise LogError(*(Finding(fault, rows.name, row=row, parameter="targets") for row, fault in faults))
    rotation = rows.targets.rotation
    quat = None if rotation is None else to_quaternions(np.reshape(rotation, (-1, 9)), "matrix")
    return Poses(rows.targets.position, quat, (False,) * len(rows.targets))
