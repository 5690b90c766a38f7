"""Joints 1 to 3 of an arm with a spherical wrist: all postures that bring the wrist centre to a point.

The two equations A1 u1 + b1(w) = A3 u3 + b3 of `loop_equations` are solved by the geometry of the arm:

1. Axes 2 and 3 meet or are parallel: A3 has rank 1, and a combination of both equations holds joint 1 alone
   (the shoulder: right, left); the other one then gives joint 3 (the elbow: down, up). Axes 1 and 2 meet or
   are parallel: the same, joint 3 first. Each joint has up to two roots (`PositionArm.solve`).
2. Otherwise one joint is eliminated, and a quadric of up to four roots is left (`_quartic_roots`), the
   quartic of [Pieper1968]_: posture 1 to 4.
3. Joint 2 follows from both. Where axes meet or are parallel only up to rounding (`RANK_TOLERANCE`), the
   joints are refined by Newton's rule.
4. Of postures that coincide the later one is masked, with the reason (`mask_coincident`, `mask_duplicates`).

`PositionArm.branches` defines right, left, elbow up and elbow down.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray
from urmpipe_models.ik.loop_equations import (
    LoopEquations,
    ReachReasons,
    Track,
    WristView,
    jacobian_determinant,
    loop_equations,
    refine_joints,
)
from urmpipe_models.ik.solutions import SingularFamily
from urmpipe_models.ik.trigonometric import (
    ON_AXIS,
    Roots,
    angle_about,
    circle_roots,
    is_linear,
    parabola_roots,
    quadric_roots,
    wrap_angle,
)
from urmpipe_models.kinematics.forward import Screws

# Axes count as meeting or as parallel where that changes a loop equation by this, relative to the others. The
# joints are then refined until the wrist is at its target. Only where axes are off by 1e-8 to 1e-6 a posture
# next to a fold may be lost by this.
RANK_TOLERANCE = 1e-6
EXACT_TOLERANCE = 1e-14  # up to this the loop equations hold exactly, and there is nothing to refine
MAX_RESIDUAL = 2e-11  # of the arm's size; refined joints that leave the wrist centre off by more are dropped
DUPLICATE_TOLERANCE = 1e-5  # [rad] or of the arm's size; refined postures that differ by less are one
# A prismatic joint beyond 1000 arm's sizes is a root at infinity, moved by rounding.
MIN_HALF_ANGLE_COSINE = 1e-3

Order = Literal["first", "third", "both"]
Meeting: TypeAlias = dict[SingularFamily, BoolArray]  # where two postures are one, shape (k, n), by family


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """Joints 1 to 3 of n targets in k postures.

    Attributes:
        q: In [rad] or [m], shape (3, k, n); NaN where there is none.
        reasons: Why there is none, shape (k, n).
        meeting: Where two postures are one, shape (k, n), by the family of such poses.
        on_axis: Where the wrist centre lies on axis 1 and on axis 2, each of shape (k, n).
    """

    q: FloatArray
    reasons: TextArray
    meeting: Meeting
    on_axis: tuple[BoolArray, BoolArray]


def position_arm(screws: Screws, wrist: FloatArray) -> PositionArm | None:
    """Return the first three joints of an arm, ready to be solved for the wrist centre.

    Args:
        screws: Of the arm; the first three of any kind.
        wrist: The wrist centre at q = 0 in [m], shape (3,).

    Returns:
        None if these joints cannot move the wrist centre through a volume.
    """
    size = screws.size
    scaled = replace(screws, point=screws.point / size, position=screws.position / size)
    wrist = wrist / size
    samples = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, 32))
    if np.abs(jacobian_determinant(scaled, wrist, samples)).max() <= 1e-9:
        return None
    equations = loop_equations(scaled, wrist)
    orders: tuple[tuple[Order, Track], ...] = (("first", equations.third), ("third", equations.first))
    for order, track in orders:
        vectors, sizes, _ = np.linalg.svd(track.coefficients)
        if sizes[1] <= RANK_TOLERANCE * sizes[0]:
            single, other = _oriented(vectors[:, 1])
            exact = bool(sizes[1] <= EXACT_TOLERANCE * sizes[0])
            return PositionArm(scaled, wrist, size, equations, order, single, other, exact)
    return PositionArm(scaled, wrist, size, equations, "both")


def _oriented(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a combination of the two equations and the one across it, with defined signs.

    The sign is that of the second equation, which no choice of a point on axis 2 can change.
    """
    single = np.where(np.abs(vector) <= EXACT_TOLERANCE, 0.0, vector)
    lead = single[1] if abs(single[1]) > RANK_TOLERANCE else single[0]
    single = single * np.sign(lead)
    other = (
        np.array([single[1], -single[0]])
        if abs(single[1]) > RANK_TOLERANCE
        else np.array([-single[1], single[0]])
    )
    return single, other


