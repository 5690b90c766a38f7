"""A request for a plan: the path, the arm and the law, and which of them are refused."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.planning.laws import ARCS, Arcs

Law = Literal["trapezoid", "jerk", "limits"]
LAWS: tuple[Law, ...] = ("trapezoid", "jerk", "limits")
"""How time runs: within a speed and an acceleration, within a jerk, too, or as the joints allow."""

VELOCITY, ACCELERATION = 0.5, 6.0
"""The largest speed [m/s] and acceleration [m/s2] where none is given: those of the paper's section 5."""

PERIOD = 0.005
"""From sample to sample in [s] where nothing else is given."""

LEAST, LARGEST = 1e-9, 1e9
"""Speeds, accelerations and jerks outside of this are those of no arm, and their powers leave no digits."""

NANOSECOND = 1e-9
"""What times are counted in [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """How time runs along a path.

    Attributes:
        law: Which law.
        velocity: The largest speed in [m/s]; None for the usual one, or with the law of limits for none.
        acceleration: The largest acceleration in [m/s2], likewise.
        jerk: The largest jerk in [m/s3], of that law alone.
        arcs: What the acceleration holds on arcs.
        tsp: From sample to sample in [s].
    """

    law: Law = "trapezoid"
    velocity: float | None = None
    acceleration: float | None = None
    jerk: float | None = None
    arcs: Arcs = "tangential"
    tsp: float = PERIOD

    @property
    def velocity_limit(self) -> float | None:
        """The largest speed that holds in [m/s]; None where only the joints limit it."""
        return VELOCITY if self.velocity is None and self.law != "limits" else self.velocity

    @property
    def acceleration_limit(self) -> float | None:
        """The largest acceleration that holds in [m/s2], likewise."""
        return ACCELERATION if self.acceleration is None and self.law != "limits" else self.acceleration

    @property
    def options(self) -> dict[str, Any]:
        """The options as a recording keeps them."""
        return {name: getattr(self, name) for name in self.__slots__}


def checked_timing(timing: Timing) -> Timing:
    """Return how time runs; raise an `OptionError` with every value that makes no sense."""
    faults = [*_bad_values(timing), *_bad_pairs(timing)]
    if faults:
        raise OptionError(*faults)
    return timing


def require_limits(timing: Timing, arm: Chain | None) -> None:
    """Raise an `OptionError` if the law of limits lacks some of them."""
    if faults := [*_without_limits(timing, arm)]:
        raise OptionError(*faults)


def _bad_values(timing: Timing) -> Iterator[Finding]:
    """Yield which values are not among those allowed, or no finite numbers above 0."""
    for name, words in (("law", LAWS), ("arcs", ARCS)):
        if getattr(timing, name) not in words:
            yield Finding(parameter=name, found=format_value(getattr(timing, name)), allowed=", ".join(words))
    units = {"velocity": "m/s", "acceleration": "m/s2", "jerk": "m/s3", "tsp": "s"}
    for name, unit in units.items():
        value = getattr(timing, name)
        if value is not None and not (isinstance(value, Real) and 0.0 < float(value) < math.inf):
            yield Finding(
                parameter=name, found=format_value(value), allowed=f"a finite number of {unit} above 0"
            )
        elif name == "tsp" and timing.tsp < NANOSECOND:
            yield Finding(
                parameter=name, found=format_value(value), allowed="1e-09 s or more: times are in ns"
            )
        elif value is not None and not LEAST <= float(value) <= LARGEST:
            allowed = f"{LEAST:g} to {LARGEST:g} {unit}"
            yield Finding(parameter=name, found=format_value(value), allowed=allowed)


def _bad_pairs(timing: Timing) -> Iterator[Finding]:
    """Yield which values do not go with the law."""
    if timing.law == "jerk" and timing.jerk is None:
        yield Finding(parameter="jerk", found="no jerk with the law jerk", allowed="a number of m/s3")
    if timing.law != "jerk" and timing.jerk is not None:
        yield Finding(
            parameter="jerk", found=f"a jerk with the law {timing.law}", allowed="with the law jerk"
        )
    if timing.law == "limits" and timing.arcs != "tangential":
        allowed = "with the laws trapezoid and jerk"
        yield Finding(parameter="arcs", found=f"{timing.arcs} with the law limits", allowed=allowed)


def _without_limits(timing: Timing, arm: Chain | None) -> Iterator[Finding]:
    """Yield what the law of limits has to know of the joints, and does not."""
    if timing.law != "limits":
        return
    if arm is None:
        yield Finding(parameter="law", found="limits without a robot", allowed="with a robot")
        return
    lacks = [one.name for one in arm.moving if math.isinf(one.acceleration) and one.lower < one.upper]
    if lacks:
        found = f"{arm.name} without the largest acceleration of {', '.join(lacks)}"
        allowed = "a robot file with the key acceleration in limits, in rad/s2 or m/s2"
        yield Finding(parameter="robot", found=found, allowed=allowed)


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """What is to be planned.

    Attributes:
        arm: The arm on its base and with its tool; None for path and time alone.
        start: Joint values in [rad] or [m], shape (joints,), that the first sample is to be near to; None
            for the robot's own.
        timing: How time runs along the path.
    """

    arm: Chain | None
    start: FloatArray | None
    timing: Timing
