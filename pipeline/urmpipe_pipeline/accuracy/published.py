"""Published accuracy of an arm, to be drawn with the simulated one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.planning.path import PathRows, cube_rows


class Point(NamedTuple):
    """A largest error at a velocity.

    Attributes:
        velocity: In [m/s].
        error: In [m].
        least: Whether the source states only that the error is larger.
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

FIG7_ROBOT = "irb60"  # the names of the robot and of its variants begin so


def fig7_rows() -> PathRows:
    """Return the contour of [Iso9283] section 5."""
    return cube_rows("wall", 0.6, 0.03, np.array([1.7, 0.0, 1.0]))


def published_points(robot: str, rows: PathRows) -> tuple[Point, ...]:
    """Return the published errors of a robot on a path; empty for any other."""
    contour = fig7_rows()
    same = rows.position.shape == contour.position.shape and np.allclose(rows.position, contour.position)
    same = same and np.allclose(rows.radius, contour.radius)
    return FIG7 if same and robot.startswith(FIG7_ROBOT) else ()
