"""Models traced with CasADi: the same functions of symbols and of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import casadi
import numpy as np
import pytest

from differences import assert_jacobian
from made_masses import DRIVE, with_drives, with_masses
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain, Joint, JointKind, Mimic
from urmpipe_models.arm.denavit_hartenberg import (
    DHRow,
    articulated_6r,
    dh_chain,
    modified_dh_chain,
    urm_chain,
)
from urmpipe_models.delta import delta, exceeds_tolerance
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
    sampled_voltage,
    shaft_acceleration,
    shaft_torque,
)
from urmpipe_models.dynamics import driven_arm, equations, links
from urmpipe_models.kinematics.forward import Motion, forward, jacobian, point_motions, tip_position
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

TRACED = 1e-14  # values of about 1; CasADi may use another sine and simplify, each some 1e-16
SAME = 1e-12  # of the largest value, of sums of many such


def wrench_of(values: Sequence[Any]) -> links.Wrench:
    return links.Wrench(tuple(values[:3]), tuple(values[3:]))


@pytest.fixture(autouse=True)
def numpy_functions_of_symbols() -> None:
    casadi.GlobalOptions.setNumpyMode(-1)


def assert_traces(
    function: Callable[..., Any], samples: Iterable[Sequence[Any]], size: float | None = 1.0
) -> None:
    """Compare a function traced with symbols with the function itself, for samples of its arguments.

    The values are about `size`; without one, the tolerance is `SAME` of the largest of them.
    """
    samples = [*samples]
    symbols = [casadi.SX.sym(f"x{k}", len(argument)) for k, argument in enumerate(samples[0])]
    results = flat(function(*(symbol.elements() for symbol in symbols)))
    traced = casadi.Function("traced", symbols, [casadi.vertcat(*results)])
    for sample in samples:
        expected = np.array(flat(function(*sample)), dtype=float)
        tolerance = SAME * (1.0 + np.abs(expected).max()) if size is None else size * TRACED
        got = np.ravel(np.array(traced(*sample)))
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=tolerance)


def assert_sums_trace(function: Callable[..., Any], *sizes: int) -> None:
    """Compare at 20 random samples of arguments of some sizes, to `SAME` of the largest value."""
    rng = np.random.default_rng(0)
    assert_traces(function, [[rng.normal(size=size) for size in sizes] for _ in range(20)], None)


def flat(results: Any) -> list[Any]:
    """Return nested tuples and lists of elements as one list."""
    nested = isinstance(results, (tuple, list))
    return [leaf for part in results for leaf in flat(part)] if nested else [results]


def entries(motion: Motion) -> list[Any]:
    pose, rates = motion.pose, (motion.velocity, motion.acceleration, motion.omega, motion.alpha)
    return [pose.translation, pose.rotation, rates]


@pytest.mark.parametrize("name", ["urm6", "ur5e"])
def test_kinematics_trace_with_symbolic_joints(name: str) -> None:
    chain = load_robot(name)
    motions = np.random.default_rng(11).uniform(-1.0, 1.0, (20, 3, 6)).tolist()
    joints = [motion[:1] for motion in motions]
    axis, frame = (0.0, 0.6, 0.8), from_rpy(0.1, -0.7, 0.4)
    twists = [Twist(place, kind, axis, frame) for place in range(9) for kind in ("along", "about")]
    assert_traces(lambda q: (forward(chain, q)[-1].translation, tip_position(chain, q)), joints)
    assert_traces(lambda q: (jacobian(chain, q), *sensitivities(chain, q, twists)), joints)
    # 1 / cos(ry), 1 / sin(x), and speeds of up to 6
    for euler_angles in (euler_zyx, euler_zxz):
        assert_traces(lambda q, of=euler_angles: of(forward(chain, q)[-1].rotation), joints, size=20.0)
    assert_traces(lambda *q: entries(point_motions(chain, *q)[-1]), motions, size=20.0)


def test_euler_angles_trace_where_they_are_singular() -> None:
    samples = [[(0.4, 0.0, 0.5)], [(0.4, np.pi, 0.5)], [(-2.0, 0.0, -0.1)], [(0.4, 1.0, 0.5)]]
    assert_traces(lambda x: euler_zxz(from_zxz(*x).rotation), samples)
    assert_traces(lambda x: euler_zxz(rotation_z(x[0]).rotation), [[[0.3]]])
    assert euler_zxz(rotation_z(0.3).rotation) == pytest.approx((0.3, 0.0, 0.0, True), rel=TRACED)


def arms_of(x: Sequence[Any]) -> list[Chain]:
    """Return arms of every kind by 13 lengths and angles: DH, articulated, sliding, following, URM."""
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
        urm_chain("urm6", x[:7], x[7:]),
    ]


@pytest.mark.parametrize("number", range(5), ids=["dh", "modified", "articulated", "follows", "urm"])
def test_arms_of_every_kind_trace_with_all_their_parameters(number: int) -> None:
    joints = len(arms_of([0.1] * 13)[number].coordinates)
    rng = np.random.default_rng(15)
    samples = [[rng.uniform(0.1, 1.0, 13), rng.uniform(-1.0, 1.0, joints)] for _ in range(20)]

    def arm(x: Sequence[Any]) -> Chain:
        return arms_of(x)[number]

    assert_traces(lambda x, q: (forward(arm(x), q)[-1].translation, jacobian(arm(x), q)), samples)
    assert_traces(lambda x, q: entries(point_motions(arm(x), q, q, q)[-1]), samples, size=20.0)


@pytest.mark.parametrize("name", ["urm4", "ur5e", "panda", "articulated6r"])
def test_a_pose_has_derivatives_by_every_parameter(name: str) -> None:
    arm = load_robot(name).placed(from_offset([1.0, 2.0, 3.0]), rotation_x(0.5))
    q = [0.3 * k - 0.7 for k in range(len(arm.coordinates))]
    start = np.array([[parameter.value] for parameter in arm.parameters])

    def entries(values: Iterable[Any]) -> list[Any]:
        names = (parameter.name for parameter in arm.parameters)
        pose = forward(arm.with_parameters(dict(zip(names, values, strict=True))), q)[-1]
        return flat([pose.translation, pose.rotation])

    x = casadi.SX.sym("x", len(start))
    pose = casadi.vertcat(*entries(x.elements()))
    slopes = np.array(casadi.Function("slopes", [x], [casadi.jacobian(pose, x)])(start))
    # up to 5 m; three derivatives by an angle
    assert_jacobian(lambda at: entries(at[:, 0].tolist()), slopes.T, start, third=5.0, size=5.0)


def test_a_deviation_and_its_flag_trace_also_of_missing_values() -> None:
    def of_points(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
        deviation = delta((a[0], a[1], a[2]), (b[0], b[1], b[2]))
        return [deviation, exceeds_tolerance(deviation, 0.0035)]

    samples = [[(1.0, 2.0, 3.0), (1.0, 2.0, 3.004)], [(1.0, 2.0, np.nan), (1.0, 2.0, 3.0)]]
    assert_traces(of_points, samples, size=0.0)


def drive_values(x: Sequence[Any]) -> list[Any]:
    """Return the results of the drive for 13 elements: seven constants, then states and inputs."""
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
    """Return the results of the controller for 13 elements."""
    gains, setpoint, actual = Gains(*x[:3]), JointMotion(*x[3:6]), JointMotion(*x[6:9])
    return [control_voltage(x[9], gains, setpoint, actual, x[10]), sample_index(x[11], x[12])]


@pytest.mark.parametrize("function", [drive_values, controller_values])
def test_drive_and_controller_trace_with_all_their_parameters(function: Callable[..., list[Any]]) -> None:
    samples = np.random.default_rng(14).uniform(0.5, 2.0, (50, 1, 13)).tolist()
    assert_traces(function, samples, size=20.0)  # sums and quotients of up to 20


@pytest.mark.parametrize("kind", [0.0, 1.0, 2.0])
def test_set_points_trace_before_within_and_after_a_move(kind: float) -> None:
    samples = [[[kind, time, 0.5, 3.0, 1.5, 1.0, 4.0]] for time in np.linspace(0.0, 3.0, 31).tolist()]
    assert_traces(lambda x: [*evaluate_setpoint(*x)], samples, size=4.0)


@pytest.mark.slow
@pytest.mark.parametrize("arm", [load_robot("urm6"), load_robot("ur5e"), sliding_arm()])
def test_equations_of_motion_trace(arm: Chain) -> None:
    chain, n = with_masses(arm), len(arm.coordinates)
    motions = partial(links.mass_motions, chain)
    for of_wrench in (equations.inverse_dynamics, equations.torque_terms, equations.forward_dynamics):
        assert_sums_trace(lambda q, v, a, w, f=of_wrench: f(chain, q, v, a, wrench_of(w)), n, n, n, 6)
    for of_q in (equations.mass_matrix, equations.mass_matrix_scales, links.centres_of_mass):
        assert_sums_trace(partial(of_q, chain), n)
    assert_sums_trace(partial(links.potential_energy, chain), n)
    assert_sums_trace(partial(links.kinetic_energy, chain), n, n)
    assert_sums_trace(lambda q, v, w: links.wrench_power(chain, q, v, wrench_of(w)), n, n, 6)
    assert_sums_trace(lambda q, v: [(m.centre, m.velocity, m.omega) for m in motions(q, v)], n, n)


def test_masses_centres_inertias_and_gravity_trace_as_parameters() -> None:
    chain = with_masses(load_robot("urm6"))
    count = len(chain.inertials)

    def of_bodies(q: Any, spread: Any, centres: Any, gravity: Any) -> list[Any]:
        """Return values of bodies of any masses above 1 kg, whose inertias are those of boxes."""
        masses = [1.0 + spread[k] * spread[k] for k in range(count)]
        changed = [
            replace(body, mass=m, centre=tuple(centres[3 * k : 3 * k + 3]), inertia=(m, m, m, 0.1, 0.1, 0.1))
            for k, (body, m) in enumerate(zip(chain.inertials, masses, strict=True))
        ]
        arm = replace(chain, inertials=tuple(changed), gravity=tuple(gravity))
        values = [equations.inverse_dynamics(arm, q, q, q), equations.mass_matrix(arm, q)]
        return [*values, links.kinetic_energy(arm, q, q)]

    assert_sums_trace(of_bodies, 6, count, 3 * count, 3)


def test_a_driven_arm_traces_with_its_drives_as_parameters() -> None:
    chain = with_drives(with_masses(load_robot("urm6")))

    def of_drives(q: Any, qd: Any, motors: Any, x: Any) -> list[Any]:
        constants = [1.5 + value * value for value in x]
        drive = Drive(*(c * constant for c, constant in zip(constants, DRIVE, strict=True)))
        actuators = [driven_arm.Motor(drive, *motors[4 * k : 4 * k + 4]) for k in range(5)]
        spring = driven_arm.Spring(constants[0] * 100.0, constants[1], 0.3)
        state, wrench = driven_arm.ArmState(q, qd, [*actuators, spring]), links.Wrench((1.0, 2.0, 3.0))
        rates = [list(values) for values in driven_arm.motor_derivatives(state).values()]
        flows = [*driven_arm.power_flow(chain, state, wrench), driven_arm.arm_energy(chain, state)]
        return [driven_arm.joint_accelerations(chain, state, wrench), rates, flows]

    assert_sums_trace(of_drives, 6, 6, 20, 7)


def test_a_sampled_voltage_traces() -> None:
    samples = (-200.0, 0.0, 200.0)
    assert_sums_trace(lambda x: [sampled_voltage(x[0], 5e-3, sample, x[1], x[2]) for sample in samples], 3)
