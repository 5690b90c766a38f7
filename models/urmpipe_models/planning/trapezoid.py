"""The law with a largest acceleration: up to the largest speed, on with it, and down, from stop to stop."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.stretches import Arcs, Piece, speeds, stretches
from urmpipe_models.planning.time_law import Phase, TimeLaw, swing_at


def trapezoid_law(
    path: LineArcPath, velocity: float, acceleration: float, arcs: Arcs = "tangential"
) -> TimeLaw:
    """Return the fastest law along a path within a speed and an acceleration, at rest at its stops.

    With u = s'^2 a line allows |du/ds| <= 2 a. Where the total acceleration is held an arc allows
    u = a r sin(p) with |dp/ds| <= 2 / r (a swing, see `time_law.Phase`), and u <= a r. Speeds where pieces
    meet follow from one pass along the path and one back; in between it speeds up, keeps the largest speed
    of the piece, and slows down.

    Args:
        path: The path.
        velocity: The largest s' in [m/s].
        acceleration: The largest acceleration a in [m/s2]: of s'', or on arcs in total.
        arcs: "tangential" or "total".

    Source: [Iso9283]_ section 2 (an assumed pattern of movement), section 4 steps 11 to 13.
    """
    phases: list[Phase] = []
    begin = 0.0
    for pieces in stretches(path, velocity, acceleration, arcs):
        met = speeds(pieces, lambda piece, speed: _reached(piece, speed, acceleration))
        for piece, (entry, leave) in zip(pieces, pairwise(met), strict=True):
            phases += piece_phases(piece, begin, entry, leave, acceleration)
            begin += piece.length
    return TimeLaw(phases)


def _reached(piece: Piece, speed: float, a: float) -> float:
    """Return the largest speed in [m/s] at the end of a piece that begins with one."""
    if math.isinf(piece.radius):
        return min(piece.fastest, math.sqrt(speed * speed + 2.0 * a * piece.length))
    most = a * piece.radius
    angle = math.asin(min(speed * speed / most, 1.0)) + 2.0 * piece.length / piece.radius
    return min(piece.fastest, math.sqrt(most * math.sin(min(angle, 0.5 * math.pi))))


def piece_phases(piece: Piece, begin: float, entry: float, leave: float, a: float) -> Iterator[Phase]:
    """Yield how a piece is passed in the least time: faster, on, slower; none of no duration.

    Args:
        piece: The piece.
        begin: Where it begins along the path in [m].
        entry: s' there in [m/s].
        leave: s' at its end in [m/s]; one that the acceleration allows from `entry`.
        a: The largest acceleration in [m/s2]: of s'', or on an arc in total.
    """
    rise = _line_rise if math.isinf(piece.radius) else _arc_rise
    peak, up, down = rise(piece, entry, leave, a)
    level = piece.length - up.s - down.s
    if up.duration > 0.0:
        yield up._replace(s=begin)
    if level > 0.0 and peak > 0.0:
        yield Phase(level / peak, begin + up.s, peak)
    if down.duration > 0.0:
        yield down._replace(s=begin + piece.length - down.s)


def _line_rise(piece: Piece, entry: float, leave: float, a: float) -> tuple[float, Phase, Phase]:
    """Return the largest speed along a line, and how it is reached and left; `s` is their way."""
    peak = min(piece.fastest, math.sqrt(0.5 * (entry * entry + leave * leave) + a * piece.length))
    peak = max(peak, entry, leave)
    up = Phase((peak - entry) / a, 0.5 * (peak + entry) * (peak - entry) / a, entry, a)
    return peak, up, Phase((peak - leave) / a, 0.5 * (peak + leave) * (peak - leave) / a, peak, -a)


def _arc_rise(piece: Piece, entry: float, leave: float, a: float) -> tuple[float, Phase, Phase]:
    """Return the same of an arc along which the total acceleration is held."""
    radius, most = piece.radius, a * piece.radius
    first, last, cap = (math.asin(min(v * v / most, 1.0)) for v in (entry, leave, piece.fastest))
    angle = max(min(cap, 0.5 * (first + last) + piece.length / radius), first, last)
    peak = math.sqrt(most * math.sin(angle))
    rate = math.sqrt(2.0 * a / radius)
    begin, end, top = swing_at(np.array([entry, leave, peak]), a, radius).tolist()
    up = Phase((top - begin) / rate, 0.5 * radius * (angle - first), 0.0, a, 0.0, radius, begin)
    return peak, up, Phase((top - end) / rate, 0.5 * radius * (angle - last), 0.0, a, 0.0, radius, -top)
