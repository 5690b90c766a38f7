"""How numbers are written: plain digits, as many as a judgement needs, the unit in the table's head."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from urmpipe_pipeline.comparison import AXES
from urmpipe_pipeline.results import json_ready

NOTHING = "–"
"""Stands where there is no value."""

DIGITS = 4
"""Digits after the point of a length in [mm]: a tenth of a micrometre."""

SYMBOLS = dict(zip(AXES, ("Δx", "Δy", "Δz", "‖Δ‖"), strict=True))
"""The quantities of a deviation as people read them."""


def millimetres(value: float | None, against: float | None = None) -> str:
    """Return a length in [m] as [mm].

    Four digits after the point, or as many as tell it from what it is held against; below a micrometre
    in exponent form.

    Args:
        value: In [m].
        against: What it is held against, in [m].
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    scaled = value * 1e3
    if 0.0 < abs(scaled) < 1e-3:
        return f"{scaled:.3e}"
    digits = DIGITS
    if against is not None and abs(value) != against:
        while digits < 12 and f"{abs(scaled):.{digits}f}" == f"{against * 1e3:.{digits}f}":
            digits += 1
    return f"{scaled:.{digits}f}"


def limit(value: float | None) -> str:
    """Return a tolerance in [m] as [mm], with no more digits than it has."""
    return NOTHING if value is None else f"{value * 1e3:.6g}"


def metres(value: float) -> str:
    """Return a coordinate in [m]: tenths of a millimetre."""
    return f"{value:.4f}" if math.isfinite(value) else NOTHING


def point(values: Any) -> str:
    """Return x, y, z in [m]."""
    return ", ".join(metres(float(value)) for value in values)


def seconds(value: float) -> str:
    """Return a time in [s]: milliseconds, and microseconds where they are not 0."""
    if not math.isfinite(value):
        return NOTHING
    text = f"{value:.6f}"
    return text[:-3] + text[-3:].rstrip("0")


def percent(share: float) -> str:
    """Return a share 0..1 in [%], never rounded to 0 or to 100 when it is not."""
    scaled = share * 100.0
    if scaled in (0.0, 100.0):
        return f"{scaled:.0f} %"
    if scaled > 99.0:
        return f"{min(scaled, 99.99):.2f} %"
    return f"{scaled:.2g} %" if scaled < 10.0 else f"{scaled:.1f} %"


def counted(count: int, noun: str) -> str:
    """Return a count with its noun in the right number: "1 log", "2 logs"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def tolerance(allowed: Mapping[str, float]) -> str:
    """Return a comparison's tolerance in [mm]: "±3.5 mm per axis, 5 mm norm"."""
    words = {"axis": ("±", "per axis"), "norm": ("", "norm")} | {axis: ("±", axis) for axis in "xyz"}
    parts = [
        "{0}{2} mm {1}".format(*words.get(name, ("±", name)), limit(value)) for name, value in allowed.items()
    ]
    return ", ".join(parts)


def size(count: int) -> str:
    """Return a file's length in bytes, with thin spaces between thousands."""
    return f"{count:,}".replace(",", "\u202f")


def plain(value: Any) -> str:
    """Return an option's value as one line: text as it is, the rest as JSON."""
    return value if isinstance(value, str) else json.dumps(json_ready(value), ensure_ascii=False)
