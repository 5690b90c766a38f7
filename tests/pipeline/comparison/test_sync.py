"""Laws of `sync="auto"`, the offset between two clocks by the motion; `sync.cases` has its answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asserting import refusal, there
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_pipeline.comparison.sync import (
    iter_channels,
    linearise,
    mean_rates,
    sync_warnings,
    synchronise,
)
from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.trajectories import AlignMode, Trajectory

Motion = Callable[[FloatArray], FloatArray]

JOINTS = tuple(f"q{k}" for k in range(1, 7))
ALLOWED = (
    "allowed: one motion that does not repeat itself, at least half of it on both sides; --sync start aligns"
    " the first samples; --sync SECONDS sets the offset"
)
CLEAN = 1e-5
"""In [s]: a fiftieth of the tenth of a period of 5 ms that is asked for. Lines between samples 5 to 10 ms
apart miss the motions here by 1e-4 of their size, and that is nearly orthogonal to the rate."""


def smooth(seed: int, channels: int) -> Motion:
    """A motion of five frequencies up to 0.6 Hz a channel, about 1 in size."""
    rng = np.random.default_rng(seed)
    size, phase = rng.normal(size=(5, channels)), rng.uniform(0.0, 2.0 * np.pi, (5, channels))
    turns = 2.0 * np.pi * rng.uniform(0.05, 0.6, (5, channels))
    return lambda t: sum(size[k] * np.sin(np.outer(t, turns[k]) + phase[k]) for k in range(5))


def moves(seed: int, channels: int) -> Motion:
    """Moves from point to point, 1 to 2.5 s each with a rest at its end, over 100 s."""
    rng = np.random.default_rng(seed)
    ends, points = np.cumsum(rng.uniform(1.0, 2.5, 80)), rng.normal(size=(80, channels))
    resting = rng.uniform(0.1, 0.5, 80)

    def at(t: FloatArray) -> FloatArray:
        k = np.clip(np.searchsorted(ends, t), 1, 79)
        share = (t - ends[k - 1]) / ((ends[k] - ends[k - 1]) * (1.0 - resting[k]))
        s = np.clip(share, 0.0, 1.0)
        blend = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
        return np.asarray(points[k - 1] + (points[k] - points[k - 1]) * blend[:, np.newaxis])

    return at


def times(start: float, duration: float, period: float) -> FloatArray:
    return start + np.arange(0.0, duration, period)


def joints(values: FloatArray, t: FloatArray, name: str = "log") -> Trajectory:
    names = JOINTS[: values.shape[1]]
    units = ("rad",) * len(names)
    return replace(path(np.zeros((len(t), 3)), t, name), joints=names, joint_units=units, q=values)


def path(position: FloatArray, t: FloatArray, name: str = "log") -> Trajectory:
    t_ns = np.rint((t - t[0]) * 1e9).astype(np.int64)
    return Trajectory(name, t_ns, position, (SourceFile(f"{name}.csv", "0", 1),))


def turning(t: FloatArray) -> Rotation:
    return Rotation.from_rotvec(np.outer(np.sin(0.9 * t + 0.4), [0.6, 0.3, 0.2]))


def refused(reference: Trajectory, log: Trajectory, align: AlignMode = "none") -> str:
    return refusal(LogError, synchronise, reference, log, "auto", align)


def shared(q: Motion, wanted: FloatArray, done: FloatArray) -> float:
    """Share of a motion, as the energy of its rates, that both sides have; of the side with more of it."""
    first, last = max(wanted[0], done[0]), min(wanted[-1], done[-1])
    energies = [(np.diff(q(t), axis=0) ** 2).sum(axis=1) for t in (wanted, done)]
    both = [(t[:-1] >= first) & (t[1:] <= last) for t in (wanted, done)]
    return max(float(side[here].sum() / side.sum()) for side, here in zip(energies, both, strict=True))


STARTS = st.floats(0.0, 6.0)
LENGTHS = st.floats(14.0, 20.0)
RATES = st.sampled_from([(0.005, 0.005), (0.005, 0.008), (0.008, 0.005), (0.004, 0.01)])
SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(SEEDS, STARTS, STARTS, LENGTHS, LENGTHS, RATES, st.sampled_from([smooth, moves]))
@example(19933, 0.0, 6.0, 14.0, 15.0, (0.005, 0.005), smooth)  # 8 s in both, 0.49 of the motion
@example(3262002750, 0.0, 6.0, 14.0, 14.0, (0.004, 0.01), moves)
def test_any_offset_between_two_logs_of_the_joints_is_found_or_too_little_is_in_both(
    seed: int, first: float, second: float, long: float, other: float, rate: tuple[float, float],
    make: Callable[[int, int], Motion],
) -> None:  # fmt: skip
    q = make(seed, 6)
    wanted, done = times(first, long, rate[0]), times(second, other, rate[1])
    turns = 2.0 * np.pi * np.arange(6)  # two logs may count the turns of their start differently
    reference, log = joints(q(wanted), wanted, "wanted"), joints(q(done) + turns, done)
    try:
        sync = synchronise(reference, log, "auto")
    except LogError as error:
        assert str(error).endswith(f", {ALLOWED}")
        # A period of up to 0.1 s at either end, of 8 s in both, is cut off: 0.02 of the motion.
        assert shared(q, wanted, done) < 0.52
        return
    assert abs(sync.offset - (second - first)) < CLEAN
    assert (sync.mode, sync.by) == ("auto", "joints")
    assert there(sync.similarity) > 0.999  # lines between samples leave less than 1e-3 unlike


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(SEEDS, STARTS, STARTS, RATES, st.sampled_from([smooth, moves]), st.booleans())
def test_any_offset_between_two_paths_is_found_wherever_they_stand(
    seed: int, first: float, second: float, rate: tuple[float, float], make: Callable[[int, int], Motion],
    turned: bool,
) -> None:  # fmt: skip
    p = make(seed, 3)
    wanted, done = times(first, 40.0, rate[0]), times(second, 36.0, rate[1])
    moved = (Rotation.random(rng=seed) if turned else Rotation.identity()).apply(p(done))
    reference, log = path(p(wanted), wanted, "wanted"), path(moved + np.array([0.3, -2.0, 1.0]), done)
    for align in ("none", "rigid", "start"):
        sync = synchronise(reference, log, "auto", align)
        assert abs(sync.offset - (second - first)) < CLEAN
        assert sync.by == "position"


@pytest.mark.parametrize("seed", range(8))
def test_a_piece_is_found_in_the_whole_and_the_whole_about_a_piece(seed: int) -> None:
    q = moves(seed, 6)
    whole, piece = times(0.0, 60.0, 0.005), times(23.4567, 6.0, 0.008)
    longer, shorter = joints(q(whole), whole), joints(q(piece), piece)
    assert abs(synchronise(longer, shorter, "auto").offset - 23.4567) < CLEAN
    assert abs(synchronise(shorter, longer, "auto").offset + 23.4567) < CLEAN


@pytest.mark.parametrize("seed", range(8))
def test_noise_and_gaps_leave_an_error_that_the_precision_tells(seed: int) -> None:
    """Five standard errors: their own are known to a sixth from 20 blocks; a chance of 1e-5 a case."""
    q, rng = smooth(seed, 6), np.random.default_rng(seed)
    wanted, done = times(0.0, 30.0, 0.005), times(3.4021, 25.0, 0.008)
    noisy = [q(t) + rng.normal(scale=0.01, size=(len(t), 6)) for t in (wanted, done)]
    noisy[0][1000:1200] = np.nan
    noisy[1][500:520, 2] = np.nan
    there = np.ones(len(done), dtype=bool)
    there[1500:1700] = False  # rows that the file does not have
    log = joints(noisy[1][there], done[there])
    sync = synchronise(joints(noisy[0], wanted), log, "auto")
    assert sync.precision is not None
    assert abs(sync.offset - 3.4021) < 5.0 * sync.precision
    assert sync.precision < 0.1 * 0.008  # 0.01 rad of noise in 6 rad/s x 3000 samples: some 0.05 ms
    assert sync_warnings("log", sync, 0.008) == []


def test_a_tool_that_is_not_known_does_not_move_the_offset() -> None:
    """A point 0.2 m off a turning flange goes another way: --align tool looks for both together."""
    t, flange = times(0.0, 30.0, 0.005), smooth(3, 3)
    tip = flange(t) + turning(t).apply([0.05, 0.0, 0.2])
    late = replace(path(flange(t[700:]), t[700:]), quat_xyzw=turning(t[700:]).as_quat())
    assert abs(synchronise(path(tip, t), late, "auto", "tool").offset - 3.5) < 1e-8  # exact but for rounding
    assert abs(synchronise(path(tip, t), late, "auto", "none").offset - 3.5) > CLEAN
    elsewhere = path(np.roll(tip, 1, axis=1) + np.array([3.0, 1.0, 2.0]), t)
    # The turn of the base is the best one without a tool: a small tool leaves little of it, squared.
    assert abs(synchronise(elsewhere, late, "auto", "base+tool").offset - 3.5) < 1e-5


@pytest.mark.parametrize("align", ["none", "start", "tool", "base+tool"])
def test_the_rate_is_the_derivative_of_the_residual_by_the_offset(align: AlignMode) -> None:
    """Of a motion at the true offset: what is left over is small, and so is what its turn and tool change."""
    t, motion = times(0.0, 20.0, 0.002), smooth(4, 3)
    at = t[700:9000]
    log = replace(path(motion(at), at), quat_xyzw=turning(at).as_quat())
    view = next(iter_channels(path(motion(t), t), log, align))
    assert (view.turned, view.tool_axes is not None) == (align in ("start", "base+tool"), "tool" in align)
    found = there(mean_rates(view))
    offset_ns, step_ns = 1_400_000_000, 1_000_000
    before, now, after = (linearise(view, found, offset_ns + k * step_ns) for k in (-1, 0, 1))
    slope = (after.residual - before.residual) / (2e-9 * step_ns)
    # Both are of lines between samples 2 ms apart: they miss a motion of 0.6 Hz by (2 pi 0.6 0.002)^2 / 8.
    np.testing.assert_allclose(now.rate, slope, rtol=0.0, atol=1e-3 * np.abs(slope).max())


def test_the_standard_error_is_that_of_least_squares() -> None:
    """White noise of s in the log: s / sqrt(sum of the squares of the rate), the constants taken out."""
    t = times(0.0, 20.0, 0.005)
    motion = smooth(5, 6)
    rate = (motion(t + 1e-4) - motion(t - 1e-4)) / 2e-4
    theory = 0.01 / np.sqrt(((rate - rate.mean(axis=0)) ** 2).sum())
    found = []
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(scale=0.01, size=(len(t), 6))
        sync = synchronise(joints(motion(t), t, "asked"), joints(motion(t) + noise, t), "auto")
        found.append(there(sync.precision))
    # Each is of 20 blocks, known to 1 / sqrt(2 * 19) = 16 %; the mean of 20 to 4 %, three times that.
    assert np.mean(found) == pytest.approx(theory, rel=0.12)


LOW = "log.csv: sync (--sync): auto: found too low a similarity of the "


@pytest.mark.slow
def test_random_motions_are_not_taken_for_each_other() -> None:
    t = times(0.0, 20.0, 0.01)
    for seed in range(10):
        make = (smooth, moves)[seed % 2]
        for side, channels in ((joints, 6), (path, 3)):
            one, other = (side(make(1000 + 2 * seed + k, channels)(t), t) for k in (0, 1))
            assert refused(one, other).startswith(("log.csv: sync (--sync): auto: found no ", LOW))
