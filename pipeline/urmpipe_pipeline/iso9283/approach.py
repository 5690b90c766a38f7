"""How a cycle settles in a pose: stabilisation time and overshoot."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.motion import Motion, Rest

NEAR = 50.0
"""An approach begins where the cycle comes within so many bands of the pose for the last time."""


def settling(cycle: Motion, since: int, rest: Rest, band: float) -> tuple[float, float] | None:
    """Return the stabilisation time in [s] and the overshoot in [m] with which a cycle attains a pose.

    The final pose is where it stands in the second half of its rest. Stabilisation time: from the first
    entry into the ball of radius `band` round it to the last one, on straight lines between the rows.
    Overshoot: max((p - p_final) . u, 0) over the rows from the first entry on, with the unit vector u along
    the approach, from where the cycle comes within 50 bands to the final pose. None where it does not come
    from outside the band.

    Args:
        cycle: The cycle.
        since: The row at which it leaves the pose before.
        rest: The rows in which it rests in this one.
        band: Half of the width of the band in [m].

    Source: after ISO 9283, from common knowledge.
    """
    final, _ = cycle.pose(rest)
    rows = slice(since, rest.last + 1)
    place, t = cycle.position[rows] - final, cycle.t[rows]
    away = np.linalg.norm(place, axis=1)
    start = _entry(place, away, NEAR * band, first=False)
    begin = 0 if start is None else start[0]
    inside = _entry(place[begin:], away[begin:], band, first=True)
    settled = _entry(place[begin:], away[begin:], band, first=False)
    if inside is None or settled is None:
        return None
    times = [_between(t[begin:], *one) for one in (inside, settled)]
    came = place[0] if start is None else _between(place, *start)
    along = -came / np.linalg.norm(came)
    beyond = place[begin + inside[0] + 1 :] @ along
    return float(times[1] - times[0]), float(max(beyond.max(initial=0.0), 0.0))


def _entry(place: FloatArray, away: FloatArray, radius: float, *, first: bool) -> tuple[int, float] | None:
    """Return the row before a cycle enters a ball round the origin, first or last, and the share.

    Args:
        place: In [m] from its centre, shape (n, 3).
        away: The distances from it in [m], shape (n,).
        radius: Of the ball in [m].
        first: Whether the first entry is wanted, else the last one.
    """
    rows = np.flatnonzero((away[:-1] > radius) & (away[1:] <= radius))
    if not len(rows):
        return None
    row = int(rows[0 if first else -1])
    step = place[row + 1] - place[row]
    a, b, c = step @ step, place[row] @ step, away[row] ** 2 - radius**2  # |p + x step| = radius
    return row, float(c / (-b + np.sqrt(max(b * b - a * c, 0.0))))


def _between(values: FloatArray, row: int, share: float) -> FloatArray:
    """Return what lies between a row and the next."""
    return np.asarray(values[row] + share * (values[row + 1] - values[row]))
