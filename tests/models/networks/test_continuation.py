"""Networks in motion: closed forms over the whole range, branches, singular poses, limits, logs, rates."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from known_mechanisms import four_bar_angles, four_bar_tables, tables_of
from random_networks import FIRST, SECOND, assert_close, joint_matrix
from test_higher_pairs import shaft
from test_shipped import Answer, Tables, bennett, bricard, rccc, rssr, slider_crank
from urmpipe import load_network, network_drive
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.file import network_names
from urmpipe_pipeline.networks.network_motion import NetworkMotion

PI, TURN = math.pi, 2 * math.pi
CRANK_ROCKER = (0.4, 0.9, 0.7, 1.0)  # m: the shipped four-bar

ANSWER = 1e-9  # m and rad: gaps of 1e-13, which mechanisms far from singular magnify by about 10


def apart(found: FloatArray, expected: FloatArray) -> FloatArray:
    """Return differences of angles within half a turn in [rad]."""
    return np.asarray(np.remainder(found - expected + PI, TURN) - PI)


def column(moved: NetworkMotion, name: str) -> FloatArray:
    """Return a joint in [rad] or [m] over time, shape (n,)."""
    return np.asarray(moved.joint_motion[0][:, moved.joints.index(name)])


def planar(links: Sequence[float], crank: float = 0.9, sign: int = 1, **more: dict[str, Any]) -> Tables:
    """Return a four-bar of links [m] at an assembly; `more` are keys by joint."""
    tables = four_bar_tables(links, four_bar_angles(links, crank, sign))
    for name, keys in more.items():
        tables["joints"][name] |= keys
    return tables


# ---------------------------------------------------------------------------------------- closed forms


def four_bar(t: float) -> Answer:
    return {name: (angle,) for name, angle in four_bar_angles(CRANK_ROCKER, t).items() if name != "crank"}


def rccc_answer(t: float) -> Answer:
    elements = tables_of("rccc")["dh"]["elements"].values()
    a, alpha = np.array([(one["a"], one["alpha"]) for one in elements]).T
    return rccc(a, alpha, 0.05, t)[1]


def bricard_answer(t: float) -> Answer:
    """Return the smooth branch: it is the other one beyond t = pi, where both branches cross."""
    return bricard(PI / 3, t, margin=1.0)[math.cos(t / 2) < 0]


RSSR = (0.15, 0.05, 0.4, 0.25, 0.04, 0.4, 0.1), math.atan2(0.6, 0.8)

CLOSED: dict[str, tuple[tuple[float, float], Callable[[float], Answer]]] = {
    "four-bar": ((1, 1 - 2 * TURN), four_bar),
    "slider-crank": ((0, TURN), lambda t: slider_crank(0.3, 0.8, 0.1, t)[1]),
    "rssr": ((0, TURN), lambda t: rssr(*RSSR, t)[0]),
    # through 0 and pi, where it is flat
    "bennett": ((-3, 9), lambda t: bennett(math.asin(0.6), math.asin(0.8), t)[0]),
    "bricard": ((-1, 5), bricard_answer),
    "rccc": ((0, TURN), rccc_answer),
    "screw-jack": ((-TURN, 3 * TURN), lambda t: {"rise": (0.005 * t / TURN,), "swivel": (-t,)}),
}
"""Range of the control, and the answer on the branch of the network's start."""


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSED)
def test_networks_follow_their_closed_form(name: str) -> None:
    ends, answer = CLOSED[name]
    network = load_network(name)
    moved = network_drive(network, {network.controls[0].name: ends}, steps=999)
    assert (len(moved), moved.verdict) == (1000, "pass")
    assert [one.kind for one in moved.events] == (["branches"] if name == "bricard" else [])
    answers = [answer(t) for t in np.linspace(*ends, 1000)]
    units = {one.name: one.units for one in network.joints}
    for joint in answers[0]:
        for k, unit in enumerate(units[joint]):
            found = column(moved, joint if len(units[joint]) == 1 else f"{joint}_{k + 1}")
            expected = np.array([one[joint][k] for one in answers])
            gaps = apart(found, expected) if unit == "rad" else found - expected
            assert np.abs(gaps).max() < ANSWER
            assert np.abs(np.diff(found)).max() < 0.2  # no jump by a turn; t2 of bennett is fastest, 10 steps


