"""The torques that a motion takes: over its samples, largest by joint, and beyond the effort of a joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import torques_over_log
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning

EFFORT_LIMIT = "effort-limit"

CHECK_LOG = "check masses, clock and noise of the log"
"""What to do where the motion of a log that was recorded takes more than a joint can give."""

MOVE_SLOWER = "move slower, or check the masses"
"""What to do where a motion that was planned or solved does."""

PERIOD_ASSUMED = "The period of the rows is assumed. Torques depend on it, so no limit is applied."
"""What stands with torques whose rates rest on an assumption."""


@dataclass(frozen=True, slots=True)
class TorqueSummary:
    """The torque of a joint over a motion, in [N.m], or the force in [N] of one that slides.

    Attributes:
        joint: Its name.
        unit: N.m or N.
        max: Largest absolute value; NaN where no sample has one.
        t_max: When, in [s]; NaN likewise.
        sample_max: In which sample, from 0.
        rms: Root of its mean square.
        effort: Its limit either way; None without one, and where the period of the rows is assumed.
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
        """The largest share of its limit that it takes, above 1 beyond it; None without limit or samples."""
        return None if self.effort is None or not self.samples else self.max / self.effort

    @property
    def share_out(self) -> float | None:
        """Share of the samples beyond the limit, 0 to 1; None without limit or samples."""
        return None if self.effort is None or not self.samples else len(self.beyond) / self.samples

    def to_dict(self) -> dict[str, Any]:
        """Return it as `urmpipe ingest --json` prints it."""
        keys = ("joint", "unit", "max", "t_max", "rms", "effort", "effort_share", "share_out")
        return {key: getattr(self, key) for key in keys}


def torques_of_log(robot: Chain | None, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray | None:
    """Return the torques of the joints in [N.m] or [N], (n, joints), NaN where a rate is; None if all are.

    Args:
        robot: The arm; None, and one without masses, has none.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).
    """
    if robot is None or not robot.inertials or q.shape[1] == 0:
        return None
    tau = torques_over_log(robot, q, qd, qdd)
    return tau if np.isfinite(tau).any() else None


def torque_summaries(
    names: Sequence[str],
    robot: Chain | None,
    t_ns: IntArray,
    tau: FloatArray | None,
    *,
    limited: bool = True,
) -> list[TorqueSummary]:
    """Return the torque of each joint in short; none where torques are not known.

    Args:
        names: Of the joints.
        robot: The arm, with its limits.
        t_ns: Times in integer [ns], shape (n,).
        tau: Torques in [N.m] or [N], shape (n, joints); None where they are not known.
        limited: Whether they are held against the efforts of the joints.
    """
    if robot is None or tau is None or not len(tau):
        return []
    found = []
    for name, joint, column in zip(names, robot.moving, np.asarray(tau).T, strict=True):
        size = np.abs(column)
        known = size[np.isfinite(size)]
        at = int(np.nanargmax(size)) if len(known) else 0
        effort = joint.effort if limited else math.inf
        found.append(
            TorqueSummary(
                joint=name,
                unit="N.m" if joint.kind == "revolute" else "N",
                max=float(size[at]) if len(known) else math.nan,
                t_max=float(t_ns[at]) / 1e9 if len(known) else math.nan,
                sample_max=at,
                rms=float(np.sqrt(np.mean(known**2))) if len(known) else math.nan,
                effort=effort if math.isfinite(effort) else None,
                beyond=np.flatnonzero(size > effort),
                samples=len(known),
            )
        )
    return found


def beyond_efforts(
    summaries: Sequence[TorqueSummary],
    t_ns: IntArray,
    advice: str,
    rows_ns: IntArray | None = None,
    hints: tuple[Hint, ...] = (),
) -> list[LogWarning]:
    """Return a warning if joints need more than their effort: which, how often, where worst, first row.

    Args:
        summaries: The torque of each joint.
        t_ns: Times of the samples in integer [ns], shape (n,).
        advice: What to do about it.
        rows_ns: Times of the file's rows in integer [ns], shape (m,): the row nearest to a sample is named;
            None where the samples are no rows of a file: their times are named.
        hints: What to give to do so.
    """
    found = [one for one in summaries if len(one.beyond)]
    if not found:
        return []
    worst = max(found, key=lambda one: one.effort_share or 0.0)
    first, place = None, f"at t = {text.seconds(worst.t_max)} s"
    if rows_ns is not None:
        first, row = _rows_at(rows_ns, t_ns[[min(int(one.beyond[0]) for one in found), worst.sample_max]])
        place = f"in row {row}"
    words = f"{worst.joint} needs more than its effort of {worst.effort:.6g} {worst.unit} in"
    words += f" {len(worst.beyond)} of {worst.samples} samples ({text.percent(worst.share_out or 0.0)}),"
    words += f" at worst {worst.max:.4g} {worst.unit} {place}"
    others = [f"{one.joint} ({text.counted(len(one.beyond), 'sample')})" for one in found if one is not worst]
    words += f"; also {text.enumerated(others)}" if others else ""
    return [LogWarning(EFFORT_LIMIT, f"{words}: {advice}", first, hints=hints)]


def _rows_at(rows_ns: IntArray, t_ns: IntArray) -> list[int]:
    """Return the rows nearest to some times in [ns], shape (k,), from 1."""
    return [round(row) + 1 for row in np.interp(t_ns, rows_ns, np.arange(len(rows_ns))).tolist()]
