"""A side of a comparison, and how two sides are put together in time and in space."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.hand_eye import UnobservableDirection
from urmpipe_models.math3d import rotation_angle, to_quaternions
from urmpipe_pipeline.joint_log import SourceFile, seconds

SyncMode = Literal["start", "stamps", "given", "auto"]
AlignMode = Literal["none", "start", "rigid", "tool", "base+tool"]

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Where an arm or a point was, when: a side of a comparison.

    Attributes:
        name: Its name.
        t_ns: Times from its first sample in integer [ns], shape (m,).
        position: In [m], shape (m, 3).
        files: The files it came from.
        quat_xyzw: Orientation as unit quaternions x, y, z, w [-], shape (m, 4), each the nearer of q and -q
            to the one before; None without one.
        joints: Names of the joints; none of a path.
        joint_units: rad or m, one a joint.
        q: Repolarized joint values in [rad] or [m], shape (m, joints); None without joints.
        broken: Samples behind which a joint steps as no motion does, to the next one: nothing is known in
            between, shape (k,).
    """

    name: str
    t_ns: IntArray
    position: FloatArray
    files: tuple[SourceFile, ...] = ()
    quat_xyzw: FloatArray | None = None
    joints: tuple[str, ...] = ()
    joint_units: tuple[str, ...] = ()
    q: FloatArray | None = None
    broken: IntArray | None = None

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (m,)."""
        return seconds(self.t_ns)

    @property
    def has_value(self) -> BoolArray:
        """Which rows have a position, or all joints where no row has one, shape (m,)."""
        values = self.position
        if self.q is not None and not np.isfinite(values).any():
            values = self.q
        return np.asarray(np.isfinite(values).all(axis=1))

    def rows_with_value(self) -> Trajectory:
        """Return the rows that have a value: the others may be those of another topic, and are no gaps."""
        valued = self.has_value
        if valued.all() or not valued.any():
            return self
        kept = np.flatnonzero(valued)
        return replace(
            self,
            t_ns=self.t_ns[kept],
            position=self.position[kept],
            quat_xyzw=None if self.quat_xyzw is None else self.quat_xyzw[kept],
            q=None if self.q is None else self.q[kept],
            broken=None if self.broken is None else _behind(self.broken, kept),
        )


def _behind(broken: IntArray, kept: IntArray) -> IntArray:
    """Return the kept rows, by their new numbers, behind which a step of the whole trajectory is broken."""
    rows = np.unique(np.searchsorted(kept, broken, side="right") - 1)
    return np.asarray(rows[rows >= 0])


@dataclass(frozen=True, slots=True)
class Sync:
    """How two clocks were put together: t_reference = t_log + offset, both from their first samples.

    Attributes:
        mode: start (both start together), stamps (Unix times or dates on both sides), given, or auto
            (estimated from the motion).
        offset: In [s].
        by: What an estimate rests on: joints or position; empty without one.
        precision: Standard error of an estimate in [s]; None without one.
        similarity: How alike the two motions are at that offset, -1 to 1; None without an estimate.
    """

    mode: SyncMode = "start"
    offset: float = 0.0
    by: str = ""
    precision: float | None = None
    similarity: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return asdict(self) | {"by": self.by or None}


@dataclass(frozen=True, slots=True)
class Alignment:
    """How the log was moved in space before it was compared: p' = rotation p + translation + R' tool.

    R' is the log's orientation after the rotation, and R' tool_rotation its orientation in the end.

    Attributes:
        mode: none, start (the first compared poses agree), rigid (the best rigid motion), tool (the best
            constant offset of the tool centre point) or base+tool (the best base and the best tool at once).
        rotation: Rotation matrix [-], row by row, 3 by 3.
        translation: In [m].
        tool: In the frame of the log's tool, in [m].
        tool_rotation: In the frame of the log's tool, rotation matrix [-], row by row, 3 by 3.
        unobservable: What the compared poses do not determine of base and tool, or hardly.
    """

    mode: AlignMode = "none"
    rotation: tuple[tuple[float, ...], ...] = IDENTITY
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tool: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tool_rotation: tuple[tuple[float, ...], ...] = IDENTITY
    unobservable: tuple[UnobservableDirection, ...] = ()

    @property
    def angle(self) -> float:
        """Angle of the rotation in [rad], 0 to pi."""
        return _angle(self.rotation)

    @property
    def tool_angle(self) -> float:
        """Angle of the tool's rotation in [rad], 0 to pi."""
        return _angle(self.tool_rotation)

    def moved(self, aligned: FloatArray) -> FloatArray:
        """Return how far the log's positions, now in [m], shape (m, 3), were moved, in [m], shape (m,).

        Of base+tool: how far the base took them.
        """
        if self.mode == "tool":
            return np.full(len(aligned), np.linalg.norm(self.tool))
        before = (aligned - np.array(self.translation)) @ np.array(self.rotation)  # R^T (p' - t)
        return np.asarray(np.linalg.norm(aligned - before, axis=1))

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return asdict(self)


def _angle(rotation: tuple[tuple[float, ...], ...]) -> float:
    quat = to_quaternions(np.reshape(rotation, (1, 9)), "matrix")
    return float(rotation_angle(quat, np.array([[0.0, 0.0, 0.0, 1.0]]))[0])


def extent(values: FloatArray) -> float:
    """Return the largest span of the columns of values in [m] or [rad], shape (n, k); 0 without a value."""
    known = values[np.isfinite(values).all(axis=1)]
    return float(np.ptp(known, axis=0).max()) if known.size else 0.0