@dataclass(frozen=True, slots=True, eq=False)
class PositionArm:
    """The first three joints of an arm, ready to be solved; see the head of this module.

    Attributes:
        screws: Of the arm, in units of its size.
        wrist: The wrist centre at q = 0, in the same units, shape (3,).
        size: In [m].
        equations: Its loop equations.
        order: Which joint is solved first.
        single: The combination of the equations that holds this joint alone [-], shape (2,).
        other: The one across it [-], shape (2,).
        exact: Whether `single` holds it alone exactly, or only up to `RANK_TOLERANCE`.

    Source: [Pieper1968]_.
    """

    screws: Screws
    wrist: FloatArray
    size: float
    equations: LoopEquations
    order: Order
    single: FloatArray = field(default_factory=lambda: np.array([1.0, 0.0]))
    other: FloatArray = field(default_factory=lambda: np.array([0.0, 1.0]))
    exact: bool = False

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the postures, in their order.

        right and left: at the right one the equation of joint 1 rises with q1. Where axes 2 and 3 are
        parallel, or axes 1 and 2 meet, this is the side of axis 1 that the wrist lies on, along k1 x k2.
        elbow down and elbow up, of the right arm: the distance of the wrist from axis 2 decreases or
        increases as joint 3 turns in the sense of joint 2; of the left arm the other way round. So an elbow
        above the line from axis 2 to the wrist, seen along k1, is up on both sides of axis 1 and for either
        sense of axis 2, as long as the wrist is farther out than axis 2. A joint with a single root has no
        word.

        The postures of an arm without such an order are numbered by q3, from the pose where the wrist is
        farthest from axis 2: such arms can change from one to another without passing a singular pose, so
        that no name would last.
        """
        if self.order == "both":
            return "posture 1", "posture 2", "posture 3", "posture 4"
        sides, elbows = self._counts
        if sides == 1:
            return ("",) if elbows == 1 else ("elbow down", "elbow up")
        if elbows == 1:
            return "right", "left"
        return "right, elbow down", "right, elbow up", "left, elbow up", "left, elbow down"

    @property
    def _counts(self) -> list[int]:
        """Numbers of roots of joint 1 and joint 3."""
        first, third = self._combinations
        return [
            1 if not track.revolute and is_linear(share @ track.coefficients) else 2
            for track, share in ((self.equations.first, first), (self.equations.third, third))
        ]

    @property
    def _combinations(self) -> tuple[FloatArray, FloatArray]:
        """The combinations of both equations that joint 1 and joint 3 are solved from."""
        return (self.single, self.other) if self.order == "first" else (self.other, self.single)

    def solve(self, position: FloatArray, near: FloatArray | None = None) -> Postures:
        """Return all postures that bring the wrist centre to a position.

        Args:
            position: In [m], shape (3, n).
            near: q1 to q3 in [rad] or [m], shape (3, n), for a joint that the pose leaves free; 0 (and pi
                for q1 of the left arm) without it.
        """
        target = position / self.size
        view = self.equations.view_from_joint1(target)
        if self.order == "both":
            u1, u3 = _quartic_roots(self.equations, view)
            reasons: TextArray = np.full(u3[0].shape, "", dtype=np.object_)
            ReachReasons(self.equations, self.size).write_position(reasons, np.isnan(u3[0]), view)
            meeting: Meeting = {}
        else:
            u1, u3, reasons, meeting = self._solve_in_order(view)
        q, on_axis = self._joints(view, u1, u3, near)
        if not self.exact:
            q = self._refined(q, target, reasons)
            mask_duplicates(q, self.screws.revolute[:3], self.size, self.branches, reasons, meeting)
        exists = np.isfinite(q).all(axis=0)
        meeting = {family: where & exists for family, where in meeting.items()}
        return Postures(q, reasons, meeting, (on_axis[0] & exists, on_axis[1] & exists))

    def _solve_in_order(self, view: WristView) -> tuple[FloatArray, FloatArray, TextArray, Meeting]:
        """Return u1, u3, shape (2, k, n), one joint after the other, reasons and where postures coincide."""
        equations, (first, third) = self.equations, self._combinations
        a1, a3 = equations.first.coefficients, equations.third.coefficients
        offset = equations.constant[:, None] - view.constant
        if self.order == "first":
            roots1 = _roots(equations.first, first @ a1, first @ offset, view.radius)
            rest = np.tensordot(third, np.tensordot(a1, roots1.u, 1) - offset[:, None], 1)
            roots3 = _roots(equations.third, third @ a3, rest, equations.radius)
            u1, u3 = roots1.u[:, :, None], roots3.u.swapaxes(1, 2)
            meet1, meet3 = roots1.coincide[None, None], roots3.coincide[:, None]
        else:
            roots3 = _roots(equations.third, third @ a3, -(third @ offset), equations.radius)
            rest = np.tensordot(first, np.tensordot(a3, roots3.u, 1) + offset[:, None], 1)
            roots1 = _roots(equations.first, first @ a1, rest, view.radius)
            u1, u3 = roots1.u, roots3.u[:, None]
            meet1, meet3 = roots1.coincide[None], roots3.coincide[None, None]
        if equations.axis @ equations.third.axis < -RANK_TOLERANCE:
            u1, u3, meet1 = u1[:, :, ::-1], u3[:, :, ::-1], meet1[:, ::-1]
        u1, u3 = np.broadcast_arrays(u1, u3)
        reasons = self._reasons(view, u1, u3)
        u1, u3, meeting = self._mask_coincident(u1.copy(), u3.copy(), meet1, meet3, reasons)
        shape = (u1.shape[1] * u1.shape[2], u1.shape[3])
        meeting = {family: where.reshape(shape) for family, where in meeting.items()}
        return u1.reshape(2, *shape), u3.reshape(2, *shape), reasons.reshape(shape), meeting

    def _reasons(self, view: WristView, u1: FloatArray, u3: FloatArray) -> TextArray:
        """Return why there is no u1 or no u3, shape (sides, elbows, n), by the joint that is solved first."""
        equations, (first, third) = self.equations, self._combinations
        reach = ReachReasons(equations, self.size)
        a1, a3 = equations.first.coefficients, equations.third.coefficients
        offset = equations.constant[:, None] - view.constant
        none1, none3 = np.isnan(u1[0]), np.isnan(u3[0])
        reasons: TextArray = np.full(none1.shape, "", dtype=np.object_)
        if self.order == "first":
            at = np.where(none1, 0.0, u1)
            rest = np.tensordot(third, np.tensordot(a1, at, 1) - offset[:, None, None], 1)
            reach.write_elbow(reasons, none3 & ~none1, third, rest)
            reach.write_side(reasons, none1, view, first @ a1, np.broadcast_to(first @ offset, none1.shape))
        else:
            at = np.where(none3, 0.0, u3)
            rest = np.tensordot(first, np.tensordot(a3, at, 1) + offset[:, None, None], 1)
            reach.write_side(reasons, none1 & ~none3, view, first @ a1, rest)
            reach.write_elbow(reasons, none3, third, np.broadcast_to(-(third @ offset), none3.shape))
        return reasons

    def _mask_coincident(
        self, u1: FloatArray, u3: FloatArray, meet1: BoolArray, meet3: BoolArray, reasons: TextArray
    ) -> tuple[FloatArray, FloatArray, Meeting]:
        """Return u1 and u3 with NaN in the later one of two equal postures, and where they coincide."""
        shape = u1.shape[1:]
        meet1, meet3 = np.broadcast_to(meet1, shape), np.broadcast_to(meet3, shape)
        names = np.array(self.branches, dtype=np.object_).reshape(shape[:2])
        meeting: Meeting = {}
        if meet3.any():
            meeting = self._elbow_families(u3, meet3)
            mask_coincident(u1, u3, reasons, meet3, names, 1)
        if meet1.any():
            first, _ = self._combinations
            sideways = abs(first[1]) <= RANK_TOLERANCE  # the way along axis 2 alone decides
            family: SingularFamily = "postures meet"
            if sideways and self.equations.revolute:
                family = "wrist beside axis 1"  # plain: ok
            meeting[family] = meet1 | meeting.get(family, np.zeros(shape, dtype=bool))
            mask_coincident(u1, u3, reasons, meet1, names, 0)
        return u1, u3, meeting

    def _elbow_families(self, u3: FloatArray, meet: BoolArray) -> Meeting:
        """Return the families of poses where both roots of joint 3 are one."""
        _, third = self._combinations
        if abs(third[0]) > RANK_TOLERANCE:  # the equation of joint 3 is not a distance alone
            return {"postures meet": meet}
        far = np.tensordot(third @ self.equations.third.coefficients, u3, 1) > 0.0
        return {"arm stretched": meet & far, "arm withdrawn": meet & ~far}

    def _joints(
        self, view: WristView, u1: FloatArray, u3: FloatArray, near: FloatArray | None
    ) -> tuple[FloatArray, tuple[BoolArray, BoolArray]]:
        """Return q1 to q3, shape (3, k, n), of u1 and u3, and where the wrist is on axes 1 and 2."""
        equations, chosen = self.equations, near
        if chosen is None:
            chosen = np.zeros((3, u1.shape[2]))
        x = np.tensordot(equations.first.directions, u1, 1) + view.start[:, None]
        y = np.tensordot(equations.third.directions, u3, 1) + equations.start[:, None, None]
        on_first = np.zeros(u1.shape[1:], dtype=bool)
        on_second = on_first.copy()
        if equations.first.revolute:
            on_first |= view.radius <= ON_AXIS
            opposite = np.array([np.pi if name.startswith("left") else 0.0 for name in self.branches])
            regular = wrap_angle(view.zero - np.arctan2(u1[1], u1[0]))
            q1 = np.where(on_first & np.isfinite(u1[0]), wrap_angle(chosen[0] + opposite[:, None]), regular)
        else:
            q1 = (view.zero + u1[0]) * self.size
        if equations.revolute:
            along = np.tensordot(equations.axis, x, 1)
            across = x - equations.axis[:, None, None] * along
            on_second |= (across * across).sum(axis=0) <= ON_AXIS**2
            regular = angle_about(equations.axis, y, x)
            q2 = np.where(on_second, wrap_angle(np.broadcast_to(chosen[1], regular.shape)), regular)
        else:
            q2 = np.tensordot(equations.axis, x - y, 1) * self.size
        q3 = (
            wrap_angle(np.arctan2(u3[1], u3[0]))
            if equations.third.revolute
            else (u3[0] + equations.shift) * self.size
        )
        return np.stack((q1, q2, q3)), (on_first, on_second)

    def _refined(self, q: FloatArray, target: FloatArray, reasons: TextArray) -> FloatArray:
        """Return q refined, and reasons for what then still misses the target."""
        unit = np.where(self.screws.revolute[:3], 1.0, self.size)[:, None, None]
        exists = np.isfinite(q).all(axis=0)
        aim = np.broadcast_to(target[:, None], q.shape)
        better, residual = refine_joints(self.screws, self.wrist, np.where(exists, q / unit, 0.0), aim)
        missed = exists & ~(residual <= MAX_RESIDUAL)
        for where in np.argwhere(missed):
            distance = residual[tuple(where)] * self.size
            reasons[tuple(where)] = (
                f"joints 1 to 3 leave the wrist centre off by {distance:.3g} m at best,"
                f" allowed: {MAX_RESIDUAL * self.size:.3g} m"
            )
        scaled = np.where(self.screws.revolute[:3, None, None], wrap_angle(better), better * unit)
        return np.where(exists & ~missed, scaled, np.nan)


def _roots(track: Track, alpha: FloatArray, beta: FloatArray, radius: FloatArray | float) -> Roots:
    """Return the points of a joint's track with alpha . u = beta."""
    return circle_roots(alpha, beta, radius) if track.revolute else parabola_roots(alpha, beta)


