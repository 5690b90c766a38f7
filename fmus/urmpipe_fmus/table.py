"""A table over time inside a unit: the rows about an instant, found the same way in Python and in C."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.variable import LARGEST_INTEGER
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.errors import UnitError

LAST_NS = 2**63 - 1
"""The last time that 64 bits hold."""


class Rows(NamedTuple):
    """The rows of a table about an instant.

    Attributes:
        before: Values of the last row at or before it, one element a column; before the first, the first.
        after: Values of the row after that; beyond the last, the last.
        fraction: How far the instant is from one to the other, 0 at a row and outside the table, below 1.
    """

    before: tuple[Element, ...]
    after: tuple[Element, ...]
    fraction: Element


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Values over time.

    Times are integer nanoseconds, so that t = k h meets the row that is meant and not its neighbour.

    Attributes:
        t_ns: Times in [ns], strictly rising, shape (n,), n >= 1.
        values: Finite, in SI, shape (n, columns).
    """

    t_ns: NDArray[np.int64]
    values: FloatArray
    _times: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        given = np.asarray(self.t_ns)
        if given.dtype.kind not in "iu":
            raise UnitError(f"table: found times of type {given.dtype}, allowed: integers, in ns")
        if given.size and given.max() > LAST_NS:
            raise UnitError(f"table: found a time of {given.max()} ns, allowed: {LAST_NS} ns")
        for name, value in (
            ("t_ns", np.array(given, dtype=np.int64)),
            ("values", np.array(self.values, dtype=np.float64, order="C")),
            ("_times", np.array(given, dtype=np.float64)),
        ):
            value.flags.writeable = False  # a copy of its own: nobody changes what a unit holds
            object.__setattr__(self, name, value)
        faults = list(self._faults())
        if faults:
            raise UnitError(*faults)

    def _faults(self) -> Iterator[str]:
        if self.values.ndim != 2 or self.t_ns.shape != self.values.shape[:1] or not self.values.size:
            yield (
                f"table: found {self.t_ns.shape} times and {self.values.shape} values, allowed: (n,) and"
                " (n, columns), at least one of each"
            )
            return
        if len(self.t_ns) > LARGEST_INTEGER:
            yield f"table: found {len(self.t_ns)} rows, allowed: {LARGEST_INTEGER}"
        falls = self.t_ns[1:] <= self.t_ns[:-1]  # their differences may have more than 64 bits
        if falls.any():
            row = int(np.argmax(falls)) + 2
            yield f"table: the time of row {row} is not after the one before; allowed: rising times"
        if not np.isfinite(self.values).all():
            row, column = (int(i) + 1 for i in np.argwhere(~np.isfinite(self.values))[0])
            yield f"table: row {row}, column {column} is not finite; allowed: finite values"

    @property
    def columns(self) -> int:
        """How many values a row has."""
        return int(self.values.shape[1])

    def rows_at(self, time: Element) -> Rows:
        """Return the rows about a time in [s], a float or an array of shape (n,).

        The time is rounded to whole nanoseconds, halves away from zero as C's `round` does.
        """
        scaled = np.asarray(time, dtype=np.float64) * 1e9
        whole = np.trunc(scaled)  # adding 0.5 first would round once more where half a ns is an ulp
        instant = whole + np.where(np.abs(scaled - whole) >= 0.5, np.copysign(1.0, scaled), 0.0)
        times = self._times
        last = len(times) - 1
        before = np.clip(np.searchsorted(times, instant, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        span = np.where(after > before, times[after] - times[before], 1.0)
        fraction = np.where(instant <= times[before], 0.0, (instant - times[before]) / span)
        fraction = np.where(after > before, fraction, 0.0)
        return Rows(tuple(self.values[before].T), tuple(self.values[after].T), fraction)
