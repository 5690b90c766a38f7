"""Forward kinematics of a chain, elementwise: joint values, frames, Jacobian, motion, screws; over a log.

Each function takes one element per coordinate (see `elementwise`): arrays over the samples of a log,
floats, or CasADi symbols. Those that end in `_over_log` run over the rows of an array, shape (n, joints).

    joint_values, joint_rates   values of all joints from the coordinates q; here a mimic gets its value:
                                multiplier q + offset
    iter_frames, forward        products of frames and joint motions, from the base outwards
    tip_position, tip_pose      the tool centre point alone, inwards: p' = o + R Rot(axis, q) p
    jacobian                    columns (z x (p - o), z) of revolute, (z, 0) of prismatic joints
    point_motions               velocities and accelerations by the outward recursion
    chain_to_screws             the axes at q = 0: T(q) = exp(xi_1 q_1) ... exp(xi_n q_n) T(0)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import (
    ZERO,
    Element,
    FloatArray,
    Vector,
    add,
    cross,
    map_blocks,
    plus,
    row_blocks,
    scale,
    subtract,
    times,
)
from urmpipe_models.math3d import Transform, euler_zyx, rotate_vectors
from urmpipe_models.tape import aligned, fill_over_log


def joint_values(chain: Chain, q: Sequence[Element]) -> list[Element]:
    """Return the value of every joint of the chain in [rad] or [m]: fixed joints 0, mimics included."""
    # a joint value is no constant, whose products with 0 and 1 would be folded
    values = (np.float64(value) if isinstance(value, (int, float)) else value for value in q)
    q_by_name = dict(zip(chain.coordinates, values, strict=True))
    return [
        plus(times(joint.mimic.multiplier, q_by_name[joint.mimic.joint]), joint.mimic.offset)
        if joint.mimic
        else q_by_name.get(joint.name, 0.0)
        for joint in chain.joints
    ]


def joint_rates(chain: Chain, rates: Sequence[Element]) -> list[Element]:
    """Return the derivative of every joint's value: as `joint_values`, but without the offset of a mimic."""
    rate_by_name = dict(zip(chain.coordinates, rates, strict=True))
    return [
        times(joint.mimic.multiplier, rate_by_name[joint.mimic.joint])
        if joint.mimic
        else rate_by_name.get(joint.name, 0.0)
        for joint in chain.joints
    ]


def iter_frames(chain: Chain, q: Sequence[Element]) -> Iterator[Transform]:
    """Yield the base and the moving frame of every joint, in the world: the frames of the links.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
    """
    frame = chain.base
    yield frame
    for joint, value in zip(chain.joints, joint_values(chain, q), strict=True):
        frame = apply_joint(frame @ joint.origin, joint, value)
        yield frame


def apply_joint(at_joint: Transform, joint: Joint, value: Element) -> Transform:
    """Return the joint's moving frame from its fixed one and its value in [rad] or [m]."""
    if joint.kind == "revolute":
        return at_joint.rotated(joint.axis, value)
    if joint.kind == "prismatic":
        return Transform(at_joint.rotation, at_joint.point(scale(value, joint.axis)))
    return at_joint


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
    _, *links = iter_frames(chain, q)
    poses = [
        Transform(frame.rotation, frame.point(joint.origin.translation))
        for frame, joint in zip(links, chain.joints[1:], strict=False)
    ]
    return (*poses, links[-1] @ chain.tip @ chain.tool)


def tip_position(chain: Chain, q: Sequence[Element]) -> Vector:
    """Return the tool centre point in the world [m]; `tip_pose` also returns its orientation.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
    """
    return tip_to_world(chain, q, chain.tip.point(chain.tool.translation))[0]


def tip_pose(chain: Chain, q: Sequence[Element]) -> Transform:
    """Return the pose of the tool centre point alone, in the world: the last of `forward`, at less cost.

    Its axes x and y are computed with the point from the tool to the base; z = x cross y.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
    """
    tip = chain.tip @ chain.tool
    point, x, y = tip_to_world(chain, q, tip.translation, *tip.columns[:2])
    return Transform(Transform((x, y, cross(x, y))).columns, point)