def mask_duplicates(
    q: FloatArray,
    revolute: BoolArray,
    size: float,
    branches: tuple[str, ...],
    reasons: TextArray,
    meeting: Meeting,
) -> None:
    """Mask every posture that equals an earlier one by NaN, with the reason and the family.

    Args:
        q: Joints 1 to 3 in [rad] or [m], shape (3, k, n); written.
        revolute: Which of them are revolute, shape (3,).
        size: Of the arm in [m].
        branches: Names of the postures.
        reasons: Shape (k, n); written.
        meeting: Where postures coincide, by family, shape (k, n); written.
    """
    meet = np.zeros(q.shape[1:], dtype=bool)
    for first, second in combinations(range(q.shape[1]), 2):
        difference = q[:, first] - q[:, second]
        difference = np.where(revolute[:, None], wrap_angle(difference), difference / size)
        same = np.abs(difference).max(axis=0) < DUPLICATE_TOLERANCE
        meet[first] |= same
        q[:, second, same] = np.nan
        reasons[second, same] = f"the same as {branches[first]}: both meet here"
    if meet.any():
        meeting["postures meet"] = meet | meeting.get("postures meet", False)


def mask_coincident(
    u1: FloatArray, u3: FloatArray, reasons: TextArray, meet: BoolArray, names: TextArray, axis: int
) -> None:
    """Mask the second one of two coincident postures by NaN, with the reason.

    Args:
        u1: In units of the arm's size, shape (2, sides, elbows, n); written.
        u3: In the same unit and shape; written.
        reasons: Shape (sides, elbows, n); written.
        meet: Where both are one, of the shape of reasons.
        names: Of the postures, shape (sides, elbows).
        axis: Which two: 0 both sides, 1 both elbows.
    """
    first: tuple[slice | int, ...] = (slice(None), 0) if axis == 1 else (0,)
    second: tuple[slice | int, ...] = (slice(None), 1) if axis == 1 else (1,)
    for u in (u1, u3):
        u[(slice(None), *second)][:, meet[second]] = np.nan
    same = np.array([f"the same as {name}: both meet here" for name in names[first]])
    where = meet[second] & (reasons[second] == "")
    reasons[second] = np.where(where, same[:, None], reasons[second])


