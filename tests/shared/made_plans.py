"""Plans of contours by arms, and plans of each kind that an arm cannot move as."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.planning.joints import PathJoints
from urmpipe_models.planning.path import PathRows, cube_rows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.planned_paths.given_path import given_path
from urmpipe_pipeline.planned_paths.obstacles import ObstacleKind
from urmpipe_pipeline.planned_paths.planning import joints_of, plan_path
from urmpipe_pipeline.planned_paths.request import Request, Timing, checked_timing
from urmpipe_pipeline.planned_paths.result import PlannedPath

DOWN = np.diag([1.0, -1.0, -1.0])
CONTOUR = cube_rows("wall", 0.6, 0.03, np.array([1.7, 0.0, 1.0]))
SMALL = cube_rows("wall", 0.3, 0.03, np.array([0.45, 0.0, 0.3]), rotation=DOWN)


def limited(name: str, **limits: float | list[float]) -> Chain:
    """Return an arm with limits of its moving joints: one for all, or one each."""
    chain = load_robot(name)
    own = {key: iter(np.broadcast_to(value, len(chain.moving)).tolist()) for key, value in limits.items()}
    joints = (
        replace(one, **{key: next(values) for key, values in own.items()}) if one in chain.moving else one
        for one in chain.joints
    )
    return replace(chain, joints=tuple(joints))


def planned(arm: Chain | None, rows: PathRows, **timing: Any) -> PlannedPath:
    """Return the plan of rows."""
    request = Request(arm, None, checked_timing(Timing(**timing)))
    return plan_path(given_path(rows), request, joints=followed(arm, rows))


def followed(arm: Chain | None, rows: PathRows) -> PathJoints | None:
    """Return the joints along rows, which are those of any timing and of any limits of rates."""
    if arm is None:
        return None
    free = tuple(replace(one, velocity=math.inf, acceleration=math.inf) for one in arm.joints)
    return replace(_followed(replace(arm, joints=free), rows), chain=arm)


@lru_cache(maxsize=16)
def _followed(arm: Chain, rows: PathRows) -> PathJoints:
    joints = joints_of(given_path(rows), Request(arm, None, Timing()))
    assert joints is not None
    return joints


@cache
def across_the_base() -> PlannedPath:
    """Return a plan between rows that are reached, across the column of the arm."""
    points = np.array([[0.3, 0.3, 0.3], [-0.3, -0.3, 0.3]])
    return planned(load_robot("ur5e"), PathRows(points, rotation=DOWN))


@cache
def behind_the_arm() -> PlannedPath:
    """Return a plan past the limit of the first joint, of an arm that cannot bend over back."""
    points = np.array([[-1.5, 0.3, 1.0], [-1.5, -0.3, 1.0]])
    arm = limited("irb60", lower=[-3.14, 0.0, -1.0, 0.0], upper=[3.14, 1.5, 1.5, 0.0])
    return planned(arm, PathRows(points))


@cache
def over_its_axis() -> PlannedPath:
    """Return a plan over the axis of theta1, along which the joints go on without a jump."""
    points = np.array([[0.6, 0.0, 1.6], [0.3, 0.0, 1.6], [-0.3, 0.0, 1.6]])
    return planned(load_robot("irb60"), PathRows(points))


@cache
def by_a_slow_joint() -> PlannedPath:
    """Return a plan by an arm whose first joint allows less than 1 % of the speed."""
    return planned(limited("ur5e", velocity=[0.005, *[math.inf] * 5]), SMALL)


FAILED: Mapping[ObstacleKind, Callable[[], PlannedPath]] = {
    "unreachable": across_the_base,
    "jump": behind_the_arm,
    "singular": over_its_axis,
    "too-slow": by_a_slow_joint,
}
"""Plans that fail, by what is in the way."""
