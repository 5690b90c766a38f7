"""Assembly: every way to close a loop, counted by other means; what does not close, and by how much."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from closed_forms import arm_with_wrist
from known_mechanisms import (
    MECHANISMS,
    ORIGIN,
    X,
    Z,
    circles,
    coupled_loops,
    driven,
    four_bar,
    nine_revolutes,
    ring,
    rod,
    rssr,
    sarrus,
    tied,
)
from random_networks import matrix, transform, unit, vec
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import NetworkError
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.ik.solve import solve
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.assembly import AssemblyResult, assemble
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility
from urmpipe_models.networks.parts import Body, ConstraintElement, Control, Expression, Joint, frame_from_axes

CLOSED = 1e-9  # largest gap of an assembly in m and rad, of mechanisms of some metres
ANGLE = 1e-8  # rad: gaps near 1e-14 times conditions below 1e5


def every(
    network: Network, controls: dict[str, float] | None = None, seed: int = 0, restarts: int = 500
) -> AssemblyResult:
    """Return every assembly; all close, are apart, and have angles within -pi and pi."""
    mechanism = build_mechanism(network)
    found = assemble(mechanism, controls or {}, find_all=True, restarts=restarts, seed=seed)
    assert found.continuum == 0
    assert len(found.assemblies) == found.x.shape[1]
    for one in found.assemblies:
        assert one.residual < CLOSED
    assert np.abs(evaluate_closure(mechanism, found.x).residual).max(initial=0.0) < CLOSED
    assert np.abs(found.x[mechanism.angles]).max(initial=0.0) <= math.pi + 1e-12
    for some in mechanism.rotations:
        assert np.linalg.norm(found.x[some], axis=0).max(initial=0.0) <= math.pi + 1e-12
    return found


def values(found: AssemblyResult, joint: str) -> list[float]:
    """Return the first variable of a joint in each assembly, sorted."""
    return sorted(one.values[joint][0] for one in found.assemblies)


def same_angles(found: list[float], expected: list[float]) -> None:
    turned = sorted(math.remainder(one, 2.0 * math.pi) for one in expected)
    np.testing.assert_allclose(
        sorted(math.remainder(one, 2.0 * math.pi) for one in found), turned, rtol=0.0, atol=ANGLE
    )


# --- how many, and which


def cranked(a: float, b: float, c: float, d: float, t: float) -> list[float]:
    """Return both angles of a four-bar's rocker in [rad], by circles."""
    p, q = a * np.array([math.cos(t), math.sin(t)]), np.array([d, 0.0])
    ends = [circles(p, b, q, c, sign) - q for sign in (1.0, -1.0)]
    return [math.atan2(end[1], end[0]) for end in ends]


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0, -1.3, 3.5])
def test_a_four_bar_has_both_its_modes(turn: float) -> None:
    """Drawn at a crank of 0.9 rad: joint j3 is the rocker against the ground, the other way round."""
    found = every(four_bar(drive="s"), {"s": turn})
    (drawn, _) = cranked(0.4, 0.9, 0.7, 1.0, 0.9)
    expected = [-(one - drawn) for one in cranked(0.4, 0.9, 0.7, 1.0, 0.9 + turn)]
    assert len(found.assemblies) == 2
    same_angles(values(found, "j3"), expected)


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 0.2, -0.3])
def test_two_loops_have_the_product_of_their_modes(turn: float) -> None:
    """Of each rocker of the first loop both modes of the second, where its circles meet."""
    found = every(coupled_loops("s"), {"s": turn})
    crank, out = np.array([0.2, 0.35]), np.array([2.0, 0.0])
    b, c = float(np.linalg.norm(np.array([1.1, 0.7]) - crank)), math.hypot(0.1, 0.7)
    e, f, g = np.array([0.4, 0.6]), math.hypot(0.7, 0.2), math.hypot(0.1, 0.8)
    drawn = math.atan2(0.7, 0.1)
    turned = math.atan2(crank[1], crank[0]) + turn
    start = np.linalg.norm(crank) * np.array([math.cos(turned), math.sin(turned)])
    expected = []
    for sign in (1.0, -1.0):
        end = circles(start, b, np.array([1.0, 0.0]), c, sign) - [1.0, 0.0]
        rocker = math.atan2(end[1], end[0]) - drawn
        rotation = np.array([[math.cos(rocker), -math.sin(rocker)], [math.sin(rocker), math.cos(rocker)]])
        pin = np.array([1.0, 0.0]) + rotation @ e
        if abs(f - g) < np.linalg.norm(out - pin) < f + g:
            expected += [(rocker, other) for other in (1.0, -1.0)]
    assert len(found.assemblies) == len(expected) >= 2
    same_angles(values(found, "D"), [rocker for rocker, _ in expected])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_rssr_has_as_many_modes_as_its_circle_meets_the_sphere(seed: int) -> None:
    """Whatever its rod spins: two, of which the output's angle solves A cos + B sin = C."""
    network = rssr("s")
    turn = 0.4 * seed
    found = every(network, {"s": turn})
    frames = [matrix(one.frames[0]) for one in network.joints]
    first, second, third, out = (frame[:3, 3] for frame in frames)
    about = Rotation.from_rotvec(turn * frames[0][:3, 1])
    ball = first + about.apply(second - first)
    length = float(np.linalg.norm(third - second))

    def open_by(angle: float) -> float:
        # the last joint's first body is the output: it turns by minus its variable
        turned = out + Rotation.from_rotvec(-angle * frames[3][:3, 1]).apply(third - out)
        return float(np.linalg.norm(turned - ball)) - length

    expected = roots_of(open_by)
    assert len(found.assemblies) == len(expected)
    same_angles(values(found, "j3"), expected)
    assert len(expected) == 2 or seed