def _quartic_roots(equations: LoopEquations, view: WristView) -> tuple[FloatArray, FloatArray]:
    """Return u1 and u3 of A1 u1 + b1 = A3 u3 + b3, both on their tracks.

    The equations give one of the two as v = G u + g of the other, which put into |v|^2 = radius^2 (or v[1] =
    v[0]^2 of a prismatic joint) leaves a quadric in the cosine and the sine of the other joint, or a quartic
    in its length. The one that is eliminated has the better conditioned matrix: an arm two of whose axes
    almost meet or almost are parallel loses no digit then.

    Returns:
        u1 and u3 in units of the arm's size, shape (2, 4, n), by rising q3 from where the second equation is
        largest; NaN where there is none.
    """
    first, third = equations.first, equations.third
    offset = equations.constant[:, None] - view.constant
    radius = np.full_like(view.radius, equations.radius)
    if np.linalg.cond(first.coefficients) <= np.linalg.cond(third.coefficients):
        u1, u3 = _eliminate(first, view.radius, third, radius, offset)
    else:
        u3, u1 = _eliminate(third, radius, first, view.radius, -offset)
    from_largest = np.asarray(u3[0])
    if third.revolute:
        largest = float(np.arctan2(third.coefficients[1, 1], third.coefficients[1, 0]))
        from_largest = wrap_angle(np.arctan2(u3[1], u3[0]) - largest)
    order = np.argsort(from_largest, axis=0)[None]  # NaN last
    return np.take_along_axis(u1, order, axis=1), np.take_along_axis(u3, order, axis=1)


