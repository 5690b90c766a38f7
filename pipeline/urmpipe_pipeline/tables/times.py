"""Integer nanoseconds as the clock of a file writes them: exact text, or a type that holds them."""

from __future__ import annotations

from typing import Any

import numpy as np

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.presentation.exports import DATE, DAY, TIME_OF_DAY, Times

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Powers of ten from a unit to [ns]."""

HOUR = 3_600 * 10**9
"""An hour in [ns]."""

_FINENESS = ((10**9, "s"), (10**6, "ms"), (10**3, "us"), (1, "ns"))


def text_of(times: Times) -> Any:
    """Return the exact text of times as an Arrow array, with as many decimals as the column needs."""
    common = int(np.gcd.reduce(times.ns)) if len(times.ns) else 0
    if times.unit == DATE:
        return _dates(times.ns, common)
    if times.unit == TIME_OF_DAY:
        return _times_of_day(times.ns, common)
    return _decimals(times.ns, EXPONENTS[times.unit], common)


def typed(times: Times) -> Any:
    """Return times as an Arrow array of a type for them; [s], [ms] and [us] are doubles, rounded once.

    Times of day are durations where some lie outside of a day.
    """
    import pyarrow as pa

    if times.unit == DATE:
        return pa.array(times.ns).cast(pa.timestamp("ns"))
    if times.unit == TIME_OF_DAY:
        within = times.ns.min(initial=0) >= 0 and times.ns.max(initial=0) < DAY
        return pa.array(times.ns).cast(pa.time64("ns") if within else pa.duration("ns"))
    if times.unit == "ns":
        return pa.array(times.ns)
    return pa.array(np.true_divide(times.ns, 10.0 ** EXPONENTS[times.unit], dtype=np.float64))


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
