"""Closed form of arms whose last three joints are revolute and meet in one point, the wrist centre.

1. `spherical_wrist` recognises such an arm by its screws.
2. The tool's pose gives the wrist centre, this joints 1 to 3 in up to four postures: right or left, elbow up
   or down (`shoulder_elbow.PositionArm`).
3. The remaining rotation gives joints 4 to 6, R4 R5 R6 = Q, in up to two: not flipped, flipped (`Wrist`).
4. Both are combined to up to eight branches, such as "right, elbow up, flipped" (`SphericalWrist`); where
   they lie in singular poses, the families say what is free and what was chosen.

Sources: [Pieper1968]_, [Serial6dof2019]_ section 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray, map_blocks, row_blocks
from urmpipe_models.ik.shoulder_elbow import PositionArm, Postures, position_arm
from urmpipe_models.ik.solutions import (
    SingularFamily,
    SingularPoses,
    Solutions,
    Targets,
    concatenate_solutions,
)
from urmpipe_models.ik.trigonometric import BOUNDARY, MEETING, angle_about, angle_between, wrap_angle
from urmpipe_models.kinematics.forward import Screws
from urmpipe_models.math3d import rotation_about

# Axes 4 to 6 meet in one point if none passes it by more than this, in units of the arm's size. The tool is
# then off by no more: 1e-11 of an arm of some metres is below the 1e-10 m of closed forms. An arm whose
# description is rounded more coarsely has this closed form nearly (`closed.NearClosedForm`).
MEETING_TOLERANCE = 1e-11
MIN_TILT_SINE = 1e-6  # of the angles between axes 4 and 5, and 5 and 6
# Axes 4 and 6 at a smaller angle than this, in [rad], count as one line. The choice made there turns the
# tool by less than this; beyond it the angles are accurate to rounding, as each is computed from those
# before it.
ALIGNED_TOLERANCE = 1e-11
DUPLICATE_TOLERANCE = 1e-5  # [rad]; flips that differ by less in every joint are one
BATCH_SIZE = 5000  # targets at a time: NumPy outweighs Python, and the arrays stay in a core's cache
FLIPS = "not flipped", "flipped"


def spherical_wrist(screws: Screws, names: tuple[str, ...]) -> SphericalWrist | None:
    """Return the closed form of an arm with a spherical wrist, recognised by its screws.

    Args:
        screws: Of the arm.
        names: Of its coordinates, for texts.

    Returns:
        None unless the arm has six joints, the last three are revolute, meet in one point
        (`MEETING_TOLERANCE`), neighbours among them at an angle (`MIN_TILT_SINE`), and the first three move
        that point through a volume. These may be of any kind: revolute or prismatic, in any order and at
        any angles and offsets.
    """
    if len(screws.revolute) != 6 or not screws.revolute[3:].all():
        return None
    axes = screws.direction[3:]
    sines = (np.linalg.norm(np.cross(axes[0], axes[1])), np.linalg.norm(np.cross(axes[1], axes[2])))
    if min(sines) <= MIN_TILT_SINE:
        return None
    centre = meeting_point(axes, screws.point[3:])
    distance = np.linalg.norm(np.cross(centre - screws.point[3:], axes), axis=1)
    if distance.max() > MEETING_TOLERANCE * screws.size:
        return None
    arm = position_arm(screws, centre)
    return None if arm is None else SphericalWrist(arm, Wrist(axes), screws, centre, names)


def meeting_point(axes: FloatArray, points: FloatArray) -> FloatArray:
    """Return the point nearest to lines, in their unit, shape (3,): the least squares of its distances.

    Args:
        axes: Unit vectors [-], shape (k, 3).
        points: Of the lines, in any unit, shape (k, 3).
    """
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    return np.asarray(np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, points)))


@dataclass(frozen=True, slots=True, eq=False)
class SphericalWrist:
    """The inverse of an arm with a spherical wrist: up to eight solutions.

    Their names, such as "right, elbow up, flipped", are those of `PositionArm.branches`, and "flipped"
    where the sine of the wrist's angle, k5 . (k4 x k6), is negative. They change with the senses in which
    joints count, not with their names and zeros, the base or the tool.

    Attributes:
        arm: Its first three joints.
        wrist: Its last three joints.
        screws: Of the arm.
        centre: The wrist centre at q = 0 in [m], shape (3,).
        names: Of its coordinates.

    Source: [Pieper1968]_, [Serial6dof2019]_ section 4.
    """

    arm: PositionArm
    wrist: Wrist
    screws: Screws
    centre: FloatArray
    names: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the closed form."""
        return "spherical wrist"

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the solutions, in their order."""
        return tuple(", ".join(filter(None, (arm, flip))) for arm in self.arm.branches for flip in FLIPS)

    def solve(self, targets: Targets, near: FloatArray | None = None) -> Solutions:
        """Return all solutions of all targets, joints in (-pi, pi], limits of the joints not considered.

        Of two solutions that are one, such as both elbows of a stretched arm, the second one is NaN and its
        reason names the first.

        Args:
            targets: Poses.
            near: Joint values in [rad] or [m], shape (joints,) or (n, joints): a joint that a singular pose
                leaves free takes its value from here; by default that of `SingularPoses.chosen`.

        Raises:
            ValueError: If the targets are positions alone.
        """
        if targets.rotation is None:
            raise ValueError("targets without orientation; allowed: poses")
        count = len(targets)
        free_values = None if near is None else np.broadcast_to(near, (count, 6))
        if count <= BATCH_SIZE:
            return self._solve_batch(targets.position, targets.rotation, free_values)
        positions, rotations = targets.position, targets.rotation

        def work(rows: slice) -> Solutions:
            chosen = None if free_values is None else free_values[rows]
            return self._solve_batch(positions[rows], rotations[rows], chosen)

        return concatenate_solutions(map_blocks(work, row_blocks(count, BATCH_SIZE)))

    def _solve_batch(
        self, positions: FloatArray, rotations: FloatArray, near: FloatArray | None
    ) -> Solutions:
        chosen = None if near is None else near.T
        rotation = rotations @ self.screws.rotation.T
        with np.errstate(invalid="ignore", over="ignore"):
            position = positions.T + np.einsum("nij,j->in", rotation, self.centre - self.screws.position)
            postures = self.arm.solve(position, None if chosen is None else chosen[:3])
            angles = self._wrist_angles(rotation, postures.q, None if chosen is None else chosen[3])
        return self._combine(postures, angles, chosen is not None)

    def _wrist_angles(self, rotation: FloatArray, q: FloatArray, near: FloatArray | None) -> _WristAngles:
        """Return joints 4 to 6 of every posture, shape (3, 2, k * n)."""
        vectors = [tuple((rotation @ axis).T) for axis in (self.wrist.axes[2], self.wrist.across_tool)]
        for joint in np.flatnonzero(self.screws.revolute[:3]):
            turn = rotation_about(self.screws.direction[joint].tolist(), -q[joint])
            vectors = [turn.rotate(vector) for vector in vectors]
        tool_axis, across = (
            np.stack([np.broadcast_to(part, q.shape[1:]) for part in vector]).reshape(3, -1)
            for vector in vectors
        )
        free = np.zeros(q.shape[1:]) if near is None else np.broadcast_to(near, q.shape[1:])
        return self.wrist.solve(tool_axis, across, free.reshape(-1))

    def _combine(self, postures: Postures, angles: _WristAngles, near: bool) -> Solutions:
        k, n = postures.reasons.shape
        last = angles.q.reshape(3, 2, k, n)
        both = np.asarray(np.isfinite(last).all(axis=0) & np.isfinite(postures.q).all(axis=0))
        exists = both.transpose(2, 1, 0)
        joints = np.empty((n, k, 2, 6))
        joints[..., :3] = postures.q.transpose(2, 1, 0)[:, :, None]
        joints[..., 3:] = last.transpose(3, 2, 1, 0)
        joints[~exists] = np.nan
        joints += 0.0  # no -0.0
        q, reached = joints.reshape(n, 2 * k, 6), exists.reshape(n, 2 * k)
        reasons = self._reasons(postures, angles, reached)
        return Solutions(q, self.branches, reasons, tuple(self._singular(postures, angles, reached, near)))

    def _reasons(self, postures: Postures, angles: _WristAngles, reached: BoolArray) -> TextArray:
        """Return why there is no solution, shape (n, 2 k)."""
        reasons = np.repeat(postures.reasons.T, 2, axis=1)
        angle, meet = (values.reshape(postures.reasons.shape) for values in (angles.angle, angles.meet))
        allowed = f"allowed: {self.wrist.min_angle:.6f} to {self.wrist.max_angle:.6f} rad"
        for row, slot in np.argwhere(~reached & (reasons == "")).tolist():
            posture = slot // 2, row
            if meet[posture]:
                reasons[row, slot] = f"the same as {self.branches[slot - 1]}: both meet here"
            elif np.isfinite(angle[posture]):
                reasons[row, slot] = (
                    f"axis 6 must stand at {angle[posture]:.6f} rad to axis 4, {allowed}"  # plain: ok
                )
            else:
                reasons[row, slot] = "the target is not finite, allowed: finite numbers"
        return reasons

    def _singular(
        self, postures: Postures, angles: _WristAngles, reached: BoolArray, near: bool
    ) -> list[SingularPoses]:
        """Return the families that solutions lie in, with what is free there and what was chosen."""
        q1, q2, _, q4, _, q6 = self.names
        shape = postures.reasons.shape
        value = "as near" if near else "= 0"
        left = ", and pi more for the left arm" if "left" in " ".join(self.arm.branches) else ""
        families: list[tuple[SingularFamily, BoolArray, str, str]] = [
            ("wrist on axis 1", postures.on_axis[0], f"{q1}: any value", f"{q1} {value}{left}"),
            ("wrist on axis 2", postures.on_axis[1], f"{q2}: any value", f"{q2} {value}"),
        ]
        flip = ", and pi more for the flipped wrist"
        for where, what in ((angles.along, "sum"), (angles.against, "difference")):
            free = f"{q4} and {q6}: only their {what} is determined"
            families.append(("wrist aligned", where.reshape(shape), free, f"{q4} {value}{flip}"))
        families += [(family, where, "", "") for family, where in postures.meeting.items()]
        families.append(("flips meet", angles.meet.reshape(shape), "", ""))
        spread = ((f, np.repeat(where.T, 2, axis=1) & reached, a, b) for f, where, a, b in families)
        return [SingularPoses(f, where, a, b) for f, where, a, b in spread if where.any()]


class _WristAngles(NamedTuple):
    """Joints 4 to 6 of a wrist for m rotations."""

    q: FloatArray  # [rad], shape (3, 2, m), not flipped before flipped; NaN where there is none
    angle: FloatArray  # between axes 4 and 6, in [rad], shape (m,)
    along: BoolArray  # where these axes are one line and point the same way, shape (m,)
    against: BoolArray  # where they are one line and point opposite ways, shape (m,)
    meet: BoolArray  # where both flips are one, as all three axes lie in a plane, shape (m,)


@dataclass(frozen=True, slots=True, eq=False)
class Wrist:
    """Axes 4 to 6 of an arm at q = 0.

    Attributes:
        axes: Unit vectors k4, k5, k6 [-], shape (3, 3).
    """

    axes: FloatArray

    @property
    def min_angle(self) -> float:
        """The smallest angle that joint 5 can give axes 4 and 6, in [rad]."""
        first, second = self._tilts
        return abs(first - second)

    @property
    def max_angle(self) -> float:
        """The largest angle that joint 5 can give axes 4 and 6, in [rad]."""
        first, second = self._tilts
        return min(first + second, 2 * np.pi - first - second)

    @property
    def _tilts(self) -> tuple[float, float]:
        """The angles between axes 4 and 5 and between 5 and 6, in [rad]."""
        k4, k5, k6 = self.axes
        return float(angle_between(k4, k5)), float(angle_between(k5, k6))

    def solve(self, tool_axis: FloatArray, across: FloatArray, chosen: FloatArray) -> _WristAngles:
        """Return both solutions of R4 R5 R6 = Q.

        The spherical triangle of the three axes, with the sides tilt 4-5, tilt 5-6 and the angle z between
        k4 and Q k6, has the angle pi - d at axis 5: tan^2(d / 2) = (cos(tilt difference) - cos z) / (cos z -
        cos(tilt sum)), both as products of sines, which lose no digit where axes 4 and 6 align. Then q4 turns
        R5 k6 to Q k6, and q6 is the remaining angle.

        Args:
            tool_axis: Q k6 [-], shape (3, m).
            across: Q p of the unit vector p of `across_tool`, shape (3, m).
            chosen: q4 where it is free, of the wrist that is not flipped, in [rad], shape (m,).
        """
        k4, k5, k6 = self.axes
        angle = angle_between(k4, tool_axis)
        swing, meet = self._swing(angle)
        level = float(angle_about(k5, k6, k4))
        in_line = (np.sin(angle) <= ALIGNED_TOLERANCE) & np.isfinite(swing)
        q5 = wrap_angle(level + np.stack((swing, -swing)))
        fifth = rotation_about(k5.tolist(), q5)
        raised = np.stack(np.broadcast_arrays(*fifth.rotate(tuple(k6.tolist())), q5)[:3])
        q4 = angle_about(k4, raised, np.broadcast_to(tool_axis[:, None], raised.shape))
        q4 = np.where(in_line, wrap_angle(chosen + np.array([[0.0], [np.pi]])), q4)
        before_fifth = rotation_about(k4.tolist(), -q4).rotate(tuple(across[:, None]))
        before_sixth = np.stack(fifth.inverse().rotate(before_fifth))
        q6 = angle_about(k6, self.across_tool, before_sixth)
        q = np.where(np.isfinite(swing), np.stack((q4, q5, q6)), np.nan)
        meet = meet & (np.abs(wrap_angle(q4[0] - q4[1])) < DUPLICATE_TOLERANCE)
        q[:, 1, meet] = np.nan
        along, against = in_line & (angle < np.pi / 2), in_line & (angle > np.pi / 2)
        return _WristAngles(q, angle, along, against, meet)

    @property
    def across_tool(self) -> FloatArray:
        """A unit vector perpendicular to axis 6, shape (3,)."""
        k6 = self.axes[2]
        helper = np.eye(3)[np.argmin(np.abs(k6))]
        across = np.cross(k6, helper)
        return np.asarray(across / np.linalg.norm(across))

    def _swing(self, angle: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return d, the angle of joint 5 from the plane of axes 4 and 5, and where both flips coincide."""
        first, second = self._tilts
        inner = np.sin((angle + first - second) / 2) * np.sin((angle - first + second) / 2)
        outer = np.sin((first + second + angle) / 2) * np.sin((first + second - angle) / 2)
        scale = np.sin(first) * np.sin(second)
        none = ~((inner >= -BOUNDARY * scale) & (outer >= -BOUNDARY * scale))
        inner, outer = np.maximum(inner, 0.0), np.maximum(outer, 0.0)
        swing = 2.0 * np.arctan2(np.sqrt(inner), np.sqrt(outer))
        meet = np.minimum(inner, outer) <= MEETING * scale
        return np.where(none, np.nan, swing), np.asarray(meet & ~none)
