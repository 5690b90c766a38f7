"""Joints along a path: their slopes against differences, the law of their limits against TOPP-RA."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IndexArray
from urmpipe_models.ik.solutions import pose_errors
from urmpipe_models.planning import joints as path_joints
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.joints import (
    JointLimits,
    JointPathDerivatives,
    PathJoints,
    joint_limited_law,
    joints_along,
    max_limit_utilisation,
    targets_at,
    time_optimal_law,
)
from urmpipe_models.planning.laws import TimeLaw, trapezoid_law
from urmpipe_models.planning.path import LineArcPath, PathRows
from urmpipe_models.robots.catalogue import load_robot

DOWN = np.diag([1.0, -1.0, -1.0])
SQUARE = np.array([[0.15, 0.15], [0.3, 0.15], [0.3, -0.15], [0.0, -0.15], [0.0, 0.15], [0.15, 0.15]])


def arm(name: str, velocity: float, acceleration: float) -> Chain:
    chain = load_robot(name)
    joints = (replace(one, velocity=velocity, acceleration=acceleration) for one in chain.joints)
    return replace(chain, joints=tuple(joints))


def square(x: float, z: float, turned: bool) -> LineArcPath:
    points = np.column_stack((SQUARE[:, 0] + x, SQUARE[:, 1], np.full(6, z)))
    return rows_to_path(PathRows(points, 0.03, corner=True, rotation=DOWN if turned else None))


CASES = {
    "poses": ("ur5e", square(0.3, 0.3, turned=True)),
    "positions": ("urm6", square(0.3, 0.6, turned=False)),
}
"""An arm with a closed form, and one with a joint too many at positions, that moves as little as it can."""


@cache
def joints_of(case: str) -> PathJoints:
    """Return the joints of a case: they follow the path once for all tests."""
    name, path = CASES[case]
    return joints_along(load_robot(name), path)


def limited(case: str, velocity: float, acceleration: float) -> PathJoints:
    """Return the joints of a case with limits, which change no value."""
    name, _ = CASES[case]
    return replace(joints_of(case), chain=arm(name, velocity, acceleration))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_slopes_are_those_of_the_joint_values(case: str) -> None:
    """By differences in each segment; half the step leaves a quarter of what they differ by.

    Least motion finds each place of the grid from the one before, and so leaves the null space of a redundant
    arm as it comes: an error of the grid, whatever the places.
    """
    joints, errors = joints_of(case), []
    path = joints.path
    for count in (100, 200):
        parts = (np.linspace(a, b, count) for a, b in zip(path.bounds[:-1], path.bounds[1:], strict=True))
        s = np.unique(np.concatenate([*parts]))
        found = joints.at(s)
        inner = np.flatnonzero(np.abs(s[:, None] - path.bounds).min(axis=1) > 1e-9)
        first, second = differences(found.q, s, inner), differences(found.dq, s, inner)
        bend = np.abs(second - found.ddq[inner]).max() * path.radius.min()
        errors.append([np.abs(first - found.dq[inner]).max(), bend])
    if case == "poses":
        assert (np.array(errors[1]) < 0.26 * np.array(errors[0])).all()
    assert (np.array(errors[1]) < (2e-3 if case == "poses" else 1.5e-2)).all()


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_joints_are_those_of_the_grid_go_on_between_its_places_and_are_on_the_path(case: str) -> None:
    joints = joints_of(case)
    np.testing.assert_allclose(joints.at(joints.s).q, joints.grid.q, atol=1e-9)  # what it is followed to
    h = 1e-9
    steps = np.abs(joints.at(joints.s[1:-1] + h).q - joints.at(joints.s[1:-1] - h).q)
    assert steps.max() < 2.0 * h * np.abs(joints.after.dq).max() * 1.1 + 1e-11
    s = np.linspace(0.0, joints.path.total, 300)
    off, _ = pose_errors(joints.chain, joints.at(s).q, targets_at(joints.path, s))
    assert np.linalg.norm(off, axis=1).max() < 1e-14


def differences(values: FloatArray, s: FloatArray, at: IndexArray) -> FloatArray:
    """Return the slopes of parabolas through three neighbours."""
    before, after = s[at] - s[at - 1], s[at + 1] - s[at]
    rise, fall = values[at + 1] - values[at], values[at] - values[at - 1]
    weighted = rise * (before / after)[:, None] + fall * (after / before)[:, None]
    return np.asarray(weighted / (before + after)[:, None])


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_slopes_move_the_tool_along_its_path(case: str) -> None:
    """A step along dq is the tangent, and ddq the curvature: to the third power of the step."""
    path = joints_of(case).path
    s = np.linspace(0.01, path.total - 0.01, 80)
    s = s[np.abs(s[:, None] - path.bounds).min(axis=1) > 2e-4]
    found = joints_of(case).at(s)
    h = 1e-4
    ahead = found.q + h * found.dq + 0.5 * h * h * found.ddq
    miss, turn = pose_errors(joints_of(case).chain, ahead, targets_at(path, s + h))
    allowed = 10.0 * h**3 / path.radius.min() ** 2  # the third derivative of an arc is 1 / r^2
    assert np.abs(miss).max() < allowed
    assert np.abs(turn).max() < allowed


class Sampled:
    """Our joint values as a path of TOPP-RA, on its own grid."""

    def __init__(self, joints: PathJoints, s: FloatArray) -> None:
        self.slopes, self.s = joints.at(s), s
        self.path_interval, self.dof = np.array([0.0, joints.path.total]), len(joints.chain.coordinates)
        self.waypoints = None

    def __call__(self, places: FloatArray, order: int = 0) -> FloatArray:
        values = (self.slopes.q, self.slopes.dq, self.slopes.ddq)[order]
        return np.asarray(values[np.searchsorted(self.s, np.clip(places, 0.0, self.s[-1]))])


def by_toppra(joints: PathJoints, s: FloatArray, scheme: DiscretizationType) -> float:
    """Return the duration that TOPP-RA finds on places of the path."""
    chain = joints.chain
    both = np.ones((len(chain.coordinates), 2)) * [-1.0, 1.0]
    limits = [
        JointVelocityConstraint(chain.moving[0].velocity * both),
        JointAccelerationConstraint(chain.moving[0].acceleration * both, discretization_scheme=scheme),
    ]
    instance = TOPPRA(limits, Sampled(joints, s), gridpoints=s, parametrizer="ParametrizeConstAccel")
    _, speeds, _ = instance.compute_parameterization(0.0, 0.0)
    return float((2.0 * np.diff(s) / (speeds[1:] + speeds[:-1])).sum())


BOTH, RATES, ACCELERATIONS = (2.0, 5.0), (0.4, 20.0), (5.0, 1.0)
"""Limits of rates in [rad/s] and accelerations in [rad/s2]: both count, rates count, accelerations count."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "way", "limits"),
    [  # every two of them together
        ("poses", "line", BOTH),
        ("poses", "contour", RATES),
        ("poses", "line", ACCELERATIONS),
        ("positions", "contour", BOTH),
        ("positions", "line", RATES),
        ("positions", "contour", ACCELERATIONS),
    ],
)
def test_the_law_of_limits_is_as_fast_as_toppra(case: str, way: str, limits: tuple[float, float]) -> None:
    """Within 1 %, and never faster by more than 0.1 %, on the same places and the same joint values.

    TOPP-RA knows one curvature at a place. Interpolating, it would hold the end of a line to that of the arc
    behind it, which costs 1 %: so a path with arcs is held against its collocation.
    """
    joints = limited(case, *limits)
    if way == "line":
        ends = np.array([[0.0, 0.1, 0.0], [0.1, -0.2, 0.0]])
        path = joints.path
        joints = joints_along(joints.chain, rows_to_path(PathRows(path.points(path.stops).position + ends)))
    law = joint_limited_law(joints)
    s = np.append([phase.s for phase in law.phases], joints.path.total)
    scheme = DiscretizationType.Interpolation if way == "line" else DiscretizationType.Collocation
    wanted = by_toppra(joints, s, scheme)
    assert 0.999 * wanted <= law.duration <= 1.01 * wanted


