"""Motions of made-up arms, and what is said of their plausibility."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.wraps import repolarize
from urmpipe_pipeline.joint_log import JointLog, LogColumn, LogWarning
from urmpipe_pipeline.runs.plausibility import plausibility_warnings

KINDS = {"outlier-first", "outlier-last", "repeated-samples", "joint-limit", "speed-limit"}
NO_STEPS = np.empty((0, 2), dtype=np.int64)


def arm(joints: int, **limits: float) -> Chain:
    return Chain("arm", tuple(Joint(f"q{j + 1}", **limits) for j in range(joints)))  # type: ignore[arg-type]


def log_of(q: FloatArray, t: FloatArray, unit: str = "rad", digits: int | None = None) -> JointLog:
    names = tuple(f"q{j + 1}" for j in range(q.shape[1]))
    factor = np.pi / 180.0 if unit == "deg" else 1.0
    columns = tuple(LogColumn(name, name, "joint", j, unit, factor) for j, name in enumerate(names))
    t_ns = np.rint(t * 1e9).astype(np.int64)
    return JointLog("log", "table", (), t_ns, names, q, columns=columns, digits=digits)


def found(
    q: FloatArray,
    t: FloatArray,
    robot: Chain | None = None,
    *,
    slides: bool = False,
    timed: bool = True,
    unit: str = "rad",
    digits: int | None = None,
) -> list[LogWarning]:
    """What is said of a log after its repolarization, as ingest does it."""
    log = log_of(q, t, unit, digits)
    turning = np.full(q.shape[1], not slides)
    fixed = repolarize(q, np.diff(t, prepend=0.0))
    before = fixed.q.copy()
    warnings = plausibility_warnings(log, fixed.q, robot, turning, fixed.unexplained, timed=timed)
    np.testing.assert_array_equal(fixed.q, before)
    return warnings


def clock(rows: int, period: float = 0.005) -> FloatArray:
    return period * np.arange(rows, dtype=np.float64)


def swing(rows: int = 400, period: float = 0.005, joints: int = 3) -> tuple[FloatArray, FloatArray]:
    """Every joint swings by 1 rad, each at its own pace and at most at 1.4 rad/s; period in s."""
    t = clock(rows, period)
    return np.sin(np.outer(t, 1.0 + 0.2 * np.arange(joints)) + 0.3), t


# The first and the last row
