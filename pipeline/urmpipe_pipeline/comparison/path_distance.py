"""Distance from a path: how far points are from its nearest point, whatever the time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import THREADS, FloatArray, IndexArray, map_blocks, row_blocks

ACCURACY = (1e-9, 1e-6)
"""What a distance may be too large by: in [m], and as a share of itself. A nanometre beside the path; a log
a metre away is not judged to less than a micrometre."""

BRANCHES = 4
"""A group of points or pieces consists of so many smaller ones."""

BLOCK = 1 << 12
"""Points that are searched for together."""

GROWN = 1 << 15
"""Points or pieces that are grouped together: what a core's cache holds."""

PAIRS = 1 << 16
"""Pairs of groups that are looked at at once: some MB."""

GUESS = 0.01
"""What the first guess may be too large by, as a share: in the middle of a circle the best takes forever."""


@dataclass(frozen=True, slots=True, eq=False)
class _Groups:
    """Groups of what is near one another in space, each as a straight piece and how far it leaves that.

    The widest groups come first, then those that they consist of, 4 each, and so on; the points or pieces
    themselves come last. Some stand there twice, so that all groups of a level have equally many.

    Attributes:
        widest: How many groups there are on the first level. Those that group k consists of begin at
            `widest + BRANCHES * k`.
        row: Which point or piece each of the last level is.
        start: Where the piece begins in [m], shape (n, 3).
        step: From there to its end in [m], shape (n, 3).
        spread: No part of the group is further than this from the piece, in [m], shape (n,).
    """

    widest: int
    row: IndexArray
    start: FloatArray
    step: FloatArray
    spread: FloatArray

    @property
    def single(self) -> int:
        """Where the points or pieces themselves begin."""
        return len(self.spread) - len(self.row)

    def parts(self, group: IndexArray) -> IndexArray:
        """Return what groups consist of, shape (n, 4)."""
        return self.widest + BRANCHES * group[:, np.newaxis] + np.arange(BRANCHES)