def on_grid(joints: PathJoints, law: TimeLaw) -> tuple[FloatArray, FloatArray]:
    """Return how much of their limits rates and accelerations use, just inside both ends of every phase."""
    ends = law.ends
    begin = np.append(0.0, ends[:-1])
    t = np.sort(np.concatenate((begin + 1e-9 * (ends - begin), ends - 1e-9 * (ends - begin))))
    found = law.at(t)
    rates, accelerations = joints.at(found.s).rates(found.v, found.a)
    chain = joints.chain
    velocity, acceleration = chain.moving[0].velocity, chain.moving[0].acceleration
    return np.abs(rates) / velocity, np.abs(accelerations) / acceleration


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_law_of_limits_runs_at_its_limits(case: str) -> None:
    """On its grid no limit is exceeded, and nearly everywhere one is used up."""
    joints = limited(case, 1.0, 5.0)
    rates, accelerations = on_grid(joints, joint_limited_law(joints))
    assert rates.max() < 1.0 + 1e-6  # so far inside an interval they are looked at
    assert accelerations.max() < 1.0 + 1e-6
    used = np.maximum(rates.max(axis=1), accelerations.max(axis=1))
    assert np.mean(used > 0.97) > 0.9


def test_speed_and_acceleration_of_the_tool_hold_too() -> None:
    law = joint_limited_law(limited("poses", 5.0, 50.0), 0.2, 1.0)
    found = law.at(np.linspace(0.0, law.duration, 5000))
    assert found.v.max() <= 0.2 * (1.0 + 1e-9)
    assert np.abs(found.a).max() <= 1.0 + 1e-9
    alone = CASES["poses"][1].total / 0.2 + 0.2 / 1.0
    assert law.duration == pytest.approx(alone, rel=1e-3)  # the joints hardly matter


