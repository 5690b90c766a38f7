"""What is published of an arm's accuracy, to be drawn beside what is simulated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.planning.path import PathRows, cube_rows


class Point(NamedTuple):
    """A largest error at a velocity.

    Attributes:
        velocity: In [m/s].
        error: In [m].
        least: Whether it is only said that the error is more than that.
    """

    velocity: float
    error: float
    least: bool = False


FIG7 = (
    Point(0.1, 0.33e-3),
    Point(0.2, 0.97e-3),
    Point(0.3, 1.96e-3),
    Point(0.5, 17e-3, least=True),
    Point(1.0, 182e-3),
)
"""[Iso9283] Fig. 7 of the robot IRb-60: its labels, read with conclusion 4, which says "exceeds 0,017 m"."""

FIG7_ROBOT = "irb60"
"""How the names of the robot and of its variants begin."""


def fig7_rows() -> PathRows:
    """Return the contour of [Iso9283] section 5."""
    return cube_rows("wall", 0.6, 0.03, np.array([1.7, 0.0, 1.0]))


def published_points(robot: str, rows: PathRows) -> tuple[Point, ...]:
    """Return what is published of a robot on a path; nothing of any other."""
    wanted = fig7_rows()
    same = rows.position.shape == wanted.position.shape and np.allclose(rows.position, wanted.position)
    same = same and np.allclose(rows.radius, wanted.radius)
    return FIG7 if same and robot.startswith(FIG7_ROBOT) else ()
