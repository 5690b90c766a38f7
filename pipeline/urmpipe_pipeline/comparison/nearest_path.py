"""Distance from a path: how far points are from its nearest point, whatever the time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray
from urmpipe_models.row_blocks import row_blocks, side_by_side

ACCURACY = (1e-9, 1e-6)
"""What a distance may be too large by: in [m], and as a share of itself. A nanometre beside the path; a log
a metre away is not judged to less than a micrometre."""

BRANCHES = 8
"""A run of points or pieces consists of so many shorter ones."""

BLOCK = 1 << 12
"""Points that are worked on together."""

PAIRS = 1 << 17
"""Pairs of runs that are worked on at once: some tens of MB."""

ENOUGH = 256
"""Pairs a point, on average over a block, after which the accuracy is let go by a factor of 2, and so on.

Only points amid many pieces that are equally near need more, as where a path stands and trembles."""


@dataclass(frozen=True, slots=True, eq=False)
class _Runs:
    """Runs of what follows one another, each as a straight piece and how far it leaves that.

    The first ones are the points or pieces themselves, then come runs of 8 of them, runs of 64, and so on.

    Attributes:
        start: Where the piece begins in [m], shape (n, 3).
        step: From there to its end in [m], shape (n, 3).
        spread: No part of the run is further than this from the piece, in [m], shape (n,).
        slack: Any point of the piece has a part of the run within this, in [m], shape (n,).
        child: The first of the shorter runs that it consists of, shape (n,).
        children: How many these are, shape (n,); 0 of a point or piece itself.
        levels: Where the runs of each length begin, and how many runs there are.
    """

    start: FloatArray
    step: FloatArray
    spread: FloatArray
    slack: FloatArray
    child: NDArray[np.intp]
    children: NDArray[np.intp]
    levels: tuple[int, ...]


def distance_from_path(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> FloatArray:
    """Return the distance of points from the nearest point of a path of straight pieces.

    Runs of points, each in a ball, are held against runs of pieces, each about a chord that it leaves by no
    more than its spread. A pair of them is dropped once it cannot bring a point nearer than what is known of
    it already, else the longer run is split: branch and bound. Points that follow one another share the work
    far from the path; a run that is nearly straight, or a ball that is small, is never looked into.

    A distance is never too small, and too large by no more than 1 nm and a millionth of itself; where very
    many pieces are equally near, by a small multiple of that, or by what the path trembles there.

    Args:
        points: In [m], shape (n, 3), without NaN.
        path: Vertices in [m], shape (m, 3), one of them without NaN; those with a NaN are passed over.
        joined: Where a vertex is joined to the next by a piece of the path, shape (m - 1,).

    Returns:
        In [m], shape (n,).
    """
    pieces = _of_path(path, joined)
    blocks = row_blocks(len(points), BLOCK)
    found = side_by_side(lambda rows: _search(_of_points(points[rows]), pieces), blocks)
    return np.concatenate(found) if found else np.empty(0)


def _search(balls: _Runs, pieces: _Runs) -> FloatArray:
    """Return the distances of the points in some balls from the nearest of some pieces, shape (n,)."""
    best = np.full(len(balls.spread), np.inf)  # what no point of a ball is further away than
    ball, piece = (np.arange(*runs.levels[-2:]) for runs in (balls, pieces))
    waiting = deque([(np.repeat(ball, len(piece)), np.tile(piece, len(ball)))])
    done, share = 0, ENOUGH * balls.levels[1]
    while waiting:
        ball, piece = waiting.popleft()  # the widest first: they tell most
        done += len(ball)
        distance = _distance(balls.start[ball], pieces.start[piece], pieces.step[piece])
        np.minimum.at(best, ball, distance + pieces.slack[piece] + balls.spread[ball])
        most = best[ball]
        accuracy = (ACCURACY[0] + ACCURACY[1] * most) * 2.0 ** (done // share)
        open_ = distance - pieces.spread[piece] - balls.spread[ball] < most - accuracy
        waiting += _split(balls, pieces, ball[open_], piece[open_], best)
    for k in range(len(balls.levels) - 2, 0, -1):  # what holds for a ball holds for the points in it
        low, high, top = balls.levels[k - 1 : k + 2]
        best[low:high] = np.minimum(best[low:high], np.repeat(best[high:top], BRANCHES)[: high - low])
    return best[: balls.levels[1]]


def _split(
    balls: _Runs, pieces: _Runs, ball: NDArray[np.intp], piece: NDArray[np.intp], best: FloatArray
) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return pairs with the wider run of each split, some at a time; parts of a ball begin with its best."""
    of_piece = (pieces.spread[piece] >= balls.spread[ball]) | (balls.children[ball] == 0)
    of_piece &= pieces.children[piece] > 0
    parts = np.where(of_piece, pieces.children[piece], balls.children[ball])
    first = np.where(of_piece, pieces.child[piece], balls.child[ball])
    part = np.arange(parts.sum()) + np.repeat(first - np.cumsum(parts) + parts, parts)
    of_piece, ball, piece = (np.repeat(one, parts) for one in (of_piece, ball, piece))
    of_ball = ~of_piece
    np.minimum.at(best, part[of_ball], best[ball[of_ball]])
    ball, piece = np.where(of_piece, ball, part), np.where(of_piece, part, piece)
    return [
        (ball[start : start + PAIRS], piece[start : start + PAIRS]) for start in range(0, len(ball), PAIRS)
    ]


