"""The masses of an arm: what its frames carry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from numbers import Real
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import ZERO, Element, Vector

GRAVITY: tuple[float, float, float] = (0.0, 0.0, -9.81)
"""The acceleration of gravity in the world's frame, in [m/s2], where a robot file gives no other."""

PRINTED_DIGITS = 1e-2
"""Principal moments may miss what a body can have by this share of the largest: a thin rod that was turned
and printed with three digits misses it by up to 0.8 %."""

SMALLEST_RADIUS = 3e-5
"""They may also miss it by what the mass has at this radius in [m]: rounding of a point mass."""

_Six: TypeAlias = tuple[Element, Element, Element, Element, Element, Element]
_SixNumbers: TypeAlias = tuple[float, float, float, float, float, float]
_ThreeNumbers: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Inertial:
    """A mass that a frame of the arm carries; a frame may carry several.

    Attributes:
        joint: Name of the joint whose moving frame carries it; None for the base, which stands still.
        mass: m in [kg].
        centre: Its centre in the frame that carries it, in [m].
        inertia: ixx, iyy, izz, ixy, ixz, iyz about the centre, along the axes of the frame, in [kg.m2];
            the products are those of the inertia matrix, -integral of x y dm.
        source: Where the numbers come from.
    """

    joint: str | None
    mass: Element = field(metadata={"stored": float})
    centre: Vector = field(default=ZERO, metadata={"stored": _ThreeNumbers})
    inertia: _Six = field(default=(0.0,) * 6, metadata={"stored": _SixNumbers})
    source: str = ""

    @property
    def place(self) -> str:
        """The joint that carries it in words, for messages."""
        return "the base" if self.joint is None else f"joint {self.joint}"

    @property
    def matrix(self) -> tuple[Vector, Vector, Vector]:
        """The rows of the inertia matrix about the centre, in [kg.m2]."""
        ixx, iyy, izz, ixy, ixz, iyz = self.inertia
        return (ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz)

    @property
    def principal_moments(self) -> tuple[float, float, float]:
        """The moments of inertia about the principal axes through the centre, the least first, in [kg.m2]."""
        low, middle, high = np.linalg.eigvalsh(np.array(self.matrix, dtype=np.float64)).tolist()
        return low, middle, high

    def faults(self) -> Iterator[str]:
        """Yield why no body has this mass and inertia; of what is no number, as in a trace, nothing."""
        values = (self.mass, *self.centre, *self.inertia)
        if not all(isinstance(value, Real) for value in values):
            return
        where = f"inertial on {self.place}"
        if not np.isfinite(np.array(values, dtype=np.float64)).all():
            yield f"{where}: found a number that is not finite in {[*map(float, values)]}; allowed: finite"
            return
        mass = float(self.mass)
        if mass < 0.0:
            yield f"{where}: mass {mass:g} kg; allowed: 0 or more"
        if mass == 0.0 and any(self.inertia):
            yield f"{where}: mass 0 with an inertia; allowed: a mass, or no inertia"
        low, middle, high = self.principal_moments
        moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg.m2"
        slack = PRINTED_DIGITS * max(high, 0.0) + max(mass, 0.0) * SMALLEST_RADIUS**2
        if low < -slack:
            yield f"{where}: {moments}; allowed: 0 or more"
        elif low + middle < high - slack:
            yield f"{where}: {moments}; allowed: none above the sum of the other two"
