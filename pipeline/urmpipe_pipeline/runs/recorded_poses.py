"""The poses that a log recorded of its tool centre point, and how far an arm's kinematics stay from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, Vector
from urmpipe_models.kinematics.forward import poses_over_log, positions_over_log
from urmpipe_models.math3d import Transform, fit_rotation, matrix_to_rpy, to_matrices, to_quaternions
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.runs.recorded_start import outlying_start
from urmpipe_pipeline.sources.units.evidence import (
    CLEARLY,
    Fit,
    has_both,
    mean_turn,
    spread,
    tool_fit,
    turned_apart,
)

FINEST = 1e-4
"""Options are told to a tenth of a millimetre: where kinematics are nearer than this in [m], none helps."""

FINEST_TURN = 1e-3
"""The same of an angle in [rad], which moves what is a tool's length away by that."""


@dataclass(frozen=True, slots=True)
class Apart:
    """How far an arm stays from recorded poses.

    Attributes:
        distance: Root mean square distance in [m].
        angle: The same of the angle in [rad]; 0 where no orientation was recorded.
    """

    distance: float
    angle: float

    def clearly_nearer(self, other: Apart) -> bool:
        """Tell whether it is clearly less in place or in angle than another, and clearly more in neither."""
        nearer = CLEARLY * self.distance <= other.distance and other.distance > FINEST
        straighter = CLEARLY * self.angle <= other.angle and other.angle > FINEST_TURN
        no_further = self.distance <= CLEARLY * max(other.distance, FINEST)
        no_more_turned = self.angle <= CLEARLY * max(other.angle, FINEST_TURN)
        return (nearer and no_more_turned) or (straighter and no_further)

    def said(self, *, turned: bool) -> str:
        """Return it as people read it, with the angle if that matters."""
        angle = f" and {text.quantity(self.angle, 'rad')}" if turned else ""
        return f"{self.distance * 1e3:.2f} mm{angle}"


@dataclass(frozen=True, slots=True, eq=False)
class RecordedPoses:
    """Rows of a log that have joint values and a recorded tool centre point.

    Attributes:
        q: Joint values in [rad] or [m], shape (n, joints).
        position: Recorded positions in [m], shape (n, 3).
        quat: Recorded orientations as unit quaternions x, y, z, w [-], shape (n, 4); NaN where one is
            missing, None without any.
    """

    q: FloatArray
    position: FloatArray
    quat: FloatArray | None

    @classmethod
    def of(cls, robot: Chain | None, log: JointLog) -> RecordedPoses | None:
        """Return some rows that are spread over a log; None if it has none that an arm can be held against.

        Those at its start that are outliers are left out.
        """
        if robot is None or log.tcp_position is None or log.measured or log.q.shape[1] != len(robot.moving):
            return None
        start, _ = outlying_start(robot, log)
        rows = np.arange(start, log.rows)[spread(log.rows - start)]
        q, position = log.q[rows], log.tcp_position[rows]
        known = has_both(q, position)
        quat = None
        if log.tcp_rotation is not None and log.rotation_form is not None:
            quat = to_quaternions(log.tcp_rotation[rows], log.rotation_form)[known]
        told = quat is not None and bool(np.isfinite(quat).all(axis=1).any())
        return cls(q[known], position[known], quat if told else None) if known.any() else None

    def fit(self, robot: Chain, q: FloatArray | None = None) -> Fit:
        """Return how near an arm comes to the points.

        Args:
            robot: The arm.
            q: Other joint values in [rad] or [m], shape (n, joints).
        """
        return self.fits(robot, [self.q if q is None else q])[0]

    def fits(self, robot: Chain, every: Sequence[FloatArray]) -> list[Fit]:
        """Return the fits of several joint values in [rad] or [m], shape (n, joints) each, all at once."""
        position, rotation = poses_over_log(robot, np.concatenate(every))
        parts = zip(np.split(position, len(every)), np.split(rotation, len(every)), strict=True)
        return [tool_fit(*part, self.position) for part in parts]

    def apart(self, robot: Chain, q: FloatArray | None = None, *, tool: bool) -> Apart:
        """Return how far an arm stays from the poses, perhaps but for the constant tool that fits best.

        Where a log hardly moves, any tool would fit: its points are then held as the arm has them.

        Args:
            robot: The arm.
            q: Other joint values in [rad] or [m], shape (n, joints).
            tool: Whether a tool is allowed for.
        """
        found = self.fit(robot, q)
        distance = found.with_tool if tool and np.isfinite(found.with_tool) else found.distance
        return Apart(distance, self._angle(robot, self.q if q is None else q, tool=tool))

    def tool_turn(self, robot: Chain) -> tuple[float, float, float]:
        """Return rx, ry, rz in [rad] of the tool that fits the orientations best; zeros without them."""
        if self.quat is None:
            return 0.0, 0.0, 0.0
        (turn,) = to_matrices(mean_turn(*self._orientations(robot, self.q))[np.newaxis])
        return matrix_to_rpy(_rows_of(turn))

    def base(self, robot: Chain) -> tuple[float, ...]:
        """Return x, y, z in [m] and rx, ry, rz in [rad] of the base with which the points agree best."""
        computed = positions_over_log(replace(robot, base=Transform()), self.q)
        middle, target = computed.mean(axis=0), self.position.mean(axis=0)
        turn, _ = fit_rotation((self.position - target).T @ (computed - middle))
        return (*(target - turn @ middle).tolist(), *matrix_to_rpy(_rows_of(turn)))

    def _angle(self, robot: Chain, q: FloatArray, *, tool: bool) -> float:
        return 0.0 if self.quat is None else turned_apart(*self._orientations(robot, q), tool=tool)

    def _orientations(self, robot: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return computed and recorded orientations where both are, each of shape (n, 4) [-]."""
        assert self.quat is not None  # asked before
        known = np.isfinite(self.quat).all(axis=1)
        _, rotation = poses_over_log(robot, q[known])
        return to_quaternions(rotation.reshape(-1, 9), "matrix"), self.quat[known]


def _rows_of(matrix: FloatArray) -> tuple[Vector, Vector, Vector]:
    """Return the rows of a rotation matrix as a transform has them."""
    x, y, z = (tuple(row) for row in matrix.tolist())
    return x, y, z
