"""The blocks of a drive, against closed forms, energy balances and an independent integrator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from asserting import refusal
from urmpipe_fmus.block import BlockModel, State, Values
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.dependencies import TIME, Dependencies
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.run import run
from urmpipe_models.drives import ramp, step, trapezoid
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import UnitError

K, DAMPING, RATIO, C, R, L, I1 = 2500.0, 5.0, 100.0, 0.05, 0.5, 1e-3, 0.5
"""The parameters at their start values, written out: what is tested computes nothing for its own oracle."""

STEP = 0.04
HALVINGS = [2e-3 / 2**n for n in range(5)]
BEGIN = {"theta1": 0.02, "omega1": -0.5, "i_a": 3.0, "u": 24.0, "theta2": 0.01, "omega2": 0.3}


def instance_of(model: BlockModel, values: Mapping[str, float]) -> Instance:
    instance = Instance(model)
    put(instance, **values)
    return instance


def put(instance: Instance, **values: float) -> None:
    instance.set([instance.reference(name) for name in values], list(values.values()))


def read(instance: Instance, *names: str) -> FloatArray:
    return np.array(instance.get([instance.reference(name) for name in names]))


def orders(errors: list[float]) -> FloatArray:
    """Return by which power of the internal step errors fall, from halving to halving."""
    return np.asarray(-np.diff(np.log2(errors)))


def by_scipy(values: Mapping[str, float], duration: float) -> FloatArray:
    """Return theta1, omega1, i_a after a time with the inputs held: eq. 14-18 written out."""
    u, theta2, omega2 = values["u"], values["theta2"], values["omega2"]

    def rates(_: float, x: FloatArray) -> list[float]:
        theta1, omega1, current = x
        torque = K * (theta1 - theta2) + DAMPING * (omega1 - omega2)
        return [omega1, (RATIO * C * current - torque) / I1, (u - C * RATIO * omega1 - R * current) / L]

    start = [values["theta1"], values["omega1"], values["i_a"]]
    found = solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-14)
    return np.asarray(found.y[:, -1])


def test_the_error_against_scipy_falls_with_the_fourth_power_of_the_internal_step() -> None:
    expected = by_scipy(BEGIN, STEP)
    size = np.abs(expected).max()
    errors = []
    for internal_step in HALVINGS:
        instance = instance_of(make_block("dc_drive"), BEGIN | {"internal_step": internal_step})
        instance.do_step(0.0, STEP)
        errors.append(float(np.abs(read(instance, "theta1", "omega1", "i_a") - expected).max() / size))
    assert (orders(errors)[1:] > 3.8).all(), errors
    assert (orders(errors)[1:] < 4.2).all(), errors


def test_with_small_internal_steps_it_agrees_with_scipy_to_one_in_a_billion() -> None:
    expected = by_scipy(BEGIN, STEP)
    instance = instance_of(make_block("dc_drive"), BEGIN | {"internal_step": 2e-5})
    instance.do_step(0.0, STEP)
    # RK4 in steps of 20 us errs by less, and so does SciPy.
    np.testing.assert_allclose(read(instance, "theta1", "omega1", "i_a"), expected, rtol=1e-9, atol=0.0)


def load_motion(t: Any) -> tuple[Any, Any]:
    """Return angle and rate of a driven element that is moved from outside."""
    return 0.05 * np.sin(40.0 * t), 2.0 * np.cos(40.0 * t)


POWERS = ("electrical", "joule", "shaft", "work")


def with_powers(model: BlockModel) -> BlockModel:
    """Return a drive whose load moves on its own within a step, and that integrates its powers as well."""

    def moving(v: Values) -> Values:
        theta2, omega2 = load_motion(v.time)
        names = [one.name for one in model.arguments]
        return Values(
            v.time, {name: getattr(v, name) for name in names} | {"theta2": theta2, "omega2": omega2}
        )

    def derivatives(given: Values) -> dict[str, Any]:
        assert model.derivatives is not None and model.outputs is not None
        v = moving(given)
        powers = {
            "electrical": v.u * v.i_a,
            "joule": v.R * v.i_a**2,
            "shaft": v.l * (v.omega1 - v.omega2) ** 2,
            "work": model.outputs(v)["Mk"] * v.omega2,
        }
        return {**model.derivatives(v), **powers}

    works = tuple(State(name=name, description="Work", unit="J") for name in POWERS)
    return replace(model, variables=(*model.variables, *works), derivatives=derivatives)


def stored(instance: Instance, time: float) -> float:
    """Return the drive's kinetic, elastic and magnetic energy in [J]."""
    theta1, omega1, current = read(instance, "theta1", "omega1", "i_a")
    twist = theta1 - load_motion(time)[0]
    return float(0.5 * I1 * omega1**2 + 0.5 * K * twist**2 + 0.5 * L * current**2)


