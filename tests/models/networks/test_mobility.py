"""Mobility: laws of every mechanism, Kutzbach's formula by hand, redundant constraints, special places."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from known_mechanisms import (
    MECHANISMS,
    ORIGIN,
    X,
    Y,
    Z,
    bennett,
    coupled_loops,
    driven,
    four_bar,
    nine_revolutes,
    rccc,
    ring,
    rod,
    rod_platform,
    rssr,
    sarrus,
    tied,
)
from random_networks import (
    assert_same_space,
    matrix,
    null_space,
    random_network,
    reframed,
    transform,
    twist_space,
    unit,
    vec,
)
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.assembly import assemble
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility, find_blocked_controls
from urmpipe_models.networks.parts import Body, ConstraintElement, Control, Expression, Joint, JointKind

SAME_POSES = 1e-8  # lengths of the mechanism and rad: descent ends at gaps below 1e-14, conditions below 1e5

few_examples = settings(
    max_examples=5, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)


class Facts(NamedTuple):
    """What does not depend on how a network is written."""

    mobility: int
    kutzbach: int
    redundant: int
    idle: tuple[str, ...]
    special: bool
    kind: str
    structure: str


def facts_of(network: Network) -> Facts:
    mechanism = build_mechanism(network)
    x = mechanism.start
    gap = np.abs(evaluate_closure(mechanism, x[:, np.newaxis]).residual) * mechanism.row_scales[:, np.newaxis]
    assert gap.max(initial=0.0) < 1e-12  # every variant closes at its start, in lengths of the mechanism
    found = analyse_mobility(mechanism, x)
    assert len(found.redundant) == mechanism.rows - found.rank == found.mobility - found.kutzbach
    return Facts(
        found.mobility, found.kutzbach, len(found.redundant), found.idle, found.special, found.kind,
        mechanism.graph.structure,
    )  # fmt: skip


def moving(
    mobility: int, kutzbach: int, redundant: int, *idle: str, structure: str = "closed chain"
) -> Facts:
    return Facts(mobility, kutzbach, redundant, idle, False, "mechanism", structure)


EXPECTED = {
    "four-bar": moving(1, -2, 3), "bennett": moving(1, -2, 3), "sarrus": moving(1, 0, 1),
    "rssr": moving(2, 2, 0, "b2"), "rccc": moving(1, 1, 0), "rod platform": moving(1, 1, 0),
    "nine revolutes": moving(1, 1, 0), "coupled loops": moving(1, -5, 6),
}  # fmt: skip


# --- ways to write the same mechanism


def scaled(network: Network, factor: float) -> Network:
    """Return a network with all lengths, driven ones and pitches too, times a factor."""

    def moved(frame: Transform) -> Transform:
        return Transform(frame.rotation, (*(factor * one for one in frame.translation),))

    def times(value: Expression | None, unit: str) -> Expression | None:
        return Expression(f"{factor!r} * ({value.text})") if value is not None and unit == "m" else value

    joints = tuple(
        replace(
            one,
            frames=(moved(one.frames[0]), moved(one.frames[1])),
            pitch=factor * one.pitch,
            start=tuple(q * factor if u == "m" else q for q, u in zip(one.start, one.units, strict=False)),
            values=tuple(times(v, u) for v, u in zip(one.values, one.units, strict=False)),
        )
        for one in network.joints
    )
    elements = tuple(
        replace(
            one,
            points=(vec(factor * np.array(one.points[0])), vec(factor * np.array(one.points[1]))),
            length=Expression(f"{factor!r} * ({one.length.text})"),
        )
        for one in network.elements
    )
    bodies = tuple(
        Body(one.name, (*(factor * c for c in one.start[:3]), *one.start[3:])) for one in network.bodies
    )
    return replace(network, bodies=bodies, joints=joints, elements=elements)


def shuffled(network: Network, rng: np.random.Generator) -> Network:
    """Return a network whose bodies, joints, elements and controls stand in another order."""
    parts = {key: getattr(network, key) for key in ("bodies", "joints", "elements", "controls")}
    orders = {key: rng.permutation(len(part)) for key, part in parts.items()}
    ordered: dict[str, Any] = {key: tuple(part[k] for k in orders[key]) for key, part in parts.items()}
    return replace(network, **ordered)


def rooted(network: Network, ground: str) -> Network:
    """Return a network in which another body stands still."""
    names = [one for one in network.body_names if one != ground]
    starts = {one.name: one.start for one in network.bodies if one.start}
    here = starts.pop(ground, ())
    if here:  # the other way round: the old ground is seen from the new one
        assert here == (0.0,) * 6
        starts[network.ground] = here
    return replace(network, ground=ground, bodies=tuple(Body(one, starts.get(one, ())) for one in names))


def reversed_joints(network: Network, rng: np.random.Generator) -> Network:
    """Return a network some of whose joints, without drives, name their bodies the other way round.

    T^-1 of the same axis is the motion by -q; of a global joint, too.
    """

    def turned(one: Joint) -> Joint:
        if one.values or one.kind == "user" or rng.random() < 0.5:
            return one
        start = tuple(-q for q in one.start)
        return replace(one, bodies=one.bodies[::-1], frames=one.frames[::-1], start=start)

    return replace(network, joints=tuple(map(turned, network.joints)))


def rewritten(network: Network, seed: int) -> Network:
    """Return a network written in all other ways at once."""
    rng = np.random.default_rng(seed)
    is_tied = not any(one.start for one in network.bodies)
    network = reversed_joints(reframed(network, rng) if is_tied else network, rng)
    names = network.body_names if is_tied else (network.ground,)
    return shuffled(rooted(network, names[int(rng.integers(len(names)))]), rng)


seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("name", MECHANISMS)
def test_known_mechanisms_move_as_is_known(name: str) -> None:
    assert facts_of(MECHANISMS[name](drive="s")) == EXPECTED[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
@few_examples
@given(seed=seeds, power=st.integers(-4, 4))
def test_units_order_ground_and_cuts_do_not_matter(name: str, seed: int, power: int) -> None:
    network = scaled(rewritten(MECHANISMS[name](drive="s"), seed), 10.0**power)
    found = facts_of(network)
    assert found._replace(idle=()) == EXPECTED[name]._replace(idle=())
    assert len(found.idle) == len(EXPECTED[name].idle)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize("name", MECHANISMS)
def test_the_unit_of_length_does_not_matter(name: str, factor: float) -> None:
    """From micrometres to 1000 km."""
    assert facts_of(scaled(MECHANISMS[name](drive="s"), factor)) == EXPECTED[name]


@pytest.mark.parametrize("build", [four_bar, bennett, coupled_loops])
def test_which_constraints_are_redundant_does_not_depend_on_the_unit_of_length(
    build: Callable[..., Network],
) -> None:
    mechanisms = [build_mechanism(scaled(build(), factor)) for factor in (1e-3, 1.0, 1e3)]
    found = [analyse_mobility(mechanism, mechanism.start).redundant for mechanism in mechanisms]
    assert found[0] == found[1] == found[2]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_random_networks_do_not_depend_on_how_they_are_written(seed: int) -> None:
    """Joints of all kinds and elements of all kinds."""
    network = random_network(np.random.default_rng(seed), bodies=4, extra=2, elements=1)
    expected = facts_of(network)
    for k in range(2):
        other = facts_of(scaled(rewritten(network, 100 * seed + k), 10.0 ** (3 * k - 2)))
        assert other._replace(idle=()) == expected._replace(idle=())
        if set(expected.idle):
            assert other.idle


def poses_in(network: Network, held: dict[str, float]) -> dict[str, FloatArray]:
    """Return the poses of the assembly nearest to the start, translations in lengths of the mechanism."""
    mechanism = build_mechanism(network)
    found = assemble(mechanism, held)
    assert not found.elsewhere
    assert found.continuum == 0
    poses = found.assemblies[0].poses.copy()
    poses[:, :3, 3] /= mechanism.length
    return dict(zip(network.body_names, poses, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
@few_examples
@given(seed=seeds, power=st.integers(-3, 3), value=st.floats(-0.05, 0.05))
def test_closed_poses_do_not_depend_on_how_a_network_is_written(
    name: str, seed: int, power: int, value: float
) -> None:
    """Held by its control each body is where it is against the others; what spins idly is left out."""
    network = MECHANISMS[name](drive="s")
    rng = np.random.default_rng(seed)
    ground = network.body_names[int(rng.integers(len(network.body_names)))]
    other = scaled(shuffled(rooted(reversed_joints(network, rng), ground), rng), 10.0**power)
    first, second = poses_in(network, {"s": value}), poses_in(other, {"s": value})
    base = np.linalg.inv(first[ground])
    for body in set(first) - set(EXPECTED[name].idle) - {ground}:
        np.testing.assert_allclose(second[body], base @ first[body], rtol=0.0, atol=SAME_POSES)


@pytest.mark.parametrize("name", ["four-bar", "rccc", "coupled loops", "nine revolutes"])
def test_the_motions_do_not_depend_on_where_loops_are_cut(name: str) -> None:
    """The null space, its entries in the order of joints, is the same for every order of joints."""
    network = MECHANISMS[name]()
    places = [(one.name, k) for one in network.joints for k in range(len(one.units))]
    spaces = []
    for k in range(len(network.joints)):
        mechanism = build_mechanism(replace(network, joints=(*network.joints[k:], *network.joints[:k])))
        ways = null_space(evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).jacobian[:, :, 0])
        spaces.append(ways[[mechanism.variable_index[one] for one in places]])
    for one, other in pairwise(spaces):
        assert_same_space(one, other, 1e-9)  # rounding times a condition of the Jacobian below 1e5


# --- Kutzbach by hand


def by_hand(network: Network) -> int:
    """Return 6 (bodies - 1) - sum(6 - f) - elements - (driven freedoms - controls that can be set)."""
    freedoms = {"revolute": 1, "prismatic": 1, "cylindrical": 2, "helical": 1, "global": 3, "user": 0}
    kept = sum(6 - freedoms[one.kind] for one in network.joints)
    taken = sum(value is not None for one in network.joints for value in one.values)
    settable = sum(one.value is None for one in network.controls)
    return 6 * len(network.bodies) - kept - len(network.elements) - taken + settable


def user_slide() -> Joint:
    motion = tuple(map(Expression, ("1", "0", "0", "0", "1", "0", "s", "0.1", "0.2")))
    return Joint("U", "user", ("ground", "b"), motion=motion)


@pytest.mark.parametrize(
    ("network", "figure"),
    [
        (four_bar(), 18 - 20),
        (four_bar(drive="s"), 18 - 20 - 1 + 1),
        (sarrus(), 30 - 30),
        (rssr(), 18 - 5 - 3 - 3 - 5),
        (rccc("s"), 18 - 5 - 4 - 4 - 4 - 1 + 1),
        (nine_revolutes(), 48 - 45),
        (nine_revolutes("s"), 48 - 45 - 3 + 1),
        (coupled_loops(), 30 - 35),
        (rod_platform(), 6 - 6),
        (rod_platform("s"), 6 - 6 + 1),
        (Network("user", (Body("b"),), (user_slide(),), (), (Control("s"),)), 6 - 6 + 1),
    ],
)
def test_the_formula_of_kutzbach_by_hand(network: Network, figure: int) -> None:
    mechanism = build_mechanism(network)
    assert by_hand(network) == figure
    assert analyse_mobility(mechanism, mechanism.start).kutzbach == figure


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_the_formula_of_kutzbach_on_random_networks(seed: int) -> None:
    network = random_network(np.random.default_rng(seed), bodies=5, extra=3, elements=2)
    mechanism = build_mechanism(network)
    found = analyse_mobility(mechanism, mechanism.start)
    assert found.kutzbach == by_hand(network)
    assert found.mobility - found.kutzbach == len(found.redundant)


# --- redundant constraints


def generator_joint(joint: Joint, constraint: str, side: Transform) -> tuple[Joint, Joint]:
    """Return a joint that allows what a constraint ("rotation about m") forbids, and the joint after it."""
    what, _, axis = constraint.split(" ", maxsplit=2)
    m, n, k = side.columns
    along = {"m": m, "n": n, "m x n": k}[axis]
    frame = np.eye(4)
    across = m if axis == "n" else n
    frame[:3, :3] = np.column_stack((across, along, np.cross(across, along)))
    frame[:3, 3] = side.translation
    kind: JointKind = "revolute" if what == "rotation" else "prismatic"
    extra = Joint("extra", kind, (joint.bodies[0], "between"), (transform(frame), transform(frame)))
    return extra, replace(joint, bodies=("between", joint.bodies[1]))


@pytest.mark.slow
@pytest.mark.parametrize("build", [four_bar, bennett, sarrus, coupled_loops])
@pytest.mark.parametrize("seed", range(3))
def test_redundant_constraints_can_be_set_free_together(build: Callable[..., Network], seed: int) -> None:
    """With a joint before each for what it forbids the mobility stays: all of them are redundant at once.

    The mechanisms are drawn at q = 0, so that frames of both bodies are one.
    """
    network = shuffled(build(), np.random.default_rng(seed))
    mechanism = build_mechanism(network)
    found = analyse_mobility(mechanism, mechanism.start)
    assert len(found.redundant) == found.mobility - found.kutzbach
    joints = {one.name: one for one in network.joints}
    bodies = list(network.bodies)
    for k, one in enumerate(found.redundant):
        joint = joints[one.joint]
        extra, behind = generator_joint(joint, one.constraint, joint.frames[0])
        bodies.append(Body(f"between{k}"))
        joints[f"extra{k}"] = replace(extra, name=f"extra{k}", bodies=(extra.bodies[0], f"between{k}"))
        joints[one.joint] = replace(behind, bodies=(f"between{k}", behind.bodies[1]))
    freed = build_mechanism(replace(network, bodies=tuple(bodies), joints=tuple(joints.values())))
    after = analyse_mobility(freed, freed.start)
    assert after.mobility == found.mobility == after.kutzbach
    assert after.redundant == ()


def with_kind(network: Network, kind: JointKind, names: set[str]) -> Network:
    """Return a network some of whose joints are of another kind, their starts 0."""
    joints = tuple(replace(one, kind=kind) if one.name in names else one for one in network.joints)
    return replace(network, joints=joints)


def test_one_hinge_of_a_plane_loop_may_slide_two_may_not() -> None:
    """Revolute becomes cylindrical: what "translation along n" forbids is redundant once in each loop."""
    for name in ("j0", "j1", "j2", "j3"):
        one = facts_of(with_kind(four_bar(), "cylindrical", {name}))
        assert (one.mobility, one.kutzbach, one.redundant) == (1, -1, 2)
    assert facts_of(with_kind(four_bar(), "cylindrical", {"j0", "j2"})).mobility == 2


@pytest.mark.slow
@pytest.mark.parametrize("build", [four_bar, coupled_loops, bennett, sarrus])
@pytest.mark.parametrize("seed", range(3))
def test_joints_of_a_kind_with_the_freedom_leave_the_mobility(
    build: Callable[..., Network], seed: int
) -> None:
    """A revolute joint of which "translation along n" is redundant may be cylindrical."""
    network = shuffled(build(), np.random.default_rng(seed))
    before = facts_of(network)
    mechanism = build_mechanism(network)
    for one in analyse_mobility(mechanism, mechanism.start).redundant:
        if one.constraint == "translation along n":
            after = facts_of(with_kind(network, "cylindrical", {one.joint}))
            assert (after.mobility, after.redundant) == (before.mobility, before.redundant - 1)


def test_a_slide_may_turn_about_its_axis_where_that_is_redundant() -> None:
    """Of a plane loop of three slides all rotation is redundant, and translation along z."""
    network = ring("ppp", np.array([X, Y, (1.0, 1.0, 0.0)]), np.zeros((3, 3)))
    mechanism = build_mechanism(network)
    found = analyse_mobility(mechanism, mechanism.start)
    assert (found.mobility, found.kutzbach, len(found.redundant)) == (1, -3, 4)
    turning = [one for one in found.redundant if one.constraint == "rotation about n"]
    assert turning
    for one in turning:
        assert facts_of(with_kind(network, "cylindrical", {one.joint})).mobility == 1


def test_a_rod_too_many_is_redundant() -> None:
    """A rod beside the crank of a four-bar, from pivot to pivot, forbids nothing new."""
    network = four_bar()
    more = rod("R", ("ground", "b2"), (0.0, 0.0, 0.0), (0.4 * math.cos(0.9), 0.4 * math.sin(0.9), 0.0))
    mechanism = build_mechanism(replace(network, elements=(more,)))
    found = analyse_mobility(mechanism, mechanism.start)
    assert (found.mobility, len(found.redundant)) == (1, 4)
    names = {(one.joint, one.constraint) for one in found.redundant}
    assert ("R", "length") in names
    assert len(names) == 4


def test_a_drive_too_many_is_redundant() -> None:
    """Opposite sides of a parallelogram, driven alike."""
    network = four_bar(1.0, 2.0, 1.0, 2.0, 0.9)
    first, *middle, last = network.joints
    both = (driven(first, "s"), *middle, driven(last, "-s"))
    mechanism = build_mechanism(replace(network, joints=both, controls=(Control("s"),)))
    found = analyse_mobility(mechanism, mechanism.start)
    assert (found.mobility, found.kutzbach, len(found.redundant)) == (1, -3, 4)
    one_drive = replace(network, joints=(both[0], *middle, last), controls=(Control("s"),))
    assert facts_of(one_drive)[:3] == (1, -2, 3)
    assert find_blocked_controls(mechanism, mechanism.start) == ()


# --- special configurations


Special = tuple[int, int, str]  # mobility at a place and near it, and the kind


def special_of(network: Network) -> Special:
    mechanism = build_mechanism(network)
    found = analyse_mobility(mechanism, mechanism.start)
    assert found.special == (found.nearby < found.mobility)
    return found.mobility, found.nearby, found.kind


def in_line(*places: float) -> Network:
    """Return hinges about z on the x axis in a ring."""
    points = np.zeros((len(places), 3))
    points[:, 0] = places
    return ring("r" * len(places), np.tile(Z, (len(places), 1)), points)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("network", "expected"),
    [
        (in_line(0.0, 1.0, 3.0, 2.0), (2, 1, "mechanism")),  # folded parallelogram: 1, 2, 1, 2
        (in_line(0.0, 0.4, 1.6, 1.0), (2, 1, "mechanism")),  # change point: 0.4 + 1.2 = 0.6 + 1.0
        (in_line(0.0, 1.0, 2.5), (1, 0, "structure")),  # two links in line
        (in_line(0.0, 1.0, 0.5), (1, 0, "structure")),  # two links folded
        (four_bar(), (1, 1, "mechanism")),
        (four_bar(1.0, 2.0, 1.0, 2.0, 0.9), (1, 1, "mechanism")),  # parallelogram
        (four_bar(t=1e-3), (1, 1, "mechanism")),
        (bennett(), (1, 1, "mechanism")),
        (bennett(t=2.5), (1, 1, "mechanism")),
        (sarrus(), (1, 1, "mechanism")),
        (rssr(), (2, 2, "mechanism")),
    ],
)  # fmt: skip
@pytest.mark.parametrize("factor", [1.0, 1e-3, 1e3])
def test_special_places_are_told_from_regular_ones(
    network: Network, expected: Special, factor: float
) -> None:
    assert special_of(scaled(network, factor)) == expected


def slider_crank(crank: float, drive: str | None = None) -> Network:
    """Return a crank of 0.3 m at an angle in [rad], a rod of 0.8 m and a slide along x, driven if asked."""
    at = 0.3 * np.array([math.cos(crank), math.sin(crank)])
    slide = at[0] + math.sqrt(0.64 - at[1] ** 2)
    joints = [
        tied("A", "revolute", ("ground", "crank"), Z, ORIGIN),
        tied("B", "revolute", ("crank", "rod"), Z, (float(at[0]), float(at[1]), 0.0)),
        tied("C", "revolute", ("rod", "slider"), Z, (float(slide), 0.0, 0.0)),
        tied("P", "prismatic", ("ground", "slider"), X, ORIGIN),
    ]
    controls: tuple[Control, ...] = ()
    if drive is not None:
        joints[3], controls = driven(joints[3], drive), (Control("s"),)
    bodies = tuple(map(Body, ("crank", "rod", "slider")))
    return Network("slider-crank", bodies, tuple(joints), controls=controls)


@pytest.mark.parametrize("crank", [0.0, math.pi])
def test_at_a_dead_centre_the_slide_is_stuck_but_the_mechanism_is_not_special(crank: float) -> None:
    """The crank still moves it one way; a control of the slide cannot."""
    assert special_of(slider_crank(crank)) == (1, 1, "mechanism")
    mechanism = build_mechanism(slider_crank(crank, "s"))
    found = analyse_mobility(mechanism, mechanism.start)
    assert (found.mobility, found.special) == (1, False)
    assert find_blocked_controls(mechanism, mechanism.start) == ("s",)
    regular = build_mechanism(slider_crank(1.0, "s"))
    assert find_blocked_controls(regular, regular.start) == ()


# --- edges


def test_trees_and_single_joints() -> None:
    one = Network("one", (Body("b"),), (tied("A", "cylindrical", ("ground", "b"), Y, (1.0, 0.0, 0.0)),))
    assert facts_of(one) == moving(2, 2, 0, structure="tree")
    more = (
        tied("B", "global", ("c", "b"), Z, (0.0, 1.0, 0.0)), tied("C", "helical", ("d", "b"), X, ORIGIN, 0.2)
    )  # fmt: skip
    two = replace(one, bodies=(Body("b"), Body("c"), Body("d")), joints=(*one.joints, *more))
    assert facts_of(two) == moving(6, 6, 0, structure="tree")


def test_a_body_on_one_element_has_five_freedoms() -> None:
    single = rod("R", ("ground", "b"), ORIGIN, (0.0, 1.0, 0.0))
    network = Network("free", (Body("b", (0.0,) * 6),), (), (single,))
    assert facts_of(network) == moving(5, 5, 0, structure="tree")


def test_a_bar_between_two_balls_of_the_ground_is_a_structure_that_spins() -> None:
    joints = (
        tied("A", "global", ("ground", "bar"), Z, ORIGIN),
        tied("B", "global", ("bar", "ground"), Z, (1.0, 0.0, 0.0)),
    )
    found = facts_of(Network("bar", (Body("bar"),), joints))
    assert found == Facts(1, 0, 1, ("bar",), False, "structure", "closed chain")


def test_a_spherical_four_bar_moves_although_its_lengths_are_none() -> None:
    """All axes meet in a point, all frames are there: the mechanism's length is 0, and counts as 1."""
    axes = np.array([unit(one) for one in ((0, 0, 1), (0.6, 0, 1), (0.5, 0.9, 0.8), (-0.4, 0.7, 1))])
    network = ring("rrrr", axes, np.zeros((4, 3)))
    assert facts_of(network) == moving(1, -2, 3)
    moved = assemble(build_mechanism(ring("rrrr", axes, np.zeros((4, 3)), "s")), {"s": 0.2})
    poses = moved.assemblies[0].poses
    np.testing.assert_allclose(poses[:, :3, 3], 0.0, rtol=0.0, atol=1e-12)  # the point stays where it is