def test_it_rests_at_stops_and_where_the_turn_changes_its_rate() -> None:
    points = np.array([[0.4, -0.2, 0.3], [0.5, 0.0, 0.3], [0.4, 0.2, 0.3], [0.3, 0.1, 0.3]])
    turned = np.array([DOWN, DOWN, DOWN @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]], DOWN])
    path = rows_to_path(PathRows(points, np.array([0, 0.05, 0, 0]), corner=True, rotation=turned))
    law = joint_limited_law(joints_along(arm("ur5e", 3.0, 10.0), path))
    assert path.orientation is not None
    assert path.orientation.uneven_rows.tolist() == [1, 2]
    np.testing.assert_allclose(law.at(law.time_at(path.at)).v, 0.0, atol=1e-6)


def test_a_path_out_of_reach_says_so() -> None:
    joints = joints_along(load_robot("ur5e"), square(0.8, 0.3, turned=True))
    assert not joints.reached
    found = joints.at(np.linspace(0.0, joints.path.total, 500))
    np.testing.assert_array_equal(np.isnan(found.q).any(axis=1), np.isnan(found.ddq).all(axis=1))
    assert 0.1 < np.isnan(found.q).any(axis=1).mean() < 0.9


def test_a_joint_without_room_gives_no_freedom() -> None:
    """Locked, the last joint of ur5e leaves five for a position, and stays where it is."""
    chain = load_robot("ur5e")
    *others, last = chain.joints
    locked = replace(chain, joints=(*others, replace(last, lower=0.3, upper=0.3)))
    path = square(0.3, 0.3, turned=False)
    found = joints_along(locked, path).at(np.linspace(0.0, path.total, 200))
    np.testing.assert_array_equal(found.q[:, -1], 0.3)
    np.testing.assert_array_equal(found.dq[:, -1], 0.0)
    np.testing.assert_array_equal(found.ddq[:, -1], 0.0)
    assert (np.abs(found.dq[:, :3]).max(axis=0) > 0.1).all()


@pytest.mark.parametrize("case", ["poses", pytest.param("positions", marks=pytest.mark.slow)])
def test_the_largest_usage_is_that_of_many_places(case: str) -> None:
    """Also where s'' steps, in the middle of an interval: by five times as many places as the grid has."""
    joints = limited(case, 1.0, 2.0)
    law = trapezoid_law(joints.path, 0.5, 6.0)
    found = law.at(np.linspace(0.0, law.duration, 20_000)[1:-1])
    rates, accelerations = joints.at(found.s).rates(found.v, found.a)
    wanted = max(np.abs(rates).max() / 1.0, np.sqrt(np.abs(accelerations).max() / 2.0))
    usage = max_limit_utilisation(joints, law)
    assert usage.share == pytest.approx(wanted, rel=1e-3)  # the square of a fortieth of an arc, and its half
    half = max_limit_utilisation(joints, law.scaled(0.5)).share
    assert usage.share == pytest.approx(half / 0.5, rel=1e-6)  # in proportion


