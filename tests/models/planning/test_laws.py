"""Laws of time along a path: their derivatives, their limits, the paper's figures, and Ruckig."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from ruckig import InputParameter, Ruckig, Trajectory

from asserting import refusal
from random_paths import corner_rows, slow_law
from test_path import CONTOUR
from urmpipe_models.drives import trapezoid
from urmpipe_models.errors import OptionError
from urmpipe_models.planning import laws
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.laws import ARCS, Arcs, TimeLaw, jerk_law, trapezoid_law
from urmpipe_models.planning.path import LineArcPath, PathRows

KEPT = 1.0 + 1e-9  # so much of a limit may be used: rounding

speeds, rises, jerks = st.floats(0.05, 2.0), st.floats(0.2, 20.0), st.floats(1.0, 300.0)
places = st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5)
PATH = rows_to_path(PathRows(np.array(CONTOUR), 0.03))


def law_of(path: LineArcPath, v: float, a: float, j: float | None, arcs: Arcs) -> TimeLaw:
    return trapezoid_law(path, v, a, arcs) if j is None else jerk_law(path, v, a, j, arcs)


@pytest.mark.parametrize(("arcs", "printed"), [("tangential", 4.780324), ("total", 4.855270)])
def test_the_papers_contour_takes_its_time(arcs: Arcs, printed: float) -> None:
    """v = 0.5 m/s, a = 6 m/s2; T after errata of the paper, to its digits."""
    law = trapezoid_law(PATH, 0.5, 6.0, arcs)
    assert law.duration == pytest.approx(printed, abs=1e-6)
    on_arcs = law.at(law.time_at(PATH.bounds[1:-1:2] + 0.02)).v
    assert_allclose(on_arcs, 0.5 if arcs == "tangential" else 0.424264, atol=1e-6)


def test_a_trapezoid_from_stop_to_stop_is_that_of_a_set_point_and_of_ruckig_without_a_limit_of_jerk() -> None:
    t, law = np.linspace(0.0, 4.78, 1000), trapezoid_law(PATH, 0.5, 6.0)
    motion, setpoint = law.at(t), trapezoid(t, 0.0, 0.0, PATH.total, 0.5, 6.0)
    assert_allclose([motion.s, motion.v, motion.a], setpoint, atol=1e-14)  # rounding of 2 m
    from_ruckig = jerk_law(PATH, 0.5, 6.0, math.inf, "tangential").duration
    assert from_ruckig == pytest.approx(law.duration, abs=1e-9)
    # with a jerk the law approaches that from above, by a / j for each of its two ramps
    late = jerk_law(PATH, 0.5, 6.0, 6e6, "total").duration - trapezoid_law(PATH, 0.5, 6.0, "total").duration
    assert 0.0 < late < 20 * 6.0 / 6e6


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.01, 5.0), speeds, rises)
@example(entry=0.015625, leave=1.0, length=0.01171875, v=1.3314804301090923, a=6.887068678770632)
def test_ruckig_takes_the_same_time(entry: float, leave: float, length: float, v: float, a: float) -> None:
    """Without a limit of jerk, from any speed to any in reach: what the total acceleration asks for."""
    reach = 2.0 * a * length * (1.0 - 1e-9)  # where all fits to the last bit Ruckig takes another way
    start = min(entry * v, math.sqrt(reach))
    end = max(min(leave * v, math.sqrt(start**2 + reach)), math.sqrt(max(start**2 - reach, 0.0)))
    task, from_ruckig = InputParameter(1), Trajectory(1)
    task.current_velocity, task.target_velocity, task.target_position = [start], [end], [length]
    task.max_velocity, task.max_acceleration, task.max_jerk = [v], [a], [math.inf]
    Ruckig(1).calculate(task, from_ruckig)
    law = TimeLaw([*laws.segment_phases(laws.SpeedSegment(length, math.inf, v), 0.0, start, end, a)])
    assert law.duration == pytest.approx(from_ruckig.duration, abs=1e-9)
    reached = law.at(np.array([law.duration]))
    # rounding; of the speed also what it has of the place, e: sqrt(2 a e)
    assert reached.s[0] == pytest.approx(length, abs=1e-12)
    assert reached.v[0] == pytest.approx(end, abs=1e-7)


@slow_law(corner_rows(), speeds, rises, st.none() | jerks, st.sampled_from(ARCS), places)
def test_a_law_runs_the_path_from_rest_to_rest_within_its_limits_with_derivatives_that_belong_together(
    rows: PathRows, v: float, a: float, j: float | None, arcs: Arcs, shares: list[float]
) -> None:
    path = rows_to_path(rows)
    law = law_of(path, v, a, j, arcs)
    ends = law.at(np.array([0.0, law.duration]))
    # s to Ruckig's ends; v where s is short of its end by rounding e: sqrt(2 a e)
    assert_allclose(ends.s, [0.0, path.total], atol=1e-8)
    assert_allclose(ends.v, 0.0, atol=1e-6)
    at_stops = law.at(law.time_at(path.stops))
    assert_allclose(at_stops.v, 0.0, atol=1e-3)  # a stop is met to 1e-8 m: sqrt(2 a 1e-8)
    s = path.total * np.array(shares)
    assert_allclose(law.at(law.time_at(s)).s, s, atol=1e-8)
    # limits
    motion = law.at(np.union1d(np.linspace(0.0, law.duration, 2000), law.ends))
    assert motion.v.max() <= v * KEPT
    assert motion.v.min() >= -1e-7  # Ruckig's ends
    assert np.abs(motion.a).max() <= a * KEPT
    if j is not None:
        assert np.abs(motion.j).max() <= j * KEPT
    if arcs == "total":
        s = np.clip(motion.s, 0.0, path.total)
        radii = np.array([path.radius[path.segment_at(s + d)] for d in (-1e-9, 1e-9)])
        total = np.hypot(motion.a, motion.v**2 / radii).min(axis=0)  # at a bound that of either segment
        assert total.max() <= a * (1.0 + 1e-7)  # the place of a bound is known to 1e-9 m
    # central differences inside each phase; speed is continuous, with a jerk the acceleration, too
    begin = np.append(0.0, law.ends[:-1])
    is_long = law.ends - begin > 1e-4
    middle, h = (0.5 * (begin + law.ends))[is_long], 1e-6
    ahead, behind, here = law.at(middle + h), law.at(middle - h), law.at(middle)
    # rounding of 40 m over 1e-6 s, and a swing's change of j over 1e-4 s
    assert_allclose((ahead.s - behind.s) / (2.0 * h), here.v, atol=1e-7 * (1.0 + v))
    assert_allclose((ahead.v - behind.v) / (2.0 * h), here.a, atol=1e-7 * (1.0 + a))
    joints = begin[1:][np.diff(begin) > 1e-6]
    after, before = law.at(joints + 1e-12), law.at(joints - 1e-12)
    assert_allclose(after.v, before.v, atol=1e-5)  # sqrt(2 a 1e-11) where s' is 0
    if j is not None:
        assert_allclose(after.a, before.a, atol=1e-4)
    # a slower law is the same in slower time
    factor = 0.01 + 0.99 * shares[0]
    slow = law.scaled(factor)
    assert slow.duration == pytest.approx(law.duration / factor, rel=1e-12)
    t = np.linspace(0.0, law.duration, 50)[1:-1]
    fast_motion, slow_motion = law.at(t), slow.at(t / factor)
    inside = np.abs(t[:, None] - law.ends).min(axis=1) > 1e-9  # a corner's either side
    assert_allclose(slow_motion.s, fast_motion.s, atol=1e-9)
    assert_allclose(slow_motion.v, factor * fast_motion.v, atol=1e-7)
    assert_allclose(slow_motion.a[inside], factor**2 * fast_motion.a[inside], atol=1e-6)


@pytest.mark.slow
@given(st.floats(0.0, 1.0), st.floats(0.1, 20.0), st.floats(0.01, 2.0))
@example(entry=1e-12, a=6.0, radius=2.0)
def test_a_swing_keeps_the_total_acceleration(entry: float, a: float, radius: float) -> None:
    """And its derivatives belong together: j to the differences of a."""
    v = entry * math.sqrt(a * radius)
    w = float(laws.swing_phase(v, a, radius))
    rate = math.sqrt(2.0 * a / radius)
    law = TimeLaw([laws.Phase(-2.0 * w / rate + 1e-6, 0.0, 0.0, a, 0.0, radius, w)])
    t = np.linspace(0.0, law.duration, 4001)
    motion = law.at(t)
    # w has a few roundings of up to 1.85, which cn passes on to v as a share of sqrt(a r)
    assert motion.v[0] == pytest.approx(v, rel=1e-12, abs=2e-15 * math.sqrt(a * radius))
    assert_allclose(np.hypot(motion.a, motion.v**2 / radius), a, rtol=1e-9)
    step, inner = t[1] - t[0], slice(2, -2)
    for value, slope in ((motion.s, motion.v), (motion.v, motion.a), (motion.a, motion.j)):
        allowed = (step * rate) ** 2 * np.abs(slope).max() + 1e-15 * (1.0 + np.abs(value).max()) / step
        assert_allclose(np.gradient(value, t)[inner], slope[inner], atol=2.0 * allowed)


def test_the_pieces_that_no_speed_can_be_constant_on() -> None:
    """A path of arcs alone, from rest to rest: the swing is the fastest law, the law of jerk a slower one."""
    rows = PathRows(np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [1, 1, 0.0]]), 0.5, corner=True)
    path = rows_to_path(rows)
    swung, smooth = trapezoid_law(path, 9.0, 2.0, "total"), jerk_law(path, 9.0, 2.0, 1e4, "total")
    assert trapezoid_law(path, 9.0, 2.0).duration < swung.duration < smooth.duration
    # w from -K to 0 takes half of a quarter, on with sqrt(a r) = 1 m/s, and so back
    swing = 1.8540746773013719 / math.sqrt(2.0 * 2.0 / 0.5)
    assert swung.duration == pytest.approx(2.0 * swing + 0.25 * math.pi, rel=1e-12)


def test_ruckig_missing_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ruckig", None)
    message = "law (--law): found jerk without ruckig, allowed: with ruckig: pip install urmpipe[planning]"
    assert refusal(OptionError, jerk_law, PATH, 0.5, 6.0, 60.0, "tangential") == message


def test_a_path_with_its_stops_is_run_in_stretches() -> None:
    """Each stretch as if there were no other."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    paths = (rows_to_path(PathRows(points[:n], [0, 0.2, 0, 0][:n], corner=True)) for n in (4, 3))
    both, stretch = (trapezoid_law(path, 0.5, 2.0) for path in paths)
    assert_allclose(both.phases[:3], stretch.phases, atol=1e-12)
    assert both.duration == pytest.approx(stretch.duration + 1.0 / 0.5 + 0.5 / 2.0, abs=1e-12)


@pytest.mark.parametrize(("first", "j"), [(1e-11, None), (1e-11, 60.0), (5e-10, None), (5e-10, 60.0)])
def test_a_stretch_may_be_as_short_as_two_rows_are_apart(first: float, j: float | None) -> None:
    """Alone, and before another one: its own time and that of the other one."""
    points = [[0.0, 0.0, 0.0], [first, 0.0, 0.0], [1.0, 1.0, 0.0]]
    paths = [rows_to_path(PathRows(rows)) for rows in (points, points[:2], points[1:])]
    for arcs in ARCS:
        both, short, other = (law_of(path, 0.5, 6.0, j, arcs).duration for path in paths)
        assert 0.0 < short < 1e-3  # 4 cbrt(s / 2 / j), 6e-4 s
        assert both == pytest.approx(short + other, abs=1e-9)