def test_the_energy_balance_closes_with_the_fourth_power_of_the_internal_step() -> None:
    model = with_powers(make_block("dc_drive"))
    open_by = []
    for internal_step in HALVINGS:
        instance = instance_of(model, BEGIN | {"internal_step": internal_step})
        before = stored(instance, 0.0)
        instance.do_step(0.0, STEP)
        electrical, joule, shaft, work = read(instance, *POWERS)
        assert min(electrical, joule, shaft, abs(work)) > 0.01  # no term is there for show, of up to 30 J
        gained = stored(instance, STEP) - before
        open_by.append(abs(electrical - joule - shaft - work - gained) / electrical)
    assert open_by[-1] < 1e-7  # at 0.125 ms; the order below says how to get less
    assert orders(open_by)[1:] == pytest.approx(4.0, abs=0.2), open_by


def test_at_its_default_internal_step_a_controllers_period_is_exact_to_parts_in_a_hundred_thousand() -> None:
    instance = instance_of(make_block("dc_drive"), BEGIN)
    instance.do_step(0.0, 5e-3)
    found, expected = read(instance, "theta1", "omega1", "i_a"), by_scipy(BEGIN, 5e-3)
    # In a step of 0.5 ms RK4 leaves (h R / L)^5 / 120 = 8e-6 of the current's own mode out.
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=0.0)


def test_the_torque_follows_the_driven_end_at_once_and_nothing_else_does() -> None:
    found = Dependencies(make_block("dc_drive"))
    inputs = {"u", "theta2", "omega2"}
    assert found.outputs["Mk"] & inputs == {"theta2", "omega2"}
    assert found.outputs["alpha1"] & inputs == {"theta2", "omega2"}
    assert found.derivatives["i_a"] & inputs == {"u"}
    instance = instance_of(make_block("dc_drive"), {"theta1": 0.3, "omega1": 2.0})
    # the same sums in another order: the rounding of the last place
    assert read(instance, "Mk")[0] == pytest.approx(K * 0.3 + DAMPING * 2.0, rel=1e-15)
    instance.set([instance.reference("theta2"), instance.reference("omega2")], [0.1, 1.0])
    torque, acceleration = read(instance, "Mk", "alpha1")
    assert torque == pytest.approx(K * 0.2 + DAMPING * 1.0, rel=1e-15)
    assert acceleration == pytest.approx(-torque / I1, rel=1e-15)


def test_over_a_log_the_inputs_are_held_from_sample_to_sample() -> None:
    t = np.linspace(0.0, 4.0 * STEP, 5)
    rng = np.random.default_rng(3)
    inputs = {
        "u": rng.uniform(-24, 24, 5),
        "theta2": rng.uniform(-0.1, 0.1, 5),
        "omega2": rng.uniform(-1, 1, 5),
    }
    found = run(make_block("dc_drive"), t, inputs, {"internal_step": 5e-5})
    state = np.zeros(3)
    for k in range(4):
        held = {name: float(column[k]) for name, column in inputs.items()}
        state = by_scipy(held | dict(zip(("theta1", "omega1", "i_a"), state, strict=True)), STEP)
        # RK4 in steps of 50 us, four times over
        np.testing.assert_allclose([found[n][k + 1] for n in ("theta1", "omega1", "i_a")], state, rtol=1e-8)


@pytest.mark.parametrize("name", ["k", "l", "i_p", "C", "R", "L", "I1"])
def test_every_constant_must_be_above_0(name: str) -> None:
    instance = Instance(make_block("dc_drive"))
    with pytest.raises(UnitError) as error:
        instance.set([instance.reference(name)], [0.0])
    assert str(error.value) == (f"unit dc_drive: {name}: found 0, allowed: 1e-09 to inf")


def test_a_step_that_diverges_is_refused_and_undone() -> None:
    model = make_block("dc_drive")
    instance = instance_of(model, BEGIN | {"internal_step": 1.0, "L": 1e-9})
    before = instance.save()
    with pytest.raises(UnitError, match=r"unit dc_drive: state .* is not finite"):
        instance.do_step(0.0, 100.0)
    assert instance.save()[2] == before[2]
    assert instance.time == 0.0


