"""How a recording says numbers: lengths in [mm], angles in [mrad], as people read them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from urmpipe_pipeline.comparison import Alignment, Statistics, Sync

SHOWN = {"m": (1e3, "mm"), "rad": (1e3, "mrad")}
"""Of an SI unit: what a person is shown, and the factor."""


def amount(value: float, unit: str) -> str:
    """Return a length in [m] or an angle in [rad] with four digits after the point, and its unit."""
    factor, name = SHOWN[unit]
    return f"{factor * value:.4f} {name}"


def limit(value: float, unit: str) -> str:
    """Return a tolerance with no more digits than it has, and its unit."""
    factor, name = SHOWN[unit]
    return f"{factor * value:.6g} {name}"


def excess(one: Statistics) -> str:
    """Return how far a quantity goes, and of how much: "x reaches 4.2000 mm of 3.5 mm allowed"."""
    allowed = "" if one.tolerance is None else f" of {limit(one.tolerance, one.unit)} allowed"
    return f"{one.quantity} reaches {amount(one.max, one.unit)}{allowed}"


def sync_words(sync: Sync) -> str:
    """Return how two clocks were put together; nothing if both simply start together."""
    if sync.mode == "start" and not sync.offset:
        return ""
    how = "as given" if sync.mode == "given" else f"estimated from {sync.by or 'the motion'}"
    said = f"clocks: reference = log {sync.offset:+.6g} s, {how}"
    if sync.precision is not None:
        said += f", +-{1e3 * sync.precision:.2g} ms"
    return said + ("" if sync.similarity is None else f", similarity {sync.similarity:.4f}")


def alignment_words(alignment: Alignment) -> str:
    """Return how a log was moved in space before it was compared; nothing if it was not."""
    if alignment.mode == "none":
        return ""
    if alignment.mode == "tool":
        x, y, z = (1e3 * value for value in alignment.tool)
        return f"aligned: tool centre point moved by ({x:.4f}, {y:.4f}, {z:.4f}) mm in the tool's frame"
    x, y, z = (1e3 * value for value in alignment.translation)
    how = "by the first pose" if alignment.mode == "start" else "by the best rigid motion"
    turned = amount(_turn(alignment.rotation), "rad")
    return f"aligned {how}: turned by {turned}, moved by ({x:.4f}, {y:.4f}, {z:.4f}) mm"


def _turn(rotation: Sequence[Sequence[float]]) -> float:
    """Return the angle of a rotation matrix in [rad]: from sine and cosine, so that small ones stay exact."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    return math.atan2(math.hypot(zy - yz, xz - zx, yx - xy), xx + yy + zz - 1.0)
