"""The tool centre point that a side recorded: whether its kinematics agree with it, and what that shows.

1. Each side with joints, a robot and a recorded tool centre point is compared with itself, row by row.
2. A side has the causes if its record follows the other side, and its kinematics do not.
3. Where both sides go by joints, a side that agrees with its record does not have the causes. Then the other
   one has them, if it recorded no tool centre point, or if a constant tool does not explain how far its
   kinematics are from it.

A controller computes its record from its joints. So a side that is late, lags, yields or sags agrees with
itself, too: such causes, and whole turns, do not show an origin. Nor does 3 with a path on one side: the arm
itself may have another zero than its controller assumes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from urmpipe_pipeline.diagnosis.causes import OwnTcp, rms
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.recorded_tcp import RecordedPoses, distances_from_recorded
from urmpipe_pipeline.sources.units.evidence import CLEARLY
from urmpipe_pipeline.trajectories import Matched, Side

NOT_SHOWN = (
    "time_lag", "clock_drift", "servo_lag", "joint_lag", "compliance", "backlash", "sag", "turns",
)  # fmt: skip
"""Causes that a side may have although its joints lead to its recorded tool centre point."""


def ask_both_sides(
    diagnosis: Diagnosis, matched: Matched, reference: Side, log: Side, tolerance: float
) -> Diagnosis:
    """Return a diagnosis with what the recorded tool centre points of both sides show.

    A log that is compared with its own record is left as it is.

    Args:
        diagnosis: The diagnosis.
        matched: Both sides at the same times, not moved in space.
        reference: The reference.
        log: The log.
        tolerance: Of a length in [m], within which a side agrees with its record.
    """
    if reference.run is log.run:
        return diagnosis
    sides = (reference, log)
    tcps = [_own_tcp(side, tolerance) for side in sides]
    size = _size_shown(diagnosis)
    record = [_record_apart(matched, side, is_log=side is log) for side in sides]
    left = float(np.hypot(diagnosis.remainder.rms, size / CLEARLY))

    def agrees(k: int) -> bool:
        tcp = tcps[k]
        return tcp is not None and tcp.agrees and CLEARLY * tcp.rms <= size

    def has_causes(k: int) -> bool:
        tcp, follows = tcps[k], record[k] <= left
        if tcp is not None and CLEARLY * tcp.rms > size and follows:
            return True
        consistent = tcp is not None and CLEARLY * tcp.rms_with_tool <= size
        return reference.by_joints and log.by_joints and agrees(1 - k) and not consistent

    origin = [side.run.name for k, side in enumerate(sides) if size and has_causes(k)]
    return replace(
        diagnosis,
        own_tcp=tuple(tcp for tcp in tcps if tcp is not None),
        origin=origin[0] if len(origin) == 1 else "",
    )


def _own_tcp(side: Side, tolerance: float) -> OwnTcp | None:
    """Return how far a side is from its recorded tool centre point; None without one."""
    run = side.run
    position = side.trajectory.position
    by_kinematics = side.by_joints and run.tcp is not None and np.isfinite(position).any()
    distance = distances_from_recorded(run, position if by_kinematics else None)
    poses = RecordedPoses.of(run.robot, run.log)
    if not len(distance) or run.robot is None or poses is None:
        return None
    largest, mean = float(distance.max()), rms(distance[:, np.newaxis])
    return OwnTcp(run.name, mean, largest, largest <= tolerance, min(mean, poses.fit(run.robot).with_tool))


def _size_shown(diagnosis: Diagnosis) -> float:
    """Return what the causes that a record would show take away, root mean square in [m].

    Joints alone are judged in [rad], which is taken as [m]: they move what is 1 m away by that.
    """
    shown = (cause for cause in diagnosis.causes if cause.kind not in NOT_SHOWN)
    return float(np.sqrt(max(sum(cause.rms_before**2 - cause.rms_after**2 for cause in shown), 0.0)))


def _record_apart(matched: Matched, side: Side, *, is_log: bool) -> float:
    """Return the root mean square distance of a record from the other side in [m]; inf without a record."""
    recorded, other = side.run.log.tcp_position, matched.reference if is_log else matched.actual
    if recorded is None or side.run.log.measured:
        return np.inf
    at_ns = matched.t_ns + round(matched.sync.offset * 1e9)
    there = recorded[matched.sample] if is_log else interpolate(at_ns, side.run.on_rows.t_ns, recorded)
    return rms(there - other) if np.isfinite(there - other).all(axis=1).any() else np.inf