def roots_of(function: Callable[[float], float], count: int = 4000) -> list[float]:
    """Return where a function of an angle changes its sign, over a turn."""
    angles = np.linspace(-math.pi, math.pi, count + 1) + 1e-4
    sizes = [function(float(one)) for one in angles]
    return [
        float(brentq(function, one, other, xtol=1e-14))
        for (one, left), (other, right) in pairwise(zip(angles.tolist(), sizes, strict=True))
        if left * right < 0.0 and abs(left - right) < 0.5
    ]


class Plane(NamedTuple):
    """Points in [m] of a plane platform on three legs: on the ground, on the platform; and their lengths."""

    anchors: FloatArray
    points: FloatArray
    legs: tuple[float, float, float]


def plane(legs: tuple[float, float, float]) -> Plane:
    anchors = np.array([(0.0, 0.0), (2.4, 0.3), (0.9, 2.1)])
    return Plane(anchors, np.array([(0.0, 0.0), (1.5, 0.1), (0.4, 1.3)]), legs)


def merlet() -> Plane:
    """Return a platform with six modes, in decimetres.

    Source: Merlet 1996, Direct kinematics of planar parallel manipulators: sides 17.04, 16.54 and 20.84.
    """
    third = circles(np.zeros(2), 20.84, np.array([17.04, 0.0]), 16.54)
    anchors = 0.1 * np.array([(0.0, 0.0), (15.91, 0.0), (0.0, 10.0)])
    return Plane(anchors, 0.1 * np.array([(0.0, 0.0), (17.04, 0.0), third]), (1.498, 1.538, 1.2))


def platform_3rpr(of: Plane) -> Network:
    """Return a plane platform on three legs whose lengths controls hold."""
    joints = []
    for k in range(3):
        a, b = upright(of.anchors[k]), upright(of.points[k])
        slide = transform(np.eye(4))
        along = Joint(f"P{k}", "prismatic", (f"cylinder{k}", f"piston{k}"), (slide, slide))
        joints += [
            Joint(f"A{k}", "revolute", ("ground", f"cylinder{k}"), (a, upright(np.zeros(2))), (0.3,)),
            driven(along, f"l{k}"),
            Joint(f"B{k}", "revolute", (f"piston{k}", "platform"), (upright(np.zeros(2)), b), (0.1 * k,)),
        ]
    names = ["platform", *(f"{part}{k}" for part in ("cylinder", "piston") for k in range(3))]
    controls = tuple(Control(f"l{k}", of.legs[k]) for k in range(3))
    return Network("3-RPR", tuple(map(Body, names)), tuple(joints), controls=controls)