def _eliminate(
    eliminated: Track, eliminated_radius: FloatArray, other: Track, radius: FloatArray, offset: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return v and u of A v = B u + offset, v on the track of the eliminated joint, u on the other's."""
    inverse = np.linalg.inv(eliminated.coefficients)
    matrix, g = inverse @ other.coefficients, inverse @ offset
    a, b, c, d, e, f = _conic(matrix, g, eliminated_radius, eliminated.revolute)
    if other.revolute:
        square = radius * radius
        x = quadric_roots((a * square, b * square, c * square, d * radius, e * radius, f))
        is_point = (radius <= ON_AXIS) & (np.abs(f) <= ON_AXIS)  # any angle: one is enough
        x = np.where(is_point, np.array([0.0, np.nan, np.nan, np.nan])[:, None], x)
        u = radius * np.stack((np.cos(x), np.sin(x)))
    else:
        x = quadric_roots(_in_half_angle((c, b, a + e, d, f)))
        t = np.where(np.abs(np.cos(x / 2)) > MIN_HALF_ANGLE_COSINE, np.tan(x / 2), np.nan)
        u = np.stack((t, t * t))
    return np.asarray(np.tensordot(matrix, u, 1) + g[:, None]), u


def _conic(m: FloatArray, g: FloatArray, radius: FloatArray, revolute: bool) -> tuple[FloatArray, ...]:
    """Return A to F of A x^2 + B x y + C y^2 + D x + E y + F = 0: M (x, y) + g is on a circle or parabola."""
    if revolute:
        (a, b), (_, c) = m.T @ m
        (d, e), f = 2.0 * m.T @ g, (g * g).sum(axis=0) - radius**2
    else:
        a, b, c = -(m[0, 0] ** 2), -m[0, 0] * m[0, 1], -(m[0, 1] ** 2)
        (d, e), f = m[1][:, None] - 2.0 * m[0][:, None] * g[0], g[1] - g[0] ** 2
    return tuple(np.broadcast_to(coefficient, f.shape) for coefficient in (a, 2.0 * b, c, d, e, f))


def _in_half_angle(quartic: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
    """Return the quadric's A to F in the angle x of a quartic in t = tan(x / 2), highest power first."""
    p4, p3, p2, p1, p0 = quartic
    a = (p0 + p4) / 2
    return a, (p1 - p3) / 4, (p2 + 2.0 * a) / 4, (p0 - p4) / 2, (p1 + p3) / 4, np.zeros_like(a)
