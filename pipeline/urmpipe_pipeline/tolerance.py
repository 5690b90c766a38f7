"""Tolerances: what is allowed of each kind of deviation."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from urmpipe_models.errors import OptionError

DEFAULT_TOLERANCE = 0.0035
"""Largest deviation allowed on an axis in [m]. Source: [UrmArm2021]_ section 2.4."""

LENGTHS = {"": 1.0, "m": 1.0, "mm": 1e-3, "um": 1e-6}
ANGLES = {"": 1.0, "rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180}
UNITS: dict[str, dict[str, float]] = {
    **dict.fromkeys(("axis", "x", "y", "z", "norm", "path"), LENGTHS),
    "angle": ANGLES,
    "joint": ANGLES | LENGTHS,
}
"""What a tolerance may be of, and the units that it may be written in: axis holds for x, y and z each."""

ALLOWED = "a length in m, or axis=, x=, y=, z=, norm=, path= (m, mm, um), angle=, joint= (rad, mrad, deg)"


def parse_tolerance(text: str, option: str = "--tolerance") -> dict[str, float]:
    """Return what is allowed in [m] and [rad] by kind, from "0.0035", "3.5mm" or "axis=3.5mm,angle=0.5deg".

    Args:
        text: One length for every axis, or some kinds with theirs. What is not named has no tolerance.
        option: Where it was given, for messages.

    Raises:
        OptionError: With everything that is wrong.
    """
    found: dict[str, float] = {}
    faults = []
    for part in text.split(","):
        kind, _, value = part.rpartition("=") if "=" in part else ("axis", "", part)
        kind = kind.strip()
        number = _number(value, UNITS.get(kind, {}))
        if kind in found or number is None:
            twice = " twice" if kind in found else ""
            faults.append(f"{option}: found {part.strip()!r}{twice}, allowed: {ALLOWED}")
        else:
            found[kind] = number
    if faults:
        raise OptionError(*faults)
    return found


def check_tolerance(tolerance: Mapping[str, float], option: str = "--tolerance") -> None:
    """Raise an `OptionError` with everything in a tolerance that is no kind or no positive number."""
    faults = [
        f"{option}: found {kind}={value}, allowed: {ALLOWED}; positive"
        for kind, value in tolerance.items()
        if kind not in UNITS or not (math.isfinite(value) and value > 0)
    ]
    if not tolerance:
        faults = [f"{option}: found nothing, allowed: {ALLOWED}"]
    if faults:
        raise OptionError(*faults)


def allowed_for(quantity: str, kind: str, tolerance: Mapping[str, float]) -> float | None:
    """Return what is allowed of a quantity: by its own name if it is a coordinate, else by its kind."""
    own = tolerance.get(quantity) if kind == "axis" else None
    return own if own is not None else tolerance.get(kind)


def _number(text: str, units: Mapping[str, float]) -> float | None:
    """Return a positive number with one of the units, in SI; None if it is none."""
    match = re.fullmatch(r"\s*(.*?)\s*([a-z]*)\s*", text)
    try:
        value = float(match[1]) * units[match[2]] if match else math.nan
    except (ValueError, KeyError):
        return None
    return value if 0.0 < value < math.inf else None
