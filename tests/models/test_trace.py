"""The kinematics as CasADi traces them: the very functions, with symbols in place of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi
import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain, Joint, JointKind, Mimic
from urmpipe_models.arm.geometric_models import DHRow, articulated_6r, dh_chain, modified_dh_chain, urm_chain
from urmpipe_models.drives import (
    Drive,
    Gains,
    JointMotion,
    control_voltage,
    current_rate,
    evaluate_setpoint,
    load_acceleration,
    motor_torque,
    sample_index,
    shaft_acceleration,
    shaft_torque,
)
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward, jacobian, point_motions, tip_position
from urmpipe_models.kinematics.identification import Twist, sensitivities
from urmpipe_models.math3d import (
    euler_zxz,
    euler_zyx,
    from_offset,
    from_rpy,
    from_zxz,
    rotation_x,
    rotation_z,
    translation,
)
from urmpipe_models.robots.catalogue import load_robot

TRACED = 1e-14
"""The same operations on values of about 1; CasADi may take another sine and simplify, each some 1e-16."""


def traced(name: str, arguments: Sequence[Any], results: Sequence[Any]) -> Callable[..., FloatArray]:
    """Compile what came out of a trace, flat, as a function of numbers."""
    function = casadi.Function(name, list(arguments), [casadi.vertcat(*results)])
    return lambda *values: np.ravel(np.array(function(*values)))


def flat(results: Any) -> list[Any]:
    """Return nested tuples of elements as one list."""
    return [leaf for one in results for leaf in flat(one)] if isinstance(results, tuple) else [results]


def everything(motion: Any) -> list[Any]:
    pose = motion.pose
    return flat(
        (pose.translation, pose.rotation, motion.velocity, motion.acceleration, motion.omega, motion.alpha)
    )


def assert_traced(got: FloatArray, expected: list[Any], size: float = 1.0) -> None:
    np.testing.assert_allclose(got, np.array(expected, dtype=float), rtol=0.0, atol=size * TRACED)


@pytest.fixture
def symbols() -> list[Any]:
    casadi.GlobalOptions.setNumpyMode(-1)
    return [casadi.SX.sym(name, 6) for name in ("q", "qd", "qdd")]


@pytest.mark.parametrize("name", ["urm6", "ur5e"])
def test_changes_of_frames_trace_with_symbolic_joints(symbols: list[Any], name: str) -> None:
    chain = load_robot(name)
    frame = from_rpy(0.1, -0.7, 0.4)
    twists = [Twist(place, kind, (0.0, 0.6, 0.8), frame) for place in range(9) for kind in ("along", "about")]
    columns_of_q = traced(
        "columns", symbols[:1], flat(tuple(sensitivities(chain, symbols[0].elements(), twists)))
    )
    for values in np.random.default_rng(12).uniform(-1.0, 1.0, (20, 6)).tolist():
        assert_traced(columns_of_q(values), flat(tuple(sensitivities(chain, values, twists))))


@pytest.mark.parametrize("name", ["urm6", "ur5e"])
def test_forward_jacobian_and_motions_trace_with_symbolic_joints(symbols: list[Any], name: str) -> None:
    chain = load_robot(name)
    q, qd, qdd = symbols
    x, xd, xdd = (symbol.elements() for symbol in symbols)
    pose_of = traced("pose", [q], [*forward(chain, x)[-1].translation])
    position_of = traced("position", [q], [*tip_position(chain, x)])
    euler_of = traced("euler", [q], [*euler_zyx(forward(chain, x)[-1].rotation)])
    zxz_of = traced("zxz", [q], [*euler_zxz(forward(chain, x)[-1].rotation)])
    jacobian_of = traced("jacobian", [q], flat(jacobian(chain, x)))
    motion_of = traced("motion", [q, qd, qdd], everything(point_motions(chain, x, xd, xdd)[-1]))
    for values in np.random.default_rng(11).uniform(-1.0, 1.0, (20, 3, 6)).tolist():
        tip = forward(chain, values[0])[-1]
        assert_traced(pose_of(values[0]), flat(tip.translation))
        assert_traced(position_of(values[0]), flat(tip_position(chain, values[0])))
        assert_traced(euler_of(values[0]), flat(euler_zyx(tip.rotation)), size=20.0)  # 1 / cos(ry)
        assert_traced(zxz_of(values[0]), flat(euler_zxz(tip.rotation)), size=20.0)  # 1 / sin(x)
        assert_traced(jacobian_of(values[0]), flat(jacobian(chain, values[0])))
        assert_traced(
            motion_of(*values), everything(point_motions(chain, *values)[-1]), size=20.0
        )  # speeds of up to 6


def test_euler_angles_trace_where_they_are_singular() -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    x = casadi.SX.sym("x", 3)
    zxz_of = traced("zxz", [x], [*euler_zxz(from_zxz(*x.elements()).rotation)])
    for values in [(0.4, 0.0, 0.5), (0.4, np.pi, 0.5), (-2.0, 0.0, -0.1), (0.4, 1.0, 0.5)]:
        assert_traced(zxz_of(values), flat(euler_zxz(from_zxz(*values).rotation)))
    turn = casadi.SX.sym("turn")
    assert_traced(traced("zxz", [turn], [*euler_zxz(rotation_z(turn).rotation)])(0.3), [0.3, 0.0, 0.0, 1.0])


def test_lengths_and_tilts_trace_as_parameters(symbols: list[Any]) -> None:
    q, r, theta = symbols[0], casadi.SX.sym("r", 7), casadi.SX.sym("theta", 6)
    x, zero = q.elements(), [0.0] * 6
    chain = urm_chain("urm6", r.elements(), theta.elements())
    pose_of = traced("pose", [q, r, theta], [*forward(chain, x)[-1].translation])
    jacobian_of = traced("jacobian", [q, r, theta], flat(jacobian(chain, x)))
    motion_of = traced("motion", [q, r, theta], everything(point_motions(chain, x, zero, x)[-1]))
    rng = np.random.default_rng(12)
    for _ in range(20):
        values = rng.uniform(-1.0, 1.0, 6).tolist()
        lengths, tilts = rng.uniform(0.1, 0.3, 7).tolist(), rng.uniform(0.0, 1.5, 6).tolist()
        numeric, given = urm_chain("urm6", lengths, tilts), (values, lengths, tilts)
        assert_traced(pose_of(*given), flat(forward(numeric, values)[-1].translation))
        assert_traced(jacobian_of(*given), flat(jacobian(numeric, values)))
        assert_traced(
            motion_of(*given), everything(point_motions(numeric, values, zero, values)[-1]), size=20.0
        )


def test_one_trace_serves_a_float_and_a_column() -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    chain = load_robot("urm4")
    q = casadi.SX.sym("q", 4)
    pose_of = casadi.Function("pose", [q], [casadi.vertcat(*forward(chain, q.elements())[-1].translation)])
    rows = np.random.default_rng(13).uniform(-4.0, 4.0, (50, 4))
    columns = forward(chain, list(rows.T))[-1].translation
    singles = [forward(chain, row)[-1].translation for row in rows.tolist()]
    np.testing.assert_allclose(np.column_stack(columns), singles, rtol=0.0, atol=TRACED)
    np.testing.assert_allclose(np.array(pose_of.map(50)(rows.T)).T, singles, rtol=0.0, atol=TRACED)


def arms_of(x: Sequence[Any]) -> list[Chain]:
    """Return arms of every kind by 12 lengths and angles: rows of DH, articulated, sliding, following."""
    kinds: tuple[JointKind, ...] = ("revolute", "fixed", "prismatic")
    rows = [
        DHRow(x[k], x[k + 1], x[k + 2], x[k + 3], kind=kind) for k, kind in zip((0, 4, 8), kinds, strict=True)
    ]
    follows = Joint("c", origin=from_rpy(x[0], x[1], x[2]), mimic=Mimic("b", 0.5, 0.1))
    slides = Joint("b", "prismatic", translation(*x[3:6]), (0.0, 0.6, 0.8))
    return [
        dh_chain("dh", rows),
        modified_dh_chain("modified", rows),
        articulated_6r(*x[:5]),
        Chain("follows", (Joint("a"), slides, follows), translation(*x[6:9])),
    ]


@pytest.mark.parametrize("number", range(4), ids=["dh", "modified", "articulated", "follows"])
def test_arms_of_every_kind_trace_with_all_their_parameters(number: int) -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    x = casadi.SX.sym("x", 12)
    joints = len(arms_of([0.1] * 12)[number].coordinates)
    q = casadi.SX.sym("q", joints)

    def values_of(arm: Chain, at: Sequence[Any]) -> list[Any]:
        return [*everything(point_motions(arm, at, at, at)[-1]), *flat(jacobian(arm, at))]

    function = traced("arm", [x, q], values_of(arms_of(x.elements())[number], q.elements()))
    rng = np.random.default_rng(15)
    for _ in range(10):
        parameters, at = rng.uniform(0.1, 1.0, 12).tolist(), rng.uniform(-1.0, 1.0, joints).tolist()
        assert_traced(function(parameters, at), values_of(arms_of(parameters)[number], at), size=100.0)


@pytest.mark.parametrize("name", ["urm4", "ur5e", "panda", "articulated6r"])
def test_a_pose_has_derivatives_by_every_parameter(name: str) -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    arm, step = load_robot(name).placed(from_offset([1.0, 2.0, 3.0]), rotation_x(0.5)), 1e-6
    names, own = [one.name for one in arm.parameters], [one.value for one in arm.parameters]
    q = [0.3 * k - 0.7 for k in range(len(arm.coordinates))]

    def entries(values: Sequence[Any]) -> list[Any]:
        pose = forward(arm.with_parameters(dict(zip(names, values, strict=True))), q)[-1]
        return [*pose.translation, *flat(pose.rotation)]

    x = casadi.SX.sym("x", len(names))
    found = casadi.vertcat(*entries(x.elements()))
    slopes = np.array(casadi.Function("slopes", [x], [casadi.jacobian(found, x)])(own))
    for k, slope in enumerate(slopes.T):
        ahead, behind = (entries([*own[:k], own[k] + h, *own[k + 1 :]]) for h in (step, -step))
        expected = np.subtract(ahead, behind) / (2.0 * step)
        np.testing.assert_allclose(slope, expected, rtol=0.0, atol=1e-8)  # 5 m round to 1e-15, over 2e-6


def drive_values(x: Sequence[Any]) -> list[Any]:
    """Return what the drive's functions give for 13 elements: seven constants, then states and inputs."""
    drive, (theta1, omega1, current, theta2, omega2, voltage) = Drive(*x[:7]), x[7:]
    torque = shaft_torque(drive, theta1, omega1, theta2, omega2)
    return [
        torque,
        motor_torque(drive, current),
        load_acceleration(x[0], x[1], omega2, torque, voltage),
        shaft_acceleration(drive, current, torque),
        current_rate(drive, voltage, omega1, current),
    ]


