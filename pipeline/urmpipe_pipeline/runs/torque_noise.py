"""Whether the joint values of a log are too noisy or too coarse for torques by central differences."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import SOLVED, LogWarning
from urmpipe_pipeline.runs.derivatives import WINDOW, derivatives
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.runs.torques import torques_of_log

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
    smooth = torques_of_log(run.robot, q, *derivatives(q, run.tsp, "savgol"))
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
