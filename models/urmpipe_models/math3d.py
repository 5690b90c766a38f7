"""Rotations and rigid transforms: frames, Euler angles, and the forms of orientations in logs.

1. `Transform` and the elementary motions, elementwise: constant frames of a chain and poses over a log.
2. Euler angles of a rotation, with their singular poses.
3. Orientations in the forms in which logs record them, as unit quaternions and rotation matrices of arrays.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import matmul
from typing import Literal, TypeAlias, get_args

import numpy as np

from urmpipe_models.elementwise import (
    ZERO,
    Element,
    FloatArray,
    Vector,
    add,
    cosine_sine,
    dot,
    minus,
    plus,
    scale,
    subtract,
    times,
)

SINGULAR_COSINE = 1e-9  # of ry: below it, rz and rx are not separately defined (no digits are left)
SINGULAR_SINE = 1e-9  # of x: below it, z1 and z2 of Z-X-Z are not separately defined

_QUARTERS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))  # cos, sin of 0 to 3 quarter turns
_Numbers: TypeAlias = tuple[float, float, float]  # the elements of a stored frame


@dataclass(frozen=True, slots=True)
class Transform:
    """Rotation R and translation p of a frame B in a frame A: x_A = R x_B + p.

    Attributes:
        rotation: The rows of R, each three elements [-].
        translation: p, three elements in [m].
        steps: The constants and elementary motions whose product it is, or None if only the numbers are
            known. Comparisons ignore it, and a product of frames has none.
    """

    rotation: tuple[Vector, Vector, Vector] = field(
        default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        metadata={"stored": tuple[_Numbers, _Numbers, _Numbers]},
    )
    translation: Vector = field(default=ZERO, metadata={"stored": _Numbers})
    steps: tuple[Transform | Step, ...] | None = field(default=None, compare=False, repr=False)

    def __matmul__(self, other: Transform) -> Transform:
        """Return the frame C in A from B in A (self) and C in B (other)."""
        (x, y, z), columns = self.rotation, other.columns
        return Transform(
            (
                (dot(x, columns[0]), dot(x, columns[1]), dot(x, columns[2])),
                (dot(y, columns[0]), dot(y, columns[1]), dot(y, columns[2])),
                (dot(z, columns[0]), dot(z, columns[1]), dot(z, columns[2])),
            ),
            self.point(other.translation),
        )

    @property
    def columns(self) -> tuple[Vector, Vector, Vector]:
        """The axes x, y, z of B in A: the columns of R [-]."""
        x, y, z = self.rotation
        return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])

    def rotate(self, vector: Vector) -> Vector:
        """Return R v, a direction v of B in A, in the unit of v."""
        return dot(self.rotation[0], vector), dot(self.rotation[1], vector), dot(self.rotation[2], vector)

    def point(self, position: Vector) -> Vector:
        """Return R x + p, a point x [m] of B in A [m]."""
        return add(self.rotate(position), self.translation)

    def inverse(self) -> Transform:
        """Return the frame A in B: R^T, -R^T p."""
        inverse = Transform(self.columns)
        return Transform(self.columns, scale(-1.0, inverse.rotate(self.translation)))

    def rotated(self, axis: Sequence[float], angle: Element) -> Transform:
        """Return the frame after a rotation about an axis of B: R rotation_about(axis, angle), p.

        About x, y or z the other two axes y, z (z, x; x, y) become c y + s z, c z - s y: 12 products
        instead of 27.

        Args:
            axis: Unit vector [-].
            angle: In [rad], any element.
        """
        along = _along(axis)
        if along is None:
            return Transform((self @ rotation_about(axis, angle)).rotation, self.translation)
        c, s = _cosine_sine(angle)
        s = times(axis[along], s)
        columns = list(self.columns)
        first, second = columns[along - 2], columns[along - 1]
        columns[along - 2] = add(scale(c, first), scale(s, second))
        columns[along - 1] = subtract(scale(c, second), scale(s, first))
        return Transform(Transform((columns[0], columns[1], columns[2])).columns, self.translation)


def rotate_vectors(vectors: Sequence[Vector], axis: Sequence[float], angle: Element) -> list[Vector]:
    """Return vectors after a rotation about an axis, each in its unit.

    About x, y or z the other two coordinates a, b become c a - s b, c b + s a: 4 products instead of 9.

    Args:
        vectors: Of any elements.
        axis: Unit vector [-].
        angle: In [rad], any element.
    """
    along = _along(axis)
    if along is None:
        return [*map(rotation_about(axis, angle).rotate, vectors)]
    c, s = _cosine_sine(angle)
    s = times(axis[along], s)
    rotated = []
    for vector in vectors:
        first, second = vector[along - 2], vector[along - 1]
        entries = list(vector)
        entries[along - 2] = minus(times(c, first), times(s, second))
        entries[along - 1] = plus(times(c, second), times(s, first))
        rotated.append((entries[0], entries[1], entries[2]))
    return rotated


@dataclass(frozen=True, slots=True)
class Step:
    """An elementary motion, one parameter of a frame: a shift along an axis or a turn about it.

    Attributes:
        kind: along or about.
        axis: x, y or z.
        value: In [m] along, in [rad] about the axis, any element.
        name: Its name in the arm; if empty, that of its frame and axis.
        source: The description that it is from, such as "6R length".
    """

    kind: Literal["along", "about"]
    axis: Literal["x", "y", "z"]
    value: Element = field(default=0.0, metadata={"stored": float})
    name: str = ""
    source: str = ""

    @property
    def frame(self) -> Transform:
        """The frame after this motion in the frame before it."""
        if self.kind == "about":
            return {"x": rotation_x, "y": rotation_y, "z": rotation_z}[self.axis](self.value)
        x, y, z = (self.value if axis == self.axis else 0.0 for axis in "xyz")
        return translation(x, y, z)


def compose(parts: Iterable[Transform | Step]) -> Transform:
    """Return the product of constants and elementary motions from left to right; of none, the identity."""
    frames = [part.frame if isinstance(part, Step) else part for part in parts]
    return reduce(matmul, frames) if frames else Transform()


def compose_steps(*parts: Transform | Step) -> Transform:
    """Return the product of constants and elementary motions, with these as `steps`."""
    frame = compose(parts)
    return Transform(frame.rotation, frame.translation, parts)


def translation(x: Element, y: Element, z: Element) -> Transform:
    """Return a shift by x, y, z in [m]."""
    return Transform(translation=(x, y, z))


def rotation_x(angle: Element) -> Transform:
    """Return Rx(angle), angle in [rad]."""
    c, s = _cosine_sine(angle)
    return Transform(((1.0, 0.0, 0.0), (0.0, c, minus(0.0, s)), (0.0, s, c)))


def rotation_y(angle: Element) -> Transform:
    """Return Ry(angle), angle in [rad]. Source: [UrmArm2021]_ eq. 2."""
    c, s = _cosine_sine(angle)
    return Transform(((c, 0.0, s), (0.0, 1.0, 0.0), (minus(0.0, s), 0.0, c)))


def rotation_z(angle: Element) -> Transform:
    """Return Rz(angle), angle in [rad]. Source: [UrmArm2021]_ eq. 1."""
    c, s = _cosine_sine(angle)
    return Transform(((c, minus(0.0, s), 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def rotation_about(axis: Sequence[float], angle: Element) -> Transform:
    """Return the rotation about a constant unit axis.

    R = cos(a) I + (1 - cos(a)) u u^T + sin(a) [u]x (Rodrigues).

    Args:
        axis: Unit vector u [-].
        angle: a in [rad], any element.
    """
    x, y, z = (float(u) for u in axis)
    c, s = _cosine_sine(angle)
    v = minus(1.0, c)
    return Transform(
        (
            (_cosine_entry(c, v, x), minus(times(x * y, v), times(z, s)), plus(times(x * z, v), times(y, s))),
            (plus(times(x * y, v), times(z, s)), _cosine_entry(c, v, y), minus(times(y * z, v), times(x, s))),
            (minus(times(x * z, v), times(y, s)), plus(times(y * z, v), times(x, s)), _cosine_entry(c, v, z)),
        )
    )


def from_rpy(rx: Element, ry: Element, rz: Element) -> Transform:
    """Return Rz(rz) Ry(ry) Rx(rx), angles in [rad]; URDF calls them roll, pitch, yaw."""
    return rotation_z(rz) @ rotation_y(ry) @ rotation_x(rx)


def from_xyz_rpy(xyz: Vector, rpy: Vector, source: str = "") -> Transform:
    """Return the frame at x, y, z in [m], turned by rx, ry, rz in [rad] (see `from_rpy`), as six motions.

    Args:
        xyz: Any elements in [m].
        rpy: Any elements in [rad].
        source: The description that it is from.
    """
    (x, y, z), (rx, ry, rz) = xyz, rpy
    return compose_steps(
        Step("along", "x", x, source=source),
        Step("along", "y", y, source=source),
        Step("along", "z", z, source=source),
        Step("about", "z", rz, source=source),
        Step("about", "y", ry, source=source),
        Step("about", "x", rx, source=source),
    )


def from_offset(values: Sequence[float]) -> Transform:
    """Return the frame written as x, y, z in [m] and optionally rx, ry, rz in [rad] (see `from_rpy`)."""
    x, y, z, rx, ry, rz = (*map(float, values), *(0.0,) * (6 - len(values)))
    return from_xyz_rpy((x, y, z), (rx, ry, rz), "offset")


def euler_zyx(rotation: tuple[Vector, Vector, Vector]) -> tuple[Element, Element, Element, Element]:
    """Return the moving Z-Y-X Euler angles of R = Rz(rz) Ry(ry) Rx(rx), and where they are singular.

    rx = atan2(a32, a33), ry = atan2(-a31, hypot(a11, a21)), rz = atan2(a21, a11). At ry = +-pi/2
    only rz -+ rx is defined: there rx = 0 and rz = atan2(-a12, a22) by convention.

    Args:
        rotation: Rows of R.

    Returns:
        rz, ry, rx in [rad] and a flag that is true (1 in a trace) where the convention was used.

    Source: [UrmArm2021]_ eq. 9-13, with atan2 (errata).
    """
    (a11, a12, _), (a21, a22, _), (a31, a32, a33) = rotation
    cosine = np.hypot(a11, a21)
    singular = cosine < SINGULAR_COSINE
    # + 0.0: of a signed zero atan2 would make -pi here and +pi in C, where a choice of two loses the sign
    rz = np.arctan2(np.where(singular, -a12, a21) + 0.0, np.where(singular, a22, a11))
    ry = np.arctan2(-a31, cosine)
    rx = np.arctan2(np.where(singular, 0.0, a32) + 0.0, np.where(singular, 1.0, a33))
    return rz, ry, rx, singular


def from_zxz(z1: Element, x: Element, z2: Element) -> Transform:
    """Return Rz(z1) Rx(x) Rz(z2), angles in [rad]. Source: [Geometric6R]_ eq. 34."""
    return rotation_z(z1) @ rotation_x(x) @ rotation_z(z2)


def euler_zxz(rotation: tuple[Vector, Vector, Vector]) -> tuple[Element, Element, Element, Element]:
    """Return the moving Z-X-Z Euler angles of R = Rz(z1) Rx(x) Rz(z2), and where they are singular.

    z1 = atan2(a13, -a23), x = atan2(hypot(a13, a23), a33), z2 = atan2(a31, a32): x is in [0, pi]. At
    x = 0 and x = pi only z1 + z2 and z1 - z2 are defined: there z2 = 0 and z1 = atan2(a21, a11) by
    convention. The paper's z2, from the rows x and y turned back by z1, is the same angle; the last row
    gives it without a product.

    Args:
        rotation: Rows of R.

    Returns:
        z1, x, z2 in [rad] and a flag that is true (1 in a trace) where the convention was used.

    Source: [Geometric6R]_ eq. 15, 16, with the singular cases the paper leaves out (gamma_nz = +-1).
    """
    (a11, _, a13), (a21, _, a23), (a31, a32, a33) = rotation
    sine = np.hypot(a13, a23)
    singular = sine < SINGULAR_SINE
    across: Element = np.where(singular, a21, a13)
    z1 = np.arctan2(across + 0.0, np.where(singular, a11, -a23))  # + 0.0: see `euler_zyx`
    x = np.arctan2(sine, a33)
    z2 = np.arctan2(np.where(singular, 0.0, a31) + 0.0, np.where(singular, 1.0, a32))
    return z1, x, z2, singular


def matrix_to_rpy(rotation: tuple[Vector, Vector, Vector]) -> tuple[float, float, float]:
    """Return rx, ry, rz in [rad] such that `from_rpy` gives the constant R back to 1e-15.

    Unlike `euler_zyx` it needs no singular case: rx is that of Rz(rz)^T R, so that the
    product is R for any rz that results from the rounding of a11 and a21. Half a turn is pi, not -pi, also at
    a zero of either sign.
    """
    (a11, a12, a13), (a21, a22, a23), (a31, _, _) = rotation
    rz = float(np.arctan2(a21 + 0.0, a11))  # + 0.0: see `euler_zyx`
    ry = float(np.arctan2(-a31, np.hypot(a11, a21)))
    s, c = np.sin(rz), np.cos(rz)
    rx = float(np.arctan2(s * a13 - c * a23 + 0.0, c * a22 - s * a12))
    return rx, ry, rz


def _along(axis: Sequence[float]) -> int | None:
    """Return the index of the coordinate axis that an axis is parallel to, or None."""
    return [*map(abs, axis)].index(1.0) if sorted(map(abs, axis)) == [0.0, 0.0, 1.0] else None


def _cosine_sine(angle: Element) -> tuple[Element, Element]:
    """Return cos and sin; of the constants 0, +-pi/2, +-pi, ... +-2 pi exactly, as 0 and +-1 are folded.

    A right angle in the description of a robot is exact, but cos(pi/2) in double precision is 6e-17. The
    value of a joint is no constant, so it is not a float (see `elementwise`).
    """
    if type(angle) is float:
        quarters, rest = divmod(angle, math.pi / 2)
        if rest == 0.0 and abs(quarters) <= 4:
            return _QUARTERS[int(quarters) % 4]
    return cosine_sine(angle)


def _cosine_entry(c: Element, v: Element, u: float) -> Element:
    """Return c + u^2 (1 - c), the constant 1 on the axis."""
    return 1.0 if abs(u) == 1.0 else plus(c, times(u * u, v))


RotationForm = Literal["vector", "rpy", "zyx", "xyz", "zyz", "zxz", "quat_xyzw", "quat_wxyz", "matrix"]
"""vector     x, y, z of the axis times the angle (UR's RX, RY, RZ)
rpy        roll, pitch, yaw about the fixed x, y, z: R = Rz(yaw) Ry(pitch) Rx(roll)
zyx        the same three angles, that about z first (KUKA's A, B, C)
xyz, ...   angles about the named moving axes, in this order: R = Rx(a) Ry(b) Rz(c)
quat_...   a quaternion, its letters in the order of the columns
matrix     the nine entries of R, row by row
"""

FORMS: tuple[RotationForm, ...] = get_args(RotationForm)
EULER: dict[RotationForm, str] = {"zyx": "zyx", "xyz": "xyz", "zyz": "zyz", "zxz": "zxz"}  # moving axes


def column_count(form: RotationForm) -> int:
    """Return the number of columns of a form."""
    return 9 if form == "matrix" else 4 if form.startswith("quat") else 3


COLUMN_NAMES: dict[
    RotationForm, tuple[str, ...]
] = {  # z1, y2, x3: first, second and third angle about these axes
    "vector": ("rx", "ry", "rz"),
    "rpy": ("roll", "pitch", "yaw"),
    **{form: tuple(f"{axis}{k + 1}" for k, axis in enumerate(axes)) for form, axes in EULER.items()},
    "quat_xyzw": ("qx", "qy", "qz", "qw"),
    "quat_wxyz": ("qw", "qx", "qy", "qz"),
    "matrix": tuple(f"r{i}{j}" for i in "123" for j in "123"),
}


def is_angular(form: RotationForm) -> bool:
    """Return whether the columns of a form are in [rad]; the others are in [-]."""
    return column_count(form) == 3


def to_quaternions(rotation: FloatArray, form: RotationForm) -> FloatArray:
    """Return unit quaternions x, y, z, w of recorded orientations.

    Of a rotation vector v with the angle a = |v|: [v sin(a / 2) / a, cos(a / 2)]. Of Euler angles: the
    product of the quaternions of the three rotations. Of a matrix: its largest entry of
    (1 + trace R, 1 + 2 R_ii - trace R) first, so that nothing is divided by a small number.

    Args:
        rotation: As recorded, in [rad] or [-], shape (n, width).
        form: Its form.

    Returns:
        Shape (n, 4) [-]; NaN where a sample is missing. The sign is arbitrary: q and -q are one orientation.
    """
    if form == "vector":
        angle = np.linalg.norm(rotation, axis=1)
        imaginary = rotation * (0.5 * np.sinc(angle / (2 * np.pi)))[:, np.newaxis]
        return np.column_stack((imaginary, np.cos(0.5 * angle)))
    if form == "matrix":
        return _matrices_to_quaternions(rotation.reshape(-1, 3, 3))
    if form in {"quat_xyzw", "quat_wxyz"}:
        ordered = rotation if form == "quat_xyzw" else rotation[:, [1, 2, 3, 0]]
        with np.errstate(invalid="ignore", divide="ignore"):
            unit: FloatArray = ordered / np.linalg.norm(ordered, axis=1, keepdims=True)
        return unit
    axes, turns = (EULER[form], rotation) if form in EULER else ("zyx", rotation[:, ::-1])
    result = _axis_quaternions(axes[0], turns[:, 0])
    for axis, turn in zip(axes[1:], turns.T[1:], strict=True):
        result = quaternion_product(result, _axis_quaternions(axis, turn))
    return result


def _axis_quaternions(axis: str, angle: FloatArray) -> FloatArray:
    result = np.zeros((len(angle), 4))
    result[:, "xyz".index(axis)] = np.sin(0.5 * angle)
    result[:, 3] = np.cos(0.5 * angle)
    result[np.isnan(angle)] = np.nan
    return result


def _matrices_to_quaternions(r: FloatArray) -> FloatArray:
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
    )  # four times a component times the quaternion, one row per component
    sizes = np.array([candidates[k, k] for k in range(4)])
    best = np.where(np.isnan(sizes).any(axis=0), 0, np.argmax(sizes, axis=0))
    chosen: FloatArray = candidates[best, :, np.arange(len(r))]
    unit: FloatArray = chosen / np.linalg.norm(chosen, axis=1, keepdims=True)
    return unit


def to_matrices(quat_xyzw: FloatArray) -> FloatArray:
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


def rotation_angle(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angle of the rotation from one orientation to another, 0 to pi: 2 atan2(|v|, |w|).

    Args:
        first: Unit quaternions x, y, z, w [-], shape (n, 4).
        second: Likewise [-], shape (n, 4).

    Returns:
        In [rad], shape (n,).
    """
    between = quaternion_product(conjugate(first), second)
    angle: FloatArray = 2 * np.arctan2(np.linalg.norm(between[:, :3], axis=1), np.abs(between[:, 3]))
    return angle


def slerp(first: FloatArray, second: FloatArray, share: FloatArray) -> FloatArray:
    """Return orientations on the shorter great arc from one to another.

    (sin((1 - s) a) q1 + sin(s a) q2) / sin(a), with the angle a = 2 atan2(|q2 - q1|, |q2 + q1|) between the
    two as vectors, and the sign of q2 with which it is nearer to q1. At s = 0 and s = 1 the end is returned
    even if the other end is missing.

    Args:
        first: Unit quaternions x, y, z, w [-], shape (n, 4).
        second: Likewise [-], shape (n, 4).
        share: s, 0 to 1 [-], shape (n,).

    Returns:
        Shape (n, 4) [-]; NaN between two if one is missing.

    Source: Shoemake 1985, Animating rotation with quaternion curves.
    """
    cosine = np.einsum("ij,ij->i", first, second)
    near = second * np.where(cosine < 0.0, -1.0, 1.0)[:, np.newaxis]
    angle = 2 * np.arctan2(np.linalg.norm(near - first, axis=1), np.linalg.norm(near + first, axis=1))
    # sin(a s) / sin(a), which is s where a is 0
    weight, near_weight = (
        part * np.sinc(angle * part / np.pi) / np.sinc(angle / np.pi) for part in (1 - share, share)
    )
    between = weight[:, np.newaxis] * first + near_weight[:, np.newaxis] * near
    at_first, at_second = (share == 0.0)[:, np.newaxis], (share == 1.0)[:, np.newaxis]
    return np.where(at_first, first, np.where(at_second, second, between))


def quaternion_product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the product of quaternions x, y, z, w, shape (n, 4) [-]: second rotation first.

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


def to_rotation_vectors(quat_xyzw: FloatArray) -> FloatArray:
    """Return rotation vectors u a, 0 <= a <= pi, in [rad], shape (n, 3); NaN where a quaternion is NaN.

    With v = u sin(a / 2), w = cos(a / 2) of either sign: a = 2 atan2(|v|, |w|).

    Args:
        quat_xyzw: Unit quaternions x, y, z, w [-], shape (n, 4).
    """
    imaginary, real = quat_xyzw[:, :3], quat_xyzw[:, 3]
    angle = 2.0 * np.arctan2(np.linalg.norm(imaginary, axis=1), np.abs(real))
    scale = 2.0 / np.sinc(angle / (2.0 * np.pi))  # a / sin(a / 2)
    return np.asarray(imaginary * np.copysign(scale, real)[:, None])


def fit_rotation(crossed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rotation R with the maximum sum of a . R b, which brings points b closest to a.

    With U S V^T of H: R = U diag(1, 1, det(U V^T)) V^T. It is unique if the sum of the last two of the
    returned singular values is above 0.

    Args:
        crossed: H = sum(a b^T), in the product of their units, shape (..., 3, 3).

    Returns:
        R [-], shape (..., 3, 3), and s1, s2, det(U V^T) s3, whose sum is the maximum, shape (..., 3).

    Source: Kabsch 1976; Umeyama 1991, eq. 39-43, without scale.
    """
    u, sizes, vt = np.linalg.svd(crossed)
    signs = np.ones_like(sizes)
    signs[..., 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray(u * signs[..., np.newaxis, :] @ vt), np.asarray(sizes * signs)
