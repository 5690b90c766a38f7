"""The limits of joints along a path: the law that runs at them, and how much of them a law uses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.chains.chain import Chain
from urmpipe_models.planning.fastest import JointLimits, fastest_law
from urmpipe_models.planning.joint_motion import JointSlopes
from urmpipe_models.planning.path_joints import PathJoints, rests_of
from urmpipe_models.planning.time_law import PathMotion, TimeLaw

INSIDE = 1e-6
"""How far inside an interval its ends are looked at, as a share of it: where s'' steps a side is plain."""

SIDE = 1e-9
"""How far from the time at which phases meet both are looked at, as a share of it."""


def limits_of_joints(chain: Chain, speed: float = np.inf, tangential: float = np.inf) -> JointLimits:
    """Return the largest rates and accelerations of an arm, and of its tool along the path.

    Args:
        chain: The arm.
        speed: The largest s' in [m/s]; infinity for none.
        tangential: The largest s'' in [m/s2]; infinity for none.
    """
    return JointLimits(
        np.array([joint.velocity for joint in chain.moving]),
        np.array([joint.acceleration for joint in chain.moving]),
        speed,
        tangential,
    )


def law_of_limits(joints: PathJoints, speed: float = np.inf, tangential: float = np.inf) -> TimeLaw:
    """Return the law in the least time within the rates and accelerations of the joints.

    The limits hold on the grid of the joints; between its places they are exceeded by less than its step
    squared makes. Where the rates of the joints step, as where the tool's turn changes its rate or a joint
    comes to a limit, the path stops: no finite acceleration follows that.

    Args:
        joints: The joints along a path that the arm reaches everywhere.
        speed: The largest s' in [m/s], too; infinity for none.
        tangential: The largest s'' in [m/s2], too; infinity for none.
    """
    stop = np.isin(joints.s, rests_of(joints.path))
    stop[joints.rate_steps] = True
    limits = limits_of_joints(joints.chain, speed, tangential)
    return fastest_law(joints.s, joints.after, joints.before, stop, limits)


class Usage(NamedTuple):
    """The largest use of a limit along a path.

    Attributes:
        share: max(|q'| / limit, sqrt(|q''| / limit)) [-]: with speeds divided by it the limit holds.
        s: Where, in [m].
        joint: Which of the moving joints, from 0.
    """

    share: float
    s: float
    joint: int


def largest_usage(joints: PathJoints, law: TimeLaw, *, between: bool = False) -> Usage:
    """Return the largest use of a joint's limit by a law.

    It is looked for in the middle and just inside both ends of each interval of the grid, and on both sides
    of the times at which phases of the law meet: rates and accelerations step at both.

    Args:
        joints: The joints along a path that the arm reaches everywhere.
        law: The law.
        between: Whether the middles alone are looked at, since the law holds the limits on the grid.

    Source: [Iso9283]_ section 4, steps 17 and 18.
    """
    limits = limits_of_joints(joints.chain)
    if not np.isfinite([limits.velocity, limits.acceleration]).any():
        return Usage(0.0, 0.0, 0)
    s, step = joints.s, INSIDE * np.diff(joints.s)
    middle = 0.5 * (s[1:] + s[:-1])
    looked = [_usage(joints.at(middle), law.at(law.time_at(middle)), limits)]
    if not between:
        for slopes, places in ((joints.after, s[:-1] + step), (joints.before, s[1:] - step)):
            looked.append(_usage(slopes, law.at(law.time_at(places)), limits))
        sides = np.concatenate((law.ends * (1.0 - SIDE), law.ends * (1.0 + SIDE)))
        motion = law.at(np.minimum(sides, law.duration))
        looked.append(_usage(joints.at(np.clip(motion.s, 0.0, s[-1])), motion, limits))
    return max(looked)


def _usage(slopes: JointSlopes, motion: PathMotion, limits: JointLimits) -> Usage:
    """Return the largest use of a limit, of n places."""
    rates, accelerations = slopes.rates(motion.v, motion.a)
    share = np.maximum(np.abs(rates) / limits.velocity, np.sqrt(np.abs(accelerations) / limits.acceleration))
    place, joint = np.unravel_index(int(share.argmax()), share.shape)
    return Usage(float(share[place, joint]), float(motion.s[place]), int(joint))
