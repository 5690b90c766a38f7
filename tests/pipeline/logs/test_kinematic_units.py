"""Units against the data and against the kinematics: the header may lie."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from io import StringIO

import numpy as np
import pytest

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.math3d import from_offset, translation
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


def text(names: Sequence[str], *columns: FloatArray, rows: int = ROWS) -> str:
    target = StringIO()
    t = np.arange(rows) * 0.005
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
    every = " ".join(f"--unit q{k}=deg" for k in range(1, 7))
    assert re.fullmatch(
        "q1, q2, q3, q4, q5, q6: deg (its name) contradicts the kinematics: taken as rad: with it the"
        " kinematics follow the recorded TCP within 0.00 mm (median), 0.00 % of its distance, as deg within"
        f" 2.. %; {every} overrides this".replace("(", r"\(").replace(")", r"\)"),
        str(warning),
    )


@pytest.mark.parametrize("given", [{"": "deg"}, {f"q{k}": "deg" for k in range(1, 7)}])
def test_the_user_has_the_last_word(given: dict[str, str], read: Read) -> None:
    log = read(text([*joints(), "x [m]", "y [m]", "z [m]"], Q, FLANGE), UR5E, unit=given)
    np.testing.assert_allclose(log.q, np.radians(Q), atol=PRINTED)
    (warning,) = log.warnings
    assert (warning.kind, warning.assumption) == ("unit-contradiction", "the joints are in deg")
    message = (
        "q1, q2, q3, q4, q5, q6: deg (given as an option) contradicts the kinematics: taken as deg, though"
    )
    assert warning.message.startswith(message)
    assert warning.hints[0].value == {f"q{k}": "rad" for k in range(1, 7)}


def test_a_given_length_that_contradicts_the_kinematics_is_used(read: Read) -> None:
    log = read(text([*joints(" [rad]"), "x", "y", "z"], Q, FLANGE), UR5E, unit=dict.fromkeys("xyz", "mm"))
    (warning,) = log.warnings
    assert (log.units["x"], warning.assumption) == ("mm", "the positions are in mm")


@pytest.mark.parametrize("angle", ["rad", "deg"])
@pytest.mark.parametrize("length", ["m", "mm"])
@pytest.mark.parametrize("turn", [(), (0.7, -1.1, 2.5)], ids=["moved", "turned"])
def test_bad_rows_and_another_base_leave_the_proof(
    angle: str, length: str, turn: tuple[float, ...], read: Read
) -> None:
    """One row in ten is wrong by up to a kilometre; the arm rests in half of the rows."""
    placed = UR5E.placed(base=from_offset((0.4, -2.0, 1.0, *turn)), tool=translation(0.0, 0.02, 0.15))
    q = np.repeat(Q, 1 + 60 * (np.arange(ROWS) == 20), axis=0)
    position = positions_over_log(placed, q)
    position[5::10] += np.random.default_rng(7).normal(0.0, 300.0, (len(position[5::10]), 3))
    scales = {"rad": 1.0, "deg": 180 / np.pi, "m": 1.0, "mm": 1e3}
    table = text([*joints(), "x", "y", "z"], q * scales[angle], position * scales[length], rows=len(q))
    log = read(table, UR5E)
    assert (log.units["q1"], log.units["x"]) == (angle, length)
    assert not [one for one in log.warnings if one.assumption]


@pytest.mark.parametrize(("per_rad", "per_m"), [(4096 / 2 / np.pi, 1.0), (1.0, 1 / 0.0254), (1000.0, 1e4)])
def test_other_units_are_proved_to_be_none_of_ours(per_rad: float, per_m: float, read: Read) -> None:
    """Servo ticks are no deg because they are no rad, and in too small a unit no points are near."""
    table = text([*joints(" [rad]"), "x", "y", "z"], Q * per_rad, FLANGE * per_m)
    log = read(table, UR5E, unit=dict.fromkeys(joints(), "rad"))
    assert [one.assumption for one in log.warnings if one.role == "position"]


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