@pytest.mark.parametrize("name", ["rssr", "rccc", "bennett", "bricard"])
def test_loops_close_by_a_product_of_matrix_exponentials(name: str) -> None:
    network = load_network(name)
    moved = network_drive(network, {network.controls[0].name: (0.7, 0.9)}, steps=4)
    for row, x in enumerate(moved.x):
        poses = dict(zip(network.body_names, moved.poses(slice(row, row + 1))[0], strict=True))
        for joint in network.joints:
            places = [k for k, one in enumerate(moved.mechanism.variables) if one.owner == joint.name]
            q = x[places] if places else x[moved.mechanism.controls]
            a, b = (poses[body] for body in joint.bodies)
            assert_close(a @ joint_matrix(joint, q), b, 1e-12)


# ---------------------------------------------------------------------------------------- branches


SWEEP = 3.8  # rad: through the flat pose at 0 or pi from any start


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_perturbed_change_points_keep_the_branch_of_their_start(seed: int) -> None:
    """Twenty four-bars each, next to those whose branches meet where all links are in line."""
    rng = np.random.default_rng(seed)
    for _ in range(20):
        kind = rng.integers(3)
        short, long = rng.uniform(0.3, 0.9), rng.uniform(1.0, 1.6)
        kinds = [(short, long, short, long), (short, short, long, long), (short, 0.7, 0.9, 1.6 - short)]
        size = 10.0 ** rng.uniform(-6, -2)
        a, b, c, d = (one * (1.0 + size * rng.uniform(-1, 1)) for one in kinds[kind])
        begin, sign, way = float(rng.uniform(0.6, 2.5)), int(rng.choice([-1, 1])), int(rng.choice([-1, 1]))
        cosines = [(a * a + d * d - (b + other * c) ** 2) / (2 * a * d) for other in (1, -1)]
        limits = [turn * math.acos(one) for one in cosines if abs(one) < 1 for turn in (1, -1)]
        first = min((way * (one - begin) % TURN for one in limits), default=TURN)
        drives = {"crank": (begin, begin + way * SWEEP)}
        moved = network_drive(planar((a, b, c, d), begin, sign), drives, steps=24)
        case = (a, b, c, d, begin, sign, way)
        assert moved.complete == (first > SWEEP), case
        if not moved.complete:
            assert [one.kind for one in moved.events] == ["turns back"], case
            assert moved.events[0].values["crank"] == pytest.approx(begin + way * first, abs=1e-6)
        assert len(moved) == min(1 + math.floor(24 * first / SWEEP), 25), case
        crank = begin + way * SWEEP / 24 * np.arange(len(moved))
        theta4 = four_bar_angles((a, b, c, d), crank, sign)["theta4"]
        # next to a flat pose the height of the triangle falls to the root of the perturbation, 1e-3
        assert np.abs(apart(column(moved, "theta4"), theta4)).max() < 1e-8, case


ENDS = [(-3.0, 1), *(pytest.param(end, sign, marks=pytest.mark.slow) for end, sign in ((3.0, 1), (3.0, -1)))]


