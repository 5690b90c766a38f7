"""Logs of one motion that does not repeat itself, each with a clock of its own."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pandas as pd

from urmpipe_models.elementwise import IntArray

S, MS = 10**9, 10**6
BEGIN = 1_700_000_000 * S + 123_456_789
"""A Unix time in [ns]."""

DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
ZONES = {"utc": ("Z", 0), "zone": ("+02:00", 7200 * S), "local": ("", 0)}


def times(start_ns: int, period_ns: int, rows: int = 400) -> IntArray:
    return start_ns + period_ns * np.arange(rows, dtype=np.int64)


def clock_log(clock: str, t_ns: IntArray, off: float = 0.0, first: int = BEGIN) -> str:
    """Return the text of a log at times since `first`, with joint 2 displaced by some [rad]."""
    t, stamps = t_ns / 1e9, [first + int(ns) for ns in t_ns]
    q = [0.4 * np.sin((0.9 + 0.13 * k) * t + k) + 0.05 * k * t + off * (k == 1) for k in range(6)]
    if clock in DIGITS:
        name, cells = f"t [{clock}]", [f"{Decimal(ns).scaleb(-DIGITS[clock]):f}" for ns in stamps]
    else:
        zone, ahead = ZONES[clock]
        name, cells = "time", [f"{np.datetime64(ns + ahead, 'ns')}{zone}" for ns in stamps]
    table = pd.DataFrame(np.transpose(q), cells, [f"q{k} [rad]" for k in range(1, 7)])
    return table.to_csv(index_label=name, float_format="%.12f", lineterminator="\n")