def tip_to_world(chain: Chain, q: Sequence[Element], point: Vector, *directions: Vector) -> list[Vector]:
    """Return a point [m] and directions in the world, given in the frame of the last joint.

    Inward recursion from the tool to the base: p' = o + R Rot(axis, q) p and v' = R Rot(axis, q) v. It
    rotates one vector for each of them, whereas `iter_frames` rotates three per joint.
    """
    vectors = [point, *directions]
    for joint, value in zip(reversed(chain.joints), reversed(joint_values(chain, q)), strict=True):
        if joint.kind == "revolute":
            vectors = rotate_vectors(vectors, joint.axis, value)
        elif joint.kind == "prismatic":
            vectors[0] = add(vectors[0], scale(value, joint.axis))
        vectors = [joint.origin.point(vectors[0]), *map(joint.origin.rotate, vectors[1:])]
    return [chain.base.point(vectors[0]), *map(chain.base.rotate, vectors[1:])]


def jacobian(chain: Chain, q: Sequence[Element], point: int = -1) -> tuple[tuple[Element, ...], ...]:
    """Return the geometric Jacobian of a point p1..pn, in the world.

    Column i is (z_i x (p - o_i), z_i) for a revolute and (z_i, 0) for a prismatic joint with axis z_i
    through o_i; a mimic's column counts with its multiplier towards the joint it follows.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        point: Index of the point, -1 for the tool centre point.

    Returns:
        One column per coordinate, each vx, vy, vz in [m/s] and wx, wy, wz in [rad/s] per unit rate.
    """
    count = len(chain.joints)
    last = range(count)[point]
    axes: list[tuple[Vector, Vector]] = []
    frame = chain.base
    for k, (joint, value) in enumerate(zip(chain.joints, joint_values(chain, q), strict=True)):
        at_joint = frame @ joint.origin
        if k == last + 1:
            target = at_joint.translation
            break
        axes.append((at_joint.rotate(joint.axis), at_joint.translation))
        frame = apply_joint(at_joint, joint, value)
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
class Motion:
    """Pose and its first two derivatives of one point, in the world.

    Attributes:
        pose: Position in [m] and rotation.
        velocity: In [m/s].
        acceleration: In [m/s2].
        omega: Angular velocity in [rad/s].
        alpha: Angular acceleration in [rad/s2].
    """

    pose: Transform
    velocity: Vector
    acceleration: Vector
    omega: Vector
    alpha: Vector


def point_motions(
    chain: Chain, q: Sequence[Element], qd: Sequence[Element], qdd: Sequence[Element]
) -> tuple[Motion, ...]:
    """Return pose, velocity and acceleration of the points p1..pn, from q, q' and q''.

    Outward recursion over the joints, with d the vector from one frame's origin to the next:
    v' = v + omega x d, a' = a + alpha x d + omega x (omega x d); a revolute joint adds z q' to omega and
    z q'' + omega x z q' to alpha, a prismatic one z q' to v and z q'' + 2 omega x z q' to a.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        qd: Their first derivatives, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].

    Source: [UrmArm2021]_ section 3, Figure 10 b and c (v7 of q', a7 of q'' and q'^2).
    """
    return tuple(iter_point_motions(chain, q, qd, qdd))


def iter_point_motions(
    chain: Chain, q: Sequence[Element], qd: Sequence[Element], qdd: Sequence[Element]
) -> Iterator[Motion]:
    """Yield the motions of p1..pn one by one, so that the arrays of all need not be in memory.

    Args:
        chain: The arm.
        q: One element per coordinate, in [rad] or [m].
        qd: Their first derivatives, in [rad/s] or [m/s].
        qdd: Their second derivatives, in [rad/s2] or [m/s2].
    """
    values, rates, accelerations = joint_values(chain, q), joint_rates(chain, qd), joint_rates(chain, qdd)
    body = Motion(chain.base, ZERO, ZERO, ZERO, ZERO)
    for k, joint in enumerate(chain.joints):
        at_joint = _fixed_frame_motion(body, joint.origin)
        if k > 0:
            yield replace(at_joint, pose=Transform(body.pose.rotation, at_joint.pose.translation))
        body = _moving_frame_motion(at_joint, joint, values[k], rates[k], accelerations[k])
    yield _fixed_frame_motion(body, chain.tip @ chain.tool)


