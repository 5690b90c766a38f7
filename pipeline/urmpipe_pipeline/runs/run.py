"""A run: an ingested log as plain arrays.

- `Run`: the arrays, as a table (`to_frame`) and as JSON (`to_dict`); `RunLike`: what has one.
- `TorqueSummary`, `summarise_torques`: the largest and the rms torque of each joint, and its effort limit.
- `slice_run`: some rows of a run.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count, format_headline
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError
from urmpipe_models.kinematics.forward import PointLog
from urmpipe_models.math3d import COLUMN_NAMES, is_angular
from urmpipe_pipeline.joint_log import URMPIPE_SOURCE, JointLog, LogWarning, ns_to_seconds
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.repolarization.audit import AuditEntry
from urmpipe_pipeline.runs.grid import RESAMPLED, interpolate

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1


@dataclass(frozen=True, slots=True)
class TorqueSummary:
    """The torque of a revolute joint in [N.m], or the force of a prismatic joint in [N], over a motion.

    Attributes:
        joint: Name of the joint.
        unit: N.m or N.
        max: Largest absolute value; NaN if no sample has a value.
        t_max: Time of the largest value in [s]; NaN likewise.
        sample_max: Sample of the largest value, from 0.
        rms: Root mean square.
        effort: Limit in both directions; None without one, and where the period of the rows is assumed.
        samples_beyond: Samples beyond the limit, from 0, shape (k,).
        samples: Number of samples with a value.
    """

    joint: str
    unit: str
    max: float
    t_max: float
    sample_max: int
    rms: float
    effort: float | None
    samples_beyond: IntArray
    samples: int

    @property
    def effort_share(self) -> float | None:
        """The largest value divided by the limit; None without limit or samples."""
        return None if self.effort is None or not self.samples else self.max / self.effort

    @property
    def out_fraction(self) -> float | None:
        """Share of the samples beyond the limit, 0 to 1; None without limit or samples."""
        return None if self.effort is None or not self.samples else len(self.samples_beyond) / self.samples

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe ingest --json` prints."""
        keys = ("joint", "unit", "max", "t_max", "rms", "effort", "effort_share", "out_fraction")
        return {key: getattr(self, key) for key in keys}


def summarise_torques(
    names: Sequence[str],
    robot: Chain | None,
    t_ns: IntArray,
    tau: FloatArray | None,
    *,
    limited: bool = True,
) -> list[TorqueSummary]:
    """Return the torque of each joint over a motion; none if torques are unknown.

    Args:
        names: Names of the joints.
        robot: The arm, with its effort limits.
        t_ns: Times in integer [ns], shape (n,).
        tau: Torques in [N.m] or [N], shape (n, joints); None if they are unknown.
        limited: Whether they are compared with the effort limits.
    """
    if robot is None or tau is None or not len(tau):
        return []
    summaries = []
    for name, joint, column in zip(names, robot.moving, np.asarray(tau).T, strict=True):
        size = np.abs(column)
        finite = size[np.isfinite(size)]
        largest = int(np.nanargmax(size)) if len(finite) else 0
        effort = joint.effort if limited else math.inf
        summary = TorqueSummary(
            joint=name,
            unit="N.m" if joint.kind == "revolute" else "N",
            max=float(size[largest]) if len(finite) else math.nan,
            t_max=float(t_ns[largest]) / 1e9 if len(finite) else math.nan,
            sample_max=largest,
            rms=float(np.sqrt(np.mean(finite**2))) if len(finite) else math.nan,
            effort=effort if math.isfinite(effort) else None,
            samples_beyond=np.flatnonzero(size > effort),
            samples=len(finite),
        )
        summaries.append(summary)
    return summaries


@dataclass(frozen=True, slots=True, eq=False)
class RowJoints:
    """The joints on the rows of the file, where deviations are measured.

    Attributes:
        t_ns: Times of the rows in integer [ns], shape (n,); of quantised timestamps the regular times.
        q: Repolarized joint values in [rad] or [m], shape (n, joints).
    """

    t_ns: IntArray
    q: FloatArray