GAINS = {"Kphi": 1.0, "Kw": 0.0, "Keps": 0.0}


def times(count: int, step: float, begin: float = 0.0) -> NDArray[np.float64]:
    return np.asarray(begin + np.arange(count) * step, dtype=np.float64)


def voltage(instance: Instance) -> float:
    return float(read(instance, "u")[0])


def test_at_a_sample_the_voltage_follows_its_inputs_at_once_and_then_holds() -> None:
    instance = instance_of(make_block("drive_controller"), GAINS)
    put(instance, set_theta=2.0)
    assert voltage(instance) == 2.0
    put(instance, set_theta=3.0)
    assert voltage(instance) == 3.0
    instance.do_step(0.0, 1e-3)
    put(instance, set_theta=50.0)
    assert voltage(instance) == 3.0
    for k in range(1, 5):
        instance.do_step(k * 1e-3, 1e-3)
    assert voltage(instance) == 3.0 + 50.0 - 5.0  # limited to 48: the sample at 5 ms


@pytest.mark.parametrize("parts", [1, 2, 5, 7])
def test_the_communication_step_changes_no_sample(parts: int) -> None:
    step = 5e-3 / parts
    t = times(200 * parts + 1, step)
    wanted = np.sin(17.0 * t)
    found = run(make_block("drive_controller"), t, {"set_theta": wanted}, GAINS)["u"]
    samples = np.cumsum(np.sin(17.0 * np.arange(201) * 5e-3))
    # The limit is not met; the times of a sample differ in their last bit.
    np.testing.assert_allclose(found, np.repeat(samples, parts)[: len(t)], rtol=0.0, atol=1e-10)


def test_a_communication_step_above_the_period_samples_at_every_point() -> None:
    t = times(6, 0.02)
    found = run(make_block("drive_controller"), t, {"set_theta": np.ones(6)}, GAINS)["u"]
    np.testing.assert_array_equal(found, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])


def test_a_sample_that_no_communication_point_meets_is_taken_at_the_next() -> None:
    t = times(8, 3e-3)  # samples at 0, 5, 10, 15, 20 ms
    found = run(make_block("drive_controller"), t, {"set_theta": np.ones(8)}, GAINS)["u"]
    np.testing.assert_array_equal(found, [1.0, 1.0, 2.0, 2.0, 3.0, 4.0, 4.0, 5.0])


def test_a_run_that_begins_late_takes_one_sample_a_period_from_there() -> None:
    t = times(11, 1e-3, begin=10.0)
    found = run(make_block("drive_controller"), t, {"set_theta": np.ones(11)}, GAINS)["u"]
    np.testing.assert_array_equal(found, np.repeat([1.0, 2.0, 3.0], [5, 5, 1]))


def test_a_run_that_begins_before_0_takes_one_sample_a_period_from_there() -> None:
    t = times(11, 1e-3, begin=-0.02)
    found = run(make_block("drive_controller"), t, {"set_theta": np.ones(11)}, GAINS)["u"]
    np.testing.assert_array_equal(found, np.repeat([1.0, 2.0, 3.0], [5, 5, 1]))


def test_eq_20_weighs_the_three_errors_and_keeps_within_the_limit() -> None:
    instance = instance_of(make_block("drive_controller"), {"last": 10.0})
    put(instance, set_theta=1.0, set_omega=2.0, set_alpha=30.0)
    put(instance, real_theta=0.5, real_omega=3.0, real_alpha=10.0)
    # the same sum in another order: the rounding of the last place
    assert voltage(instance) == pytest.approx(10.0 + 7.5 * 0.5 - 0.75 * 1.0 + 0.01 * 20.0, rel=1e-15)
    put(instance, set_theta=1e6)
    assert voltage(instance) == 48.0
    put(instance, set_theta=-1e6)
    assert voltage(instance) == -48.0


def test_going_back_takes_the_same_sample_again() -> None:
    instance = instance_of(make_block("drive_controller"), GAINS)
    put(instance, set_theta=2.0)
    instance.do_step(0.0, 5e-3)
    saved = instance.save()
    first = voltage(instance)
    instance.do_step(5e-3, 5e-3)
    instance.restore(saved)
    assert voltage(instance) == first == 4.0


