"""Denavit-Hartenberg elements (eq. 3-5 to 3-7, Craig's parameters), and robots in networks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from random_networks import matrix
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import DHRow, modified_dh_chain
from urmpipe_models.elementwise import FloatArray, cross
from urmpipe_models.kinematics.forward import iter_frames
from urmpipe_models.math3d import Transform, translation
from urmpipe_models.networks.elements import (
    DHElement,
    chain_to_parts,
    control_name,
    element_frame,
    element_to_joint,
)
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.joint_motion import joint_frame
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.parts import Body, Joint
from urmpipe_models.robots.catalogue import load_robot, robot_names

EXACT = 1e-14  # products of a few matrices whose entries are 5 at most, each rounded to 1e-16
ROBOT_EXACT = 1e-12  # some twenty products of matrices, of lengths of 2 m at most

values = st.tuples(*(st.floats(-2.0, 2.0) for _ in range(4)))


def assert_frames(found: Transform, expected: Transform, atol: float = EXACT) -> None:
    np.testing.assert_allclose(matrix(found), matrix(expected), rtol=0, atol=atol)


# --- Denavit-Hartenberg elements


def printed(a: float, alpha: float, s: float, theta: float) -> Transform:
    """The frame as the paper prints it: r, e1 and e2 are its columns."""
    r = (s * math.cos(alpha), a, -s * math.sin(alpha))
    e1 = (math.cos(alpha), 0.0, -math.sin(alpha))
    e2 = (math.sin(alpha) * math.sin(theta), math.cos(theta), math.cos(alpha) * math.sin(theta))
    return Transform(Transform((e1, e2, cross(e1, e2))).columns, r)


def across(joint: Joint, *values: float) -> Transform:
    """R = A_1 T A_2^-1."""
    return joint.frames[0] @ joint_frame(joint, values) @ joint.frames[1].inverse()


@given(values, st.floats(-0.5, 0.5))
def test_the_frame_of_an_element_and_the_motion_of_its_joint_are_the_printed_ones(
    row: tuple[float, float, float, float], pitch: float
) -> None:
    a, alpha, s, theta = row
    assert_frames(element_frame(*row), printed(*row))
    ends = ("b", "c")
    for element, variables in (
        (DHElement("J", "R", a, alpha, s), (theta,)),
        (DHElement("J", "P", a, alpha, theta=theta), (s,)),
        (DHElement("J", "C", a, alpha), (theta, s)),
    ):
        assert_frames(across(element_to_joint(element, ends), *variables), printed(*row))
    helix = across(element_to_joint(DHElement("J", "H", a, alpha, pitch=pitch), ends), theta)
    assert_frames(helix, printed(a, alpha, pitch * theta, theta))


@given(st.lists(values, min_size=1, max_size=5))
def test_an_element_is_a_row_of_modified_parameters(rows: list[tuple[float, float, float, float]]) -> None:
    """With x, y, z of Craig for e2, e3, e1."""
    axes = Transform(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    craig = modified_dh_chain("arm", [DHRow(theta, s, a, alpha) for a, alpha, s, theta in rows])
    here = Transform()
    for row, frame in zip(rows, [*iter_frames(craig, [0.0] * len(rows))][1:], strict=True):
        here = here @ element_frame(*row)
        assert_frames(axes.inverse() @ here @ axes, frame)


ROWS: dict[str, dict[str, Any]] = {
    "A": {"kind": "R", "a": 0.1, "alpha": 0.2, "s": 0.3, "theta": 0.4},
    "B": {"kind": "P", "a": -0.2, "alpha": 1.2, "s": 0.1, "theta": -0.7},
    "C": {"kind": "C", "a": 0.5, "alpha": -0.4, "s": -0.2, "theta": 2.0, "body": "hand"},
    "D": {"kind": "H", "a": 0.3, "alpha": 0.9, "theta": 1.1, "pitch": 0.05},
}


@pytest.mark.parametrize("closed", [False, True])
def test_a_chain_of_all_kinds_ends_in_a_body_or_leads_back_to_the_ground(closed: bool) -> None:
    network = load_network({"dh": {"closed": closed, "elements": ROWS}})
    bodies = ["A.body", "B.body", "hand", "ground" if closed else "D.body"]
    assert [joint.bodies for joint in network.joints] == [*zip(["ground", *bodies], bodies, strict=False)]
    assert network.bodies == tuple(Body(name) for name in bodies if name != "ground")
    mechanism = build_mechanism(network)
    poses = mechanism.poses(mechanism.start)
    here = expected = Transform()
    for joint, row in zip(network.joints, ROWS.values(), strict=True):
        s = row["pitch"] * row["theta"] if row["kind"] == "H" else row["s"]
        expected = expected @ printed(row["a"], row["alpha"], s, row["theta"])
        here = here @ across(joint, *joint.start)
        assert_frames(here, expected)
        if not closed:
            assert_frames(poses[joint.bodies[1]], expected)


# --- robots


def check_poses(network: Network, chain: Chain, q: FloatArray, rail: float = 0.0) -> None:
    """Compare an arm on a rail with the frames of its chain; a control drives joints that others follow."""
    mechanism = build_mechanism(network)
    values = {"rail": np.full_like(q[0], rail)}
    for key, row in zip(chain.coordinates, q, strict=True):
        values[f"arm.{key}"] = values[control_name("arm", key)] = row
    poses = mechanism.poses(np.array([values[variable.owner] for variable in mechanism.variables]))
    moving = [translation(0.0, rail, 0.0) @ frame for frame in iter_frames(chain, list(q))][1:]
    expected = {f"arm.{joint.name}": frame for joint, frame in zip(chain.joints, moving, strict=True)}
    expected["arm.tool"] = moving[-1] @ chain.tip @ chain.tool
    for body, frame in expected.items():
        found = (*poses[body].rotation, poses[body].translation)
        for row, expected_row in zip(found, (*frame.rotation, frame.translation), strict=True):
            for a, b in zip(row, expected_row, strict=True):
                np.testing.assert_allclose(a, b, rtol=0, atol=ROBOT_EXACT, err_msg=body)


@pytest.mark.parametrize("robot", robot_names())
def test_a_robot_on_a_rail_moves_as_its_chain_within_its_limits(robot: str) -> None:
    network = load_network(
        {
            "bodies": {"carriage": {}},
            "joints": {"rail": {"kind": "prismatic", "bodies": ["ground", "carriage"]}},
            "chains": {"arm": {"robot": robot, "body": "carriage"}},
        }
    )
    chain = load_robot(robot)
    bodies = [f"arm.{joint.name}" for joint in chain.joints]
    assert [body.name for body in network.bodies] == ["carriage", *bodies, "arm.tool"]
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (len(chain.coordinates), 7))
    check_poses(network, chain, q, rail=0.3)
    start = {f"arm.{key}": (value,) for key, value in zip(chain.coordinates, chain.start, strict=True)}
    assert all(joint.start == start[joint.name] for joint in network.joints if joint.name in start)
    assert {joint.name: joint.limits for joint in network.joints if joint.limits} == {
        f"arm.{joint.name}": ((joint.lower, joint.upper),)
        for joint in chain.joints
        if joint.kind != "fixed" and (math.isfinite(joint.lower) or math.isfinite(joint.upper))
    }


@pytest.mark.slow
@given(st.data())
def test_any_chain_moves_as_its_frames(chains: SearchStrategy[Chain], data: DataObject) -> None:
    chain = data.draw(chains)
    parts = chain_to_parts("arm", chain, "ground", chain.start, {})
    network = Network("arm", parts.bodies, parts.joints, (), parts.controls)
    rows = st.lists(st.floats(-3.0, 3.0), min_size=len(chain.coordinates), max_size=len(chain.coordinates))
    check_poses(network, chain, np.array([data.draw(rows)]).T)
