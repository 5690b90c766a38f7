"""Robot files: what they mean, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from asserting import refusal
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.arm.geometric_models import DHRow, articulated_6r, dh_chain, modified_dh_chain, urm_chain
from urmpipe_models.errors import RobotError
from urmpipe_models.math3d import from_offset, from_rpy, translation
from urmpipe_models.robots.toml import read_robot_file
from urmpipe_models.robots.urdf_writer import write_urdf


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


# --- what a file means -----------------------------------------------------------------------------


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
    expected = urm_chain(
        "two", (0.243215, 0.21243, 0.042215), (math.radians(52), math.pi / 2), directions=(1, -1),
        start=(0.0, math.pi), description="two modules", source="a test",
    ).placed(from_offset([0, 0, 1, 0, 0, math.pi / 2]), translation(0.0, 0.0, 0.15))  # fmt: skip
    got = robot(text)
    assert [joint.velocity for joint in got.moving] == [math.pi, math.pi / 2]
    assert [joint.acceleration for joint in got.moving] == [4 * math.pi] * 2
    assert [joint.upper for joint in got.moving] == [2 * math.pi] * 2
    assert [joint.lower for joint in got.moving] == [-math.inf] * 2
    unlimited = [Joint(joint.name, joint.kind, joint.origin, joint.axis) for joint in got.joints]
    assert unlimited == list(expected.joints)
    for field in ("name", "description", "source", "start", "base", "tip", "tool"):
        assert getattr(got, field) == getattr(expected, field)


@pytest.mark.parametrize(("kind", "build"), [("dh", dh_chain), ("modified_dh", modified_dh_chain)])
def test_dh_rows(robot: Any, kind: str, build: Any) -> None:
    text = f"""
        kind = "{kind}"
        limits = {{ lower = [-1, -2] }}
        start = [0.1, 0.2]
        [[joints]]
        name = "turn"
        theta = 0.1
        d = 0.2
        a = 0.3
        alpha = 0.4
        [[joints]]
        kind = "prismatic"
        d = 0.5
    """
    rows = [DHRow(0.1, 0.2, 0.3, 0.4, "turn", lower=-1.0), DHRow(d=0.5, kind="prismatic", lower=-2.0)]
    assert robot(text) == build("arm", rows, start=(0.1, 0.2))


def test_fixed_dh_rows_have_no_coordinate_no_limits_and_no_start(robot: Any) -> None:
    text = """
        kind = "modified_dh"
        limits = { lower = [-1, -2], upper = [3, 4], velocity = [5, 6], acceleration = [7, 8] }
        start = [0.1, 0.2]
        [[joints]]
        d = 0.2
        [[joints]]
        kind = "fixed"
        a = 0.3
        [[joints]]
        kind = "prismatic"
        [[joints]]
        name = "flange"
        kind = "fixed"
        d = 0.5
    """
    chain = robot(text)
    assert [joint.name for joint in chain.joints] == ["q1", "frame2", "q2", "flange"]
    assert [joint.kind for joint in chain.joints] == ["revolute", "fixed", "prismatic", "fixed"]
    assert chain.start == (0.1, 0.2)
    limits = [(joint.lower, joint.upper, joint.velocity, joint.acceleration) for joint in chain.joints]
    assert limits[0::2] == [(-1.0, 3.0, 5.0, 7.0), (-2.0, 4.0, 6.0, 8.0)]
    assert limits[1::2] == [(-math.inf, math.inf, math.inf, math.inf)] * 2


def test_articulated6r_by_its_lengths(robot: Any) -> None:
    chain = robot("""
        kind = "articulated6r"
        length_unit = "mm"
        angle_unit = "deg"
        lengths = [100, 200, 300, 400, 50]
        limits = { lower = [-180, -90, -90, -180, -90, -360], velocity = 90, acceleration = 45 }
    """)
    bare = articulated_6r(0.1, 0.2, 0.3, 0.4, 0.05)
    assert (chain.name, chain.tip, chain.start) == ("arm", bare.tip, (0.0,) * 6)
    assert [joint.origin for joint in chain.joints] == [joint.origin for joint in bare.joints]
    assert [joint.axis for joint in chain.joints] == [joint.axis for joint in bare.joints]
    quarter = math.pi / 2
    assert [joint.lower for joint in chain.joints] == [
        -math.pi,
        *[-quarter] * 2,
        -math.pi,
        -quarter,
        -2 * math.pi,
    ]
    assert [joint.velocity for joint in chain.joints] == [quarter] * 6
    assert [joint.acceleration for joint in chain.joints] == [quarter / 2] * 6


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


# --- what is refused -------------------------------------------------------------------------------


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
    with pytest.raises(RobotError) as caught:
        robot('kind = "urm"\nname = ur5e  # mine')
    assert str(caught.value) == (
        'arm.toml:2: not valid TOML: Invalid value (at line 2, column 8); a text needs quotes: name = "ur5e"'
    )


def test_other_bytes_and_missing_files_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    with pytest.raises(RobotError) as caught:
        read_robot_file(path)
    assert str(caught.value) == f"{path}: cannot be read: No such file or directory"
    path.write_bytes("name = 'Ärm'".encode("latin-1"))
    assert refusal(RobotError, read_robot_file, path) == (
        f"{path}:1: byte 8 is not UTF-8; allowed: TOML in UTF-8"
    )


def test_an_arm_of_more_joints_than_any_has_is_refused(robot: Any) -> None:
    joints = ", ".join(f'{{ name = "j{k}" }}' for k in range(1001))
    said = "arm.toml: found 1001 joints, allowed: 1000 at most"
    assert complaint(robot, f'kind = "joints"\njoints = [{joints}]') == [said]
