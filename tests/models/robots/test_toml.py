"""Robot files: their meaning, their errors, and the same chain after a round trip."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from asserting import refusal
from urmpipe_models.arm.chain import Box, Chain, Inertial, Joint, Mesh, Mimic, Visual
from urmpipe_models.arm.denavit_hartenberg import (
    DHRow,
    articulated_6r,
    dh_chain,
    modified_dh_chain,
    urm_chain,
)
from urmpipe_models.drives import NO_SPRING, CounterbalanceSpring, Drive, DrivenJoint, Gains, PassiveJoint
from urmpipe_models.errors import RobotError
from urmpipe_models.math3d import Transform, from_offset, from_rpy, rotation_x, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict, read_robot_file, robot_toml
from urmpipe_models.robots.urdf_writer import urdf_text, write_urdf


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Write a text as arm.toml in an empty folder, the working one, and read it."""
    monkeypatch.chdir(tmp_path)

    def read(text: str) -> Chain:
        Path("arm.toml").write_text(text, encoding="utf-8")
        return read_robot_file("arm.toml")

    return read


def complaint(read: Any, text: str) -> list[str]:
    return refusal(RobotError, read, text).splitlines()


def test_urm_modules_in_mm_and_deg(robot: Any) -> None:
    text = """
        kind = "urm"
        name = "two"
        description = "two modules"
        source = "a test"
        length_unit = "mm"
        angle_unit = "deg"
        lengths = [243.215, 212.43, 42.215]
        tilts = [52, 90]
        directions = [1, -1]
        start = [0, 180]
        limits = { velocity = [180, 90], upper = 360, acceleration = 720 }
        base = { translation = [0, 0, 1000], rpy = [0, 0, 90] }
        tool = { translation = [0, 0, 150] }
    """
    bare = urm_chain(
        "two", (0.243215, 0.21243, 0.042215), (math.radians(52), math.pi / 2), directions=(1, -1),
        start=(0.0, math.pi), description="two modules", source="a test",
    ).placed(from_offset([0, 0, 1, 0, 0, math.pi / 2]), translation(0.0, 0.0, 0.15))  # fmt: skip
    modules = (
        replace(joint, upper=2 * math.pi, velocity=velocity, acceleration=4 * math.pi)
        for joint, velocity in zip(bare.moving, (math.pi, math.pi / 2), strict=True)
    )
    assert robot(text) == replace(bare, joints=(*modules, bare.joints[-1]))


@pytest.mark.parametrize(("kind", "build"), [("dh", dh_chain), ("modified_dh", modified_dh_chain)])
def test_dh_rows_of_which_fixed_ones_have_no_coordinate_no_limits_and_no_start(
    robot: Any, kind: str, build: Any
) -> None:
    text = f"""
        kind = "{kind}"
        limits = {{ lower = [-1, -2], upper = [3, 4], velocity = [5, 6], acceleration = [7, 8] }}
        start = [0.1, 0.2]
        joints = [
            {{ name = "turn", theta = 0.1, d = 0.2, a = 0.3, alpha = 0.4 }}, {{ kind = "fixed", a = 0.3 }},
            {{ kind = "prismatic", d = 0.5 }}, {{ name = "flange", kind = "fixed", d = 0.6 }},
        ]
    """
    rows = [
        DHRow(0.1, 0.2, 0.3, 0.4, "turn", "revolute", -1.0, 3.0, 5.0, 7.0),
        DHRow(a=0.3, kind="fixed"),
        DHRow(d=0.5, kind="prismatic", lower=-2.0, upper=4.0, velocity=6.0, acceleration=8.0),
        DHRow(d=0.6, name="flange", kind="fixed"),
    ]
    chain = robot(text)
    assert chain == build("arm", rows, start=(0.1, 0.2))
    assert [joint.name for joint in chain.joints] == ["turn", "frame2", "q2", "flange"]


def test_articulated6r_by_its_lengths(robot: Any) -> None:
    chain = robot("""
        kind = "articulated6r"
        length_unit = "mm"
        angle_unit = "deg"
        lengths = [100, 200, 300, 400, 50]
        limits = { lower = [-180, -90, -90, -180, -90, -360], velocity = 90, acceleration = 45 }
    """)
    bare, quarter = articulated_6r(0.1, 0.2, 0.3, 0.4, 0.05, name="arm"), math.pi / 2
    lowers = (-math.pi, -quarter, -quarter, -math.pi, -quarter, -2 * math.pi)
    joints = (
        replace(joint, lower=lower, velocity=quarter, acceleration=quarter / 2)
        for joint, lower in zip(bare.joints, lowers, strict=True)
    )
    assert chain == replace(bare, joints=tuple(joints))


