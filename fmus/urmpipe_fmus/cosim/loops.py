"""Algebraic loops at a communication point: the torn inputs are found by Newton's method.

A sweep gives g(x), what the sources of the torn inputs are if these are x. x is sought with r = g(x) - x = 0.
The Jacobian of r is found by differences and kept, from iteration to iteration and from point to point, with
Broyden's update; it is found anew where it no longer serves.

Source: [Broyden1965]_.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from urmpipe_fmus.cosim.job import LoopJob
from urmpipe_models.elementwise import FloatArray

ITERATIONS = 50
"""Newton's method needs a handful; what is not solved by then does not converge."""

DIFFERENCE = 1e-7
"""Relative step of the differences: about the root of the precision of a double."""

SHRINKS = 6
"""A step that makes the residual larger is halved so often at most."""

DEEPEST = 40
"""A step to where the values are not finite is halved until they are, but not more often."""

USEFUL = 0.25
"""A step that leaves more of the residual than this is a reason to find the Jacobian anew."""


class NoConvergence(Exception):  # noqa: N818 - it ends the run, and is told as a result
    """A loop was not solved."""


class LoopSolver:
    """Solves a loop.

    Args:
        loop: The loop.
        values: The vector of the Reals, each in its own unit, shape (reals,).
        sweeps: The exchanges of a sweep.
        tolerance: What may be left of the residual, relative to nominal + |x|.
    """

    def __init__(
        self, loop: LoopJob, values: FloatArray, sweeps: Sequence[Callable[[], None]], tolerance: float
    ) -> None:
        self._loop, self._values, self._sweeps, self._tolerance = loop, values, sweeps, tolerance
        self._torn, self._sources = np.array(loop.torn, np.intp), np.array(loop.sources, np.intp)
        read = [p for one in loop.exchanges for t in one.gets if t.type == "Real" for p in t.places]
        self._read = np.array(read, np.intp)
        self._minimum, self._maximum = loop.minimum[self._torn], loop.maximum[self._torn]
        self._jacobian: FloatArray | None = None

    def solve(self) -> int:
        """Solve the loop: afterwards all its exchanges are those of the solution. Returns FMI's status OK.

        Raises:
            NoConvergence: If it cannot.
        """
        x = self._values[self._torn].copy()
        r = self._residual(x)
        for _ in range(ITERATIONS):
            if self._solved(x, r):
                return 0
            fresh = self._jacobian is None
            if self._jacobian is None:
                self._jacobian = self._differences(x, r)
            if not (np.isfinite(r).all() and np.isfinite(self._jacobian).all()):
                raise NoConvergence(
                    f"algebraic loop: {self._loop.ring}: found values that are not finite; start values of"
                    " its inputs, nearer to the solution, may help"
                )
            newton = -np.linalg.lstsq(self._jacobian, r, rcond=None)[0].astype(np.float64)
            following, left = self._line(x, r, newton)
            step = following - x
            if _size(left) > USEFUL * _size(r) and not (fresh and _size(left) < _size(r)):
                self._jacobian = None
            elif step.any():
                self._jacobian = self._jacobian + np.outer(left - r - self._jacobian @ step, step) / (
                    step @ step
                )
            x, r = following, left
        if self._solved(x, r):
            return 0
        raise NoConvergence(
            f"algebraic loop: {self._loop.ring}: not solved after {ITERATIONS} iterations, found a residual"
            f" of {np.max(np.abs(r)):.3g}, allowed: {self._tolerance:.3g} relative to its values"
        )

    def _residual(self, x: FloatArray) -> FloatArray:
        """Return g(x) - x."""
        self._values[self._torn] = x
        for sweep in self._sweeps:
            sweep()
            if not np.isfinite(self._values[self._read]).all():
                self._values[self._read] = 0.0  # all are read again by the next sweep
                return np.full_like(x, np.nan)  # no block of the sweep is given what is not finite
        return self._values[self._sources] - x

    def _solved(self, x: FloatArray, r: FloatArray) -> bool:
        return bool(np.all(np.abs(r) <= self._tolerance * (self._loop.nominal + np.abs(x))))

    def _differences(self, x: FloatArray, r: FloatArray) -> FloatArray:
        """Return the Jacobian of the residual by differences, to the side where the inputs may be."""
        return np.column_stack([self._column(i, x, r) for i in range(len(x))])

    def _column(self, i: int, x: FloatArray, r: FloatArray) -> FloatArray:
        """Return a column of the Jacobian; not finite if it is on neither side."""
        column = np.full_like(r, np.nan)
        h = DIFFERENCE * (self._loop.nominal[i] + abs(x[i]))
        for each in (x[i] + h, x[i] - h):
            moved = x.copy()
            moved[i] = each
            if self._minimum[i] <= each <= self._maximum[i] and not np.isfinite(column).all():
                column = (self._residual(moved) - r) / (moved[i] - x[i])
        return column

    def _line(self, x: FloatArray, r: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return a point along a step, in the range of the inputs, that leaves less, and what it leaves."""
        for halved in range(DEEPEST):
            following = np.clip(x + step, self._minimum, self._maximum)
            left = self._residual(following)
            if np.isfinite(left).all() and (_size(left) < _size(r) or halved >= SHRINKS - 1):
                break
            step = 0.5 * step
        return following, left


def _size(r: FloatArray) -> float:
    return float(np.linalg.norm(r))