def upright(a: FloatArray) -> Transform:
    """Return a frame at a point of the plane in [m] whose second axis is z."""
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack((X, Z, np.cross(X, Z)))
    frame[:2, 3] = a
    return transform(frame)


def orientations(of: Plane) -> list[float]:
    """Return the angles of the platform in [rad], by a search along the coupler curve of its first two legs.

    At an angle the platform's origin is where the circles about both anchors meet, moved by its points.
    """

    def third_leg(angle: float, sign: float) -> float:
        R = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        first, second = of.anchors[0] - R @ of.points[0], of.anchors[1] - R @ of.points[1]
        d = float(np.linalg.norm(second - first))
        if not abs(of.legs[0] - of.legs[1]) < d < of.legs[0] + of.legs[1]:
            return math.nan
        origin = circles(first, of.legs[0], second, of.legs[1], sign)
        return float(np.linalg.norm(origin + R @ of.points[2] - of.anchors[2])) - of.legs[2]

    return [root for sign in (1.0, -1.0) for root in roots_of(partial(third_leg, sign=sign))]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "count"), [(merlet(), 6), (plane((1.0, 1.1, 0.9)), None), (plane((1.6, 1.2, 1.4)), None)]
)
def test_a_plane_platform_has_as_many_modes_as_its_coupler_curve_meets_a_circle(
    of: Plane, count: int | None
) -> None:
    expected = orientations(of)
    found = every(platform_3rpr(of), restarts=300)
    at = platform_3rpr(of).body_names.index("platform")
    angles = [math.atan2(one.poses[at, 1, 0], one.poses[at, 0, 0]) for one in found.assemblies]
    assert len(found.assemblies) == len(expected) >= 2
    assert count in (None, len(expected))
    same_angles(angles, expected)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_an_arm_with_a_spherical_wrist_has_the_eight_modes_of_its_closed_form(seed: int) -> None:
    """Its tool is fixed to the ground: joint values are those of `solve`, counted from where it is drawn."""
    rng = np.random.default_rng(seed)
    chain = arm_with_wrist(rng, "like a PUMA")
    while True:
        q = rng.uniform(-2.5, 2.5, (1, 6))
        closed = solve(chain, forward_targets(chain, q), every=True)
        if closed.reached.sum() == 8:
            break
    J = jacobian_over_log(chain, q)[0]
    v, n = J[:3].T, J[3:].T
    tool = forward_targets(chain, q).position[0]
    network = ring("rrrrrr", n, tool + np.cross(n, v))
    found = every(network, restarts=300)
    ours = np.array([[one.values[f"j{k}"][0] for k in range(6)] for one in found.assemblies])
    theirs = closed.q[0][closed.reached[0]] - q
    assert ours.shape == theirs.shape == (8, 6)
    apart = np.abs(np.remainder(ours[:, np.newaxis] - theirs + np.pi, 2.0 * np.pi) - np.pi).max(axis=2)
    assert sorted(apart.argmin(axis=1)) == list(range(8))
    assert apart.min(axis=1).max() < 1e-7  # a PUMA's conditions near the elbow's stretch times 1e-13


def test_sarrus_has_both_sides_of_each_leg() -> None:
    """Held at its foot a leg leaves its upper hinge two heights, and the other leg both elbows at each."""
    found = every(sarrus("s"), {"s": 0.05})
    assert len(found.assemblies) == 4
    poses = np.array([one.poses[3] for one in found.assemblies])
    np.testing.assert_allclose(poses[:, :3, :3], np.tile(np.eye(3), (4, 1, 1)), rtol=0.0, atol=ANGLE)
    heights = sorted(poses[:, 2, 3].tolist())
    np.testing.assert_allclose(heights[::2], heights[1::2], rtol=0.0, atol=ANGLE)
    np.testing.assert_allclose(poses[:, :2, 3], 0.0, rtol=0.0, atol=ANGLE)