def test_joints_of_any_kind(robot: Any) -> None:
    text = """
        kind = "joints"
        length_unit = "mm"
        angle_unit = "deg"
        start = [90, 500]
        [[joints]]
        name = "mount"
        kind = "fixed"
        origin = { rotation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]] }
        [[joints]]
        name = "turn"
        lower = -inf
        upper = 90
        [[joints]]
        name = "slide"
        kind = "prismatic"
        origin = { translation = [100, 0, 0] }
        axis = [1, 0, 0]
        upper = 1000
        velocity = 250
        [[joints]]
        name = "follow"
        mimic = { joint = "turn", multiplier = -2, offset = 180 }
        [tip]
        translation = [0, 0, 100]
    """
    quarter = from_rpy(0.0, 0.0, math.pi / 2)
    assert robot(text) == Chain(
        "arm",
        (
            Joint("mount", "fixed", quarter),
            Joint("turn", upper=math.pi / 2),
            Joint(
                "slide", "prismatic", translation(0.1, 0.0, 0.0), (1.0, 0.0, 0.0), upper=1.0, velocity=0.25
            ),
            Joint("follow", mimic=Mimic("turn", -2.0, math.pi)),
        ),
        tip=translation(0.0, 0.0, 0.1),
        start=(math.pi / 2, 0.5),
    )


def test_a_urdf_with_a_name_a_tip_and_a_start(robot: Any) -> None:
    write_urdf(Chain("u", (Joint("a"), Joint("b")), base=translation(1.0, 0.0, 0.0)), "robot.urdf")
    text = """
        kind = "urdf"
        file = "robot.urdf"
        name = "mine"
        tip_link = "link1"
        start = [0.5]
        tool = { translation = [0, 0, 0.1] }
    """
    assert robot(text) == Chain(
        "mine",
        (Joint("a"),),
        base=translation(1.0, 0.0, 0.0),
        tool=translation(0.0, 0.0, 0.1),
        start=(0.5,),
        source="robot.urdf",
    )


def test_everything_wrong_is_said_at_once(robot: Any) -> None:
    text = """
        kind = "urm"
        nmae = "arm"
        length_unit = "inch"
        lengths = [0.3, "long", nan]
        directions = 1
        start = [true]
        description = 5
        base = { translation = [1, 2], rpy = [0, 0, 0], rotation = [[1, 0], [0, 1]], turn = 3 }
        tool = { rotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]] }
        limits = { lower = [1, 2], uper = 5, velocity = "fast", acceleration = [nan] }
    """
    assert complaint(robot, text) == [
        "arm.toml: key length_unit: found 'inch', allowed: one of m, mm",
        "arm.toml: key description: found 5, allowed: a text",
        "arm.toml: key start[0]: found True, allowed: a finite number",
        "arm.toml: key base.translation: found [1, 2], allowed: 3 finite numbers",
        "arm.toml: key base.rotation: found [[1, 0], [0, 1]], allowed: three rows of three finite numbers",
        "arm.toml: key base.rotation: found beside rpy; allowed: one of the two",
        "arm.toml: key base.turn: unknown; allowed: translation, rpy, rotation, steps",
        "arm.toml: key tool.rotation: is not a rotation matrix; allowed: orthonormal rows, right-handed",
        "arm.toml: key lengths[1]: found 'long', allowed: a finite number",
        "arm.toml: key lengths[2]: found nan, allowed: a finite number",
        "arm.toml: key tilts: found nothing, allowed: a list of finite numbers",
        "arm.toml: key directions: found 1, allowed: a list of finite numbers",
        "arm.toml: key limits.lower: found [1, 2], allowed: a number, or 0 numbers, one per joint",
        "arm.toml: key limits.velocity: found 'fast', allowed: a number, or 0 numbers, one per joint",
        "arm.toml: key limits.acceleration: found [nan], allowed: a number, or 0 numbers, one per joint",
        "arm.toml: key limits.uper: unknown (did you mean upper?); allowed: lower, upper, velocity,"
        " acceleration, effort",
        "arm.toml: key nmae: unknown (did you mean name?); allowed: kind, length_unit, angle_unit, name,"
        " description, source, start, base, tool, lengths, tilts, directions, limits, visuals,"
        " inertials, drives, left_out, mass_faults, gravity",
    ]


