"""Assembly: every way to close a loop, counted by other means; starts, gaps, places far away."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import known_mechanisms as km
from closed_forms import arm_with_wrist
from random_networks import matrix, motion, transform, unit, vec
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.ik.solve import solve
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.math3d import Transform, rotation_y
from urmpipe_models.networks.assembly import AssemblyResult, assemble
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility
from urmpipe_models.networks.parts import Body, Control, Expression, Joint, frame_from_axes

CLOSED = 1e-9  # largest gap of an assembly in m and rad, of mechanisms of some metres
ANGLE = 1e-8  # rad: gaps near 1e-14 times conditions below 1e5


def every(
    network: Network, controls: dict[str, float] | None = None, seed: int = 0, restarts: int = 500
) -> AssemblyResult:
    """Return every assembly; all close, are apart, and have angles within -pi and pi."""
    mechanism = build_mechanism(network)
    found = assemble(mechanism, controls or {}, find_all=True, restarts=restarts, seed=seed)
    assert (found.continuum, len(found.assemblies)) == (0, found.x.shape[1])
    assert max(one.residual for one in found.assemblies) < CLOSED
    assert np.abs(evaluate_closure(mechanism, found.x).residual).max(initial=0.0) < CLOSED
    assert np.abs(found.x[mechanism.angles]).max(initial=0.0) <= math.pi + 1e-12
    for some in mechanism.rotations:
        assert np.linalg.norm(found.x[some], axis=0).max(initial=0.0) <= math.pi + 1e-12
    return found


def values(found: AssemblyResult, joint: str) -> list[float]:
    """Return the first variable of a joint in each assembly, sorted."""
    return sorted(one.values[joint][0] for one in found.assemblies)


def assert_same_angles(found: list[float], expected: list[float]) -> None:
    ours, theirs = (sorted(math.remainder(one, math.tau) for one in angles) for angles in (found, expected))
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=ANGLE)


def turned(angle: float) -> FloatArray:
    """Return the rotation of the plane by an angle in [rad]."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


# --- how many, and which


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 0.2, -0.3])
def test_two_loops_have_the_product_of_their_modes(turn: float) -> None:
    """Of each rocker of the first loop both modes of the second, where its circles meet."""
    found = every(km.coupled_loops("s"), {"s": turn})
    crank, out = np.array([0.2, 0.35]), np.array([2.0, 0.0])
    b, c = float(np.linalg.norm(np.array([1.1, 0.7]) - crank)), math.hypot(0.1, 0.7)
    e, f, g = np.array([0.4, 0.6]), math.hypot(0.7, 0.2), math.hypot(0.1, 0.8)
    drawn = math.atan2(0.7, 0.1)
    expected = []
    for sign in (1.0, -1.0):
        end = km.circles(turned(turn) @ crank, b, np.array([1.0, 0.0]), c, sign) - [1.0, 0.0]
        rocker = math.atan2(end[1], end[0]) - drawn
        pin = np.array([1.0, 0.0]) + turned(rocker) @ e
        if abs(f - g) < np.linalg.norm(out - pin) < f + g:
            expected += [rocker, rocker]
    assert len(found.assemblies) == len(expected) >= 2
    assert_same_angles(values(found, "D"), expected)


def roots_of(function: Callable[[float], float], count: int = 4000) -> list[float]:
    """Return where a function of an angle changes its sign, over a turn."""
    angles = np.linspace(-math.pi, math.pi, count + 1) + 1e-4
    sizes = [function(float(one)) for one in angles]
    return [
        float(brentq(function, one, other, xtol=1e-14))
        for (one, left), (other, right) in pairwise(zip(angles.tolist(), sizes, strict=True))
        if left * right < 0.0 and abs(left - right) < 0.5
    ]


# a plane platform on three legs. Source: Merlet 1996, Direct kinematics of planar parallel manipulators
ANCHORS = np.array([(0.0, 0.0), (1.591, 0.0), (0.0, 1.0)])  # m, on the ground
POINTS = np.array([(0.0, 0.0), (1.704, 0.0), km.circles(np.zeros(2), 2.084, np.array([1.704, 0.0]), 1.654)])
Legs = tuple[float, float, float]  # lengths in m


