"""The equations of motion as CasADi traces them: the very functions, with symbols in place of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
import pytest
from numpy.testing import assert_allclose

from made_masses import DRIVE, with_drives, with_masses
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import Drive, sampled_voltage
from urmpipe_models.dynamics import driven_arm, equations, links
from urmpipe_models.robots.catalogue import load_robot

SAME = 1e-12  # of the largest value, as is required: CasADi takes another sine and simplifies


def flat(results: Any) -> list[Any]:
    if isinstance(results, (list, tuple)):
        return [leaf for result in results for leaf in flat(result)]
    return [results]


def assert_traced(function: Callable[..., Any], *sizes: int) -> None:
    """Compare a trace with the function in some random states."""
    casadi.GlobalOptions.setNumpyMode(-1)
    symbols = [casadi.SX.sym("x", size) for size in sizes]
    results = flat(function(*(x.elements() for x in symbols)))
    traced = casadi.Function("f", symbols, [casadi.vertcat(*results)])
    rng = np.random.default_rng(0)
    for _ in range(20):
        values = [rng.normal(size=size) for size in sizes]
        expected = np.array(flat(function(*values)), dtype=float)
        atol = SAME * (1.0 + np.abs(expected).max())
        assert_allclose(np.ravel(np.array(traced(*values))), expected, rtol=0.0, atol=atol)


def wrench_of(values: Sequence[Any]) -> links.Wrench:
    return links.Wrench(tuple(values[:3]), tuple(values[3:]))


@pytest.mark.slow
@pytest.mark.parametrize("arm", [load_robot("urm6"), load_robot("ur5e"), sliding_arm()])
def test_equations_of_motion_trace(arm: Chain) -> None:
    chain, n = with_masses(arm), len(arm.coordinates)
    for function in (equations.inverse_dynamics, equations.torque_terms, equations.forward_dynamics):
        assert_traced(lambda q, v, a, w, f=function: f(chain, q, v, a, wrench_of(w)), n, n, n, 6)
    for of_q in (equations.mass_matrix, equations.mass_matrix_scales, links.centres_of_mass):
        assert_traced(lambda q, f=of_q: f(chain, q), n)
    assert_traced(lambda q, v: [links.kinetic_energy(chain, q, v), links.potential_energy(chain, q)], n, n)
    assert_traced(lambda q, v, w: links.wrench_power(chain, q, v, wrench_of(w)), n, n, 6)
    motions = links.mass_motions
    assert_traced(lambda q, v: [(m.centre, m.velocity, m.omega) for m in motions(chain, q, v)], n, n)


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

    assert_traced(of_bodies, 6, count, 3 * count, 3)


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

    assert_traced(of_drives, 6, 6, 20, 7)


def test_a_sampled_voltage_traces() -> None:
    samples = (-200.0, 0.0, 200.0)
    assert_traced(lambda x: [sampled_voltage(x[0], 5e-3, sample, x[1], x[2]) for sample in samples], 3)
