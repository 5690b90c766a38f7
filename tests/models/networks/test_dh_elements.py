"""Joint-body elements: their frames against eq. 3-5 to 3-7, and against Craig's modified parameters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.arm.geometric_models import DHRow, modified_dh_chain
from urmpipe_models.elementwise import FloatArray, cross
from urmpipe_models.kinematics.forward import iter_frames
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.elements import DHElement, element_frame, element_to_joint
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.joint_motion import joint_frame
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.parts import Body, Joint

EXACT = 1e-14
"""Products of a few matrices whose entries are 5 at most, each rounded to 1e-16."""

values = st.tuples(*(st.floats(-2.0, 2.0) for _ in range(4)))


def printed(a: float, alpha: float, s: float, theta: float) -> Transform:
    """The frame as the paper prints it: r, e1 and e2 are its columns."""
    r = (s * math.cos(alpha), a, -s * math.sin(alpha))
    e1 = (math.cos(alpha), 0.0, -math.sin(alpha))
    e2 = (math.sin(alpha) * math.sin(theta), math.cos(theta), math.cos(alpha) * math.sin(theta))
    return Transform(Transform((e1, e2, cross(e1, e2))).columns, r)


def matrix(frame: Transform) -> FloatArray:
    return np.array([[*row, p] for row, p in zip(frame.rotation, frame.translation, strict=True)], float)


def across(joint: Joint, *values: float) -> Transform:
    """R = A_1 T A_2^-1."""
    return joint.frames[0] @ joint_frame(joint, values) @ joint.frames[1].inverse()


@given(values)
def test_the_frame_of_an_element_is_the_printed_one(row: tuple[float, float, float, float]) -> None:
    np.testing.assert_allclose(matrix(element_frame(*row)), matrix(printed(*row)), rtol=0, atol=EXACT)


@given(values, st.floats(-0.5, 0.5))
def test_the_joint_of_each_kind_moves_by_the_printed_frame(
    row: tuple[float, float, float, float], pitch: float
) -> None:
    a, alpha, s, theta = row
    moved = {
        "R": across(element_to_joint(DHElement("J", "R", a, alpha, s), ("b", "c")), theta),
        "P": across(element_to_joint(DHElement("J", "P", a, alpha, theta=theta), ("b", "c")), s),
        "C": across(element_to_joint(DHElement("J", "C", a, alpha), ("b", "c")), theta, s),
    }
    for frame in moved.values():
        np.testing.assert_allclose(matrix(frame), matrix(printed(*row)), rtol=0, atol=EXACT)
    helix = across(element_to_joint(DHElement("J", "H", a, alpha, pitch=pitch), ("b", "c")), theta)
    expected = printed(a, alpha, pitch * theta, theta)
    np.testing.assert_allclose(matrix(helix), matrix(expected), rtol=0, atol=EXACT)


def test_the_given_number_of_a_variable_is_its_start() -> None:
    rows = [DHElement("J", kind, s=0.1, theta=0.2) for kind in "RPCH"]
    assert [element_to_joint(row, ("b", "c")).start for row in rows] == [(0.2,), (0.1,), (0.2, 0.1), (0.2,)]


@given(st.lists(values, min_size=1, max_size=5))
def test_an_element_is_a_row_of_modified_parameters(rows: list[tuple[float, float, float, float]]) -> None:
    """With x, y, z of Craig for e2, e3, e1."""
    axes = Transform(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    craig = modified_dh_chain("arm", [DHRow(theta, s, a, alpha) for a, alpha, s, theta in rows])
    here = Transform()
    for row, frame in zip(rows, [*iter_frames(craig, [0.0] * len(rows))][1:], strict=True):
        here = here @ element_frame(*row)
        np.testing.assert_allclose(matrix(axes.inverse() @ here @ axes), matrix(frame), rtol=0, atol=EXACT)


ROWS: dict[str, dict[str, Any]] = {
    "A": {"kind": "R", "a": 0.1, "alpha": 0.2, "s": 0.3, "theta": 0.4},
    "B": {"kind": "P", "a": -0.2, "alpha": 1.2, "s": 0.1, "theta": -0.7},
    "C": {"kind": "C", "a": 0.5, "alpha": -0.4, "s": -0.2, "theta": 2.0, "body": "hand"},
    "D": {"kind": "H", "a": 0.3, "alpha": 0.9, "theta": 1.1, "pitch": 0.05},
}


def dh_network(*, closed: bool, **units: str) -> Network:
    return load_network({**units, "dh": {"closed": closed, "elements": ROWS}})


def expected_frames() -> list[Transform]:
    here, found = Transform(), []
    for row in ROWS.values():
        s = row["pitch"] * row["theta"] if row["kind"] == "H" else row["s"]
        here = here @ printed(row["a"], row["alpha"], s, row["theta"])
        found.append(here)
    return found


def test_an_open_chain_of_all_kinds() -> None:
    network = dh_network(closed=False)
    assert network.bodies == tuple(map(Body, ("A.body", "B.body", "hand", "D.body")))
    mechanism = build_mechanism(network)
    poses = mechanism.poses(mechanism.start)
    for body, expected in zip(network.bodies, expected_frames(), strict=True):
        np.testing.assert_allclose(matrix(poses[body.name]), matrix(expected), rtol=0, atol=EXACT)


def test_the_last_element_of_a_closed_chain_leads_back_to_the_ground() -> None:
    network = dh_network(closed=True)
    assert [one.bodies for one in network.joints] == [
        ("ground", "A.body"),
        ("A.body", "B.body"),
        ("B.body", "hand"),
        ("hand", "ground"),
    ]
    starts = [across(joint, *joint.start) for joint in network.joints]
    here = Transform()
    for frame, expected in zip(starts, expected_frames(), strict=True):
        here = here @ frame
        np.testing.assert_allclose(matrix(here), matrix(expected), rtol=0, atol=EXACT)


def test_parameters_are_in_the_units_of_the_file() -> None:
    rows = {
        "A": {"kind": "R", "a": 100, "alpha": 90, "s": 20, "theta": 45},
        "B": {"kind": "H", "alpha": -90, "theta": 180, "pitch": 5},
    }
    network = load_network({"length_unit": "mm", "angle_unit": "deg", "dh": {"elements": rows}})
    right = math.pi / 2.0
    assert network.joints == (
        element_to_joint(DHElement("A", "R", 0.1, right, 0.02, right / 2.0), ("ground", "A.body")),
        element_to_joint(DHElement("B", "H", 0.0, -right, theta=math.pi, pitch=0.005), ("A.body", "B.body")),
    )


@pytest.mark.parametrize(("key", "value"), [("driven", "turn"), ("value", "2 * turn")])
def test_a_control_drives_an_element(key: str, value: str) -> None:
    rows = {"A": {"kind": "R", "theta": 0.3, key: value}, "B": {"kind": "C", key: ["", value]}}
    network = load_network({"controls": {"turn": {}}, "dh": {"elements": rows}})
    assert [[one and one.text for one in joint.drives] for joint in network.joints] == [
        [value],
        [None, value],
    ]
