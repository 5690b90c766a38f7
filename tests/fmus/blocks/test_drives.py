"""The blocks of a drive, against closed forms, energy balances and an independent integrator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drive_oracle import I1, K, L, motor_after
from fmu_run import FmuRun
from stepped_unit import SteppedUnit, needs_native
from urmpipe_fmus.block import BlockModel, State, Values
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray

STEP = 0.04
HALVINGS = [2e-3 / 2**n for n in range(5)]
BEGIN = {"theta1": 0.02, "omega1": -0.5, "i_a": 3.0, "u": 24.0, "theta2": 0.01, "omega2": 0.3}
MOTOR = ("theta1", "omega1", "i_a")


def orders(errors: list[float]) -> FloatArray:
    """Return by which power of the internal step errors fall, from halving to halving."""
    return np.asarray(-np.diff(np.log2(errors)))


def stepped(duration: float, **changes: float) -> FloatArray:
    """Return theta1, omega1, i_a of the unit after one step."""
    unit = SteppedUnit("dc_drive", BEGIN | changes)
    unit.do_step(0.0, duration)
    return unit.read(*MOTOR)


def native(duration: float, **changes: float) -> FloatArray:
    """Return them of its native FMU."""
    model = make_block("dc_drive")
    with FmuRun(cached_fmu(model, "native"), model, BEGIN | changes) as fmu:
        fmu.over(np.array([0.0, duration]), {})
        return np.array(fmu.get([one for one in model.states if one.name in MOTOR]))


@pytest.mark.parametrize("after", [stepped, pytest.param(native, marks=[pytest.mark.slow, needs_native])])
def test_the_error_against_scipy_falls_with_the_fourth_power(after: Callable[..., FloatArray]) -> None:
    expected = motor_after(BEGIN, STEP)
    size = np.abs(expected).max()
    errors = [float(np.abs(after(STEP, internal_step=h) - expected).max() / size) for h in HALVINGS]
    assert orders(errors)[1:] == pytest.approx(4.0, abs=0.2), errors
    # RK4 in steps of 20 us errs by less, and so does SciPy.
    np.testing.assert_allclose(after(STEP, internal_step=2e-5), expected, rtol=1e-9, atol=0.0)
    # By default, in a step of 0.5 ms, RK4 leaves (h R / L)^5 / 120 = 8e-6 of the current's own mode out.
    np.testing.assert_allclose(after(5e-3), motor_after(BEGIN, 5e-3), rtol=2e-5, atol=0.0)


def load_motion(t: Any) -> tuple[Any, Any]:
    """Return angle and rate of a driven element that is moved from outside."""
    return 0.05 * np.sin(40.0 * t), 2.0 * np.cos(40.0 * t)


POWERS = ("electrical", "joule", "shaft", "work")


def with_powers(model: BlockModel) -> BlockModel:
    """Return a drive whose load moves on its own within a step, and that integrates its powers as well."""

    def derivatives(given: Values) -> dict[str, Any]:
        assert model.derivatives is not None and model.outputs is not None
        values = {one.name: getattr(given, one.name) for one in model.arguments}
        load = dict(zip(("theta2", "omega2"), load_motion(given.time), strict=True))
        v = Values(given.time, values | load)
        powers = {
            "electrical": v.u * v.i_a,
            "joule": v.R * v.i_a**2,
            "shaft": v.l * (v.omega1 - v.omega2) ** 2,
            "work": model.outputs(v)["Mk"] * v.omega2,
        }
        return {**model.derivatives(v), **powers}

    works = tuple(State(name=name, description="Work", unit="J") for name in POWERS)
    return replace(model, variables=(*model.variables, *works), derivatives=derivatives)


def stored(unit: SteppedUnit, time: float) -> float:
    """Return the drive's kinetic, elastic and magnetic energy in [J]."""
    theta1, omega1, current = unit.read(*MOTOR)
    twist = theta1 - load_motion(time)[0]
    return float(0.5 * I1 * omega1**2 + 0.5 * K * twist**2 + 0.5 * L * current**2)


def test_the_energy_balance_closes_with_the_fourth_power_of_the_internal_step() -> None:
    model = with_powers(make_block("dc_drive"))
    open_by = []
    for internal_step in HALVINGS:
        unit = SteppedUnit(model, BEGIN | {"internal_step": internal_step})
        before = stored(unit, 0.0)
        unit.do_step(0.0, STEP)
        electrical, joule, shaft, work = unit.read(*POWERS)
        assert min(electrical, joule, shaft, abs(work)) > 0.01  # no term is there for show, of up to 30 J
        gained = stored(unit, STEP) - before
        open_by.append(abs(electrical - joule - shaft - work - gained) / electrical)
    assert open_by[-1] < 1e-7  # at 0.125 ms; the order below says how to get less
    assert orders(open_by)[1:] == pytest.approx(4.0, abs=0.2), open_by


def test_over_a_log_the_inputs_are_constant_from_sample_to_sample() -> None:
    rng = np.random.default_rng(3)
    limits = {"u": 24.0, "theta2": 0.1, "omega2": 1.0}
    inputs = {name: rng.uniform(-limit, limit, 5) for name, limit in limits.items()}
    found = run(make_block("dc_drive"), np.linspace(0.0, 4.0 * STEP, 5), inputs, {"internal_step": 5e-5})
    state = np.zeros(3)
    for k in range(4):
        values = {name: float(column[k]) for name, column in inputs.items()}
        state = motor_after(values | dict(zip(MOTOR, state, strict=True)), STEP)
        # RK4 in steps of 50 us, four times over
        np.testing.assert_allclose([found[name][k + 1] for name in MOTOR], state, rtol=1e-8)


@pytest.mark.parametrize("parts", [1, 2, 5, 7])
def test_the_communication_step_changes_no_sample(parts: int) -> None:
    gains = {"Kphi": 1.0, "Kw": 0.0, "Keps": 0.0}
    t = 5e-3 / parts * np.arange(200 * parts + 1, dtype=np.float64)
    found = run(make_block("drive_controller"), t, {"set_theta": np.sin(17.0 * t)}, gains)["u"]
    samples = np.cumsum(np.sin(17.0 * np.arange(201) * 5e-3))
    # The limit is not met; the times of a sample differ in their last bit.
    np.testing.assert_allclose(found, np.repeat(samples, parts)[: len(t)], rtol=0.0, atol=1e-10)
