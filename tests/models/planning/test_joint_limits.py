"""Joints along a path: their slopes against differences, the law of their limits against TOPP-RA."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint

from asserting import there
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import pose_errors
from urmpipe_models.planning import joints as path_joints
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.joints import PathJoints, joint_limited_law, joints_along, max_limit_utilisation
from urmpipe_models.planning.laws import TimeLaw, trapezoid_law
from urmpipe_models.planning.path import LineArcPath, PathRows
from urmpipe_models.robots.catalogue import load_robot

DOWN = np.diag([1.0, -1.0, -1.0])
# Limits of rates in [rad/s] and accelerations in [rad/s2]: both count, rates count, accelerations count
BOTH, RATES, ACCELERATIONS = (2.0, 5.0), (0.4, 20.0), (5.0, 1.0)
SQUARE = np.array([[0.15, 0.15], [0.3, 0.15], [0.3, -0.15], [0.0, -0.15], [0.0, 0.15], [0.15, 0.15]])


def arm(name: str, velocity: float, acceleration: float) -> Chain:
    chain = load_robot(name)
    joints = (replace(joint, velocity=velocity, acceleration=acceleration) for joint in chain.joints)
    return replace(chain, joints=tuple(joints))


def square(x: float, z: float, rotation: FloatArray | None = None) -> LineArcPath:
    points = np.column_stack((SQUARE[:, 0] + x, SQUARE[:, 1], np.full(6, z)))
    return rows_to_path(PathRows(points, 0.03, corner=True, rotation=rotation))


# An arm with a closed form, and one with a joint too many at positions, that moves as little as it can
CASES = {"poses": ("ur5e", square(0.3, 0.3, DOWN)), "positions": ("urm6", square(0.3, 0.6))}


@cache
def joints_of(case: str) -> PathJoints:
    """Return the joints of a case: they follow the path once for all tests."""
    name, path = CASES[case]
    return joints_along(load_robot(name), path)


def limited(case: str, velocity: float, acceleration: float) -> PathJoints:
    """Return the joints of a case with limits, which change no value."""
    return replace(joints_of(case), chain=arm(CASES[case][0], velocity, acceleration))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_joints_follow_the_path_with_their_slopes(case: str) -> None:
    """By differences in each segment; half the step leaves a quarter of what they differ by.

    Least motion finds each place of the grid from the one before, and so leaves the null space of a redundant
    arm as it comes: an error of the grid, whatever the places.
    """
    joints, errors = joints_of(case), []
    path = joints.path
    for count in (100, 200):
        parts = (np.linspace(a, b, count) for a, b in zip(path.bounds[:-1], path.bounds[1:], strict=True))
        s = np.unique(np.concatenate([*parts]))
        slopes = joints.at(s)
        inner = np.abs(s[:, None] - path.bounds).min(axis=1) > 1e-9
        first, second = (np.gradient(values, s, axis=0) for values in (slopes.q, slopes.dq))
        bend = np.abs(second - slopes.ddq)[inner].max() * path.radius.min()
        errors.append([np.abs(first - slopes.dq)[inner].max(), bend])
    if case == "poses":
        assert (np.array(errors[1]) < 0.26 * np.array(errors[0])).all()
    assert (np.array(errors[1]) < (2e-3 if case == "poses" else 1.5e-2)).all()
    # the joints are those of the grid, continue between its places, and are on the path
    assert_allclose(joints.at(joints.s).q, joints.grid.q, atol=1e-9)  # what it is followed to
    h = 1e-9
    steps = np.abs(joints.at(joints.s[1:-1] + h).q - joints.at(joints.s[1:-1] - h).q)
    assert steps.max() < 2.0 * h * np.abs(joints.after.dq).max() * 1.1 + 1e-11
    s = np.linspace(0.0, path.total, 300)
    distance, _ = pose_errors(joints.chain, joints.at(s).q, path_joints.targets_at(path, s))
    assert np.linalg.norm(distance, axis=1).max() < 1e-14
    # a step along dq is the tangent, and ddq the curvature: to the third power of the step
    s = np.linspace(0.01, path.total - 0.01, 80)
    s = s[np.abs(s[:, None] - path.bounds).min(axis=1) > 2e-4]
    slopes, h = joints.at(s), 1e-4
    ahead = slopes.q + h * slopes.dq + 0.5 * h * h * slopes.ddq
    allowed = 10.0 * h**3 / path.radius.min() ** 2  # the third derivative of an arc is 1 / r^2
    assert np.abs(pose_errors(joints.chain, ahead, path_joints.targets_at(path, s + h))).max() < allowed


class Sampled:
    """Our joint values as a path of TOPP-RA, on its own grid."""

    def __init__(self, joints: PathJoints, s: FloatArray) -> None:
        slopes = joints.at(s)
        self.values, self.s = (slopes.q, slopes.dq, slopes.ddq), s
        self.path_interval, self.dof = np.array([0.0, joints.path.total]), len(joints.chain.coordinates)
        self.waypoints = None

    def __call__(self, places: FloatArray, order: int = 0) -> FloatArray:
        return np.asarray(self.values[order][np.searchsorted(self.s, np.clip(places, 0.0, self.s[-1]))])


def toppra_duration(joints: PathJoints, s: FloatArray, scheme: DiscretizationType) -> float:
    """Return the duration that TOPP-RA finds on places of the path."""
    both = np.ones((len(joints.chain.coordinates), 2)) * [-1.0, 1.0]
    limits = [
        JointVelocityConstraint(joints.chain.moving[0].velocity * both),
        JointAccelerationConstraint(joints.chain.moving[0].acceleration * both, discretization_scheme=scheme),
    ]
    instance = TOPPRA(limits, Sampled(joints, s), gridpoints=s, parametrizer="ParametrizeConstAccel")
    _, speeds, _ = instance.compute_parameterization(0.0, 0.0)
    return float((2.0 * np.diff(s) / (speeds[1:] + speeds[:-1])).sum())


def limit_shares(joints: PathJoints, law: TimeLaw, t: FloatArray) -> FloatArray:
    """Return the shares of the limits of velocity and acceleration in use, shape (2, n, joints)."""
    motion, limits = law.at(t.ravel()), joints.chain.moving[0]
    velocities, accelerations = joints.at(motion.s).rates(motion.v, motion.a)
    return np.abs([velocities / limits.velocity, accelerations / limits.acceleration])


@pytest.mark.slow
@pytest.mark.parametrize(("case", "limits"), [*product(CASES, (BOTH, RATES, ACCELERATIONS))])
def test_the_law_of_limits_is_as_fast_as_toppra(case: str, limits: tuple[float, float]) -> None:
    """Within 1 %, and never faster by more than 0.1 %, on the same places and the same joint values.

    TOPP-RA knows one curvature at a place. Interpolating, it would limit the end of a line by that of the arc
    after it, which costs 1 %: so a path with arcs is compared with its collocation.
    """
    joints, scheme = limited(case, *limits), DiscretizationType.Collocation
    if (case == "positions") == (limits == RATES):  # lines, so that each two of three options meet
        ends = np.array([[0.0, 0.1, 0.0], [0.1, -0.2, 0.0]])
        path, scheme = joints.path, DiscretizationType.Interpolation
        joints = joints_along(joints.chain, rows_to_path(PathRows(path.points(path.stops).position + ends)))
    law = joint_limited_law(joints)
    s = np.append([phase.s for phase in law.phases], joints.path.total)
    by_toppra = toppra_duration(joints, s, scheme)
    assert 0.999 * by_toppra <= law.duration <= 1.01 * by_toppra
    # just inside both ends of every phase no limit is exceeded, and nearly everywhere one is used up
    begin, shares = np.append(0.0, law.ends[:-1]), np.array([[1e-9], [1.0 - 1e-9]])
    used = limit_shares(joints, law, begin + shares * (law.ends - begin)).max(axis=(0, 2))
    assert used.max() < 1.0 + 1e-6  # at 1e-9 of an interval inside it
    assert np.mean(used > 0.97) > 0.9


def test_speed_and_acceleration_of_the_tool_are_limited_too() -> None:
    law = joint_limited_law(limited("poses", 5.0, 50.0), 0.2, 1.0)
    motion = law.at(np.linspace(0.0, law.duration, 5000))
    assert motion.v.max() <= 0.2 * (1.0 + 1e-9)
    assert np.abs(motion.a).max() <= 1.0 + 1e-9
    of_the_tool = CASES["poses"][1].total / 0.2 + 0.2 / 1.0
    assert law.duration == pytest.approx(of_the_tool, rel=1e-3)  # the joints matter by less than 1e-3


def test_it_rests_at_stops_and_where_the_turn_changes_its_rate() -> None:
    points = np.array([[0.4, -0.2, 0.3], [0.5, 0.0, 0.3], [0.4, 0.2, 0.3], [0.3, 0.1, 0.3]])
    turned = np.array([DOWN, DOWN, DOWN @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]], DOWN])
    path = rows_to_path(PathRows(points, np.array([0, 0.05, 0, 0]), corner=True, rotation=turned))
    law = joint_limited_law(joints_along(arm("ur5e", 3.0, 10.0), path))
    assert there(path.orientation).uneven_rows.tolist() == [1, 2]
    assert_allclose(law.at(law.time_at(path.at)).v, 0.0, atol=1e-6)


def test_a_path_out_of_reach_says_so() -> None:
    joints = joints_along(load_robot("ur5e"), square(0.8, 0.3, DOWN))
    assert not joints.reached
    motion = joints.at(np.linspace(0.0, joints.path.total, 500))
    is_missing = np.isnan(motion.q).any(axis=1)
    assert_array_equal(is_missing, np.isnan(motion.ddq).all(axis=1))
    assert 0.1 < is_missing.mean() < 0.9


def test_a_joint_without_room_gives_no_freedom() -> None:
    """Locked, the last joint of ur5e leaves five for a position, and stays where it is."""
    chain = load_robot("ur5e")
    *others, last = chain.joints
    locked = replace(chain, joints=(*others, replace(last, lower=0.3, upper=0.3)))
    path = square(0.3, 0.3)
    motion = joints_along(locked, path).at(np.linspace(0.0, path.total, 200))
    assert set(zip(motion.q[:, -1], motion.dq[:, -1], motion.ddq[:, -1], strict=True)) == {(0.3, 0.0, 0.0)}
    assert (np.abs(motion.dq[:, :3]).max(axis=0) > 0.1).all()


@pytest.mark.parametrize("case", ["poses", pytest.param("positions", marks=pytest.mark.slow)])
def test_the_largest_usage_is_that_of_many_places(case: str) -> None:
    """Also where s'' steps, in the middle of an interval: by five times as many places as the grid has."""
    joints = limited(case, 1.0, 2.0)
    law = trapezoid_law(joints.path, 0.5, 6.0)
    shares = limit_shares(joints, law, np.linspace(0.0, law.duration, 20_000)[1:-1]).max(axis=(1, 2))
    largest = max_limit_utilisation(joints, law).share
    # the square of a fortieth of an arc, and its half
    assert largest == pytest.approx(max(shares[0], np.sqrt(shares[1])), rel=1e-3)
    half = max_limit_utilisation(joints, law.scaled(0.5)).share
    assert largest == pytest.approx(half / 0.5, rel=1e-6)  # in proportion


@pytest.mark.slow
def test_a_joint_that_comes_to_its_limit_makes_the_others_step() -> None:
    """While the third joint of panda rests on a limit, of 0.02 rad, the others move otherwise.

    The law of limits rests there: by differences no joint accelerates more than it may.
    """
    chain = load_robot("panda")
    moving = [replace(joint, acceleration=10.0) for joint in chain.joints]
    moving[2] = replace(moving[2], lower=-0.02, upper=0.02)
    joints = joints_along(replace(chain, joints=tuple(moving)), square(0.3, 0.4))
    law = joint_limited_law(joints)
    assert joints.reached
    assert len(joints.rate_steps) > 0
    assert np.abs(joints.at(np.linspace(0.0, joints.path.total, 3000)).q[:, 2]).max() <= 0.02
    assert_allclose(np.abs(joints.grid.q[joints.rate_steps, 2]), 0.02, atol=1e-11)
    assert_allclose(law.at(law.time_at(joints.s[joints.rate_steps])).v, 0.0, atol=1e-6)
    assert not len(joints_along(chain, joints.path).rate_steps)
    q = joints.at(law.at(np.arange(0.0, law.duration, 0.001)).s).q
    assert np.abs(np.diff(q, n=2, axis=0)).max() / 0.001**2 < 1.01 * 10.0  # differences over phases that meet


def test_slopes_that_contradict_a_step_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Close to its axis the first joint of irb60 turns by pi; steps that are far longer miss that."""
    path = rows_to_path(PathRows(np.array([[0.6, 1e-7, 1.6], [-0.3, 1e-7, 1.6]])))
    monkeypatch.setattr(path_joints, "MAX_PASSES", 1)
    joints = joints_along(load_robot("irb60"), path)
    assert np.abs(np.diff(joints.grid.q, axis=0)).max() < path_joints.MAX_JOINT_STEP
    undivided = np.flatnonzero(joints.parts == path_joints.MAX_DIVISION)
    assert len(undivided) > 0
    assert np.abs(path.points(joints.s[undivided]).position[:, 0]).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_phases_that_meet_are_evaluated_on_both_sides(size: float) -> None:
    """Also of a path of 1 um: the largest usage is that of many times, to the square of their step."""
    corners = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.2, 0.1], [0.0, 0.3, 0.1]])
    rows = PathRows(np.array([0.4, 0.1, 0.4]) + size * corners, 0.03 * size, corner=True, rotation=DOWN)
    joints = joints_along(arm("ur5e", 1e3, size), rows_to_path(rows))
    law = trapezoid_law(joints.path, size, 6.0 * size, "total")
    begin, shares = np.append(0.0, law.ends[:-1]), np.linspace(1e-6, 1.0 - 1e-6, 200)[:, None]
    largest = np.sqrt(limit_shares(joints, law, begin + shares * (law.ends - begin))[1].max())
    assert max_limit_utilisation(joints, law).share == pytest.approx(largest, rel=1e-3)


def test_places_after_each_other_may_all_be_rests() -> None:
    """One joint along the path, up to 5 rad/s2 and 0.2 rad/s: a triangle, slower where that is too fast."""
    s = np.array([0.0, 0.002, 0.006, 0.4])
    slopes = path_joints.JointPathDerivatives(np.zeros((3, 1)), np.ones((3, 1)), np.zeros((3, 1)))
    limits = path_joints.JointLimits(np.array([0.2]), np.array([5.0]))
    law = path_joints.time_optimal_law(s, slopes, slopes, np.full(4, True), limits)
    for end, length in zip(law.ends[1::2], np.diff(s), strict=True):
        begin = end - 2.0 * np.sqrt(length / min(5.0, 0.04 / length))
        v = law.at(np.array([begin + 1e-9, 0.5 * (begin + end), end - 1e-9])).v
        assert_allclose(v[[0, 2]], 0.0, atol=1e-8)
        assert v[1] == pytest.approx(np.sqrt(min(5.0 * length, 0.04)), rel=1e-9)
