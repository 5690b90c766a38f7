"""Orientations in the forms in which logs record them, as unit quaternions and rotation matrices."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from urmpipe_models.arrays import FloatArray

RotationForm = Literal["vector", "rpy", "zyx", "xyz", "zyz", "zxz", "quat_xyzw", "quat_wxyz", "matrix"]
"""vector     x, y, z of the axis times the angle (UR's RX, RY, RZ)
rpy        roll, pitch, yaw about the fixed x, y, z: R = Rz(yaw) Ry(pitch) Rx(roll)
zyx        the same three angles, that about z first (KUKA's A, B, C)
xyz, ...   angles about the moving axes named, in turn: R = Rx(a) Ry(b) Rz(c)
quat_...   a quaternion, its letters in the order of the columns
matrix     the nine entries of R, row by row
"""

FORMS: tuple[RotationForm, ...] = get_args(RotationForm)

EULER: dict[RotationForm, str] = {"zyx": "zyx", "xyz": "xyz", "zyz": "zyz", "zxz": "zxz"}
"""The forms that are three angles about moving axes, and these axes."""


def width(form: RotationForm) -> int:
    """Return how many columns a form has."""
    return 9 if form == "matrix" else 4 if form.startswith("quat") else 3


NAMES: dict[RotationForm, tuple[str, ...]] = {
    "vector": ("rx", "ry", "rz"),
    "rpy": ("roll", "pitch", "yaw"),
    **{form: tuple(f"{axis}{k + 1}" for k, axis in enumerate(axes)) for form, axes in EULER.items()},
    "quat_xyzw": ("qx", "qy", "qz", "qw"),
    "quat_wxyz": ("qw", "qx", "qy", "qz"),
    "matrix": tuple(f"r{i}{j}" for i in "123" for j in "123"),
}
"""What the columns of a form are called: z1, y2, x3 are the first, second and third angle and their axes."""


def angles(form: RotationForm) -> bool:
    """Return whether the columns of a form are in [rad]; the others are in [-]."""
    return width(form) == 3


def quaternions(rotation: FloatArray, form: RotationForm) -> FloatArray:
    """Return unit quaternions x, y, z, w of recorded orientations.

    Of a rotation vector v with the angle a = |v|: [v sin(a / 2) / a, cos(a / 2)]. Of Euler angles: the
    product of the quaternions of the three rotations. Of a matrix: its largest entry of
    (1 + trace R, 1 + 2 R_ii - trace R) first, so that nothing is divided by a small number.

    Args:
        rotation: As recorded, in [rad] or [-], shape (n, width).
        form: What its columns are.

    Returns:
        Shape (n, 4) [-]; NaN where a sample is missing. Their sign is open: q and -q are one orientation.
    """
    if form == "vector":
        angle = np.linalg.norm(rotation, axis=1)
        imaginary = rotation * (0.5 * np.sinc(angle / (2 * np.pi)))[:, np.newaxis]
        return np.column_stack((imaginary, np.cos(0.5 * angle)))
    if form == "matrix":
        return _of_matrix(rotation.reshape(-1, 3, 3))
    if form in {"quat_xyzw", "quat_wxyz"}:
        ordered = rotation if form == "quat_xyzw" else rotation[:, [1, 2, 3, 0]]
        with np.errstate(invalid="ignore", divide="ignore"):
            unit: FloatArray = ordered / np.linalg.norm(ordered, axis=1, keepdims=True)
        return unit
    axes, turns = (EULER[form], rotation) if form in EULER else ("zyx", rotation[:, ::-1])
    result = _about(axes[0], turns[:, 0])
    for axis, turn in zip(axes[1:], turns.T[1:], strict=True):
        result = product(result, _about(axis, turn))
    return result


def matrices(quat_xyzw: FloatArray) -> FloatArray:
    """Return rotation matrices, R = I + 2 w [v]x + 2 [v]x [v]x, shape (n, 3, 3) [-].

    Args:
        quat_xyzw: Unit quaternions x, y, z, w [-], shape (n, 4).
    """
    x, y, z, w = quat_xyzw.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.asarray(np.array(rows, dtype=np.float64).transpose(2, 0, 1))


def conjugate(quat_xyzw: FloatArray) -> FloatArray:
    """Return the opposite rotations, -v and w, shape (n, 4) [-].

    Args:
        quat_xyzw: Unit quaternions x, y, z, w [-], shape (n, 4).
    """
    return np.asarray(quat_xyzw * np.array([-1.0, -1.0, -1.0, 1.0]))


def angle_between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angle of the rotation from one orientation to another, 0 to pi: 2 atan2(|v|, |w|).

    Args:
        first: Unit quaternions x, y, z, w [-], shape (n, 4).
        second: Likewise [-], shape (n, 4).

    Returns:
        In [rad], shape (n,).
    """
    between = product(conjugate(first), second)
    angle: FloatArray = 2 * np.arctan2(np.linalg.norm(between[:, :3], axis=1), np.abs(between[:, 3]))
    return angle


def slerp(first: FloatArray, second: FloatArray, share: FloatArray) -> FloatArray:
    """Return orientations on the great arc from one to another, the shorter way.

    (sin((1 - s) a) q1 + sin(s a) q2) / sin(a), with the angle a = 2 atan2(|q2 - q1|, |q2 + q1|) of the two as
    vectors, of which q2 or -q2 is the nearer to q1. At an end of the way stands that end, though the other
    is missing.

    Args:
        first: Unit quaternions x, y, z, w [-], shape (n, 4).
        second: Likewise [-], shape (n, 4).
        share: s, 0 to 1 [-], shape (n,).

    Returns:
        Shape (n, 4) [-]; NaN between two of which one is missing.

    Source: Shoemake 1985, Animating rotation with quaternion curves.
    """
    cosine = np.einsum("ij,ij->i", first, second)
    near = second * np.where(cosine < 0.0, -1.0, 1.0)[:, np.newaxis]
    angle = 2 * np.arctan2(np.linalg.norm(near - first, axis=1), np.linalg.norm(near + first, axis=1))
    # sin(a s) / sin(a), which is s where a is 0
    own, other = (
        part * np.sinc(angle * part / np.pi) / np.sinc(angle / np.pi) for part in (1 - share, share)
    )
    between = own[:, np.newaxis] * first + other[:, np.newaxis] * near
    at_first, at_second = (share == 0.0)[:, np.newaxis], (share == 1.0)[:, np.newaxis]
    return np.where(at_first, first, np.where(at_second, second, between))


def _about(axis: str, angle: FloatArray) -> FloatArray:
    """Return the quaternions of rotations about a coordinate axis."""
    result = np.zeros((len(angle), 4))
    result[:, "xyz".index(axis)] = np.sin(0.5 * angle)
    result[:, 3] = np.cos(0.5 * angle)
    result[np.isnan(angle)] = np.nan
    return result


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the product of quaternions x, y, z, w, shape (n, 4) [-]: the second rotation, then the first.

    Args:
        first: Shape (n, 4) [-].
        second: Likewise, shape (n, 4) [-].
    """
    x, y, z, w = first.T
    a, b, c, d = second.T
    return np.column_stack(
        (
            w * a + d * x + y * c - z * b,
            w * b + d * y + z * a - x * c,
            w * c + d * z + x * b - y * a,
            w * d - (x * a + y * b + z * c),
        )
    )


def rotation_vectors(quat_xyzw: FloatArray) -> FloatArray:
    """Return u a, 0 <= a <= pi, of orientations, in [rad], shape (n, 3); NaN of one with NaN.

    With v = u sin(a / 2), w = cos(a / 2) of either sign: a = 2 atan2(|v|, |w|).

    Args:
        quat_xyzw: Unit quaternions x, y, z, w [-], shape (n, 4).
    """
    imaginary, real = quat_xyzw[:, :3], quat_xyzw[:, 3]
    angle = 2.0 * np.arctan2(np.linalg.norm(imaginary, axis=1), np.abs(real))
    scale = 2.0 / np.sinc(angle / (2.0 * np.pi))  # a / sin(a / 2)
    return np.asarray(imaginary * np.copysign(scale, real)[:, None])


def best_rotation(crossed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rotation R with the largest sum of products a . R b, which brings points b nearest to a.

    With U S V^T of H: R = U diag(1, 1, det(U V^T)) V^T. It is the only one if the last two of the sizes that
    are returned beside it add up to more than 0.

    Args:
        crossed: H = sum(a b^T), in the units of both, shape (..., 3, 3).

    Returns:
        R [-], shape (..., 3, 3), and s1, s2, det(U V^T) s3, which add up to that of the products,
        shape (..., 3).

    Source: Kabsch 1976; Umeyama 1991, eq. 39-43, without scale.
    """
    u, sizes, vt = np.linalg.svd(crossed)
    signs = np.ones_like(sizes)
    signs[..., 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray(u * signs[..., np.newaxis, :] @ vt), np.asarray(sizes * signs)


def _of_matrix(r: FloatArray) -> FloatArray:
    """Return the unit quaternions x, y, z, w of rotation matrices, shape (n, 3, 3) [-]."""
    trace = np.trace(r, axis1=1, axis2=2)
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = r.transpose(1, 2, 0)
    candidates = np.array(
        [
            [1 + 2 * xx - trace, xy + yx, zx + xz, zy - yz],
            [xy + yx, 1 + 2 * yy - trace, yz + zy, xz - zx],
            [zx + xz, yz + zy, 1 + 2 * zz - trace, yx - xy],
            [zy - yz, xz - zx, yx - xy, 1 + trace],
        ]
    )  # four times a component times the quaternion, one row a component
    sizes = np.array([candidates[k, k] for k in range(4)])
    best = np.where(np.isnan(sizes).any(axis=0), 0, np.argmax(sizes, axis=0))
    chosen: FloatArray = candidates[best, :, np.arange(len(r))]
    unit: FloatArray = chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
    return unit