# --- seeds


@pytest.mark.slow
@pytest.mark.parametrize("build", [four_bar, rssr, nine_revolutes])
def test_one_seed_gives_the_same_bits_another_the_same_set(build: Callable[..., Network]) -> None:
    network = build(drive="s")
    first, again, other = (every(network, {"s": 0.1}, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.x, again.x)
    assert first.tried == again.tried
    assert first.reason == again.reason
    assert len(first.assemblies) == len(other.assemblies)
    for one, two in zip(first.assemblies, other.assemblies, strict=True):
        # 1e-9: gaps near 1e-14 times conditions below 1e4, and what spins idly is held by its start
        np.testing.assert_allclose(two.poses, one.poses, rtol=0.0, atol=1e-9)
        assert one.values.keys() == two.values.keys()


@pytest.mark.slow
def test_the_nearest_assembly_is_the_first_of_all() -> None:
    for build in (four_bar, rssr, coupled_loops):
        network = build(drive="s")
        one = assemble(build_mechanism(network), {"s": 0.05})
        assert len(one.assemblies) == 1
        np.testing.assert_array_equal(one.x[:, 0], every(network, {"s": 0.05}).x[:, 0])
        assert (one.elsewhere, one.reason) == (False, "the start closes")


LENGTHS, ANGLES = st.floats(0.2, 1.0), st.floats(-math.pi, math.pi)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(links=st.tuples(*[LENGTHS] * 4), crank=ANGLES, start=st.tuples(*[ANGLES] * 3))
@example(links=(0.4, 0.9, 0.7, 1.0), crank=4.712, start=(-0.46, 1.04, 1.48))  # the shipped one: B is +1.460
def test_the_assembly_is_the_nearer_one_of_both_of_a_four_bar(
    links: tuple[float, float, float, float], crank: float, start: tuple[float, float, float]
) -> None:
    a, b, c, d = links
    p, q = a * np.array([math.cos(crank), math.sin(crank)]), np.array([d, 0.0])
    assume(0.01 + abs(b - c) < np.linalg.norm(q - p) < 0.99 * (b + c))  # both are apart
    both = []
    for sign in (1.0, -1.0):
        end = circles(p, b, q, c, sign)
        coupler, rocker = (math.atan2(*(end - one)[::-1]) for one in (p, q))
        both.append((coupler - crank, rocker - coupler, rocker))
    way = [np.linalg.norm(np.remainder(np.subtract(one, start) + np.pi, math.tau) - np.pi) for one in both]
    assume(abs(way[0] - way[1]) > 1e-3)
    pins = {
        "A": ("crank", "coupler", a, 0),
        "B": ("coupler", "rocker", b, c),
        "C": ("ground", "rocker", d, 0),
    }
    joints: dict[str, Any] = {
        name: {"bodies": [first, second], "a": [[x, 0, 0], [y, 0, 0]], "start": angle}
        for (name, (first, second, x, y)), angle in zip(pins.items(), start, strict=True)
    }
    joints["turn"] = {"bodies": ["ground", "crank"], "driven": "s"}
    tables = {
        "controls": {"s": {"start": crank}},
        "bodies": {name: {} for name in ("crank", "coupler", "rocker")},
        "joints": {name: {"kind": "revolute", "n": [0, 0, 1]} | one for name, one in joints.items()},
    }
    (found,) = assemble(build_mechanism(load_network(tables))).assemblies
    pairs = zip("ABC", both[int(np.argmin(way))], strict=True)
    errors = [math.remainder(found.values[name][0] - angle, math.tau) for name, angle in pairs]
    assert np.abs(errors).max() < 1e-7  # gaps near 1e-13 times conditions below 1e5


# --- starts


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
@pytest.mark.parametrize("seed", range(5))
def test_rough_starts_close(name: str, seed: int) -> None:
    """Every variable is off by 0.3 m or rad, more or less."""
    mechanism = rough(MECHANISMS[name](drive="s"), 0.3, seed)
    found = assemble(mechanism)
    assert len(found.assemblies) == 1
    assert found.assemblies[0].residual < CLOSED
    assert found.assemblies[0].values["s"] == (0.0,)  # controls are held


def rough(network: Network, size: float, seed: int) -> Mechanism:
    rng = np.random.default_rng(seed)
    joints = tuple(
        replace(one, start=tuple((size * rng.normal(size=len(one.units))).tolist())) for one in network.joints
    )
    bodies = tuple(
        Body(one.name, tuple((size * rng.normal(size=6)).tolist()) if one.start else ())
        for one in network.bodies
    )
    return build_mechanism(replace(network, joints=joints, bodies=bodies))


@pytest.mark.slow
def test_idle_spins_stay_as_they_are_at_the_start() -> None:
    """The rod's twist about its line against the crank, from the rotation, is that of each start."""
    network = rssr("s")
    ball = network.joints[1]
    first, second = (matrix(joint.frames[0])[:3, 3] for joint in network.joints[1:3])
    line = (second - first) / np.linalg.norm(second - first)
    in_rod = matrix(ball.frames[1])[:3, :3].T @ line
    for spin in (0.0, 1.0, -2.5):
        start = matrix(ball.frames[0])[:3, :3].T @ line * spin
        joints = (network.joints[0], replace(ball, start=vec(start)), *network.joints[2:])
        found = every(replace(network, joints=joints))
        assert len(found.assemblies) == 2
        # rotated about its line by so much, nothing else moved: the drawn place closes with any spin
        rod_at = found.assemblies[0].poses[network.body_names.index("b2")]
        expected = Rotation.from_rotvec(spin * line).as_matrix()
        np.testing.assert_allclose(rod_at[:3, :3], expected, rtol=0.0, atol=ANGLE)
        for one in found.assemblies:
            quaternion = Rotation.from_rotvec(one.values["j1"]).as_quat()
            twist = 2.0 * math.atan2(quaternion[:3] @ in_rod, quaternion[3])
            assert math.remainder(twist - spin, 2.0 * math.pi) == pytest.approx(0.0, abs=ANGLE)


# --- what does not close


def two_links(length: float, distance: float) -> Network:
    """Return two equal links of a total length in [m], hinged to the ground at both ends at a distance."""
    half, ends = length / 2.0, [upright(np.array([one, 0.0])) for one in (length, distance)]
    joints = (
        replace(tied("A", "revolute", ("ground", "a"), Z, ORIGIN), start=(0.7,)),
        tied("B", "revolute", ("a", "b"), Z, (half, 0.0, 0.0)),
        Joint("C", "revolute", ("b", "ground"), (ends[0], ends[1]), (0.3,)),
    )
    return Network("links", (Body("a"), Body("b")), joints)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.1, 1e-6])