def test_faults_in_rows_name_the_row(robot: Any) -> None:
    text = """
        kind = "joints"
        joints = [
            { name = "a", kind = "revolut", axis = [0, 0] },
            { kind = "prismatic", upper = "far", mimic = { multiplier = inf } },
        ]
        tip = 5
    """
    assert complaint(robot, text) == [
        "arm.toml: key joints[0].kind: found 'revolut', allowed: one of revolute, prismatic, fixed"
        " (did you mean revolute?)",
        "arm.toml: key joints[0].axis: found [0, 0], allowed: 3 finite numbers",
        "arm.toml: key joints[1].name: found nothing, allowed: a text",
        "arm.toml: key joints[1].upper: found 'far', allowed: a number",
        "arm.toml: key joints[1].mimic.joint: found nothing, allowed: a text",
        "arm.toml: key joints[1].mimic.multiplier: found inf, allowed: a finite number",
        "arm.toml: key tip: found 5, allowed: a table",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "",
            "arm.toml: key kind: found nothing, allowed: one of urm, dh, modified_dh, articulated6r, joints,"
            " urdf",
        ),
        (
            'kind = "dh_modified"',
            "arm.toml: key kind: found 'dh_modified', allowed: one of urm, dh, modified_dh,"
            " articulated6r, joints, urdf (did you mean modified_dh?)",
        ),
        ('kind = "dh"\njoints = 5', "arm.toml: key joints: found 5, allowed: a list of tables"),
        ('kind = "dh"\njoints = []', "arm.toml: robot arm: has no moving joint; at least one is needed"),
        (
            'kind = "urm"\nlengths = [1, 1]\ntilts = [1]\nstart = [1, 2]',
            "arm.toml: robot arm: start has 2 values; allowed: 1, one a coordinate",
        ),
        (
            'kind = "urm"\nlengths = [1]\ntilts = [1]',
            "arm.toml: robot arm: 1 lengths and 1 tilts; n modules need n + 1 lengths and n tilts",
        ),
        (
            'kind = "urm"\nlengths = [1, 1]\ntilts = [1]\ndirections = [0.5]',
            "arm.toml: robot arm: directions [0.5]; allowed: 1 values, each 1 or -1",
        ),
        (
            f'kind = "dh"\njoints = [{{ d = {10**400} }}]',
            "arm.toml:2: joints[0].d: found an integer of 1329 bits, allowed: 64 bits at most",
        ),
        (
            'kind = "articulated6r"\nlengths = [1, 2, 3]',
            "arm.toml: key lengths: found [1, 2, 3], allowed: 5 finite numbers",
        ),
        (
            'kind = "dh"\nlimits = { upper = [1, 2] }\njoints = [{ d = 1 }, { kind = "fixed" }]',
            "arm.toml: key limits.upper: found [1, 2], allowed: a number, or 1 numbers, one per joint",
        ),
        (
            'kind = "dh"\njoints = [{ kind = "fixed" }]',
            "arm.toml: robot arm: has no moving joint; at least one is needed",
        ),
        ('kind = "urdf"\nfile = "no.urdf"', "no.urdf: cannot be read: No such file or directory"),
    ],
)
def test_whole_messages(robot: Any, text: str, said: str) -> None:
    assert complaint(robot, text) == [said]


def test_a_text_without_quotes_is_told_how_to_be_written(robot: Any) -> None:
    assert refusal(RobotError, robot, 'kind = "urm"\nname = ur5e  # mine') == (
        'arm.toml:2: not valid TOML: Invalid value (at line 2, column 8); a text needs quotes: name = "ur5e"'
    )


def test_other_bytes_and_missing_files_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    assert refusal(RobotError, read_robot_file, path) == f"{path}: cannot be read: No such file or directory"
    path.write_bytes("name = 'Ärm'".encode("latin-1"))
    assert refusal(RobotError, read_robot_file, path) == (
        f"{path}:1: byte 8 is not UTF-8; allowed: TOML in UTF-8"
    )


def test_an_arm_of_more_joints_than_any_has_is_refused(robot: Any) -> None:
    joints = ", ".join(f'{{ name = "j{k}" }}' for k in range(1001))
    said = "arm.toml: found 1001 joints, allowed: 1000 at most"
    assert complaint(robot, f'kind = "joints"\njoints = [{joints}]') == [said]


