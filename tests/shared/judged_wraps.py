"""Wraps of joints as `repolarize`, `repolarize_sample` and `find_interpolated_samples` judge them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from urmpipe_models import wraps
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.wraps import FULL_TURN, WrapState, repolarize, repolarize_sample

TSP = 0.005  # s


def wrap(x: FloatArray, period: float = FULL_TURN) -> FloatArray:
    """Limit to +-period/2, as an environment with limited joints does."""
    return x - period * np.floor((x + period / 2.0) / period)


class Judged(NamedTuple):
    """The turns added to each sample of a joint, and rows of in-between samples and unexplained steps."""

    turns: list[int]
    in_between: list[int]
    unexplained: list[int]


def batch_judged(batch: wraps.Repolarized, j: int) -> Judged:
    """Return the results of a joint by `repolarize`."""
    changes, of_joint = np.zeros(len(batch.q), dtype=np.int64), batch.joints == j
    changes[batch.rows[of_joint]] = batch.change[of_joint]
    lists = (rows[rows[:, 1] == j, 0].tolist() for rows in (batch.in_between, batch.unexplained))
    return Judged(np.cumsum(changes).tolist(), *lists)


def judge(q: FloatArray, dt: Any = TSP, period: Any = FULL_TURN, max_speed: float = math.inf) -> list[Judged]:
    """Return the results of each joint, which the batch and the steps must give bit for bit."""
    periods, times = np.broadcast_to(period, q.shape[1]), np.broadcast_to(dt, len(q))
    batch = repolarize(q, times, period=periods, max_speed=max_speed)
    assert batch.change.dtype == np.int64
    assert batch.change.all()
    for rows in (np.column_stack((batch.rows, batch.joints)), batch.unexplained, batch.in_between):
        assert rows.tolist() == sorted(rows.tolist())  # by row and joint
    joints = []
    for j, column in enumerate(q.T):
        state, out, changes, unexplained, in_between, last = WrapState(), [], [], set[int](), [], -1
        options = {"period": float(periods[j]), "max_speed": max_speed}
        for i, (value, elapsed) in enumerate(zip(column, times, strict=True)):
            state, result, flags = repolarize_sample(state, value, elapsed, **options)
            out.append(float(result))
            changes.append(int(flags.change))
            unexplained |= {i} if flags.unexplained else set()
            if flags.in_between:
                in_between.append(last)
                unexplained -= {last}
            last = i if abs(value) < wraps.MAX_VALUE else last
        turns = np.cumsum(changes)
        assert np.array(out).tobytes() == np.ascontiguousarray(batch.q[:, j]).tobytes()
        np.testing.assert_array_equal(out, column + periods[j] * turns)
        assert np.array(out)[turns == 0].tobytes() == column[turns == 0].tobytes()  # signs of zeros, too
        joints.append(Judged(turns.tolist(), in_between, sorted(unexplained)))
        assert joints[j] == batch_judged(batch, j)
    return joints


def find_in_between(q: FloatArray, max_speed: float = math.inf) -> Judged:
    """Return the results of a joint by the batch, with in-between samples that only the whole log shows."""
    t, here = TSP * np.arange(len(q), dtype=np.float64), np.flatnonzero(~np.isnan(q))
    batch = repolarize(q[:, np.newaxis], np.full(len(q), TSP), max_speed=max_speed)
    rows, unwrapped = np.searchsorted(here, batch.rows), batch.q[here, 0]
    found = here[wraps.find_interpolated_samples(q[here], unwrapped, t[here], rows, FULL_TURN)]
    judged = batch_judged(batch, 0)
    return judged._replace(in_between=sorted({*judged.in_between, *found.tolist()}))
