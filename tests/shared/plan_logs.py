"""Motions from rest to rest of arms of all kinds, written as the log that a plan is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain, Joint, Mimic
from urmpipe_models.continuity import continuous_quaternions
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.orientation import quaternions
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.transform import from_offset
from urmpipe_pipeline.outputs import PATH_ROW, guarded_output
from urmpipe_pipeline.tables.joint_file import write_joint_log

STEP_NS = 5_000_000
TURNED = (0.9, -0.6, 0.5, 0.8, -0.7, 0.4)
"""How far each joint goes, in [rad] or [m], as a share."""

Y = (0.0, 1.0, 0.0)


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


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """A plan of an arm, or of none.

    Attributes:
        robot: The arm.
        q: In [rad] and [m], shape (n, joints).
        position: In [m], shape (n, 3).
        quat_xyzw: Of the tool [-], shape (n, 4); None where a plan leaves it open.
        row: Of the path, shape (n,).
    """

    robot: Chain | None
    q: FloatArray
    position: FloatArray
    quat_xyzw: FloatArray | None
    row: IntArray

    def write(self, path: Path) -> Path:
        """Write it as `plan` does, and return where."""
        moving = () if self.robot is None else self.robot.moving
        units = ["m" if joint.kind == "prismatic" else "rad" for joint in moving]
        t_ns = np.arange(len(self.q), dtype=np.int64) * STEP_NS
        with guarded_output(path, [], "plan") as part:
            write_joint_log(
                part, path, joints=[joint.name for joint in moving], units=units, q=self.q, row=self.row,
                t_ns=t_ns, position=self.position, quat_xyzw=self.quat_xyzw, row_column=PATH_ROW,
            )  # fmt: skip
        return path

    def alone(self) -> Planned:
        """Return the same path of no arm."""
        return Planned(None, np.empty((len(self.q), 0)), self.position, None, self.row)


def planned(robot: Chain, *, oriented: bool, amplitude: float = 0.4, rows: int = 200) -> Planned:
    """Return a plan of an arm that starts beside its own start; a joint whose limits are equal stays.

    All joints go along 10 s^3 - 15 s^4 + 6 s^5, s from 0 to 1.
    """
    s = np.linspace(0.0, 1.0, rows)[:, np.newaxis]
    share = np.where([joint.lower == joint.upper for joint in robot.moving], 0.0, TURNED[: len(robot.moving)])
    q = np.asarray(np.array(robot.start) + share * (0.2 + amplitude * (10 * s**3 - 15 * s**4 + 6 * s**5)))
    position, rotation = poses_over_log(robot, q)
    quat = continuous_quaternions(quaternions(rotation.reshape(-1, 9), "matrix")) if oriented else None
    return Planned(robot, q, position, quat, np.arange(rows) // 50 + 1)


PLANS: Mapping[str, Callable[[], Planned]] = {
    "ur5e": lambda: planned(load_robot("ur5e"), oriented=True),
    "ur5e, a millimetre": lambda: planned(load_robot("ur5e"), oriented=True, amplitude=1e-3),
    "urm6": lambda: planned(load_robot("urm6"), oriented=False),
    "urm6, many turns": lambda: planned(
        load_robot("urm6"), oriented=False, amplitude=9.0 * math.pi, rows=4000
    ),
    "level": lambda: planned(absolute_angles(), oriented=True),
    "level, position only": lambda: planned(absolute_angles(), oriented=False),
    "sliding": lambda: planned(sliding(), oriented=False),
    "gantry": lambda: planned(gantry(), oriented=True),
}
"""Plans by what is odd about them."""
