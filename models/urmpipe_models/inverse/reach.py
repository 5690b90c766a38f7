"""Why the first three joints of an arm do not reach a wrist centre, in words and figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.inverse.loop_equations import LoopEquations, Seen
from urmpipe_models.inverse.solutions import BoolArray, FloatArray, TextArray

PURE = 1e-6
"""A combination of the equations holds one of them alone if the other's share is smaller than this."""


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """What the loop equations allow.

    Attributes:
        equations: In units of the arm's size.
        size: In [m].
    """

    equations: LoopEquations
    size: float

    def side(
        self, reasons: TextArray, missed: BoolArray, seen: Seen, alpha: FloatArray, needed: FloatArray
    ) -> None:
        """Tell where joint 1 has no root of alpha . u1 = needed: the wrist centre is too near to axis 1."""
        for where in np.argwhere(missed):
            radius = seen.radius[where[-1]]
            if not np.isfinite(radius):
                reasons[tuple(where)] = "the target is not finite, allowed: finite numbers"
            elif self.equations.first.revolute:
                least = abs(needed[tuple(where)]) / np.hypot(*alpha)
                found, limit = self._told(radius, least)
                reasons[tuple(where)] = (
                    f"the wrist centre is {found} m from axis 1, allowed: {limit} m or more"
                )
            else:
                reasons[tuple(where)] = self._place(seen, where[-1])

    def elbow(self, reasons: TextArray, missed: BoolArray, share: FloatArray, value: FloatArray) -> None:
        """Tell where joint 3 has no root: the wrist centre is too near or too far.

        Args:
            reasons: Written where `missed`.
            missed: Of the shape of reasons.
            share: The combination of the equations that joint 3 is solved from.
            value: What it must give, less its constant, of the shape of reasons.
        """
        low, high = self._range(share)
        for where in np.argwhere(missed):
            reasons[tuple(where)] = self._elbow_text(share, value[tuple(where)], low, high)

    def out_of_reach(self, seen: Seen, missed: BoolArray) -> TextArray:
        """Return the reasons of an arm whose joints 1 and 3 are solved at once, empty where not missed."""
        reasons: TextArray = np.full(missed.shape, "", dtype=np.object_)
        for where in np.argwhere(missed):
            reasons[tuple(where)] = self._place(seen, where[-1])
        return reasons

    def _place(self, seen: Seen, target: int) -> str:
        """Return where the wrist centre of a target is, and that this has no such posture."""
        radius, height = seen.radius[target] * self.size, seen.height[target] * self.size
        if not np.isfinite(height):
            return "the target is not finite, allowed: finite numbers"
        return (
            f"the wrist centre is {radius:.3f} m from axis 1 and {height:.3f} m along it,"
            " allowed: where joints 1 to 3 bring it in one posture more"
        )

    def _range(self, share: FloatArray) -> tuple[float, float]:
        """Return the least and the largest value of share . A3 u3."""
        alpha = share @ self.equations.third.coefficients
        if self.equations.third.revolute:
            high = float(np.hypot(*alpha)) * self.equations.radius
            return -high, high
        vertex = -float(alpha[0] ** 2 / (4.0 * alpha[1]))
        return (vertex, np.inf) if alpha[1] > 0.0 else (-np.inf, vertex)

    def _elbow_text(self, share: FloatArray, value: float, low: float, high: float) -> str:
        """Return why joint 3 has no root."""
        if not np.isfinite(value):
            return "the target is not finite, allowed: finite numbers"
        constant = float(share @ self.equations.constant)
        values = [constant + value, constant + low, constant + high]
        if self.equations.revolute and abs(share[0]) <= PURE:
            height = self._height_to_leave_out()
            found, least, most = (float(np.sqrt(max(one - height, 0.0))) for one in values)
            what = "from axis 2" if height or self._parallel else "from the point where axes 1 and 2 meet"
        elif self.equations.revolute and abs(share[1]) <= PURE:
            (found, least, most), what = values, "along axis 2"
        else:
            (found, least, most), what = values, "off in what joint 3 must do"
        told, limit = self._told(found, least if value < low else most)
        allowed = f"{limit} m or more" if not np.isfinite(most) else None
        if allowed is None:
            ends = (limit, self._metres(most)) if value < low else (self._metres(least), limit)
            allowed = f"{ends[0]} to {ends[1]} m"
        return f"the wrist centre is {told} m {what}, allowed: {allowed}"

    @property
    def _parallel(self) -> bool:
        """Whether axes 2 and 3 are parallel."""
        return bool(np.linalg.norm(np.cross(self.equations.axis, self.equations.third.axis)) <= PURE)

    def _height_to_leave_out(self) -> float:
        """Return the square of the wrist's way along axis 2 where joint 3 does not change it, else 0."""
        return float(self.equations.constant[0] ** 2) if self._parallel else 0.0

    def _metres(self, length: float) -> str:
        """Return a length of the equations in [m]."""
        return f"{length * self.size:.3f}"

    def _told(self, found: float, limit: float) -> tuple[str, str]:
        """Return two lengths in [m] with as many digits as tell them apart."""
        digits = next((n for n in range(3, 13) if abs(found - limit) * self.size > 10.0**-n), 13)
        return f"{found * self.size:.{digits}f}", f"{limit * self.size:.{digits}f}"
