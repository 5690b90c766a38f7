"""A planned path: lines and arcs, when the tool is where, and the joints that lead it there."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_headline
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.laws import Arcs, PathMotion
from urmpipe_models.planning.path import LineArcPath, PathRows
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.joint_log import LogWarning, ns_to_seconds
from urmpipe_pipeline.planned_paths.motion import run_of_plan
from urmpipe_pipeline.planned_paths.obstacles import Infeasibility
from urmpipe_pipeline.planned_paths.planned_joints import PlannedJoints
from urmpipe_pipeline.planned_paths.request import Law
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.run import SCHEMA, Run, RunLike

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class PlannedPath(RunLike):
    """A path of lines and arcs with its time law, and the joints of the arm that follows it.

    Attributes:
        name: What the path is called: its file, or its test cube.
        robot: The arm, with base and tool; None for path and time alone.
        rows: The rows that it was planned from.
        law: How time runs along it.
        arcs: What the acceleration holds on arcs.
        velocity: The largest speed that was asked for in [m/s]; None: only the joints limit it.
        acceleration: The largest acceleration likewise in [m/s2].
        jerk: The largest jerk likewise in [m/s3].
        speed_factor: Factor of the law's speeds for the limits of the joints, 1 for none; of the law of
            limits always 1, since it is made from them.
        tsp: From sample to sample in [s].
        duration: From the first stop to the last one in [s]; the last sample may be later by less than tsp.
        t_ns: Times in integer [ns], shape (n,).
        motion: Arc length and its derivatives at the samples.
        segment_times: When each segment begins, and when the last one ends, in [s], shape (segments + 1,).
        row_times: When each row is passed in [s], shape (rows,).
        joints: The joints; None without a robot.
        infeasibilities: Why the arm cannot move so; none of a plan that holds.
        warnings: What a person should know.
        provenance: How to repeat it.
        recording: Where it was written.
        log: The log (CSV) that was written.
    """

    name: str
    robot: Chain | None
    rows: PathRows
    law: Law
    arcs: Arcs
    velocity: float | None
    acceleration: float | None
    jerk: float | None
    speed_factor: float
    tsp: float
    duration: float
    t_ns: IntArray
    motion: PathMotion
    segment_times: FloatArray
    row_times: FloatArray
    joints: PlannedJoints | None
    infeasibilities: tuple[Infeasibility, ...]
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    recording: Path | None = field(default=None, metadata={"stored": False})
    log: Path | None = field(default=None, metadata={"stored": False})

    def __len__(self) -> int:
        return len(self.t_ns)

    @cached_property
    def path(self) -> LineArcPath:
        """The lines and arcs through its rows."""
        return rows_to_path(self.rows)

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (n,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def position(self) -> FloatArray:
        """Where the tool shall be in [m], shape (n, 3)."""
        return self.path.points(self.motion.s).position

    @property
    def quat_xyzw(self) -> FloatArray | None:
        """How the tool shall be turned, as x, y, z, w [-], shape (n, 4); None where that is left open."""
        orientation = self.path.orientation
        return None if orientation is None else orientation.quaternions(self.motion.s)

    @property
    def row(self) -> IntArray:
        """Row of the path, from 1, that each sample's segment belongs to, shape (n,)."""
        path = self.path
        return np.asarray(path.row[path.segment_at(self.motion.s)] + 1, dtype=np.int64)

    @property
    def joint_units(self) -> list[str]:
        """The SI unit of each joint, rad or m; none without a robot."""
        return ["rad" if one.kind == "revolute" else "m" for one in self.robot.moving] if self.robot else []

    @property
    def speed(self) -> float | None:
        """The speed that the path is to be run with in [m/s], after the joints' limits; None without one."""
        return None if self.velocity is None else self.velocity * self.speed_factor

    @property
    def corners(self) -> FloatArray:
        """The corners that arcs round in [m], shape (arcs, 3)."""
        return self.path.corners

    @property
    def stops(self) -> FloatArray:
        """The points at which it stops in [m], shape (k, 3), the first and the last among them."""
        return np.asarray(self.rows.position[self.path.stop_row])

    @property
    def verdict(self) -> Verdict | None:
        """Pass if the arm can move so; None without a robot."""
        if self.robot is None:
            return None
        return "fail" if self.infeasibilities else "pass"

    @property
    def reached(self) -> BoolArray:
        """True of samples that the arm reaches, shape (n,); all of them without a robot."""
        return np.ones(len(self), dtype=bool) if self.joints is None else self.joints.reached

    @property
    def output(self) -> Path | None:
        """The recording or the log that was written."""
        return self.recording or self.log

    def as_run(self) -> Run:
        """Return the plan as a run: its joints, and the path as the recorded tool centre point."""
        return run_of_plan(
            self.name, self.joints, self.tsp, self.t_ns, self.position, self.quat_xyzw, self.warnings,
            self.provenance,
        )  # fmt: skip

    def _headline(self) -> str:
        """Return its verdict, the arm, its length and duration."""
        arm = self.robot.name if self.robot else "no robot"
        return format_headline(
            self.name, self.verdict, arm, f"{self.path.total:.6g} m in {self.duration:.6g} s"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a sample.

        Its columns: t [s], row, s [m], v, a, j [m/s, m/s2, m/s3], x, y, z [m], qx..qw [-] where it has an
        orientation, and of an arm the joints [rad] or [m], their rates (d_) and second derivatives (dd_). The
        names of joints begin with q_ where one is that of another column.
        """
        import pandas as pd

        law = self.motion
        columns: dict[str, Any] = {"t": self.t, "row": self.row}
        columns |= {"s": law.s, "v": law.v, "a": law.a, "j": law.j}
        columns |= dict(zip("xyz", self.position.T, strict=True))
        if self.quat_xyzw is not None:
            columns |= dict(zip(("qx", "qy", "qz", "qw"), self.quat_xyzw.T, strict=True))
        if self.joints is not None:
            before = "q_" if columns.keys() & {*self.joints.chain.coordinates} else ""
            names = [f"{before}{name}" for name in self.joints.chain.coordinates]
            for prefix, values in (("", self.joints.q), ("d_", self.joints.qd), ("dd_", self.joints.qdd)):
                columns |= dict(zip((f"{prefix}{name}" for name in names), values.T, strict=True))
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe plan --json` prints."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "robot": self.robot.name if self.robot else None,
            "length": self.path.total,
            "duration": self.duration,
            "law": self.law,
            "velocity": self.velocity,
            "acceleration": self.acceleration,
            "speed_factor": self.speed_factor,
            "segments": self.segments(),
            "limits": self.limits(),
            "singularity": self._singularity(),
            "infeasibilities": [
                {"kind": one.kind, "segment": one.segment, "row": one.row, "s": one.s, "t": one.t,
                 "joint": one.joint or None, "message": one.message}
                for one in self.infeasibilities
            ],
            "verdict": self.verdict,
            "warnings": [one.to_dict() for one in self.warnings],
            "output": str(self.output) if self.output else None,
        }  # fmt: skip

    def segments(self) -> list[dict[str, Any]]:
        """Return the segments as --json has them: lengths in [m], times in [s]."""
        path, t = self.path, self.segment_times.tolist()
        return [
            {
                "kind": kind,
                "row": int(path.row[k]) + 1,
                "length": float(path.length[k]),
                "radius": float(path.radius[k]) if kind == "arc" else None,
                "t": t[k],
                "duration": t[k + 1] - t[k],
            }
            for k, kind in enumerate(path.kinds)
        ]

    def limits(self) -> list[dict[str, Any]]:
        """Return how much of its limits each joint uses at most, and when in [s], as --json has it."""
        if self.joints is None or not self.reached.any():
            return []
        velocity, acceleration = self.joints.velocity_share, self.joints.acceleration_share
        found = []
        for k, joint in enumerate(self.joints.chain.moving):
            shares = np.fmax(velocity[:, k], acceleration[:, k])
            found.append(
                {
                    "joint": joint.name,
                    "velocity_share": _largest(velocity[:, k], joint.velocity),
                    "acceleration_share": _largest(acceleration[:, k], joint.acceleration),
                    "t": float(self.t[np.nanargmax(shares)]) if np.nanmax(shares) > 0.0 else None,
                }
            )
        return found

    def _singularity(self) -> dict[str, Any] | None:
        """Return where the arm comes nearest to a singular pose, as `ik` does."""
        nearest = None if self.joints is None else self.joints.nearest_singularity
        if nearest is None or self.joints is None:
            return None
        near = self.joints.singularity
        return {
            "row": int(self.row[nearest]),
            "t": float(self.t[nearest]),
            "smallest": float(near.smallest[nearest]),
            "manipulability": float(near.manipulability[nearest]),
        }


def _largest(shares: FloatArray, limit: float) -> float | None:
    """Return the largest share of a limit that is used; None without a limit."""
    return float(np.nanmax(shares)) if np.isfinite(limit) else None
