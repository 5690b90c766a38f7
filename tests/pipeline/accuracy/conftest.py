"""Accuracies that a test makes up: the paper's contour, planned, and a motion that is a little off it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from asserting import there
from made_plans import CONTOUR, planned
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.accuracy.driven_motion import Divergence, DrivenMotion
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.provenance import build_provenance

Make = Callable[..., AccuracyResult]

LIMIT = 0.4e-3
"""The largest error allowed in [m]."""

VOLTAGE = 36.0
"""The largest voltage in [V]."""


@cache
def plan_at(velocity: float) -> PlannedPath:
    """Return the contour by its arm at a velocity."""
    return planned(load_robot("irb60"), CONTOUR, velocity=velocity, tsp=0.02)


def motion(velocity: float, diverged: Divergence | None = None) -> DrivenMotion:
    """Return a motion whose first joint lags by 3 mrad at 1 m/s, by the square of the velocity else.

    The second voltage is at its limit at every fourth sample, but not below 0.5 m/s.
    """
    plan = plan_at(velocity)
    joints = there(plan.joints)
    wave = np.sin(np.linspace(0.0, np.pi, len(plan)))
    q = joints.q + np.outer(wave, [3e-3 * velocity**2, 0.0, 0.0, 0.0])
    voltage = np.outer(wave, [10.0, 20.0, 30.0])
    if velocity >= 0.5:
        voltage[::4, 1] = VOLTAGE
    return DrivenMotion(
        velocity=velocity,
        t_ns=plan.t_ns,
        planned=plan.position,
        set_q=joints.q,
        set_qd=joints.qd,
        speed=plan.motion.v,
        position=positions_over_log(joints.chain, q),
        q=q,
        qd=joints.qd + 1e-3,
        voltage=voltage,
        current=voltage / 10.0,
        limits=np.full(3, VOLTAGE),
        corner_times_ns=plan.t_ns[[30, 60, 90]],
        diverged=diverged,
    )


@pytest.fixture
def accuracy() -> Make:
    """Make an accuracy at some velocities in [m/s], with further fields."""

    def make(*velocities: float, gone: float | None = None, **more: Any) -> AccuracyResult:
        """Return it; the motion of one velocity diverged."""
        motions = tuple(
            motion(one, Divergence(float(plan_at(one).t[-1]), "theta2") if one == gone else None)
            for one in velocities or (0.1, 0.5, 1.0)
        )
        fields: dict[str, Any] = {
            "name": "cube wall xy", "robot": plan_at(0.5).robot, "rows": CONTOUR, "law": "trapezoid",
            "acceleration": 6.0, "jerk": None, "period": 0.02, "force": (0.0, 0.0, 0.0), "motions": motions,
            "probed": (), "running": None, "limit": None, "limited_error": "time", "loop_radius": 0.99,
            "compiled": True, "warnings": (), "provenance": build_provenance("accuracy", {}, []),
        }  # fmt: skip
        return AccuracyResult(**fields | more)

    return make


@pytest.fixture
def limited(accuracy: Make) -> AccuracyResult:
    """An accuracy with a limit, and the velocities run to find the running speed."""
    running = motion(0.2)
    tried = tuple(one.errors for one in (motion(0.1), running, motion(0.3)))
    return accuracy(limit=LIMIT, running=running, probed=tried)
