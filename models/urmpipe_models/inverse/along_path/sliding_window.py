"""A window that slides along a path: what converged leaves it at the front, new samples enter at the back.

The samples at the front converge in a few sweeps (see `path_newton`), and meanwhile those behind them come
near. Samples whose correction is so large that the linearisation says nothing about them leave the window
at the back again, so its length finds itself. A sample at the front that does not converge goes to `rescue`.

A joint whose least motion would leave its limits is held on the limit from that sample on, until least
motion would take it inwards (see `holding`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.along_path import holding
from urmpipe_models.inverse.along_path.path_newton import DAMPING, sweep
from urmpipe_models.inverse.iterative.task import task_of
from urmpipe_models.inverse.limits import limits_of
from urmpipe_models.inverse.targets import Targets

LONGEST = 384
"""Samples of a window: NumPy outweighs Python, and the samples at the back are still worth their sweeps.

What is found depends on it by 1e-8 rad a step, and by 1e-5 rad near singular poses: what the nanometre leaves
open, as how much is damped depends on the sweeps that a sample took."""

MET = 9e-10
"""A target is met within this, in [m]; rotations times `turn_length`: a nanometre less what
a converged sample may still move."""

STILL = 1e-10
"""A sample has converged once a sweep moves no joint by more, in [rad] or [m]."""

NEARLY_STILL = 1e-6
"""Here a miss that is left is one of the damping, not of the sweeps."""

LESS_DAMPING = 0.1
"""What the damping of a sample is multiplied with where it alone keeps the tool from its target ..."""

LEAST_DAMPING = 1e-15
"""... down to this, in [m2/rad2]: less is lost in the rounding of J J^T."""

FAR = 0.1
"""A correction by more, in [rad] or [m], is not trusted."""

PATIENCE = 25
"""Sweeps that the sample at the front may take."""


@dataclass(eq=False)
class SlidingWindow:
    """Least motion along the samples of a path.

    Attributes:
        chain: The arm.
        targets: Where the tool shall be, one a sample.
        start: Joint values in [rad] or [m] that the first sample moves least from, shape (joints,).
        rescue: Given the index of a sample at the front that does not converge and the joint values before
            it, returns those of this sample and of as many more as it likes, shape (m, joints); NaN where
            there are none.
        q: Joint values found in [rad] or [m], shape (n, joints); NaN where there are none.
    """

    chain: Chain
    targets: Targets
    start: FloatArray
    rescue: Callable[[int, FloatArray], FloatArray]
    q: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.q = np.full((len(self.targets), len(self.start)), np.nan)
        self._lower, self._upper = limits_of(self.chain)
        self._held = np.full_like(self.start, np.nan)
        self._at = 0
        self._last = self.start
        self._rate = np.zeros_like(self.start)
        self._reach = LONGEST
        self._empty()

    def slide(self, progress: Callable[[float], None]) -> FloatArray:
        """Go along the whole path and return the joint values in [rad] or [m], shape (n, joints).

        Args:
            progress: Told the share of the samples that is done, 0 to 1.
        """
        while self._at < len(self.q):
            progress(self._at / len(self.q))
            if self._sweeps == PATIENCE:
                self._take_rescue(self.rescue(self._at, self._last))
            else:
                self._enlarge()
                self._advance()
        return self.q

    def _empty(self) -> None:
        """Let all samples out of the window."""
        self._guess = np.empty((0, len(self.start)))
        self._damping = np.empty(0)
        self._sweeps = 0

    def _enlarge(self) -> None:
        """Let samples in at the back, guessed on the line through the two before."""
        new = min(self._reach, len(self.q) - self._at) - len(self._guess)
        if new <= 0:
            return
        ends = np.vstack((self._last - self._rate, self._last, self._guess))[-2:]
        line = ends[1] + np.arange(1, new + 1)[:, None] * (ends[1] - ends[0])
        self._guess = np.vstack((self._guess, np.where(np.isnan(self._held), line, self._held)))
        self._damping = np.concatenate((self._damping, np.full(new, DAMPING)))

    def _advance(self) -> None:
        """Correct the window once, let out at the front what has converged, at the back what is far off."""
        window = self.targets.rows(slice(self._at, self._at + len(self._guess)))
        swept = sweep(task_of(self.chain, window), self._guess, self._last, self._held, self._damping)
        correction = swept.q - self._guess
        size = np.abs(correction).max(axis=1)
        self._sweeps += 1
        self._lower_damping((size <= NEARLY_STILL) & (swept.miss > MET))
        converged = _leading((size <= STILL) & (swept.miss <= MET))
        trusted = max(1, _leading(size <= FAR))
        self._reach = min(LONGEST, 2 * trusted)
        self._guess = self._guess[:trusted] + correction[:trusted] * min(1.0, FAR / max(size[0], FAR))
        self._damping = self._damping[:trusted]
        self._let_out(converged, swept.pull)

    def _lower_damping(self, where: BoolArray) -> None:
        """Damp less where the damping alone keeps the tool from its target."""
        self._damping[where] = np.maximum(LESS_DAMPING * self._damping[where], LEAST_DAMPING)

    def _let_out(self, count: int, pull: FloatArray | None) -> None:
        """Take what is in front of the window as found, up to where a joint meets or leaves a limit."""
        found = self._guess[:count]
        at, held = holding.change(
            found, None if pull is None else pull[:count], self._held, self._lower, self._upper
        )
        self._take(np.clip(found[:at], self._lower, self._upper))
        if at < count:
            sweeps = self._sweeps
            self._held = held
            self._empty()
            self._sweeps = sweeps
        else:
            self._guess, self._damping = self._guess[at:], self._damping[at:]

    def _take(self, found: FloatArray) -> None:
        """Take joint values as those of the next samples."""
        if not len(found):
            return
        self.q[self._at : self._at + len(found)] = found
        self._rate = found[-1] - (found[-2] if len(found) > 1 else self._last)
        self._last = found[-1]
        self._at += len(found)
        self._sweeps = 0

    def _take_rescue(self, found: FloatArray) -> None:
        """Take what the rescue found, and begin anew after it: at rest, with no joint held."""
        self.q[self._at : self._at + len(found)] = found
        self._at += len(found)
        reached = found[np.isfinite(found).all(axis=1)]
        self._last = reached[-1] if len(reached) else self._last
        self._rate = np.zeros_like(self.start)
        self._held = np.full_like(self.start, np.nan)
        self._empty()


def _leading(true: BoolArray) -> int:
    """Return how many are true before the first that is not."""
    return int(np.argmin(np.append(true, False)))
