"""Plans: joints on their path, speeds within limits, and what keeps an arm from moving as planned."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from asserting import there
from made_plans import (
    CONTOUR,
    DOWN,
    SMALL,
    across_the_base,
    behind_the_arm,
    limited,
    over_its_axis,
    planned,
)
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError, PathError
from urmpipe_models.ik.solutions import Targets, pose_errors
from urmpipe_models.math3d import to_matrices, to_quaternions
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.path import PathRows, cube_rows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.planned_paths.given_path import given_path
from urmpipe_pipeline.planned_paths.planned_joints import PlannedJoints
from urmpipe_pipeline.planned_paths.planning import plan_path
from urmpipe_pipeline.planned_paths.request import Request, Timing, checked_timing, require_limits
from urmpipe_pipeline.planned_paths.result import PlannedPath

KEPT = 1.0 + 1e-9
"""So much of a limit may be used: rounding."""


def largest(rates: FloatArray) -> list[float]:
    return [float(value) for value in np.abs(rates).max(axis=0)]


def joints_of(plan: PlannedPath) -> PlannedJoints:
    return there(plan.joints)


@pytest.mark.slow
def test_limits_of_rates_change_no_joint_along_a_path() -> None:
    """So `followed` looks for them once; here the plan looks for them itself."""
    slow = limited("ur5e", velocity=0.6, acceleration=4.0)
    plan = plan_path(given_path(SMALL), Request(slow, None, checked_timing(Timing())))
    np.testing.assert_array_equal(joints_of(plan).q, joints_of(planned(slow, SMALL)).q)


def test_the_papers_contour_by_its_arm() -> None:
    plan = planned(load_robot("irb60"), CONTOUR)
    assert plan.verdict == "pass"
    assert plan.duration == pytest.approx(4.780324, abs=1e-6)
    assert (len(plan), plan.speed_factor, plan.speed) == (958, 1.0, 0.5)
    joints = joints_of(plan)
    np.testing.assert_array_equal(joints.q[:, 3], 0.0)
    miss = pose_errors(load_robot("irb60"), joints.q, Targets(plan.position))[0]
    assert np.linalg.norm(miss, axis=1).max() < 1e-9
    np.testing.assert_allclose(plan.stops, [[1.7, 0.3, 1.0]] * 2, atol=1e-15)
    np.testing.assert_allclose(plan.corners[1], [2.0, -0.3, 1.0], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("law", [{}, {"arcs": "total"}, {"law": "jerk", "jerk": 40.0}])
def test_rates_are_the_derivatives_of_the_joints(law: dict[str, Any]) -> None:
    """At a fine period, away from the times at which the law's acceleration steps."""
    plan = planned(load_robot("ur5e"), SMALL, tsp=0.0005, **law)
    joints, tsp = joints_of(plan), plan.tsp
    steady = np.abs(np.diff(plan.motion.a, n=2, prepend=0, append=0)) < 1e-2
    steady &= np.roll(steady, 1) & np.roll(steady, -1)
    segment = plan.path.segment_at(plan.motion.s)
    steady &= (segment == np.roll(segment, 2)) & (segment == np.roll(segment, -2))
    steady[[0, 1, -2, -1]] = False
    assert steady.mean() > 0.8
    for values, rates in ((joints.q, joints.qd), (joints.qd, joints.qdd)):
        found = np.gradient(values, tsp, axis=0)[steady]
        # errors of a difference over 1 ms: third derivatives of some 1000 rad/s3
        np.testing.assert_allclose(found, rates[steady], atol=2e-3 * max(1.0, np.abs(rates).max()))


