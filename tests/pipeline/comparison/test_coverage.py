"""How much a verdict rests on: two shares, against independent code, and what a PASS then promises."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from statistics import median

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import urmpipe
from made_runs import ingested
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import rotation_angle, to_quaternions
from urmpipe_pipeline.comparison.compare import compare_runs

AXES = ["x [m]", "y [m]", "z [m]"]
TOLERANCE = 0.0035


def path_of(t: FloatArray, rest: float = 0.0) -> FloatArray:
    """A motion through space in [m] that begins and ends at rest, shape (n, 3)."""
    moved = np.clip(t - rest, 0.0, None)
    return 0.3 * np.column_stack([np.sin(1.3 * moved), np.cos(0.9 * moved), 0.5 * np.sin(2.1 * moved)])


def table(t: FloatArray, position: FloatArray) -> pd.DataFrame:
    return pd.DataFrame({"t [s]": t, **dict(zip(AXES, position.T, strict=True))})


Rows = list[tuple[int, FloatArray]]


def valued(t_ns: Iterable[int], frame: pd.DataFrame) -> Rows:
    """Times in [ns] and positions in [m] of the rows that have a value."""
    return [(int(t), p) for t, p in zip(t_ns, frame[AXES].to_numpy(), strict=True) if np.isfinite(p).all()]


def period(side: Rows) -> float:
    return median([b[0] - a[0] for a, b in pairwise(side)] or [0])


def at(reference: Rows, t: int) -> FloatArray | None:
    """The reference at a time; None outside of it and inside a gap of more than three periods."""
    for (t0, p0), (t1, p1) in pairwise(reference):
        if t0 <= t <= t1:
            inside = t0 < t < t1 and t1 - t0 > 3 * period(reference)
            return None if inside else p0 + (t - t0) / (t1 - t0) * (p1 - p0)
    return None


def is_shown(t: int, reference: Rows, judged: Rows, usual: float, tolerance: float) -> bool:
    """Whether a sample of the reference is shown by what was judged of a log with a usual period."""
    near = min(abs(t - other) for other, _ in judged)
    if near <= period(reference) / 2:
        return True
    before, after = [one for one in judged if one[0] <= t], [one for one in judged if one[0] >= t]
    if before and after:
        (t0, p0), (t1, p1) = before[-1], after[0]
        line = ((p0 + (s - t0) / (t1 - t0) * (p1 - p0), p) for s, p in reference if t0 < s < t1)
        return near <= 0.9 * usual and all(np.abs(p - q).max() <= tolerance for p, q in line)
    end, value = judged[0 if after else -1]
    beyond = [np.abs(p - value).max() for s, p in reference if (s < end if after else s > end)]
    return bool(max(beyond) <= tolerance < max(np.abs(p - value).max() for _, p in reference))


def defined_shares(reference: Rows, log: Rows, tolerance: float) -> tuple[float, float]:
    """The shares by their definition, sample by sample; both clocks start together, an axis is judged."""
    judged = [(t, value) for t, _ in log if (value := at(reference, t)) is not None]
    shown = [is_shown(t, reference, judged, period(log), tolerance) for t, _ in reference]
    times = [t for t, _ in judged]
    start, whole, counted = log[0][1], 0.0, 0.0
    for t, p in log:
        if (length := math.dist(start, p)) >= tolerance:
            start, whole, counted = p, whole + length, counted + length * (t in times)
    return sum(shown) / len(shown), counted / whole if whole else len(judged) / len(log)


@st.composite
def damaged(draw: st.DrawFn) -> tuple[pd.DataFrame, pd.DataFrame, float]:
    """A reference and a log of other periods, with rows that are deleted, emptied, late or beyond it."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    t = draw(st.sampled_from([0.004, 0.01, 0.03])) * np.arange(draw(st.integers(8, 60)), dtype=np.float64)
    asked = table(t, path_of(t, draw(st.sampled_from([0.0, 0.05]))))
    own = draw(st.sampled_from([0.004, 0.01, 0.05])) * np.arange(draw(st.integers(4, 60)), dtype=np.float64)
    own[1:] += rng.uniform(-0.3, 0.3, len(own) - 1) * own[1] * draw(st.sampled_from([0.0, 1.0]))
    done = table(own, path_of(own) * draw(st.sampled_from([0.0, 1.0, 1.1])))
    for side in (asked, done):
        side.loc[rng.random(len(side)) < draw(st.sampled_from([0.0, 0.2, 0.6])), AXES[0]] = np.nan
        side.loc[[0, 1, len(side) - 1], AXES] = path_of(side["t [s]"].to_numpy()[[0, 1, -1]])
    lost = rng.random(len(done)) < draw(st.sampled_from([0.0, 0.2, 0.8]))
    lost[[0, 1, -1]] = False
    return asked, done[~lost].reset_index(drop=True), draw(st.sampled_from([0.0005, 0.0035, 0.05]))


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(damaged())
def test_the_shares_are_what_their_definition_gives(
    case: tuple[pd.DataFrame, pd.DataFrame, float],
) -> None:
    asked, done, tolerance = case
    made = urmpipe.compare(asked, done, tolerance=tolerance)
    (one,) = made.runs
    sides = valued(made.reference.t_ns, asked), valued(one.run.on_rows.t_ns, done)
    got = one.shares["coverage"].value, one.shares["judged"].value
    assert got == pytest.approx(defined_shares(*sides, tolerance), abs=1e-12)  # sums of 60 lengths


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 0.09),
    st.sampled_from([0.9, 0.4, 0.05]),
)  # fmt: skip
@example(0, 1.0, 0.0, 0.0, 0.05).via("all that is out of tolerance is deleted")
def test_a_pass_promises_the_undamaged_truth_on_the_share_that_it_names(
    seed: int, deleted: float, emptied: float, jitter: float, least: float
) -> None:
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(200, dtype=np.float64)
    wrong = np.zeros(len(t))
    for start in rng.integers(2, 190, rng.integers(0, 4)):
        wrong[start : start + rng.integers(1, 80)] = 0.01  # out of tolerance
    truth = path_of(t)
    late = t + 0.01 * rng.uniform(-jitter, jitter, len(t)) * (t > 0.0)  # shown by no row but its own
    done = table(late, np.column_stack([np.interp(late, t, axis) for axis in truth.T]) + wrong[:, np.newaxis])
    out = wrong > 0.0
    done.loc[out & (rng.random(len(t)) < emptied), AXES[1]] = np.nan
    done = done[~(out & (rng.random(len(t)) < deleted))]
    made = urmpipe.compare(table(t, truth), done, tolerance={"axis": TOLERANCE, "coverage": least})
    coverage = made.to_dict()["runs"][0]["coverage"]
    if made.verdict == "pass":
        assert coverage["value"] >= least
        assert np.count_nonzero(~out) >= round(coverage["value"] * len(t))
    elif not out.any():
        assert (
            coverage["value"] >= least and made.runs[0].worst_statistics.verdict == "fail"
        )  # never by its shares


