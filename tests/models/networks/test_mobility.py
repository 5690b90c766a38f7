"""Mobility: laws of mechanisms however they are written; `mobility.cases` has the numbers of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest

import random_networks as rn
from known_mechanisms import MECHANISMS, X, Y, bennett, coupled_loops, four_bar, ring, sarrus
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import Transform, translation
from urmpipe_models.networks.assembly import assemble
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.mobility import Mobility, RedundantConstraint, analyse_mobility
from urmpipe_models.networks.parts import Body, Expression, Joint, JointKind, frame_from_axes

SAME_POSES = 1e-8  # lengths of the mechanism and rad: descent ends at gaps below 1e-14, conditions below 1e5


class Facts(NamedTuple):
    """What does not depend on how a network is written."""

    mobility: int
    nearby: int
    kutzbach: int
    redundant: int
    idle: tuple[str, ...] = ()
    kind: str = "mechanism"
    structure: str = "closed chain"


def start_mobility(network: Network) -> Mobility:
    mechanism = build_mechanism(network)
    return analyse_mobility(mechanism, mechanism.start)


def facts_of(network: Network) -> Facts:
    """Return the facts of a network that closes at its start, in lengths of the mechanism."""
    mechanism, found = build_mechanism(network), start_mobility(network)
    residual = evaluate_closure(mechanism, mechanism.start[:, np.newaxis]).residual
    assert np.abs(residual * mechanism.row_scales[:, np.newaxis]).max(initial=0.0) < 1e-12
    assert found.kutzbach == kutzbach_by_hand(network)
    assert found.special == (found.nearby < found.mobility)
    redundant = len(found.redundant)
    assert redundant == mechanism.rows - found.rank == found.mobility - found.kutzbach
    return Facts(
        found.mobility, found.nearby, found.kutzbach, redundant, found.passive, found.kind,
        mechanism.graph.structure,
    )  # fmt: skip


def kutzbach_by_hand(network: Network) -> int:
    """Return 6 (bodies - 1) - sum(6 - f) - elements - (driven freedoms - controls that can be set)."""
    freedoms = {"revolute": 1, "prismatic": 1, "cylindrical": 2, "helical": 1, "global": 3, "user": 0}
    kept = sum(6 - freedoms[one.kind] for one in network.joints)
    taken = sum(value is not None for one in network.joints for value in one.values)
    settable = sum(one.value is None for one in network.controls)
    return 6 * len(network.bodies) - kept - len(network.elements) - taken + settable


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
            points=(rn.vec(factor * np.array(one.points[0])), rn.vec(factor * np.array(one.points[1]))),
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
    network = reversed_joints(rn.reframed(network, rng) if is_tied else network, rng)
    names = network.body_names if is_tied else (network.ground,)
    return shuffled(rooted(network, names[int(rng.integers(len(names)))]), rng)


WRITTEN = [(name, seed) for name in MECHANISMS for seed in range(5)]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [*WRITTEN, *(("random", seed) for seed in range(20))])
def test_units_order_ground_and_cuts_do_not_matter(name: str, seed: int) -> None:
    """Of known mechanisms, and of random networks: joints of all kinds and elements of all kinds."""
    rng, more = np.random.default_rng(seed), seed % 2
    is_random = name == "random"
    network = (
        rn.random_network(rng, 4 + more, 2 + more, 1 + more) if is_random else MECHANISMS[name](drive="s")
    )
    expected = facts_of(network)
    found = facts_of(scaled(rewritten(network, seed), float(10.0 ** rng.integers(-4, 5))))
    assert found._replace(idle=()) == expected._replace(idle=())
    assert len(found.idle) == len(expected.idle)


def closed_poses(network: Network, control: float) -> dict[str, FloatArray]:
    """Return the poses of the assembly nearest to the start, translations in lengths of the mechanism."""
    mechanism = build_mechanism(network)
    found = assemble(mechanism, {"s": control})
    assert (found.elsewhere, found.continuum) == (False, 0)
    poses = found.assemblies[0].poses.copy()
    poses[:, :3, 3] /= mechanism.length
    return dict(zip(network.body_names, poses, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), WRITTEN)
def test_closed_poses_do_not_depend_on_how_a_network_is_written(name: str, seed: int) -> None:
    """With a control each body is where it is against the others; what spins idly is left out."""
    network, rng = MECHANISMS[name](drive="s"), np.random.default_rng(seed)
    value, factor = rng.uniform(-0.03, 0.05), float(10.0 ** rng.integers(-3, 4))  # rccc ends before -0.05
    ground = network.body_names[int(rng.integers(len(network.body_names)))]
    other = scaled(shuffled(rooted(reversed_joints(network, rng), ground), rng), factor)
    first, second = closed_poses(network, value), closed_poses(other, value)
    base = np.linalg.inv(first[ground])
    for body in set(first) - set(start_mobility(network).passive) - {ground}:
        np.testing.assert_allclose(second[body], base @ first[body], rtol=0.0, atol=SAME_POSES)


@pytest.mark.parametrize("name", ["four-bar", "rccc", "coupled loops", "nine revolutes"])
def test_the_motions_do_not_depend_on_where_loops_are_cut(name: str) -> None:
    """The null space, its entries in the order of joints, is the same for every order of joints."""
    network = MECHANISMS[name]()
    places = [(one.name, k) for one in network.joints for k in range(len(one.units))]
    spaces = []
    for k in range(len(network.joints)):
        mechanism = build_mechanism(replace(network, joints=(*network.joints[k:], *network.joints[:k])))
        ways = rn.closed_motions(mechanism, mechanism.start)
        spaces.append(ways[[mechanism.variable_index[one] for one in places]])
    for one, other in pairwise(spaces):
        rn.assert_same_space(one, other, 1e-9)  # rounding times a condition of the Jacobian below 1e5


# --- redundant constraints


def slides(drive: str | None = None) -> Network:
    """Return a plane loop of three slides: all rotation is redundant, and translation along z."""
    return ring("ppp", np.array([X, Y, (1.0, 1.0, 0.0)]), np.zeros((3, 3)), drive)


def set_free(network: Network, redundant: RedundantConstraint, number: int) -> Network:
    """Return a network with a joint more that allows what a constraint ("rotation about m") forbids.

    The mechanisms are drawn at q = 0, so that frames of both bodies are one.
    """
    what, _, axis = redundant.constraint.split(" ", maxsplit=2)
    (joint,) = (joint for joint in network.joints if joint.name == redundant.joint)
    m, n, k = joint.frames[0].columns
    across, along = {"m": (n, m), "n": (m, n), "m x n": (m, k)}[axis]
    frame = frame_from_axes(across, along, joint.frames[0].translation)
    kind: JointKind = "revolute" if what == "rotation" else "prismatic"
    between = Body(f"between{number}")
    extra = Joint(f"extra{number}", kind, (joint.bodies[0], between.name), (frame, frame))
    behind = replace(joint, bodies=(between.name, joint.bodies[1]))
    joints = (extra, *(behind if one is joint else one for one in network.joints))
    return replace(network, bodies=(*network.bodies, between), joints=joints)


@pytest.mark.slow
@pytest.mark.parametrize("build", [four_bar, bennett, sarrus, coupled_loops, slides])
@pytest.mark.parametrize("seed", range(3))
def test_redundant_constraints_can_be_set_free_together(build: Callable[..., Network], seed: int) -> None:
    """With a joint before each for what it forbids the mobility stays: all of them are redundant at once."""
    network = shuffled(build(), np.random.default_rng(seed))
    before = start_mobility(network)
    for number, constraint in enumerate(before.redundant):
        network = set_free(network, constraint, number)
    after = start_mobility(network)
    assert after.mobility == before.mobility == after.kutzbach
    assert after.redundant == ()


# --- edges


@pytest.mark.slow
@pytest.mark.parametrize("far", [1e3, 1e6])
@pytest.mark.parametrize("name", ["four-bar", "bennett", "sarrus", "rccc", "coupled loops"])
def test_frames_far_from_the_mechanism_do_not_matter(name: str, far: float) -> None:
    """The origins of bodies are 1000 km away: joints are found near each other all the same.

    Rounding of 1e-10 m stands against lengths of 1 m.
    """
    network = MECHANISMS[name]()
    away = translation(0.6 * far, -0.5 * far, 0.4 * far)
    joints = tuple(
        replace(one, frames=(away @ one.frames[0], away @ one.frames[1])) for one in network.joints
    )
    found = start_mobility(replace(network, joints=joints))
    assert (found.mobility, found.nearby, found.kutzbach) == facts_of(network)[:3]
