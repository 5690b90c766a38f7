"""Paths of arms of all kinds, planned and written as logs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import urmpipe
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import from_offset
from urmpipe_models.planning.path import PathRows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.planned_paths.result import PlannedPath

Y = (0.0, 1.0, 0.0)

FAST = 2.0
"""The speed of the plans in [m/s]: their logs are short."""


def absolute_angles() -> Chain:
    """Return an arm with angles of upper arm and forearm to the ground, and a wrist that stays level."""
    joints = (
        Joint("theta1"),
        Joint("theta2", origin=from_offset((0.0, 0.0, 0.7)), axis=Y),
        Joint("undo2", origin=from_offset((0.0, 0.0, 0.9)), axis=Y, mimic=Mimic("theta2", -1.0)),
        Joint("theta3", axis=Y),
        Joint("undo3", origin=from_offset((1.0, 0.0, 0.0)), axis=Y, mimic=Mimic("theta3", -1.0)),
        Joint("theta4", axis=Y, lower=0.0, upper=0.0),
    )
    return Chain("level", joints, tip=from_offset((0.2, 0.0, 0.0)))


def sliding() -> Chain:
    """Return an arm that only slides."""
    axes = {"rail": (1.0, 0.0, 0.0), "reach": Y, "lift": (0.0, 0.0, 1.0)}
    joints = tuple(Joint(name, kind="prismatic", axis=axis) for name, axis in axes.items())
    return Chain("sliding", joints, tip=from_offset((0.4, 0.1, 0.6)))


def gantry() -> Chain:
    """Return an arm whose joints have the names of the tool's coordinates, and of the time."""
    slides = tuple(
        Joint(name, kind="prismatic", axis=axis)
        for name, axis in (("x", (1.0, 0.0, 0.0)), ("y", Y), ("z", (0.0, 0.0, 1.0)))
    )
    return Chain(
        "gantry", (*slides, Joint("t", origin=from_offset((0.2, 0.0, 0.5)))), tip=from_offset((0.3, 0, 0))
    )


def of_joints(arm: Chain, q: FloatArray, *, oriented: bool) -> tuple[Chain, PathRows]:
    """Return an arm with stops where it has joint values in [rad] and [m], shape (n, joints)."""
    position, rotation = poses_over_log(arm, q)
    return arm, PathRows(position, rotation=rotation if oriented else None)


def between(arm: Chain, first: list[float], last: list[float], *, oriented: bool) -> tuple[Chain, PathRows]:
    """Return an arm with three stops: where it has some joint values, in the middle, and others."""
    return of_joints(arm, np.linspace(first, last, 3), oriented=oriented)


def around(arm: Chain, turns: int) -> tuple[Chain, PathRows]:
    """Return an arm with a path round the axis of its first joint, of so many turns with corners."""
    q = np.tile(np.add(arm.start, [0.0, 0.9, -1.2, 0.4, 0.5, 0.0]), (8 * turns + 1, 1))
    q[:, 0] += np.arange(len(q)) * math.pi / 4.0
    position, _ = poses_over_log(arm, q)
    return arm, PathRows(position, 0.02, corner=True)


PATHS: Mapping[str, Callable[[], tuple[Chain, PathRows]]] = {
    "ur5e": lambda: between(
        load_robot("ur5e"),
        [0.2, -1.4, 1.2, -1.3, -1.5, 0.1],
        [0.6, -1.7, 1.5, -1.0, -1.2, 0.3],
        oriented=True,
    ),
    "ur5e, a millimetre": lambda: between(
        load_robot("ur5e"),
        [0.2, -1.4, 1.2, -1.3, -1.5, 0.1],
        [0.201, -1.4, 1.201, -1.3, -1.5, 0.1],
        oriented=True,
    ),
    "urm6": lambda: between(
        load_robot("urm6"), [0.2, 2.5, 0.1, 3.3, -0.1, 3.2], [0.6, 2.2, 0.3, 3.6, -0.2, 3.3], oriented=False
    ),
    "urm6, many turns": lambda: around(load_robot("urm6"), 2),
    "level": lambda: between(absolute_angles(), [0.4, 0.2, 0.3, 0.0], [0.4, 0.5, 0.1, 0.0], oriented=True),
    "level, position only": lambda: between(
        absolute_angles(), [0.1, 0.2, 0.3, 0.0], [0.6, 0.5, 0.1, 0.0], oriented=False
    ),
    "sliding": lambda: between(sliding(), [0.0, 0.1, 0.2], [0.5, -0.3, 0.4], oriented=False),
    "gantry": lambda: between(gantry(), [0.0, 0.1, 0.2, 0.3], [0.5, -0.3, 0.4, 1.1], oriented=True),
}
"""Arms and paths by what is odd about them."""


def planned(name: str, log: Path) -> PlannedPath:
    """Return the plan of a path for its arm, written as a log."""
    plan, text = _made(name, alone=False)
    log.write_bytes(text)
    return replace(plan, log=log)


def planned_alone(name: str, log: Path) -> PlannedPath:
    """Return the plan of the same path without an arm and an orientation, likewise."""
    plan, text = _made(name, alone=True)
    log.write_bytes(text)
    return replace(plan, log=log)


def written_plan(name: str, log: Path, *, alone: bool = False) -> PlannedPath:
    """Return one of these plans, made anew and written by `plan` itself."""
    arm, rows = PATHS[name]()
    if alone:
        return urmpipe.plan(PathRows(rows.position, rows.radius, rows.corner), velocity=FAST, output=log)
    return urmpipe.plan(rows, arm, velocity=FAST, output=log)


@cache
def _made(name: str, *, alone: bool) -> tuple[PlannedPath, bytes]:
    """Return a plan, which is made once a session, and the log that was written of it."""
    with TemporaryDirectory() as folder:
        log = Path(folder) / "plan.csv"
        return written_plan(name, log, alone=alone), log.read_bytes()