ROWS = """
    joints = [
        {{ theta = {quarter}, d = {long}, a = {short}, alpha = {quarter} }},
        {{ kind = "prismatic", d = {short} }},
    ]
    start = [{quarter}, {short}]
    limits.lower = [{quarter}, {short}]
    limits.upper = [{half}, {long}]
    limits.velocity = [{half}, {long}]
    limits.acceleration = [{quarter}, {long}]
"""

KINDS = {
    "urm": """
        lengths = [{long}, {short}]
        tilts = [{quarter}]
        start = [{half}]
        limits = {{ lower = {quarter}, upper = {half}, velocity = [{half}], acceleration = {quarter} }}
    """,
    "dh": ROWS,
    "modified_dh": ROWS,
    "articulated6r": """
        lengths = [{long}, {short}, {long}, {short}, {long}]
        start = [{half}, 0, 0, 0, 0, {quarter}]
        limits = {{ lower = {quarter}, upper = {half}, velocity = {half}, acceleration = {half} }}
    """,
    "joints": """
        start = [{quarter}, {short}, {half}, {long}]
        joints = [
            {{ name = "a", origin = {{ rpy = [{half}, 0, {quarter}] }}, lower = {quarter}, upper = {half} }},
            {{ name = "b", kind = "prismatic", lower = {short}, upper = {long}, velocity = {long} }},
            {{ name = "c", mimic = {{ joint = "b", multiplier = 2, offset = {quarter} }}, upper = {half} }},
            {{ name = "d", velocity = {quarter}, acceleration = {half} }},
            {{ name = "e", kind = "prismatic", acceleration = {long} }},
        ]
        tip = {{ translation = [0, {short}, {long}], rpy = [0, 0, {quarter}] }}
    """,
    "urdf": 'file = "robot.urdf"\nstart = [{quarter}, {short}]',
}

OF_EVERY_KIND = """
    base = {{ translation = [{long}, 0, {short}], rpy = [{quarter}, 0, 0] }}
    tool = {{ translation = [0, 0, {short}], rpy = [0, {half}, 0] }}
    visuals = [
        {{ box = [{long}, {short}, 0], origin = {{ translation = [{long}, 0, 0], rpy = [0, 0, {half}] }} }},
        {{ cylinder = [{short}, {long}] }},
        {{ capsule = [{short}, {long}] }},
        {{ sphere = {short} }},
        {{ mesh = "a.stl", scale = [2, 2, 2] }},
    ]
"""


@pytest.mark.parametrize("kind", KINDS)
def test_every_value_of_a_file_is_in_the_units_of_the_file(robot: Any, kind: str) -> None:
    write_urdf(Chain("u", (Joint("a"), Joint("b", "prismatic"))), "robot.urdf")
    text = f'kind = "{kind}"\n{KINDS[kind]}\n{OF_EVERY_KIND}'
    si = robot(text.format(long=0.75, short=0.25, quarter=math.pi / 2, half=math.pi))
    units = 'length_unit = "mm"\nangle_unit = "deg"\n'
    assert robot(units + text.format(long=750, short=250, quarter=90, half=180)) == si
    assert 0.25 in (si.tool.translation[2], si.start[-1])
    assert chain_from_dict(chain_to_dict(si)) == si


def test_rows_that_make_no_arm_in_metres_and_radians_must_tell_their_units(robot: Any) -> None:
    rows = 'kind = "dh"\njoints = [{ d = 118, alpha = 90 }, { a = 612 }]'
    assert refusal(RobotError, robot, rows).splitlines() == [
        'arm.toml: key length_unit: found none, and links of 730 m, allowed: "mm", or "m" if intended',
        'arm.toml: key angle_unit: found none, and 90 rad, allowed: "deg", or "rad" if intended',
    ]
    assert robot(f'length_unit = "mm"\nangle_unit = "deg"\n{rows}').joints[1].origin.translation[2] == 0.118
    assert robot(f'length_unit = "m"\nangle_unit = "rad"\n{rows}').tip.translation[0] == 612.0


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ('kind = "dh"\njoints = [{ d = 100 }]', None),
        ('kind = "dh"\njoints = [{ d = 101 }]', "key length_unit: found none, and links of 101 m"),
        ('kind = "urm"\nlengths = [0.1, 0.1]\ntilts = [-45]', "key angle_unit: found none, and 45 rad"),
        ('kind = "dh"\njoints = [{ theta = 6.283185307179586 }]', None),
        ('kind = "modified_dh"\njoints = [{ theta = -6.3 }]', "key angle_unit: found none, and 6.3 rad"),
    ],
)
def test_units_are_asked_for_beyond_a_hundred_metres_and_beyond_a_turn(
    robot: Any, rows: str, told: str | None
) -> None:
    if told is None:
        assert len(robot(rows).coordinates) == 1
    else:
        (said,) = refusal(RobotError, robot, rows).splitlines()
        assert said.startswith(f"arm.toml: {told}, allowed: ")


