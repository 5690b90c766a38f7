"""Random rows that make a path: corners in space, and radii that fit them."""

from __future__ import annotations

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

from urmpipe_models.planning.from_rows import path_of
from urmpipe_models.planning.rows import PathRows, path_rows

SHARPEST, FLATTEST = 2.9, 0.05
"""Angles of corners in [rad] that are drawn: between them an arc fits, and its plane is known to 1e-14."""

shares = st.floats(0.1, 0.9)
coordinates = st.integers(-1000, 1000).map(lambda mm: mm / 1000.0)


@st.composite
def corner_rows(draw: DrawFn, variants: bool = False) -> PathRows:
    """Draw 3 to 20 corners: each is a stop, or rounded by an arc of less than half of both lines."""
    count = draw(st.integers(3, 20))
    points = np.array(draw(st.lists(st.tuples(*[coordinates] * 3), min_size=count, max_size=count)))
    way = np.diff(points, axis=0)
    leg = np.linalg.norm(way, axis=1)
    assume((leg > 0.05).all())
    along = way / leg[:, None]
    across = np.linalg.norm(np.cross(along[:-1], along[1:]), axis=1)
    turn = np.arctan2(across, (along[:-1] * along[1:]).sum(axis=1))
    assume(((turn > FLATTEST) & (turn < SHARPEST)).all())
    share = np.array(draw(st.lists(st.just(0.0) | shares, min_size=count - 2, max_size=count - 2)))
    radius = np.zeros(count)
    radius[1:-1] = 0.5 * share * np.minimum(leg[:-1], leg[1:]) / np.tan(0.5 * turn)
    variant = draw(st.lists(st.sampled_from([1, 2]), min_size=count, max_size=count)) if variants else 2
    return path_rows(points, radius, corner=True, variant=np.array(variant))


def by_first_points(rows: PathRows) -> PathRows:
    """Return the same path by the first points of its arcs, as the paper tells it."""
    path = path_of(rows)
    position = rows.position.copy()
    position[path.row[path.arcs]] = path.start[path.arcs]
    return path_rows(position, rows.radius, variant=rows.variant)
