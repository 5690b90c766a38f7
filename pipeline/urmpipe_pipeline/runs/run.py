"""A run: an ingested log as plain arrays, a table (`to_frame`) and JSON (`to_dict`); and a slice of it."""

from __future__ import annotations

import math
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
    """The torque of a joint over a motion, in [N.m], or the force in [N] of one that slides.

    Attributes:
        joint: Its name.
        unit: N.m or N.
        max: Largest absolute value; NaN where no sample has one.
        t_max: When, in [s]; NaN likewise.
        sample_max: In which sample, from 0.
        rms: Root of its mean square.
        effort: Its limit either way; None without one, and where the period of the rows is assumed.
        beyond: Row numbers of the samples beyond the limit, from 0, shape (k,).
        samples: How many samples have a value.
    """

    joint: str
    unit: str
    max: float
    t_max: float
    sample_max: int
    rms: float
    effort: float | None
    beyond: IntArray
    samples: int

    @property
    def effort_share(self) -> float | None:
        """The largest share of its limit that it takes, above 1 beyond it; None without limit or samples."""
        return None if self.effort is None or not self.samples else self.max / self.effort

    @property
    def share_out(self) -> float | None:
        """Share of the samples beyond the limit, 0 to 1; None without limit or samples."""
        return None if self.effort is None or not self.samples else len(self.beyond) / self.samples

    def to_dict(self) -> dict[str, Any]:
        """Return it as `urmpipe ingest --json` prints it."""
        keys = ("joint", "unit", "max", "t_max", "rms", "effort", "effort_share", "share_out")
        return {key: getattr(self, key) for key in keys}


def summarise_torques(
    names: Sequence[str],
    robot: Chain | None,
    t_ns: IntArray,
    tau: FloatArray | None,
    *,
    limited: bool = True,
) -> list[TorqueSummary]:
    """Return the torque of each joint in short; none where torques are not known.

    Args:
        names: Of the joints.
        robot: The arm, with its limits.
        t_ns: Times in integer [ns], shape (n,).
        tau: Torques in [N.m] or [N], shape (n, joints); None where they are not known.
        limited: Whether they are held against the efforts of the joints.
    """
    if robot is None or tau is None or not len(tau):
        return []
    found = []
    for name, joint, column in zip(names, robot.moving, np.asarray(tau).T, strict=True):
        size = np.abs(column)
        known = size[np.isfinite(size)]
        at = int(np.nanargmax(size)) if len(known) else 0
        effort = joint.effort if limited else math.inf
        found.append(
            TorqueSummary(
                joint=name,
                unit="N.m" if joint.kind == "revolute" else "N",
                max=float(size[at]) if len(known) else math.nan,
                t_max=float(t_ns[at]) / 1e9 if len(known) else math.nan,
                sample_max=at,
                rms=float(np.sqrt(np.mean(known**2))) if len(known) else math.nan,
                effort=effort if math.isfinite(effort) else None,
                beyond=np.flatnonzero(size > effort),
                samples=len(known),
            )
        )
    return found


