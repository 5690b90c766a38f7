"""What `ingest` returns: plain arrays, a table (`to_frame`) and JSON (`to_dict`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count, format_headline
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError, Voice
from urmpipe_models.kinematics.forward import PointLog
from urmpipe_models.math3d import COLUMN_NAMES, is_angular
from urmpipe_pipeline.joint_log import OWN, JointLog, LogWarning, seconds
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry
from urmpipe_pipeline.runs.grid import RESAMPLED, interpolate
from urmpipe_pipeline.runs.torques import TorqueSummary, torque_summaries

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1


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
        return seconds(self.t_ns)

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
        return torque_summaries(self.log.joints, self.robot, self.t_ns, self.tau, limited=limited)

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
        frame.attrs[OWN] = {"units": self._units()}
        return frame

    def _units(self) -> dict[str, str]:
        """Return the units by which `ingest` reads its table again."""
        units = {"t": "s"} if self.timed else {}
        for prefix, order in (("", ""), ("d_", "/s"), ("dd_", "/s2")):
            joints = zip(self.log.joints, self.joint_units, strict=True)
            units |= {f"{prefix}{name}": unit + order for name, unit in joints}
        return units | {f"p{axis}": "m" for axis in "xyz"} | dict.fromkeys(("rz", "ry", "rx"), "rad")

    def to_dict(self, voice: Voice = "python") -> dict[str, Any]:
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
            "inferences": [one.to_dict(voice) for one in self.log.inferences],
            "repolarizations": [entry.to_dict() for entry in self.repolarizations],
            "audit": [entry.to_dict() for entry in self.audit],
            "derivative": self.derivative or None,
            "torques": [one.to_dict() for one in self.torque_summaries()],
            "warnings": [one.to_dict(voice) for one in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }
