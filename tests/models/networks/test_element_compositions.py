"""Each constraint element is a composition of joints: the same mobility, and the same motions of its body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import random_networks as rn
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.networks.closure import evaluate_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.joint_motion import measure_element
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility
from urmpipe_models.networks.parts import Body, ConstraintElement, ElementKind, Expression, Joint, JointKind

CLOSES = 1e-12  # residuals in [m] and [rad]: products of some ten matrices with entries up to 10
SAME = 1e-6  # projections onto twist spaces: differences of 1e-12 times the networks' conditions, below 1e5
X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
NETWORKS = 5  # of each kind and each number of other elements, 0 to 4: 100


class Composition(NamedTuple):
    """Bodies and joints in the place of an element, and how many idle spins they have."""

    bodies: tuple[str, ...]
    joints: tuple[Joint, ...]
    idle: tuple[str, ...] = ()


def compose(element: ConstraintElement, poses: rn.Poses, rng: np.random.Generator) -> Composition:
    """Return what moves as an element does where its bodies have these poses."""
    a, b = element.bodies
    first, second = poses[a], poses[b]
    p = first[:3, :3] @ np.array(element.points[0]) + first[:3, 3]
    q = second[:3, :3] @ np.array(element.points[1]) + second[:3, 3]
    n, other = first[:3, :3] @ np.array(element.normals[0]), second[:3, :3] @ np.array(element.normals[1])

    def joint(kind: JointKind, first: str, second: str, at: FloatArray, n: FloatArray | None = None) -> Joint:
        """Return a joint at a point in [m], along an axis [-] unless it is global."""
        frame = rn.random_pose(rng) if n is None else rn.axis_frame(n, at, rng)
        frame[:3, 3] = at
        return rn.joint_between(f"{first} {second}", kind, (first, second), poses, rng, frame)

    if element.kind == "gg":  # a rod with a global joint at each end, which spins
        ends = (joint("global", a, "rod", p), joint("global", "rod", b, q))
        return Composition(("rod",), ends, idle=("rod",))
    if element.kind == "gc":  # a rod across the axis of a cylindrical joint, a global joint at its end
        return Composition(("rod",), (joint("cylindrical", a, "rod", p, n), joint("global", b, "rod", q)))
    if element.kind == "eg":  # two slides in the plane across each other, and a global joint at the point
        u = rn.unit(np.cross(n, rng.normal(size=3)))
        slides = joint("prismatic", a, "slide", q, u), joint("prismatic", "cross", "slide", q, np.cross(n, u))
        return Composition(("slide", "cross"), (*slides, joint("global", "cross", b, q)))
    # a cylindrical joint on each line, a revolute along their common perpendicular between both
    u = rn.unit(np.cross(n, other))
    foot = p + np.linalg.solve(np.column_stack((n, -other, u)), q - p)[0] * n
    sleeves = joint("cylindrical", a, "sleeve", p, n), joint("cylindrical", "cross", b, q, other)
    return Composition(("sleeve", "cross"), (*sleeves, joint("revolute", "sleeve", "cross", foot, u)))


def both(kind: ElementKind, others: int, seed: int) -> tuple[Network, Network, Composition]:
    """Return a platform on some random elements and one of a kind, and with that one composed of joints."""
    rng = np.random.default_rng((seed, others, rn.ELEMENTS.index(kind)))
    names = ("platform", "rod", "slide", "cross", "sleeve")
    poses = {name: rn.random_pose(rng) for name in names} | {"ground": np.eye(4)}
    swapped = rng.random() < 0.5
    bodies = ("platform", "ground") if swapped else ("ground", "platform")
    element = rn.element_between("E", kind, bodies, poses, rng)
    more = [
        rn.element_between(f"e{k}", rn.ELEMENTS[int(rng.integers(4))], ("ground", "platform"), poses, rng)
        for k in range(others)
    ]
    built = compose(element, poses, rng)
    start = rn.start_of(poses["platform"])
    first = Network("element", (Body("platform", start),), (), (*more, element))
    second = Network("joints", (Body("platform"), *map(Body, built.bodies)), built.joints, tuple(more))
    return first, second, built


@pytest.mark.slow
@pytest.mark.parametrize("kind", rn.ELEMENTS)
@pytest.mark.parametrize("others", range(5))
def test_an_element_equals_its_joints_on_a_hundred_networks(kind: ElementKind, others: int) -> None:
    for seed in range(NETWORKS):
        first, second, built = both(kind, others, seed)
        of_element, of_joints = build_mechanism(first), build_mechanism(second)
        x, y = of_element.start, of_joints.start
        for mechanism, at in ((of_element, x), (of_joints, y)):
            assert np.abs(evaluate_closure(mechanism, at[:, np.newaxis]).residual).max(initial=0.0) < CLOSES
        rotation: FloatArray = np.array(of_joints.poses(y.tolist())["platform"].rotation)
        rn.assert_close(rotation, np.array(of_element.poses(x.tolist())["platform"].rotation), CLOSES)
        one, other = analyse_mobility(of_element, x), analyse_mobility(of_joints, y)
        assert one.mobility == 5 - others
        assert other.passive == built.idle
        assert other.mobility - len(other.passive) == one.mobility
        assert other.kutzbach - len(other.passive) == one.kutzbach
        assert one.redundant == other.redundant == ()
        space = rn.twist_space(of_element, x, "platform")
        assert space.shape == (6, 5 - others)
        rn.assert_same_space(space, rn.twist_space(of_joints, y, "platform"), SAME)


@pytest.mark.parametrize("kind", rn.ELEMENTS)
def test_an_element_holds_wherever_its_joints_move(kind: ElementKind) -> None:
    """The composition's loop is opened: wherever its joints are set, the element is satisfied."""
    rng = np.random.default_rng(1)
    for seed in range(NETWORKS):
        first, second, _ = both(kind, 0, seed)
        element = first.elements[0]
        mechanism = build_mechanism(second)
        for _ in range(5):
            x = rng.uniform(-2.0, 2.0, len(mechanism.variables))
            poses = mechanism.poses(x.tolist())
            distance = float(measure_element(element, *(poses[name] for name in element.bodies)).distance)
            # points up to some 4 m away, eps each; crc's distance has no sign
            assert distance == pytest.approx(float(element.length.value({})), abs=1e-12)


def test_lines_that_meet_have_a_twist_space_of_five_as_well() -> None:
    """d = 0: the joints' composition has no perpendicular of its own there, the lines' normal serves."""
    lines = ConstraintElement("E", "crc", ("ground", "b"), Expression("0.0"), normals=(Z, X))
    network = Network("lines", (Body("b", (0.3, 0.0, 0.2, 0.0, 0.3, 0.0)),), (), (lines,))
    mechanism = build_mechanism(network)
    x = mechanism.start
    assert np.abs(evaluate_closure(mechanism, x[:, np.newaxis]).residual).max() == 0.0
    found = analyse_mobility(mechanism, x)
    assert (found.mobility, found.special) == (5, False)
    rng = np.random.default_rng(0)
    pose = rn.matrix(mechanism.poses(x.tolist())["b"])
    poses = {"ground": np.eye(4), "b": pose, "sleeve": rn.random_pose(rng), "cross": rn.random_pose(rng)}
    built = compose(network.elements[0], poses, rng)
    composed = build_mechanism(Network("joints", (Body("b"), Body("sleeve"), Body("cross")), built.joints))
    other = rn.twist_space(composed, composed.start, "b")
    rn.assert_same_space(rn.twist_space(mechanism, x, "b"), other, SAME)