@pytest.mark.slow
@pytest.mark.parametrize("far", [1e3, 1e6])
@pytest.mark.parametrize("name", ["four-bar", "bennett", "sarrus", "rccc", "coupled loops"])
def test_frames_far_from_the_mechanism_do_not_matter(name: str, far: float) -> None:
    """The origins of bodies are 1000 km away: joints are found near each other all the same.

    Rounding of 1e-10 m stands against lengths of 1 m.
    """
    network = MECHANISMS[name]()
    away = np.eye(4)
    away[:3, 3] = far * np.array([0.6, -0.5, 0.4])
    pairs = [[transform(away @ matrix(frame)) for frame in one.frames] for one in network.joints]
    joints = tuple(replace(one, frames=(a, b)) for one, (a, b) in zip(network.joints, pairs, strict=True))
    mechanism = build_mechanism(replace(network, joints=joints))
    found = analyse_mobility(mechanism, mechanism.start)
    assert (found.mobility, found.kutzbach) == EXPECTED[name][:2]
    assert found.nearby == found.mobility


def test_a_plane_far_from_its_bodys_origin_does_not_matter() -> None:
    """A four-bar whose coupler's point is in the plane of motion, 10,000 km from the origin."""
    far = 1e7
    points = np.array([(0.0, 0.0, 0.0), (0.2, 0.35, 0.0), (1.1, 0.7, 0.0), (1.0, 0.0, 0.0)])
    points[:, :2] += far
    network = ring("rrrr", np.tile(Z, (4, 1)), points)
    ends = (ORIGIN, (far + 0.8, far + 0.5, 0.0))
    plane = ConstraintElement("E", "eg", ("ground", "b2"), Expression("0"), ends, (Z, Z))
    mechanism = build_mechanism(replace(network, elements=(plane,)))
    assert analyse_mobility(mechanism, mechanism.start).mobility == 1


