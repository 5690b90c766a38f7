"""The causes of a deviation, as a diagnosis reports them, and explanations that consist of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from urmpipe_models.elementwise import FloatArray

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
CLOCKS = ("time_lag", "clock_drift")
TOO_LARGE = "more than any arm differs by"  # reasons of refusals
CANCELLING = "they cancel each other"
NOT_CONSTANT = "what would fit changes during the log"


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
        equivalents: Short names of equivalent causes: they move the tool centre point in the same way.
        rms_before: Root mean square of the deviation in the unit of the diagnosis, without the causes that
            stand before this one.
        rms_after: The same without this one, too.
        rms_alone: Root mean square without this cause alone.
        effect: Largest deviation that this cause alone makes, in the unit of the diagnosis.
        exceeds_tolerance: Whether that is out of tolerance.
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
    equivalents: tuple[str, ...] = ()
    rms_before: float = 0.0
    rms_after: float = 0.0
    rms_alone: float = 0.0
    effect: float = 0.0
    exceeds_tolerance: bool = False

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
            "equivalents": list(self.equivalents),
            "rms_before": self.rms_before,
            "rms_after": self.rms_after,
            "rms_alone": self.rms_alone,
            "effect": self.effect,
            "exceeds_tolerance": self.exceeds_tolerance,
        }


@dataclass(frozen=True, slots=True)
class Alternative:
    """One of several explanations between which the log does not decide.

    Attributes:
        causes: What it takes; none for the explanation that nothing of the kind is there.
        discriminating_joint: The joint whose motion would decide; empty if none would.
    """

    causes: tuple[Cause, ...]
    discriminating_joint: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "causes": [one.to_dict() for one in self.causes],
            "discriminating_joint": self.discriminating_joint or None,
        }


@dataclass(frozen=True, slots=True)
class UnidentifiableCauses:
    """Causes that leave less, but that this motion does not determine.

    Attributes:
        causes: What was fitted.
        reason: Why it is not believed.
        discriminating_joint: The joint whose motion would determine it; empty if none would.
    """

    causes: tuple[Cause, ...]
    reason: str
    discriminating_joint: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        causes = [one.to_dict() for one in self.causes]
        return {
            "causes": causes,
            "reason": self.reason,
            "discriminating_joint": self.discriminating_joint or None,
        }


@dataclass(frozen=True, slots=True)
class RecordedTcpCheck:
    """Distance of the kinematics of a side from the tool centre point that it recorded.

    Attributes:
        name: What the side is called.
        rms: Root mean square distance in [m].
        max: Largest distance in [m].
        agrees: Whether that is within the tolerance, with the tool as it is given.
        rms_with_tool: Root mean square distance with the constant tool that fits best in [m]; `rms` where the
            motion does not determine one.
    """

    name: str
    rms: float
    max: float
    agrees: bool
    rms_with_tool: float = 0.0


@dataclass(frozen=True, slots=True)
class UntestedCauses:
    """Causes that these sides cannot show.

    Attributes:
        kinds: Which.
        reason: Why not.
    """

    kinds: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class Unexplained:
    """Deviation that no named cause explains.

    Attributes:
        rms: Root mean square of what stays, in the unit of the diagnosis.
        interpretation: What it is taken for, where that is known; else empty.
        is_unrelated_motion: Whether it is so large that the two sides are probably different motions.
    """

    rms: float
    interpretation: str = ""
    is_unrelated_motion: bool = False


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
