"""Random networks that close at their start, and what is computed of networks with matrices alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import expm, null_space
from scipy.spatial.transform import Rotation

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.parts import (
    JOINT_UNITS,
    Body,
    ConstraintElement,
    ElementKind,
    Expression,
    Joint,
    JointKind,
    frame_from_axes,
)

Poses = dict[str, FloatArray]
Vec = tuple[float, float, float]

KINDS: tuple[JointKind, ...] = ("revolute", "prismatic", "cylindrical", "helical", "global")
ELEMENTS: tuple[ElementKind, ...] = ("gg", "eg", "crc", "gc")
# weights of central differences of eighth order of nine equally spaced values: first and second derivative
FIRST = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
SECOND = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040


def vec(array: FloatArray) -> Vec:
    return float(array[0]), float(array[1]), float(array[2])


def unit(array: FloatArray | Sequence[float]) -> FloatArray:
    return np.asarray(np.asarray(array) / np.linalg.norm(array))


def transform(matrix: FloatArray) -> Transform:
    R = matrix[:3, :3]
    return Transform((vec(R[0]), vec(R[1]), vec(R[2])), vec(matrix[:3, 3]))


def matrix(frame: Transform) -> FloatArray:
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = np.array(frame.rotation), np.array(frame.translation)
    return full


def random_pose(rng: np.random.Generator, size: float = 1.0) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    pose[:3, 3] = size * rng.uniform(-1.0, 1.0, 3)
    return pose


def axis_frame(n: FloatArray, a: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a frame at a in [m] whose second column is n; its first is any across it."""
    return matrix(frame_from_axes(vec(unit(np.cross(n, rng.normal(size=3)))), vec(n), vec(a)))


def generator(w: FloatArray | Sequence[float], v: FloatArray | Sequence[float]) -> FloatArray:
    """Return the 4 x 4 matrix of a twist in [rad] and [m]."""
    full = np.zeros((4, 4))
    full[:3, :3], full[:3, 3] = np.cross(np.eye(3), w), v
    return full


def twist_of(full: FloatArray) -> FloatArray:
    """Return the twist of a 4 x 4 matrix in [rad] and [m], shape (6,)."""
    return np.array([full[2, 1], full[0, 2], full[1, 0], *full[:3, 3]])


def motion(kind: JointKind, q: Sequence[float] | FloatArray, pitch: float = 0.0) -> FloatArray:
    """Return T(q) as a matrix exponential: an oracle that shares no formula with the models."""
    theta = q[0] if kind in ("revolute", "cylindrical", "helical") else 0.0
    s = {"prismatic": q[0], "cylindrical": q[-1], "helical": pitch * q[0]}.get(kind, 0.0)
    w = tuple(q) if kind == "global" else (0.0, theta, 0.0)
    return np.asarray(expm(generator(w, (0.0, s, 0.0))))


def joint_matrix(joint: Joint, q: Sequence[float] | FloatArray) -> FloatArray:
    """Return R = A_1 T(q) A_2^-1, the pose of the second body in the first."""
    first, second = map(matrix, joint.frames)
    return np.asarray(first @ motion(joint.kind, q, joint.pitch) @ np.linalg.inv(second))


def random_values(kind: JointKind, rng: np.random.Generator) -> tuple[float, ...]:
    """Return variables in [rad] and [m] away from half a turn."""
    return tuple(float(one) for one in rng.uniform(-1.2, 1.2, len(JOINT_UNITS[kind])))


def joint_between(
    name: str,
    kind: JointKind,
    bodies: tuple[str, str],
    poses: Poses,
    rng: np.random.Generator,
    at: FloatArray | None = None,
    start: Sequence[float] | None = None,
) -> Joint:
    """Return a joint that closes where its bodies have these poses.

    It is at a frame `at` in the ground, with variables `start` in [rad] and [m], or both at random.
    """
    at = random_pose(rng) if at is None else at
    q = random_values(kind, rng) if start is None else tuple(start)
    pitch = float(rng.uniform(-0.5, 0.5)) if kind == "helical" else 0.0
    first = np.linalg.inv(poses[bodies[0]]) @ at
    second = np.linalg.inv(poses[bodies[1]]) @ at @ motion(kind, q, pitch)
    return Joint(name, kind, bodies, (transform(first), transform(second)), q, pitch=pitch)


