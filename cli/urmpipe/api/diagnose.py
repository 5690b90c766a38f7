"""`urmpipe.diagnose`: why logs deviate from their reference.

Logs are compared as by `compare`, with a diagnosis of each. The logs of a finished comparison are diagnosed
as they were compared: the comparison contains their runs, and its reference becomes a run again. Statistics
and verdict stay.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack, overload

import numpy as np

from urmpipe.api.compare import Operand, log_by_log, run_comparison
from urmpipe.arm_placing import Robot
from urmpipe.parameters import kinds
from urmpipe.parameters.comparing import Diagnose
from urmpipe.public_functions import public_function
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.logs import LogMap, arrays_to_table
from urmpipe_pipeline.operands import load_comparison
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Trajectory

SAME_POSITION = 1e-9  # m; rounding of positions that the joints of a reference determine


@overload
def diagnose(
    reference: Comparison, logs: None = None, robot: None = None, **options: Unpack[Diagnose]
) -> Comparison: ...


@overload
def diagnose(
    reference: Operand,
    logs: list[Any] | tuple[Any, ...],
    robot: Robot | None = None,
    **options: Unpack[Diagnose],
) -> Comparison: ...


@overload
def diagnose(
    reference: Operand,
    logs: Operand | None = None,
    robot: Robot | None = None,
    **options: Unpack[Diagnose],
) -> Diagnosis: ...


@public_function(Diagnose, robot=kinds.ROBOT)
def diagnose(
    reference: Operand | Comparison,
    logs: Operand | list[Any] | tuple[Any, ...] | None = None,
    robot: Robot | None = None,
    **options: Unpack[Diagnose],
) -> Diagnosis | Comparison:
    """Find out why logs deviate from their reference: the causes that make both agree. See docs/diagnose.md.

    Args:
        reference: A path, a log, a recording, a run or a simulation; alone, a log that is compared with the
            TCP that it recorded, or a finished comparison: what `compare` returned, or its recording.
        logs: A log, a recording, a run or a simulation to diagnose, or a list of them.
        robot: The arm; a recording or a run with another one is computed again with it.
        **options: What is judged, how logs are read, what is written: the options of `urmpipe diagnose`, by
            their names. The verdict is that of `compare`.

    Returns:
        The `Diagnosis` of a single log, with its `comparison`; of a list of logs, or of a finished
        comparison, the `Comparison` whose `runs` have their `diagnosis`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    finished = _load_finished(reference) if logs is None else None
    if finished is not None and robot is not None:
        allowed = "with the logs themselves"
        raise OptionError(Finding(parameter="robot", found="a finished comparison", allowed=allowed))
    comparison = run_comparison(
        reference, [] if logs is None else logs, robot, values,
        lambda operand, read: log_by_log(values, diagnose=True), judged=(),
        finished=None if finished is None else _diagnose_finished(finished),
    )  # fmt: skip
    if finished is not None or isinstance(logs, (list, tuple)):
        return comparison
    (run,) = comparison.runs
    assert run.diagnosis is not None
    warnings = (*run.diagnosis.warnings, *comparison.general_warnings, *comparison.warnings_of(run))
    return replace(
        run.diagnosis, verdict=comparison.verdict, warnings=warnings, recording=comparison.recording,
        comparison=comparison,
    )  # fmt: skip


def _load_finished(reference: object) -> Comparison | None:
    """Return the comparison that a reference is, or is the recording of; None if it is anything else."""
    if isinstance(reference, (str, Path)) and reference:
        return load_comparison(Path(reference))
    return reference if isinstance(reference, Comparison) else None


def _diagnose_finished(comparison: Comparison) -> Comparison:
    """Return a comparison with a diagnosis of each of its logs.

    Raises:
        OptionError: If it is a test after ISO 9283, whose logs are cycles.
    """
    if comparison.iso is not None:
        allowed = "a comparison log by log"
        raise OptionError(Finding(about="reference", found="a test after ISO 9283", allowed=allowed))
    options = comparison.provenance.options
    compare_options = CompareOptions(
        comparison.tolerance, options.get("tcp", "fk"), options.get("sync"), from_text=True, diagnose=True
    )
    runs = tuple(
        _diagnose_run(comparison.reference, deviation, compare_options) for deviation in comparison.runs
    )
    provenance = replace(comparison.provenance, options={**options, "diagnose": True})
    return replace(comparison, runs=runs, provenance=provenance, recording=None)


def _diagnose_run(reference: Trajectory, deviation: Deviation, options: CompareOptions) -> Deviation:
    """Return a deviation with its diagnosis."""
    run = deviation.run
    if reference.name == f"{run.name} (recorded)":
        compared = compare_with_recorded_tcp(run, options)
    else:
        compared = compare_runs(_reference_run(reference, run, options.tcp), [run], options)
    diagnosis = compared.runs[0].diagnosis
    assert diagnosis is not None
    return replace(deviation, diagnosis=replace(diagnosis, name=deviation.name))


def _reference_run(reference: Trajectory, run: Run, tcp: str) -> Run:
    """Return a run of a reference's trajectory: by its joints if they determine it, else its positions."""
    position, robot = reference.position, run.robot
    has_position = bool(np.isfinite(position).any())
    by_joints = reference.q is not None and tcp == "fk"
    if by_joints and has_position:
        by_joints = robot is not None and len(robot.coordinates) == len(reference.joints)
    if by_joints and has_position:
        assert robot is not None and reference.q is not None
        by_joints = bool(np.nanmax(np.abs(positions_over_log(robot, reference.q) - position)) < SAME_POSITION)
    poses = position if reference.quat_xyzw is None else np.hstack([position, reference.quat_xyzw])
    table = arrays_to_table(
        reference.t if run.timed else None,
        reference.q if by_joints else None,
        None if by_joints else poses,
        reference.joints,
        reference.name,
        robot if by_joints else None,
        reference.joints,
    )
    units = dict(zip(reference.joints, reference.joint_units, strict=True)) if by_joints else {}
    read = LogMap(unit=units, poses=not run.timed)
    return ingest_log([table], robot=robot if by_joints else None, read=read, name=reference.name)
