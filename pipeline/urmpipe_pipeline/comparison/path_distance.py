"""Distance of points from the nearest point of a path, at any time, by branch and bound.

1. `_group`: points, and pieces of the path, in a tree of groups that are near in space, four per group. Each
   group has a straight piece (of points: their mean) and a spread, its largest distance from that.
2. `_guess`: an upper bound for each point, by the pieces at the nearest vertex (k-d tree).
3. `_search`: a pair of groups is dropped if distance - spreads >= the bound of the points; else the wider
   group is split. A pair of single ones lowers the bound of the point.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import THREADS, FloatArray, IndexArray, map_blocks, row_blocks

# Allowed error in [m] and as a share of the distance: a nanometre next to the path; a log a metre away is not
# judged to less than a micrometre.
ACCURACY = (1e-9, 1e-6)
BRANCHES = 4  # smaller groups per group
BLOCK = 1 << 12  # points that are searched together
GROUP_SIZE = 1 << 15  # points or pieces that are grouped together, in the cache of a core
PAIRS = 1 << 16  # pairs of groups per step: some MB
GUESS = (
    0.01  # share by which the first guess may be too large: at the centre of a circle the best takes forever
)


class _Groups(NamedTuple):
    """Groups of points or pieces that are near in space, each as a straight piece and a spread about it.

    The widest groups come first, then those that they consist of, 4 each, and so on; the points or pieces
    themselves come last. Some are repeated, so that all groups of a level have equally many.

    Attributes:
        widest: Number of groups on the first level. The parts of group k begin at `widest + BRANCHES * k`.
        row: Point or piece of each on the last level.
        start: Start of the straight piece in [m], shape (n, 3).
        step: From there to its end in [m], shape (n, 3).
        spread: Largest distance of the group from the straight piece in [m], shape (n,).
    """

    widest: int
    row: IndexArray
    start: FloatArray
    step: FloatArray
    spread: FloatArray

    @property
    def single(self) -> int:
        """Index of the first point or piece."""
        return len(self.spread) - len(self.row)

    def parts(self, group: IndexArray) -> IndexArray:
        """Return the parts of groups, shape (n, 4)."""
        return self.widest + BRANCHES * group[:, np.newaxis] + np.arange(BRANCHES)


# Start, step and spread of groups from the rows in them, shape (groups, rows per group).
_Shape = Callable[[IndexArray], tuple[FloatArray, FloatArray, FloatArray]]


def distance_from_path(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> FloatArray:
    """Return the distance of points from the nearest point of a path of straight pieces.

    A distance is never too small, and too large by no more than 1 nm and a millionth of it. Groups are near
    in space, not in time, so a path that repeats a motion is searched once there.

    Args:
        points: In [m], shape (n, 3), without NaN.
        path: Vertices in [m], shape (m, 3), one of them without NaN; those with a NaN are skipped.
        joined: Where a vertex is joined to the next by a piece of the path, shape (m - 1,).

    Returns:
        In [m], shape (n,).
    """
    return _distances(points, path, joined)[0]


def _distances(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> tuple[FloatArray, int]:
    """Return the distances of points from a path, and how many pairs of groups were searched."""
    distances = np.empty(len(points))
    if not len(points):
        return distances, 0

    def ball(rows: IndexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        middle, out = _centre(points.take(rows, axis=0))
        return middle, np.zeros_like(middle), _max_length(out)

    pieces, balls = _group_path(path, joined), _group(points, ball)
    best = _guess(balls, pieces)
    blocks = row_blocks(balls.widest, max(1, BLOCK * balls.widest // len(balls.row)))
    counts = map_blocks(lambda some: _search(balls, pieces, np.arange(some.start, some.stop), best), blocks)
    distances[balls.row] = best[balls.single :]
    return distances, sum(counts)


def _guess(balls: _Groups, pieces: _Groups) -> FloatArray:
    """Return the distance of points from the pieces at the nearest vertex, and the largest per ball."""
    from scipy.spatial import cKDTree

    start, step = pieces.start[pieces.single :], pieces.step[pieces.single :]
    # A rest has many equal vertices, which would take forever.
    once = np.flatnonzero(np.append(True, (start[1:] != start[:-1]).any(axis=1)))
    tree = cKDTree(start[once], balanced_tree=False, compact_nodes=False)
    points = balls.start[balls.single :]
    after = once[tree.query(points, eps=GUESS, workers=THREADS)[1]]
    place = np.empty(len(start), np.intp)
    place[pieces.row] = np.arange(len(start))
    before = place[np.maximum(pieces.row[after] - 1, 0)]
    levels = [np.minimum(*(_distance(points, start[at], step[at]) for at in (after, before)))]
    while len(levels[-1]) > balls.widest:
        levels.append(levels[-1].reshape(-1, BRANCHES).max(axis=1))
    return np.concatenate(levels[::-1])


def _search(balls: _Groups, pieces: _Groups, widest: IndexArray, best: FloatArray) -> int:
    """Lower the best distances of the points in some of the widest balls; return the number of pairs."""
    count = 0
    waiting = [(np.repeat(widest, pieces.widest), np.tile(np.arange(pieces.widest), len(widest)))]
    while waiting:
        ball, piece = waiting.pop()  # the narrowest first: few wait then
        count += len(ball)
        points = balls.start.take(ball, axis=0)  # take: several times as fast as [...]
        distance = _distance(points, pieces.start.take(piece, axis=0), pieces.step.take(piece, axis=0))
        single = np.flatnonzero((ball >= balls.single) & (piece >= pieces.single))
        np.minimum.at(best, ball[single], distance[single])
        least = distance - pieces.spread.take(piece) - balls.spread.take(ball)
        most = best.take(ball)
        kept = np.flatnonzero(least < most - (ACCURACY[0] + ACCURACY[1] * most))
        waiting += _split(balls, pieces, ball.take(kept), piece.take(kept))
    return count


def _split(
    balls: _Groups, pieces: _Groups, ball: IndexArray, piece: IndexArray
) -> list[tuple[IndexArray, IndexArray]]:
    """Return pairs with the wider group of each split, some at a time; pairs of single ones are complete."""
    by_piece = (pieces.spread[piece] >= balls.spread[ball]) | (ball >= balls.single)
    by_piece &= piece < pieces.single
    by_ball = ~by_piece & (ball < balls.single)
    of_pieces, of_balls = pieces.parts(piece[by_piece]), balls.parts(ball[by_ball])
    ball = np.append(np.repeat(ball[by_piece], BRANCHES), of_balls)
    piece = np.append(of_pieces, np.repeat(piece[by_ball], BRANCHES))
    return [(ball[some], piece[some]) for some in row_blocks(len(ball), PAIRS)]


def _group_path(path: FloatArray, joined: NDArray[np.bool_]) -> _Groups:
    """Return groups of the pieces of a path; a vertex that is not joined to the next is one without length.

    The chord of a group is along the main axis of its ends; the distance from a chord is convex, so no part
    of a piece is further from it than one of its ends.
    """
    known: NDArray[np.bool_] = np.asarray(np.isfinite(path).all(axis=1))
    start, linked = path[known], np.append(joined & known[1:] & known[:-1], False)[known]
    step = np.zeros_like(start)
    np.subtract(start[1:], start[:-1], out=step[:-1], where=linked[:-1, np.newaxis])

    def chord(rows: IndexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        if rows.shape[1] == 1:
            return start[rows[:, 0]], step[rows[:, 0]], np.zeros(len(rows))
        first = start.take(rows, axis=0)
        middle, out = _centre(np.concatenate((first, first + step.take(rows, axis=0)), axis=1))
        axis = _main_axis(out)
        along = out @ axis
        low, high = (axis[:, :, 0] * end(along, axis=1) for end in (np.min, np.max))
        out -= along * axis.transpose(0, 2, 1)
        return middle + low, high - low, _max_length(out)

    return _group(start + step / 2.0, chord)


def _group(middle: FloatArray, shape: _Shape) -> _Groups:
    """Return groups by their middles, shape (n, 3): the widest split in 4 again and again."""
    size = 1
    while -(-len(middle) // size) > BRANCHES**2:
        size *= BRANCHES
    widest = -(-len(middle) // size)
    rows = _divide(middle, np.resize(np.arange(len(middle)), (1, widest * size)), widest)
    count = widest * (size * BRANCHES - 1) // (BRANCHES - 1)
    start, step, spread = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    groups = _Groups(widest, np.empty(rows.size, np.intp), start, step, spread)

    def grow(some: slice) -> None:
        """Split some of the widest groups, down to their points or pieces."""
        level, first = rows[some], some.start
        while True:
            at = slice(first, first + len(level))
            start[at], step[at], spread[at] = shape(level)
            if level.shape[1] == 1:
                groups.row[first - groups.single :][: len(level)] = level[:, 0]
                return
            level, first = _divide(middle, level, BRANCHES), widest + BRANCHES * first

    map_blocks(grow, row_blocks(widest, max(1, GROUP_SIZE // size)))
    return groups


def _divide(middle: FloatArray, rows: IndexArray, parts: int) -> IndexArray:
    """Return the rows of groups, shape (k, n), each divided into equal parts across its main axis."""
    size = rows.shape[1] // parts
    if size > 1:
        out = _centre(middle.take(rows, axis=0))[1]
        along = (out @ _main_axis(out))[:, :, 0]
        order = np.argpartition(along, np.arange(1, parts) * size, axis=1)
        rows = np.take_along_axis(rows, order, axis=1)
    return rows.reshape(-1, size)


def _centre(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of the points in each group, and the points minus it, in place; shape (k, n, 3)."""
    mean = np.einsum("kni->ki", points) / points.shape[1]  # several times as fast as np.mean
    points -= mean[:, np.newaxis]
    return mean, points


def _main_axis(out: FloatArray) -> FloatArray:
    """Return the direction of the largest spread of points, shape (k, n, 3), as shape (k, 3, 1)."""
    return np.asarray(np.linalg.eigh(out.transpose(0, 2, 1) @ out)[1][:, :, -1:])


def _max_length(out: FloatArray) -> FloatArray:
    """Return the greatest length in each group of vectors, shape (k, n, 3), as shape (k,)."""
    return np.asarray(np.sqrt(np.einsum("kni,kni->kn", out, out).max(axis=1)))


def _distance(points: FloatArray, start: FloatArray, step: FloatArray) -> FloatArray:
    """Return the distance of points from straight pieces, shape (n,); all are of shape (n, 3)."""
    out = points - start
    squared = np.einsum("ni,ni->n", step, step)
    along = np.einsum("ni,ni->n", out, step)
    share = np.clip(along / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    out -= share[:, np.newaxis] * step
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", out, out)))
