"""The accuracy of a driven arm on a path: errors over velocity, and its largest velocity within a limit."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_headline
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.path import LineArcPath, PathRows
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion, TrackingErrors
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.planned_paths.request import Law
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.run import SCHEMA

if TYPE_CHECKING:
    import pandas as pd

Decides = Literal["time", "path"]
DECIDES: tuple[Decides, ...] = ("time", "path")
"""The error that is judged: from the set point of the same time, or from the nearest point of the path."""

SLOWEST, FASTEST = 0.01, 10.0  # m/s, between which the running speed is searched for
FINE = 1.01  # ratio of the next velocity that is too fast to the running speed, at most


@dataclass(frozen=True, eq=False, repr=False)
class AccuracyResult(Result):
    """The errors of a driven arm on a path over velocity, and its largest velocity within a limit.

    Attributes:
        name: The path: its file, or its test cube.
        robot: The arm, with masses and drives, base and tool.
        rows: The rows of the path.
        law: The law of time along it.
        acceleration: The largest acceleration along the path in [m/s2], the same for all velocities; None:
            only the joints limit it.
        jerk: The largest jerk of the law jerk in [m/s3].
        period: Sample period in [s].
        force: External force on the tool in [N], along the axes of the world.
        motions: The motions at the requested velocities, in their order.
        probed: The errors of all motions that were run to find the running speed, by velocity; empty
            without a limit.
        running: The motion at the running speed; None without a limit, or if no velocity is within it.
        limit: The largest error allowed in [m], or None.
        limited_error: The error that is judged.
        loop_radius: Largest spectral radius of the sampled loop along the path [-]; below 1 it is stable.
        compiled: Whether the arm ran as machine code; else in NumPy.
        warnings: Warnings for the user.
        provenance: How to repeat it.
        recording: The file to which it was written.
    """

    name: str
    robot: Chain
    rows: PathRows
    law: Law
    acceleration: float | None
    jerk: float | None
    period: float
    force: tuple[float, float, float]
    motions: tuple[DrivenMotion, ...]
    probed: tuple[TrackingErrors, ...]
    running: DrivenMotion | None
    limit: float | None
    limited_error: Decides
    loop_radius: float
    compiled: bool
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    recording: Path | None = field(default=None, metadata={"stored": False})

    @cached_property
    def path(self) -> LineArcPath:
        """The lines and arcs through its rows."""
        return rows_to_path(self.rows)

    @cached_property
    def errors(self) -> tuple[TrackingErrors, ...]:
        """The errors at the requested velocities, in their order."""
        return tuple(motion.errors for motion in self.motions)

    def judged_error(self, errors: TrackingErrors) -> float | None:
        """Return the error that is judged in [m]; None if the motion diverged."""
        return errors.error if self.limited_error == "time" else errors.path_error

    def judge(self, errors: TrackingErrors) -> Verdict | None:
        """Return whether an error is within the limit; None without a limit."""
        if self.limit is None:
            return None
        error = self.judged_error(errors)
        return "pass" if error is not None and error <= self.limit else "fail"

    @property
    def verdict(self) -> Verdict | None:
        """Pass if each requested velocity is within the limit; None without a limit."""
        if self.limit is None:
            return None
        return "fail" if any(self.judge(errors) == "fail" for errors in self.errors) else "pass"

    @property
    def running_speed(self) -> float | None:
        """The largest velocity within the limit in [m/s]; None without a limit, or if none is."""
        return None if self.running is None else self.running.velocity

    @property
    def joint_units(self) -> list[str]:
        """The SI unit of each joint, rad or m."""
        return ["rad" if joint.kind == "revolute" else "m" for joint in self.robot.moving]

    @property
    def driven(self) -> tuple[str, ...]:
        """The joints that have a drive, in the order of the voltages."""
        passive = {drive.joint for drive in self.robot.drives if not hasattr(drive, "drive")}
        return tuple(name for name in self.robot.coordinates if name not in passive)

    def _headline(self) -> str:
        """Return its verdict, the arm, and the running speed or the largest error."""
        speed = self.running_speed
        summary = "" if self.limit is None else "no velocity within the limit"
        if speed is not None:
            summary = f"{speed:.4g} m/s within {self.limit:g} m"
        return format_headline(self.name, self.verdict, self.robot.name, summary)

    def to_frame(self) -> pd.DataFrame:
        """Return one row per velocity that was requested or tried, by velocity.

        Its columns: velocity, reached [m/s], error, path_error [m], saturated [-], and whether it was
        requested.
        """
        import pandas as pd

        requested = {errors.velocity for errors in self.errors}
        by_velocity = {errors.velocity: errors for errors in (*self.probed, *self.errors)}
        rows = [
            {
                "velocity": velocity,
                "reached": errors.reached,
                "error": np.nan if errors.error is None else errors.error,
                "path_error": np.nan if errors.path_error is None else errors.path_error,
                "saturated_share": errors.saturated_share,
                "asked": velocity in requested,
            }
            for velocity, errors in sorted(by_velocity.items())
        ]
        return pd.DataFrame(rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe accuracy --json` prints."""
        return {
            "schema": SCHEMA,
            "robot": self.robot.name,
            "path": self.name,
            "velocities": [errors.velocity for errors in self.errors],
            "reached": [errors.reached for errors in self.errors],
            "errors": [errors.error for errors in self.errors],
            "path_errors": [errors.path_error for errors in self.errors],
            "saturated_share": [errors.saturated_share for errors in self.errors],
            "diverged": [None if e.diverged is None else asdict(e.diverged) for e in self.errors],
            "running_speed": self.running_speed,
            "probed": [asdict(errors) for errors in self.probed],
            "limit": self.limit,
            "limited_error": self.limited_error,
            "loop_radius": self.loop_radius,
            "compiled": self.compiled,
            "verdict": self.verdict,
            "warnings": [warning.to_dict() for warning in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }
