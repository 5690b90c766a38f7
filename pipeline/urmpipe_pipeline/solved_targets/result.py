"""Solved targets: joint values by target, how far the tool misses it, and why there are none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count, format_headline
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray, IntArray, TextArray
from urmpipe_models.errors import Finding, LogError
from urmpipe_models.ik.path import JointPath
from urmpipe_models.ik.solutions import Solutions, Targets, pose_errors
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.joint_log import LogWarning, ns_to_seconds
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.run import SCHEMA, Run, RunLike
from urmpipe_pipeline.solved_targets.motion import run_of_solutions
from urmpipe_pipeline.solved_targets.solution_warnings import path_warnings, unreached_warnings

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IkResult(RunLike):
    """The joint values that bring the tool centre point of an arm to n targets.

    Attributes:
        name: What the targets are called: their file.
        robot: The arm, with base and tool.
        method: What solved it: "spherical wrist", "three parallel axes" or "iterative".
        row: Data row of each target in its file, from 1, shape (n,).
        t_ns: Times of a path from its first row in integer [ns], shape (n,); None where each target stands
            for itself.
        clock_start_ns: The path's own clock at the first row in integer [ns].
        targets: Where the tool shall be.
        solutions: All solutions that were found, k a target at most; along a path one.
        chosen: Column of the solution nearest to the start, shape (n,); it means nothing where there is none.
        position_error: How far the tool is from its target by forward kinematics, in [m], shape (n, k).
        angle: By which angle it is turned away from it, in [rad], shape (n, k); None where any orientation
            will do.
        all_solutions: Whether all solutions were requested: they are shown beside the chosen ones.
        branches: Along a path all solutions of each target, if they were requested; else None.
        path: What is known of the way from target to target; None where each stands for itself.
        warnings: What a person should know.
        provenance: How to repeat it.
        motion: The chosen solutions along a path as a run; None where it was not computed (`as_run`), and
            without times.
        recording: Where it was written.
        joint_log: The joint log that was written.
    """

    name: str
    robot: Chain
    method: str
    row: IntArray
    t_ns: IntArray | None
    clock_start_ns: int
    targets: Targets
    solutions: Solutions
    chosen: IndexArray
    position_error: FloatArray
    angle: FloatArray | None
    all_solutions: bool
    branches: Solutions | None
    path: JointPath | None
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    motion: Run | None = None
    recording: Path | None = field(default=None, metadata={"stored": False})
    joint_log: Path | None = field(default=None, metadata={"stored": False})

    def __post_init__(self) -> None:
        faults = [Finding(file=self.name, found=found, allowed=allowed) for found, allowed in self._faults()]
        if faults:
            raise LogError(*faults)

    def _faults(self) -> Iterator[tuple[str, str]]:
        """Yield what does not fit together, and what is allowed."""
        n, k, joints = self.solutions.q.shape
        shapes: dict[str, tuple[NDArray[Any] | None, tuple[int, ...]]] = {
            "rows": (self.row, (n,)),
            "times": (self.t_ns, (n,)),
            "positions": (self.targets.position, (n, 3)),
            "rotations": (self.targets.rotation, (n, 3, 3)),
            "chosen solutions": (self.chosen, (n,)),
            "distances": (self.position_error, (n, k)),
            "angles": (self.angle, (n, k)),
            "branches": (None if self.branches is None else self.branches.reached[:, 0], (n,)),
            "samples of the path": (None if self.path is None else self.path.q, (n, joints)),
        }
        if not n:
            yield "no target", "one or more"
        if joints != len(self.robot.coordinates):
            yield f"{joints} joints", f"{len(self.robot.coordinates)}"
        for what, (values, allowed) in shapes.items():
            if values is not None and values.shape != allowed:
                yield f"{what} of shape {values.shape}", f"{allowed}"
        if self.t_ns is not None and (np.diff(self.t_ns) <= 0).any():
            yield "times that do not rise", "rising times"

    def __len__(self) -> int:
        return len(self.row)

    @property
    def clock_ns(self) -> IntArray | None:
        """Times on the path's own clock in integer [ns], shape (n,); None without times."""
        return None if self.t_ns is None else self.t_ns + self.clock_start_ns

    @property
    def t(self) -> FloatArray | None:
        """Times on the path's own clock in [s], shape (n,); None where each target stands for itself."""
        return None if self.clock_ns is None else ns_to_seconds(self.clock_ns)

    @property
    def joint_units(self) -> list[str]:
        """The SI unit of each joint, rad or m."""
        return ["rad" if joint.kind == "revolute" else "m" for joint in self.robot.moving]

    @property
    def reached(self) -> BoolArray:
        """True of a target that has a solution, shape (n,)."""
        return np.asarray(self.solutions.reached.any(axis=1))

    @property
    def q(self) -> FloatArray:
        """The solutions nearest to the start in [rad] or [m], shape (n, joints); NaN where there is none."""
        near: FloatArray = self._of_chosen(self.solutions.q)
        return near

    @property
    def branch(self) -> TextArray:
        """What the solutions of `q` are called, shape (n,); empty where there is none."""
        return np.where(self.reached, self._of_chosen(self.solutions.labels), "")

    @property
    def reasons(self) -> list[str | None]:
        """Why a target has no solution, one line a target; None where it has one."""
        return [self.solutions.reason(target) for target in range(len(self))]

    @property
    def verdict(self) -> Verdict:
        """Pass if the arm reaches every target, along a path without a jump or a joint that is too fast."""
        smooth = self.path is None or not (self.path.jumps or self.path.speed_violations)
        return "pass" if smooth and bool(self.reached.all()) else "fail"

    @property
    def output(self) -> Path | None:
        """The recording or the joint log that was written."""
        return self.recording or self.joint_log

    @property
    def other_branches(self) -> Solutions | None:
        """All solutions of each target, if they were requested; else None."""
        if not self.all_solutions:
            return None
        return self.solutions if self.path is None else self.branches

    def as_run(self) -> Run:
        """Return the chosen solutions as a run: a motion where the targets have times, else poses.

        Poses have no rates: no motion joins them (`Run.timed`).

        Raises:
            LogError: If the times need a grid without end.
        """
        if self.motion is not None:
            return self.motion
        why = (*(path_warnings(self.path) if self.path else ()), *unreached_warnings(self.reasons))
        return run_of_solutions(
            self.name, self.robot, self.q, self.t_ns, self.clock_start_ns, (*self.warnings, *why),
            self.provenance,
        )  # fmt: skip

    def _headline(self) -> str:
        """Return its verdict, the arm, and how many targets it reaches."""
        reached = f"{int(self.reached.sum())} of {format_count(len(self), 'target')} reached"
        return format_headline(self.name, self.verdict, self.robot.name, reached, self.method)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a solution, and one a target that has none.

        Its columns: row, t [s] of a path, branch, the joints in [rad] or [m], miss in [m], angle in [rad] of
        poses, nearest (whether it is the one nearest to the start), and reason.
        """
        import pandas as pd

        target, column = self._listed()
        reached = self.solutions.reached[target, column]
        columns: dict[str, Any] = {"row": self.row[target]}
        if self.t is not None:
            columns["t"] = self.t[target]
        columns["branch"] = np.where(reached, self.solutions.labels[target, column], "")
        q = self.solutions.q[target, column]
        columns |= {name: q[:, j] for j, name in enumerate(self.robot.coordinates)}
        columns["position_error"] = self.position_error[target, column]
        if self.angle is not None:
            columns["angle"] = self.angle[target, column]
        columns["nearest"] = reached & (self.chosen[target] == column)
        columns["reason"] = [reason or "" for reason in np.array(self.reasons, dtype=np.object_)[target]]
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe ik --json` prints."""
        found: dict[str, Any] = {
            "schema": SCHEMA,
            "name": self.name,
            "robot": self.robot.name,
            "joints": list(self.robot.coordinates),
            "method": self.method,
            "verdict": self.verdict,
            "reached": int(self.reached.sum()),
            "targets": [self._target(index, there) for index, there in enumerate(self.solutions.reached)],
        }
        if self.path is not None:
            found |= self._way(self.path)
        found["warnings"] = [one.to_dict() for one in self.warnings]
        return found | {"output": str(self.output) if self.output else None}

    def _way(self, path: JointPath) -> dict[str, Any]:
        """Return what --json has of a path: its jumps, joints too fast, and its nearest singularity."""
        nearest = path.nearest_singularity
        return {
            "singularity": None
            if nearest is None
            else {
                "row": int(self.row[nearest]),
                "t": self._time(nearest),
                "smallest": float(path.singularity.smallest[nearest]),
                "manipulability": float(path.singularity.manipulability[nearest]),
            },
            "jumps": [
                {
                    "row": int(self.row[one.sample]),
                    "from_row": int(self.row[one.last]),
                    "t": self._time(one.sample),
                    "position": list(one.position),
                    "from": one.from_branch,
                    "to": one.to_branch,
                    "steps": {step.joint: step.step for step in one.joints},
                }
                for one in path.jumps
            ],
            "speed_violations": [
                {
                    "joint": one.joint,
                    "row": int(self.row[one.first]),
                    "last_row": int(self.row[one.last]),
                    "t": self._time(one.first),
                    "speed": one.speed,
                    "allowed": one.allowed,
                }
                for one in path.speed_violations
            ],
        }

    def _time(self, index: int) -> float | None:
        """Return the time of a target in [s]; None where each stands for itself."""
        return None if self.t_ns is None else float(self.t_ns[index] + self.clock_start_ns) / 1e9

    def _target(self, index: int, there: BoolArray) -> dict[str, Any]:
        """Return a target as --json has it: every solution, and which of them is nearest to the start."""
        columns = np.flatnonzero(there)
        chosen = np.flatnonzero(columns == self.chosen[index]).tolist()
        return {
            "row": int(self.row[index]),
            **({} if self.t_ns is None else {"t": self._time(index)}),
            "solutions": [self._solution(index, int(column)) for column in columns],
            "nearest": chosen[0] if chosen else None,
            "singular": self.solutions.families(index),
            "reason": self.solutions.reason(index),
        }

    def _solution(self, index: int, column: int) -> dict[str, Any]:
        """Return a solution as --json has it."""
        return {
            "q": self.solutions.q[index, column].tolist(),
            "branch": self.solutions.labels[index, column],
            "position_error": float(self.position_error[index, column]),
            "angle": None if self.angle is None else float(self.angle[index, column]),
        }

    def _listed(self) -> tuple[IndexArray, IndexArray]:
        """Return target and column of each solution; of a target that has none the first column."""
        listed = self.solutions.reached.copy()
        listed[~self.reached, 0] = True
        target, column = np.nonzero(listed)
        return target, column

    def _of_chosen(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return what belongs to the chosen column of each target."""
        return np.asarray(values[np.arange(len(self)), self.chosen])


def missed_by(chain: Chain, solutions: Solutions, targets: Targets) -> tuple[FloatArray, FloatArray | None]:
    """Return how far the tool is from its targets by forward kinematics: a check of whatever solved them.

    Returns:
        The distances in [m] and the angles in [rad], shape (n, k); no angles where any orientation will do.
        NaN where there is no solution.
    """
    both = [pose_errors(chain, solutions.q[:, column], targets) for column in range(solutions.q.shape[1])]
    miss = np.column_stack([np.linalg.norm(position, axis=1) for position, _ in both])
    if targets.rotation is None:
        return miss, None
    return miss, np.column_stack([np.linalg.norm(turn, axis=1) for _, turn in both])
