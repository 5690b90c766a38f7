"""Three revolute joints whose axes meet in one point: the angles that give a rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray
from urmpipe_models.inverse.closed.angles import angle_about, angle_between
from urmpipe_models.inverse.closed.tracks import MEETING
from urmpipe_models.inverse.closed.trigonometric import BOUNDARY, wrapped
from urmpipe_models.transform import rotation_about

ALIGNED = 1e-11
"""Axes 4 and 6 at a smaller angle than this, in [rad], count as one line.

What is chosen there turns the tool away by less than this; beyond it the angles are still good to the
rounding, as each is computed from the ones before it.
"""

SAME_ANGLE = 1e-5
"""Flips that differ by less than this in every joint are one, in [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class WristAngles:
    """Joints 4 to 6 of a wrist for m rotations.

    Attributes:
        q: In [rad], shape (3, 2, m), not flipped before flipped; NaN where there is none.
        angle: Between axes 4 and 6, in [rad], shape (m,).
        along: Where these axes are one line and point the same way, shape (m,).
        against: Where they are one line and point opposite ways, shape (m,).
        meet: Where both flips are one, as all three axes lie in a plane, shape (m,).
    """

    q: FloatArray
    angle: FloatArray
    along: BoolArray
    against: BoolArray
    meet: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class Wrist:
    """Axes 4 to 6 of an arm at q = 0.

    Attributes:
        axes: Unit vectors k4, k5, k6 [-], shape (3, 3).
    """

    axes: FloatArray

    @property
    def least(self) -> float:
        """The least angle that joint 5 brings axes 4 and 6 to, in [rad]."""
        first, second = self._tilts
        return abs(first - second)

    @property
    def most(self) -> float:
        """The largest angle that joint 5 brings axes 4 and 6 to, in [rad]."""
        first, second = self._tilts
        return min(first + second, 2 * np.pi - first - second)

    @property
    def _tilts(self) -> tuple[float, float]:
        """The angles between axes 4 and 5 and between 5 and 6, in [rad]."""
        k4, k5, k6 = self.axes
        return float(angle_between(k4, k5)), float(angle_between(k5, k6))

    def solve(self, tool_axis: FloatArray, across: FloatArray, chosen: FloatArray) -> WristAngles:
        """Return both solutions of R4 R5 R6 = Q.

        The spherical triangle of the three axes, with the sides tilt 4-5, tilt 5-6 and the angle z between
        k4 and Q k6, has the angle pi - d at axis 5: tan^2(d / 2) = (cos(tilt difference) - cos z) / (cos z -
        cos(tilt sum)), both as products of sines, which lose no digit where axes 4 and 6 align. Then q4 turns
        R5 k6 to Q k6, and q6 what is left.

        Args:
            tool_axis: Q k6 [-], shape (3, m).
            across: Q p of the unit vector p of `across_tool`, shape (3, m).
            chosen: q4 where it is free, of the wrist that is not flipped, in [rad], shape (m,).
        """
        k4, k5, k6 = self.axes
        angle = angle_between(k4, tool_axis)
        away, meet = self._away(angle)
        level = float(angle_about(k5, k6, k4))
        in_line = (np.sin(angle) <= ALIGNED) & np.isfinite(away)
        q5 = wrapped(level + np.stack((away, -away)))
        fifth = rotation_about(k5.tolist(), q5)
        raised = np.stack(np.broadcast_arrays(*fifth.rotate(tuple(k6.tolist())), q5)[:3])
        q4 = angle_about(k4, raised, np.broadcast_to(tool_axis[:, None], raised.shape))
        q4 = np.where(in_line, wrapped(chosen + np.array([[0.0], [np.pi]])), q4)
        before_fifth = rotation_about(k4.tolist(), -q4).rotate(tuple(across[:, None]))
        before_sixth = np.stack(fifth.inverse().rotate(before_fifth))
        q6 = angle_about(k6, self.across_tool, before_sixth)
        q = np.where(np.isfinite(away), np.stack((q4, q5, q6)), np.nan)
        meet = meet & (np.abs(wrapped(q4[0] - q4[1])) < SAME_ANGLE)
        q[:, 1, meet] = np.nan
        along, against = in_line & (angle < np.pi / 2), in_line & (angle > np.pi / 2)
        return WristAngles(q, angle, along, against, meet)

    @property
    def across_tool(self) -> FloatArray:
        """A unit vector across axis 6, shape (3,)."""
        k6 = self.axes[2]
        helper = np.eye(3)[np.argmin(np.abs(k6))]
        across = np.cross(k6, helper)
        return np.asarray(across / np.linalg.norm(across))

    def _away(self, angle: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return d, how far joint 5 turns axis 6 out of the plane of axes 4 and 5, and where it does not."""
        first, second = self._tilts
        inner = np.sin((angle + first - second) / 2) * np.sin((angle - first + second) / 2)
        outer = np.sin((first + second + angle) / 2) * np.sin((first + second - angle) / 2)
        whole = np.sin(first) * np.sin(second)
        none = ~((inner >= -BOUNDARY * whole) & (outer >= -BOUNDARY * whole))
        inner, outer = np.maximum(inner, 0.0), np.maximum(outer, 0.0)
        away = 2.0 * np.arctan2(np.sqrt(inner), np.sqrt(outer))
        meet = np.minimum(inner, outer) <= MEETING * whole
        return np.where(none, np.nan, away), np.asarray(meet & ~none)