def controller_values(x: Sequence[Any]) -> list[Any]:
    """Return what the controller's functions give for 13 elements."""
    gains, wanted, real = Gains(*x[:3]), JointMotion(*x[3:6]), JointMotion(*x[6:9])
    return [control_voltage(x[9], gains, wanted, real, x[10]), sample_index(x[11], x[12])]


@pytest.mark.parametrize("values_of", [drive_values, controller_values])
def test_drive_and_controller_trace_with_all_their_parameters(values_of: Callable[..., list[Any]]) -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    x = casadi.SX.sym("x", 13)
    function = traced("values", [x], values_of(x.elements()))
    for values in np.random.default_rng(14).uniform(0.5, 2.0, (50, 13)).tolist():
        assert_traced(function(values), values_of(values), size=20.0)  # sums and quotients of up to 20


@pytest.mark.parametrize("kind", [0.0, 1.0, 2.0])
def test_set_points_trace_before_within_and_after_a_move(kind: float) -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    x = casadi.SX.sym("x", 7)
    function = traced("set_point", [x], [*evaluate_setpoint(*x.elements())])
    for time in np.linspace(0.0, 3.0, 31).tolist():
        values = [kind, time, 0.5, 3.0, 1.5, 1.0, 4.0]
        assert_traced(function(values), [*evaluate_setpoint(*values)], size=4.0)
