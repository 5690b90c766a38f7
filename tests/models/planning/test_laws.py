"""Laws of time along a path: their derivatives, their limits, the paper's figures, and Ruckig."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ruckig import InputParameter, Ruckig, Trajectory

from asserting import refusal
from random_paths import corner_rows
from test_path import CONTOUR
from urmpipe_models.drives import trapezoid
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.laws import (
    ARCS,
    Arcs,
    Phase,
    SpeedSegment,
    TimeLaw,
    jerk_law,
    segment_phases,
    swing_phase,
    trapezoid_law,
)
from urmpipe_models.planning.path import LineArcPath, PathRows

KEPT = 1.0 + 1e-9
"""So much of a limit may be used: rounding."""

speeds, rises, jerks = st.floats(0.05, 2.0), st.floats(0.2, 20.0), st.floats(1.0, 300.0)
arcs = st.sampled_from(ARCS)
some = settings(max_examples=40)
places = st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5)


def contour() -> LineArcPath:
    return rows_to_path(PathRows(np.array(CONTOUR), 0.03))


def made(path: LineArcPath, v: float, a: float, j: float | None, held: Arcs) -> TimeLaw:
    return trapezoid_law(path, v, a, held) if j is None else jerk_law(path, v, a, j, held)


@pytest.mark.parametrize(("held", "printed"), [("tangential", 4.780324), ("total", 4.855270)])
def test_the_papers_contour_takes_its_time(held: Arcs, printed: float) -> None:
    """v = 0.5 m/s, a = 6 m/s2; T after errata of the paper, to its digits."""
    law = trapezoid_law(contour(), 0.5, 6.0, held)
    assert law.duration == pytest.approx(printed, abs=1e-6)
    on_arcs = law.at(law.time_at(contour().bounds[1:-1:2] + 0.02)).v
    np.testing.assert_allclose(on_arcs, 0.5 if held == "tangential" else 0.424264, atol=1e-6)


def test_a_trapezoid_from_stop_to_stop_is_that_of_a_set_point() -> None:
    path = contour()
    t = np.linspace(0.0, 4.78, 1000)
    found, wanted = trapezoid_law(path, 0.5, 6.0).at(t), trapezoid(t, 0.0, 0.0, path.total, 0.5, 6.0)
    np.testing.assert_allclose(found.s, wanted.position, atol=1e-14)  # rounding of 2 m
    np.testing.assert_allclose(found.v, wanted.velocity, atol=1e-14)
    np.testing.assert_allclose(found.a, wanted.acceleration, atol=1e-14)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.01, 5.0), speeds, rises)
@example(entry=0.015625, leave=1.0, length=0.01171875, v=1.3314804301090923, a=6.887068678770632)
def test_ruckig_without_a_limit_of_jerk_takes_the_same_time(
    entry: float, leave: float, length: float, v: float, a: float
) -> None:
    """Line by line, from any speed to any that can be reached: what the total acceleration asks for."""
    reach = 2.0 * a * length * (1.0 - 1e-9)  # where all fits to the last bit Ruckig takes another way
    start = min(entry * v, math.sqrt(reach))
    end = max(min(leave * v, math.sqrt(start**2 + reach)), math.sqrt(max(start**2 - reach, 0.0)))
    given_, found = InputParameter(1), Trajectory(1)
    given_.current_velocity, given_.target_velocity, given_.target_position = [start], [end], [length]
    given_.max_velocity, given_.max_acceleration, given_.max_jerk = [v], [a], [math.inf]
    Ruckig(1).calculate(given_, found)
    phases = TimeLaw([*segment_phases(SpeedSegment(length, math.inf, v), 0.0, start, end, a)])
    assert phases.duration == pytest.approx(found.duration, abs=1e-9)
    reached = phases.at(np.array([phases.duration]))
    # rounding; of the speed also what it has of the place, e: sqrt(2 a e)
    assert reached.s[0] == pytest.approx(length, abs=1e-12)
    assert reached.v[0] == pytest.approx(end, abs=1e-7)


def test_the_contour_by_ruckig_without_a_limit_of_jerk() -> None:
    path = contour()
    assert jerk_law(path, 0.5, 6.0, math.inf, "tangential").duration == pytest.approx(
        trapezoid_law(path, 0.5, 6.0).duration, abs=1e-9
    )
    # with a jerk the law approaches that from above, by a / j for each of its two ramps
    late = jerk_law(path, 0.5, 6.0, 6e6, "total").duration - trapezoid_law(path, 0.5, 6.0, "total").duration
    assert 0.0 < late < 20 * 6.0 / 6e6


@pytest.mark.slow
@some
@given(corner_rows(), speeds, rises, st.none() | jerks, arcs, places)
def test_a_law_runs_the_whole_path_from_rest_to_rest_and_times_of_places_lead_back(
    rows: PathRows, v: float, a: float, j: float | None, held: Arcs, shares: list[float]
) -> None:
    path = rows_to_path(rows)
    law = made(path, v, a, j, held)
    ends = law.at(np.array([0.0, law.duration]))
    # s to Ruckig's ends; v where s is short of its end by rounding e: sqrt(2 a e)
    np.testing.assert_allclose(ends.s, [0.0, path.total], atol=1e-8)
    np.testing.assert_allclose(ends.v, 0.0, atol=1e-6)
    at_stops = law.at(law.time_at(path.stops))
    np.testing.assert_allclose(at_stops.v, 0.0, atol=1e-3)  # a stop is met to 1e-8 m: sqrt(2 a 1e-8)
    s = path.total * np.array(shares)
    np.testing.assert_allclose(law.at(law.time_at(s)).s, s, atol=1e-8)


@pytest.mark.slow
@some
@given(corner_rows(), speeds, rises, st.none() | jerks, arcs)
def test_a_law_keeps_its_limits(rows: PathRows, v: float, a: float, j: float | None, held: Arcs) -> None:
    path = rows_to_path(rows)
    law = made(path, v, a, j, held)
    t = np.union1d(np.linspace(0.0, law.duration, 2000), law.ends)
    found = law.at(t)
    assert found.v.max() <= v * KEPT
    assert found.v.min() >= -1e-7  # Ruckig's ends
    assert np.abs(found.a).max() <= a * KEPT
    if j is not None:
        assert np.abs(found.j).max() <= j * KEPT
    if held == "total":
        s = np.clip(found.s, 0.0, path.total)
        total = np.minimum(  # at a bound that of the segment that allows it
            *(np.hypot(found.a, found.v**2 / path.radius[path.segment_at(s + d)]) for d in (-1e-9, 1e-9))
        )
        assert total.max() <= a * (1.0 + 1e-7)  # the place of a bound is known to 1e-9 m


@pytest.mark.slow
@some
@given(corner_rows(), speeds, rises, st.none() | jerks, arcs)
def test_derivatives_belong_together(rows: PathRows, v: float, a: float, j: float | None, held: Arcs) -> None:
    """By central differences inside each phase; speed is continuous, with a jerk the acceleration, too."""
    law = made(rows_to_path(rows), v, a, j, held)
    begin = np.append(0.0, law.ends[:-1])
    long = np.diff(np.append(begin, law.duration)) > 1e-4
    middle, h = (0.5 * (begin + law.ends))[long], 1e-6
    ahead, behind, here = law.at(middle + h), law.at(middle - h), law.at(middle)
    for value, slope, size in (("s", "v", v), ("v", "a", a)):
        found = (getattr(ahead, value) - getattr(behind, value)) / (2.0 * h)
        # rounding of 40 m over 1e-6 s, and a swing's change of j over 1e-4 s
        np.testing.assert_allclose(found, getattr(here, slope), atol=1e-7 * (1.0 + size))
    met = begin[1:][np.diff(begin) > 1e-6]
    after, before = law.at(met + 1e-12), law.at(met - 1e-12)
    np.testing.assert_allclose(after.v, before.v, atol=1e-5)  # sqrt(2 a 1e-11) where s' is 0
    if j is not None:
        np.testing.assert_allclose(after.a, before.a, atol=1e-4)


@pytest.mark.slow
@given(st.floats(0.0, 1.0), st.floats(0.1, 20.0), st.floats(0.01, 2.0))
@example(entry=1e-12, a=6.0, radius=2.0)
def test_a_swing_keeps_the_total_acceleration(entry: float, a: float, radius: float) -> None:
    """And its derivatives belong together: j to the differences of a."""
    v = entry * math.sqrt(a * radius)
    w = float(swing_phase(v, a, radius))
    rate = math.sqrt(2.0 * a / radius)
    law = TimeLaw([Phase(-2.0 * w / rate + 1e-6, 0.0, 0.0, a, 0.0, radius, w)])
    t = np.linspace(0.0, law.duration, 4001)
    found = law.at(t)
    # w has a few roundings of up to 1.85, which cn passes on to v as a share of sqrt(a r)
    assert found.v[0] == pytest.approx(v, rel=1e-12, abs=2e-15 * math.sqrt(a * radius))
    np.testing.assert_allclose(np.hypot(found.a, found.v**2 / radius), a, rtol=1e-9)
    step, inner = t[1] - t[0], slice(2, -2)
    for value, slope in ((found.s, found.v), (found.v, found.a), (found.a, found.j)):
        allowed = (step * rate) ** 2 * np.abs(slope).max() + 1e-15 * (1.0 + np.abs(value).max()) / step
        np.testing.assert_allclose(np.gradient(value, t)[inner], slope[inner], atol=2.0 * allowed)


@pytest.mark.slow
@some
@given(corner_rows(), speeds, rises, st.none() | jerks, arcs, st.floats(0.01, 1.0))
def test_a_slower_law_is_the_same_in_slower_time(
    rows: PathRows, v: float, a: float, j: float | None, held: Arcs, factor: float
) -> None:
    law = made(rows_to_path(rows), v, a, j, held)
    slow = law.scaled(factor)
    assert slow.duration == pytest.approx(law.duration / factor, rel=1e-12)
    t = np.linspace(0.0, law.duration, 50)[1:-1]
    one, other = law.at(t), slow.at(t / factor)
    away = np.abs(t[:, None] - law.ends).min(axis=1) > 1e-9  # a corner's either side
    np.testing.assert_allclose(other.s, one.s, atol=1e-9)
    np.testing.assert_allclose(other.v, factor * one.v, atol=1e-7)
    np.testing.assert_allclose(other.a[away], factor**2 * one.a[away], atol=1e-6)


def test_the_pieces_that_no_speed_can_be_constant_on() -> None:
    """A path of arcs alone, from rest to rest: the swing is the fastest law, the law of jerk a slower one."""
    rows = PathRows(np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [1, 1, 0.0]]), 0.5, corner=True)
    path = rows_to_path(rows)
    swung, smooth = trapezoid_law(path, 9.0, 2.0, "total"), jerk_law(path, 9.0, 2.0, 1e4, "total")
    assert trapezoid_law(path, 9.0, 2.0).duration < swung.duration < smooth.duration
    # w from -K to 0 takes half of a quarter, on with sqrt(a r) = 1 m/s, and so back
    swing = 1.8540746773013719 / math.sqrt(2.0 * 2.0 / 0.5)
    assert swung.duration == pytest.approx(2.0 * swing + 0.25 * math.pi, rel=1e-12)


def test_ruckig_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ruckig", None)
    message = "law: found jerk without ruckig, allowed: with ruckig: pip install urmpipe[planning]"
    assert refusal(OptionError, jerk_law, contour(), 0.5, 6.0, 60.0, "tangential") == message


def values(law: TimeLaw) -> FloatArray:
    return np.array([list(phase) for phase in law.phases])


def test_a_path_with_its_stops_is_run_in_stretches() -> None:
    """Each stretch as if it were alone."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    rows = PathRows(points, np.array([0, 0.2, 0, 0]), corner=True)
    whole = trapezoid_law(rows_to_path(rows), 0.5, 2.0)
    first = replace(rows, position=points[:3], radius=rows.radius[:3], variant=rows.variant[:3])
    alone = trapezoid_law(rows_to_path(first), 0.5, 2.0)
    np.testing.assert_allclose(values(whole)[:3], values(alone), atol=1e-12)
    assert whole.duration == pytest.approx(alone.duration + 1.0 / 0.5 + 0.5 / 2.0, abs=1e-12)


@pytest.mark.parametrize("first", [1e-11, 5e-10])
@pytest.mark.parametrize("j", [None, 60.0])
@pytest.mark.parametrize("held", ARCS)
def test_a_stretch_may_be_as_short_as_two_rows_are_apart(first: float, j: float | None, held: Arcs) -> None:
    """Alone, and before another one: its own time and that of the other one."""
    points = [[0.0, 0.0, 0.0], [first, 0.0, 0.0], [1.0, 1.0, 0.0]]
    whole, short, other = (
        made(rows_to_path(PathRows(rows)), 0.5, 6.0, j, held) for rows in (points, points[:2], points[1:])
    )
    assert 0.0 < short.duration < 1e-3  # 4 cbrt(s / 2 / j), 6e-4 s
    assert whole.duration == pytest.approx(short.duration + other.duration, abs=1e-9)