class RunLike(Result):
    """A result that is a run, or contains one."""

    __slots__ = ()

    @abstractmethod
    def as_run(self) -> Run:
        """Return the run."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Run(RunLike):
    """One ingested log: repolarized, on a uniform grid, with the arm's kinematics.

    Attributes:
        name: Name of the log.
        log: The rows of the file.
        robot: The arm; None for a log without kinematics.
        tsp: Sampling period of the grid in [s]; 0 without times.
        t_ns: Grid times in integer [ns], shape (g,).
        q: Repolarized joint values in [rad] or [m], shape (g, joints).
        qd: Joint velocities in [rad/s] or [m/s], shape (g, joints).
        qdd: Joint accelerations in [rad/s2] or [m/s2], shape (g, joints).
        tcp: Motion of the tool centre point; None without a robot.
        tcp_recorded: The recorded position of the tool centre point on the grid in [m], shape (g, 3).
        audit: What the repolarizer changed and what is ambiguous, by row.
        warnings: Warnings about the log, the robot and the motion.
        provenance: How to repeat it.
        recording: Path of its recording.
        rows: The joints on the rows of the file if the grid has other samples; else None.
        tau: Torques of the joints in [N.m] or [N], shape (g, joints), NaN where a derivative is; None for a
            robot without masses, for static poses, and if no sample has a torque.
        derivative: Source of the accelerations: central, savgol, recorded or planned; empty without any, and
            in recordings that do not contain it.
    """

    name: str
    log: JointLog
    robot: Chain | None
    tsp: float
    t_ns: IntArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    tcp: PointLog | None
    tcp_recorded: FloatArray | None
    audit: tuple[AuditEntry, ...]
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    recording: Path | None = field(default=None, metadata={"stored": False})
    rows: RowJoints | None = None
    tau: FloatArray | None = field(default=None, metadata={"path": "joints/torque"})
    derivative: str = ""

    @property
    def resampled(self) -> bool:
        """Whether its grid has other samples than the rows of the log."""
        return any(warning.kind == RESAMPLED for warning in self.warnings)

    @property
    def on_rows(self) -> RowJoints:
        """The joints on the rows of the file.

        Raises:
            LogError: If the recording of the run has only the grid.
        """
        if self.rows is None and self.resampled:
            message = "found a recording of the grid alone, allowed: one with the log's rows"
            file = self.log.files[0].name if self.log.files else self.name
            raise LogError(Finding(f"{message}; ingest the log again", file))
        return self.rows or RowJoints(self.t_ns, self.q)

    @property
    def rows_ns(self) -> IntArray:
        """Times of the rows as in `RowJoints`, in integer [ns], shape (n,)."""
        if self.rows is not None:
            return self.rows.t_ns
        return self.log.t_ns if self.resampled else self.t_ns

    @property
    def t(self) -> FloatArray:
        """Grid times in [s], shape (g,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def repolarizations(self) -> tuple[AuditEntry, ...]:
        """The wraps that were undone."""
        return tuple(entry for entry in self.audit if entry.kind == "wrap")

    @property
    def duration(self) -> float:
        """From the first to the last row, in [s]; 0 without times."""
        return float(self.log.t_ns[-1] - self.log.t_ns[0]) / 1e9 if self.timed else 0.0

    @property
    def timed(self) -> bool:
        """Whether its rows have times; else they are static poses without velocities."""
        return self.log.timed

    @property
    def rotation_recorded(self) -> FloatArray | None:
        """The recorded orientation on the grid, shape (g, k); None without one.

        In the form of the log (a matrix as a quaternion x, y, z, w) in [rad] or [-], continuous, so that it
        can be interpolated; of static poses as in the log.
        """
        form = self.log.rotation_form
        rotation = self.log.tcp_rotation_continuous if self.timed else self.log.tcp_rotation
        values = self.log.tcp_quat_xyzw if form == "matrix" else rotation
        if form is None or values is None:
            return None
        if not np.array_equal(self.t_ns, self.log.t_ns):
            values = interpolate(self.t_ns, self.log.t_ns, values)
        return values if is_angular(form) else values / np.linalg.norm(values, axis=1, keepdims=True)

    @property
    def rotation_names(self) -> tuple[str, ...]:
        """Names of the columns of `rotation_recorded`; none without one."""
        form = self.log.rotation_form
        return () if form is None else COLUMN_NAMES["quat_xyzw" if form == "matrix" else form]

    @property
    def joint_units(self) -> list[str]:
        """The SI unit of each joint, rad or m: by the robot, else by the unit of its column."""
        if self.robot is not None and self.log.joints:
            return ["rad" if joint.kind == "revolute" else "m" for joint in self.robot.moving]
        return list(self.log.joint_units)

    @property
    def torque_units(self) -> list[str]:
        """The SI unit of the torque of each joint: N.m of a revolute, N of a prismatic joint."""
        return ["N.m" if unit == "rad" else "N" for unit in self.joint_units]

    def torque_summaries(self) -> list[TorqueSummary]:
        """Return the torque of each joint over the run; without limits if the period is assumed."""
        limited = not self.log.period_assumed
        return summarise_torques(self.log.joints, self.robot, self.t_ns, self.tau, limited=limited)

    def as_run(self) -> Run:
        """Return this run; results that contain a run return that."""
        return self

    def _headline(self) -> str:
        arm = self.robot.name if self.robot else "no robot"
        rows = format_count(self.log.rows, "row")
        if not self.timed:
            return format_headline(self.name, arm, rows)
        grid = f"grid of {format_count(len(self.t_ns), 'sample')}"
        return format_headline(self.name, arm, f"{rows} in {self.duration:g} s", grid)

    def to_frame(self) -> pd.DataFrame:
        """Return one row per grid sample: t [s], joints, their derivatives and torques, and the TCP.

        Static poses have the number of the row, from 1, in place of t, and no derivatives.
        """
        import pandas as pd

        columns: dict[str, Any] = {"t": self.t} if self.timed else {"row": np.arange(1, len(self.q) + 1)}
        kinds = 3 if self.timed else 1
        for prefix, values in (("", self.q), ("d_", self.qd), ("dd_", self.qdd))[:kinds]:
            columns |= {f"{prefix}{name}": values[:, i] for i, name in enumerate(self.log.joints)}
        if self.tau is not None:
            columns |= {f"tau_{name}": self.tau[:, i] for i, name in enumerate(self.log.joints)}
        if self.tcp is not None:
            for name, values in (
                ("p", self.tcp.position), ("v", self.tcp.velocity), ("a", self.tcp.acceleration),
            )[:kinds]:  # fmt: skip
                columns |= {f"{name}{axis}": values[:, i] for i, axis in enumerate("xyz")}
            columns |= {name: self.tcp.euler_zyx[:, i] for i, name in enumerate(("rz", "ry", "rx"))}
        frame = pd.DataFrame(columns)
        frame.attrs[URMPIPE_SOURCE] = {"units": self._column_units()}
        return frame

    def _column_units(self) -> dict[str, str]:
        units = {"t": "s"} if self.timed else {}
        for prefix, order in (("", ""), ("d_", "/s"), ("dd_", "/s2")):
            joints = zip(self.log.joints, self.joint_units, strict=True)
            units |= {f"{prefix}{name}": unit + order for name, unit in joints}
        return units | {f"p{axis}": "m" for axis in "xyz"} | dict.fromkeys(("rz", "ry", "rx"), "rad")

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe ingest --json` prints."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "samples": self.log.rows,
            "duration": self.duration if self.timed else None,
            "period": self.log.period if self.timed else None,
            "tsp": self.tsp if self.timed else None,
            "grid_samples": len(self.t_ns),
            "clock_start": self.log.clock_start if self.timed else None,
            "joints": list(self.log.joints),
            "source": self.log.source,
            "robot": self.robot.name if self.robot else None,
            "units": dict(self.log.units),
            "inferences": [inference.to_dict() for inference in self.log.inferences],
            "repolarizations": [entry.to_dict() for entry in self.repolarizations],
            "audit": [entry.to_dict() for entry in self.audit],
            "derivative": self.derivative or None,
            "torques": [summary.to_dict() for summary in self.torque_summaries()],
            "warnings": [warning.to_dict() for warning in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }


def slice_run(run: Run, first: int, last: int, name: str) -> Run:
    """Return some rows of a run, both ends included, with times from its first row.

    The turns of the joints stay as they are; warnings are left out.

    Args:
        run: The run.
        first: The first row, from 0.
        last: The last row, from 0.
        name: Name of the slice.
    """
    rows = slice(first, last + 1)
    start_ns = int(run.rows_ns[first])
    grid = rows
    if run.rows is not None:  # the grid has other samples than the rows
        end_ns = int(run.rows_ns[last])
        grid = slice(*np.searchsorted(run.t_ns, [start_ns, end_ns + 1]).tolist())
    tcp = run.tcp
    if tcp is not None:
        tcp = PointLog(**{part.name: getattr(tcp, part.name)[grid] for part in fields(tcp)})
    audit = (
        replace(entry, row=entry.row - first, t=entry.t - start_ns / 1e9)
        for entry in run.audit
        if first < entry.sample <= last
    )
    return replace(
        run, name=name, log=_slice_log(run.log, rows, name), t_ns=run.t_ns[grid] - start_ns, q=run.q[grid],
        qd=run.qd[grid], qdd=run.qdd[grid], tcp=tcp,
        tcp_recorded=None if run.tcp_recorded is None else run.tcp_recorded[grid],
        tau=None if run.tau is None else run.tau[grid], audit=tuple(audit), warnings=(), recording=None,
        rows=None if run.rows is None else RowJoints(run.rows.t_ns[rows] - start_ns, run.rows.q[rows]),
    )  # fmt: skip


def _slice_log(log: JointLog, rows: slice, name: str) -> JointLog:
    start_ns = int(log.t_ns[rows.start])
    arrays: dict[str, Any] = {
        key: None if (values := getattr(log, key)) is None else values[rows]
        for key in ("q", "qd", "qdd", "tcp_position", "tcp_rotation", "file_rows")
    }
    return replace(
        log, name=name, t_ns=log.t_ns[rows] - start_ns, clock_start_ns=log.clock_start_ns + start_ns,
        first_line=log.first_line + rows.start, **arrays,
    )  # fmt: skip