_Shape = Callable[[IndexArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Gives the start, step and spread of groups from the rows in them, shape (groups, rows a group)."""


def distance_from_path(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> FloatArray:
    """Return the distance of points from the nearest point of a path of straight pieces.

    Groups of points, each in a ball, are held against groups of pieces, each about a chord that it leaves by
    no more than its spread. A pair of them is dropped if it cannot bring a point nearer than the first guess,
    else the wider group is split: branch and bound. Groups are near in space, not in time, so a path that
    comes by the same place again and again is looked at once there, whole.

    A distance is never too small, and too large by no more than 1 nm and a millionth of itself.

    Args:
        points: In [m], shape (n, 3), without NaN.
        path: Vertices in [m], shape (m, 3), one of them without NaN; those with a NaN are passed over.
        joined: Where a vertex is joined to the next by a piece of the path, shape (m - 1,).

    Returns:
        In [m], shape (n,).
    """
    return _distances(points, path, joined)[0]


def _distances(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> tuple[FloatArray, int]:
    """Return the distances of points from a path, and how many pairs of groups were looked at for them."""
    found = np.empty(len(points))
    if not len(points):
        return found, 0
    pieces, balls = _of_path(path, joined), _of_points(points)
    best = _guess(balls, pieces)
    blocks = row_blocks(balls.widest, max(1, BLOCK * balls.widest // len(balls.row)))
    looked = map_blocks(lambda some: _search(balls, pieces, np.arange(some.start, some.stop), best), blocks)
    found[balls.row] = best[balls.single :]
    return found, sum(looked)


def _guess(balls: _Groups, pieces: _Groups) -> FloatArray:
    """Return how far each point is from the pieces at the nearest vertex, and the most of each ball."""
    from scipy.spatial import cKDTree

    start, step = pieces.start[pieces.single :], pieces.step[pieces.single :]
    once = np.flatnonzero(np.append(True, (start[1:] != start[:-1]).any(axis=1)))  # else rests take forever
    tree = cKDTree(start[once], balanced_tree=False, compact_nodes=False)
    points = balls.start[balls.single :]
    after = once[tree.query(points, eps=GUESS, workers=THREADS)[1]]
    place = np.empty(len(start), np.intp)
    place[pieces.row] = np.arange(len(start))
    before = place[np.maximum(pieces.row[after] - 1, 0)]
    levels = [np.minimum(*(_distance(points, start[one], step[one]) for one in (after, before)))]
    while len(levels[-1]) > balls.widest:
        levels.append(levels[-1].reshape(-1, BRANCHES).max(axis=1))
    return np.concatenate(levels[::-1])


def _search(balls: _Groups, pieces: _Groups, widest: IndexArray, best: FloatArray) -> int:
    """Lessen the best of the points in some of the widest balls; return how many pairs were looked at."""
    looked = 0
    waiting = [(np.repeat(widest, pieces.widest), np.tile(np.arange(pieces.widest), len(widest)))]
    while waiting:
        ball, piece = waiting.pop()  # the narrowest first: few wait then
        looked += len(ball)
        points = balls.start.take(ball, axis=0)  # take: several times as fast as [...]
        distance = _distance(points, pieces.start.take(piece, axis=0), pieces.step.take(piece, axis=0))
        single = np.flatnonzero((ball >= balls.single) & (piece >= pieces.single))
        np.minimum.at(best, ball[single], distance[single])
        around, beside = balls.spread.take(ball), pieces.spread.take(piece)
        least, most = distance - beside - around, best.take(ball)
        open_ = np.flatnonzero(least < most - (ACCURACY[0] + ACCURACY[1] * most))
        waiting += _split(balls, pieces, ball.take(open_), piece.take(open_))
    return looked


def _split(
    balls: _Groups, pieces: _Groups, ball: IndexArray, piece: IndexArray
) -> list[tuple[IndexArray, IndexArray]]:
    """Return pairs with the wider group of each split, some at a time; pairs of single ones are done with."""
    of_piece = (pieces.spread[piece] >= balls.spread[ball]) | (ball >= balls.single)
    of_piece &= piece < pieces.single
    of_ball = ~of_piece & (ball < balls.single)
    parts, whole = pieces.parts(piece[of_piece]), balls.parts(ball[of_ball])
    ball = np.append(np.repeat(ball[of_piece], BRANCHES), whole)
    piece = np.append(parts, np.repeat(piece[of_ball], BRANCHES))
    return [(ball[some], piece[some]) for some in row_blocks(len(ball), PAIRS)]


def _of_points(points: FloatArray) -> _Groups:
    """Return groups of points: each a ball about their mean."""

    def ball(rows: IndexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the balls about the points in each group."""
        middle, out = _centred(points.take(rows, axis=0))
        return middle, np.zeros_like(middle), _farthest(out)

    return _grouped(points, ball)


def _of_path(path: FloatArray, joined: NDArray[np.bool_]) -> _Groups:
    """Return groups of the pieces of a path; a vertex that is not joined to the next is one without length.

    The chord of a group is along what its ends spread most; the distance from a chord is convex, so no part
    of a piece is further from it than one of its ends.
    """
    known: NDArray[np.bool_] = np.asarray(np.isfinite(path).all(axis=1))
    start, linked = path[known], np.append(joined & known[1:] & known[:-1], False)[known]
    step = np.zeros_like(start)
    np.subtract(start[1:], start[:-1], out=step[:-1], where=linked[:-1, np.newaxis])

    def chord(rows: IndexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the chords of the pieces in each group."""
        if rows.shape[1] == 1:
            return start[rows[:, 0]], step[rows[:, 0]], np.zeros(len(rows))
        first = start.take(rows, axis=0)
        middle, out = _centred(np.concatenate((first, first + step.take(rows, axis=0)), axis=1))
        axis = _main_axis(out)
        along = out @ axis
        low, high = (axis[:, :, 0] * end(along, axis=1) for end in (np.min, np.max))
        out -= along * axis.transpose(0, 2, 1)
        return middle + low, high - low, _farthest(out)

    return _grouped(start + step / 2.0, chord)


def _grouped(middle: FloatArray, shape: _Shape) -> _Groups:
    """Return groups of what has its middles there, shape (n, 3): the widest split in 4 again and again."""
    size = 1
    while -(-len(middle) // size) > BRANCHES**2:
        size *= BRANCHES
    widest = -(-len(middle) // size)
    rows = _apart(middle, np.resize(np.arange(len(middle)), (1, widest * size)), widest)
    count = widest * (size * BRANCHES - 1) // (BRANCHES - 1)
    groups = _Groups(
        widest, np.empty(rows.size, np.intp), np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    )

    def grow(some: slice) -> None:
        """Split some of the widest groups, down to what they consist of."""
        level, first = rows[some], some.start
        while True:
            at = slice(first, first + len(level))
            groups.start[at], groups.step[at], groups.spread[at] = shape(level)
            if level.shape[1] == 1:
                groups.row[first - groups.single :][: len(level)] = level[:, 0]
                return
            level, first = _apart(middle, level, BRANCHES), widest + BRANCHES * first

    map_blocks(grow, row_blocks(widest, max(1, GROWN // size)))
    return groups


def _apart(middle: FloatArray, rows: IndexArray, parts: int) -> IndexArray:
    """Return the rows of groups, shape (k, n), in so many equal parts each, across what they spread most."""
    size = rows.shape[1] // parts
    if size > 1:
        out = _centred(middle.take(rows, axis=0))[1]
        along = (out @ _main_axis(out))[:, :, 0]
        order = np.argpartition(along, np.arange(1, parts) * size, axis=1)
        rows = np.take_along_axis(rows, order, axis=1)
    return rows.reshape(-1, size)


def _centred(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of the points in each group, and them seen from there, in place; shape (k, n, 3)."""
    mean = np.einsum("kni->ki", points) / points.shape[1]  # several times as fast as np.mean
    points -= mean[:, np.newaxis]
    return mean, points


def _main_axis(out: FloatArray) -> FloatArray:
    """Return the direction in which points spread most, shape (k, 3, 1); they are of shape (k, n, 3)."""
    return np.asarray(np.linalg.eigh(out.transpose(0, 2, 1) @ out)[1][:, :, -1:])


def _farthest(out: FloatArray) -> FloatArray:
    """Return the greatest length in each group of vectors, shape (k,); they are of shape (k, n, 3)."""
    return np.asarray(np.sqrt(np.einsum("kni,kni->kn", out, out).max(axis=1)))


def _distance(points: FloatArray, start: FloatArray, step: FloatArray) -> FloatArray:
    """Return the distance of points from straight pieces, shape (n,); all are of shape (n, 3)."""
    out = points - start
    squared = np.einsum("ni,ni->n", step, step)
    along = np.einsum("ni,ni->n", out, step)
    share = np.clip(along / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    out -= share[:, np.newaxis] * step
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", out, out)))
