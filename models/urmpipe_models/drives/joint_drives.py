"""What holds or turns the joints of an arm: a drive under control, or a spring and a damper alone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from urmpipe_models.drives.controller import Gains
from urmpipe_models.drives.drive import Drive


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


@dataclass(frozen=True, slots=True)
class DrivenJoint:
    """A joint with a flexible DC drive and a sampled controller.

    Attributes:
        joint: Name of a coordinate.
        drive: The constants of motor, gear and shaft; of a joint that slides with m for rad.
        period: Time between two samples of the controller in [s].
        gains: What a sample adds to the voltage.
        largest_voltage: u_max in [V].
    """

    joint: str
    drive: Drive = field(metadata={"stored": tuple[float, ...]})
    period: float
    gains: Gains = field(metadata={"stored": tuple[float, ...]})
    largest_voltage: float

    def __post_init__(self) -> None:
        """Make drive and gains of the plain numbers that a recording gives."""
        object.__setattr__(self, "drive", Drive(*self.drive))
        object.__setattr__(self, "gains", Gains(*self.gains))

    def faults(self) -> Iterator[str]:
        """Yield which constants no drive has; gains may have any sign (see `drive_controller`)."""
        yield from _at_least(SMALLEST, self.joint, dict(zip(DRIVE_KEYS, self.drive, strict=True)))
        yield from _at_least(SHORTEST_PERIOD, self.joint, {"period": self.period})
        yield from _at_least(0.0, self.joint, {"u_max": self.largest_voltage})
        for key, value in zip(GAIN_KEYS, self.gains, strict=True):
            if not math.isfinite(value):
                yield f"drives.{self.joint}.{key}: found {value:g}, allowed: a finite number"


JointDrive: TypeAlias = HeldJoint | DrivenJoint

DRIVE_KEYS = ("k", "l", "i_p", "C", "R", "L", "I1")
"""The constants of `Drive`, as robot files and units name them."""

GAIN_KEYS = ("Kphi", "Kw", "Keps")
"""The gains, as robot files and units name them."""


SMALLEST = 1e-9
"""The least value of a constant that is above 0, in its unit; FMI's min is a value that is allowed."""

SHORTEST_PERIOD = 1e-6
"""The least time between two samples of a controller in [s]."""


def _at_least(least: float, joint: str, values: Mapping[str, float]) -> Iterator[str]:
    """Yield which constants are not finite, or below the least value."""
    for key, value in values.items():
        if not least <= value < math.inf:
            yield f"drives.{joint}.{key}: found {value:g}, allowed: a finite number, {least:g} or more"