def test_the_period_is_fixed_once_it_runs_and_cannot_be_0() -> None:
    instance = Instance(make_block("drive_controller"))
    change = [instance.reference("period")]
    assert refusal(UnitError, instance.set, change, [0.0]) == (
        "unit drive_controller: period: found 0, allowed: 1e-06 to inf"
    )
    instance.do_step(0.0, 5e-3)
    assert refusal(UnitError, instance.set, change, [1e-3]) == (
        "unit drive_controller: period: set while it runs, allowed: a fixed parameter before the first step"
    )


TIMES = np.linspace(0.0, 2.0, 41)


def constant(value: float) -> np.ndarray:
    return np.full(len(TIMES), value)


def test_without_friction_a_constant_torque_makes_a_parabola() -> None:
    found = run(make_block("inertia"), TIMES, {"tau": constant(3.0), "tau_ext": constant(-1.0)}, {"J": 4.0})
    # RK4 is exact for it; sums of 4000 internal steps round.
    np.testing.assert_allclose(found["theta"], 0.25 * TIMES**2, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found["omega"], 0.5 * TIMES, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(found["alpha"], constant(0.5))


def test_with_friction_the_speed_nears_torque_over_friction() -> None:
    start = {"J": 2.0, "d": 4.0, "omega": 3.0, "theta": 1.0}
    found = run(make_block("inertia"), TIMES, {"tau": constant(8.0)}, start)
    omega = 2.0 + np.exp(-2.0 * TIMES)
    # (h d / J)^5 / 120 a step of 0.5 ms: far below rounding.
    np.testing.assert_allclose(found["omega"], omega, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(
        found["theta"], 1.0 + 2.0 * TIMES + 0.5 * (1.0 - np.exp(-2.0 * TIMES)), rtol=0.0, atol=1e-12
    )
    np.testing.assert_allclose(found["alpha"], -2.0 * np.exp(-2.0 * TIMES), rtol=0.0, atol=1e-11)


def test_the_acceleration_is_that_of_the_torques_as_they_stand() -> None:
    assert Dependencies(make_block("inertia")).outputs["alpha"] == {"J", "d", "omega", "tau", "tau_ext"}
    instance = Instance(make_block("inertia"))
    for torque in (5.0, -3.0):
        instance.set([instance.reference("tau")], [torque])
        # divided by 1: the rounding of the last place
        assert instance.get([instance.reference("alpha")]) == [pytest.approx(torque, rel=1e-15)]


T = np.linspace(0.0, 2.0, 81)
MOVE = {"begin": 0.25, "initial": 0.5, "target": -1.0, "speed": 1.5, "acceleration": 6.0}


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (0, step(T, 0.25, 0.5, -1.0)),
        (1, ramp(T, 0.25, 0.5, -1.0, 1.5)),
        (2, trapezoid(T, 0.25, 0.5, -1.0, 1.5, 6.0)),
    ],
)
def test_each_kind_is_its_form_for_a_log_and_for_an_instance(
    kind: int, expected: tuple[np.ndarray, ...]
) -> None:
    found = run(make_block("set_point"), T, start=MOVE | {"kind": kind})
    instance = Instance(make_block("set_point"))
    names = ("theta", "omega", "alpha")
    instance.set([instance.reference(name) for name in (*MOVE, "kind")], [*MOVE.values(), float(kind)])
    for name, column in zip(names, expected, strict=True):
        np.testing.assert_array_equal(found[name], column)
    for k in range(3):
        got = instance.get([instance.reference(name) for name in names])
        assert got == [column[k] for column in expected]
        instance.do_step(float(T[k]), float(T[k + 1] - T[k]))


def test_it_is_a_function_of_time_and_parameters_alone() -> None:
    parameters = {"kind", "begin", "initial", "target", "speed", "acceleration"}
    assert Dependencies(make_block("set_point")).outputs["theta"] == parameters | {TIME}


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("kind", 3.0, "found 3, allowed: 0 to 2"),
        ("kind", 1.5, "found 1.5, allowed: an integer of 32 bits"),
        ("speed", 0.0, "found 0, allowed: 1e-09 to inf"),
        ("acceleration", -1.0, "found -1, allowed: 1e-09 to inf"),
    ],
)
def test_what_makes_no_move_is_refused(name: str, value: float, said: str) -> None:
    instance = Instance(make_block("set_point"))
    message = refusal(UnitError, instance.set, [instance.reference(name)], [value])
    assert message == f"unit set_point: {name}: {said}"