def test_it_is_at_rest_at_its_ends_and_holds_the_last_point() -> None:
    plan = planned(load_robot("ur5e"), SMALL, tsp=0.01)
    assert plan.t[-1] - plan.tsp < plan.duration <= plan.t[-1]
    np.testing.assert_array_equal(plan.t_ns, np.arange(len(plan)) * 10_000_000)
    np.testing.assert_array_equal([plan.motion.v[[0, -1]], plan.motion.a[[-1, -1]]], 0.0)
    np.testing.assert_allclose(plan.position[-1], SMALL.position[-1], atol=1e-15)
    np.testing.assert_array_equal(joints_of(plan).qd[-1], 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("law", [{}, {"arcs": "total"}, {"law": "jerk", "jerk": 40.0}])
def test_a_joint_that_is_twice_too_fast_halves_the_speed(law: dict[str, Any]) -> None:
    free = planned(limited("ur5e", velocity=math.inf), SMALL, tsp=0.0005, **law)
    most = largest(joints_of(free).qd)
    velocity = [math.inf] * 6
    velocity[2] = 0.5 * most[2]
    plan = planned(limited("ur5e", velocity=velocity), SMALL, **law)
    assert plan.verdict == "pass"
    assert plan.speed_factor == pytest.approx(0.5, rel=1e-3)
    assert plan.duration == pytest.approx(free.duration / plan.speed_factor, rel=1e-12)
    assert plan.speed == pytest.approx(0.25, rel=1e-3)
    assert joints_of(plan).velocity_share.max() <= KEPT


@pytest.mark.slow
def test_a_joint_that_accelerates_four_times_too_much_halves_the_speed() -> None:
    free = planned(limited("ur5e", velocity=math.inf), SMALL, tsp=0.0001)
    most = largest(joints_of(free).qdd)
    plan = planned(
        limited("ur5e", velocity=math.inf, acceleration=[0.25 * one + 1e-9 for one in most]), SMALL
    )
    assert plan.speed_factor == pytest.approx(0.5, rel=1e-3)
    assert joints_of(plan).acceleration_share.max() <= KEPT


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limits", "law"),
    [
        ({"velocity": 0.6, "acceleration": 4.0}, {}),
        ({"velocity": math.inf, "acceleration": 12.0}, {"law": "jerk", "jerk": 40.0}),
        ({"velocity": 1.5, "acceleration": 8.0}, {"law": "limits"}),
    ],
)
def test_the_period_changes_no_speed(limits: dict[str, float], law: dict[str, Any]) -> None:
    """Limits are looked at along the path, whatever samples are taken of it."""
    arm = limited("ur5e", **limits)
    plan = planned(arm, SMALL, **law)
    for tsp in (0.0007, 0.5):
        other = planned(arm, SMALL, tsp=tsp, **law)
        # samples beside the grid: 1e-4 once more
        assert other.speed_factor == pytest.approx(plan.speed_factor, rel=2e-4), tsp
        assert other.duration == pytest.approx(plan.duration, rel=2e-4), tsp


@pytest.mark.slow
def test_arcs_shorter_than_a_period_count() -> None:
    """An arc of 0.5 mm is passed between two samples, and its acceleration is 20 times what is allowed."""
    rows = cube_rows("wall", 0.1, 0.0005, np.array([0.45, 0.0, 0.3]), rotation=DOWN)
    plan = planned(limited("ur5e", velocity=math.inf, acceleration=15.0), rows)
    fine = planned(limited("ur5e", velocity=math.inf, acceleration=15.0), rows, tsp=0.0005)
    assert plan.speed_factor < 0.2
    assert fine.speed_factor == pytest.approx(plan.speed_factor, rel=2e-4)
    assert joints_of(fine).acceleration_share.max() == pytest.approx(1.0, abs=0.01)  # 30 samples an arc


@pytest.mark.slow
@pytest.mark.parametrize("tsp", [0.005, 7.0])
def test_the_period_hides_no_obstacle(tsp: float) -> None:
    singular = np.array([[0.6, 0.0, 1.6], [0.3, 0.0, 1.6], [-0.3, 0.0, 1.6]])
    assert [
        one.kind for one in planned(load_robot("irb60"), PathRows(singular), tsp=tsp).infeasibilities
    ] == ["singular"]
    points = np.array([[0.3, 0.3, 0.3], [-0.3, -0.3, 0.3]])
    plan = planned(load_robot("ur5e"), PathRows(points, rotation=DOWN), tsp=tsp)
    assert [one.kind for one in plan.infeasibilities] == ["unreachable"]