@pytest.mark.slow
def test_no_well_made_pair_fails_by_its_shares() -> None:
    """Other periods, jitter to a third of a period, lost rows up to 2 %, recordings longer by 20 %."""
    rng = np.random.default_rng(43)
    for _ in range(1000):
        periods = rng.choice([0.002, 0.004, 0.005, 0.008, 0.01, 0.02, 1 / 30], 2)
        lasts, rest = rng.uniform(1.5, 2.5), rng.choice([0.0, 1.0])
        sides = []
        for period, longer in zip(periods, (0.0, rng.uniform(0.0, 0.2)), strict=True):
            t = np.arange(0.0, lasts * (1.0 + longer), period, dtype=np.float64)
            t[1:] += period * rng.uniform(-1 / 3, 1 / 3, len(t) - 1)
            kept = rng.random(len(t)) >= rng.uniform(0.0, 0.02)
            kept[[0, -1]] = True
            sides.append(ingested(t[kept], position=path_of(t[kept], rest)))
        shares = compare_runs(sides[0], sides[1:]).runs[0].shares
        assert all(one.verdict == "pass" for one in shares.values()), (periods, shares)


@pytest.mark.parametrize("tolerance", ["joint=0.1deg", "angle=0.1deg", "norm=1mm", "x=1mm", "path=1mm"])
def test_whatever_is_judged_the_shares_are_of_it(tolerance: str) -> None:
    t = 0.01 * np.arange(200, dtype=np.float64)
    q = np.column_stack([0.3 * np.sin(t + k) for k in range(6)])
    whole, part = (urmpipe.ingest(t=t[:end], q=q[:end], robot="ur5e") for end in (200, 120))
    one = urmpipe.compare(whole, part, tolerance=tolerance).runs[0]
    assert (one.shares["coverage"].value, one.shares["judged"].value) == (0.6, 1.0)
    assert (one.verdict, one.decisive) == ("fail", one.shares["coverage"])
    longer = urmpipe.compare(part, whole, tolerance=f"{tolerance},judged=40%").runs[0]
    assert longer.shares["coverage"].value == 1.0 and longer.verdict == "pass"
    tcp = whole.tcp
    assert tcp is not None
    lengths = np.linalg.norm(np.diff(whole.q if "joint" in tolerance else tcp.position, axis=0), axis=1)
    if "angle" in tolerance:
        quat = to_quaternions(tcp.euler_zyx, "zyx")
        lengths = rotation_angle(quat[1:], quat[:-1])
    share = lengths[:119].sum() / lengths.sum()
    assert longer.shares["judged"].value == pytest.approx(share, abs=0.02)  # a step of the tolerance
