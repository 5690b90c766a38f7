"""A window that slides along a path: what has converged leaves it at the front, new samples enter at the back.

The samples at the front converge in a few sweeps (see `least_motion`), and meanwhile those behind them come
near. Samples whose correction is so large that the linearisation says nothing about them leave the window
at the back again, so its length finds itself. A sample at the front that does not converge goes to `rescue`.

A joint whose least motion would leave its limits is held on the limit from that sample on, until least
motion would take it inwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.inverse.least_motion import DAMPING, sweep
from urmpipe_models.inverse.limits import LIMIT_ROUNDING
from urmpipe_models.inverse.solutions import BoolArray, FloatArray
from urmpipe_models.inverse.task import Task

LONGEST = 256
"""Samples of a window: NumPy outweighs Python, and the samples at the back are still worth their sweeps."""

MET = 1e-9
"""A target is met within this, in [m]; rotations as arcs of the characteristic length."""

STILL = 1e-10
"""A sample has converged once a sweep moves no joint by more, in [rad] or [m]: errors fall as their square."""

NEARLY_STILL = 1e-6
"""Here a miss that is left is one of the damping, not of the sweeps."""

LESS_DAMPING = 0.01
"""What the damping of a sample is multiplied with where it alone keeps the tool from its target ..."""

LEAST_DAMPING = 1e-15
"""... down to this, in [m2/rad2]: less is lost in the rounding of J J^T."""

FAR = 0.1
"""A correction by more, in [rad] or [m], is not trusted."""

PATIENCE = 25
"""Sweeps that the sample at the front may take."""


@dataclass(frozen=True, slots=True, eq=False)
class Rescue:
    """What became of samples, from the front of the window on, that did not converge: one or more.

    Attributes:
        q: Joint values in [rad] or [m], shape (m, joints); NaN where there are none.
    """

    q: FloatArray


@dataclass(eq=False)
class SlidingWindow:
    """Least motion along the samples of a path.

    Attributes:
        task: Where the tool shall be, a row a sample.
        lower: Limits of the joints in [rad] or [m], shape (joints,).
        upper: Limits of the joints in [rad] or [m], shape (joints,).
        start: Joint values that the first sample moves least from, shape (joints,).
        rescue: Called with the sample at the front and the joint values before it; see `Rescue`.
        q: Joint values found, shape (n, joints); NaN where there are none.
    """

    task: Task
    lower: FloatArray
    upper: FloatArray
    start: FloatArray
    rescue: Callable[[int, FloatArray], Rescue]
    q: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.task.position[0])
        self.q = np.full((count, len(self.start)), np.nan)
        self._at = 0
        self._last = self.start
        self._rate = np.zeros_like(self.start)
        self._held = np.full_like(self.start, np.nan)
        self._begin_anew(LONGEST)

    def slide(self) -> FloatArray:
        """Go along the whole path and return the joint values, shape (n, joints)."""
        while self._at < len(self.q):
            self._enlarge()
            if self._sweeps > PATIENCE:
                self._accept_rescue(self.rescue(self._at, self._last))
            elif not self._sweep():
                self._sweeps += 1
        return self.q

    def _begin_anew(self, reach: int) -> None:
        """Empty the window, to be filled with up to `reach` samples."""
        self._guess = np.empty((0, len(self.start)))
        self._damping = np.empty(0)
        self._reach = reach
        self._sweeps = 0

    def _enlarge(self) -> None:
        """Let samples in at the back, guessed on the line through the two before."""
        size = min(self._reach, len(self.q) - self._at)
        new = size - len(self._guess)
        if new <= 0:
            return
        ends = np.vstack((self._last - self._rate, self._last, self._guess))[-2:]
        line = ends[1] + np.arange(1, new + 1)[:, None] * (ends[1] - ends[0])
        line = np.where(np.isnan(self._held), line, self._held)
        self._guess = np.vstack((self._guess, line))
        self._damping = np.concatenate((self._damping, np.full(new, DAMPING)))

    def _sweep(self) -> bool:
        """Correct the window once; true if samples left it at the front."""
        window = slice(self._at, self._at + len(self._guess))
        swept = sweep(_rows(self.task, window), self._guess, self._last, self._held, self._damping)
        size = np.abs(swept.q - self._guess).max(axis=1)
        converged = _leading((size <= STILL) & (swept.miss <= MET))
        damped = (size <= NEARLY_STILL) & (swept.miss > MET)
        self._damping[damped] = np.maximum(self._damping[damped] * LESS_DAMPING, LEAST_DAMPING)
        done, changed = self._limits_allow(swept.q[:converged], None if swept.pull is None else swept.pull[:converged])
        self._leave(swept.q[:done])
        if changed:
            self._begin_anew(self._reach)
        elif converged == 0 and size[0] > FAR:
            self._guess = self._guess[:1] + (swept.q[:1] - self._guess[:1]) * FAR / size[0]
            self._shorten(1)
        else:
            trusted = _leading(size <= FAR)
            self._guess = swept.q[done:trusted]
            self._shorten
        return done > 0
