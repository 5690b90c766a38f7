"""The causes of a deviation, as a diagnosis reports them, and explanations that consist of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from urmpipe_models.elementwise import FloatArray

Kind = Literal[  # of a cause
    "time_lag", "clock_drift", "servo_lag", "joint_lag",
    "base_shift", "base_rotation", "base_mirrored", "tool_shift", "tool_rotation", "path_unit",
    "joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored", "turns",
    "joint_offset", "joint_scale", "compliance", "backlash", "sag",
    "link_length", "link_shift", "tilt", "own_geometry",
    "other_robot", "outliers",
]  # fmt: skip
STRUCTURE = ("link_length", "link_shift", "tilt")
CLOCKS = ("time_lag", "clock_drift")
TOO_LARGE = "too large for a real arm"  # reasons of refusals
CANCELLING = "the causes cancel each other"
NOT_CONSTANT = "the best value changes during the log"


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause: a change of the robot or of the reading of the log with which the sides agree.

    Attributes:
        kind: Its kind.
        name: What it is of: a joint by the arm's name, two with " and " between them, a parameter or
            segment of the chain, base or tool, the side and unit of a path, the axes of a mirrored base
            ("(x, y, -z)"), the clock, all joints, another robot, rows.
        joints: Its joints, by the log's names; empty for other causes.
        segment: The point p1..pn that ends its segment; None for other causes.
        axis: Unit vector along or about which it acts, in the frame of segment, base or tool [-]; None for
            other causes, and for a base or tool with three numbers.
        value: One number, three for base and tool, empty for signs and exchanges, in `unit`. Of a backlash
            the full play, of a sag 1 / stiffness, of a coupling -1 if the first joint includes the second, of
            outliers their least and their largest distance, or one if both are similar.
        unit: m, rad, s, s2 (of q'' in q), s/s, turns, rad/(N m), m/N, rad/kg, m/kg (of a sag without masses:
            of each kg at the tool centre point), or empty for a factor.
        low: Lower end of the 95 % interval of each number; empty if nothing was fitted.
        high: Upper end.
        from_sample: Row of the log, from 0, from which on it holds; None for all of them.
        rows: Rows of the log, from 0, that are outliers; empty for other causes.
        equivalents: Short names of equivalent causes: they move the tool centre point in the same way.
        rms_before: Root mean square of the deviation in the unit of the diagnosis, without the causes that
            precede this one.
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
        causes: Its causes; empty if none of those of the other alternatives is there.
        discriminating_joint: The joint whose motion would decide; empty if none would.
    """

    causes: tuple[Cause, ...]
    discriminating_joint: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "causes": [cause.to_dict() for cause in self.causes],
            "discriminating_joint": self.discriminating_joint or None,
        }


@dataclass(frozen=True, slots=True)
class UnidentifiableCauses:
    """Causes that leave less, but that this motion does not determine.

    Attributes:
        causes: The fitted causes.
        reason: Why they are refused.
        discriminating_joint: The joint whose motion would determine them; empty if none would.
    """

    causes: tuple[Cause, ...]
    reason: str
    discriminating_joint: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "causes": [cause.to_dict() for cause in self.causes],
            "reason": self.reason,
            "discriminating_joint": self.discriminating_joint or None,
        }


@dataclass(frozen=True, slots=True)
class RecordedTcpCheck:
    """Distance of the kinematics of a side from the tool centre point that it recorded.

    Attributes:
        name: Name of the side.
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
        kinds: Their kinds.
        reason: Why they are not shown.
    """

    kinds: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class Unexplained:
    """Deviation that no named cause explains.

    Attributes:
        rms: Its root mean square, in the unit of the diagnosis.
        interpretation: Its probable reason, or empty.
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
