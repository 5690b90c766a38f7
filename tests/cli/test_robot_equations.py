"""`urmpipe robot equations` as a user runs it, and `urmpipe.equations`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import urmpipe as api
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.math3d import from_offset

URDF = """<robot name="swing"><link name="base"/>
<link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
<inertia ixx="0" iyy="0.25" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint>
</robot>
"""


@pytest.fixture
def pendulum(tmp_path: Path) -> str:
    (tmp_path / "swing.urdf").write_text(URDF, encoding="utf-8")
    return "swing.urdf"


def test_the_equations_are_printed(urmpipe: Any, pendulum: str) -> None:
    ran = urmpipe("robot", "equations", pendulum, "--term", "gravity")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == api.equations(pendulum, term="gravity").text
    assert ran.out.endswith("\n\ntau_swing = gravity\n  gravity = -9.81*c1\n")


def test_the_equations_as_json(urmpipe: Any, pendulum: str) -> None:
    ran = urmpipe("robot", "equations", pendulum, "--term", "inertia", "--json")
    assert json.loads(ran.out) == {
        "schema": 1,
        "robot": "swing",
        "coordinates": ["swing"],
        "terms": [
            {
                "joint": "swing",
                "term": "inertia",
                "operations": {"additions": 2, "multiplications": 7},
                "reduced": {"additions": 0, "multiplications": 1},
            }
        ],
        "output": None,
    }


def test_c_is_written_and_replaces_only_an_export(urmpipe: Any, pendulum: str, tmp_path: Path) -> None:
    ran = urmpipe("robot", "equations", pendulum, "--form", "c", "-o", "swing.c")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == (
        "Equations: swing.c  (0 additions, 2 multiplications; before reduction 2 additions,"
        " 8 multiplications)\n"
    )
    code = (tmp_path / "swing.c").read_text(encoding="utf-8")
    assert code == api.equations(tmp_path / pendulum, form="c").text
    assert "\nvoid swing_torque(const double q[], const double qd[], const double qdd[]," in code
    assert urmpipe("robot", "equations", pendulum, "-o", "swing.c", "--json").code == 0
    assert (tmp_path / "swing.c").read_text(encoding="utf-8") == code
    ran = urmpipe("robot", "equations", pendulum, "--form", "text", "-o", "swing.c")
    assert (ran.code, ran.err) == (
        2,
        "error: form (--form): found text for swing.c, allowed: c, or another name\n",
    )
    (tmp_path / "mine.c").write_text("int x;", encoding="utf-8")
    ran = urmpipe("robot", "equations", pendulum, "-o", "mine.c")
    assert (ran.code, ran.err) == (
        2,
        "error: mine.c: found a file that is not a robot export of urmpipe, allowed: a new name, or such an"
        " export to replace\n",
    )


def test_a_mistaken_term_is_refused(urmpipe: Any, pendulum: str) -> None:
    ran = urmpipe("robot", "equations", pendulum, "--term", "corioli")
    allowed = "all, inertia, centrifugal, coriolis, gravity, tool"
    assert ran.code == 2
    assert f"found 'corioli' (did you mean coriolis?), allowed: {allowed}" in ran.err
    with pytest.raises(api.OptionError) as error:
        api.equations("urm4", term="friction", form="pdf")  # type: ignore[arg-type]
    assert str(error.value).splitlines() == [
        "form (--form): found 'pdf', allowed: text, c", f"term (--term): found 'friction', allowed:"
                                                        f" {allowed}",
    ]  # fmt: skip


def test_the_result_shows_what_it_costs() -> None:
    chain = Chain("rod", (Joint("turn"),), inertials=(Inertial("turn", 2.0, (0.5, 0.0, 0.0)),))
    found = api.equations(chain, base=(0.0, 0.0, 0.0, 1.5707963267948966, 0.0, 0.0), tool=(0.5, 0.0, 0.0))
    assert repr(found) == "<Equations rod: 1 coordinate, 2 additions, 6 multiplications>"
    assert "  gravity = 9.81*c1\n" in found.text  # the base lays the axis level
    assert found.robot.tool == from_offset([0.5, 0.0, 0.0])
    frame = found.to_frame()
    assert list(frame.columns) == [
        "joint", "term", "additions", "multiplications", "reduced_additions", "reduced_multiplications",
    ]  # fmt: skip
    assert list(frame.term) == ["inertia", "centrifugal", "coriolis", "gravity", "tool"]