@pytest.mark.parametrize(("end", "sign"), ENDS)
def test_a_four_bar_that_cannot_turn_stops_at_its_limit(end: float, sign: int) -> None:
    """Its coupler and rocker are in line where (b + c)^2 = a^2 + d^2 - 2 a d cos(crank)."""
    links = (0.5, 0.5, 0.5, 1.2)
    moved = network_drive(planar(links, 0.5, sign), {"crank": (0.5, end)}, steps=50)
    limit = math.copysign(math.acos((0.5**2 + 1.2**2 - 1.0) / (2 * 0.5 * 1.2)), end)
    assert (moved.verdict, [one.kind for one in moved.events]) == ("fail", ["turns back"])
    # the extreme of s along the arc is found to 1e-13 of its tangent; s itself is flat there
    assert moved.events[0].values["crank"] == pytest.approx(limit, abs=1e-9)
    assert 0 < (limit - column(moved, "theta2")[-1]) / ((end - 0.5) / 50) < 1
    before = limit * (1 - 1e-9)
    near = network_drive(planar(links, 0.5, sign), {"crank": (0.5, before)}, steps=50)
    assert near.verdict == "pass"
    error = four_bar_angles(links, before, sign)["theta4"] - column(near, "theta4")[-1]
    assert math.remainder(error, TURN) == pytest.approx(0.0, abs=1e-6)  # d theta4 / d crank is 1e4 here


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ends", "flat"),
    [
        ((-1, 7), [0, PI, TURN]), ((7, -1), [TURN, PI, 0]), ((0.5, 2.5), []),
        ((0, 1), [0]), ((1, PI), [PI]), ((PI, TURN), [PI, TURN]),  # begins flat, ends flat, both
    ],
)  # fmt: skip
def test_a_parallelogram_goes_straight_on_through_its_flat_pose(
    ends: tuple[float, float], flat: list[float]
) -> None:
    moved = network_drive(planar((0.4, 1.0, 0.4, 1.0)), {"crank": ends}, steps=200)
    assert moved.verdict == "pass"
    assert [one.kind for one in moved.events] == ["branches"] * len(flat)
    assert [one.values["crank"] for one in moved.events] == pytest.approx(flat, abs=1e-9)
    crank = np.linspace(*ends, 201)
    for name, expected in {"theta2": crank, "theta4": crank, "A": -crank, "B": crank}.items():
        assert_close(column(moved, name), expected, ANSWER)
    for one in moved.events:  # the other motion there: of the antiparallelogram
        assert set(one.direction) == {"A", "B", "theta4"}
        assert one.t == pytest.approx((one.values["crank"] - ends[0]) / (ends[1] - ends[0]), abs=1e-9)


# ---------------------------------------------------------------------------------------- limits and drives


@pytest.mark.parametrize(
    ("joint", "limits", "end", "limit"),
    [
        ("theta4", {"lower": 0.0, "upper": 2.0}, 6, 2.0), ("theta4", {"lower": 1.45}, -1, 1.45),
        ("theta2", {"upper": 1.2}, 2, 1.2),  # which the control drives
    ],
)  # fmt: skip
def test_a_joint_stops_the_motion_at_its_limit(
    joint: str, limits: dict[str, float], end: float, limit: float
) -> None:
    tables = planar(CRANK_ROCKER, 0.9, 1, **{joint: limits})
    moved = network_drive(tables, {"crank": (0.9, end)}, steps=100)
    assert (moved.verdict, [one.kind for one in moved.events]) == ("fail", ["limit"])
    (event,) = moved.events
    assert len(moved) == math.floor(event.row) + 1
    crank = 0.9 + event.row * (end - 0.9) / 100
    assert event.values["crank"] == pytest.approx(crank, abs=1e-12)
    at_limit = crank if joint == "theta2" else four_bar_angles(CRANK_ROCKER, crank)["theta4"]
    assert at_limit == pytest.approx(limit, abs=1e-12 if joint == "theta2" else ANSWER)
    low, high = limits.get("lower", -PI), limits.get("upper", PI)
    assert ((low <= column(moved, joint)) & (column(moved, joint) <= high)).all()


def test_a_joint_drives_by_its_name_in_place_of_the_control() -> None:
    by_joint = network_drive("four-bar", {"theta4": ("85deg", "120deg")}, steps=50)
    assert column(by_joint, "theta4") == pytest.approx(np.radians(np.linspace(85, 120, 51)), abs=1e-14)
    log = pd.DataFrame({"t": by_joint.t, "crank [rad]": column(by_joint, "theta2")})
    by_crank = network_drive("four-bar", log=log)
    assert_close(by_crank.joint_motion[0], by_joint.joint_motion[0], ANSWER)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in network_names() if load_network(name).controls])
def test_any_number_of_steps_gives_the_same_motion(name: str) -> None:
    network = load_network(name)
    drives = {}
    for k, one in enumerate(network.controls):
        unit, factor = network.control_unit(one.name) or ("", 1.0)
        size = 0.03 * (k + 1) if unit == "m" else 60.0 if float(factor) < 0.1 else 0.8  # degrees
        if one.value is None:
            drives[one.name] = (one.start, one.start + size)
    few, many = (network_drive(network, drives, steps=steps) for steps in (100, 1000))
    assert few.verdict == many.verdict == "pass"
    assert_close(few.joint_motion[0], many.joint_motion[0][::10], ANSWER)


