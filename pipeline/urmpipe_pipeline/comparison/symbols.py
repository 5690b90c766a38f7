"""What the quantities of a deviation are called where people read them, and what of a tolerance they use."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from urmpipe_pipeline.comparison.deviation import AXES, Statistics
from urmpipe_pipeline.text import SHOWN, limit, portion

SYMBOLS = dict(zip(AXES, ("Δx", "Δy", "Δz", "‖Δ‖"), strict=True))
"""The quantities of a deviation as people read them."""


def symbol(statistics: Statistics) -> str:
    """Return what a quantity is called: Δx, ‖Δ‖, path, angle, or a joint by its name."""
    own = statistics.kind in ("axis", "norm")
    return SYMBOLS[statistics.quantity] if own else statistics.quantity


def size_of(statistics: Statistics) -> str:
    """Return what the absolute value of a quantity is called: |Δx|, ‖Δ‖, path, angle, |Δ phi1|."""
    named = symbol(statistics)
    if statistics.kind == "joint":
        return f"|Δ {named}|"
    return f"|{named}|" if statistics.kind == "axis" else named


def used_words(statistics: Statistics) -> str:
    """Return how much of its tolerance a quantity uses up: "71.0 % of the tolerance"."""
    share = statistics.used
    if share is None:
        return ""
    if statistics.missing:
        return f"no value at {statistics.missing} of {(statistics.samples or 0) + statistics.missing} samples"
    return portion_words(share)


def portion_words(share: float) -> str:
    """Return a share of a tolerance: "71.0 % of the tolerance", "1.2 times the tolerance"."""
    return f"{portion(share)} the tolerance"


def allowed_words(allowed: Mapping[str, float], joint_units: Iterable[str] = ("rad",)) -> str:
    """Return a comparison's tolerance as people read it: "±3.5 mm per axis, 0.5 deg of orientation".

    Args:
        allowed: In [m] or [rad], by kind or coordinate.
        joint_units: The units of the joints that are held to a tolerance, rad or m.
    """
    words = {
        "axis": "±{} mm per axis",
        "norm": "{} mm norm",
        "path": "{} mm from the path",
        "angle": "{} deg of orientation",
        **{axis: f"±{{}} mm {axis}" for axis in "xyz"},
    }
    parts = []
    for name, value in allowed.items():
        if name == "joint":
            units = sorted(set(joint_units), reverse=True)
            shown = (f"±{limit(value, unit)} {SHOWN[unit][0]}" for unit in units)
            parts.append(f"{' or '.join(shown)} per joint")
        else:
            parts.append(words[name].format(limit(value, "rad" if name == "angle" else "m")))
    return ", ".join(parts)
