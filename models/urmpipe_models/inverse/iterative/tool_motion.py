"""Pose and Jacobian of the tool over many rows in few NumPy calls: a vector is one array of shape (3, n).

The chain of `kinematics` has an array an entry, so that a symbol may stand there too. Here only numbers
do, and x, y and z of a vector are worked on together: a batch of a few rows costs a tenth. Every joint
turns about the z axis of a frame of its own, or slides along it,

    T = C_0 Z(q_1) C_1 Z(q_2) ... Z(q_n) C_n,

with constant transforms C that hold all the rest: base, origins, directions of the axes, frames that carry
a sensor, tip and tool. Products with their 0 and 1 are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import Vector, add, cross, scale
from urmpipe_models.kinematics.frames import joint_values
from urmpipe_models.transform import Transform

Terms: TypeAlias = tuple[tuple[int, float], ...]
"""A constant vector by its entries that are not 0: which, and how much."""

Columns: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""The axes x, y, z of a frame in the world, each of shape (3, n), or (3, 1) where it does not move."""


class ToolMotion(NamedTuple):
    """Where the tool centre point is, and how every joint moves it, in the world.

    Attributes:
        position: In [m], shape (3, n).
        columns: The axes x, y, z of the tool [-], shape (3, 3, n), first index: which.
        jacobian: As `kinematics.jacobian` has it, in [m/rad] or [-], shape (6, joints, n).
    """

    position: FloatArray
    columns: FloatArray
    jacobian: FloatArray


@dataclass(frozen=True, slots=True)
class Step:
    """A constant transform C: its columns and its translation."""

    columns: tuple[Terms, Terms, Terms]
    translation: Terms


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A chain made ready for `tool_motion`.

    Attributes:
        chain: The arm.
        joints: Those that are not fixed.
        steps: C_0 ... C_n, one before each joint and one after the last.
    """

    chain: Chain
    joints: tuple[Joint, ...]
    steps: tuple[Step, ...]


@lru_cache(maxsize=32)
def arm_of(chain: Chain) -> Arm:
    """Return a chain made ready for `tool_motion`."""
    between, joints, steps = chain.base, [], []
    for joint in chain.joints:
        between = between @ joint.origin
        if joint.kind != "fixed":
            upright = _upright(joint.axis)
            steps.append(_step(between @ upright))
            joints.append(joint)
            between = upright.inverse()
    steps.append(_step(between @ chain.tip @ chain.tool))
    return Arm(chain, tuple(joints), tuple(steps))


def _upright(axis: Vector) -> Transform:
    """Return a frame whose z is a unit vector; of a coordinate axis its entries are 0 and +-1."""
    along = max(range(3), key=lambda i: abs(axis[i]))
    beside = [0.0, 0.0, 0.0]
    beside[(along + 1) % 3] = 1.0
    x = add((beside[0], beside[1], beside[2]), scale(-axis[(along + 1) % 3], axis))
    x = scale(1.0 / math.hypot(*x), x)
    return Transform(Transform((x, cross(axis, x), axis)).columns)


def _step(frame: Transform) -> Step:
    """Return a constant transform by its entries that are not 0."""
    x, y, z = frame.columns
    return Step((_terms(x), _terms(y), _terms(z)), _terms(frame.translation))


def _terms(vector: Vector) -> Terms:
    """Return the entries that are not 0."""
    return tuple((i, float(weight)) for i, weight in enumerate(vector) if weight != 0.0)


def tool_motion(arm: Arm, q: FloatArray) -> ToolMotion:
    """Return pose and Jacobian of the tool centre point.

    Args:
        arm: Of the chain, by `arm_of`.
        q: Joint values in [rad] or [m], shape (joints, n).
    """
    n = q.shape[1]
    J, origins = np.empty((6, len(arm.joints), n)), np.empty((3, len(arm.joints), n))
    values = _values(arm, q)
    columns: Columns = (np.eye(3)[:, :1], np.eye(3)[:, 1:2], np.eye(3)[:, 2:])
    point: FloatArray = np.zeros((3, 1))
    for i, (joint, step) in enumerate(zip(arm.joints, arm.steps, strict=False)):
        columns, point = _placed(columns, point, step)
        J[3:, i], origins[:, i] = columns[2], point
        if joint.kind == "prismatic":
            point = point + values[i] * columns[2]
        else:
            c, s = np.cos(values[i]), np.sin(values[i])
            columns = (c * columns[0] + s * columns[1], c * columns[1] - s * columns[0], columns[2])
    columns, point = _placed(columns, point, arm.steps[-1])
    axes, position = np.empty((3, 3, n)), np.empty((3, n))
    axes[0], axes[1], axes[2] = columns
    position[:] = point
    np.subtract(position[:, None], origins, out=origins)
    return ToolMotion(position, axes, _jacobian(arm, J, origins))


def _values(arm: Arm, q: FloatArray) -> list[FloatArray]:
    """Return the value of every joint that is not fixed, mimics included."""
    if len(arm.joints) == len(q):
        return list(q)
    every = zip(arm.chain.joints, joint_values(arm.chain, list(q)), strict=True)
    return [value for joint, value in every if joint.kind != "fixed"]


def _jacobian(arm: Arm, J: FloatArray, levers: FloatArray) -> FloatArray:
    """Return J, whose last rows are the axes, with its first: z x (p - o) of revolute joints, z of others.

    A mimic's column counts with its multiplier towards the joint that it follows.
    """
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        np.multiply(J[3 + j], levers[k], out=J[i])
        J[i] -= J[3 + k] * levers[j]
    for i, joint in enumerate(arm.joints):
        if joint.kind == "prismatic":
            J[:3, i], J[3:, i] = J[3:, i], 0.0
    if J.shape[1] == len(arm.chain.moving):
        return J
    place = {joint.name: i for i, joint in enumerate(arm.joints)}
    for i, joint in enumerate(arm.joints):
        if joint.mimic is not None:
            J[:, place[joint.mimic.joint]] += joint.mimic.multiplier * J[:, i]
    return J[:, [place[name] for name in arm.chain.coordinates]]


def _placed(columns: Columns, point: FloatArray, step: Step) -> tuple[Columns, FloatArray]:
    """Return axes and origin of a constant frame that is given in another's."""
    x, y, z = step.columns
    if step.translation:
        point = point + _combined(columns, step.translation)
    return (_combined(columns, x), _combined(columns, y), _combined(columns, z)), point


def _combined(columns: Columns, terms: Terms) -> FloatArray:
    """Return the sum of columns times their weights; there is at least one."""
    (first, weight), *others = terms
    total = columns[first] if weight == 1.0 else weight * columns[first]
    for which, weight in others:
        total = total + weight * columns[which]
    return total
