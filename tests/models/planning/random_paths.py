"""Random rows that make a path: corners in space, and arcs that leave a line between them, or touch."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.path import PathRows

# What an arc takes from a line, and what is left of it, in [m]
legs = st.integers(50, 500).map(lambda mm: mm / 1000.0)
# Angles of corners in [rad]: the plane of each is known to 1e-14, and its radius is more than 5 mm
turns = st.floats(0.05, 2.9)
rolls = st.floats(0.0, 2.0 * math.pi)  # angles of the planes of corners about the lines before them in [rad]


@st.composite
def corner_rows(draw: DrawFn, variants: bool = False) -> PathRows:
    """Draw 3 to 20 corners: each is a stop, or rounded by an arc, which may touch the next one."""
    count = draw(st.integers(3, 20))
    cut = np.zeros(count)
    cut[1:-1] = draw(st.lists(st.just(0.0) | legs, min_size=count - 2, max_size=count - 2))
    turn, roll = (draw(st.lists(each, min_size=count - 2, max_size=count - 2)) for each in (turns, rolls))
    along, normal, points = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), [np.zeros(3)]
    for k in range(count - 1):
        # an arc that touches a stop has no first point of its own
        between = draw(st.just(0.0) | legs if cut[k] > 0.0 and cut[k + 1] > 0.0 else legs)
        points.append(points[-1] + (cut[k] + between + cut[k + 1]) * along)
        if k < count - 2:
            side = math.cos(roll[k]) * normal + math.sin(roll[k]) * np.cross(along, normal)
            cosine, sine = math.cos(turn[k]), math.sin(turn[k])
            along, normal = cosine * along + sine * side, cosine * side - sine * along
    radius = np.zeros(count)
    radius[1:-1] = cut[1:-1] / np.tan(0.5 * np.array(turn))
    variant = draw(st.lists(st.sampled_from([1, 2]), min_size=count, max_size=count)) if variants else 2
    return PathRows(np.array(points), radius, corner=True, variant=variant)


def by_first_points(rows: PathRows) -> PathRows:
    """Return the same path by the first points of its arcs, as in the paper."""
    path, position = rows_to_path(rows), rows.position.copy()
    position[path.row[path.arcs]] = path.start[path.arcs]
    return PathRows(position, rows.radius, variant=rows.variant)


def slow_law(*drawn: SearchStrategy[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator of slow tests, each of 40 drawn cases."""
    return lambda test: pytest.mark.slow(settings(max_examples=40)(given(*drawn)(test)))