@pytest.mark.slow
def test_less_than_a_hundredth_of_the_speed_is_no_plan() -> None:
    free = planned(limited("ur5e", velocity=math.inf), SMALL, tsp=0.0005)
    most = largest(joints_of(free).qd)
    velocity = [math.inf] * 6
    velocity[0] = most[0] / 250.0
    plan = planned(limited("ur5e", velocity=velocity), SMALL)
    (obstacle,) = plan.infeasibilities
    assert (plan.verdict, plan.speed_factor, plan.duration) == ("fail", 1.0, free.duration)
    assert (obstacle.kind, obstacle.joint) == ("too-slow", "shoulder_pan_joint")
    assert obstacle.message == "shoulder_pan_joint limits the speed to 0.4 %, allowed: 1 % or more"
    sample = int(np.abs(joints_of(free).qd[:, 0]).argmax())
    assert obstacle.t == pytest.approx(free.t[sample], abs=free.tsp)
    assert obstacle.row == free.row[sample]
    assert plan.path.row[obstacle.segment] + 1 == obstacle.row


@pytest.mark.slow
@pytest.mark.parametrize("y", [1e-3, 2e-3])
def test_past_the_axis_the_first_joint_takes_the_speed(y: float) -> None:
    """At a distance y from it the joint turns at v / y: with v = 0.5 m/s, and 6 rad/s allowed."""
    points = np.array([[0.8, y, 1.5], [-0.8, y, 1.5]])
    joints = [6.0, *[math.inf] * 3]
    plan = planned(limited("irb60", velocity=joints), PathRows(points))
    share = 6.0 * y / 0.5
    if share > 0.01:
        assert plan.verdict == "pass"
        assert plan.speed_factor == pytest.approx(share, rel=2e-3)
    else:
        assert [one.kind for one in plan.infeasibilities] == ["too-slow"]
        assert plan.infeasibilities[0].t == pytest.approx(0.5 * plan.duration, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("y", [1e-2, 1e-4])
def test_the_law_of_limits_turns_the_arm_near_its_axis(y: float) -> None:
    """However near it passes, half a turn of the first joint takes what its limits allow, and hardly more."""
    points = np.array([[0.8, y, 1.5], [-0.8, y, 1.5]])
    plan = planned(limited("irb60", velocity=6.0, acceleration=10.0), PathRows(points), law="limits")
    assert plan.verdict == "pass"
    assert joints_of(plan).velocity_share.max() <= KEPT
    assert joints_of(plan).acceleration_share.max() <= KEPT
    far = planned(
        limited("irb60", velocity=6.0, acceleration=10.0),
        PathRows(points + np.array([0.0, 0.05, 0.0])),
        law="limits",
    )
    assert far.duration < plan.duration < far.duration + 2.0 * math.sqrt(math.pi / 10.0)


@pytest.mark.slow
def test_a_determinant_that_passes_through_zero_is_no_plan() -> None:
    plan = over_its_axis()
    (obstacle,) = plan.infeasibilities
    assert (obstacle.kind, obstacle.segment, obstacle.row) == ("singular", 1, 2)
    assert obstacle.message == "the arm passes a singular pose"
    at = np.interp(obstacle.t, plan.t, plan.position[:, 0])
    assert at == pytest.approx(0.0, abs=2.0 * plan.path.total / 4000)  # found by the step of the grid


@pytest.mark.slow
def test_a_jump_is_no_plan() -> None:
    plan = behind_the_arm()
    jumps = [one for one in plan.infeasibilities if one.kind == "jump"]
    assert (plan.verdict, jumps[0].row, jumps[0].joint) == ("fail", 1, "theta1")


def test_samples_out_of_reach_between_rows_are_told() -> None:
    plan = across_the_base()
    (obstacle,) = plan.infeasibilities
    assert (obstacle.kind, obstacle.row, obstacle.joint) == ("unreachable", 1, "")
    away = "the wrist is 0.1332 m from axis 1, allowed: at least 0.1333 m"
    assert obstacle.message == f"{away}; this holds for 0.266 m of the path"
    s = plan.motion.s[~plan.reached]
    assert s[-1] - s[0] == pytest.approx(0.266, abs=2 * 0.5 * plan.tsp)  # a sample at each end


def test_rows_out_of_reach_are_all_told_by_their_distance() -> None:
    rows = cube_rows("wall", 0.3, 0.03, np.array([0.75, 0.0, 0.6]), rotation=DOWN)
    with pytest.raises(PathError) as raised:
        planned(load_robot("ur5e"), rows)
    reached = "m out of reach of ur5e, allowed: a point that the arm reaches"
    assert [str(one) for one in raised.value.findings] == [
        f"path, row 1: found (0.75, 0.15, 0.6) m, 0.023 {reached}",
        f"path, row 2: found (0.87, 0.15, 0.6) m, 0.101 {reached}",
        f"path, row 3: found (0.9, -0.12, 0.6) m, 0.119 {reached}",
        f"path, row 6: found (0.75, 0.15, 0.6) m, 0.023 {reached}",
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "rows"),
    [("ur5e", SMALL), ("urm6", cube_rows("wall", 0.3, 0.03, np.array([0.45, 0.0, 0.9])))],
    ids=["ur5e", "urm6"],
)
def test_the_law_of_limits_keeps_them(robot: str, rows: PathRows) -> None:
    plan = planned(limited(robot, velocity=1.5, acceleration=8.0), rows, law="limits")
    joints = joints_of(plan)
    assert plan.verdict == "pass"
    assert (plan.velocity, plan.acceleration, plan.speed, plan.speed_factor) == (None, None, None, 1.0)
    assert joints.velocity_share.max() <= KEPT
    assert joints.acceleration_share.max() <= KEPT
    slower = planned(limited(robot, velocity=1.5, acceleration=8.0), rows)
    assert plan.duration < slower.duration