@pytest.mark.parametrize("length", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_two_links_that_are_too_short_are_open_by_what_is_missing(length: float, missing: float) -> None:
    found = assemble(build_mechanism(two_links(length, (1.0 + missing) * length)), restarts=50)
    assert (found.assemblies, found.tried) == ((), 51)
    (gap,) = found.gaps
    assert gap.metres == pytest.approx(missing * length, rel=1e-9 if missing == 0.1 else 1e-5)
    assert gap.radians < 1e-6  # the least of the squares is flat: it ends at the root of rounding
    assert set(gap.loop) == {"A", "B", "C"} > {gap.name}
    assert found.nearest is not None  # whose residual is the largest entry of the gap
    assert 0.5 * missing < found.nearest.residual / length <= missing * (1.0 + 1e-5)


@pytest.mark.parametrize("size", [1.0, 1e3, 1e6])
def test_an_angle_that_does_not_close_is_open_at_every_size(size: float) -> None:
    """Three slides across each other close any gap in [m]; 1e-5 rad stay."""
    network = ring("ppp", np.eye(3), size * np.array([(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (3.0, 0.0, 0.0)]))
    last = network.joints[2]
    second = matrix(last.frames[1])
    second[:3, :3] = second[:3, :3] @ Rotation.from_rotvec([0.0, 1e-5, 0.0]).as_matrix()
    joints = (*network.joints[:2], replace(last, frames=(last.frames[0], transform(second))))
    found = assemble(build_mechanism(replace(network, joints=joints)), restarts=50)
    assert found.assemblies == ()
    assert found.gaps[0].radians == pytest.approx(1e-5, rel=1e-4)
    assert found.gaps[0].metres < 1e-6 * size


def test_a_rod_that_is_too_short_is_named_with_what_is_missing() -> None:
    link = replace(tied("A", "revolute", ("ground", "a"), Z, ORIGIN), start=(1.0,))
    points = ((1.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    short = ConstraintElement("R", "gg", ("a", "ground"), Expression("0.4"), points)
    network = Network("short", (Body("a"),), (link,), (short,))
    (gap,) = assemble(build_mechanism(network), restarts=50).gaps
    assert (gap.name, gap.loop, gap.radians) == ("R", ("R",), 0.0)
    assert gap.metres == pytest.approx(0.6, rel=1e-9)  # the end comes to 1 m from the point, the rod has 0.4


@pytest.mark.slow
def test_the_gap_of_the_nearest_is_the_least_whatever_the_seed() -> None:
    mechanism = build_mechanism(two_links(1.0, 1.1))
    gaps = [assemble(mechanism, seed=seed, restarts=30).gaps[0].metres for seed in range(5)]
    np.testing.assert_allclose(gaps, 0.1, rtol=1e-9)


# --- controls


@pytest.mark.parametrize("value", [1.5, -1.5, math.nan, math.inf, -math.inf])
def test_a_control_out_of_its_range_is_refused_its_limits_are_allowed(value: float) -> None:
    mechanism = build_mechanism(replace(four_bar(drive="s"), controls=(Control("s", 0.0, -1.0, 1.0),)))
    with pytest.raises(NetworkError, match=r"s = .*-1 to 1"):
        assemble(mechanism, {"s": value})
    for limit in (-1.0, 1.0):
        assert assemble(mechanism, {"s": limit}).assemblies[0].values["s"] == (limit,)
    if math.isinf(value):
        with pytest.raises(NetworkError):
            assemble(build_mechanism(four_bar(drive="s")), {"s": value}, restarts=5)


def test_every_control_that_is_wrong_is_named_at_once() -> None:
    free = four_bar()
    joints = (driven(free.joints[0], "t"), *free.joints[1:])
    controls = (Control("s", 0.0, -1.0, 1.0), Control("t", value=Expression("2 * s")))
    with pytest.raises(NetworkError) as caught:
        assemble(
            build_mechanism(replace(free, joints=joints, controls=controls)), {"s": 2.0, "t": 0.0, "u": 0.0}
        )
    assert len(caught.value.findings) == 3


def test_a_length_that_is_no_number_at_a_control_is_refused() -> None:
    link, root = tied("A", "revolute", ("ground", "a"), Z, ORIGIN), Expression("sqrt(s)")
    element = ConstraintElement("R", "gg", ("a", "ground"), root, ((1.0, 0.0, 0.0), (2.0, 0.0, 0.0)))
    network = Network("root", (Body("a"),), (link,), (element,), (Control("s", 1.0),))
    with pytest.raises(NetworkError):
        assemble(build_mechanism(network), {"s": -1.0}, restarts=5)


# --- continua, doubles and edges


@pytest.mark.slow
def test_forty_assemblies_of_the_stewart_gough_platform_for_another_seed() -> None:
    """Dietmaier's geometry has 40, which is the most that there can be; test_shipped.py has seed 0."""
    found = assemble(build_mechanism(load_network("stewart-gough")), find_all=True, seed=1)
    assert len(found.assemblies) == 40
    assert max(one.residual for one in found.assemblies) < 1e-9


def sliding_rods(drive: str) -> Network:
    """An RSSR whose coupler is a rod of two pieces, each free to spin: one slides in the other."""
    network = rssr("s")
    first, last = (one for one in network.joints if one.kind == "global")
    (rod,) = set(first.bodies) & set(last.bodies)
    ends = [one.frames[one.bodies.index(rod)].translation for one in (first, last)]
    along = unit(np.subtract(ends[1], ends[0]))
    across = unit(np.cross(along, (0.3, 0.5, 0.7)))
    at = frame_from_axes(tuple(across), tuple(along), ends[0])
    a, b = ("rod2" if one == rod else one for one in last.bodies)
    slide = Joint("C", "cylindrical", (rod, "rod2"), (at, at), values=(None, Expression(drive)))
    joints = tuple(replace(one, bodies=(a, b)) if one is last else one for one in network.joints)
    return replace(network, bodies=(*network.bodies, Body("rod2")), joints=(*joints, slide))


def test_pieces_of_a_rod_spin_apart() -> None:
    """Of a driven length: both branches, whatever the two spins are; the same as of a rod of one piece."""
    mechanism = build_mechanism(sliding_rods("0 * s"))
    found = assemble(mechanism, {"s": 0.3}, find_all=True, restarts=60)
    whole = assemble(build_mechanism(rssr("s")), {"s": 0.3}, find_all=True, restarts=60)
    assert (len(found.assemblies), found.continuum) == (2, 0)
    moves = analyse_mobility(mechanism, found.x[:, 0])
    rods = next(one.bodies for one in mechanism.network.joints if one.name == "C")
    assert sorted(moves.idle) == sorted(rods)
    assert (moves.mobility, moves.kind) == (3, "mechanism")
    numbers = [k for k, name in enumerate(mechanism.network.body_names) if name not in rods]
    for one, other in zip(found.assemblies, whole.assemblies, strict=True):
        # bodies that do not spin are where they are with a rod of one piece: rounding of poses near 1
        np.testing.assert_allclose(one.poses[numbers], other.poses[numbers], atol=1e-9)


def networks_that_move() -> Iterator[tuple[Network, int]]:
    yield four_bar(), 1
    yield nine_revolutes(), 3
    yield rssr(), 1
    yield Network("tree", (Body("a"),), (tied("A", "cylindrical", ("ground", "a"), Z, ORIGIN),)), 2
    single = rod("R", ("ground", "a"), ORIGIN, (1.0, 0.0, 0.0))
    yield Network("rod", (Body("a", (0.0,) * 6),), (), (single,)), 5


@pytest.mark.parametrize(("network", "ways"), [*networks_that_move()])
def test_what_moves_with_its_controls_held_is_a_continuum(network: Network, ways: int) -> None:
    found = assemble(build_mechanism(network), find_all=True)
    assert found.continuum == ways
    assert len(found.assemblies) == 1
    assert str(ways) in found.reason


@pytest.mark.slow
@pytest.mark.parametrize(
    ("network", "modes"),
    [
        (two_links(1.0, 1.0), 1),  # shaky: it cannot move, and there is no other way to assemble it
        (ring("rrr", np.tile(Z, (3, 1)), np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (3.0, 0.0, 0.0)])), 1),
    ],
)
def test_a_shaky_structure_is_no_continuum(network: Network, modes: int) -> None:
    found = assemble(build_mechanism(network), find_all=True, restarts=200)
    assert found.continuum == 0
    assert len(found.assemblies) == modes


def test_both_ways_at_a_near_dead_centre_are_two_and_at_it_one_place() -> None:
    """A crank and a rod of 0.5 m each, their slide held at 1 - 1e-4 m."""
    joints = (
        tied("A", "revolute", ("ground", "crank"), Z, ORIGIN),
        tied("B", "revolute", ("crank", "rod"), Z, (0.5, 0.0, 0.0)),
        tied("C", "revolute", ("rod", "slider"), Z, (1.0, 0.0, 0.0)),
        driven(tied("P", "prismatic", ("ground", "slider"), X, ORIGIN), "s"),
    )
    bodies = tuple(map(Body, ("crank", "rod", "slider")))
    found = every(Network("slider-crank", bodies, joints, controls=(Control("s", -1e-4),)))
    angle = math.acos(1.0 - 1e-4)
    assert len(found.assemblies) == 2
    # the angle is the root of 2e-4: a gap of 1e-13 makes 1e-11 of it
    np.testing.assert_allclose(values(found, "A"), [-angle, angle], rtol=0.0, atol=1e-8)


def test_lines_that_a_control_makes_parallel_are_no_crash() -> None:
    """At s = 0 the lines have no common normal: that is no configuration, and has to be said."""
    crc = ConstraintElement("E", "crc", ("ground", "b"), Expression("0.3"), (ORIGIN, (0.0, 0.3, 0.0)), (X, X))
    hinge = driven(tied("A", "revolute", ("ground", "b"), Z, ORIGIN), "s")
    mechanism = build_mechanism(Network("lines", (Body("b"),), (hinge,), (crc,), (Control("s", 1.0),)))
    assert assemble(mechanism, {"s": 0.0}, restarts=20).assemblies == ()


def test_loops_whose_joints_are_all_driven_close_or_not() -> None:
    """No variable is left to find: at s = 0 it closes as it is drawn, elsewhere it does not."""
    network = four_bar()
    joints = tuple(driven(one, "s") for one in network.joints)
    mechanism = build_mechanism(replace(network, joints=joints, controls=(Control("s"),)))
    assert len(assemble(mechanism, find_all=True, restarts=20).assemblies) == 1
    assert assemble(mechanism, {"s": 0.3}, restarts=20).assemblies == ()


def test_a_user_joint_alone_is_where_its_control_puts_it() -> None:
    motion = tuple(map(Expression, ("1", "0", "0", "0", "cos(s)", "sin(s)", "s", "0.1", "0.2")))
    joint = Joint("U", "user", ("b", "ground"), motion=motion)  # the ground seen from the body
    network = Network("user", (Body("b"),), (joint,), controls=(Control("s"),))
    found = assemble(build_mechanism(network), {"s": 0.7})
    assert found.continuum == 0
    expected = np.eye(4)
    expected[:3, :3] = Rotation.from_rotvec([0.7, 0.0, 0.0]).as_matrix()
    expected[:3, 3] = 0.7, 0.1, 0.2
    np.testing.assert_allclose(found.assemblies[0].poses[1], np.linalg.inv(expected), rtol=0.0, atol=1e-15)


def test_zero_restarts_leave_what_the_start_came_to_and_progress_ends_at_one() -> None:
    shares: list[float] = []
    mechanism = build_mechanism(four_bar(drive="s"))
    found = assemble(mechanism, {"s": 0.3}, find_all=True, restarts=0)
    assert (len(found.assemblies), found.tried) == (1, 1)
    assemble(mechanism, find_all=True, progress=shares.append)
    assert shares[-1] == 1.0
    assert all(0.0 <= one <= 1.0 for one in shares)


@pytest.mark.slow
@pytest.mark.parametrize("far", [1e3, 1e6])
def test_a_network_far_from_the_ground_assembles_as_one_at_it(far: float) -> None:
    """Pivots 1000 km from the origin of all bodies: rounding of 1e-10 m."""
    away = far * np.array([0.6, -0.5, 0.4])
    near = [matrix(one.frames[0])[:3, 3] for one in four_bar().joints]
    network = ring("rrrr", np.tile(Z, (4, 1)), np.array(near) + away, "s")
    found = assemble(build_mechanism(network), {"s": 0.7}, find_all=far < 1e6, restarts=100)
    expected = every(four_bar(drive="s"), {"s": 0.7})
    assert not found.elsewhere
    ours, theirs = (values(one, "j3")[-1:] if far == 1e6 else values(one, "j3") for one in (found, expected))
    # eps of the distance against 0.4 m, times a condition below 100
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-13 * far)