@dataclass(frozen=True, slots=True, eq=False)
class RowJoints:
    """The joints on the file's own rows: where a log is judged.

    Attributes:
        t_ns: Times of the rows in integer [ns], those of the regular clock behind rounded ones, shape (n,).
        q: Repolarized joint values in [rad] or [m], shape (n, joints).
    """

    t_ns: IntArray
    q: FloatArray


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Run(Result):
    """One ingested log: repolarized, on a uniform grid, with the arm's kinematics.

    Attributes:
        name: The log's name.
        log: The file's own rows.
        robot: The arm, or None for a log without kinematics.
        tsp: Sampling period of the grid in [s]; 0 without times.
        t_ns: Grid times in integer [ns], shape (g,).
        q: Repolarized joint values in [rad] or [m], shape (g, joints).
        qd: Rates in [rad/s] or [m/s], shape (g, joints).
        qdd: Second derivatives in [rad/s2] or [m/s2], shape (g, joints).
        tcp: Motion of the tool centre point, or None without a robot.
        tcp_recorded: The position that the log itself recorded, on the grid, in [m], shape (g, 3).
        audit: What the repolarizer did and what it could not decide, by row.
        warnings: What a person should know.
        provenance: How to repeat it.
        recording: Where it was written.
        rows: The joints on the file's rows where the grid has other samples; else None.
        tau: Torques of the joints in [N.m] or [N], shape (g, joints), NaN where a rate is; None of a robot
            without masses, of still poses, and where no sample has one.
        derivative: What made the accelerations: central, savgol, recorded or planned; empty without any, and
            in recordings that do not tell.
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
        return any(one.kind == RESAMPLED for one in self.warnings)

    @property
    def on_rows(self) -> RowJoints:
        """The joints on the file's own rows.

        Raises:
            LogError: If the run was recorded when they were not kept.
        """
        if self.rows is None and self.resampled:
            said = (
                "found a recording of the grid alone, allowed: one with the log's rows; ingest the log again"
            )
            raise LogError(Finding(said, self.log.files[0].name if self.log.files else self.name))
        return self.rows or RowJoints(self.t_ns, self.q)

    @property
    def rows_ns(self) -> IntArray:
        """Times of the file's rows in integer [ns], of rounded ones those of the clock behind, shape (n,)."""
        if self.rows is not None:
            return self.rows.t_ns
        return self.log.t_ns if self.resampled else self.t_ns

    @property
    def t(self) -> FloatArray:
        """Grid times in [s], shape (g,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def repolarizations(self) -> tuple[AuditEntry, ...]:
        """Every wrap that was undone."""
        return tuple(entry for entry in self.audit if entry.kind == "wrap")

    @property
    def duration(self) -> float:
        """From the first to the last row, in [s]; 0 without times."""
        return float(self.log.t_ns[-1] - self.log.t_ns[0]) / 1e9 if self.timed else 0.0

    @property
    def timed(self) -> bool:
        """Whether its rows have times; else they are poses that no motion joins, and it has no rates."""
        return self.log.timed

    @property
    def rotation_recorded(self) -> FloatArray | None:
        """The orientation that the log itself recorded, on the grid, shape (g, k); None without one.

        In its own form (of a matrix as a quaternion x, y, z, w) in [rad] or [-], without jumps between the
        names of one rotation, and so linear between the rows; of still poses as the log has it.
        """
        form = self.log.rotation_form
        follows = self.log.tcp_rotation_continuous if self.timed else self.log.tcp_rotation
        values = self.log.tcp_quat_xyzw if form == "matrix" else follows
        if form is None or values is None:
            return None
        if not np.array_equal(self.t_ns, self.log.t_ns):
            values = interpolate(self.t_ns, self.log.t_ns, values)
        return values if is_angular(form) else values / np.linalg.norm(values, axis=1, keepdims=True)

    @property
    def rotation_names(self) -> tuple[str, ...]:
        """What the columns of `rotation_recorded` are called; none without one."""
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
        """The SI unit of the torque of each joint, N.m, or N of one that slides."""
        return ["N.m" if unit == "rad" else "N" for unit in self.joint_units]

    def torque_summaries(self) -> list[TorqueSummary]:
        """Return the torque of each joint in short; none has a limit where the period is assumed."""
        limited = not self.log.period_assumed
        return summarise_torques(self.log.joints, self.robot, self.t_ns, self.tau, limited=limited)

    def as_run(self) -> Run:
        """Return this run: what results that have a run return of it."""
        return self

    def _headline(self) -> str:
        """Return its name, its arm and how long it is."""
        arm = self.robot.name if self.robot else "no robot"
        rows = format_count(self.log.rows, "row")
        if not self.timed:
            return format_headline(self.name, arm, rows)
        grid = f"grid of {format_count(len(self.t_ns), 'sample')}"
        return format_headline(self.name, arm, f"{rows} in {self.duration:g} s", grid)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a grid sample: t [s], the joints, their rates and torques, and the TCP, where known.

        Of still poses the number of the row stands for t, from 1, and there is nothing per second.
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
        frame.attrs[URMPIPE_SOURCE] = {"units": self._units()}
        return frame

    def _units(self) -> dict[str, str]:
        """Return the units by which `ingest` reads its table again."""
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
            "inferences": [one.to_dict() for one in self.log.inferences],
            "repolarizations": [entry.to_dict() for entry in self.repolarizations],
            "audit": [entry.to_dict() for entry in self.audit],
            "derivative": self.derivative or None,
            "torques": [one.to_dict() for one in self.torque_summaries()],
            "warnings": [one.to_dict() for one in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }


def slice_run(run: Run, first: int, last: int, name: str) -> Run:
    """Return some rows of a run, both ends included, on their own clock, with the joints' turns as they are.

    The warnings stay with the whole.

    Args:
        run: The run.
        first: The first row, from 0.
        last: The last row, from 0.
        name: What the part is called.
    """
    rows = slice(first, last + 1)
    log, begins = _log(run.log, rows, name), int(run.rows_ns[first])
    grid = rows
    if run.rows is not None:  # the grid has samples of its own
        ends = int(run.rows_ns[last])
        grid = slice(*np.searchsorted(run.t_ns, [begins, ends + 1]).tolist())
    tcp = run.tcp
    if tcp is not None:
        tcp = PointLog(**{one.name: getattr(tcp, one.name)[grid] for one in fields(tcp)})
    audit = (
        replace(one, row=one.row - first, t=one.t - begins / 1e9)
        for one in run.audit
        if first < one.sample <= last
    )
    return replace(
        run, name=name, log=log, t_ns=run.t_ns[grid] - begins, q=run.q[grid], qd=run.qd[grid],
        qdd=run.qdd[grid], tcp=tcp,
        tcp_recorded=None if run.tcp_recorded is None else run.tcp_recorded[grid],
        tau=None if run.tau is None else run.tau[grid], audit=tuple(audit), warnings=(), recording=None,
        rows=None if run.rows is None else RowJoints(run.rows.t_ns[rows] - begins, run.rows.q[rows]),
    )  # fmt: skip


def _log(log: JointLog, rows: slice, name: str) -> JointLog:
    """Return some rows of a log, on their own clock."""
    begins = int(log.t_ns[rows.start])
    arrays: dict[str, Any] = {
        one: None if (values := getattr(log, one)) is None else values[rows]
        for one in ("q", "qd", "qdd", "tcp_position", "tcp_rotation")
    }
    return replace(
        log, name=name, t_ns=log.t_ns[rows] - begins, clock_start_ns=log.clock_start_ns + begins,
        first_line=log.first_line + rows.start, **arrays,
    )  # fmt: skip
