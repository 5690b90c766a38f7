"""Torques of a run: the masses that they depend on, the inverse dynamics, and warnings about both.

- `mass_warnings`, `urdf_mass_warning`: masses that are not used, and those lost in a URDF.
- `compute_torques`: tau(q, q', q'') on the grid.
- `torque_warnings`: torques that are noise of the log (`noise_warnings`), and joints that need more than
  their effort (`effort_warning`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from urmpipe_models.arm.chain import GRAVITY, Chain
from urmpipe_models.display import format_count
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
EFFORT_LIMIT = "effort-limit"
TORQUE_NOISE = "torque-noise"

CHECK_LOG = "check masses, clock and noise of the log"  # advice for a recorded motion beyond an effort
MOVE_SLOWER = "move slower, or check the masses"  # advice for a planned or solved one
SMOOTHED = Hint("derivative", "savgol", "smooths the accelerations")
PERIOD_ASSUMED = "The period of the rows is assumed. Torques depend on it, so no limit is applied."

# A joint has noise if smoothing changes its torque by more than these, and the change alternates.
NOISE_SHARE = 0.2  # of the rms of its smoothed torque
MIN_SHARE = (
    0.01  # of the largest such rms of the joints with the same unit: a wrist may have almost no torque
)
MIN_TORQUE = 0.1  # N.m or N: an arm may rest where no joint has a load
MAX_CORRELATION = (
    -0.4
)  # of the change with itself one sample on: noise and rounding -0.5 to -0.7, values that
# change every other row -1; a motion too sharp for the smoothing, even a step of its speed, -0.1 to 1


def mass_warnings(robot: Chain) -> list[LogWarning]:
    """Return a warning about the masses of an arm that are not among its `inertials`."""
    if robot.mass_faults:
        message = f"the masses of the robot are not used: {'; '.join(robot.mass_faults)}"
        return [LogWarning(MASS_FAULT, message)]
    if not robot.left_out:
        return []
    names = ", ".join(robot.left_out)
    message = f"the masses of {names} are left out: these links move by joints outside the chain"
    if len(robot.left_out) == 1:
        message = f"the mass of {names} is left out: this link moves by a joint outside the chain"
    return [LogWarning(MASS_LEFT_OUT, message)]


def urdf_mass_warning(robot: Chain) -> list[LogWarning]:
    """Return a warning about properties of the arm that a URDF cannot contain."""
    lost = []
    if tuple(robot.gravity) != GRAVITY:
        lost.append(f"gravity {[*map(float, robot.gravity)]} m/s2")
    if robot.drives:
        lost.append("the drives")
    if robot.left_out:
        lost.append("which masses are left out")
    message = f"a URDF does not hold {' and '.join(lost)}: a TOML robot file does"
    return [LogWarning(NOT_IN_URDF, message)] if lost else []


def compute_torques(robot: Chain | None, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray | None:
    """Return the torques of the joints in [N.m] or [N], shape (n, joints), NaN where a derivative is.

    None if all are NaN, without a robot, and for one without masses.

    Args:
        robot: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Joint velocities in [rad/s] or [m/s], shape (n, joints).
        qdd: Joint accelerations in [rad/s2] or [m/s2], shape (n, joints).
    """
    if robot is None or not robot.inertials or q.shape[1] == 0:
        return None
    tau = torques_over_log(robot, q, qd, qdd)
    return tau if np.isfinite(tau).any() else None


def torque_warnings(run: Run) -> list[LogWarning]:
    """Return warnings about torques that are noise, and joints that need more than their effort."""
    advice, hints = CHECK_LOG, (SMOOTHED,) if run.derivative == "central" else ()
    if run.log.source == SOLVED:
        advice, hints = MOVE_SLOWER, ()
    summaries = run.torque_summaries()
    return [*noise_warnings(run), *effort_warning(summaries, run.t_ns, advice, run.rows_ns, hints)]


def effort_warning(
    summaries: Sequence[TorqueSummary],
    t_ns: IntArray,
    advice: str,
    rows_ns: IntArray | None = None,
    hints: tuple[Hint, ...] = (),
) -> list[LogWarning]:
    """Return one warning about the joints that need more than their effort, or none.

    Args:
        summaries: Torque of each joint.
        t_ns: Times of the samples in integer [ns], shape (n,).
        advice: What to do about it.
        rows_ns: Times of the rows of the file in integer [ns], shape (m,): the row nearest to a sample is
            named; None if the samples are not rows of a file: their times are named.
        hints: Options that help.
    """
    exceeding = [summary for summary in summaries if len(summary.samples_beyond)]
    if not exceeding:
        return []
    worst = max(exceeding, key=lambda summary: summary.effort_share or 0.0)
    row, place = None, f"at t = {text.format_seconds(worst.t_max)} s"
    if rows_ns is not None:
        first = min(int(summary.samples_beyond[0]) for summary in exceeding)
        at_ns = t_ns[[first, worst.sample_max]]
        nearest = np.interp(at_ns, rows_ns, np.arange(len(rows_ns))).tolist()
        row, worst_row = (round(index) + 1 for index in nearest)
        place = f"in row {worst_row}"
    message = f"{worst.joint} needs more than its effort of {worst.effort:.6g} {worst.unit} in"
    fraction = text.format_percent(worst.out_fraction or 0.0)
    message += f" {len(worst.samples_beyond)} of {worst.samples} samples ({fraction}),"
    message += f" at worst {worst.max:.4g} {worst.unit} {place}"
    joints = [
        f"{summary.joint} ({format_count(len(summary.samples_beyond), 'sample')})"
        for summary in exceeding
        if summary is not worst
    ]
    message += f"; also {text.join_list(joints)}" if joints else ""
    return [LogWarning(EFFORT_LIMIT, f"{message}: {advice}", row, hints=hints)]


def noise_warnings(run: Run) -> list[LogWarning]:
    """Return a warning if torques by central differences are noise that smoothing removes."""
    is_recorded = run.derivative == "central" and run.log.source != SOLVED and not run.log.period_assumed
    if run.tau is None or not is_recorded or len(run.t_ns) <= WINDOW:
        return []
    steps = np.diff(run.qdd, axis=0)
    if not (np.nansum(steps[1:] * steps[:-1], axis=0) < 0.0).any():  # cheap: no acceleration alternates
        return []
    q = np.where(np.isfinite(run.qdd), run.q, np.nan)  # no window reaches across a step that is no motion
    smooth = compute_torques(run.robot, q, *derivatives(q, run.tsp, "savgol"))
    if smooth is None:
        return []
    change = run.tau - smooth
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = _mean(change[1:] * change[:-1]) / _mean(change**2)
    before, after = _rms(np.where(np.isfinite(smooth), run.tau, np.nan)), _rms(smooth)
    units = np.array(run.torque_units)
    scale = np.array([np.nan_to_num(after[units == unit]).max() for unit in units])
    threshold = np.maximum(np.maximum(NOISE_SHARE * after, MIN_SHARE * scale), MIN_TORQUE)
    is_noisy = (_rms(change) > threshold) & (correlation < MAX_CORRELATION)
    if not is_noisy.any():
        return []
    relative = _rms(change) / (scale + _rms(change))
    worst, *further = sorted(np.flatnonzero(is_noisy).tolist(), key=lambda j: -relative[j])
    names, unit = run.log.joints, units[worst]
    message = "joint values are noisy or coarse for torques: accelerations by differences give"
    message += f" {names[worst]} {before[worst]:.4g} {unit} rms, smoothed over {WINDOW} samples"
    message += f" {after[worst]:.4g} {unit}"
    message += f"; also {text.join_list([names[j] for j in sorted(further)])}" if further else ""
    return [LogWarning(TORQUE_NOISE, message, hints=(SMOOTHED,))]


def _rms(values: FloatArray) -> FloatArray:
    return np.sqrt(_mean(values**2))


def _mean(values: FloatArray) -> FloatArray:
    """Return the mean of the finite values of each column; NaN where there are none."""
    count = np.count_nonzero(np.isfinite(values), axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.nansum(values, axis=0) / count)
