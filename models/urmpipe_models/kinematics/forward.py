"""Forward kinematics and Jacobian of a chain, elementwise, and its motion over a log.

Each function takes one element per coordinate (see `elementwise`): arrays over the samples of a log,
floats, or CasADi symbols. `over_log` runs one of them over the rows of an (n, joints) array.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.elementwise import ZERO, Element, Vector, cross, plus, subtract, times
from urmpipe_models.kinematics.frames import frames, from_tip, joint_values, moved, tip_position
from urmpipe_models.kinematics.motion import each_motion
from urmpipe_models.row_blocks import row_blocks, side_by_side
from urmpipe_models.tape import aligned, fill_over_log
from urmpipe_models.transform import Transform, euler_zyx


def forward(chain: Chain, q: Sequence[Element]) -> tuple[Transform, ...]:
    """Return the poses of the points p1..pn.

    p_{i+1} = Rz1 [r_1 + sum_k prod_j (Ry_{j+1} Rz_{j+1}) r_{k+1}], for any chain as the product of its
    frames and joint motions.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].

    Returns:
        A transform per point, in the world; positions in [m].

    Source: [UrmArm2021]_ eq. 7 and 8.
    """
    _, *links = frames(chain, q)
    poses = [
        Transform(frame.rotation, frame.point(joint.origin.translation))
        for frame, joint in zip(links, chain.joints[1:], strict=False)
    ]
    return (*poses, links[-1] @ chain.tip @ chain.tool)


def tip_pose(chain: Chain, q: Sequence[Element]) -> Transform:
    """Return the pose of the tool centre point alone, in the world: the last of `forward`, at less cost.

    Its axes x and y come with the point from the tool to the base; z = x cross y.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
    """
    tip = chain.tip @ chain.tool
    point, x, y = from_tip(chain, q, tip.translation, *tip.columns[:2])
    return Transform(Transform((x, y, cross(x, y))).columns, point)


def jacobian(chain: Chain, q: Sequence[Element], point: int = -1) -> tuple[tuple[Element, ...], ...]:
    """Return the geometric Jacobian of a point p1..pn, in the world.

    Column i is (z_i x (p - o_i), z_i) for a revolute and (z_i, 0) for a prismatic joint with axis z_i
    through o_i; a mimic's column counts with its multiplier towards the joint it follows.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        point: Index of the point, -1 for the tool centre point.

    Returns:
        One column a coordinate, each vx, vy, vz in [m/s] and wx, wy, wz in [rad/s] per unit rate.
    """
    count = len(chain.joints)
    last = range(count)[point]
    axes: list[tuple[Vector, Vector]] = []
    frame = chain.base
    target = ZERO
    for k, (joint, value) in enumerate(zip(chain.joints, joint_values(chain, q), strict=True)):
        at_joint = frame @ joint.origin
        if k == last + 1:
            target = at_joint.translation
            break
        axes.append((at_joint.rotate(joint.axis), at_joint.translation))
        frame = moved(at_joint, joint, value)
    else:
        target = (frame @ chain.tip @ chain.tool).translation

    columns: dict[str, tuple[Element, ...]] = dict.fromkeys(chain.coordinates, (0.0,) * 6)
    for joint, (axis, origin) in zip(chain.joints, axes, strict=False):
        if joint.kind == "fixed":
            continue
        column = (
            (*cross(axis, subtract(target, origin)), *axis) if joint.kind == "revolute" else (*axis, *ZERO)
        )
        name, factor = (
            (joint.name, 1.0) if joint.mimic is None else (joint.mimic.joint, joint.mimic.multiplier)
        )
        columns[name] = tuple(plus(a, times(factor, b)) for a, b in zip(columns[name], column, strict=True))
    return tuple(columns.values())


@dataclass(frozen=True, slots=True)
class PointLog:
    """One point of the arm over the samples of a log, in the world.

    Attributes:
        position: In [m], shape (n, 3).
        velocity: In [m/s], shape (n, 3).
        acceleration: In [m/s2], shape (n, 3).
        euler_zyx: rz, ry, rx in [rad], shape (n, 3).
        singular: Where ry = +-pi/2 and rx = 0 by convention, shape (n,).
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    euler_zyx: FloatArray
    singular: NDArray[np.bool_]


