"""Solids of an arm that shows nothing: joined, about the axes, of the arm's own size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from urmpipe_models.arm.chain import Box, Capsule, Chain, Cylinder, Joint, Mesh, Sphere, Visual
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain, modified_dh_chain
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import frames_over_log, positions_over_log
from urmpipe_models.math3d import Transform, from_offset, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names

QUARTER = math.pi / 2.0
ROUNDING = 1e-9
"""Share of an arm's length by which sums of its frames in double precision err at most."""


def ends_of(visual: Visual) -> FloatArray:
    """Return both ends of the axis of a shape along z in the frame that carries it, in [m], shape (2, 3)."""
    assert not isinstance(visual.shape, (Sphere, Mesh))
    length = visual.shape.size[2] if isinstance(visual.shape, Box) else visual.shape.length
    return np.array([visual.origin.point((0.0, 0.0, z * length / 2.0)) for z in (-1.0, 1.0)], float)


def on(chain: Chain, joint: str | None) -> tuple[Visual, ...]:
    return tuple(one for one in build_placeholder_solids(chain) if one.joint == joint)


def pieces(solids: Sequence[Visual]) -> list[FloatArray]:
    """Return the ends of the pieces among the solids of a link: capsules."""
    return [ends_of(one) for one in solids if isinstance(one.shape, Capsule)]


def coloured(chain: Chain) -> dict[str, Visual]:
    """Return the solids of the joints that are drawn, by name."""
    colours = {joint.name: (0.1, 0.2, 0.3, 1.0) for joint in chain.joints}
    found = [one for one in build_placeholder_solids(chain, colours) if one.colour is not None]
    return {one.joint: one for one in found if one.joint is not None}


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_solids_can_be_drawn_and_hang_on_joints(chains: SearchStrategy[Chain], data: st.DataObject) -> None:
    chain = data.draw(chains)
    solids = build_placeholder_solids(chain)
    moving = [joint.name for joint in chain.joints if joint.kind != "fixed"]
    assert {one.joint for one in solids} <= {None, *moving}
    assert len(solids) <= 2 + 5 * len(moving) + 5
    for one in solids:
        assert not list(one.faults())
        rotation: FloatArray = np.array(one.origin.rotation, float)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)  # rounding of unit vectors
        assert np.isfinite(ends_of(one)).all()
    assert replace(chain, visuals=solids).visuals == solids  # the chain takes them


