"""Parameters of chains as laws, and bodies printed with few digits. chain.cases has messages and meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from scipy.spatial.transform import Rotation

from urmpipe_models.arm import denavit_hartenberg as builders
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.arm.denavit_hartenberg import DHRow, GeometricModelRow
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import Step, Transform, from_offset, rotation_x
from urmpipe_models.robots.catalogue import load_robot, robot_names

URDFS = {
    "FancySafeBot_fsb-library/lbr_iiwa7_r800.urdf": None,
    "FancySafeBot_fsb-library/panda.urdf": "panda_hand",
    "FancySafeBot_fsb-library/ur5.urdf": "tool0",
    "Gepetto_example-robot-data/panda.urdf": "panda_hand_tcp",
    "Gepetto_example-robot-data/ur10_robot.urdf": "tool0",
    "Gepetto_example-robot-data/ur3_robot.urdf": "tool0",
    "Gepetto_example-robot-data/ur5_robot.urdf": "tool0",
    "ros-industrial_kuka_experimental/lbr_iiwa_14_r820.urdf": None,
}
"""The URDFs beside this repository, with the link that ends the arm where its file leaves a choice."""


def bits(chain: Chain) -> bytes:
    """Every number of the frames: == takes 0.0 and -0.0 for the same."""
    numbers = [[*frame.translation, *(x for row in frame.rotation for x in row)] for frame in chain.frames]
    return np.array(numbers, dtype=float).tobytes()


def parameter_values(chain: Chain) -> dict[str, float]:
    return {one.name: one.value for one in chain.parameters}


@pytest.mark.parametrize("file", [*robot_names(), *URDFS])
def test_a_robot_of_its_own_values_is_the_same_by_bits(request: pytest.FixtureRequest, file: str) -> None:
    if file in URDFS:
        chain = load_robot(request.getfixturevalue("shared") / "robots" / file, tip_link=URDFS[file])
        first = chain.joints[0].name
        assert chain.parameters[6].name == f"{first}.x"
        assert chain.parameters[6].source == f"URDF joint {first}"
    else:
        chain = load_robot(file)
    again = chain.with_parameters(parameter_values(chain))
    assert again == chain
    assert bits(again) == bits(chain)
    assert parameter_values(again) == parameter_values(chain)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_a_frame_is_before_step_and_after_in_turn(chains: SearchStrategy[Chain], data: st.DataObject) -> None:
    chain = data.draw(chains)
    assert len(parameter_values(chain)) == len(chain.parameters)  # names are unique
    for one in chain.parameters:
        frame = chain.frames[one.frame_index]
        again = one.before @ Step(one.kind, one.axis, one.value).frame @ one.after
        np.testing.assert_allclose(again.rotation, frame.rotation, rtol=0.0, atol=1e-15)  # of another order
        np.testing.assert_allclose(again.translation, frame.translation, rtol=0.0, atol=1e-15)


def test_a_frame_of_numbers_alone_turns_after_its_rotation() -> None:
    tool = Transform(rotation_x(0.5).rotation, (0.1, 0.2, 0.3))
    arm = Chain("arm", (Joint("a"),)).placed(tool=tool)
    assert [one.value for one in arm.parameters[-6:]] == [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]
    assert arm.parameters[-1].before == tool
    changed = arm.with_parameters({"tool.x": 0.7, "tool.rx": 0.25})
    assert changed.tool.translation == (0.7, 0.2, 0.3)
    np.testing.assert_allclose(changed.tool.rotation, rotation_x(0.75).rotation, rtol=0.0, atol=1e-15)
    assert parameter_values(changed)["tool.rx"] == 0.25
    assert changed.with_parameters({"tool.rx": 0.0, "tool.x": 0.1}) == arm


def test_the_rest_of_the_arm_stays() -> None:
    arm = load_robot("urm6").placed(from_offset((1.0, 2.0, 3.0)))
    assert [one.value for one in arm.parameters[:3]] == [1.0, 2.0, 3.0]
    limited = replace(arm, joints=(replace(arm.joints[0], lower=-1.0), *arm.joints[1:]))
    changed = limited.with_parameters({"r3": 0.25})
    assert replace(changed, joints=limited.joints) == limited
    (moved,) = [k for k, joint in enumerate(changed.joints) if joint != limited.joints[k]]
    assert replace(changed.joints[moved], origin=limited.joints[moved].origin) == limited.joints[moved]
    assert limited.with_parameters({}) == limited


def dh_rows(v: Any) -> list[DHRow]:
    return [DHRow(*v[:4]), DHRow(0.1, v[4])]


DESCRIBED: dict[str, tuple[Callable[..., Chain], str]] = {
    "urm": (lambda *v: builders.urm_chain("a", v[:3], v[3:5]), "r1 r2 r3 theta2 theta3"),
    "dh": (lambda *v: builders.dh_chain("a", dh_rows(v)), "theta_1 d_1 a_1 alpha_1 d_2"),
    "modified_dh": (lambda *v: builders.modified_dh_chain("a", dh_rows(v)), "theta_1 d_1 a_1 alpha_1 d_2"),
    "articulated_6r": (builders.articulated_6r, "l0 l1 l2 l3 l4"),
    "geometric": (
        lambda *v: builders.geometric_chain("a", [GeometricModelRow("R", "y", v[:3])], tip=(v[3], v[4], 0.1)),
        "r1.x r1.y r1.z r2.x r2.y",
    ),
}
five_values = st.lists(st.floats(-2.0, 2.0), min_size=5, max_size=5)


@pytest.mark.parametrize("kind", DESCRIBED)
@settings(max_examples=20, deadline=None)
@given(five_values, five_values)
def test_values_make_the_arm_described(kind: str, values: Sequence[float], others: Sequence[float]) -> None:
    made, names = DESCRIBED[kind]
    found = made(*values).with_parameters(dict(zip(names.split(), others, strict=True)))
    assert found == made(*others)
    assert bits(found) == bits(made(*others))


FILES = {
    "arm.urdf": (
        '<robot name="arm"><link name="a"/><link name="b"/><joint name="elbow" type="revolute">'
        '<parent link="a"/><child link="b"/>'
        '<origin xyz="0.1 {length} 0.3" rpy="0.4 {angle} 0.6"/></joint></robot>'
    ),
    "arm.toml": (
        'kind = "joints"\nname = "arm"\njoints = [{{ name = "elbow", origin = {{'
        " translation = [0.1, {length}, 0.3], rpy = [0.4, {angle}, 0.6] }} }}]\n"
    ),
}


@pytest.mark.parametrize("file", FILES)
def test_other_values_make_the_arm_of_a_changed_file(tmp_path: Path, file: str) -> None:
    path = tmp_path / file
    path.write_text(FILES[file].format(length=0.2, angle=0.5), encoding="utf-8")
    found = load_robot(path).with_parameters({"elbow.y": 0.25, "elbow.ry": -0.5})
    path.write_text(FILES[file].format(length=0.25, angle=-0.5), encoding="utf-8")
    assert (found, parameter_values(found)) == (load_robot(path), parameter_values(load_robot(path)))
    assert bits(found) == bits(load_robot(path))


def test_values_may_be_arrays() -> None:
    lengths: FloatArray = np.linspace(0.1, 0.4, 4)
    arm = load_robot("urm4")
    tcp = forward(arm.with_parameters({"r2": lengths}), arm.start)[-1].translation
    for k, length in enumerate(lengths.tolist()):
        one = forward(arm.with_parameters({"r2": length}), arm.start)[-1].translation
        np.testing.assert_allclose([np.broadcast_to(x, 4)[k] for x in tcp], one, rtol=0.0, atol=1e-15)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([3, 4, 6]), st.sampled_from(["rod", "plate", "point"]))
def test_a_body_turned_and_printed_with_few_digits_is_a_body(seed: int, digits: int, what: str) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.5, 1.0, 2)
    moments = {"rod": (0.0, a, a), "plate": (a, b, a + b), "point": (0.0, 0.0, 0.0)}[what]
    turn = Rotation.random(rng=rng).as_matrix()
    matrix = turn @ np.diag(moments) @ turn.T + 1e-20 * rng.normal()
    places = (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)
    ixx, iyy, izz, ixy, ixz, iyz = (float(f"{matrix[place]:.{digits}g}") for place in places)
    assert list(Inertial("j", 1.0, inertia=(ixx, iyy, izz, ixy, ixz, iyz)).faults()) == []
