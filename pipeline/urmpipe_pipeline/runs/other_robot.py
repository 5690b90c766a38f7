"""A run on another arm: its motion stays as it was ingested, and what rests on the arm is made anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.masses import MASS_LEFT_OUT
from urmpipe_pipeline.presentation.meshes import VISUAL_MISSING
from urmpipe_pipeline.repolarization.audit import audit_log, turning
from urmpipe_pipeline.runs.ingest import EULER_SINGULAR, kinematics, torque_warnings
from urmpipe_pipeline.runs.plausibility import JOINT_LIMIT, SPEED_LIMIT, beyond_limits, implausible
from urmpipe_pipeline.runs.recorded_start import RECORDED_START
from urmpipe_pipeline.runs.recorded_tcp import FAR_RECORDED, far_from_recorded
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.runs.torque_noise import TORQUE_NOISE
from urmpipe_pipeline.runs.torques import EFFORT_LIMIT, torques_of_log

BY_LIMITS = (JOINT_LIMIT, SPEED_LIMIT)
OF_ROBOT = (
    EULER_SINGULAR, VISUAL_MISSING, MASS_LEFT_OUT, FAR_RECORDED, RECORDED_START, *BY_LIMITS, EFFORT_LIMIT,
    TORQUE_NOISE,
)  # fmt: skip
"""The kinds of the warnings that rest on the robot."""


def on_robot(run: Run, robot: Chain | None) -> Run:
    """Return a run with the kinematics of an arm; as it is without one.

    Its joint values, their audit and their rates stay.

    Raises:
        LogError: If the joints of the run are not the robot's.
    """
    if robot is None or robot == run.robot:
        return run
    tcp, noticed = kinematics(robot, run.q, run.qd, run.qdd)
    _refuse_other_kinds(run, robot)
    others = [warning for warning in run.warnings if warning.kind not in OF_ROBOT]
    tau = torques_of_log(robot, run.q, run.qd, run.qdd) if run.timed else None
    doubts = [*far_from_recorded(robot, run.log), *_beyond_limits(run, robot), *noticed]
    made = replace(run.provenance, options={**run.provenance.options, "robot": robot.name})
    warnings = (*others, *doubts)
    moved = replace(run, robot=robot, tcp=tcp, tau=tau, warnings=warnings, provenance=made)
    return replace(moved, warnings=(*warnings, *torque_warnings(moved)))


def _refuse_other_kinds(run: Run, robot: Chain) -> None:
    """Raise a `LogError` with every joint that turns in the log and slides in the arm, or the other way."""
    if not run.log.joints:
        return
    before, now = turning(run.log, run.robot), turning(run.log, robot)
    wrong = [
        f"{run.name}, joint {run.log.joints[j]}: found {_unit(before[j])}, allowed: {_unit(now[j])},"
        f" as robot {robot.name} has"
        for j in np.flatnonzero(before != now).tolist()
    ]
    if wrong:
        raise LogError(*wrong)


def _unit(turns: np.bool_) -> str:
    """Return the SI unit of a joint that turns, or slides."""
    return "rad" if turns else "m"


def _beyond_limits(run: Run, robot: Chain) -> list[LogWarning]:
    """Return what the log says against the arm's limits of place and speed."""
    if not run.log.joints:
        return []
    if not run.timed:
        return beyond_limits(run.log, run.q, robot)
    read = run.provenance.options.get("read") or {}
    repaired = bool(read.get("repair"))
    found = audit_log(run.log, robot, interval=read.get("interval"), repaired=repaired)
    timed = not run.log.period_assumed
    turns = turning(run.log, robot)
    doubts = implausible(run.log, found.q, robot, turns, found.broken[:, 1:], timed=timed, tsp=run.tsp)
    return [warning for warning in doubts if warning.kind in BY_LIMITS]
