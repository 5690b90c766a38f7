"""Integer nanoseconds as the clock of a file writes them: exact text, or a type that holds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from urmpipe_models.arrays import IntArray

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Powers of ten from a unit to [ns]."""

DATE, TIME_OF_DAY = "date", "time of day"
"""Units of clocks that are text."""

HOUR = 3_600 * 10**9
"""An hour in [ns]."""

DAY = 24 * HOUR
"""A day in [ns]."""

_FINENESS = ((10**9, "s"), (10**6, "ms"), (10**3, "us"), (1, "ns"))


@dataclass(frozen=True, slots=True, eq=False)
class Times:
    """A column of times.

    Attributes:
        ns: In integer [ns], shape (n,).
        unit: How the column counts them: s, ms, us, ns, date (ISO 8601) or time of day (hh:mm:ss).
    """

    ns: IntArray
    unit: str

    def text(self) -> Any:
        """Return the exact text as an Arrow array, with as many decimals as the column needs."""
        common = int(np.gcd.reduce(self.ns)) if len(self.ns) else 0
        if self.unit == DATE:
            return _dates(self.ns, common)
        if self.unit == TIME_OF_DAY:
            return _times_of_day(self.ns, common)
        return _decimals(self.ns, EXPONENTS[self.unit], common)

    def typed(self) -> Any:
        """Return an Arrow array of a type for it; [s], [ms] and [us] are doubles, rounded once.

        Times of day are durations where some lie outside of a day.
        """
        import pyarrow as pa

        if self.unit == DATE:
            return pa.array(self.ns).cast(pa.timestamp("ns"))
        if self.unit == TIME_OF_DAY:
            within = self.ns.min(initial=0) >= 0 and self.ns.max(initial=0) < DAY
            return pa.array(self.ns).cast(pa.time64("ns") if within else pa.duration("ns"))
        if self.unit == "ns":
            return pa.array(self.ns)
        return pa.array(np.true_divide(self.ns, 10.0 ** EXPONENTS[self.unit], dtype=np.float64))


def shares(clock_ns: IntArray, units: Sequence[str]) -> list[Times]:
    """Return what each column of a clock holds: all of it or, of two columns, its share.

    Two columns are seconds and nanoseconds, or date and time of day.

    Args:
        clock_ns: The clock in integer [ns], shape (n,).
        units: The unit of each of its columns.
    """
    steps = {"s": 10**9, DATE: DAY} if len(units) > 1 else {}
    coarse = next((steps[unit] for unit in units if unit in steps), None)
    if coarse is None:
        return [Times(clock_ns, unit) for unit in units]
    rest = clock_ns % coarse
    return [Times(clock_ns - rest if unit in steps else rest, unit) for unit in units]


def _decimals(ns: IntArray, exponent: int, common: int) -> Any:
    """Return ns / 10^exponent as decimal text, with the decimals that the finest of them needs."""
    import pyarrow as pa
    import pyarrow.compute as pc

    decimals = exponent
    while decimals and common % 10 == 0:
        common, ns, decimals = common // 10, ns // 10, decimals - 1
    if not decimals:
        return pa.array(ns).cast(pa.string())
    whole, rest = np.divmod(np.abs(ns), 10**decimals)
    sign = pc.if_else(pa.array(ns < 0), "-", "")
    digits = pc.utf8_lpad(pa.array(rest).cast(pa.string()), width=decimals, padding="0")
    signed = pc.binary_join_element_wise(sign, pa.array(whole).cast(pa.string()), "")
    return pc.binary_join_element_wise(signed, digits, ".")


def _dates(ns: IntArray, common: int) -> Any:
    """Return times from 1970 as ISO 8601; of whole days the date alone."""
    import pyarrow as pa
    import pyarrow.compute as pc

    stamps = pa.array(ns).cast(pa.timestamp("ns"))
    if common % DAY == 0:
        return stamps.cast(pa.date32()).cast(pa.string())
    return pc.replace_substring(stamps.cast(pa.timestamp(_fineness(common))).cast(pa.string()), " ", "T")


def _times_of_day(ns: IntArray, common: int) -> Any:
    """Return times from midnight as hh:mm:ss, with as many hours and decimals as needed."""
    import pyarrow as pa
    import pyarrow.compute as pc

    unit = _fineness(common)
    kind = pa.time32(unit) if unit in ("s", "ms") else pa.time64(unit)
    hours, rest = np.divmod(np.abs(ns), HOUR)
    minutes = pa.array(rest).cast(pa.time64("ns")).cast(kind).cast(pa.string())  # 00:mm:ss
    sign = pc.if_else(pa.array(ns < 0), "-", "")
    signed = pc.binary_join_element_wise(
        sign, pc.utf8_lpad(pa.array(hours).cast(pa.string()), width=2, padding="0"), ""
    )
    return pc.binary_join_element_wise(signed, pc.utf8_slice_codeunits(minutes, 2), "")


def _fineness(common: int) -> str:
    """Return the coarsest unit in which multiples of so many [ns] are whole."""
    return next(unit for step, unit in _FINENESS if common % step == 0)
