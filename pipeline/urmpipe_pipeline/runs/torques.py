"""The torques that a motion takes: over its samples, largest by joint, and beyond the effort of a joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.over_log import torque_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning

EFFORT_LIMIT = "effort-limit"


@dataclass(frozen=True, slots=True)
class JointTorque:
    """The torque of a joint over a motion, in [N.m], or the force in [N] of one that slides.

    Attributes:
        joint: Its name.
        unit: N.m or N.
        max: Largest absolute value; NaN where no sample has one.
        t_max: When, in [s]; NaN likewise.
        sample_max: In which sample, from 0.
        rms: Root of its mean square.
        effort: Its limit either way; None without one.
        beyond: Row numbers of the samples beyond the limit, from 0, shape (k,).
        samples: How many samples have a value.
    """

    joint: str
    unit: str
    max: float
    t_max: float
    sample_max: int
    rms: float
    effort: float | None
    beyond: IntArray
    samples: int

    @property
    def effort_share(self) -> float | None:
        """The largest share of its limit that it takes, above 1 beyond it; None without a limit."""
        return None if self.effort is None else self.max / self.effort

    @property
    def share_out(self) -> float | None:
        """Share of the samples beyond the limit, 0 to 1; None without a limit."""
        return None if self.effort is None else len(self.beyond) / max(self.samples, 1)

    def to_dict(self) -> dict[str, Any]:
        """Return it as `urmpipe ingest --json` prints it."""
        told = ("joint", "unit", "max", "t_max", "rms", "effort", "effort_share", "share_out")
        return {name: getattr(self, name) for name in told}


def torques(robot: Chain | None, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray | None:
    """Return the torques of the joints in [N.m] or [N], shape (n, joints), NaN where a rate is.

    Args:
        robot: The arm; None, and one without masses, has none.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).
    """
    if robot is None or not robot.inertials or q.shape[1] == 0:
        return None
    return torque_over_log(robot, q, qd, qdd)


def joint_torques(
    names: Sequence[str], robot: Chain | None, t_ns: IntArray, tau: FloatArray | None
) -> list[JointTorque]:
    """Return the torque of each joint in short; none where torques are not known.

    Args:
        names: Of the joints.
        robot: The arm, with its limits.
        t_ns: Times in integer [ns], shape (n,).
        tau: Torques in [N.m] or [N], shape (n, joints); None where they are not known.
    """
    if robot is None or tau is None or not len(tau):
        return []
    found = []
    for name, joint, column in zip(names, robot.moving, np.asarray(tau).T, strict=True):
        size = np.abs(column)
        known = size[np.isfinite(size)]
        at = int(np.nanargmax(size)) if len(known) else 0
        found.append(
            JointTorque(
                joint=name,
                unit="N.m" if joint.kind == "revolute" else "N",
                max=float(size[at]) if len(known) else math.nan,
                t_max=float(t_ns[at]) / 1e9 if len(known) else math.nan,
                sample_max=at,
                rms=float(np.sqrt(np.mean(known**2))) if len(known) else math.nan,
                effort=joint.effort if math.isfinite(joint.effort) else None,
                beyond=np.flatnonzero(size > joint.effort),
                samples=len(known),
            )
        )
    return found


def beyond_efforts(
    names: Sequence[str],
    robot: Chain | None,
    t_ns: IntArray,
    tau: FloatArray | None,
    rows_ns: IntArray,
) -> list[LogWarning]:
    """Return a warning if joints need more than their effort: which, how often, where first, where worst.

    Args:
        names: Of the joints.
        robot: The arm, with its limits.
        t_ns: Times of the samples in integer [ns], shape (n,).
        tau: Torques in [N.m] or [N], shape (n, joints); None where they are not known.
        rows_ns: Times of the file's rows in integer [ns], shape (m,): a row nearest to the sample is named.
    """
    found = [one for one in joint_torques(names, robot, t_ns, tau) if len(one.beyond)]
    if not found:
        return []
    worst = max(found, key=lambda one: one.effort_share or 0.0)
    first, most = _rows_at(rows_ns, t_ns[[min(int(one.beyond[0]) for one in found), worst.sample_max]])
    said = f"{worst.joint} needs more than its effort of {worst.effort:.6g} {worst.unit} in"
    said += f" {len(worst.beyond)} of {worst.samples} samples ({text.percent(worst.share_out or 0.0)}),"
    said += f" at worst {worst.max:.4g} {worst.unit} in row {most}"
    others = [f"{one.joint} ({text.counted(len(one.beyond), 'sample')})" for one in found if one is not worst]
    said += f"; also {text.enumerated(others)}" if others else ""
    return [LogWarning(EFFORT_LIMIT, f"{said}: check masses, clock and noise of the log", first)]


def _rows_at(rows_ns: IntArray, t_ns: IntArray) -> list[int]:
    """Return the rows nearest to some times in [ns], shape (k,), from 1."""
    return [round(row) + 1 for row in np.interp(t_ns, rows_ns, np.arange(len(rows_ns))).tolist()]