def platform_3rpr(legs: Legs) -> Network:
    """Return a plane platform on three legs whose lengths are controls."""
    joints, slide, centre = [], transform(np.eye(4)), upright(np.zeros(2))
    for k in range(3):
        a, b = upright(ANCHORS[k]), upright(POINTS[k])
        along = Joint(f"P{k}", "prismatic", (f"cylinder{k}", f"piston{k}"), (slide, slide))
        joints += [
            Joint(f"A{k}", "revolute", ("ground", f"cylinder{k}"), (a, centre), (0.3,)),
            km.driven(along, f"l{k}"),
            Joint(f"B{k}", "revolute", (f"piston{k}", "platform"), (centre, b), (0.1 * k,)),
        ]
    names = ["platform", *(f"{part}{k}" for part in ("cylinder", "piston") for k in range(3))]
    controls = tuple(Control(f"l{k}", legs[k]) for k in range(3))
    return Network("3-RPR", tuple(map(Body, names)), tuple(joints), controls=controls)


def upright(a: FloatArray) -> Transform:
    """Return a frame at a point of the plane in [m] whose second axis is z."""
    return frame_from_axes(km.X, km.Z, (float(a[0]), float(a[1]), 0.0))


def orientations(legs: Legs) -> list[float]:
    """Return the angles of the platform in [rad], by a search along the coupler curve of its first two legs.

    At an angle the platform's origin is where the circles about both anchors meet, moved by its points.
    """

    def third_leg(angle: float, sign: float) -> float:
        R = turned(angle)
        first, second = ANCHORS[0] - R @ POINTS[0], ANCHORS[1] - R @ POINTS[1]
        d = float(np.linalg.norm(second - first))
        if not abs(legs[0] - legs[1]) < d < legs[0] + legs[1]:
            return math.nan
        origin = km.circles(first, legs[0], second, legs[1], sign)
        return float(np.linalg.norm(origin + R @ POINTS[2] - ANCHORS[2])) - legs[2]

    return [root for sign in (1.0, -1.0) for root in roots_of(partial(third_leg, sign=sign))]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("legs", "count"), [((1.498, 1.538, 1.2), 6), ((0.5, 0.6, 1.2), 4), ((2.5, 1.2, 1.4), 2)]
)
def test_a_plane_platform_has_as_many_modes_as_its_coupler_curve_meets_a_circle(
    legs: Legs, count: int
) -> None:
    """The first is printed to have six."""
    expected = orientations(legs)
    found = every(platform_3rpr(legs), restarts=300)
    angles = [math.atan2(one.poses[1, 1, 0], one.poses[1, 0, 0]) for one in found.assemblies]
    assert len(found.assemblies) == len(expected) == count
    assert_same_angles(angles, expected)


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
    network = km.ring("rrrrrr", n, tool + np.cross(n, v))
    found = every(network, restarts=300)
    ours = np.array([[one.values[f"j{k}"][0] for k in range(6)] for one in found.assemblies])
    theirs = closed.q[0][closed.reached[0]] - q
    assert ours.shape == theirs.shape == (8, 6)
    apart = np.abs(np.remainder(ours[:, np.newaxis] - theirs + np.pi, 2.0 * np.pi) - np.pi).max(axis=2)
    assert sorted(apart.argmin(axis=1)) == list(range(8))
    assert apart.min(axis=1).max() < 1e-7  # a PUMA's conditions near the elbow's stretch times 1e-13


# --- seeds


