"""Networks as results: those that come along, a chain, a tree, and one of each kind of joint and element."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from itertools import pairwise

from urmpipe_models.elementwise import ZERO, Vector
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.parts import Body, ConstraintElement, Control, Expression, Joint, frame_from_axes
from urmpipe_pipeline.networks.finding import Search, find_network
from urmpipe_pipeline.networks.result import NetworkResult

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def at(a: Vector, n: Vector = Y) -> Transform:
    """Return a frame at a point in [m] whose n is given, y or z."""
    return frame_from_axes(X, n, a)


def hinge(name: str, bodies: tuple[str, str], first: Vector, start: float) -> Joint:
    """Return a joint about y at a point in [m] of the first body and the origin of the second."""
    return Joint(name, "revolute", bodies, (at(first), at(ZERO)), start=(start,))


def chain() -> Network:
    """Return eight links in a row, a brace beside each pair of them, that make loops."""
    names = ["ground", *(f"link{k}" for k in range(1, 9))]
    joints = [hinge(f"A{k}", pair, (0.2, 0.0, 0.0), 0.2) for k, pair in enumerate(pairwise(names), 1)]
    braces = [
        ConstraintElement(f"brace{k}", "gg", pair, Expression("0.3"), ((0.0, 0.0, 0.1), (0.1, 0.0, 0.1)))
        for k, pair in enumerate(pairwise(names[::2]), 1)
    ]
    return Network("chain", tuple(map(Body, names[1:])), tuple(joints), tuple(braces))


def tree() -> Network:
    """Return a trunk with branches, and branches of these."""
    pairs = [("ground", "trunk"), *(("trunk", name) for name in ("left", "right", "top"))]
    pairs += [("left", "hand"), ("left", "thumb"), ("right", "tool")]
    joints = [hinge(f"J{k}", pair, (0.05 * k, 0.0, 0.3), 0.4 * k) for k, pair in enumerate(pairs, 1)]
    return Network("tree", tuple(Body(name) for _, name in pairs), tuple(joints))


def zoo() -> Network:
    """Return each kind of joint in a row, and each kind of element, which do not close."""
    ends = [("ground", "b1"), *((f"b{k}", f"b{k + 1}") for k in range(1, 6))]
    y, z = (at((0.3, 0.0, 0.0)), at(ZERO)), (at((0.3, 0.0, 0.0), Z), at(ZERO, Z))
    texts = ("cos(s)", "sin(s)", "0", "-sin(s)", "cos(s)", "0", "0.05", "0", "s / 10")
    joints = (
        Joint("revo", "revolute", ends[0], y, (0.3,)),
        Joint("pris", "prismatic", ends[1], z, (0.1,)),
        Joint("cyli", "cylindrical", ends[2], y, (0.2, 0.1)),
        Joint("heli", "helical", ends[3], z, (1.0,), pitch=0.02),
        Joint("glob", "global", ends[4], y, (0.1, 0.2, 0.3)),
        Joint("user", "user", ends[5], z, motion=tuple(map(Expression, texts))),
    )
    rod = ConstraintElement(
        "rod", "gg", ("ground", "b2"), Expression("0.5"), ((0.0, 0.3, 0.0), (0.1, 0.0, 0.0))
    )
    table = ConstraintElement(
        "table", "eg", ("ground", "b3"), Expression("0.2"), (ZERO, (0.2, 0.0, 0.1)), (Z, Y)
    )
    skew = ConstraintElement(
        "skew", "crc", ("b1", "b4"), Expression("0.2 + s"), ((0.1, 0.0, 0.2), (0.2, 0.1, 0.1)), (X, Y)
    )
    tube = ConstraintElement(
        "tube", "gc", ("ground", "b6"), Expression("0.1"), ((0.9, 0.3, 0.0), (0.1, 0.0, 0.0)), (Z, Y)
    )
    bodies = tuple(Body(name) for _, name in ends)
    return Network("zoo", bodies, joints, (rod, table, skew, tube), (Control("s", 0.4, 0.0, 1.0),))


def bars(coupler: float = 0.3) -> Network:
    """Return a crank that a control drives, a coupler of a length in [m], and a rocker on a base."""
    crank, base = (0.1, 0.0, 0.0), (0.3, 0.0, 0.0)
    joints = (
        Joint("A", "revolute", ("ground", "crank"), values=(Expression("s"),)),
        hinge("B", ("crank", "coupler"), crank, 0.3),
        Joint(
            "C", "revolute", ("coupler", "rocker"), (at((coupler, 0.0, 0.0)), at((0.25, 0.0, 0.0))), (1.0,)
        ),
        hinge("D", ("ground", "rocker"), base, -1.9),
    )
    bodies = (Body("crank"), Body("coupler"), Body("rocker"))
    return Network("bars", bodies, joints, controls=(Control("s", -0.8),))


MADE: Mapping[str, Callable[[], Network]] = {
    "chain": chain,
    "tree": tree,
    "zoo": zoo,
    "bars": bars,
    "too long": lambda: replace(bars(0.6), name="too long"),
}

SHIPPED = ("rssr", "stewart-gough", "nine-revolute-controlled", "screw-jack", "cluster-gc")
"""Networks that come along: with balls, six rods, a ring of nine, what slides, and tubes."""

NAMES = (*MADE, *SHIPPED)


@cache
def found(name: str, *, every: bool = False) -> NetworkResult:
    """Return what is found of a network by its name."""
    network = MADE[name]() if name in MADE else load_network(name)
    return find_network(network, "solve", Search({}, every=every, restarts=100))