def bits(chain: Chain) -> str:
    """Every number of frames, joints, masses and drives: == takes 0.0 and -0.0 for the same."""
    frames = [(frame.translation, frame.rotation) for frame in chain.frames]
    joints = [replace(joint, origin=Transform()) for joint in chain.joints]
    return repr((chain.start, frames, joints, chain.gravity, chain.inertials, chain.drives))


@pytest.mark.slow
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_toml_file_and_a_dictionary_are_the_same_chain_bit_by_bit(
    visual_chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(visual_chains)
    path = tmp_path / f"{chain.name or 'x'}.toml" if chain.name.isalnum() else tmp_path / "x.toml"
    path.write_text(robot_toml(chain), encoding="utf-8", newline="\n")
    of_json = json.loads(json.dumps(chain_to_dict(chain), allow_nan=False))  # infinities are null
    for back in (read_robot_file(path), chain_from_dict(of_json)):
        assert (back, bits(back), back.parameters) == (chain, bits(chain), chain.parameters)


@pytest.mark.parametrize("name", robot_names())
def test_a_toml_file_keeps_the_parameters(tmp_path: Path, name: str) -> None:
    chain = load_robot(name).placed(tool=Transform(rotation_x(0.5).rotation, (0.1, 0.2, 0.3)))
    chain = chain.with_parameters({"tool.rx": 0.25, chain.parameters[6].name: 0.4})
    path = tmp_path / f"{name}.toml"
    path.write_text(robot_toml(chain), encoding="utf-8")
    back = read_robot_file(path)
    assert (back, back.parameters) == (chain, chain.parameters)


def test_steps_of_a_file_are_parameters_in_its_units(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(
        """
        kind = "joints"
        length_unit = "mm"
        angle_unit = "deg"
        joints = [{ name = "a", origin = { steps = [
            { name = "height", along = "z", value = 250 },
            { rotation = [[1, 0, 0], [0, 0, -1], [0, 1, 0]] },
            { name = "lean", about = "y", value = 90, source = "drawing 7" },
        ] } }]
        """,
        encoding="utf-8",
    )
    chain = read_robot_file(path)
    height, lean = chain.parameters[6:8]
    assert (height.name, height.value, height.source) == ("height", 0.25, "")
    assert (lean.name, lean.value, lean.source, lean.place) == ("lean", math.pi / 2, "drawing 7", "a")
    assert lean.before.rotation == ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
    assert chain.joints[0].origin.translation == (0.0, 0.0, 0.25)


def test_steps_and_another_frame_beside_them_are_refused() -> None:
    data = chain_to_dict(load_robot("urm4"))
    data["joints"][1]["origin"]["translation"] = [0.0, 0.0, 0.3]
    data["joints"][2]["origin"]["steps"][0] |= {"along": "u"}
    assert refusal(RobotError, chain_from_dict, data) == (
        "key joints[1].origin.steps: found beside translation and rotation of another frame;"
        " allowed: steps alone\n"
        "key joints[2].origin.steps[0].along: found 'u', allowed: one of x, y, z\n"
        "key joints[2].origin.steps: found beside translation and rotation of another frame;"
        " allowed: steps alone"
    )


def test_a_negative_zero_and_odd_texts_come_back() -> None:
    chain = Chain('\x7f"\\\n', (Joint("é\t", origin=translation(-0.0, 1e-300, 5e-324)),), start=(-0.0,))
    back = chain_from_dict(chain_to_dict(chain))
    assert (back, bits(back)) == (chain, bits(chain))


def test_a_dictionary_from_before_limits_of_acceleration_has_none() -> None:
    data = chain_to_dict(load_robot("ur5e"))
    for joint in data["joints"]:
        assert "effort" not in joint  # one from before efforts and one without them are the same
        del joint["acceleration"]
    assert chain_from_dict(data) == load_robot("ur5e")


def test_a_dictionary_opens_no_file() -> None:
    data = {"kind": "urdf", "file": "robot.urdf"}
    said = "run.rrd: key kind: found 'urdf', allowed: one of joints"
    assert refusal(RobotError, chain_from_dict, data, file="run.rrd") == said


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text('kind = "urm"\nlengths = [1, 1]\ntilts = [1]\n', encoding="utf-8-sig")
    assert read_robot_file(path).coordinates == ("phi1",)


def test_a_dictionary_that_is_wrong_names_its_origin() -> None:
    data = chain_to_dict(Chain("a", (Joint("j"),)))
    data["joints"][0]["kind"] = "helical"
    assert refusal(RobotError, chain_from_dict, data, file="run.rrd") == (
        "run.rrd: key joints[0].kind: found 'helical', allowed: one of revolute, prismatic, fixed"
    )


def test_numbers_of_numpy_are_written_as_numbers(tmp_path: Path) -> None:
    joints = (
        Joint("a", lower=np.deg2rad(-170), upper=np.float64(1.0)),
        Joint("b", mimic=Mimic("a", np.float64(2.0), np.float64(0.5))),
    )
    chain = Chain("arm", joints)
    path = tmp_path / "arm.toml"
    path.write_text(robot_toml(chain), encoding="utf-8")
    assert read_robot_file(path) == chain


ARM = """
    kind = "joints"
    length_unit = "mm"
    angle_unit = "deg"
    gravity = [0, 9.81, 0]
    left_out = ["left finger", "right finger"]
    joints = [
        { name = "turn", effort = 150, velocity = 90 },
        { name = "slide", kind = "prismatic", effort = 2000, velocity = 500 },
        { name = "free" },
    ]
    inertials = [
        { mass = 20 },
        { joint = "turn", mass = 3, centre = [0, 0, 9], inertia = [0.4, 0.5, 0.6, 0.1, 0, 0], source = "A" },
        { joint = "turn", mass = 0.5, centre = [10, 0, 0] },
    ]

    [drives.turn]
    k = 2500
    l = 5
    i_p = 100
    C = 0.05
    R = 0.5
    L = 0.001
    I1 = 0.4
    period = 0.005
    Kphi = 7.5
    Kw = 0.75
    Keps = -0.01
    u_max = 48

    [drives.slide]
    k = 3000
    l = 0
"""


def test_masses_and_drives_are_si_and_centres_in_the_unit_of_the_file(robot: Any) -> None:
    chain = robot(ARM)
    assert [one.effort for one in chain.joints] == [150.0, 2000.0, float("inf")]
    assert chain.gravity == (0.0, 9.81, 0.0)
    assert chain.left_out == ("left finger", "right finger")
    assert chain.inertials == (
        Inertial(None, 20.0),
        Inertial("turn", 3.0, (0.0, 0.0, 0.009), (0.4, 0.5, 0.6, 0.1, 0.0, 0.0), "A"),
        Inertial("turn", 0.5, (0.01, 0.0, 0.0)),
    )
    drive = Drive(2500.0, 5.0, 100.0, 0.05, 0.5, 0.001, 0.4)
    assert chain.drives == (
        DrivenJoint("turn", drive, 0.005, Gains(7.5, 0.75, -0.01), 48.0), PassiveJoint("slide", 3000.0, 0.0),
    )  # fmt: skip


def test_efforts_of_a_table_of_limits_are_si(robot: Any) -> None:
    rows = 'joints = [{ d = 400 }, { kind = "prismatic" }, { kind = "fixed" }]'
    units = 'length_unit = "mm"\nangle_unit = "deg"'
    chain = robot(f'kind = "dh"\n{units}\n{rows}\nlimits = {{ effort = [30, 500], velocity = [90, 500] }}')
    assert [one.effort for one in chain.joints] == [30.0, 500.0, float("inf")]
    urm = robot(f'kind = "urm"\n{units}\nlengths = [100, 100]\ntilts = [20]\nlimits = {{ effort = 7 }}')
    assert urm.joints[0].effort == 7.0


def test_a_robot_without_masses_is_written_as_before() -> None:
    data = chain_to_dict(Chain("arm", (Joint("a"),)))
    assert data.keys() == {"kind", "name", "description", "source", "start", "base", "tip", "tool", "joints"}
    assert data["joints"][0].keys() == {
        "name", "kind", "origin", "axis", "lower", "upper", "velocity", "acceleration", "mimic",
    }  # fmt: skip


def test_masses_of_a_toml_replace_those_of_its_urdf(robot: Any) -> None:
    chain = Chain("arm", (Joint("a", effort=3.0),), inertials=(Inertial("a", 1.0),))
    finger = '<link name="finger"><inertial><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0"'
    joint = '<joint name="f" type="floating"><parent link="link1"/><child link="finger"/></joint>'
    text = urdf_text(chain).replace("</robot>", f'{finger} izz="0"/></inertial></link>{joint}</robot>')
    Path("arm.urdf").write_text(text, encoding="utf-8")
    head = 'kind = "urdf"\nfile = "arm.urdf"\ntip_link = "tool0"\n'
    kept = robot(head)
    assert (kept.inertials, kept.left_out) == ((Inertial("a", 1.0, source="link link1"),), ("finger",))
    assert kept.joints[0].effort == 3.0
    replaced = robot(head + 'inertials = [{ joint = "a", mass = 2 }]')
    assert (replaced.inertials, replaced.left_out) == ((Inertial("a", 2.0),), ())
    renamed = robot(head + 'left_out = ["both fingers"]')
    assert (renamed.inertials, renamed.left_out) == (kept.inertials, ("both fingers",))


def test_everything_wrong_with_masses_and_drives_is_said_at_once(robot: Any) -> None:
    text = """
        kind = "joints"
        gravity = [0, 9.81]
        left_out = "finger"
        joints = [{ name = "a", effort = "strong" }]
        inertials = [
            { joint = 1, centre = [0, 0], inertia = [1, 1, 1] },
            { joint = "a", mass = inf, center = [0, 0, 0] },
        ]
        drives.a = { k = 1, l = 0, i_p = 100, C = "x" }
        drives.b = { l = true, kk = 3 }
        drives.c = 5
    """
    drive = "k, l, i_p, C, R, L, I1, period, Kphi, Kw, Keps, u_max, k_spring, rest_spring"
    known = "i_p, C, R, L, I1, period, Kphi, Kw, Keps, u_max, k_spring, rest_spring, k, l"
    assert sorted(known.split(", ")) == sorted(drive.split(", "))
    assert refusal(RobotError, robot, text).splitlines() == [
        "arm.toml: key joints[0].effort: found 'strong', allowed: a number",
        "arm.toml: key drives.c: found 5, allowed: a table",
        "arm.toml: key inertials[0].centre: found [0, 0], allowed: 3 finite numbers",
        "arm.toml: key inertials[0].joint: found 1, allowed: a text",
        "arm.toml: key inertials[0].mass: found nothing, allowed: a finite number",
        "arm.toml: key inertials[0].inertia: found [1, 1, 1], allowed: 6 finite numbers",
        "arm.toml: key inertials[1].mass: found inf, allowed: a finite number",
        "arm.toml: key inertials[1].center: unknown (did you mean centre?); allowed: centre, joint, mass,"
        " inertia, source",
        "arm.toml: key drives.a.C: found 'x', allowed: a finite number",
        *(
            f"arm.toml: key drives.a.{key}: found nothing, allowed: a finite number"
            for key in ("R", "L", "I1", "period", "Kphi", "Kw", "Keps", "u_max")
        ),
        "arm.toml: key drives.b.k: found nothing, allowed: a finite number",
        "arm.toml: key drives.b.l: found True, allowed: a finite number",
        f"arm.toml: key drives.b.kk: unknown (did you mean k?); allowed: {known}",
        "arm.toml: key drives.c.k: found nothing, allowed: a finite number",
        "arm.toml: key drives.c.l: found nothing, allowed: a finite number",
        "arm.toml: key left_out: found 'finger', allowed: a list of texts",
        "arm.toml: key gravity: found [0, 9.81], allowed: 3 finite numbers",
    ]


def test_what_no_body_and_no_drive_has_is_said_beside_what_no_joint_has(robot: Any) -> None:
    text = """
        kind = "joints"
        joints = [{{ name = "a", effort = {effort} }}]
        inertials = [{{ joint = "a", mass = -1 }}, {{ joint = "b", mass = 1 }}]
        drives.a = {{ k = 0, l = 0 }}
    """
    own = [
        "arm.toml: robot arm: inertial on joint a: mass -1 kg; allowed: 0 or more",
        "arm.toml: robot arm: drives.a.k: found 0, allowed: a finite number, 1e-09 or more",
    ]
    assert refusal(RobotError, robot, text.format(effort=0)).splitlines() == [
        "arm.toml: robot arm: joint a: effort 0; allowed: more than 0", *own,
    ]  # fmt: skip
    assert refusal(RobotError, robot, text.format(effort=1)).splitlines() == [
        own[0], "arm.toml: robot arm: an inertial hangs on b, no joint of the chain; allowed: a", own[1],
    ]  # fmt: skip


SPRUNG = ARM.replace("u_max = 48\n", "u_max = 48\n{springs}\n")
"""The arm, with keys of a spring beside the drive of its first joint."""


def test_a_spring_beside_a_drive_is_in_si_whatever_the_units_of_the_file(robot: Any) -> None:
    given = robot(SPRUNG.replace("{springs}", "    k_spring = 1150\n    rest_spring = -0.1"))
    plain = robot(ARM)
    (turn, slide), (own, other) = given.drives, plain.drives
    assert isinstance(turn, DrivenJoint)
    assert isinstance(own, DrivenJoint)
    assert (turn.spring, own.spring) == (CounterbalanceSpring(1150.0, -0.1), NO_SPRING)
    assert (replace(turn, spring=NO_SPRING), slide) == (own, other)
    for chain, keys in ((given, {"k_spring", "rest_spring"}), (plain, set())):
        written = chain_to_dict(chain)["drives"]["turn"]
        assert written.keys() & {"k_spring", "rest_spring"} == keys
        back = chain_from_dict(tomllib.loads(robot_toml(chain)))
        assert back == chain
        assert bits(back) == bits(chain)


@pytest.mark.parametrize(
    ("springs", "said"),
    [
        ("k_spring = 1", "key drives.turn.rest_spring: found nothing, allowed: a finite number"),
        ("rest_spring = 1", "key drives.turn.k_spring: found nothing, allowed: a finite number"),
        (
            "k_spring = -1\n    rest_spring = 1",
            "robot arm: drives.turn.k_spring: found -1, allowed: a finite number, 0 or more",
        ),
        (
            "k_spring = 1\n    rest_spring = nan",
            "key drives.turn.rest_spring: found nan, allowed: a finite number",
        ),
    ],
)
def test_half_a_spring_and_one_that_pushes_are_refused(robot: Any, springs: str, said: str) -> None:
    text = SPRUNG.replace("{springs}", f"    {springs}")
    assert refusal(RobotError, robot, text) == f"arm.toml: {said}"


def test_a_spring_beside_no_drive_asks_for_all_of_the_drive(robot: Any) -> None:
    """`k` and `l` with the keys of a spring are a drive that lacks its others."""
    missing = "i_p", "C", "R", "L", "I1", "period", "Kphi", "Kw", "Keps", "u_max"
    assert refusal(RobotError, robot, f"{ARM}    k_spring = 1\n    rest_spring = 0\n").splitlines() == [
        f"arm.toml: key drives.slide.{key}: found nothing, allowed: a finite number" for key in missing
    ]


def test_a_mesh_of_a_robot_file_is_looked_up_from_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(
        'kind = "joints"\nlength_unit = "mm"\n[[joints]]\nname = "j"\n'
        '[[visuals]]\nmesh = "a.stl"\nscale = [1, 2, 3]\n'
        '[[visuals]]\njoint = "j"\nbox = [100, 200, 300]\ncolour = [1, 0, 0, 1]\n'
        "origin = { translation = [10, 0, 0] }\n",
        encoding="utf-8",
    )
    assert read_robot_file(path).visuals == (
        Visual(None, Mesh(str(tmp_path / "a.stl"), (1.0, 2.0, 3.0))),
        Visual("j", Box((0.1, 0.2, 0.3)), translation(0.01, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0)),
    )
    path.write_text('kind = "joints"\n[[joints]]\nname = "j"\n[[visuals]]\nbox = [1, 1, 1]\nsphere = 1\n')
    said = "key visuals[0].box: found box and sphere, allowed: one of box, cylinder, capsule, sphere, mesh"
    assert refusal(RobotError, read_robot_file, path) == f"{path}: {said}"
