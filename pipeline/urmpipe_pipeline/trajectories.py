"""Trajectories of an arm or a point, and two of them at the same times: what is compared and diagnosed.

1. `fk_trajectory`, `recorded_trajectory` and `joint_trajectory` take one side from a run: `Trajectory`, and
   `Side` with the run.
2. `Sync` and `Alignment` state how the clocks and the frames of two sides were put together.
3. `match` gives both sides at the rows of the log: t_reference = t_log + offset, the reference interpolated.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, row_blocks
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.hand_eye import UnobservableDirection
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_models.math3d import rotation_angle, slerp, to_quaternions
from urmpipe_models.wraps import unwrap_quaternions
from urmpipe_pipeline.joint_log import NETWORK, SourceFile, has_gap_after, ns_to_seconds
from urmpipe_pipeline.runs.grid import ROUNDING_NS, interpolate
from urmpipe_pipeline.runs.run import Run

SyncMode = Literal["start", "stamps", "given", "auto"]
AlignMode = Literal["none", "start", "rigid", "tool", "base+tool"]

BLOCK_ROWS = 1 << 16  # rows that are matched and measured at once: temporary arrays of some MB
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

ORIENTED = "joints with a robot, or a recorded orientation"  # what gives a side an orientation
NO_ROBOT = ("no robot, so no forward kinematics", Hint("robot", None, "sets one"))

NO_ROBOT_FITS = (
    "no robot is given, and no single one of the catalogue fits the recorded tool centre point as it is",
    Hint("robot", None, "sets one"),
    Hint("tool", None, "adds its tool"),
)  # the robot was searched for by the recorded poses

AS_RECORDED = Hint("tcp", "recorded", "uses the recorded tool centre point")
JOINTS_ALONE = Hint("tolerance", "joint=0.1deg", "compares the joints only")


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Positions, orientations and joints of an arm or a point over time: a side of a comparison.

    Attributes:
        name: Its name.
        t_ns: Times from its first sample in integer [ns], shape (m,).
        position: In [m], shape (m, 3).
        files: The files it came from.
        quat_xyzw: Orientation as unit quaternions x, y, z, w [-], shape (m, 4), each the nearer of q and -q
            to the one before; None without one.
        joints: Names of the joints; empty for a path.
        joint_units: rad or m, one per joint.
        q: Repolarized joint values in [rad] or [m], shape (m, joints); None without joints.
        discontinuities: Samples after which a joint steps to the next one as no motion does, so that nothing
            in between is defined, shape (k,).
    """

    name: str
    t_ns: IntArray
    position: FloatArray
    files: tuple[SourceFile, ...] = ()
    quat_xyzw: FloatArray | None = None
    joints: tuple[str, ...] = ()
    joint_units: tuple[str, ...] = ()
    q: FloatArray | None = None
    discontinuities: IntArray | None = None

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (m,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def has_value(self) -> BoolArray:
        """Which rows have a position, or all joints if no row has a position, shape (m,)."""
        values = self.position
        if self.q is not None and not np.isfinite(values).any():
            values = self.q
        return np.asarray(np.isfinite(values).all(axis=1))

    def rows_with_value(self) -> Trajectory:
        """Return the rows that have a value: others may belong to another topic, and are no gaps."""
        valued = self.has_value
        if valued.all() or not valued.any():
            return self
        kept, broken = np.flatnonzero(valued), None
        if self.discontinuities is not None:  # by the numbers that the kept rows have now
            broken = np.unique(np.searchsorted(kept, self.discontinuities, side="right") - 1)
            broken = broken[broken >= 0]
        return replace(
            self,
            t_ns=self.t_ns[kept],
            position=self.position[kept],
            quat_xyzw=None if self.quat_xyzw is None else self.quat_xyzw[kept],
            q=None if self.q is None else self.q[kept],
            discontinuities=broken,
        )


@dataclass(frozen=True, slots=True)
class Sync:
    """How two clocks are aligned: t_reference = t_log + offset, both from their first samples.

    Attributes:
        mode: start (both start together), stamps (Unix times or dates on both sides), given, or auto
            (estimated from the motion).
        offset: In [s].
        by: What an estimate is based on: joints or position; empty without one.
        precision: Standard error of an estimate in [s]; None without one.
        similarity: Of the two motions at that offset, -1 to 1; None without an estimate.
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
    """Rigid motion of the log before it was compared: p' = rotation p + translation + R' tool.

    R' is the log's orientation after the rotation, and R' tool_rotation its final orientation.

    Attributes:
        mode: none, start (the first compared poses agree), rigid (the best rigid motion), tool (the best
            constant offset of the tool centre point) or base+tool (the best base and the best tool at once).
        rotation: Rotation matrix [-], row by row, 3 by 3.
        translation: In [m].
        tool: In the frame of the log's tool, in [m].
        tool_rotation: In the frame of the log's tool, rotation matrix [-], row by row, 3 by 3.
        unobservable: Components of base and tool that the compared poses do not, or only weakly, determine.
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
        """Return how far aligned positions in [m], shape (m, 3), were moved, in [m], shape (m,).

        For base+tool: by the base alone.
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


class Side(NamedTuple):
    """One side of a comparison.

    Attributes:
        run: The log or the path.
        trajectory: Its trajectory as it was compared.
        by_joints: Whether the trajectory is that of its joints, by kinematics or by their values alone; else
            it is the recorded one.
    """

    run: Run
    trajectory: Trajectory
    by_joints: bool


class Matched(NamedTuple):
    """Both sides at the samples that were compared.

    Attributes:
        sample: Rows of the log, from 0, shape (m,).
        t_ns: Their times on the log's clock in integer [ns], shape (m,).
        reference: Position of the reference in [m], shape (m, 3).
        actual: Position of the log in [m], aligned, shape (m, 3).
        reference_quat: Orientation of the reference x, y, z, w [-], shape (m, 4); None without one.
        actual_quat: Orientation of the log x, y, z, w [-], shape (m, 4); None without one.
        reference_q: Joints of the reference, in the log's order, in [rad] or [m], shape (m, joints); None
            where `joint_mismatch` has a reason.
        actual_q: Joints of the log in [rad] or [m], shape (m, joints); None where the reference's are.
        left_out: Samples of the log that were not compared.
        reference_left_out: Samples of the reference outside the log's time.
        sync: How the clocks are aligned.
        alignment: How the log was moved in space.
    """

    sample: IntArray
    t_ns: IntArray
    reference: FloatArray
    actual: FloatArray
    reference_quat: FloatArray | None
    actual_quat: FloatArray | None
    reference_q: FloatArray | None
    actual_q: FloatArray | None
    left_out: int
    reference_left_out: int
    sync: Sync
    alignment: Alignment

    def at(self, kept: NDArray[np.intp]) -> Matched:
        """Return both sides at a selection of these samples, by their indices [-], shape (k,)."""
        arrays: dict[str, Any] = {
            name: value[kept] for name, value in self._asdict().items() if isinstance(value, np.ndarray)
        }
        return self._replace(**arrays, left_out=self.left_out + len(self.sample) - len(kept))


def fk_trajectory(run: Run) -> Trajectory:
    """Return the trajectory of a run's tool centre point by its joints, on its log's own rows.

    The motion of a network has that of the traced point, by the kinematics of the network.

    Raises:
        LogError: If the run has no kinematics.
    """
    if traces_point(run):
        return recorded_trajectory(run)
    if run.tcp is None or run.robot is None:
        raise LogError(kinematics_missing(run))
    tcp = run.tcp
    if run.rows is not None:  # by the arithmetic of the grid, so that no grid changes a bit of a verdict
        still = np.zeros_like(run.rows.q)
        tcp = point_over_log(run.robot, run.rows.q, still, still)
    return _with_broken(run, tcp.position, unwrap_quaternions(to_quaternions(tcp.euler_zyx, "zyx")))


def traces_point(run: Run) -> bool:
    """Return whether a run is the motion of a network with a traced point, which replaces kinematics."""
    return run.robot is None and run.log.source == NETWORK and run.log.tcp_position is not None


def recorded_trajectory(run: Run) -> Trajectory:
    """Return the trajectory of the tool centre point that a run recorded, on its log's own rows.

    Raises:
        LogError: If it recorded none.
    """
    if run.log.tcp_position is None:
        hint = Hint("tcp", "fk", "uses the joints of a log with a robot")
        raise LogError(run_finding(run, "no recorded tool centre point", hint))
    return _build_trajectory(run, run.log.tcp_position, run.log.tcp_quat_xyzw)


def joint_trajectory(run: Run) -> Trajectory:
    """Return a run's joints on its log's own rows; its positions are NaN."""
    return _with_broken(run, np.full((run.log.rows, 3), np.nan), None)


def _with_broken(run: Run, position: FloatArray, quat: FloatArray | None) -> Trajectory:
    steps = [entry.sample - 1 for entry in run.audit if entry.kind in ("unexplained", "ambiguous")]
    return replace(_build_trajectory(run, position, quat), discontinuities=np.unique(steps).astype(np.int64))


def _build_trajectory(run: Run, position: FloatArray, quat: FloatArray | None) -> Trajectory:
    joints, units, rows = run.log.joints, tuple(run.joint_units), run.on_rows
    q = rows.q if joints else None
    return Trajectory(run.name, rows.t_ns, position, run.log.files, quat, joints, units, q)


def reference_rows(reference: Side, log: Side) -> Trajectory:
    """Return the rows of a reference that are joined by lines: those with a value, on its own clock.

    All rows where nothing is joined: of static poses, and of the record that a log is compared with itself.
    """
    trajectory = reference.trajectory
    joined = reference.run is not log.run and reference.run.timed
    return trajectory.rows_with_value() if joined else trajectory


def match(reference: Trajectory, log: Trajectory, sync: Sync, *, block_rows: int = BLOCK_ROWS) -> Matched:
    """Return both sides at the log's own rows; the reference is interpolated there.

    Positions and joints are interpolated linearly, orientations on the great arc. Samples outside the time of
    the reference, inside a gap or a broken step of it, or without a position in the log are left out and
    counted.

    Args:
        reference: The reference.
        log: The log, at least one row.
        sync: The offset of the clocks.
        block_rows: Rows of the log that are matched at once; no result depends on it.
    """
    at_ns = log.t_ns + round(sync.offset * 1e9)
    q, log_q = reference.q, log.q
    by_joints = q is not None and log_q is not None and not np.isfinite(reference.position).any()
    order = None
    if q is not None and log_q is not None and not joint_mismatch(reference, log.joints, log.joint_units):
        order = joint_order(reference.joints, log.joints)
    gaps = has_gap_after(reference.t_ns)
    samples, positions, quats, joints = [], [], [], []
    for rows in row_blocks(len(at_ns), block_rows):
        first = max(int(np.searchsorted(reference.t_ns, at_ns[rows.start], side="right")) - 1, 0)
        near = slice(first, int(np.searchsorted(reference.t_ns, at_ns[rows.stop - 1])) + 1)
        known_ns = reference.t_ns[near]
        lines = partial(interpolate, known_ns=known_ns, gaps=gaps[near][: len(known_ns) - 1])
        position = lines(at_ns[rows], values=reference.position[near])
        sides = [position, log.position[rows]]
        if by_joints and q is not None and log_q is not None:
            sides = [lines(at_ns[rows], values=q[near]), log_q[rows]]
        known = np.all([np.isfinite(side).all(axis=1) for side in sides], axis=0)
        kept = np.flatnonzero(known & ~_inside_broken(at_ns[rows], reference))
        samples.append(rows.start + kept)
        positions.append(position[kept])
        if reference.quat_xyzw is not None:
            quats.append(_interpolate_orientations(at_ns[rows][kept], reference.t_ns, reference.quat_xyzw))
        if q is not None and order is not None:
            joints.append(lines(at_ns[rows][kept], values=q[near][:, order]))
    sample = np.concatenate(samples)
    outside = (reference.t_ns < at_ns[0] - ROUNDING_NS) | (reference.t_ns > at_ns[-1] + ROUNDING_NS)
    return Matched(
        sample=sample,
        t_ns=log.t_ns[sample],
        reference=np.concatenate(positions),
        actual=log.position[sample],
        reference_quat=np.concatenate(quats) if quats else None,
        actual_quat=None if log.quat_xyzw is None else log.quat_xyzw[sample],
        reference_q=np.concatenate(joints) if joints else None,
        actual_q=log_q[sample] if joints and log_q is not None else None,
        left_out=len(at_ns) - len(sample),
        reference_left_out=int(np.count_nonzero(outside)),
        sync=sync,
        alignment=Alignment(),
    )


def _inside_broken(at_ns: IntArray, reference: Trajectory) -> BoolArray:
    """Return which times lie strictly inside a broken step of the reference, shape (m,)."""
    if reference.discontinuities is None or not len(reference.discontinuities):
        return np.zeros(len(at_ns), np.bool_)
    after = np.searchsorted(reference.t_ns, at_ns, side="left")
    at_sample = reference.t_ns[np.minimum(after, len(reference.t_ns) - 1)] == at_ns
    return np.asarray(np.isin(after - 1, reference.discontinuities) & ~at_sample)


def _interpolate_orientations(at_ns: IntArray, known_ns: IntArray, quat: FloatArray) -> FloatArray:
    """Return orientations at times within the known ones, on the great arc between two of them."""
    if len(known_ns) == 1:
        return np.repeat(quat, len(at_ns), axis=0)
    after = np.clip(np.searchsorted(known_ns, at_ns), 1, len(known_ns) - 1)
    share = (at_ns - known_ns[after - 1]) / (known_ns[after] - known_ns[after - 1])
    return slerp(quat[after - 1], quat[after], np.clip(share, 0.0, 1.0))


def joint_order(reference: tuple[str, ...], log: tuple[str, ...]) -> list[int] | None:
    """Return the reference's columns of the log's joints, by name, else by place; None if these differ."""
    if not log or len(reference) != len(log):
        return None
    if set(reference) == set(log):
        return [reference.index(name) for name in log]
    return list(range(len(log)))


def joint_mismatch(reference: Trajectory, joints: tuple[str, ...], units: tuple[str, ...]) -> str:
    """Return why the joints of a log cannot be compared with the reference's, or an empty string."""
    if not reference.joints or not joints:
        return f"no joints in {'the log' if reference.joints else 'the reference'}"
    order = joint_order(reference.joints, joints)
    if order is None:
        return f"{len(joints)} joints in the log and {len(reference.joints)} in the reference"
    expected = [reference.joint_units[place] for place in order]
    names = [name for name, unit, other in zip(joints, units, expected, strict=True) if unit != other]
    return f"{', '.join(names)} revolute on one side and prismatic on the other" if names else ""


def kinematics_missing(run: Run, *hints: Hint) -> Finding:
    """Return the error of a run without kinematics; a recorded tool centre point is a way out."""
    recorded = run.log.tcp_position is not None and not run.log.externally_measured
    return run_finding(run, *NO_ROBOT, *((AS_RECORDED,) if recorded else ()), *hints)


def run_finding(run: Run, message: str, *hints: Hint, parameter: str | None = None) -> Finding:
    """Return an error about a run, with the name of its file."""
    return Finding(message, run_label(run), parameter=parameter, hints=hints)


def run_label(run: Run) -> str:
    """Return the name of a run in errors: its first file, else its name."""
    return run.log.files[0].name if run.log.files else run.name


def extent(values: FloatArray) -> float:
    """Return the largest span of the columns of values in [m] or [rad], shape (n, k); 0 without a value."""
    known = values[np.isfinite(values).all(axis=1)]
    return float(np.ptp(known, axis=0).max()) if known.size else 0.0