@pytest.mark.slow
@pytest.mark.parametrize("build", [km.four_bar, km.rssr, km.nine_revolutes, km.coupled_loops])
def test_a_seed_gives_the_same_bits_another_the_same_assemblies_and_the_nearest_is_the_first(
    build: Callable[..., Network],
) -> None:
    network = build(drive="s")
    first, again, other = (every(network, {"s": 0.05}, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.x, again.x)
    assert (first.start_count, first.reason) == (again.start_count, again.reason)
    for one, two in zip(first.assemblies, other.assemblies, strict=True):
        # 1e-9: gaps near 1e-14 times conditions below 1e4, and what spins idly is held by its start
        np.testing.assert_allclose(two.poses, one.poses, rtol=0.0, atol=1e-9)
        assert one.values.keys() == two.values.keys()
    nearest = assemble(build_mechanism(network), {"s": 0.05})
    np.testing.assert_array_equal(nearest.x, first.x[:, :1])
    assert (nearest.elsewhere, nearest.reason) == (False, "the start closes")


LENGTHS, ANGLES = st.floats(0.2, 1.0), st.floats(-math.pi, math.pi)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(links=st.tuples(*[LENGTHS] * 4), crank=ANGLES, start=st.tuples(*[ANGLES] * 3))
@example(links=(0.4, 0.9, 0.7, 1.0), crank=4.712, start=(-0.46, 1.04, 1.48))  # the shipped one: B is +1.460
def test_the_assembly_is_the_nearer_one_of_both_of_a_four_bar(
    links: tuple[float, float, float, float], crank: float, start: tuple[float, float, float]
) -> None:
    a, b, c, d = links
    diagonal, names = math.hypot(a * math.cos(crank) - d, a * math.sin(crank)), ("A", "B", "theta4")
    assume(0.01 + abs(b - c) < diagonal < 0.99 * (b + c))  # both are apart
    angles = (km.four_bar_angles(links, crank, sign) for sign in (1, -1))
    both = np.array([[one[name] for name in names] for one in angles])
    way = np.linalg.norm(np.remainder(both - start + np.pi, math.tau) - np.pi, axis=1)
    assume(abs(way[0] - way[1]) > 1e-3)
    tables = km.four_bar_tables(links, {"crank": crank, **dict(zip(names, start, strict=True))})
    (found,) = assemble(build_mechanism(load_network(tables))).assemblies
    errors = np.array([found.values[name][0] for name in names]) - both[way.argmin()]
    # gaps near 1e-13 times conditions below 1e5
    assert np.abs(np.remainder(errors + np.pi, math.tau) - np.pi).max() < 1e-7


# --- starts


@pytest.mark.slow
@pytest.mark.parametrize("name", km.MECHANISMS)
@pytest.mark.parametrize("seed", range(5))
def test_rough_starts_close(name: str, seed: int) -> None:
    """Every variable is off by 0.3 m or rad, more or less."""
    network, rng = km.MECHANISMS[name](drive="s"), np.random.default_rng(seed)

    def rough(size: int) -> tuple[float, ...]:
        return tuple((0.3 * rng.normal(size=size)).tolist())

    joints = tuple(replace(one, start=rough(len(one.units))) for one in network.joints)
    bodies = tuple(replace(one, start=rough(len(one.start))) for one in network.bodies)
    (found,) = assemble(build_mechanism(replace(network, joints=joints, bodies=bodies))).assemblies
    assert found.residual < CLOSED
    assert found.values["s"] == (0.0,)  # controls keep their values


@pytest.mark.slow
def test_idle_spins_stay_as_they_are_at_the_start() -> None:
    """The rod's twist about its line against the crank, from the rotation, is that of each start."""
    network = km.rssr("s")
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
        for one in found.assemblies:  # the twist of the ball about the line
            quaternion = Rotation.from_rotvec(one.values["j1"]).as_quat()
            twist = 2.0 * math.atan2(quaternion[:3] @ in_rod, quaternion[3])
            assert math.remainder(twist - spin, 2.0 * math.pi) == pytest.approx(0.0, abs=ANGLE)


# --- what does not close


def two_links(length: float, distance: float) -> Network:
    """Return two equal links of a total length in [m], hinged to the ground at both ends at a distance."""
    half, ends = length / 2.0, [upright(np.array([one, 0.0])) for one in (length, distance)]
    joints = (
        replace(km.tied("A", "revolute", ("ground", "a"), km.Z, km.ORIGIN), start=(0.7,)),
        km.tied("B", "revolute", ("a", "b"), km.Z, (half, 0.0, 0.0)),
        Joint("C", "revolute", ("b", "ground"), (ends[0], ends[1]), (0.3,)),
    )
    return Network("links", (Body("a"), Body("b")), joints)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.1, 1e-6])
@pytest.mark.parametrize(("length", "seed"), [(1e-6, 0), (1e-3, 1), (1.0, 2), (1e3, 3), (1e6, 4)])
def test_two_links_that_are_too_short_are_open_by_what_is_missing(
    length: float, seed: int, missing: float
) -> None:
    found = assemble(build_mechanism(two_links(length, (1.0 + missing) * length)), restarts=50, seed=seed)
    assert (found.assemblies, found.start_count) == ((), 51)
    (gap,) = found.closure_errors
    assert gap.metres == pytest.approx(missing * length, rel=1e-9 if missing == 0.1 else 1e-5)
    assert gap.radians < 1e-6  # the least of the squares is flat: it ends at the root of rounding
    assert set(gap.loop) == {"A", "B", "C"} > {gap.name}
    assert found.nearest is not None  # whose residual is the largest entry of the gap
    assert 0.5 * missing < found.nearest.residual / length <= missing * (1.0 + 1e-5)


