"""The motion of a driven arm along a path at one velocity, and its errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from urmpipe_models.delta import delta
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.comparison.path_distance import distance_from_path
from urmpipe_pipeline.joint_log import ns_to_seconds


@dataclass(frozen=True, slots=True)
class Divergence:
    """The end of a motion that leaves its set points by more than a turn.

    Attributes:
        t: Time in [s].
        joint: The joint that did.
    """

    t: float
    joint: str


@dataclass(frozen=True, slots=True)
class TrackingErrors:
    """The errors of a motion, and how often a drive was at its voltage limit.

    Attributes:
        velocity: Commanded in [m/s].
        reached: The largest speed of the plan in [m/s].
        error: Largest distance from the set point of the same time in [m]; None if it diverged.
        path_error: Largest distance from the nearest point of the path in [m]; None if it diverged.
        saturated_share: Fraction of the samples at which a voltage is at its limit, 0..1; until it diverged.
        diverged: Where it left its set points; None if it did not.
    """

    velocity: float
    reached: float
    error: float | None
    path_error: float | None
    saturated_share: float
    diverged: Divergence | None


@dataclass(frozen=True, eq=False)
class DrivenMotion:
    """The motion of an arm with drives along a path at one velocity; n samples, k joints, d of them driven.

    Attributes:
        velocity: Commanded in [m/s].
        t_ns: Times in integer [ns], shape (n,).
        planned: Planned position of the tool centre point in [m], shape (n, 3).
        set_q: Set points of the joints in [rad] or [m], shape (n, k).
        set_qd: Their rates in [rad/s] or [m/s], shape (n, k).
        speed: Planned speed along the path in [m/s], shape (n,).
        position: Position of the tool centre point in [m], shape (n, 3).
        q: Values of the joints in [rad] or [m], shape (n, k).
        qd: Their rates in [rad/s] or [m/s], shape (n, k).
        voltage: Of the drives in [V], shape (n, d).
        current: Of the drives in [A], shape (n, d).
        limits: Their largest voltages in [V], shape (d,).
        corner_times_ns: Times at the middles of the path's arcs in integer [ns], shape (arcs,).
        diverged: Where it ended early; None if it did not.
    """

    velocity: float
    t_ns: IntArray
    planned: FloatArray
    set_q: FloatArray
    set_qd: FloatArray
    speed: FloatArray
    position: FloatArray
    q: FloatArray
    qd: FloatArray
    voltage: FloatArray
    current: FloatArray
    limits: FloatArray
    corner_times_ns: IntArray
    diverged: Divergence | None

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (n,)."""
        return ns_to_seconds(self.t_ns)

    @cached_property
    def delta(self) -> FloatArray:
        """x, y, z and norm of planned - position at the same time in [m], shape (n, 4).

        Source: [Iso9283]_ eq. 6 and 7.
        """
        planned, position = ((p[:, 0], p[:, 1], p[:, 2]) for p in (self.planned, self.position))
        return np.column_stack(delta(planned, position))

    @cached_property
    def from_path(self) -> FloatArray:
        """Distance from the nearest point of the planned path in [m], shape (n,)."""
        joined = np.ones(len(self) - 1, dtype=bool)
        return np.minimum(distance_from_path(self.position, self.planned, joined), self.delta[:, 3])

    @cached_property
    def at_limit(self) -> FloatArray:
        """Fraction of the samples at which each voltage is at its limit [-], 0..1, shape (d,)."""
        return np.asarray((np.abs(self.voltage) >= self.limits).mean(axis=0))

    @property
    def worst(self) -> int:
        """The sample with the largest distance from the set point of the same time."""
        return int(np.argmax(self.delta[:, 3]))

    @property
    def errors(self) -> TrackingErrors:
        """Its largest distances."""
        has_diverged = self.diverged is not None
        saturated = (np.abs(self.voltage) >= self.limits).any(axis=1)
        return TrackingErrors(
            velocity=self.velocity,
            reached=float(self.speed.max()),
            error=None if has_diverged else float(self.delta[:, 3].max()),
            path_error=None if has_diverged else float(self.from_path.max()),
            saturated_share=float(saturated.mean()),
            diverged=self.diverged,
        )
