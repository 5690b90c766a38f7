"""A planned path: lines and arcs, when the tool is where, and the joints that lead it there."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.display import line_of
from urmpipe_models.inverse.along_path.joint_path import JointPath
from urmpipe_models.planning.from_rows import path_of
from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.rows import PathRows
from urmpipe_models.planning.stretches import Arcs
from urmpipe_models.planning.time_law import PathMotion
from urmpipe_models.spelling import Voice
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.joint_log import LogWarning, seconds
from urmpipe_pipeline.planned_paths.motion import run_of_plan
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.results import SCHEMA, Run

if TYPE_CHECKING:
    import pandas as pd

Law = Literal["trapezoid", "jerk", "limits"]
LAWS: tuple[Law, ...] = ("trapezoid", "jerk", "limits")
"""How time runs: within a speed and an acceleration, within a jerk, too, or as the joints allow."""

FOLLOWED = 1.0 + 1e-9
"""So much of a limit may be used: rounding."""

ObstacleKind = Literal["unreachable", "jump", "singular", "too-slow"]


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Why an arm cannot move as planned.

    Attributes:
        kind: What is in the way: samples without a solution, a jump, a singular pose, or speeds that would
            have to fall below what is worth moving.
        segment: Number of the segment, from 0.
        row: Row of the path that the segment belongs to, from 1.
        t: When, in [s].
        joint: The joint that is concerned most; empty where it is the arm as a whole.
        words: What is in the way, without its place.
    """

    kind: ObstacleKind
    segment: int
    row: int
    t: float
    joint: str
    words: str


@dataclass(frozen=True, slots=True, eq=False)
class PlannedJoints:
    """The joints along a plan, a row a sample.

    Attributes:
        path: Joint values and how they follow each other.
        qd: Rates in [rad/s] or [m/s], shape (n, joints); exact, not by differences.
        qdd: Second derivatives in [rad/s2] or [m/s2], shape (n, joints); likewise.
    """

    path: JointPath
    qd: FloatArray
    qdd: FloatArray

    @property
    def q(self) -> FloatArray:
        """Joint values in [rad] or [m], shape (n, joints); NaN where there is no solution."""
        return self.path.q

    @property
    def velocity_share(self) -> FloatArray:
        """How much of its largest rate each joint uses, |q'| / limit [-], shape (n, joints); 0 without."""
        return np.asarray(np.abs(self.qd) / [joint.velocity for joint in self.path.chain.moving])

    @property
    def acceleration_share(self) -> FloatArray:
        """How much of its largest acceleration each joint uses [-], shape (n, joints); 0 without one."""
        return np.asarray(np.abs(self.qdd) / [joint.acceleration for joint in self.path.chain.moving])

    @property
    def limited(self) -> bool:
        """Whether a limit of any rate or acceleration is known."""
        moving = self.path.chain.moving
        return any(np.isfinite(one.velocity) or np.isfinite(one.acceleration) for one in moving)

    @property
    def most_used(self) -> tuple[str, str, float, int]:
        """The joint that uses most of a limit, which limit that is, how much of it [-], and the sample."""
        shares = np.stack((self.velocity_share, self.acceleration_share))
        kind, sample, joint = np.unravel_index(int(np.nanargmax(shares)), shares.shape)
        limit = ("largest rate", "largest acceleration")[int(kind)]
        return self.path.chain.coordinates[joint], limit, float(shares[kind, sample, joint]), int(sample)


