"""Random chains."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from urmpipe_models import drives as driving
from urmpipe_models.arm import chain as arms
from urmpipe_models.arm.chain import Chain, Inertial, Joint, JointKind, Shape, Visual
from urmpipe_models.arm.denavit_hartenberg import DHRow
from urmpipe_models.math3d import Transform, from_offset

lengths = st.floats(-1.0, 1.0, allow_subnormal=False)
angles = st.floats(-math.pi, math.pi, allow_subnormal=False) | st.sampled_from(
    [0.0, math.pi / 2, -math.pi / 2, math.pi]
)
kinds: SearchStrategy[JointKind] = st.sampled_from(["revolute", "prismatic"])
texts = st.text(
    st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff"), max_size=20
)

# Strategies are made once: what they are made of is checked anew for each that is made while drawing.
frames = st.just(Transform()) | st.tuples(lengths, lengths, lengths, angles, angles, angles).map(from_offset)


def direction(polar: float, azimuth: float) -> tuple[float, float, float]:
    x, y, z = math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


some_axes = st.sampled_from([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
axes = some_axes | st.builds(direction, angles, angles)
limits = st.just((-math.inf, math.inf)) | st.tuples(lengths, lengths).map(sorted)
rates = st.floats(0.1, 10.0) | st.just(math.inf)
moving: SearchStrategy[JointKind] = st.sampled_from(["revolute", "revolute", "prismatic", "fixed"])
one_in_four = st.sampled_from([True, False, False, False])
counts = st.integers(1, 7)


@st.composite
def random_chains(draw: DrawFn) -> Chain:
    """A chain of one to seven joints of every kind, mimics and sensor frames among them."""
    chosen, leaders = list[Joint](), list[str]()
    for k in range(draw(counts)):
        name, kind = f"j{k}", draw(moving)
        if kind == "fixed" and leaders:
            chosen.append(Joint(name, "fixed", draw(frames)))
            continue
        kind = "revolute" if kind == "fixed" else kind
        mimic = None
        if leaders and bool(draw(one_in_four)):
            mimic = arms.Mimic(draw(st.sampled_from(leaders)), draw(lengths), draw(lengths))
        else:
            leaders.append(name)
        lower, upper = draw(limits)
        most = draw(rates), draw(rates), draw(rates)
        chosen.append(Joint(name, kind, draw(frames), draw(axes), lower, upper, *most, mimic))
    start = tuple(draw(lengths) for _ in leaders)
    name, description, source = draw(texts), draw(texts), draw(texts)
    base, tip, tool = draw(frames), draw(frames), draw(frames)
    return Chain(name, tuple(chosen), tip, base, tool, start, description, source)


points = st.tuples(st.floats(0.01, 5.0), lengths, lengths, lengths)
above_zero = st.floats(1e-6, 1e4)


@st.composite
def inertials(draw: DrawFn, joint: str | None) -> Inertial:
    """The mass and inertia of three points about the origin, at a centre of its own."""
    masses, xs, ys, zs = np.array([draw(points) for _ in range(3)]).T
    xx, yy, zz, xy, xz, yz = (
        float((masses * a * b).sum()) for a, b in ((xs, xs), (ys, ys), (zs, zs), (xs, ys), (xs, zs), (ys, zs))
    )
    inertia = (yy + zz, xx + zz, xx + yy, -xy, -xz, -yz)
    centre = draw(lengths), draw(lengths), draw(lengths)
    return Inertial(joint, float(masses.sum()), centre, inertia, draw(texts))


drive_values = st.builds(driving.Drive, *[above_zero] * 7)
gains = st.builds(driving.Gains, lengths, lengths, lengths)
springs = st.just(driving.NO_SPRING) | st.builds(driving.CounterbalanceSpring, above_zero, lengths)


def drives(joint: str) -> SearchStrategy[driving.JointDrive]:
    """A passive joint, or one with a drive and a controller."""
    name = st.just(joint)
    passive = st.builds(driving.PassiveJoint, name, above_zero, above_zero)
    driven = st.builds(driving.DrivenJoint, name, drive_values, above_zero, gains, above_zero, springs)
    return passive | driven


sizes = st.floats(0.0, 2.0)
factors = st.floats(-2.0, 2.0)
shares = st.floats(0.0, 1.0)
paths = st.sampled_from(["file:///nowhere/a%20b.stl", "package://p/b & c.obj"])
shapes: SearchStrategy[Shape] = st.one_of(
    st.builds(arms.Box, st.tuples(sizes, sizes, sizes)),
    st.builds(arms.Cylinder, sizes, sizes),
    st.builds(arms.Capsule, sizes, sizes),
    st.builds(arms.Sphere, sizes),
    st.builds(arms.Mesh, paths, st.tuples(factors, factors, factors)),
)
colours = st.none() | st.tuples(shares, shares, shares, shares)


@st.composite
def random_heavy_chains(draw: DrawFn) -> Chain:
    """A random chain with masses, shapes on its base and its joints, and some drives."""
    chain = draw(random_chains())
    carriers = [None, *(joint.name for joint in chain.joints)]
    masses = [draw(inertials(one)) for one in carriers for _ in range(draw(st.integers(0, 2)))]
    driven = [draw(drives(one)) for one in chain.coordinates if draw(st.booleans())]
    visuals = draw(
        st.lists(st.builds(Visual, st.sampled_from(carriers), shapes, frames, colours), max_size=4)
    )
    return replace(
        chain,
        inertials=tuple(masses),
        gravity=(draw(lengths), draw(lengths), draw(lengths)),
        left_out=tuple(draw(st.lists(texts, max_size=2))),
        drives=tuple(driven),
        visuals=tuple(visuals),
    )


dh_row = st.builds(DHRow, theta=angles, d=lengths, a=lengths, alpha=angles, kind=kinds)


@pytest.fixture(scope="session")
def chains() -> SearchStrategy[Chain]:
    return random_chains()


@pytest.fixture(scope="session")
def heavy_chains() -> SearchStrategy[Chain]:
    return random_heavy_chains()


@pytest.fixture(scope="session")
def dh_rows() -> SearchStrategy[list[DHRow]]:
    """One to seven rows of DH parameters, prismatic joints among them."""
    return st.lists(dh_row, min_size=1, max_size=7)
