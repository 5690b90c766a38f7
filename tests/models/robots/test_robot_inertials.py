"""Masses, gravity, efforts and drives in robot files: read, refused, and written back bit by bit."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from dataclasses import astuple, replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from asserting import refusal
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.drives import NO_SPRING, CounterbalanceSpring, Drive, DrivenJoint, Gains, PassiveJoint
from urmpipe_models.errors import RobotError
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict, read_robot_file, robot_toml
from urmpipe_models.robots.urdf_writer import urdf_text

Read = Callable[[str], Chain]

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


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    """Read a text as a robot file arm.toml of an empty folder, the working one."""
    monkeypatch.chdir(tmp_path)
    return read_text


def read_text(text: str) -> Chain:
    """Return the arm of a text."""
    Path("arm.toml").write_text(text, encoding="utf-8")
    return read_robot_file("arm.toml")


def test_masses_and_drives_are_si_and_centres_in_the_unit_of_the_file(robot: Read) -> None:
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


def test_efforts_of_a_table_of_limits_are_si(robot: Read) -> None:
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


def test_masses_of_a_toml_replace_those_of_its_urdf(robot: Read) -> None:
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


def test_everything_wrong_with_masses_and_drives_is_said_at_once(robot: Read) -> None:
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


def test_what_no_body_and_no_drive_has_is_said_beside_what_no_joint_has(robot: Read) -> None:
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


def test_a_spring_beside_a_drive_is_in_si_whatever_the_units_of_the_file(robot: Read) -> None:
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
def test_half_a_spring_and_one_that_pushes_are_refused(robot: Read, springs: str, said: str) -> None:
    text = SPRUNG.replace("{springs}", f"    {springs}")
    assert refusal(RobotError, robot, text) == f"arm.toml: {said}"


def test_a_spring_beside_no_drive_asks_for_all_of_the_drive(robot: Read) -> None:
    """`k` and `l` with the keys of a spring are a drive that lacks its others."""
    missing = "i_p", "C", "R", "L", "I1", "period", "Kphi", "Kw", "Keps", "u_max"
    assert refusal(RobotError, robot, f"{ARM}    k_spring = 1\n    rest_spring = 0\n").splitlines() == [
        f"arm.toml: key drives.slide.{key}: found nothing, allowed: a finite number" for key in missing
    ]


def bits(chain: Chain) -> str:
    """Every number of masses, gravity, efforts and drives: == takes 0.0 and -0.0 for the same."""
    efforts = [one.effort for one in chain.joints]
    parts = [astuple(one) for one in (*chain.inertials, *chain.drives)]
    return repr((efforts, chain.gravity, parts))


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_toml_file_and_a_dictionary_are_the_same_chain_bit_by_bit(
    heavy_chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path
) -> None:
    chain = data.draw(heavy_chains)
    path = tmp_path / "x.toml"
    path.write_text(robot_toml(chain), encoding="utf-8", newline="\n")
    of_json = json.loads(json.dumps(chain_to_dict(chain), allow_nan=False))
    for back in (read_robot_file(path), chain_from_dict(of_json)):
        assert back == chain
        assert bits(back) == bits(chain)
