"""From an arm and a path to the law in the least time: a grid, the joints on it, their limits."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.along_path.path import follow
from urmpipe_models.planning.fastest import JointLimits, fastest_law
from urmpipe_models.planning.joint_motion import JointSlopes, joint_slopes, targets_at
from urmpipe_models.planning.line_arc import LineArcPath
from urmpipe_models.planning.time_law import TimeLaw

GRID = 4000
"""Intervals of a grid: the time of the paper's contour is then within 0.3 % of that on ever finer ones."""

LEAST = 30
"""Intervals of a segment at least."""


def rests_of(path: LineArcPath) -> FloatArray:
    """Return where joints with finite accelerations have to rest in [m], shape (k,).

    At stops, and where the tool's turn changes its rate.
    """
    return path.stops if path.turning is None else np.append(path.stops, path.at[path.turning.uneven])


def law_of_limits(
    chain: Chain, path: LineArcPath, start: FloatArray | None, speed: float, tangential: float
) -> TimeLaw | None:
    """Return the law in the least time within the rates and accelerations of the joints.

    The limits hold on the grid; between its places they are exceeded by less than its step squared makes.
    Where the tool's turn changes its rate the path stops: no finite acceleration follows it.

    Args:
        chain: The arm.
        path: The path.
        start: Joint values to be near to at its first place in [rad] or [m], shape (joints,).
        speed: The largest s' in [m/s], too; infinity for none.
        tangential: The largest s'' in [m/s2], too; infinity for none.

    Returns:
        The law; None where the arm does not reach the whole path.
    """
    found = joints_on_grid(chain, path, start)
    if found is None:
        return None
    s, after, before = found
    stop = np.isin(s, rests_of(path))
    limits = JointLimits(
        np.array([joint.velocity for joint in chain.moving]),
        np.array([joint.acceleration for joint in chain.moving]),
        speed,
        tangential,
    )
    return fastest_law(s, after.rows(slice(None, -1)), before.rows(slice(1, None)), stop, limits)


def joints_on_grid(
    chain: Chain, path: LineArcPath, start: FloatArray | None
) -> tuple[FloatArray, JointSlopes, JointSlopes] | None:
    """Return places of a path, and the joints there, as they go on and as they come; None out of reach.

    Args:
        chain: The arm.
        path: The path.
        start: Joint values to be near to at its first place in [rad] or [m], shape (joints,).

    Returns:
        Arc lengths in [m], shape (n + 1,), and slopes of n + 1 rows: after each place, and before it.
    """
    s = _grid(path)
    followed = follow(chain, targets_at(path, s), np.arange(len(s)), start=start)
    if not followed.reached.all():
        return None
    after, before = (joint_slopes(chain, path, followed.q, s, before=one) for one in (False, True))
    return s, after, before


def _grid(path: LineArcPath) -> FloatArray:
    """Return arc lengths in [m] that hold the ends of all segments and all rows, shape (n + 1,)."""
    places = np.unique(np.concatenate((path.bounds, path.at)))
    lengths = np.diff(places)
    counts = np.maximum(np.ceil(GRID * lengths / path.total), LEAST).astype(int)
    parts = zip(places[:-1], places[1:], counts, strict=True)
    return np.append(np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b, n in parts]), places[-1])
