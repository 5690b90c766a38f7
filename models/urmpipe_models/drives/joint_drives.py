"""What holds or turns the joints of an arm: a drive under control, or a spring and a damper alone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from urmpipe_models.drives.controller import Gains
from urmpipe_models.drives.drive import Drive
from urmpipe_models.elementwise import Element


@dataclass(frozen=True, slots=True)
class HeldJoint:
    """A joint without a drive, held where it starts by a spring and a damper.

    Attributes:
        joint: Name of a coordinate.
        stiffness: k in [N.m/rad], of a joint that slides in [N/m].
        damping: l in [N.m.s/rad], of a joint that slides in [N.s/m].
    """

    joint: str
    stiffness: float
    damping: float

    def faults(self) -> Iterator[str]:
        """Yield which constants no spring and damper have."""
        yield from _at_least(SMALLEST, self.joint, {"k": self.stiffness})
        yield from _at_least(0.0, self.joint, {"l": self.damping})


class ReliefSpring(NamedTuple):
    """A spring without mass beside a drive, which carries a part of the load: k (rest - q).

    Attributes:
        stiffness: k in [N.m/rad], of a joint that slides in [N/m]; 0: there is none.
        rest: Where it gives no torque, in [rad] or [m].
    """

    stiffness: Element
    rest: Element


NO_SPRING = ReliefSpring(0.0, 0.0)
"""Of a drive that carries all of the load."""


@dataclass(frozen=True, slots=True)
class DrivenJoint:
    """A joint with a flexible DC drive and a sampled controller.

    Attributes:
        joint: Name of a coordinate.
        drive: The constants of motor, gear and shaft; of a joint that slides with m for rad.
        period: Time between two samples of the controller in [s].
        gains: What a sample adds to the voltage.
        largest_voltage: u_max in [V].
        spring: What relieves the drive of a part of its load.
    """

    joint: str
    drive: Drive = field(metadata={"stored": tuple[float, ...]})
    period: float
    gains: Gains = field(metadata={"stored": tuple[float, ...]})
    largest_voltage: float
    spring: ReliefSpring = field(default=NO_SPRING, metadata={"stored": tuple[float, ...]})

    def __post_init__(self) -> None:
        """Make drive, gains and spring of the plain numbers that a recording gives."""
        object.__setattr__(self, "drive", Drive(*self.drive))
        object.__setattr__(self, "gains", Gains(*self.gains))
        object.__setattr__(self, "spring", ReliefSpring(*self.spring))

    def faults(self) -> Iterator[str]:
        """Yield which constants no drive has; gains may have any sign (see `drive_controller`)."""
        yield from _at_least(SMALLEST, self.joint, dict(zip(DRIVE_KEYS, self.drive, strict=True)))
        yield from _at_least(SHORTEST_PERIOD, self.joint, {"period": self.period})
        yield from _at_least(0.0, self.joint, {"u_max": self.largest_voltage})
        yield from _at_least(0.0, self.joint, {SPRING_KEYS[0]: self.spring.stiffness})
        free = zip((*GAIN_KEYS, SPRING_KEYS[1]), (*self.gains, self.spring.rest), strict=True)
        for key, value in free:
            if not math.isfinite(value):
                yield f"drives.{self.joint}.{key}: found {value:g}, allowed: a finite number"


JointDrive: TypeAlias = HeldJoint | DrivenJoint

DRIVE_KEYS = ("k", "l", "i_p", "C", "R", "L", "I1")
"""The constants of `Drive`, as robot files and units name them."""

GAIN_KEYS = ("Kphi", "Kw", "Keps")
"""The gains, as robot files and units name them."""

SPRING_KEYS = ("k_spring", "rest_spring")
"""The constants of `ReliefSpring`, as robot files and units name them."""


SMALLEST = 1e-9
"""The least value of a constant that is above 0, in its unit; FMI's min is a value that is allowed."""

SHORTEST_PERIOD = 1e-6
"""The least time between two samples of a controller in [s]."""


def _at_least(least: float, joint: str, values: Mapping[str, float]) -> Iterator[str]:
    """Yield which constants are not finite, or below the least value."""
    for key, value in values.items():
        if not least <= value < math.inf:
            yield f"drives.{joint}.{key}: found {value:g}, allowed: a finite number, {least:g} or more"
