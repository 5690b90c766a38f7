"""What the arm's kinematics say about a log that recorded its tool centre point: units and the robot.

The forward kinematics of the right robot, with the right units, come out at the recorded points; those of
a wrong one do not. A tool that nobody told of only adds a constant offset in the frame of the tip:
p_recorded = p + R d, with the d that fits best.
"""

from __future__ import annotations

from collections.abc import Container, Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.math3d import conjugate, quaternion_product, rotation_angle

Key = TypeVar("Key", bound=Hashable)

SAMPLES = 400
"""Rows that decide, spread evenly over the log."""

CLOSE = 0.02
"""Largest rms distance in [m] at which kinematics agree: an arm's own calibration moves it by millimetres."""

CLOSE_WITH_TOOL = 0.006
"""The same if a constant tool may be fitted: three numbers explain a part of any motion."""

CLEARLY = 5.0
"""The best of several explanations must be so many times nearer than the next one ..."""

APART = 0.005
"""... and by so much in [m]: two robots of one family differ by that somewhere in their space."""

LEAST_MOTION = 0.02
"""Spread of the recorded points in [m] below which a tool may explain anything."""

_LEAST_ROWS = 5
"""Rows needed to fit a tool: 3 numbers against 15."""


@dataclass(frozen=True, slots=True)
class Fit:
    """How near the kinematics come to the recorded points.

    Attributes:
        distance: Root mean square distance in [m], the tool as the robot has it.
        with_tool: The same after the constant tool offset that fits best; inf where it cannot be told.
        tool: That offset in the frame of the tip, in [m].
    """

    distance: float
    with_tool: float
    tool: tuple[float, float, float]

    def of(self, *, tool: bool) -> float:
        """Return the distance in [m], with the tool that fits best or without."""
        return self.with_tool if tool else self.distance


def spread(rows: int) -> slice:
    """Return the rows that decide."""
    return slice(None, None, max(1, rows // SAMPLES))


def has_both(q: FloatArray, position: FloatArray) -> BoolArray:
    """Return which rows have joint values and a recorded point, in any unit, shape (n, joints) and (n, 3).

    A point of three zeros was not recorded: a controller writes it before it knows one.
    """
    known = np.isfinite(q).all(axis=1) & np.isfinite(position).all(axis=1)
    return np.asarray(known & position.any(axis=1))


def extent(points: FloatArray) -> float:
    """Return the root mean square distance of points, shape (n, 3) in any unit, from their middle."""
    return _rms(points - points.mean(axis=0))


def tool_fit(position: FloatArray, rotation: FloatArray, recorded: FloatArray) -> Fit:
    """Return how near poses come to recorded points, and with which tool.

    Args:
        position: Computed positions in [m], shape (n, 3).
        rotation: Computed orientations [-], shape (n, 3, 3).
        recorded: Recorded positions in [m], shape (n, 3).
    """
    miss = recorded - position
    distance = _rms(miss)
    if len(recorded) < _LEAST_ROWS or extent(recorded) < LEAST_MOTION:
        return Fit(distance, np.inf, (0.0, 0.0, 0.0))
    tool = (rotation.transpose(0, 2, 1) @ miss[:, :, np.newaxis]).mean(axis=0)  # least squares: R^T R = I
    x, y, z = tool[:, 0].tolist()
    return Fit(distance, _rms(miss - (rotation @ tool)[:, :, 0]), (x, y, z))


def single_out(fits: Mapping[Key, Fit], told: Container[Key] = ()) -> tuple[Key, bool] | None:
    """Return the only explanation that agrees with the recorded points, and whether it needs a tool.

    Of several that cannot be told apart it is the only one that is told already.
    """
    for needs_tool, close in ((False, CLOSE), (True, CLOSE_WITH_TOOL)):
        distances = {key: one.of(tool=needs_tool) for key, one in fits.items()}
        best = min(distances.values())
        if best > close:
            continue
        rivals = [key for key, distance in distances.items() if not clearly_worse(distance, best)]
        chosen = [key for key in rivals if key in told] or rivals
        if len(chosen) == 1:
            return chosen[0], needs_tool
    return None


def clearly_worse(distance: float, best: float) -> bool:
    """Return whether an explanation at a distance in [m] is excluded by the best one."""
    return distance >= CLEARLY * best and distance >= best + APART


def _rms(vectors: FloatArray) -> float:
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


def turned_apart(computed: FloatArray, recorded: FloatArray, *, tool: bool) -> float:
    """Return the rms angle between orientations in [rad], with a tool after its constant turn that fits best.

    Computed and recorded orientations are unit quaternions x, y, z, w [-], shape (n, 4).
    """
    if not tool:
        return float(np.sqrt(np.mean(rotation_angle(computed, recorded) ** 2)))
    relative = quaternion_product(conjugate(computed), recorded)
    mean = np.broadcast_to(mean_turn(computed, recorded), relative.shape)
    return float(np.sqrt(np.mean(rotation_angle(mean, relative) ** 2)))


def mean_turn(computed: FloatArray, recorded: FloatArray) -> FloatArray:
    """Return the constant turn from computed to recorded orientations that fits best, shape (4,) [-].

    It is the mean of the relative quaternions: the eigenvector of sum(q q^T) with the largest eigenvalue
    (Markley et al. 2007, "Averaging quaternions", eq. 12). Computed and recorded orientations are unit
    quaternions x, y, z, w [-], shape (n, 4).
    """
    relative = quaternion_product(conjugate(computed), recorded)
    return np.asarray(np.linalg.eigh(relative.T @ relative)[1][:, -1])
