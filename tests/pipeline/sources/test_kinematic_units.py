"""Units against the data and against the kinematics: the header may lie."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from io import StringIO

import numpy as np
import pytest

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]

UR5E = load_robot("ur5e")
ROWS = 60
PRINTED = 1e-8
"""Ten decimals, in mm or deg at the worst."""

Q = 0.4 + np.arange(6) * 0.3 + 0.5 * np.sin(np.linspace(0, 1, ROWS)[:, None] * (1 + 0.4 * np.arange(6)))
WRAPPED = np.remainder(Q * 4 + np.pi, 2 * np.pi) - np.pi
TCP = positions_over_log(UR5E.placed(tool=translation(0.0, 0.02, 0.15)), Q)
FLANGE = positions_over_log(UR5E, Q)


def text(names: Sequence[str], *columns: FloatArray) -> str:
    target = StringIO()
    t = np.arange(ROWS) * 0.005
    table, header = np.column_stack((t, *columns)), ",".join(("t", *names))
    np.savetxt(target, table, "%.10f", ",", header=header, comments="")
    return target.getvalue()


def joints(unit: str = "") -> list[str]:
    return [f"q{k}{unit}" for k in range(1, 7)]


@pytest.mark.parametrize("position", [FLANGE, TCP], ids=["flange", "with a tool"])
@pytest.mark.parametrize(("angle", "per_rad"), [("rad", 1.0), ("deg", 180 / np.pi)])
@pytest.mark.parametrize(("length", "per_m"), [("m", 1.0), ("mm", 1e3)])
def test_without_any_unit_the_kinematics_tell_both(
    position: FloatArray, angle: str, per_rad: float, length: str, per_m: float, read: Read
) -> None:
    log = read(text([*joints(), "x", "y", "z"], Q * per_rad, position * per_m), UR5E)
    assert (log.units["q1"], log.units["x"]) == (angle, length)
    np.testing.assert_allclose(log.q, Q, atol=PRINTED)
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position, position, atol=PRINTED)
    assert not log.warnings


def test_a_header_that_says_degrees_over_radians(read: Read) -> None:
    """Some controllers' traces do: the kinematics decide, and the message says by how much."""
    log = read(text([*joints(" [deg]"), "x [m]", "y [m]", "z [m]"], Q, FLANGE), UR5E)
    np.testing.assert_allclose(log.q, Q, atol=PRINTED)
    assert set(log.units.values()) == {"s", "rad", "m"}
    (warning,) = log.warnings
    assert warning.kind == "unit-contradiction"
    miss = positions_over_log(UR5E, np.radians(Q)) - FLANGE
    every = " ".join(f"--unit q{k}=deg" for k in range(1, 7))
    off = 1e3 * np.sqrt((miss**2).sum(axis=1).mean())
    assert str(warning) == (
        "q1, q2, q3, q4, q5, q6: deg (its name) contradicts the kinematics: taken as rad: with it the arm"
        f" comes within 0.00 mm (rms) of the recorded TCP, as deg within {off:.2f} mm; {every}"
        " overrides this"
    )


def test_a_unit_given_for_every_angle_does_not_reach_what_the_kinematics_give(read: Read) -> None:
    table = text([*joints(), "x [m]", "y [m]", "z [m]"], Q, FLANGE)
    log = read(table, UR5E, unit={"": "deg"})
    np.testing.assert_allclose(log.q, Q, atol=PRINTED)
    (warning,) = log.warnings
    assert (warning.kind, warning.assumption) == ("unit-not-reached", "")
    every = " ".join(f"--unit q{k}=deg" for k in range(1, 7))
    assert str(warning) == (
        f"q1, q2, q3, q4, q5, q6: deg does not reach them: the kinematics give rad; {every} does"
    )


def test_the_user_has_the_last_word_on_a_column(read: Read) -> None:
    given = {f"q{k}": "deg" for k in range(1, 7)}
    log = read(text([*joints(), "x [m]", "y [m]", "z [m]"], Q, FLANGE), UR5E, unit=given)
    np.testing.assert_allclose(log.q, np.radians(Q), atol=PRINTED)
    (warning,) = log.warnings
    assert warning.kind == "unit-contradiction"
    said = "q1, q2, q3, q4, q5, q6: deg (given as an option) contradicts the kinematics: taken as deg, though"
    assert warning.message.startswith(said)


@pytest.mark.parametrize(
    ("unit", "values", "turn"), [("deg", WRAPPED, "6.28"), ("rad", np.degrees(WRAPPED), "360")]
)
def test_a_unit_that_the_data_contradict_is_asked_for(
    unit: str, values: FloatArray, turn: str, wrong: Wrong, read: Read
) -> None:
    table = text(joints(f" [{unit}]"), values)
    other = "rad" if unit == "deg" else "deg"
    (said,) = wrong(table)
    assert re.fullmatch(
        rf"log\.csv: found q1, .*, q6 in {unit} by name or source, but \d+ steps? of about {turn} from one"
        rf" row to the next, allowed: a unit that fits the data; --unit q1={other} .* or"
        rf" --unit q1={unit} .* specifies it",
        said,
    )
    for name in (other, unit):
        assert set(read(table, unit=dict.fromkeys(joints(), name)).units.values()) == {"s", name}


def test_a_static_log_cannot_tell_its_units_by_a_tool(read: Read) -> None:
    """Any robot in any unit fits one pose with some tool: nothing is concluded from that."""
    still = np.broadcast_to(Q[:1], Q.shape)
    log = read(text([*joints(), "x [m]", "y [m]", "z [m]"], still, np.broadcast_to(TCP[:1], TCP.shape)), UR5E)
    assert [w.kind for w in log.warnings] == ["assumed-unit"]