@pytest.mark.parametrize("size", [1.0, 1e3, 1e6])
def test_an_angle_that_does_not_close_is_open_at_every_size(size: float) -> None:
    """Three slides across each other close any gap in [m]; 1e-5 rad stay."""
    network = km.ring("ppp", np.eye(3), size * np.array([(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (3.0, 0.0, 0.0)]))
    last = network.joints[2]
    second = last.frames[1] @ rotation_y(1e-5)
    joints = (*network.joints[:2], replace(last, frames=(last.frames[0], second)))
    found = assemble(build_mechanism(replace(network, joints=joints)), restarts=50)
    assert found.assemblies == ()
    assert found.closure_errors[0].radians == pytest.approx(1e-5, rel=1e-4)
    assert found.closure_errors[0].metres < 1e-6 * size


# --- continua, doubles and edges


def sliding_rods(drive: str) -> Network:
    """An RSSR whose coupler is a rod of two pieces, each free to spin: one slides in the other."""
    network = km.rssr("s")
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
    whole = assemble(build_mechanism(km.rssr("s")), {"s": 0.3}, find_all=True, restarts=60)
    assert (len(found.assemblies), found.continuum) == (2, 0)
    moves = analyse_mobility(mechanism, found.x[:, 0])
    rods = next(one.bodies for one in mechanism.network.joints if one.name == "C")
    assert sorted(moves.passive) == sorted(rods)
    assert (moves.mobility, moves.kind) == (3, "mechanism")
    numbers = [k for k, name in enumerate(mechanism.network.body_names) if name not in rods]
    for one, other in zip(found.assemblies, whole.assemblies, strict=True):
        # bodies that do not spin are where they are with a rod of one piece: rounding of poses near 1
        np.testing.assert_allclose(one.poses[numbers], other.poses[numbers], atol=1e-9)


def test_both_ways_at_a_near_dead_centre_are_two_and_at_it_one_place() -> None:
    """A crank and a rod of 0.5 m each, their slide at 1 - 1e-4 m."""
    found = every(km.slider_crank(0.0, "s - 1e-4", 0.5, 0.5))
    angle = math.acos(1.0 - 1e-4)
    assert len(found.assemblies) == 2
    # the angle is the root of 2e-4: a gap of 1e-13 makes 1e-11 of it
    np.testing.assert_allclose(values(found, "j3"), [-angle, angle], rtol=0.0, atol=1e-8)


def test_a_user_joint_alone_is_where_its_control_puts_it() -> None:
    formulas = tuple(map(Expression, ("1", "0", "0", "0", "cos(s)", "sin(s)", "s", "0.1", "0.2")))
    joint = Joint("U", "user", ("b", "ground"), motion=formulas)  # the ground seen from the body
    network = Network("user", (Body("b"),), (joint,), controls=(Control("s"),))
    found = assemble(build_mechanism(network), {"s": 0.7})
    assert found.continuum == 0
    expected = motion("global", (0.7, 0.0, 0.0))
    expected[:3, 3] = 0.7, 0.1, 0.2
    np.testing.assert_allclose(found.assemblies[0].poses[1], np.linalg.inv(expected), rtol=0.0, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("far", [1e3, 1e6])
def test_a_network_far_from_the_ground_assembles_as_one_at_it(far: float) -> None:
    """Pivots 1000 km from the origin of all bodies: rounding of 1e-10 m."""
    away = far * np.array([0.6, -0.5, 0.4])
    near = [matrix(one.frames[0])[:3, 3] for one in km.four_bar().joints]
    network = km.ring("rrrr", np.tile(km.Z, (4, 1)), np.array(near) + away, "s")
    found = assemble(build_mechanism(network), {"s": 0.7}, find_all=far < 1e6, restarts=100)
    expected = every(km.four_bar(drive="s"), {"s": 0.7})
    assert not found.elsewhere
    ours, theirs = (values(one, "j3")[-1:] if far == 1e6 else values(one, "j3") for one in (found, expected))
    # eps of the distance against 0.4 m, times a condition below 100
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-13 * far)