def _fixed_frame_motion(state: Motion, origin: Transform) -> Motion:
    """Return the motion of a frame fixed to a moving body."""
    d = state.pose.rotate(origin.translation)
    spin = cross(state.omega, d)
    rotated = Transform(state.pose.rotation) @ Transform(origin.rotation)
    return Motion(
        Transform(rotated.rotation, add(state.pose.translation, d)),
        add(state.velocity, spin),
        add(state.acceleration, add(cross(state.alpha, d), cross(state.omega, spin))),
        state.omega,
        state.alpha,
    )


def _moving_frame_motion(
    state: Motion, joint: Joint, value: Element, rate: Element, acceleration: Element
) -> Motion:
    """Return the motion of the joint's moving frame from that of its fixed one; fixed joints move by 0."""
    pose = apply_joint(state.pose, joint, value)
    axis = state.pose.rotate(joint.axis)
    axis_velocity, axis_acceleration = scale(rate, axis), scale(acceleration, axis)
    coupling = cross(state.omega, axis_velocity)
    if joint.kind == "revolute":
        omega = add(state.omega, axis_velocity)
        alpha = add(state.alpha, add(axis_acceleration, coupling))
        return Motion(pose, state.velocity, state.acceleration, omega, alpha)
    slide = scale(value, axis)
    spin = cross(state.omega, slide)
    relative = add(cross(state.alpha, slide), cross(state.omega, spin))
    relative = add(relative, add(scale(2.0, coupling), axis_acceleration))
    return Motion(
        pose,
        add(state.velocity, add(spin, axis_velocity)),
        add(state.acceleration, relative),
        state.omega,
        state.alpha,
    )