@dataclass(frozen=True, eq=False, repr=False)
class PlannedPath(Result):
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
        scaled: By which factor the law's speeds were reduced for the joints, 1 for not at all.
        tsp: From sample to sample in [s].
        duration: From the first stop to the last one in [s]; the last sample may be later by less than tsp.
        t_ns: Times in integer [ns], shape (n,).
        motion: Arc length and its derivatives at the samples.
        begins: When each segment begins, and when the last one ends, in [s], shape (segments + 1,).
        passes: When each row is passed in [s], shape (rows,).
        joints: The joints; None without a robot.
        obstacles: Why the arm cannot move so; none of a plan that holds.
        warnings: What a person should know.
        provenance: How to repeat it.
        run: The plan as a run; None where it was not computed (`as_run`).
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
    scaled: float
    tsp: float
    duration: float
    t_ns: IntArray
    motion: PathMotion
    begins: FloatArray
    passes: FloatArray
    joints: PlannedJoints | None
    obstacles: tuple[Obstacle, ...]
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    run: Run | None = None
    recording: Path | None = field(default=None, metadata={"stored": False})
    log: Path | None = field(default=None, metadata={"stored": False})

    def __len__(self) -> int:
        return len(self.t_ns)

    @cached_property
    def path(self) -> LineArcPath:
        """The lines and arcs through its rows."""
        return path_of(self.rows)

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (n,)."""
        return seconds(self.t_ns)

    @property
    def position(self) -> FloatArray:
        """Where the tool shall be in [m], shape (n, 3)."""
        return self.path.points(self.motion.s).position

    @property
    def quat_xyzw(self) -> FloatArray | None:
        """How the tool shall be turned, as x, y, z, w [-], shape (n, 4); None where that is left open."""
        turning = self.path.turning
        return None if turning is None else turning.quaternions(self.motion.s)

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
        return None if self.velocity is None else self.velocity * self.scaled

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
        return "fail" if self.obstacles else "pass"

    @property
    def reached(self) -> BoolArray:
        """True of samples that the arm reaches, shape (n,); all of them without a robot."""
        return np.ones(len(self), dtype=bool) if self.joints is None else self.joints.path.reached

    @property
    def output(self) -> Path | None:
        """The recording or the log that was written."""
        return self.recording or self.log

    def as_run(self) -> Run:
        """Return the plan as a run: its joints, and the path as the recorded tool centre point.

        Raises:
            LogError: If the times need a grid without end.
        """
        return self.run or run_of_plan(
            self.name, self.robot, self.t_ns, None if self.joints is None else self.joints.q,
            self.position, self.quat_xyzw, self.warnings, self.provenance,
        )  # fmt: skip

    def _headline(self) -> str:
        """Return its verdict, the arm, its length and duration."""
        arm = self.robot.name if self.robot else "no robot"
        return line_of(self.name, self.verdict, arm, f"{self.path.total:.6g} m in {self.duration:.6g} s")

    def to_frame(self) -> pd.DataFrame:
        """Return one row a sample.

        Its columns: t [s], row, s [m], v, a, j [m/s, m/s2, m/s3], x, y, z [m], qx..qw [-] where it has an
        orientation, and of an arm the joints [rad] or [m], their rates (d_) and second derivatives (dd_).
        """
        import pandas as pd

        law = self.motion
        columns: dict[str, Any] = {"t": self.t, "row": self.row}
        columns |= {"s": law.s, "v": law.v, "a": law.a, "j": law.j}
        columns |= dict(zip("xyz", self.position.T, strict=True))
        if self.quat_xyzw is not None:
            columns |= dict(zip(("qx", "qy", "qz", "qw"), self.quat_xyzw.T, strict=True))
        if self.joints is not None:
            found = (("", self.joints.q), ("d_", self.joints.qd), ("dd_", self.joints.qdd))
            for prefix, values in found:
                names = (f"{prefix}{name}" for name in self.joints.path.chain.coordinates)
                columns |= dict(zip(names, values.T, strict=True))
        return pd.DataFrame(columns)

    def to_dict(self, voice: Voice = "python") -> dict[str, Any]:
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
            "scaled": self.scaled,
            "segments": self.segments(),
            "limits": self.limits(),
            "singularity": self._singularity(),
            "obstacles": [
                {"kind": one.kind, "segment": one.segment, "row": one.row, "t": one.t,
                 "joint": one.joint or None, "message": one.words}
                for one in self.obstacles
            ],
            "verdict": self.verdict,
            "warnings": [one.to_dict(voice) for one in self.warnings],
            "output": str(self.output) if self.output else None,
        }  # fmt: skip

    def segments(self) -> list[dict[str, Any]]:
        """Return the segments as --json has them: lengths in [m], times in [s]."""
        path, begins = self.path, self.begins.tolist()
        return [
            {
                "kind": kind,
                "row": int(path.row[k]) + 1,
                "length": float(path.length[k]),
                "radius": float(path.radius[k]) if kind == "arc" else None,
                "t": begins[k],
                "duration": begins[k + 1] - begins[k],
            }
            for k, kind in enumerate(path.kinds)
        ]

    def limits(self) -> list[dict[str, Any]]:
        """Return how much of its limits each joint uses at most, and when in [s], as --json has it."""
        if self.joints is None or not self.reached.any():
            return []
        velocity, acceleration = self.joints.velocity_share, self.joints.acceleration_share
        found = []
        for k, joint in enumerate(self.joints.path.chain.moving):
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
        nearest = None if self.joints is None else self.joints.path.nearest_singularity
        if nearest is None or self.joints is None:
            return None
        near = self.joints.path.singularity
        return {
            "row": int(self.row[nearest]),
            "t": float(self.t[nearest]),
            "smallest": float(near.smallest[nearest]),
            "manipulability": float(near.manipulability[nearest]),
        }


def _largest(shares: FloatArray, limit: float) -> float | None:
    """Return the largest share of a limit that is used; None without a limit."""
    return float(np.nanmax(shares)) if np.isfinite(limit) else None