@pytest.mark.parametrize("name", robot_names())
def test_links_lead_from_joint_to_joint_without_a_gap_by_cylinders_on_the_axes(name: str) -> None:
    chain = load_robot(name)
    solids = coloured(chain)
    assert list(solids) == list(chain.coordinates)  # of irb60's mimics none
    for joint in chain.moving:
        solid = solids[joint.name]
        assert isinstance(solid.shape, Cylinder)
        np.testing.assert_allclose(np.cross(ends_of(solid), joint.axis), 0.0, atol=1e-15)  # rounding
    moving = [k for k, joint in enumerate(chain.joints) if joint.kind != "fixed"]
    position, rotation = frames_over_log(chain, np.array([[0.3 + 0.2 * k for k in range(len(chain.start))]]))
    for k, following in pairwise([None, *moving[:-1]]):
        frame = 0 if k is None else k + 1
        link = pieces(on(chain, None if k is None else chain.joints[k].name))
        corners = [np.zeros(3), *(end for _, end in link)]
        for corner, (start, _) in zip(corners, link, strict=False):
            np.testing.assert_allclose(start, corner, rtol=0, atol=ROUNDING)
        assert following is not None
        end = position[0, frame] + rotation[0, frame] @ corners[-1]
        np.testing.assert_allclose(end, position[0, following + 1], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("modified", [False, True])
def test_a_link_follows_the_axes_and_their_common_normal(modified: bool) -> None:
    """Link 2 of standard rows is d along z, then a along x; of modified rows a along x, then d along z."""
    rows = [DHRow(d=0.3), DHRow(d=0.2, a=0.4, alpha=QUARTER), DHRow(a=0.3), DHRow(d=0.3)]
    chain = (modified_dh_chain if modified else dh_chain)("arm", rows)
    corners = [end.tolist() for _, end in pieces(on(chain, "q1" if modified else "q2"))]
    expected = [[0.4, 0.0, 0.0], [0.4, -0.2, 0.0]] if modified else [[0.0, 0.0, 0.2], [0.4, 0.0, 0.2]]
    np.testing.assert_allclose(corners, expected, atol=1e-15)  # rounding


@settings(max_examples=60, deadline=None)
@given(alpha=st.floats(-math.pi, math.pi), d=st.floats(-1.0, 1.0), a=st.floats(-1.0, 1.0))
@example(alpha=1e-5, d=0.3, a=0.2)
@example(alpha=1e-3, d=1.0, a=1.0)
def test_no_link_goes_astray(alpha: float, d: float, a: float) -> None:
    """Of axes that are nearly parallel, as calibration finds them, the common normal can be far away."""
    joints = (Joint("a"), Joint("b", origin=Transform() @ from_offset([a, 0.1, d, alpha, 0.0, 0.0])))
    chain = Chain("arm", joints, tip=translation(0.1, 0.0, 0.0))
    lengths = [float(np.linalg.norm(end - start)) for start, end in pieces(on(chain, "a"))]
    assert sum(lengths) <= math.sqrt(3.0) * math.hypot(a, 0.1, d) * (1.0 + 1e-8)


@pytest.mark.parametrize("factor", [1e-3, 1e3, 1e5])
@pytest.mark.parametrize("name", ["urm6", "ur5e", "panda"])
def test_solids_are_as_large_as_their_arm(name: str, factor: float) -> None:
    small = load_robot(name).placed(tool=translation(0.0, 0.02, 0.1))
    lengths = {one.name: factor * one.value for one in small.parameters if one.kind == "along"}
    pair = build_placeholder_solids(small), build_placeholder_solids(small.with_parameters(lengths))
    for one, large in zip(*pair, strict=True):
        np.testing.assert_allclose(ends_of(large), factor * ends_of(one), rtol=1e-6, atol=1e-9 * factor)
        assert type(large.shape) is type(one.shape)
        if isinstance(one.shape, (Capsule, Cylinder)) and isinstance(large.shape, (Capsule, Cylinder)):
            assert large.shape.radius == pytest.approx(factor * one.shape.radius)


@pytest.mark.slow
@pytest.mark.parametrize("joints", [1, 2, 30])
def test_links_are_longer_than_they_are_thick_however_many(joints: int) -> None:
    chain = dh_chain("arm", [DHRow(a=0.1) for _ in range(joints)])
    for name in chain.coordinates:
        *_, link = (one.shape for one in on(chain, name) if not isinstance(one.shape, Sphere))
        assert isinstance(link, (Capsule, Cylinder)) and link.radius < 0.05


def test_an_arm_without_any_length_is_a_joint_on_a_plate() -> None:
    solids = build_placeholder_solids(Chain("arm", (Joint("j"),)))
    assert all(isinstance(one.shape, Cylinder) and 0.01 < one.shape.radius < 0.1 for one in solids)
    assert [one.joint for one in solids] == [None, "j", "j"]


def test_joints_at_one_place_do_not_hide_each_other() -> None:
    """In a spherical wrist the last cylinder stands beyond the middle one; about one line one is drawn."""
    wrist = [DHRow(d=0.4, alpha=-QUARTER), DHRow(alpha=QUARTER), DHRow(d=0.2)]
    solids = coloured(dh_chain("wrist", [DHRow(a=0.4, alpha=QUARTER), *wrist]))
    middle = {name: ends_of(one).mean(axis=0).tolist() for name, one in solids.items()}
    assert middle["q4"][2] > ends_of(solids["q3"])[1][2]
    assert middle["q2"] == middle["q3"] == [0.0, 0.0, 0.0]
    joints = Joint("a"), Joint("b"), Joint("c", axis=(0.0, 1.0, 0.0))
    twice = Chain("twice", joints, tip=translation(1, 0, 0))
    assert list(coloured(twice)) == ["a", "c"]


@pytest.mark.parametrize(
    ("lower", "upper", "rail"),
    [
        (0.0, 0.5, (0.0, 0.5)),
        (-0.2, 0.5, (-0.2, 0.5)),
        (0.2, 0.5, (0.0, 0.5)),  # from where the link before ends
        (-math.inf, math.inf, (-0.7, 0.7)),  # the arm's length
        (-1.7e308, 0.3, (-0.7, 0.3)),  # which stands for none in a URDF
    ],
)
def test_a_sliding_joint_is_a_box_on_a_rail(lower: float, upper: float, rail: tuple[float, float]) -> None:
    slide = Joint("slide", "prismatic", translation(0.0, 0.0, 0.4), (1.0, 0.0, 0.0), lower, upper)
    chain = Chain("arm", (Joint("turn"), slide), tip=translation(0.0, 0.0, 0.3))
    (on_link,) = (one for one in on(chain, "turn") if isinstance(one.shape, Box))
    np.testing.assert_allclose(ends_of(on_link), [(end, 0.0, 0.4) for end in rail], atol=1e-12)
    box = coloured(chain)["slide"]
    assert isinstance(box.shape, Box) and box.origin.translation == (0.0, 0.0, 0.0)
    assert isinstance(on_link.shape, Box) and box.shape.size[0] > on_link.shape.size[0]


def test_a_gantry_of_rails_alone_is_as_thick_as_they_are_long() -> None:
    axes = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)
    joints = [Joint(f"q{k}", "prismatic", axis=axis, lower=0.0, upper=0.8) for k, axis in enumerate(axes)]
    shapes = [one.shape for one in build_placeholder_solids(Chain("gantry", tuple(joints)))]
    assert all(0.01 < min(shape.size) < 0.1 for shape in shapes if isinstance(shape, Box))