# ---------------------------------------------------------------------------------------- logs


def test_a_driven_platform_goes_where_its_legs_lead() -> None:
    """leg = |p + R b - a| of a smooth motion of the platform; 5,000 rows."""
    tables, rng = tables_of("stewart-gough-driven"), np.random.default_rng(3)
    points = np.array([one["a"] for one in tables["elements"].values()])
    t = np.arange(5000) * 0.005
    waves = np.sin(np.outer(t, rng.uniform(0.3, 2.0, 6)) + rng.uniform(0, TURN, 6)) * rng.uniform(0.3, 1.0, 6)
    p = np.array(tables["bodies"]["platform"]["start"][:3]) + 0.05 * waves[:, :3]
    R = Rotation.from_rotvec(0.2 * waves[:, 3:]).as_matrix()
    reach = p[:, np.newaxis] + points[:, 1] @ R.transpose(0, 2, 1) - points[:, 0]
    legs = {f"leg{k + 1}": leg for k, leg in enumerate(np.linalg.norm(reach, axis=2).T)}
    table = pd.DataFrame({"t": t, **{f"{name} [m]": leg for name, leg in legs.items()}})
    moved = network_drive("stewart-gough-driven", log=table, joints=list(legs), point=("platform", (0, 0, 0)))
    assert (len(moved), moved.verdict) == (5000, "pass")
    pose = moved.poses()[:, moved.network.body_names.index("platform")]
    assert_close(pose[:, :3, :3], R, ANSWER)
    assert_close(pose[:, :3, 3], p, ANSWER)
    assert moved.point_motion is not None
    np.testing.assert_array_equal(moved.point_motion[0], pose[:, :3, 3])


def five_bar(left: float, right: float) -> tuple[Tables, FloatArray]:
    """Return cranks of 0.4 m at 0.6 m and rods of 0.55 m at an assembly, and its angles P, C, Q in [rad]."""
    found = five_bar_at(np.array([left]), np.array([right]))[:, 0]
    P, C, Q = ({"start": angle} for angle in found.tolist())
    joints: Tables = {
        "L": shaft(("ground", "a"), driven="left"), "P": shaft(("a", "b"), 0.4, **P),
        "C": shaft(("b", "c"), 0.55, 0.55, **C), "Q": shaft(("d", "c"), 0.4, **Q),
        "R": shaft(("ground", "d"), 0.6, driven="right"),
    }  # fmt: skip
    controls = {"left": {"start": left}, "right": {"start": right}}
    return {"bodies": {name: {} for name in "abcd"}, "joints": joints, "controls": controls}, found