@pytest.mark.parametrize("start", [math.pi, math.pi + 1e-9])
def test_a_control_whose_effect_stands_still_at_its_start_does_not_hide_the_others(start: float) -> None:
    """0.1 cos(s) starts at s = pi with a slope of 1e-17; at s = 2 it is 0.09."""
    network = slider_crank(1.0, "0.1 * cos(s) + 0.1")
    mechanism = build_mechanism(replace(network, controls=(Control("s", start),)))
    found = assemble(mechanism, {"s": 2.0})
    assert analyse_mobility(mechanism, found.x[:, 0]).mobility == 1


def test_a_ring_of_thirty_bodies() -> None:
    rng = np.random.default_rng(30)
    axes = np.array([unit(one) for one in rng.normal(size=(30, 3))])
    network = ring("r" * 30, axes, rng.uniform(-1.0, 1.0, (30, 3)))
    assert facts_of(network) == moving(24, 24, 0)


def test_helices_of_one_pitch_on_one_axis_move_together() -> None:
    """Three screws on an axis: with equal pitches two freedoms, with another pitch one."""

    def screws(pitch: float) -> Network:
        pairs = (("ground", "a"), ("a", "b"), ("b", "ground"))
        joints = [tied(f"H{k}", "helical", pair, Z, ORIGIN, 0.1) for k, pair in enumerate(pairs)]
        return Network("screws", (Body("a"), Body("b")), (*joints[:2], replace(joints[2], pitch=pitch)))

    assert facts_of(screws(0.1)).mobility == 2
    assert facts_of(screws(0.3)).mobility == 1


def test_the_twists_of_the_coupler_of_sarrus_are_one_shift() -> None:
    mechanism = build_mechanism(sarrus())
    assert_same_space(twist_space(mechanism, mechanism.start, "b3"), np.eye(6)[:, 5:], 1e-9)
