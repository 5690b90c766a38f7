"""What the commands return: plain dataclasses with arrays, tables (`to_frame`) and JSON (`to_dict`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from urmpipe_models.chain import Chain
from urmpipe_models.kinematics import PointLog
from urmpipe_models.orientation import NAMES, angles
from urmpipe_pipeline.audit_entry import AuditEntry
from urmpipe_pipeline.grid import interpolate
from urmpipe_pipeline.joint_log import FloatArray, IntArray, JointLog, LogWarning, SourceFile, seconds
from urmpipe_pipeline.provenance import Provenance

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["pass", "fail"]
AXES = ("x", "y", "z", "norm")
SCHEMA = 1


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One ingested log: repolarized, on a uniform grid, with the arm's kinematics.

    Attributes:
        name: The log's name.
        log: The file's own rows.
        robot: The arm, or None for a log without kinematics.
        tsp: Sampling period of the grid in [s].
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
    recording: Path | None = None

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
        """From the first to the last row, in [s]."""
        return float(self.log.t_ns[-1] - self.log.t_ns[0]) / 1e9

    @property
    def rotation_recorded(self) -> FloatArray | None:
        """The orientation that the log itself recorded, on the grid, shape (g, k); None without one.

        In its own form (of a matrix as a quaternion x, y, z, w) in [rad] or [-], without jumps between the
        names of one rotation, and so linear between the rows.
        """
        form = self.log.rotation_form
        values = self.log.tcp_quat_xyzw if form == "matrix" else self.log.tcp_rotation_continuous
        if form is None or values is None:
            return None
        if not np.array_equal(self.t_ns, self.log.t_ns):
            values = interpolate(self.t_ns, self.log.t_ns, values)
        return values if angles(form) else values / np.linalg.norm(values, axis=1, keepdims=True)

    @property
    def rotation_names(self) -> tuple[str, ...]:
        """What the columns of `rotation_recorded` are called; none without one."""
        form = self.log.rotation_form
        return () if form is None else NAMES["quat_xyzw" if form == "matrix" else form]

    @property
    def joint_units(self) -> list[str]:
        """The SI unit of each joint, rad or m: by the robot, else by the unit of its column."""
        if self.robot is not None and self.log.joints:
            return ["rad" if joint.kind == "revolute" else "m" for joint in self.robot.moving]
        told = (self.log.units.get(name, "rad") for name in self.log.joints)
        return ["rad" if unit in ("rad", "deg") else "m" for unit in told]

    def joint_unit(self, per: str = "") -> str:
        """Return the SI unit of all joints: rad, m or both.

        Args:
            per: What divides it: "", "/s" or "/s2".
        """
        return " or ".join(f"{unit}{per}" for unit in sorted(set(self.joint_units) or {"rad"}, reverse=True))

    def to_frame(self) -> pd.DataFrame:
        """Return one row a grid sample: t [s], the joints, their rates, and the TCP where there is one."""
        import pandas as pd

        columns: dict[str, Any] = {"t": self.t}
        for prefix, values in (("", self.q), ("d_", self.qd), ("dd_", self.qdd)):
            columns |= {f"{prefix}{name}": values[:, i] for i, name in enumerate(self.log.joints)}
        if self.tcp is not None:
            for name, values in (
                ("p", self.tcp.position), ("v", self.tcp.velocity), ("a", self.tcp.acceleration),
            ):  # fmt: skip
                columns |= {f"{name}{axis}": values[:, i] for i, axis in enumerate("xyz")}
            columns |= {name: self.tcp.euler_zyx[:, i] for i, name in enumerate(("rz", "ry", "rx"))}
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe ingest --json` prints."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "samples": self.log.rows,
            "duration": self.duration,
            "period": self.log.period,
            "tsp": self.tsp,
            "grid_samples": len(self.t_ns),
            "clock_start": self.log.clock_start,
            "joints": list(self.log.joints),
            "source": self.log.source,
            "robot": self.robot.name if self.robot else None,
            "units": dict(self.log.units),
            "inferences": [asdict(inference) for inference in self.log.inferences],
            "repolarizations": [entry.to_dict() for entry in self.repolarizations],
            "audit": [entry.to_dict() for entry in self.audit],
            "warnings": [{"kind": w.kind, "row": w.row, "message": w.message} for w in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Where a point was, when: the reference of a comparison.

    Attributes:
        name: Its name.
        t_ns: Times from its first sample in integer [ns], shape (m,).
        position: In [m], shape (m, 3).
        files: The files it came from.
    """

    name: str
    t_ns: IntArray
    position: FloatArray
    files: tuple[SourceFile, ...] = ()

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (m,)."""
        return seconds(self.t_ns)


@dataclass(frozen=True, slots=True)
class Statistics:
    """How one quantity deviates; max, rms and p95 are of absolute values, mean and std signed, all in [m].

    Attributes:
        max: Largest absolute value.
        rms: Root mean square.
        mean: Mean.
        std: Standard deviation about the mean, of the samples themselves (n, not n - 1).
        p95: 95th percentile of the absolute values.
        t_max: When the largest stands, in [s] of the log.
        sample_max: Grid sample of the largest, from 0.
        tolerance: Largest absolute value allowed, or None.
        verdict: pass or fail, None without a tolerance.
    """

    max: float
    rms: float
    mean: float
    std: float
    p95: float
    t_max: float
    sample_max: int
    tolerance: float | None
    verdict: Verdict | None

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {key: value for key, value in asdict(self).items() if key != "tolerance"}


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """The deviation of one log from the reference.

    Attributes:
        name: The log's name, unique in the comparison.
        run: The ingested log.
        sample: Grid samples that were compared, shape (m,).
        t_ns: Their times on the log's clock in integer [ns], shape (m,).
        reference: Where the reference was, in [m], shape (m, 3).
        actual: Where the log was, in [m], shape (m, 3).
        delta: x, y, z and norm of reference - actual, in [m], shape (m, 4).
        outside: Where an axis is out of tolerance, shape (m,).
        sync_offset: t_reference = t_log + sync_offset, in [s].
        left_out: Samples of the log without a reference or without a value.
        statistics: One for each of x, y, z, norm.
        start: delta at the first compared sample in [m]: x, y, z, norm (the paper's mutual calibration).
        verdict: pass or fail.
    """

    name: str
    run: Run
    sample: IntArray
    t_ns: IntArray
    reference: FloatArray
    actual: FloatArray
    delta: FloatArray
    outside: np.ndarray[tuple[int], np.dtype[np.bool_]]
    sync_offset: float
    left_out: int
    statistics: dict[str, Statistics]
    start: tuple[float, float, float, float]
    verdict: Verdict

    @property
    def t(self) -> FloatArray:
        """Times of the compared samples in [s], shape (m,)."""
        return seconds(self.t_ns)

    @property
    def worst(self) -> int:
        """Index into the compared samples of the largest norm."""
        return int(np.argmax(self.delta[:, 3]))

    @property
    def share_out(self) -> float:
        """Share of the compared samples out of tolerance, 0..1."""
        return float(np.count_nonzero(self.outside)) / len(self.sample)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of one run."""
        worst = self.worst
        return {
            "name": self.name,
            "samples": len(self.sample),
            "left_out": self.left_out,
            "duration": float(self.t_ns[-1] - self.t_ns[0]) / 1e9,
            "sync_offset": self.sync_offset,
            "delta": {axis: self.statistics[axis].to_dict() for axis in AXES},
            "start": dict(zip(AXES, self.start, strict=True)),
            "worst": {
                "t": float(self.t[worst]),
                "sample": int(self.sample[worst]),
                "norm": float(self.delta[worst, 3]),
            },
            "out_of_tolerance": int(np.count_nonzero(self.outside)),
            "share_out": self.share_out,
            "verdict": self.verdict,
            "warnings": [{"kind": w.kind, "row": w.row, "message": w.message} for w in self.run.warnings],
        }


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Some logs held against one reference.

    Attributes:
        name: Its name.
        reference: Where the arm was asked to be.
        runs: One deviation a log.
        tolerance: Largest absolute deviation allowed in [m], by quantity; "axis" holds for x, y and z.
        warnings: What a person should know about the comparison itself.
        provenance: How to repeat it.
        recording: Where it was written.
    """

    name: str
    reference: Trajectory
    runs: tuple[Deviation, ...]
    tolerance: Mapping[str, float]
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    recording: Path | None = None

    @property
    def verdict(self) -> Verdict:
        """Pass if every log passes."""
        return "pass" if all(run.verdict == "pass" for run in self.runs) else "fail"

    def to_frame(self) -> pd.DataFrame:
        """Return one row a log and quantity: the statistics and the verdict."""
        import pandas as pd

        rows = [
            {"run": run.name, "quantity": axis, **asdict(run.statistics[axis])}
            for run in self.runs
            for axis in AXES
        ]
        return pd.DataFrame(rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe compare --json` prints."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "tolerance": dict(self.tolerance),
            "reference": self.reference.name,
            "runs": [run.to_dict() for run in self.runs],
            "warnings": [{"kind": w.kind, "row": w.row, "message": w.message} for w in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }


def json_ready(value: Any) -> Any:
    """Return a value as JSON can hold it: arrays as lists, NaN and infinities as null."""
    if isinstance(value, Mapping):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(item) for item in value]
    if isinstance(value, np.ndarray):
        return json_ready(value.tolist())
    if isinstance(value, np.generic):
        return json_ready(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