def five_bar_at(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return P, C and Q in [rad], continuous, shape (3, n): both rods lean alike from the line P-Q."""
    across = 0.6 + 0.4 * (np.exp(1j * right) - np.exp(1j * left))
    lean = np.arccos(np.abs(across) / 1.1)
    line = np.unwrap(np.angle(across))
    return np.asarray([line + lean - left, PI - 2 * lean, line + PI - lean - right])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("center", "radius"),
    [
        ((PI, 0.0), 2.2),  # around cranks that the rods do not reach: lines from the start lead through them
        ((math.acos(0.75), PI - math.acos(0.75)), 0.3),  # around P = Q: the rods turn by a whole turn
    ],
)
def test_a_log_around_singular_poses_stays_on_its_branch(center: tuple[float, float], radius: float) -> None:
    turn = np.linspace(0, TURN, 201)
    left, right = center[0] + radius * np.cos(turn), center[1] + radius * np.sin(turn)
    tables, found = five_bar(float(left[0]), float(right[0]))
    log = pd.DataFrame({"t": 0.005 * np.arange(201), "left [rad]": left, "right [rad]": right})
    moved = network_drive(tables, log=log)
    assert (len(moved), moved.events) == (201, ())
    by_names = np.array([column(moved, name) for name in "PCQ"])
    assert np.abs(apart(by_names[:, 0], found)).max() < ANSWER
    expected = five_bar_at(left, right)
    assert_close(by_names - by_names[:, :1], expected - expected[:, :1], ANSWER)
    here = {name: float(column(moved, name)[0]) for name in "PCQ"}
    for row in range(0, 200, 25):  # one after another, each from the last configuration
        drives = {"left": left[[row, row + 25]].tolist(), "right": right[[row, row + 25]].tolist()}
        step = network_drive(tables, drives, steps=1, start=here)
        here = {name: float(column(step, name)[-1]) for name in "PCQ"}
        assert np.abs(apart(np.array([*here.values()]), by_names[:, row + 25])).max() < ANSWER


# ---------------------------------------------------------------------------------------- rates

PERIOD = 0.004  # s


def assert_rates(parts: tuple[FloatArray, ...], rows: FloatArray) -> None:
    """Compare rates per [s] and second derivatives per [s2] with eighth-order differences at some rows."""
    for rates, weights, power in ((parts[1], FIRST, 1), (parts[2], SECOND, 2)):
        n = len(parts[0]) - 8
        difference = sum(one * parts[0][k : n + k] for k, one in enumerate(weights)) / PERIOD**power
        # rounding of 12 rad over h^2: 5e-9; of sixth order S2 of rssr would be off by 1e-7
        assert_close(rates[4:-4][rows[4:-4]], difference[rows[4:-4]], 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "ends", "law"),
    [
        ("four-bar", (0, TURN), "uniform"), ("four-bar", (0, TURN), "trapezoid"),
        ("rssr", (0, TURN), "quintic"), ("slider-crank", (0.3, 5.0), "quintic"),
        ("bennett", (0.5, 5.5), "trapezoid"), ("rccc", (0, TURN), "quintic"),
        ("geared-five-bar", (0, 360), "uniform"), ("rack-and-pinion", (-300, 300), "quintic"),
    ],
)  # fmt: skip
def test_rates_are_derivatives(name: str, ends: tuple[float, float], law: Any) -> None:
    network = load_network(name)
    point = (network.body_names[2], (0.1, 0.2, 0.3))
    drives = {network.controls[0].name: ends}
    moved = network_drive(network, drives, duration=9, law=law, tsp=PERIOD, point=point)
    jumps = np.flatnonzero(np.abs(np.diff(moved.joint_motion[0], axis=0)).max(axis=1) > 1.0)  # q to -q at pi
    kinks = [750, 1500] if law == "trapezoid" else []  # its acceleration jumps at thirds
    apart_by = np.abs(np.arange(2251)[:, np.newaxis] - [*jumps, *kinks, -9]).min(axis=1)
    assert moved.point_motion is not None
    assert_rates(moved.joint_motion, apart_by > 5)
    assert_rates(moved.point_motion, apart_by > 5)
    peak = {"uniform": 1.0, "quintic": 15 / 8, "trapezoid": 1.5}[law]
    place = [one.kind for one in moved.mechanism.variables].index("control")
    assert np.abs(moved.xd[:, place]).max() == pytest.approx(peak * (ends[1] - ends[0]) / 9, rel=1e-9)


def test_transmission_and_dead_points_of_a_four_bar() -> None:
    """theta4' = a sin(A) / (c sin(B)) crank': 0 where crank and coupler are in line."""
    moved = network_drive("four-bar", {"crank": (0, TURN)}, steps=2000)
    ratio = -0.4 * np.sin(column(moved, "A")) / (0.7 * np.sin(column(moved, "B")))
    rates = moved.joint_motion[1][:, moved.joints.index("theta4")] / moved.xd[:, 0]
    assert_close(rates, ratio, 1e-12)  # sin(B) > 0.5
    (own,) = (one for one in moved.transmission if one.variable == "theta4")
    assert (own.drive, own.unit) == ("crank", "rad/rad")
    assert (own.smallest, own.largest) == pytest.approx((ratio.min(), ratio.max()), abs=1e-12)
    crank = column(moved, "theta2")
    assert (own.smallest_at, own.largest_at) == (crank[ratio.argmin()], crank[ratio.argmax()])
    dead = [math.acos((1 + 1.3**2 - 0.7**2) / 2.6), PI + math.acos(1 + 0.5**2 - 0.7**2)]  # stretched, folded
    assert sorted(own.dead_points) == pytest.approx(sorted(dead), abs=1e-9)


# ---------------------------------------------------------------------------------------- rows


def test_rates_and_forces_at_rows_where_branches_meet_are_those_of_the_motion() -> None:
    """A parallelogram turns its rocker with the crank: theta4' = crank', and the torque passes through."""
    tables = planar((0.4, 1.0, 0.4, 1.0))
    moved = network_drive(tables, {"crank": (0.0, TURN)}, torques={"theta4": -10.0})
    assert [event.row for event in moved.events] == pytest.approx([0, 100, 200], abs=1e-6)
    _, rates, accelerations = moved.joint_motion
    assert_close(np.abs(rates), TURN, 1e-7)  # polynomials of 7th degree, rows 4 mm apart
    assert_close(accelerations, 0.0, 1e-4)  # 39 rad/s2 would be the crank's centripetal one
    assert moved.forces is not None
    np.testing.assert_allclose(moved.forces.drives[:, 0], 10.0, atol=1e-6)
    for ratio in moved.transmission:
        assert ratio.dead_points == ()
        assert abs(ratio.smallest) == pytest.approx(1.0, abs=1e-6)


def test_a_log_that_leaves_the_branch_between_coarse_rows_ends_there() -> None:
    """theta4 goes beyond its extreme for some rows and comes back: nothing closes there."""
    largest = PI - math.acos((0.7**2 + 1 - (0.9 - 0.4) ** 2) / 1.4)  # crank and coupler folded
    parts = ((1.48, largest - 2e-3, 400), (largest - 2e-3, largest + 2e-3, 12), (largest, 1.6, 400))
    values = np.concatenate([np.linspace(*part) for part in parts])
    log = pd.DataFrame({"t (s)": 0.005 * np.arange(len(values)), "theta4 (rad)": values})
    moved = network_drive("four-bar", {"theta4": "theta4"}, log=log)
    assert (moved.verdict, len(moved)) == ("fail", int(np.argmax(values > largest)))
    assert [event.kind for event in moved.events] == ["turns back"]


def test_the_drives_reach_their_end_if_the_duration_is_no_multiple_of_the_period() -> None:
    moved = network_drive("four-bar", {"crank": (0, "100deg")}, duration=1.0, tsp=0.3)
    np.testing.assert_allclose(np.degrees(column(moved, "theta2")), [0, 30, 60, 90, 100], atol=1e-12)
    assert moved.joint_motion[1][-1, 0] == 0.0  # after the end it stands still


def test_start_values_choose_the_branch_by_the_joints_that_are_named() -> None:
    """Of a slider-crank the slider behind the crank, although the file has the other angles of its rod."""
    for s, sign in ((1.02, 1.0), (-0.6, -1.0)):
        moved = network_drive("slider-crank", {"crank": (0.7, 1.0)}, start={"s": s}, steps=3)
        # the pin of the slider is on either side: s = r cos(theta) +- sqrt(l^2 - (r sin(theta) - e)^2)
        angle = column(moved, "theta")
        expected = 0.3 * np.cos(angle) + sign * np.sqrt(0.64 - (0.3 * np.sin(angle) - 0.1) ** 2)
        np.testing.assert_allclose(column(moved, "s"), expected, atol=ANSWER)


def test_the_log_of_a_motion_drives_its_network_again() -> None:
    first = network_drive("four-bar", {"crank": (0.5, 1.0)}, steps=20)
    again = network_drive("four-bar", log=first.as_run().log.to_frame())
    assert_close(again.x, first.x, ANSWER)


def test_a_control_holds_its_value_beside_a_log() -> None:
    tables = tables_of("slider-crank")
    tables["controls"]["shift"] = {"start": 0.0}
    tables["joints"]["lift"] = {
        "kind": "prismatic", "bodies": ["slider", "load"], "n": [1, 0, 0], "driven": "shift",
    }  # fmt: skip
    tables["bodies"]["load"] = {}
    log = pd.DataFrame({"t (s)": 0.01 * np.arange(50), "crank (rad)": 0.7 + 0.01 * np.arange(50)})
    moved = network_drive(tables, {"shift": 0.2}, log=log)
    assert {drive.name: drive.end for drive in moved.drives} == pytest.approx({"crank": 1.19, "shift": 0.2})
    np.testing.assert_array_equal(column(moved, "lift"), 0.2)