def distance_of(
    kind: ElementKind, p: FloatArray, n: FloatArray, q: FloatArray, other: FloatArray, origin: FloatArray
) -> float:
    """Return what an element measures, all in the ground, by the geometry of schools."""
    if kind == "gg":
        return float(np.linalg.norm(q - p))
    if kind == "eg":
        return float(n @ (q - origin))
    if kind == "gc":
        return float(np.linalg.norm(np.cross(q - p, n)))
    return float(abs(np.linalg.det(np.column_stack((q - p, n, other)))) / np.linalg.norm(np.cross(n, other)))


def element_between(
    name: str, kind: ElementKind, bodies: tuple[str, str], poses: Poses, rng: np.random.Generator
) -> ConstraintElement:
    """Return an element with random points and lines that is satisfied where its bodies have these poses."""
    p, q = rng.uniform(-1.0, 1.0, (2, 3))
    n, other = unit(rng.normal(size=3)), unit(rng.normal(size=3))
    first, second = poses[bodies[0]], poses[bodies[1]]
    length = Expression(repr(distance_of(kind, p, n, q, other, first[:3, 3])))
    points = (vec(into(first, p)), vec(into(second, q)))
    normals = (vec(first[:3, :3].T @ n), vec(second[:3, :3].T @ other))
    return ConstraintElement(name, kind, bodies, length, points, normals)


def into(pose: FloatArray, point: FloatArray) -> FloatArray:
    """Return a point of the ground in a body, in [m]."""
    return np.asarray(pose[:3, :3].T @ (point - pose[:3, 3]))


def start_of(pose: FloatArray) -> tuple[float, ...]:
    """Return x, y, z in [m] and the rotation vector in [rad]."""
    return tuple(float(one) for one in (*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_rotvec()))


def random_network(
    rng: np.random.Generator,
    bodies: int = 4,
    extra: int = 2,
    elements: int = 2,
    kinds: Sequence[JointKind] = KINDS,
) -> Network:
    """Return a network that closes at its start: a tree of joints of any kind and direction, loops, elements.

    The joints stand in random order, so that any of a loop may be where it is cut.
    """
    names = ["ground", *(f"b{k}" for k in range(1, bodies + 1))]
    poses = {name: np.eye(4) if name == "ground" else random_pose(rng) for name in names}
    pairs = [(names[int(rng.integers(k))], names[k]) for k in range(1, len(names))]
    pairs += [random_pair(names, rng) for _ in range(extra)]
    joints = []
    for k, pair in enumerate(pairs):
        kind = kinds[int(rng.integers(len(kinds)))]
        joints.append(joint_between(f"j{k}", kind, pair if rng.random() < 0.5 else pair[::-1], poses, rng))
    held = [
        element_between(f"e{k}", ELEMENTS[int(rng.integers(4))], random_pair(names, rng), poses, rng)
        for k in range(elements)
    ]
    order = rng.permutation(len(joints))
    return Network("random", tuple(map(Body, names[1:])), tuple(joints[k] for k in order), tuple(held))


def random_pair(names: Sequence[str], rng: np.random.Generator) -> tuple[str, str]:
    first, second = rng.choice(len(names), 2, replace=False)
    return names[int(first)], names[int(second)]


def reframed(network: Network, rng: np.random.Generator, size: float = 1.0) -> Network:
    """Return a network whose joints' frames in its bodies are seen from others: the same mechanism."""
    moved = {one.name: random_pose(rng, size) for one in network.bodies} | {network.ground: np.eye(4)}

    def frames(one: Joint) -> tuple[Transform, Transform]:
        first, second = (
            np.linalg.inv(moved[name]) @ matrix(A) for name, A in zip(one.bodies, one.frames, strict=True)
        )
        return transform(first), transform(second)

    def seen(one: ConstraintElement) -> ConstraintElement:
        first, second = (moved[name] for name in one.bodies)
        n = np.array(one.normals[0])
        # h counts from the origin of the first body
        lift = f" - ({float(n @ first[:3, 3])!r})" if one.kind == "eg" else ""
        points = vec(into(first, np.array(one.points[0]))), vec(into(second, np.array(one.points[1])))
        normals = vec(first[:3, :3].T @ n), vec(second[:3, :3].T @ np.array(one.normals[1]))
        return replace(one, length=Expression(one.length.text + lift), points=points, normals=normals)

    joints = tuple(replace(one, frames=frames(one)) for one in network.joints)
    elements = tuple(map(seen, network.elements))
    return replace(network, joints=joints, elements=elements)


