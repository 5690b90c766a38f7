"""What a diagnosis finds: causes, what stays undecided, what was not looked for, and what remains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Voice
from urmpipe_pipeline.diagnosis.formatting import format_summary
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.result import Result

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1

Kind = Literal[
    "time_lag", "clock_drift", "servo_lag", "joint_lag",
    "base_shift", "base_rotation", "base_mirrored", "tool_shift", "tool_rotation", "path_unit",
    "joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored", "turns",
    "joint_offset", "joint_scale", "compliance", "backlash", "sag",
    "link_length", "link_shift", "tilt", "own_geometry",
    "other_robot", "outliers",
]  # fmt: skip
"""What may make two sides deviate."""

STRUCTURE = ("link_length", "link_shift", "tilt")


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause: what is added to the robot or to the reading of the log so that the sides agree.

    Attributes:
        kind: What it is.
        name: What it is of: a joint as the arm calls it, two with " and " between them, a parameter or
            segment of the chain, base or tool, the side and unit of a path, the axes of a mirrored base
            ("(x, y, -z)"), the clock, all joints, another robot, rows.
        joints: The joints it is of, as the log calls them; none of other causes.
        segment: The point p1..pn that ends the segment it is of; None of other causes.
        axis: Unit vector along or about which it acts, in the frame of segment, base or tool [-]; None of
            other causes, and of a base or tool with three numbers.
        value: One number, three of base and tool, none of signs and exchanges, in `unit`. Of a backlash the
            whole play, of a sag 1 / stiffness, of a coupling -1 if the first joint includes the second, of
            outliers their least and their largest distance, or one of about both.
        unit: m, rad, s, s2 (of q'' in q), s/s, turns, rad/(N m), m/N, rad/kg, m/kg (of a sag without masses:
            of each kg at the tool centre point), or empty of a factor.
        low: Lower end of the 95 % interval of each number; none where nothing was fitted.
        high: Upper end.
        from_sample: Row of the log, from 0, from which on it holds; None for all of them.
        rows: Rows of the log, from 0, that are outliers; none of other causes.
        twins: Short names of what would move the tool centre point in the very same way.
        rms_before: Root mean square of the deviation in the unit of the diagnosis, without the causes that
            stand before this one.
        rms_after: The same without this one, too.
        rms_alone: Root mean square without this cause alone.
        effect: Largest deviation that this cause alone makes, in the unit of the diagnosis.
        breaks: Whether that is out of tolerance.
    """

    kind: Kind
    name: str
    joints: tuple[str, ...] = ()
    segment: str | None = None
    axis: tuple[float, float, float] | None = None
    value: tuple[float, ...] = ()
    unit: str = ""
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    from_sample: int | None = None
    rows: tuple[int, ...] = ()
    twins: tuple[str, ...] = ()
    rms_before: float = 0.0
    rms_after: float = 0.0
    rms_alone: float = 0.0
    effect: float = 0.0
    breaks: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object: null where a key does not apply, lists of three of base and tool."""
        interval = [_one_or_three(end) for end in (self.low, self.high)] if self.low else None
        if interval and len(self.low) > 1:
            interval = [list(pair) for pair in zip(self.low, self.high, strict=True)]
        return {
            "kind": self.kind,
            "name": self.name,
            "joint": _joint(self.joints),
            "segment": self.segment,
            "axis": None if self.axis is None else list(self.axis),
            "value": _one_or_three(self.value),
            "unit": self.unit or None,
            "interval": interval,
            "from_sample": self.from_sample,
            "rows": list(self.rows),
            "twins": list(self.twins),
            "rms_before": self.rms_before,
            "rms_after": self.rms_after,
            "rms_alone": self.rms_alone,
            "effect": self.effect,
            "breaks_tolerance": self.breaks,
        }


@dataclass(frozen=True, slots=True)
class Alternative:
    """One of several explanations between which the log does not decide.

    Attributes:
        causes: What it takes; none for the explanation that nothing of the kind is there.
        needs: The joint whose motion would decide; empty if none would.
    """

    causes: tuple[Cause, ...]
    needs: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {"causes": [one.to_dict() for one in self.causes], "needs": self.needs or None}


@dataclass(frozen=True, slots=True)
class Refused:
    """Causes that leave less, but that this motion does not determine.

    Attributes:
        causes: What was fitted.
        reason: Why it is not believed.
        needs: The joint whose motion would determine it; empty if none would.
    """

    causes: tuple[Cause, ...]
    reason: str
    needs: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        causes = [one.to_dict() for one in self.causes]
        return {"causes": causes, "reason": self.reason, "needs": self.needs or None}


@dataclass(frozen=True, slots=True)
class OwnTcp:
    """How far the kinematics of a side are from the tool centre point that it recorded itself.

    Attributes:
        name: What the side is called.
        rms: Root mean square distance in [m].
        largest: Largest distance in [m].
        agrees: Whether that is within the tolerance, with the tool as it is given.
        rms_with_tool: Root mean square distance with the constant tool that fits best in [m]; `rms` where the
            motion does not determine one.
    """

    name: str
    rms: float
    largest: float
    agrees: bool
    rms_with_tool: float = 0.0


@dataclass(frozen=True, slots=True)
class NotLookedFor:
    """Causes that these sides cannot tell.

    Attributes:
        kinds: Which.
        reason: Why not.
    """

    kinds: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class Remainder:
    """What no named cause explains.

    Attributes:
        rms: Root mean square of what stays, in the unit of the diagnosis.
        words: What it is taken for, where that is known; else empty.
        different: Whether it is so large that the two sides are probably different motions.
    """

    rms: float
    words: str = ""
    different: bool = False


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Diagnosis(Result):
    """Why a log deviates from its reference.

    Attributes:
        name: The log's name.
        verdict: That of the comparison; None if nothing was judged.
        samples: How many samples were looked at.
        unit: m of positions, rad of joints alone.
        rms: Root mean square of the deviation before, in `unit`.
        causes: What was found: clocks first, then in the order of what each takes away after those before.
        undecided: Explanations between which the log does not decide.
        not_looked_for: What these sides cannot tell, and why.
        remainder: What stays.
        sample: Rows of the log, from 0, at which `mended` stands, shape (m,).
        mended: reference - log after the causes are taken away: x, y, z in [m], shape (m, 3), or the joints
            in [rad] or [m], shape (m, joints).
        warnings: What a person should know.
        recording: Where it was written.
        comparison: The comparison that it stands in, where `urmpipe.diagnose` made it.
        seen: The shares, 0..1, on which the verdict and the causes rest: coverage of the reference, judged of
            the log's motion.
        refused: What was fitted and is not believed.
        own_tcp: How far each side with joints is from its own recorded tool centre point.
        origin: Name of the side that the causes are in, as its own tool centre point shows; empty if unknown.
    """

    name: str
    verdict: Literal["pass", "fail"] | None
    samples: int
    unit: Literal["m", "rad"]
    rms: float
    causes: tuple[Cause, ...]
    undecided: tuple[Alternative, ...]
    not_looked_for: tuple[NotLookedFor, ...]
    remainder: Remainder
    sample: IntArray
    mended: FloatArray
    warnings: tuple[LogWarning, ...] = ()
    recording: Path | None = field(default=None, metadata={"stored": False})
    comparison: Result | None = field(default=None, metadata={"stored": False})
    seen: Mapping[str, float] = field(default_factory=dict)
    refused: tuple[Refused, ...] = ()
    own_tcp: tuple[OwnTcp, ...] = ()
    origin: str = ""

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        return format_summary(self)

    def _headline(self) -> str:
        """Return the answer."""
        return f"{self.name}: {self.sentence}"

    def _notes(self) -> list[str]:
        """Return what is to be known of it."""
        return [str(one) for one in self.warnings]

    def to_frame(self) -> pd.DataFrame:
        """Return one row a cause: kind, name, value, interval and rms before and after it, in SI."""
        import pandas as pd

        return pd.DataFrame([one.to_dict() for one in self.causes], columns=list(_NO_CAUSE.to_dict()))

    def to_dict(self, voice: Voice = "python") -> dict[str, Any]:
        """Return the object that `urmpipe diagnose --json` prints."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "verdict": self.verdict,
            "samples": self.samples,
            **{"coverage": None, "judged": None, **self.seen},
            "unit": self.unit,
            "rms": self.rms,
            "causes": [one.to_dict() for one in self.causes],
            "undecided": [one.to_dict() for one in self.undecided],
            "refused": [one.to_dict() for one in self.refused],
            "own_tcp": [asdict(one) for one in self.own_tcp],
            "origin": self.origin or None,
            "not_looked_for": [asdict(one) for one in self.not_looked_for],
            "remainder": asdict(self.remainder),
            "warnings": [one.to_dict(voice) for one in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }


def rms(deviation: FloatArray) -> float:
    """Return the root mean square length of deviations in any unit, shape (m, k); 0 without any."""
    known = deviation[np.isfinite(deviation).all(axis=1)]
    return float(np.sqrt((known**2).sum(axis=1).mean())) if len(known) else 0.0


def _joint(joints: tuple[str, ...]) -> str | list[str] | None:
    """Return one joint by its name, two as a list."""
    return (joints[0] if len(joints) == 1 else list(joints)) if joints else None


def _one_or_three(numbers: tuple[float, ...]) -> float | list[float] | None:
    """Return one number as it is, several as a list."""
    return (numbers[0] if len(numbers) == 1 else list(numbers)) if numbers else None


_NO_CAUSE = Cause("joint_sign", "")