def test_the_law_of_limits_without_reach_tells_where() -> None:
    points = np.array([[0.3, 0.3, 0.3], [-0.3, -0.3, 0.3]])
    plan = planned(limited("ur5e", acceleration=5.0), PathRows(points, rotation=DOWN), law="limits")
    assert [one.kind for one in plan.infeasibilities] == ["unreachable"]
    assert (plan.law, plan.velocity, plan.acceleration) == ("trapezoid", 0.5, 6.0)  # what its times are of


def test_the_tool_is_turned_as_the_rows_say() -> None:
    turned = np.array([DOWN, DOWN @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]], DOWN])
    points = np.array([[0.4, -0.2, 0.3], [0.5, 0.0, 0.3], [0.4, 0.2, 0.3]])
    plan = planned(load_robot("ur5e"), PathRows(points, np.array([0, 0.05, 0]), corner=True, rotation=turned))
    (warning,) = plan.warnings
    assert str(warning) == (
        "the tool's angular rate steps in row 2 while it moves, and so do the joints' rates"
    )
    wanted = Targets(plan.position, to_matrices(there(plan.quat_xyzw)))
    miss = np.hstack(pose_errors(load_robot("ur5e"), joints_of(plan).q, wanted))
    assert np.abs(miss).max() < 1e-9


@pytest.mark.slow
def test_the_law_of_limits_stops_where_the_turn_changes_and_does_not_warn() -> None:
    turned = np.array([DOWN, DOWN @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]], DOWN])
    points = np.array([[0.4, -0.2, 0.3], [0.5, 0.0, 0.3], [0.4, 0.2, 0.3]])
    rows = PathRows(points, np.array([0, 0.05, 0]), corner=True, rotation=turned)
    plan = planned(limited("ur5e", acceleration=10.0), rows, law="limits")
    assert plan.warnings == ()
    assert plan.motion.v[np.abs(plan.t - plan.row_times[1]).argmin()] < 10.0 * plan.tsp


@pytest.mark.slow
@pytest.mark.parametrize("digits", [6, 15])
def test_an_even_turn_that_was_rounded_is_no_step(digits: int) -> None:
    points = np.array([[0.4, -0.2, 0.3], [0.5, -0.1, 0.3], [0.5, 0.0, 0.3], [0.4, 0.2, 0.3]])
    radius = np.array([0.0, 0.02, 0.02, 0.0])
    at = rows_to_path(PathRows(points, radius, corner=True)).at
    turned = (
        to_matrices(to_quaternions(np.round(2.0 * at, digits)[:, None] * [0.0, 0.0, 1.0], "vector")) @ DOWN
    )
    rows = PathRows(points, radius, corner=True, rotation=turned)
    plan = planned(limited("ur5e", acceleration=8.0), rows, law="limits")
    assert planned(limited("ur5e", acceleration=8.0), rows).warnings == plan.warnings == ()
    assert plan.motion.v[10:-10].min() > 0.05