@pytest.mark.parametrize("name", robot_names())
def test_the_tool_centre_point_is_in_no_solid(name: str) -> None:
    """Else what is drawn there, such as the worst place, is hidden; on a surface is allowed."""
    chain = load_robot(name)
    q = np.array([chain.start])
    position, rotation = frames_over_log(chain, q)
    (tcp,) = positions_over_log(chain, q)
    carriers = [None, *(joint.name for joint in chain.joints)]
    for one in build_placeholder_solids(chain):
        k = carriers.index(one.joint)
        local = np.array(one.origin.inverse().point(tuple(rotation[0, k].T @ (tcp - position[0, k]))), float)
        assert isinstance(one.shape, (Cylinder, Capsule))
        inside = abs(local[2]) < one.shape.length / 2.0 - ROUNDING
        assert not (inside and math.hypot(*local[:2]) < one.shape.radius)
        if isinstance(one.shape, Capsule):
            assert np.linalg.norm(np.abs(local) - [0.0, 0.0, one.shape.length / 2.0]) > one.shape.radius


def test_a_thin_rod_leads_from_the_flange_to_the_tool_centre_point() -> None:
    chain = load_robot("ur5e")
    tool = translation(0.05, 0.0, 0.2)
    *bare, rod = build_placeholder_solids(chain.placed(tool=tool))
    assert tuple(bare) == build_placeholder_solids(chain)
    last = chain.coordinates[-1]
    flange = [one for one in bare if one.joint == last][-1]
    assert rod.joint == last and isinstance(rod.shape, Cylinder) and isinstance(flange.shape, Cylinder)
    tip: FloatArray = np.array(chain.tip.translation, float)
    tcp: FloatArray = np.array((chain.tip @ tool).translation, float)
    np.testing.assert_allclose(ends_of(flange)[1], tip, atol=1e-12)
    np.testing.assert_allclose(ends_of(rod), [tip, tcp], atol=1e-12)
    assert rod.shape.radius < flange.shape.radius / 2.0
