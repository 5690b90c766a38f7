"""What a person should know of the masses of an arm, and of their loss in a URDF."""

from __future__ import annotations

from urmpipe_models.arm.chain import GRAVITY, Chain
from urmpipe_pipeline.joint_log import LogWarning

MASS_LEFT_OUT = "mass-left-out"
MASS_FAULT = "mass-fault"
NOT_IN_URDF = "not-in-urdf"


def mass_notices(robot: Chain) -> list[LogWarning]:
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


def lost_in_urdf(robot: Chain) -> list[LogWarning]:
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