def test_half_a_turn_is_as_short_either_way() -> None:
    back = DOWN @ np.diag([-1.0, -1.0, 1.0])
    points = np.array([[0.4, -0.2, 0.3], [0.4, 0.0, 0.3], [0.4, 0.2, 0.3]])
    plan = planned(load_robot("ur5e"), PathRows(points, rotation=np.array([DOWN, DOWN, back])))
    assert [(one.kind, str(one)) for one in plan.warnings] == [
        ("half-turn", "the tool turns by 180 deg from row 2 to the next: either way is as short")
    ]


@pytest.mark.slow
def test_a_joint_that_comes_to_a_limit_is_warned_of() -> None:
    """The third joint of panda may hardly turn, so that it rests on its limits for most of the way."""
    chain = load_robot("panda")
    lower, upper = ([getattr(one, key) for one in chain.moving] for key in ("lower", "upper"))
    lower[2], upper[2] = -0.02, 0.02
    rows = cube_rows("wall", 0.2, 0.02, np.array([0.45, 0.0, 0.4]))
    plan = planned(limited("panda", lower=lower, upper=upper), rows, tsp=0.001)
    (warning,) = plan.warnings
    words, times = str(warning).split(" at t = ")
    assert (warning.kind, words) == ("limit-contact", "a joint comes to a limit, or leaves it,")
    found = [float(part) for part in times.split(" s: there the joints' rates step")[0].split(" s, ")]
    rests = np.abs(joints_of(plan).q[:, 2]) >= 0.02 - 1e-11
    changes = plan.t[np.flatnonzero(np.diff(rests[2:])) + 3]  # at its start the arm is at rest
    assert len(changes) > 0
    np.testing.assert_allclose(found, changes, atol=2.0 * plan.tsp)  # found by the step of the grid
    arm = limited("panda", lower=lower, upper=upper, acceleration=15.0)
    assert planned(arm, rows, law="limits").warnings == ()


def test_a_table_has_columns_of_its_own_for_joints_of_any_name() -> None:
    """A gantry whose joints are called as places are: x, y, z, and one as the time."""
    steps = (("x", (1.0, 0.0, 0.0)), ("t", (0.0, 1.0, 0.0)), ("z", (0.0, 0.0, 1.0)))
    gantry = Chain("gantry", tuple(Joint(name, "prismatic", axis=axis) for name, axis in steps))
    plan = planned(gantry, PathRows(np.array([[0.0, 0.0, 0.0], [0.3, 0.2, 0.1]])))
    frame = plan.to_frame()
    np.testing.assert_array_equal(frame[["t", "x", "y", "z"]], np.column_stack((plan.t, plan.position)))
    np.testing.assert_array_equal(frame[["q_x", "q_t", "q_z"]], joints_of(plan).q)
    np.testing.assert_array_equal(frame[["d_q_x", "d_q_t", "d_q_z"]], joints_of(plan).qd)


@pytest.mark.slow
def test_what_is_needed_to_repeat_it_is_kept() -> None:
    start = np.array([0.0, -1.5, 1.5, -1.5, -1.5, 0.0])
    request = Request(load_robot("ur5e"), start, checked_timing(Timing(arcs="total")))
    options = plan_path(given_path(SMALL), request).provenance.options
    assert options == {
        "law": "trapezoid", "arcs": "total", "tsp": 0.005, "robot": "ur5e", "start": start.tolist()
    }  # fmt: skip


def test_without_a_robot_it_is_path_and_time() -> None:
    plan = planned(None, CONTOUR)
    assert (plan.verdict, plan.joints, plan.infeasibilities) == (None, None, ())
    assert plan.duration == pytest.approx(4.780324, abs=1e-6)
    assert plan.as_run().log.joints == ()
    np.testing.assert_array_equal(plan.as_run().log.tcp_position, plan.position)


