"""What a person should know of the masses of an arm."""

from __future__ import annotations

from urmpipe_models.chains.chain import Chain
from urmpipe_pipeline.joint_log import LogWarning

MASS_LEFT_OUT = "mass-left-out"


def mass_notices(robot: Chain) -> list[LogWarning]:
    """Return a warning of the masses that the arm carries and that are not among its `inertials`."""
    if not robot.left_out:
        return []
    names = ", ".join(robot.left_out)
    said = f"the masses of {names} are left out: these links move by joints of their own"
    if len(robot.left_out) == 1:
        said = f"the mass of {names} is left out: this link moves by a joint of its own"
    return [LogWarning(MASS_LEFT_OUT, said)]
