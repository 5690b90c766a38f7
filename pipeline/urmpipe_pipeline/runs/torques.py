"""Torques of a run: the masses that they rest on, the inverse dynamics, and warnings about both.

- `mass_warnings`, `urdf_mass_warning`: masses that are not used, and those lost in a URDF.
- `compute_torques`: tau(q, q', q'') on the grid.
- `torque_warnings`: joints that need more than their effort, and torques that are noise of the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import GRAVITY, Chain
from urmpipe_models.dynamics.equations import torques_over_log
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import SOLVED, LogWarning
from urmpipe_pipeline.runs.derivatives import WINDOW, derivatives
from urmpipe_pipeline.runs.run import Run, TorqueSummary

MASS_LEFT_OUT = "mass-left-out"
MASS_FAULT = "mass-fault"
NOT_IN_URDF = "not-in-urdf"


def mass_warnings(robot: Chain) -> list[LogWarning]:
    """Return a warning of the masses that the arm carries and that are not among its `inertials`."""
    if robot.mass_faults:
        return [
            LogWarning(MASS_FAULT, f"the masses of the robot are not used: {'; '.join(robot.mass_faults)}")
        ]
    if not robot.left_out:
        return []
    names = ", ".join(robot.left_out)
    words = f"the masses of {names} are left out: these links move by joints of their own"
    if len(robot.left_out) == 1:
        words = f"the mass of {names} is left out: this link moves by a joint of its own"
    return [LogWarning(MASS_LEFT_OUT, words)]


def urdf_mass_warning(robot: Chain) -> list[LogWarning]:
    """Return a warning of what a URDF of the arm does not hold."""
    lost = []
    if tuple(robot.gravity) != GRAVITY:
        lost.append(f"gravity {[*map(float, robot.gravity)]} m/s2")
    if robot.drives:
        lost.append("the drives")
    if robot.left_out:
        lost.append("which masses are left out")
    words = f"a URDF does not hold {' and '.join(lost)}: a TOML robot file does"
    return [LogWarning(NOT_IN_URDF, words)] if lost else []


EFFORT_LIMIT = "effort-limit"

CHECK_LOG = "check masses, clock and noise of the log"
"""What to do where the motion of a log that was recorded takes more than a joint can give."""

MOVE_SLOWER = "move slower, or check the masses"
"""What to do where a motion that was planned or solved does."""

PERIOD_ASSUMED = "The period of the rows is assumed. Torques depend on it, so no limit is applied."
"""What stands with torques whose rates rest on an assumption."""


def compute_torques(robot: Chain | None, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray | None:
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


def effort_warning(
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


TORQUE_NOISE = "torque-noise"

SMOOTHED = Hint("derivative", "savgol", "smooths the accelerations")

SHARE = 0.2
"""A joint is named if smoothing changes its torque by more than this share of the smoothed one's rms ..."""

LEAST = 0.01
"""... by more than this share of the largest such rms of the joints of its unit: a wrist may have none ..."""

FELT = 0.1
"""... by more than this, in [N.m] or [N]: an arm may rest where nothing pulls at it ..."""

ALTERNATING = -0.4
"""... and if the change correlates so with itself one sample on. White noise and rounding have -0.5 to -0.7,
values that change every other row -1; a motion too sharp for the smoothing, even a step of its speed, -0.1
to 1."""


class _Change(NamedTuple):
    """What smoothing does to the torques, an entry a joint, in [N.m] or [N].

    Attributes:
        before: Their rms without it.
        after: Their rms with it.
        change: Rms of the difference.
        correlation: Of the difference with itself one sample on, -1 to 1 [-]; NaN where it is always 0.
    """

    before: FloatArray
    after: FloatArray
    change: FloatArray
    correlation: FloatArray


def noise_warnings(run: Run) -> list[LogWarning]:
    """Return a warning if torques by central differences are noise that smoothing takes away."""
    known = run.derivative == "central" and run.log.source != SOLVED and not run.log.period_assumed
    if run.tau is None or not known or len(run.t_ns) <= WINDOW or not _alternates(run.qdd):
        return []
    found = _smoothing(run, run.tau)
    units = np.array(run.torque_units)
    scale = np.array([np.nan_to_num(found.after[units == unit]).max() for unit in units])
    least = np.maximum(np.maximum(SHARE * found.after, LEAST * scale), FELT)
    noisy = (found.change > least) & (found.correlation < ALTERNATING)
    if not noisy.any():
        return []
    relative = found.change / (scale + found.change)
    worst, *others = sorted(np.flatnonzero(noisy).tolist(), key=lambda j: -relative[j])
    names, unit = run.log.joints, units[worst]
    words = "joint values are noisy or coarse for torques: accelerations by differences give"
    words += f" {names[worst]} {found.before[worst]:.4g} {unit} rms, smoothed over {WINDOW} samples"
    words += f" {found.after[worst]:.4g} {unit}"
    words += f"; also {text.enumerated([names[j] for j in sorted(others)])}" if others else ""
    return [LogWarning(TORQUE_NOISE, words, hints=(SMOOTHED,))]


def _alternates(qdd: FloatArray) -> bool:
    """Tell cheaply whether accelerations in [rad/s2] or [m/s2], shape (n, joints), go to and fro at all."""
    steps = np.diff(qdd, axis=0)
    return bool((np.nansum(steps[1:] * steps[:-1], axis=0) < 0.0).any())


def _smoothing(run: Run, tau: FloatArray) -> _Change:
    """Return what smoothing does to the torques in [N.m] or [N], shape (n, joints)."""
    q = np.where(np.isfinite(run.qdd), run.q, np.nan)  # no window reaches across a step that is no motion
    smooth = compute_torques(run.robot, q, *derivatives(q, run.tsp, "savgol"))
    if smooth is None:
        none = np.full(tau.shape[1], np.nan)
        return _Change(none, none, none, none)
    change = tau - smooth
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = _mean(change[1:] * change[:-1]) / _mean(change**2)
    known = np.where(np.isfinite(smooth), tau, np.nan)
    return _Change(_rms(known), _rms(smooth), _rms(change), correlation)


def _rms(values: FloatArray) -> FloatArray:
    """Return the root of the mean square of each column."""
    return np.sqrt(_mean(values**2))


def _mean(values: FloatArray) -> FloatArray:
    """Return the mean of what each column has; NaN where it has nothing."""
    count = np.count_nonzero(np.isfinite(values), axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.nansum(values, axis=0) / count)