@pytest.mark.slow
def test_a_joint_that_comes_to_its_limit_makes_the_others_step() -> None:
    """While the third joint of panda rests on a limit, of 0.02 rad, the others move otherwise.

    The law of limits rests there: by differences no joint accelerates more than it may.
    """
    chain = load_robot("panda")
    moving = [replace(one, acceleration=10.0) for one in chain.joints]
    moving[2] = replace(moving[2], lower=-0.02, upper=0.02)
    joints = joints_along(replace(chain, joints=tuple(moving)), square(0.3, 0.4, turned=False))
    law = joint_limited_law(joints)
    assert joints.reached
    assert len(joints.rate_steps) > 0
    assert np.abs(joints.at(np.linspace(0.0, joints.path.total, 3000)).q[:, 2]).max() <= 0.02
    at = joints.grid.q[joints.rate_steps, 2]
    np.testing.assert_allclose(np.abs(at), 0.02, atol=1e-11)
    np.testing.assert_allclose(law.at(law.time_at(joints.s[joints.rate_steps])).v, 0.0, atol=1e-6)
    assert not len(joints_along(chain, joints.path).rate_steps)
    q = joints.at(law.at(np.arange(0.0, law.duration, 0.001)).s).q
    assert np.abs(np.diff(q, n=2, axis=0)).max() / 0.001**2 < 1.01 * 10.0  # differences over phases that meet


def test_slopes_that_contradict_a_step_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside its axis the first joint of irb60 turns by pi; by steps far longer it goes straight on."""
    path = rows_to_path(PathRows(np.array([[0.6, 1e-7, 1.6], [-0.3, 1e-7, 1.6]])))
    monkeypatch.setattr(path_joints, "MAX_PASSES", 1)
    found = joints_along(load_robot("irb60"), path)
    assert np.abs(np.diff(found.grid.q, axis=0)).max() < path_joints.MAX_JOINT_STEP
    undivided = np.flatnonzero(found.parts == path_joints.MAX_DIVISION)
    assert len(undivided) > 0
    assert np.abs(path.points(found.s[undivided]).position[:, 0]).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_phases_that_meet_are_looked_at_from_both_sides(size: float) -> None:
    """Also of a path of 1 um: the largest usage is that of many times, to the square of their step."""
    rows = PathRows(np.array([[0.4, 0.1, 0.4]] * 4) + size * CORNERS, 0.03 * size, corner=True, rotation=DOWN)
    joints = joints_along(arm("ur5e", 1e3, size), rows_to_path(rows))
    law = trapezoid_law(joints.path, size, 6.0 * size, "total")
    begin = np.append(0.0, law.ends[:-1])
    shares = np.linspace(1e-6, 1.0 - 1e-6, 200)[:, None]
    found = law.at((begin + shares * (law.ends - begin)).ravel())
    _, accelerations = joints.at(found.s).rates(found.v, found.a)
    wanted = np.sqrt(np.abs(accelerations).max() / size)
    assert max_limit_utilisation(joints, law).share == pytest.approx(wanted, rel=1e-3)


CORNERS = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.2, 0.1], [0.0, 0.3, 0.1]])


def test_places_after_each_other_may_all_be_rests() -> None:
    """One joint along the path, up to 5 rad/s2 and 0.2 rad/s: a triangle, slower where that is too fast."""
    s = np.array([0.0, 0.002, 0.006, 0.4])
    slope = np.ones((3, 1))
    slopes = JointPathDerivatives(np.zeros((3, 1)), slope, np.zeros((3, 1)))
    limits = JointLimits(np.array([0.2]), np.array([5.0]))
    law = time_optimal_law(s, slopes, slopes, np.full(4, True), limits)
    for end, length in zip(law.ends[1::2], np.diff(s), strict=True):
        begin = end - 2.0 * np.sqrt(length / min(5.0, 0.04 / length))
        found = law.at(np.array([begin + 1e-9, 0.5 * (begin + end), end - 1e-9]))
        np.testing.assert_allclose(found.v[[0, 2]], 0.0, atol=1e-8)
        assert found.v[1] == pytest.approx(np.sqrt(min(5.0 * length, 0.04)), rel=1e-9)