@dataclass(frozen=True, slots=True)
class PointLog:
    """One point of the arm over the samples of a log, in the world.

    Attributes:
        position: In [m], shape (n, 3).
        velocity: In [m/s], shape (n, 3).
        acceleration: In [m/s2], shape (n, 3).
        euler_zyx: rz, ry, rx in [rad], shape (n, 3).
        singular: True if ry = +-pi/2, where rx = 0 by convention, shape (n,).
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
        pose = tip_pose(chain, q)
        return [element for row in (pose.translation, *pose.rotation) for element in row]

    position, rotation = aligned(3, len(q)), aligned(9, len(q))
    fill_over_log(entries, q, [*position, *rotation])
    return position.T, rotation.reshape(3, 3, len(q)).transpose(2, 0, 1)


def point_over_log(chain: Chain, q: FloatArray, qd: FloatArray, qdd: FloatArray, point: int = -1) -> PointLog:
    """Return the motion of one point p1..pn over a log.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their first derivatives in [rad/s] or [m/s], shape (n, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (n, joints).
        point: Index of the point, -1 for the tool centre point.
    """
    count, index = len(q), range(len(chain.joints))[point]
    position, velocity, acceleration, euler = (np.empty((3, count)) for _ in range(4))
    singular = np.empty(count, dtype=np.bool_)

    def work(block: slice) -> None:
        motions = iter_point_motions(chain, _columns(q[block]), _columns(qd[block]), _columns(qdd[block]))
        motion = next(islice(motions, index, None))
        rz, ry, rx, singular[block] = euler_zyx(motion.pose.rotation)
        _fill(position[:, block], motion.pose.translation)
        _fill(velocity[:, block], motion.velocity)
        _fill(acceleration[:, block], motion.acceleration)
        _fill(euler[:, block], (rz, ry, rx))

    map_blocks(work, row_blocks(count))
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
        for k, pose in enumerate(forward(chain, _columns(q[block])), start=1):
            _fill(skeleton[k, :, block], pose.translation)

    map_blocks(work, row_blocks(len(q)))
    return skeleton.transpose(2, 0, 1)


def frames_over_log(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the frames of an arm in the world over a log.

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
        for k, frame in enumerate(iter_frames(chain, _columns(q[block]))):
            _fill(position[k, :, block], frame.translation)
            for row in range(3):
                _fill(rotation[k, row, :, block], frame.rotation[row])

    map_blocks(work, row_blocks(len(q)))
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
        for i, column in enumerate(jacobian(chain, _columns(q[block]), point)):
            _fill(result[i, :, block], column)

    map_blocks(work, row_blocks(len(q)))
    return result.transpose(2, 1, 0)


def bias_over_log(chain: Chain, q: FloatArray, qd: FloatArray) -> FloatArray:
    """Return J' q', the acceleration of the tool centre point at q'' = 0, for every row.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
        qd: Their first derivatives in [rad/s] or [m/s], shape (n, joints).

    Returns:
        Shape (n, 6): acceleration in [m/s2], then angular acceleration in [rad/s2], in the world.
    """
    result = np.empty((6, len(q)))

    def work(block: slice) -> None:
        rates = _columns(qd[block])
        *_, tip = iter_point_motions(chain, _columns(q[block]), rates, [0.0] * len(rates))
        _fill(result[:3, block], tip.acceleration)
        _fill(result[3:, block], tip.alpha)

    map_blocks(work, row_blocks(len(q)))
    return result.T


def _columns(rows: FloatArray) -> list[FloatArray]:
    return list(np.ascontiguousarray(rows.T))


def _fill(target: FloatArray, elements: Sequence[Element]) -> None:
    """Write one element per row into target, shape (k, m); constants fill their row."""
    for i, element in enumerate(elements):
        target[i] = element


@dataclass(frozen=True, slots=True, eq=False)
class Screws:
    """The moving joints of a chain at q = 0, in the world, and the pose of its tip there.

    With the twist xi_i of a joint's axis the tip is at T(q) = exp(xi_1 q_1) ... exp(xi_n q_n) T(0), the
    product of exponentials: two descriptions of one arm have the same screws.

    Attributes:
        direction: Unit vector along each axis [-], shape (n, 3).
        point: A point of each axis in [m], shape (n, 3).
        revolute: True for a revolute, false for a prismatic joint, shape (n,).
        rotation: Of the tool centre point at q = 0 [-], shape (3, 3).
        position: Of the tool centre point at q = 0 in [m], shape (3,).

    Source: [Brockett1984]_.
    """

    direction: FloatArray
    point: FloatArray
    revolute: NDArray[np.bool_]
    rotation: FloatArray
    position: FloatArray

    @property
    def size(self) -> float:
        """A length of the arm in [m] as a scale of distances: from axis to axis to the tip."""
        points = np.vstack((self.point, self.position))
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) or 1.0


def chain_to_screws(chain: Chain) -> Screws | None:
    """Return the screws of a chain, base and tool included; None if a joint follows another (mimic).

    The axis of such a joint moves with the joint that it follows, so it has no constant screw.
    """
    if any(joint.mimic is not None for joint in chain.joints):
        return None
    zero = [0.0] * len(chain.coordinates)
    axes = [
        (frame.rotate(joint.axis), frame.translation, joint.kind == "revolute")
        for joint, frame in zip(chain.joints, list(iter_frames(chain, zero))[1:], strict=True)
        if joint.kind != "fixed"
    ]
    direction, point, revolute = zip(*axes, strict=True)
    tip = tip_pose(chain, zero)
    return Screws(
        np.array(direction, dtype=float),
        np.array(point, dtype=float),
        np.array(revolute),
        np.array(tip.rotation, dtype=float),
        np.array(tip.translation, dtype=float),
    )


def screws_to_chain(screws: Screws, names: tuple[str, ...]) -> Chain:
    """Return a chain with these screws: each joint's frame is on its axis, parallel to the world.

    Args:
        screws: The screws of its joints.
        names: The names of its joints.
    """
    offsets = np.diff(np.vstack((np.zeros(3), screws.point)), axis=0)
    joints = tuple(
        Joint(
            name,
            "revolute" if revolute else "prismatic",
            Transform(translation=_vector(offset)),
            _vector(direction),
        )
        for name, revolute, offset, direction in zip(
            names, screws.revolute, offsets, screws.direction, strict=True
        )
    )
    x, y, z = (_vector(row) for row in screws.rotation)
    return Chain("screws", joints, Transform((x, y, z), _vector(screws.position - screws.point[-1])))


def _vector(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