def positions_over_log(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the position of the tool centre point in the world [m], shape (n, 3).

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
    """
    position = aligned(3, len(q))
    fill_over_log(partial(tip_position, chain), q, [*position])
    return position.T


def poses_over_log(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return position [m], shape (n, 3), and rotation [-], shape (n, 3, 3), of the tool centre point.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).

    Returns:
        Both in the world: x_world = R x_tool + p.
    """

    def entries(q: Sequence[Element]) -> list[Element]:
        """Return p and the rows of R."""
        pose = tip_pose(chain, q)
        return [element for row in (pose.translation, *pose.rotation) for element in row]

    position, rotation = aligned(3, len(q)), aligned(9, len(q))
    fill_over_log(entries, q, [*position, *rotation])
    return position.T, rotation.reshape(3, 3, len(q)).transpose(2, 0, 1)


def point_over_log(
    chain: Chain,
    q: FloatArray,
    qd: FloatArray,
    qdd: FloatArray,
    point: int = -1,
) -> PointLog:
    """Return the motion of one point p1..pn over a log.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).
        point: Index of the point, -1 for the tool centre point.
    """
    count, place = len(q), range(len(chain.joints))[point]
    position, velocity, acceleration, euler = (np.empty((3, count)) for _ in range(4))
    singular = np.empty(count, dtype=np.bool_)

    def work(block: slice) -> None:
        """Fill the rows of a block."""
        every = each_motion(chain, _columns(q[block]), _columns(qd[block]), _columns(qdd[block]))
        motion = next(islice(every, place, None))
        rz, ry, rx, singular[block] = euler_zyx(motion.pose.rotation)
        _fill(position[:, block], motion.pose.translation)
        _fill(velocity[:, block], motion.velocity)
        _fill(acceleration[:, block], motion.acceleration)
        _fill(euler[:, block], (rz, ry, rx))

    side_by_side(work, row_blocks(count))
    return PointLog(position.T, velocity.T, acceleration.T, euler.T, singular)


def points_over_log(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the arm's skeleton: the base and p1..pn in the world [m], shape (n, points + 1, 3).

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
    """
    skeleton = np.empty((len(chain.joints) + 1, 3, len(q)))
    _fill(skeleton[0], chain.base.translation)

    def work(block: slice) -> None:
        """Fill the rows of a block."""
        for k, pose in enumerate(forward(chain, _columns(q[block])), start=1):
            _fill(skeleton[k, :, block], pose.translation)

    side_by_side(work, row_blocks(len(q)))
    return skeleton.transpose(2, 0, 1)


def frames_over_log(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the frames of an arm are, in the world, over a log.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, coordinates).

    Returns:
        Positions [m], shape (n, joints + 1, 3), and rotations [-], shape (n, joints + 1, 3, 3): of the base,
        then of the moving frame of every joint, fixed ones and mimics included.
    """
    count = len(chain.joints) + 1
    position, rotation = np.empty((count, 3, len(q))), np.empty((count, 3, 3, len(q)))

    def work(block: slice) -> None:
        """Fill the rows of a block."""
        for k, frame in enumerate(frames(chain, _columns(q[block]))):
            _fill(position[k, :, block], frame.translation)
            for row in range(3):
                _fill(rotation[k, row, :, block], frame.rotation[row])

    side_by_side(work, row_blocks(len(q)))
    return position.transpose(2, 0, 1), rotation.transpose(3, 0, 1, 2)


def jacobian_over_log(chain: Chain, q: FloatArray, point: int = -1) -> FloatArray:
    """Return the geometric Jacobian of a point p1..pn, in the world, for every row of q.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
        point: Index of the point, -1 for the tool centre point.

    Returns:
        Shape (n, 6, joints): rows vx, vy, vz in [m/s] and wx, wy, wz in [rad/s] per unit rate of each joint,
        [rad/s] of a revolute and [m/s] of a prismatic one; see `jacobian`.
    """
    result = np.empty((len(chain.coordinates), 6, len(q)))

    def work(block: slice) -> None:
        """Fill the rows of a block."""
        for i, column in enumerate(jacobian(chain, _columns(q[block]), point)):
            _fill(result[i, :, block], column)

    side_by_side(work, row_blocks(len(q)))
    return result.transpose(2, 1, 0)


def bias_over_log(chain: Chain, q: FloatArray, qd: FloatArray) -> FloatArray:
    """Return J' q', the acceleration of the tool centre point that the rates alone make, for every row.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their rates in [rad/s] or [m/s], shape (n, joints).

    Returns:
        Shape (n, 6): acceleration in [m/s2], then angular acceleration in [rad/s2], in the world.
    """
    result = np.empty((6, len(q)))

    def work(block: slice) -> None:
        """Fill the rows of a block."""
        rates = _columns(qd[block])
        *_, tip = each_motion(chain, _columns(q[block]), rates, [0.0] * len(rates))
        _fill(result[:3, block], tip.acceleration)
        _fill(result[3:, block], tip.alpha)

    side_by_side(work, row_blocks(len(q)))
    return result.T


def _columns(rows: FloatArray) -> list[FloatArray]:
    """Return the columns of (m, joints) as contiguous arrays."""
    return list(np.ascontiguousarray(rows.T))


def _fill(target: FloatArray, elements: Sequence[Element]) -> None:
    """Write one element a row into target, shape (k, m); constants spread over the columns."""
    for i, element in enumerate(elements):
        target[i] = element