def test_segments_have_their_times() -> None:
    """Without acceleration on the way a segment takes its length over the speed."""
    segments = planned(None, CONTOUR).to_dict()["segments"]
    assert [(one["kind"], one["row"]) for one in segments] == [
        ("line", 1), ("arc", 2), ("line", 2), ("arc", 3), ("line", 3), ("arc", 4), ("line", 4), ("arc", 5),
        ("line", 5),
    ]  # fmt: skip
    assert segments[0]["t"] == 0.0
    for one in segments[1:-1]:
        assert one["duration"] == pytest.approx(one["length"] / 0.5, abs=1e-9)
    assert sum(one["duration"] for one in segments) == pytest.approx(4.780324, abs=1e-6)


@pytest.mark.slow
def test_what_is_told_of_limits() -> None:
    plan = planned(limited("ur5e", velocity=3.0, acceleration=[50.0, *[math.inf] * 5]), SMALL)
    told = plan.to_dict()["limits"]
    joints = joints_of(plan)
    assert [one["joint"] for one in told] == list(load_robot("ur5e").coordinates)
    assert told[0]["acceleration_share"] == joints.acceleration_share[:, 0].max()
    assert told[1]["acceleration_share"] is None
    for k, one in enumerate(told):
        assert one["velocity_share"] == joints.velocity_share[:, k].max()
    assert told[1]["t"] == plan.t[joints.velocity_share[:, 1].argmax()]


def refused(arm: Chain | None = None, **timing: Any) -> list[str]:
    with pytest.raises(OptionError) as raised:
        require_limits(checked_timing(Timing(**timing)), arm)
    return [str(one) for one in raised.value.findings]


def test_values_that_make_no_sense_are_refused_together() -> None:
    assert refused(law="fast", arcs="both", velocity=0.0, acceleration=math.inf, jerk=-1, tsp=math.nan) == [
        "law (--law): found 'fast', allowed: trapezoid, jerk, limits",
        "arcs (--arcs): found 'both', allowed: tangential, total",
        "velocity (--velocity): found 0.0, allowed: a finite number of m/s above 0",
        "acceleration (--acceleration): found inf, allowed: a finite number of m/s2 above 0",
        "jerk (--jerk): found -1, allowed: a finite number of m/s3 above 0",
        "tsp (--tsp): found nan, allowed: a finite number of s above 0",
        "jerk (--jerk): found a jerk with the law fast, allowed: with the law jerk",
    ]
    assert refused(law="jerk") == [
        "jerk (--jerk): found no jerk with the law jerk, allowed: a number of m/s3"
    ]
    assert refused(law="limits", arcs="total") == [
        "arcs (--arcs): found total with the law limits, allowed: with the laws trapezoid and jerk"
    ]


def test_the_law_of_limits_names_the_key_that_it_lacks() -> None:
    assert refused(law="limits") == ["law (--law): found limits without a robot, allowed: with a robot"]
    assert refused(limited("ur5e", acceleration=[5.0] * 4 + [math.inf] * 2), law="limits") == [
        "robot (--robot): found ur5e without the largest acceleration of wrist_2_joint, wrist_3_joint,"
        " allowed: a robot file with the key acceleration in limits, in rad/s2 or m/s2"
    ]


def test_times_are_in_ns() -> None:
    assert refused(tsp=4e-10) == ["tsp (--tsp): found 4e-10, allowed: 1e-09 s or more: times are in ns"]


def test_a_period_longer_than_a_plan_has_both_ends() -> None:
    plan = planned(None, PathRows(np.array([[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0]])), tsp=1000.0)
    np.testing.assert_array_equal(plan.motion.s, [0.0, plan.path.total])


def test_too_many_samples_are_refused() -> None:
    with pytest.raises(OptionError) as raised:
        planned(None, CONTOUR, tsp=1e-7)
    assert str(raised.value) == (
        "tsp (--tsp): found 1e-07 s, allowed: a period that makes up to 1000000 samples of 4.78032 s"
    )
