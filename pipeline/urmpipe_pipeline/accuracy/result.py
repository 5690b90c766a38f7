"""The accuracy of a driven arm on a path: errors over velocity, and how fast it may run within a limit."""

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
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion, Errors
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
"""Which error is judged: from the set point of the same time, or from the nearest point of the path."""

SLOWEST, FASTEST = 0.01, 10.0
"""Between which velocities in [m/s] the running speed is looked for."""

FINE = 1.01
"""The running speed is known when the next velocity that is too fast is this many times it, or less."""


@dataclass(frozen=True, eq=False, repr=False)
class Accuracy(Result):
    """How far a driven arm is from its path at which velocity, and how fast it may run within a limit.

    Attributes:
        name: What the path is called: its file, or its test cube.
        robot: The arm, with masses and drives, base and tool.
        rows: The rows of the path.
        law: How time runs along it.
        acceleration: The largest acceleration along the path in [m/s2], the same for all velocities; None:
            only the joints limit it.
        jerk: The largest jerk of the law jerk in [m/s3].
        period: From sample to sample in [s].
        force: What acts on the tool from outside in [N], along the axes of the world.
        motions: Those at the velocities that were asked for, in their order.
        tried: The errors of all that were run to find the running speed, by velocity; none without a limit.
        running: The motion at the running speed; None without a limit, or if no velocity is within it.
        limit: The largest error allowed in [m], or None.
        decides: Which error is judged.
        loop_radius: Largest spectral radius of the sampled loop along the path [-]; below 1 it is stable.
        compiled: Whether the arm ran as machine code; else in NumPy.
        warnings: What a person should know.
        provenance: How to repeat it.
        recording: Where it was written.
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
    tried: tuple[Errors, ...]
    running: DrivenMotion | None
    limit: float | None
    decides: Decides
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
    def errors(self) -> tuple[Errors, ...]:
        """The errors of the velocities that were asked for, in their order."""
        return tuple(one.errors for one in self.motions)

    def judged(self, one: Errors) -> float | None:
        """Return the error that is judged in [m]; None of a motion that diverged."""
        return one.error if self.decides == "time" else one.path_error

    def within(self, one: Errors) -> Verdict | None:
        """Return whether an error is within the limit; None without a limit."""
        if self.limit is None:
            return None
        found = self.judged(one)
        return "pass" if found is not None and found <= self.limit else "fail"

    @property
    def verdict(self) -> Verdict | None:
        """Pass if every velocity that was asked for is within the limit; None without a limit."""
        if self.limit is None:
            return None
        return "fail" if any(self.within(one) == "fail" for one in self.errors) else "pass"

    @property
    def running_speed(self) -> float | None:
        """The largest velocity within the limit in [m/s]; None without a limit, or if none is."""
        return None if self.running is None else self.running.velocity

    @property
    def joint_units(self) -> list[str]:
        """The SI unit of each joint, rad or m."""
        return ["rad" if one.kind == "revolute" else "m" for one in self.robot.moving]

    @property
    def driven(self) -> tuple[str, ...]:
        """The joints that have a drive, in the order of the voltages."""
        held = {one.joint for one in self.robot.drives if not hasattr(one, "drive")}
        return tuple(name for name in self.robot.coordinates if name not in held)

    def _headline(self) -> str:
        """Return its verdict, the arm, and the running speed or the largest error."""
        found = self.running_speed
        said = "" if self.limit is None else "no velocity within the limit"
        if found is not None:
            said = f"{found:.4g} m/s within {self.limit:g} m"
        return format_headline(self.name, self.verdict, self.robot.name, said)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a velocity that was asked for or tried, by velocity.

        Its columns: velocity, reached [m/s], error, path_error [m], saturated [-], and whether it was asked
        for.
        """
        import pandas as pd

        asked = {one.velocity for one in self.errors}
        every = {one.velocity: one for one in (*self.tried, *self.errors)}
        rows = [
            {
                "velocity": one.velocity,
                "reached": one.reached,
                "error": np.nan if one.error is None else one.error,
                "path_error": np.nan if one.path_error is None else one.path_error,
                "saturated": one.saturated,
                "asked": one.velocity in asked,
            }
            for _, one in sorted(every.items())
        ]
        return pd.DataFrame(rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe accuracy --json` prints."""
        return {
            "schema": SCHEMA,
            "robot": self.robot.name,
            "path": self.name,
            "velocities": [one.velocity for one in self.errors],
            "reached": [one.reached for one in self.errors],
            "errors": [one.error for one in self.errors],
            "path_errors": [one.path_error for one in self.errors],
            "saturated": [one.saturated for one in self.errors],
            "diverged": [None if one.diverged is None else asdict(one.diverged) for one in self.errors],
            "running_speed": self.running_speed,
            "tried": [asdict(one) for one in self.tried],
            "limit": self.limit,
            "decides": self.decides,
            "loop_radius": self.loop_radius,
            "compiled": self.compiled,
            "verdict": self.verdict,
            "warnings": [one.to_dict() for one in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }
