"""The controller as a unit: when it samples, what it holds, how its output follows the inputs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from asserting import refusal
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.run import Instance, run
from urmpipe_models.errors import UnitError

GAINS = {"Kphi": 1.0, "Kw": 0.0, "Keps": 0.0}


def times(count: int, step: float, begin: float = 0.0) -> NDArray[np.float64]:
    return np.asarray(begin + np.arange(count) * step, dtype=np.float64)


def controller(**starts: float) -> Instance:
    instance = Instance(make_block("drive_controller"))
    instance.set([instance.reference(name) for name in starts], list(starts.values()))
    return instance


def voltage(instance: Instance) -> float:
    return float(instance.get([instance.reference("u")])[0])


def put(instance: Instance, name: str, value: float) -> None:
    instance.set([instance.reference(name)], [value])


def test_at_a_sample_the_voltage_follows_its_inputs_at_once_and_then_holds() -> None:
    instance = controller(**GAINS)
    put(instance, "set_theta", 2.0)
    assert voltage(instance) == 2.0
    put(instance, "set_theta", 3.0)
    assert voltage(instance) == 3.0
    instance.do_step(0.0, 1e-3)
    put(instance, "set_theta", 50.0)
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
    instance = controller(last=10.0)
    for name, value in (("set_theta", 1.0), ("set_omega", 2.0), ("set_alpha", 30.0)):
        put(instance, name, value)
    for name, value in (("real_theta", 0.5), ("real_omega", 3.0), ("real_alpha", 10.0)):
        put(instance, name, value)
    # the same sum in another order: the rounding of the last place
    assert voltage(instance) == pytest.approx(10.0 + 7.5 * 0.5 - 0.75 * 1.0 + 0.01 * 20.0, rel=1e-15)
    put(instance, "set_theta", 1e6)
    assert voltage(instance) == 48.0
    put(instance, "set_theta", -1e6)
    assert voltage(instance) == -48.0


def test_going_back_takes_the_same_sample_again() -> None:
    instance = controller(**GAINS)
    put(instance, "set_theta", 2.0)
    instance.do_step(0.0, 5e-3)
    saved = instance.save()
    first = voltage(instance)
    instance.do_step(5e-3, 5e-3)
    instance.restore(saved)
    assert voltage(instance) == first == 4.0


def test_the_period_is_fixed_once_it_runs_and_cannot_be_0() -> None:
    instance = controller()
    with pytest.raises(UnitError) as error:
        put(instance, "period", 0.0)
    assert str(error.value) == ("unit drive_controller: period: found 0, allowed: 1e-06 to inf")
    instance.do_step(0.0, 5e-3)
    assert refusal(UnitError, put, instance, "period", 1e-3) == (
        "unit drive_controller: period: set while it runs, allowed: a fixed parameter before the first step"
    )
