"""Logs that urmpipe itself wrote: what their header says is no matter of doubt, whatever the values are."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog

Read = Callable[..., JointLog]

PLAN = "urmpipe_path_row"
SOLVED = "urmpipe_target_row"


def table(header: str, row: str, rows: int = 20) -> str:
    """Return a table of alike rows, 5 ms apart."""
    return f"t (s),{header}\n" + "".join(f"{k * 0.005:.3f},{row}\n" for k in range(rows))


@pytest.mark.parametrize(
    ("names", "last"),
    [
        ("rail (m),lift (m),reach (m),x (m),y (m),z (m)", PLAN),  # none turns
        ("q1 (rad),q2 (rad),hand (rad),x (m),y (m),z (m)", PLAN),  # one has no number
        ("tool_yaw (rad),current_roll (rad),speed (rad),x (m),y (m),z (m)", PLAN),  # words of other things
        ("x (m),y (m),z (m),tcp_x (m),tcp_y (m),tcp_z (m)", PLAN),
        ("x (m),y (m),z (m)", SOLVED),
    ],
)
def test_the_joints_are_the_columns_before_the_tool(read: Read, names: str, last: str) -> None:
    row = ",".join(str(k / 10) for k in range(1 + names.count(",")))
    log = read(table(f"{names},{last}", f"{row},1"))
    assert log.joints == tuple(name.split(" ")[0] for name in names.split(",")[:3])
    assert log.q[0].tolist() == [0.0, 0.1, 0.2]
    assert (log.tcp_position is not None) == (last == PLAN)
    assert (log.source, list(log.warnings)) == ("urmpipe", [])
    if log.tcp_position is not None:
        assert log.tcp_position[0].tolist() == [0.3, 0.4, 0.5]


def test_a_plan_without_an_arm_is_a_path_even_for_one_with_joints_x_y_z(read: Read) -> None:
    """A gantry with joints x, y, z reads its own positions."""
    gantry = Chain("gantry", tuple(Joint(name, kind="prismatic") for name in "xyz"))
    text = table(f"x (m),y (m),z (m),{PLAN}", "0.3,0.1,0.5,1")
    log = read(text, robot=gantry)
    assert log.tcp_position is not None
    assert (log.joints, log.tcp_position[0].tolist()) == ((), [0.3, 0.1, 0.5])
    assert read(text.replace(PLAN, "row"), robot=gantry).joints == ("x", "y", "z")


@pytest.mark.parametrize("x", ["0.001", "300"])
def test_a_place_where_no_arm_works_and_joints_of_many_turns_are_not_doubted(read: Read, x: str) -> None:
    text = table(f"q1 (rad),q2 (rad),x (m),y (m),z (m),{PLAN}", f"25,-31,{x},0,0,1")
    assert list(read(text).warnings) == []
    assert [one.kind for one in read(text.replace(f",{PLAN}", ",row")).warnings] == ["doubted-unit"] * 2


def test_what_somebody_added_behind_is_no_joint(read: Read) -> None:
    log = read(
        table(f"q1 (rad),q2 (rad),x (m),y (m),z (m),{PLAN},load (rad),note", "1,2,0.3,0.1,0.5,1,7,home")
    )
    assert log.joints == ("q1", "q2")


def test_joints_may_be_named_as_in_any_log(read: Read) -> None:
    text = table(f"q1 (rad),q2 (rad),x (m),y (m),z (m),{PLAN}", "1,2,0.3,0.1,0.5,1")
    assert read(text, joints=("q2",)).q[0].tolist() == [2.0]
    assert read(text, source="path").joints == ()
    with pytest.raises(LogError, match="allowed: 3, as robot arm has"):
        read(text, robot=Chain("arm", tuple(Joint(f"q{k}") for k in (1, 2, 3))))
