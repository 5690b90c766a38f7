"""Why the first three joints of an arm do not reach a wrist centre, in words and figures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, TextArray
from urmpipe_models.inverse.closed.loop_equations import LoopEquations, Seen

PURE = 1e-6
"""A combination of the equations holds one of them alone if the other's share is smaller than this."""

CLEAR = 1e-3
"""What is outside by more than this, in [m], is told to the millimetre."""

NOT_FINITE = "the target is not finite, allowed: finite numbers"


@dataclass(frozen=True, eq=False)
class Reach:
    """What the loop equations allow.

    Attributes:
        equations: In units of the arm's size.
        size: In [m].
    """

    equations: LoopEquations
    size: float

    def tell_side(
        self, reasons: TextArray, missed: BoolArray, seen: Seen, alpha: FloatArray, needed: FloatArray
    ) -> None:
        """Tell where joint 1 has no root of alpha . u1 = needed: the wrist centre is too near to axis 1.

        Args:
            reasons: Shape (..., n); written where `missed`.
            missed: Of the shape of reasons.
            seen: The wrist centres.
            alpha: Of the equations, in units of the arm's size, shape (2,).
            needed: In the same unit as alpha . u1, of the shape of reasons.
        """
        if not self.equations.first.revolute:
            self.tell_place(reasons, missed, seen)
            return
        radius = np.broadcast_to(seen.radius, missed.shape)[missed] * self.size
        least = np.abs(needed[missed]) / np.hypot(*alpha) * self.size
        reasons[missed] = [
            _outside(found, limit, math.inf, "from axis 1")
            for found, limit in zip(radius.tolist(), least.tolist(), strict=True)
        ]

    def tell_elbow(self, reasons: TextArray, missed: BoolArray, share: FloatArray, value: FloatArray) -> None:
        """Tell where joint 3 has no root: the wrist centre is too near or too far.

        Args:
            reasons: Shape (..., n); written where `missed`.
            missed: Of the shape of reasons.
            share: The combination of the equations that joint 3 is solved from [-], shape (2,).
            value: What it must give, less its constant, in units of the arm's size, of the shape of reasons.
        """
        found, what = self._measured(share, value[missed])
        (least, most), _ = self._measured(share, np.array(self._range(share)))
        figures, which = np.unique(found, return_inverse=True)  # both elbows have one
        reasons[missed] = _outside_range(figures, float(least), float(most), what)[which]

    def tell_place(self, reasons: TextArray, missed: BoolArray, seen: Seen) -> None:
        """Tell where a wrist centre is that no further posture reaches, by its cylinder coordinates.

        Args:
            reasons: Shape (..., n); written where `missed`.
            missed: Of the shape of reasons.
            seen: The wrist centres.
        """
        radius = np.broadcast_to(seen.radius, missed.shape)[missed] * self.size
        height = np.broadcast_to(seen.height, missed.shape)[missed] * self.size
        reasons[missed] = [
            f"the wrist centre is {r:.3f} m from axis 1 and {h:.3f} m along it,"
            " allowed: where joints 1 to 3 bring it in one posture more"
            if math.isfinite(h)
            else NOT_FINITE
            for r, h in zip(radius.tolist(), height.tolist(), strict=True)
        ]

    def _range(self, share: FloatArray) -> tuple[float, float]:
        """Return the least and the largest value of share . A3 u3."""
        alpha = share @ self.equations.third.coefficients
        if self.equations.third.revolute:
            high = float(np.hypot(*alpha)) * self.equations.radius
            return -high, high
        if alpha[1] == 0.0:
            return -math.inf, math.inf
        vertex = -float(alpha[0] ** 2 / (4.0 * alpha[1]))
        return (vertex, math.inf) if alpha[1] > 0.0 else (-math.inf, vertex)

    def _measured(self, share: FloatArray, value: FloatArray) -> tuple[FloatArray, str]:
        """Return what a combination of the equations says of the wrist centre, in [m], and in words."""
        total = float(share @ self.equations.constant) + value
        if not self.equations.revolute or min(np.abs(share)) > PURE:
            return total * self.size, "off in what joint 3 must make good"
        if abs(share[1]) <= PURE:
            return total * self.size, "along axis 2"
        where = "from axis 2" if self._parallel else "from the point where axes 1 and 2 meet"
        height = float(self.equations.constant[0] ** 2) if self._parallel else 0.0
        return np.sqrt(np.maximum(total - height, 0.0)) * self.size, where

    @cached_property
    def _parallel(self) -> bool:
        """Whether axes 2 and 3 are parallel: joint 3 does not change the wrist's way along axis 2."""
        return bool(np.linalg.norm(np.cross(self.equations.axis, self.equations.third.axis)) <= PURE)


def _outside_range(found: FloatArray, least: float, most: float, what: str) -> TextArray:
    """Return `_outside` of many figures and one range; what they share is written once."""
    clear = np.isfinite(found) & (np.maximum(least - found, found - most) > CLEAR)
    ending = f" m {what}, {_allowed(least, most, 3)}"
    texts: TextArray = np.empty(len(found), dtype=np.object_)
    texts[clear] = [f"the wrist centre is {one:.3f}{ending}" for one in found[clear].tolist()]
    texts[~clear] = [_outside(one, least, most, what) for one in found[~clear].tolist()]
    return texts


def _outside(found: float, least: float, most: float, what: str) -> str:
    """Return what was found and what is allowed, with as many digits as tell found and limit apart."""
    if not math.isfinite(found):
        return NOT_FINITE
    away = max(least - found, found - most)
    digits = 3 if away > CLEAR else min(13, 1 - math.floor(math.log10(max(away, 1e-12))))
    return f"the wrist centre is {found:.{digits}f} m {what}, {_allowed(least, most, digits)}"


def _allowed(least: float, most: float, digits: int) -> str:
    """Return a range in words."""
    if math.isinf(most):
        return f"allowed: {least:.{digits}f} m or more"
    return f"allowed: {least:.{digits}f} to {most:.{digits}f} m"