def _of_points(points: FloatArray) -> _Runs:
    """Return runs of points: each a ball about the middle of what it spans."""
    levels = []
    for first, run in _levels(len(points)):
        middle = (np.minimum.reduceat(points, first) + np.maximum.reduceat(points, first)) / 2.0
        spread = np.maximum.reduceat(np.linalg.norm(points - middle[run], axis=1), first)
        levels.append((middle, np.zeros_like(middle), spread, spread))
    return _runs(levels)


def _of_path(path: FloatArray, joined: NDArray[np.bool_]) -> _Runs:
    """Return runs of the pieces of a path; a vertex that is not joined to the next is a piece without length.

    A run of joined pieces crosses every plane across its chord: no point of that is further from the run than
    its spread. Where a joint is missing, the vertex that the run begins with is as near as the chord is long.
    """
    known: NDArray[np.bool_] = np.asarray(np.isfinite(path).all(axis=1))
    vertex, linked = path[known], np.append(joined & known[1:] & known[:-1], False)[known]
    end = len(vertex) - 1
    inner = np.append(linked[:-1], True)
    levels = []
    for first, run in _levels(len(vertex)):
        single = len(first) == len(vertex)
        last = np.where(linked, first + 1, first) if single else np.append(first[1:], end)
        start, step = vertex[first], vertex[last] - vertex[first]
        spread = np.maximum.reduceat(_distance(vertex, start[run], step[run]), first)
        whole = np.logical_and.reduceat(inner, first) | single
        levels.append((start, step, spread, np.where(whole, spread, np.linalg.norm(step, axis=1))))
    return _runs(levels)


def _levels(count: int) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield where runs of 1, 8, 64, ... of so many begin and which run each belongs to, up to a few runs."""
    row: NDArray[np.intp] = np.arange(count)
    length = 1
    while True:
        yield row[::length], row // length
        if -(-count // length) <= BRANCHES:
            return
        length *= BRANCHES


def _runs(levels: Sequence[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]) -> _Runs:
    """Return the runs of all lengths, the shortest first, each with where its parts stand."""
    sizes = [len(level[0]) for level in levels]
    begins = np.concatenate(([0], np.cumsum(sizes)))
    child, children = [np.zeros(sizes[0], np.intp)], [np.zeros(sizes[0], np.intp)]
    for begin, size, shorter in zip(begins, sizes[1:], sizes, strict=False):
        parts = np.arange(size) * BRANCHES
        child.append(begin + parts)
        children.append(np.minimum(BRANCHES, shorter - parts))
    start, step, spread, slack = (np.concatenate(parts) for parts in zip(*levels, strict=True))
    return _Runs(
        start, step, spread, slack, np.concatenate(child), np.concatenate(children), tuple(begins.tolist())
    )


def _distance(points: FloatArray, start: FloatArray, step: FloatArray) -> FloatArray:
    """Return the distance of points from straight pieces, shape (n,); all are of shape (n, 3)."""
    out = points - start
    squared = np.einsum("ni,ni->n", step, step)
    along = np.einsum("ni,ni->n", out, step)
    share = np.clip(along / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    out -= share[:, np.newaxis] * step
    return np.asarray(np.sqrt(np.einsum("ni,ni->n", out, out)))
