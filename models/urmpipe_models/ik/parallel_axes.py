"""Closed form of arms whose axes 2, 3 and 4 are parallel: the UR arms and similar ones.

1. `outer_joints` gives q1 and q5.
2. q6 and the angle phi by which axes 2, 3 and 4 turn together follow from the rotation (`_wrist`).
3. Joints 2 and 3 are an arm of two links in the plane across axis 2, which brings a point p4 of axis 4 to
   its place: elbow up and elbow down (`two_links`). q4 = phi - q2 - q3.

       G = exp(xi_1 q1) P exp(xi_5 q5) exp(xi_6 q6),   P = exp(xi_2 q2) exp(xi_3 q3) exp(xi_4 q4)

   with P a motion in the plane.
4. `ParallelAxes.solve` combines up to eight solutions and masks the second one of two that coincide.

Axes 2, 3, 4 that are not parallel to 1e-10 rad, as those of a UR arm whose kinematics were calibrated, have
no such form; `closed.NearClosedForm` solves them from that of the arm with its axes made parallel.

Near one family of singular poses, and near an aligned wrist of a stretched arm, every pose is met to 1e-10.
Within 1e-5 rad of both the stretched arm and the least distance of the wrist from axis 1, and within 1e-4 rad
if the wrist is aligned as well, the rounding of q1 can put a pose that is in reach out of it: it then has a
reason.

Source: [EliasWen2022]_ for the case; the steps are ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import (
    BoolArray,
    Element,
    FloatArray,
    TextArray,
    Vector,
    cross,
    dot,
    scale,
    subtract,
)
from urmpipe_models.errors import OptionError
from urmpipe_models.ik.outer_joints import (
    EDGE,
    REACH,
    OuterJoints,
    ParallelGeometry,
    branch_names,
    format_reasons,
    outer_joints,
    parallel_geometry,
)
from urmpipe_models.ik.solutions import SingularPoses, Solutions, Targets
from urmpipe_models.ik.trigonometric import wrap_angle
from urmpipe_models.kinematics.forward import Screws
from urmpipe_models.math3d import Transform, rotation_about

# [rad]; axis 6 nearer to parallel to axis 4 leaves q6 too uncertain for the reach of p4.
NEARLY_ALIGNED = 1e-5
DUPLICATE_TOLERANCE = 1e-9  # [rad]; solutions of a singular pose that differ by less in every joint are one
ELBOWS = ("elbow up", "elbow down")


def parallel_axes(screws: Screws, names: tuple[str, ...]) -> ParallelAxes | None:
    """Return the closed form of an arm of six revolute joints with axes 2, 3, 4 parallel; None of any other.

    Args:
        screws: The arm.
        names: Of its coordinates, for texts.
    """
    arm = parallel_geometry(screws)
    return None if arm is None else ParallelAxes(arm, names)


@dataclass(frozen=True, slots=True)
class ParallelAxes:
    """The inverse of an arm with three parallel axes: a `closed.ClosedForm` of up to eight solutions.

    The branches, where axes 5 and 6 meet: `right` | `left`, the side of axis 1 on which the wrist is, right
    being where axis 1 x axis 2 points; `elbow up` | `elbow down`, up being along axis 1 for an arm that
    reaches outwards; `not flipped` | `flipped`, by the sign of q5, counted from where axis 6 is nearest to
    axis 4. Where axes 5 and 6 are parallel, right is where axis 6 points along axis 1 x axis 2, wherever
    the wrist is, and the flips part at the ends of the wrist's way along axis 2. Where they pass
    each other `shoulder 1` to `shoulder 4` stand for the sides and flips: by the angle about axis 1 from
    the wrist to axis 2; where two of them meet and are lost, the others are renumbered. The
    names change with the senses in which joints count, not with their zeros, the base or the tool.

    Attributes:
        arm: Its geometry.
        names: Of its coordinates.
    """

    arm: ParallelGeometry
    names: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the closed form."""
        return "three parallel axes"

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the solutions, in their order."""
        sides, flips = branch_names(self.arm)
        return tuple(
            ", ".join(filter(None, (side, elbow, flip)))
            for side in sides
            for elbow in ELBOWS
            for flip in flips
        )

    def solve(self, targets: Targets, near: FloatArray | None = None) -> Solutions:
        """Return all solutions of all targets, joints in (-pi, pi], limits of the joints not considered.

        Args:
            targets: Poses.
            near: Joint values in [rad], shape (joints,) or (n, joints), value where a joint is free.
        """
        free_values = np.broadcast_to(
            np.atleast_2d(np.zeros(6) if near is None else near), (len(targets), 6)
        ).T
        with np.errstate(invalid="ignore", divide="ignore"):
            motion = self.arm.to_frame @ _pose(targets) @ self.arm.from_tip
            outer = outer_joints(self.arm, motion, free_values[0])
            wrist = _wrist(self.arm, outer, motion, free_values[5])
            links = two_links(self.arm, wrist.place, outer.side, free_values[1])
        q4 = wrist.phi - links.q2 - links.q3
        joints = np.broadcast_arrays(outer.q1, links.q2, links.q3, q4, outer.q5, wrist.q6)
        signs = np.array((1.0, *self.arm.signs, 1.0, 1.0))
        q = wrap_angle(_by_target(np.stack(joints, axis=-1)) * signs) + 0.0  # no -0.0
        reasons = _by_target(outer.reasons + links.reasons)
        families = [
            replace(poses, where=_by_target(np.broadcast_to(poses.where, q4.shape)))
            for poses in self._families(outer, wrist, links, near is None)
        ]
        _mask_duplicates(q, reasons, self.branches, [poses.where for poses in families])
        reached = np.asarray(np.isfinite(q).all(axis=2))
        q[~reached] = np.nan
        spread = (replace(poses, where=poses.where & reached) for poses in families)
        singular = tuple(poses for poses in spread if poses.where.any())
        return Solutions(q, self.branches, reasons, singular)

    def _families(
        self, outer: OuterJoints, wrist: _Wrist, links: _TwoLinks, at_zero: bool
    ) -> tuple[SingularPoses, ...]:
        """Return the families of singular poses, and what is free there."""
        q1, q2, q3, q4, _, q6 = self.names
        value = "= 0" if at_zero else "as near"
        flipped = f"{q6} {value}, and pi more for the flipped wrist, or the nearest value in reach"
        return (
            SingularPoses(
                "wrist on axis 1",
                outer.free,
                f"{q1}: any value",
                f"{q1} {value}, and pi more for the left arm",
            ),
            *outer.singular,
            SingularPoses(
                "wrist aligned",
                wrist.free,
                f"{q6}: any value in reach, and {q2}, {q3}, {q4} with it",
                flipped,
            ),
            SingularPoses("arm stretched", links.stretched),
            SingularPoses("arm withdrawn", links.withdrawn & ~links.free),
            SingularPoses("arm withdrawn", links.free, f"{q2}: any value", f"{q2} {value}"),
        )


class _Wrist(NamedTuple):
    """Joint 6 and the task of joints 2 to 4, each array of shape (a, b, n)."""

    q6: FloatArray  # [rad]
    phi: FloatArray  # [rad]; the angle by which axes 2, 3 and 4 turn together
    place: tuple[FloatArray, FloatArray]  # [m]; x and y of the goal of the point p4 of axis 4
    free: BoolArray  # where axis 6 is parallel to them, and q6 was chosen


def _wrist(arm: ParallelGeometry, outer: OuterJoints, motion: Transform, near: FloatArray) -> _Wrist:
    """Return q6 and the motion P in the plane that q1 and q5 leave.

    R6 takes R_M^T z to R5^T z with M = exp(-xi_1 q1) G. Where axis 6 is along z, both are along axis 6 and
    q6 is free: `near` (0, and pi where flipped, by default), or the value nearest to it with p4 in reach.
    Where it is nearly along z, rounding leaves q6 uncertain, and within that p4 is kept in reach too.
    """
    rest = _about_line(arm.k1, arm.p1, -outer.q1) @ motion
    turn5 = _about_line(arm.k5, arm.p5, outer.q5)
    # only the parts across axis 6 count; taken first, they keep their digits where they are small
    goal, now = _across(arm.k6, turn5.rotation[2]), _across(arm.k6, rest.rotation[2])
    q6 = np.arctan2(dot(arm.k6, cross(now, goal)), dot(now, goal))
    axis6 = rest.rotate(arm.k6)
    sine = np.broadcast_to(np.hypot(axis6[0], axis6[1]), q6.shape)
    p4 = turn5.inverse().point(arm.p4)
    free = sine <= REACH
    if (sine <= NEARLY_ALIGNED).any():
        wish = np.where(outer.flip, np.pi, 0.0)[:, None] + near
        wish = np.where(free, wish, q6)
        reaching = _in_reach(arm, rest, p4, wish)
        loose = (sine <= NEARLY_ALIGNED) & (sine * np.abs(reaching - wish) <= np.where(free, np.inf, REACH))
        q6 = np.where(loose, reaching, wish)
    turn6 = _about_line(arm.k6, arm.p6, -q6)
    x, y, _ = rest.rotate(turn6.rotate(turn5.rotation[0]))
    place = rest.point(turn6.point(p4))
    return _Wrist(q6, np.arctan2(y, x), (place[0], place[1]), free)


def _in_reach(arm: ParallelGeometry, rest: Transform, p4: Vector, wish: FloatArray) -> FloatArray:
    """Return the q6 nearest to `wish` at which the two links reach p4, of a wrist with axis 6 along z.

    p4 then runs on a circle: |o + u cos q6 + w sin q6|^2 = o^2 + u^2 + 2 o (u cos q6 + w sin q6).
    """
    lever = subtract(p4, arm.p6)
    across = _across(arm.k6, lever)
    o = rest.point(subtract(p4, across))[:2]
    u = rest.rotate(across)[:2]
    w = rest.rotate(cross(lever, arm.k6))[:2]
    a, b = (2.0 * (o[0] * v[0] + o[1] * v[1]) for v in (u, w))
    mean = o[0] ** 2 + o[1] ** 2 + u[0] ** 2 + u[1] ** 2
    swing, middle = np.hypot(a, b), np.arctan2(b, a)
    upper, fore = _link_lengths(arm)
    least, most = ((square - mean) / swing for square in ((upper - fore) ** 2, (upper + fore) ** 2))
    away = wrap_angle(wish - middle)
    cosine = np.cos(away)
    allowed = np.clip(cosine, least, most)
    moved = wish + np.copysign(np.arccos(np.clip(allowed, -1.0, 1.0)), away) - away
    return np.where((allowed == cosine) | (np.abs(allowed) > 1.0 + REACH), wish, moved)


class _TwoLinks(NamedTuple):
    """Joints 2 and 3 of both elbows, each of shape (2, a, b, n); their signs are those of z."""

    q2: FloatArray  # [rad]
    q3: FloatArray  # [rad]
    reasons: TextArray  # why there are none
    stretched: BoolArray  # where both elbows are one, the links stretched
    withdrawn: BoolArray  # the same, one link folded back on the other
    free: BoolArray  # where axis 4 is on axis 2, which leaves q2 free


def two_links(
    arm: ParallelGeometry, place: tuple[FloatArray, FloatArray], side: FloatArray, near: FloatArray
) -> _TwoLinks:
    """Return q2 and q3 that bring the point p4 to a place in the plane.

    With the links' lengths l2, l3, the distance r and the angle psi between the links
    tan^2(psi/2) = (l2 + l3 - r)(l2 + l3 + r) / ((r - |l2 - l3|)(r + |l2 - l3|)).

    Args:
        arm: The arm.
        place: Of p4 in the plane in [m], two arrays of the same shape (..., n).
        side: 1 or -1 [-]: the sign of the first elbow's bend, shape (..., n) or one that broadcasts to it.
        near: q2 where it is free, in [rad], shape (..., n) or one that broadcasts to it.
    """
    upper, fore = _link_lengths(arm)
    r = np.hypot(*place)
    short, long = abs(upper - fore), upper + fore
    stretched, withdrawn = long - r <= EDGE * arm.size, r - short <= EDGE * arm.size
    reached = (r <= long + REACH * arm.size) & (r >= short - REACH * arm.size)
    up = np.where(stretched, 0.0, (long - r) * (long + r))
    down = np.where(withdrawn, 0.0, (r - short) * (r + short))
    psi = 2.0 * np.arctan2(np.sqrt(np.maximum(up, 0.0)), np.sqrt(np.maximum(down, 0.0)))
    psi = np.where(reached, np.stack((-side * psi, side * psi)), np.nan)
    first = float(np.arctan2(arm.p3[1], arm.p3[0]))
    second = float(np.arctan2(arm.p4[1] - arm.p3[1], arm.p4[0] - arm.p3[0]))
    free = reached & (r <= REACH * arm.size)
    to_place = np.arctan2(place[1], place[0])
    bend = np.arctan2(fore * np.sin(psi), upper + fore * np.cos(psi))
    q2 = np.where(free, near, to_place - first - bend)
    reasons = format_reasons(
        ~reached & np.isfinite(r),
        "axis 4 is {} m from axis 2, allowed: {} to {} m",
        r,
        short,
        long,
    )
    return _TwoLinks(
        q2 + np.zeros_like(psi),
        psi - (second - first),
        np.broadcast_to(reasons, psi.shape),
        stretched & reached,
        withdrawn & reached,
        free,
    )


def _link_lengths(arm: ParallelGeometry) -> tuple[float, float]:
    """Return the lengths of the links from axis 2 to axis 3 and on to axis 4, in [m]."""
    return (
        float(np.hypot(arm.p3[0], arm.p3[1])),
        float(np.hypot(arm.p4[0] - arm.p3[0], arm.p4[1] - arm.p3[1])),
    )


def _mask_duplicates(
    q: FloatArray, reasons: TextArray, branches: tuple[str, ...], where: list[BoolArray]
) -> None:
    """Mask the second of two equal solutions of a singular pose, as of a stretched elbow, with the reason.

    `q`, shape (n, k, 6), and `reasons`, shape (n, k), are written; `where`, each of shape (n, k), are the
    families of singular poses.
    """
    rows = np.flatnonzero(np.any(where, axis=0).any(axis=1))
    for first, second in combinations(range(len(branches)), 2) if len(rows) else ():
        same = np.abs(wrap_angle(q[rows, first] - q[rows, second])).max(axis=1) < DUPLICATE_TOLERANCE
        q[rows[same], second] = np.nan
        reasons[rows[same], second] = f"the same as {branches[first]}: both meet here"


def _pose(targets: Targets) -> Transform:
    """Return the targets as one transform, one array per entry."""
    if targets.rotation is None:
        raise OptionError("three parallel axes: found positions with any orientation, allowed: poses")
    x, y, z = (tuple(np.ascontiguousarray(row)) for row in targets.rotation.transpose(1, 2, 0))
    return Transform((x, y, z), tuple(np.ascontiguousarray(targets.position.T)))


def _about_line(k: Vector, p: Vector, angle: Element) -> Transform:
    """Return the rotation by an angle about the line along k through p."""
    turn = rotation_about(k, angle)
    return Transform(turn.rotation, subtract(p, turn.rotate(p)))


def _across(k: Vector, v: Vector) -> Vector:
    """Return v - k (k . v)."""
    return subtract(v, scale(dot(k, v), k))


def _by_target(values: NDArray[Any]) -> NDArray[Any]:
    """Return values of shape (2 elbows, a, b, n, ...) as (n, k, ...), by q1, then by elbow, then by q5."""
    elbows, first, second, count, *rest = values.shape
    ordered = values.transpose(3, 1, 0, 2, *range(4, values.ndim))
    return ordered.reshape(count, first * elbows * second, *rest)
