"""The equations of motion as CasADi traces them: the very functions, with symbols in place of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
import pytest

from made_masses import DRIVE, with_drives, with_masses
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import Drive, sampled_voltage
from urmpipe_models.dynamics.driven_arm import (
    ArmState,
    Motor,
    Spring,
    arm_energy,
    joint_accelerations,
    motor_derivatives,
    power_flow,
)
from urmpipe_models.dynamics.equations import (
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    mass_matrix_scales,
    torque_terms,
)
from urmpipe_models.dynamics.links import (
    Wrench,
    centres_of_mass,
    kinetic_energy,
    mass_motions,
    potential_energy,
    wrench_power,
)
from urmpipe_models.robots.catalogue import load_robot

SAME = 1e-12
"""Of the largest value, as is required: CasADi takes another sine and simplifies."""


def flat(results: Any) -> list[Any]:
    if isinstance(results, (list, tuple)):
        return [leaf for one in results for leaf in flat(one)]
    return [results]


def assert_traced(function: Callable[..., Any], sizes: Sequence[int], seed: int = 0) -> None:
    """Hold a trace against the function in some random states."""
    casadi.GlobalOptions.setNumpyMode(-1)
    symbols = [casadi.SX.sym("x", size) for size in sizes]
    results = flat(function(*(x.elements() for x in symbols)))
    traced = casadi.Function("f", symbols, [casadi.vertcat(*results)])
    rng = np.random.default_rng(seed)
    for _ in range(20):
        values = [rng.normal(size=size) for size in sizes]
        expected = np.array(flat(function(*values)), dtype=float)
        got = np.ravel(np.array(traced(*values)))
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=SAME * (1.0 + np.abs(expected).max()))


@pytest.mark.slow
@pytest.mark.parametrize("arm", [load_robot("urm6"), load_robot("ur5e"), sliding_arm()])
def test_equations_of_motion_trace(arm: Chain) -> None:
    chain, n = with_masses(arm), len(arm.coordinates)

    def wrench_of(values: Sequence[Any]) -> Wrench:
        x, y, z, mx, my, mz = values
        return Wrench((x, y, z), (mx, my, mz))

    assert_traced(lambda q, v, a, w: inverse_dynamics(chain, q, v, a, wrench_of(w)), [n, n, n, 6])
    assert_traced(lambda q, v, a, w: torque_terms(chain, q, v, a, wrench_of(w)), [n, n, n, 6])
    assert_traced(lambda q, v, a, w: forward_dynamics(chain, q, v, a, wrench_of(w)), [n, n, n, 6])
    assert_traced(lambda q: [mass_matrix(chain, q), mass_matrix_scales(chain, q)], [n])
    assert_traced(lambda q, v: [kinetic_energy(chain, q, v), potential_energy(chain, q)], [n, n])
    assert_traced(lambda q, v, w: wrench_power(chain, q, v, wrench_of(w)), [n, n, 6])
    assert_traced(lambda q: centres_of_mass(chain, q), [n])
    assert_traced(
        lambda q, v: [(one.centre, one.velocity, one.omega) for one in mass_motions(chain, q, v)], [n, n]
    )


def test_masses_centres_inertias_and_gravity_trace_as_parameters() -> None:
    chain = with_masses(load_robot("urm6"))
    count = len(chain.inertials)

    def of_bodies(q: Any, spread: Any, centres: Any, gravity: Any) -> list[Any]:
        """What numbers drawn from spread make: bodies that there are, their inertias those of boxes."""
        masses = [1.0 + spread[k] * spread[k] for k in range(count)]
        changed = [
            replace(one, mass=m, centre=tuple(centres[3 * k : 3 * k + 3]), inertia=(m, m, m, 0.1, 0.1, 0.1))
            for k, (one, m) in enumerate(zip(chain.inertials, masses, strict=True))
        ]
        arm = replace(chain, inertials=tuple(changed), gravity=tuple(gravity))
        return [inverse_dynamics(arm, q, q, q), mass_matrix(arm, q), kinetic_energy(arm, q, q)]

    assert_traced(of_bodies, [6, count, 3 * count, 3])


def test_a_driven_arm_traces_with_its_drives_as_parameters() -> None:
    chain = with_drives(with_masses(load_robot("urm6")))

    def everything(q: Any, qd: Any, motors: Any, x: Any) -> list[Any]:
        constants = [1.5 + value * value for value in x]
        drive = Drive(*(c * constant for c, constant in zip(constants, DRIVE, strict=True)))
        actuators = [Motor(drive, *motors[4 * k : 4 * k + 4]) for k in range(5)]
        state = ArmState(q, qd, [*actuators, Spring(constants[0] * 100.0, constants[1], 0.3)])
        wrench = Wrench((1.0, 2.0, 3.0))
        rates = [list(one) for one in motor_derivatives(state).values()]
        flows = [*power_flow(chain, state, wrench), arm_energy(chain, state)]
        return [joint_accelerations(chain, state, wrench), rates, flows]

    assert_traced(everything, [6, 6, 20, 7])


def test_a_held_voltage_traces() -> None:
    def voltages(values: Any) -> list[Any]:
        time, fresh, last = values
        return [sampled_voltage(time, 5e-3, sample, fresh, last) for sample in (-200.0, 0.0, 200.0)]

    assert_traced(voltages, [3])