def difference(function: Callable[[FloatArray], FloatArray], x: FloatArray, step: float = 1e-3) -> FloatArray:
    """Return the derivatives of a function by each entry of x, shape (..., entries).

    Central differences over 1, 2 and 3 steps: an error of step^6 times the seventh derivative / 140, and
    rounding of 1e-16 / step.

    Args:
        function: From shape (entries, n) to shape (..., n).
        x: Where, shape (entries,).
        step: In the units of x.
    """
    size = len(x)
    steps = np.concatenate([m * step * np.eye(size) for m in (1, 2, 3, -1, -2, -3)], axis=1)
    values = np.array_split(function(x[:, np.newaxis] + steps), 6, axis=-1)
    sides = [ahead - behind for ahead, behind in zip(values[:3], values[3:], strict=True)]
    return np.asarray((45.0 * sides[0] - 9.0 * sides[1] + sides[2]) / (60.0 * step))


def one_by_one(function: Callable[[FloatArray], FloatArray]) -> Callable[[FloatArray], FloatArray]:
    """Return a function of shape (entries, n) from one of shape (entries,)."""
    return lambda x: np.stack([function(one) for one in x.T], axis=-1)


def pose_of(mechanism: Mechanism, x: FloatArray, body: str) -> FloatArray:
    return matrix(mechanism.poses([float(one) for one in x])[body])


def body_jacobian(mechanism: Mechanism, x: FloatArray, body: str) -> FloatArray:
    """Return a body's twists in the ground a unit of each variable, by differences, shape (6, variables)."""
    now = np.linalg.inv(pose_of(mechanism, x, body))
    rates = difference(one_by_one(lambda at: pose_of(mechanism, at, body)), x)
    return np.array([twist_of(rate @ now) for rate in np.moveaxis(rates, -1, 0)]).T


def twist_space(mechanism: Mechanism, x: FloatArray, body: str) -> FloatArray:
    """Return a basis of the twists that a body can have in the closed network, shape (6, k)."""
    return column_space(body_jacobian(mechanism, x, body) @ closed_motions(mechanism, x))


def closed_motions(mechanism: Mechanism, x: FloatArray) -> FloatArray:
    """Return a basis of the changes of the variables that leave a network closed, shape (variables, k)."""
    jacobian = evaluate_closure(mechanism, x[:, np.newaxis]).jacobian[:, :, 0]
    return np.asarray(null_space(jacobian, rcond=1e-8) if len(jacobian) else np.eye(len(x)))


def column_space(vectors: FloatArray) -> FloatArray:
    """Return an orthonormal basis of what columns span, of singular values above 1e-6."""
    left, values, _ = np.linalg.svd(vectors, full_matrices=False)
    return np.asarray(left[:, values > 1e-6 * max(1.0, values.max(initial=0.0))])


def assert_same_space(first: FloatArray, second: FloatArray, atol: float) -> None:
    """Compare the spaces of two orthonormal bases by their projections."""
    assert first.shape == second.shape
    np.testing.assert_allclose(first @ first.T, second @ second.T, rtol=0.0, atol=atol)


def assert_close(found: FloatArray | float, expected: FloatArray | float, atol: float) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=atol)


DOOR: dict[str, Any] = {
    "angle_unit": "deg",
    "controls": {"opening": {"start": 20, "lower": -10, "upper": 90}},
    "chains": {"arm": {"robot": "ur5e", "start": [0, -90, 100, -10, 90, 0]}},
    "bodies": {"door": {}},
    "joints": {
        "hinge": {
            "kind": "revolute", "bodies": ["ground", "door"], "n": [0, 0, 1],
            "a": [[0.6, -0.5, 0], [0, 0, 0]], "driven": "opening",
        },
        "grip": {
            "kind": "user", "bodies": ["door", "arm.tool"],
            "m": [0, 0, 1], "n": [0, 1, 0], "a": [0, 0.5, 0.4],
        },
    },
}  # fmt: skip
"""An arm of the catalogue that holds the handle of a door."""
