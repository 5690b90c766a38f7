"""The law with a largest jerk, by Ruckig, from stop to stop (extra `planning`)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from scipy.optimize import brentq

from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.stretches import Arcs, Piece, speeds, stretches
from urmpipe_models.planning.time_law import Phase, TimeLaw

EQUAL_SHARE = math.sqrt(0.5)
"""Of a total acceleration: so much s'' and s'^2 / r each may have on an arc that begins or ends at rest."""

SPARE_LENGTH = 1e-9
"""Of a piece, this share stays free where speeds meet: Ruckig finds no motion that fits to the last bit."""


def jerk_law(path: LineArcPath, velocity: float, acceleration: float, jerk: float, arcs: Arcs) -> TimeLaw:
    """Return the law along a path within a speed, an acceleration and a jerk of s, at rest at its stops.

    Where the total acceleration is held, an arc is run at a constant speed, up to v^2 = a r. Arcs next to a
    stop cannot be: there s'' and s'^2 / r are each held to a / sqrt 2. The acceleration across the path still
    steps where an arc begins: the jerk is that of s.

    Args:
        path: The path.
        velocity: The largest s' in [m/s].
        acceleration: The largest s'' in [m/s2], or in total on arcs.
        jerk: The largest s''' in [m/s3].
        arcs: "tangential" or "total".

    Raises:
        OptionError: If Ruckig is not installed, or finds no motion.

    Source: [BerscheidKroger2021]_ (Ruckig), which plans each piece.
    """
    phases: list[Phase] = []
    begin = 0.0
    for stretch in stretches(path, velocity, acceleration, arcs):
        pieces = [*_held(stretch, acceleration)]
        met = speeds(pieces, lambda piece, speed: _reached(piece, speed, jerk))
        for piece, (entry, leave) in zip(pieces, pairwise(met), strict=True):
            phases += _planned(piece, entry, leave, jerk, begin)
            begin += piece.length
    return TimeLaw(phases)


class _Piece(NamedTuple):
    """A piece of a stretch: its length [m], the largest s'' [m/s2], 0 for a constant speed, and s' [m/s]."""

    length: float
    acceleration: float
    fastest: float


def _held(stretch: Sequence[Piece], acceleration: float) -> Iterator[_Piece]:
    """Yield the pieces of a stretch with the s'' that each may have."""
    lines = [k for k, piece in enumerate(stretch) if math.isinf(piece.radius)]
    for k, piece in enumerate(stretch):
        if math.isinf(piece.radius):
            yield _Piece(piece.length, acceleration, piece.fastest)
        elif lines and lines[0] < k < lines[-1]:
            yield _Piece(piece.length, 0.0, piece.fastest)
        else:
            fastest = min(piece.fastest, math.sqrt(EQUAL_SHARE * acceleration * piece.radius))
            yield _Piece(piece.length, EQUAL_SHARE * acceleration, fastest)


def _reached(piece: _Piece, speed: float, jerk: float) -> float:
    """Return the largest speed in [m/s] at the end of a piece that begins with one, s'' = 0 at both ends.

    From v0 to v1 it takes T = 2 sqrt((v1 - v0) / j), or (v1 - v0) / a + a / j where that reaches a, and
    T (v0 + v1) / 2 of way.
    """
    a = piece.acceleration
    if a == 0.0 or speed >= piece.fastest:
        return min(speed, piece.fastest)

    def beyond(end: float) -> float:
        """Return how far in [m] the change to a speed in [m/s] leads beyond the piece."""
        change = end - speed
        duration = 2.0 * math.sqrt(change / jerk) if change < a * a / jerk else change / a + a / jerk
        return 0.5 * (speed + end) * duration - (1.0 - SPARE_LENGTH) * piece.length

    return piece.fastest if beyond(piece.fastest) <= 0.0 else float(brentq(beyond, speed, piece.fastest))


def _planned(piece: _Piece, entry: float, leave: float, jerk: float, begin: float) -> Iterator[Phase]:
    """Yield how a piece that begins at an arc length in [m] is passed."""
    if piece.acceleration == 0.0:
        yield Phase(piece.length / entry, begin, entry)
        return
    try:
        from ruckig import InputParameter, Result, Ruckig, Trajectory
    except ImportError:
        needs = "with ruckig: pip install urmpipe[planning]"
        raise OptionError(Finding(parameter="law", found="jerk without ruckig", allowed=needs)) from None
    given, found = InputParameter(1), Trajectory(1)
    given.current_velocity, given.target_velocity, given.target_position = [entry], [leave], [piece.length]
    given.max_velocity, given.max_acceleration = [piece.fastest], [piece.acceleration]
    given.max_jerk = [jerk]
    if Ruckig(1).calculate(given, found) not in (Result.Working, Result.Finished):
        motion = f"{piece.length:g} m from {entry:g} to {leave:g} m/s with a jerk of {jerk:g} m/s3"
        raise OptionError(Finding(parameter="jerk", found=f"no motion over {motion}", allowed="another jerk"))
    profile = found.profiles[0][0]
    for duration, s, v, a, j in zip(profile.t, profile.p, profile.v, profile.a, profile.j, strict=False):
        if duration > 0.0:
            yield Phase(duration, begin + s, v, a, j)
