"""Laws of the equations of motion that hold for any arm: with slides, mimics, fixed frames, odd axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from asserting import refusal
from made_masses import body, with_masses
from random_arms import random_arm
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.dynamics import equations, links
from urmpipe_models.dynamics.equations import check_solvable, forward_dynamics, inverse_dynamics, torque_terms
from urmpipe_models.dynamics.links import Wrench, kinetic_energy, potential_energy
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import point_motions
from urmpipe_models.math3d import from_offset
from urmpipe_models.robots.catalogue import load_robot

ROUNDED = 1e-11  # sums of some thousand products, of values up to some hundred


def random_state(chain: Chain, seed: int, count: int = 3) -> FloatArray:
    """Some sets of numbers, one a coordinate: shape (count, coordinates)."""
    return np.random.default_rng(seed + 1).normal(size=(count, len(chain.coordinates)))


SEEDS = st.integers(0, 10**6)
WRENCH = Wrench((1.0, -2.0, 3.0), (0.5, 0.2, -0.4))


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(SEEDS)
def test_power_mass_matrix_terms_recursion_and_forward_dynamics_are_one_equation(seed: int) -> None:
    chain = random_arm(np.random.default_rng(seed), 1 + seed % 4)
    q, qd, qdd = random_state(chain, seed)
    tau = np.array(inverse_dynamics(chain, q, qd, qdd, WRENCH), dtype=float)
    # tau . q' = dT/dt + dU/dt + what the tool takes, by a complex step along the motion
    step = 1e-20j  # of a complex step the difference is exact to rounding
    moved, faster = q + step * qd, qd + step * qdd
    change = np.imag(kinetic_energy(chain, moved, faster) + potential_energy(chain, moved)) / 1e-20
    power = tau @ qd + links.wrench_power(chain, q, qd, WRENCH)
    assert power == pytest.approx(change, rel=ROUNDED, abs=ROUNDED * (1.0 + np.abs(tau) @ np.abs(qd)))
    terms = torque_terms(chain, q, qd, qdd, WRENCH)
    size = ROUNDED * (1.0 + np.abs(np.array(terms, dtype=float)).sum())
    assert_allclose(np.sum(terms, axis=0), tau, rtol=0.0, atol=size)
    M = np.array(equations.mass_matrix(chain, q), dtype=float)
    assert_array_equal(M, M.T)
    assert_allclose(M @ qdd, np.array(terms.inertia, dtype=float), rtol=0.0, atol=size)
    assert 0.5 * qd @ M @ qd == pytest.approx(kinetic_energy(chain, q, qd), rel=ROUNDED)
    # centrifugal is what squares of rates need without gravity, Coriolis what products need
    free, still = replace(chain, gravity=(0.0, 0.0, 0.0)), np.zeros_like(q)
    single = np.array([inverse_dynamics(free, q, list(rate), still) for rate in np.diag(qd)], dtype=float)
    products = np.array(inverse_dynamics(free, q, qd, still), dtype=float) - single.sum(axis=0)
    size = ROUNDED * (1.0 + np.abs(single).sum())
    assert_allclose(np.array(terms.centrifugal, dtype=float), single.sum(axis=0), rtol=0.0, atol=size)
    assert_allclose(np.array(terms.coriolis, dtype=float), products, rtol=0.0, atol=10.0 * size)
    try:
        check_solvable(chain)
    except RobotError:  # slides along one line, with no mass between them
        return
    accelerations = forward_dynamics(chain, q, qd, qdd.tolist(), WRENCH)  # of any torques
    again = inverse_dynamics(chain, q, qd, accelerations, WRENCH)
    terms = torque_terms(chain, q, qd, accelerations, WRENCH)
    # the residual of a positive definite system is rounding of the terms, whatever its condition
    size = 1e-12 * (1.0 + np.abs(np.array(terms, dtype=float)).sum())
    assert_allclose(np.array(again, dtype=float), qdd, rtol=0.0, atol=size)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_centres_move_as_points_of_the_chain_do(seed: int) -> None:
    """A mass at the tool centre point, and omega, as the kinematics have them."""
    chain = random_arm(np.random.default_rng(seed), 1 + seed % 4)
    q, qd, _ = random_state(chain, seed)
    body = Inertial(chain.joints[-1].name, 1.0, (chain.tip @ chain.tool).translation)
    carrying = replace(chain, inertials=(body,))
    *_, tip = point_motions(chain, q, qd, [0.0] * len(q))
    (mass,) = links.mass_motions(carrying, q, qd)
    assert_allclose(mass.centre, tip.pose.translation, rtol=0.0, atol=ROUNDED)
    assert_allclose(mass.velocity, tip.velocity, rtol=0.0, atol=ROUNDED)
    assert np.linalg.norm(mass.omega) == pytest.approx(np.linalg.norm(tip.omega), abs=ROUNDED)
    assert_array_equal(links.centres_of_mass(carrying, q), [mass.centre])


def test_the_base_turns_the_arm_under_gravity() -> None:
    chain, base = with_masses(load_robot("ur5e")), from_offset((1.0, 2.0, 3.0, 0.4, -0.8, 1.2))
    pulled = replace(chain, gravity=base.inverse().rotate((0.0, 0.0, -9.81)))
    q, qd, qdd = random_state(chain, 3)
    turned, seen_from_the_base = (inverse_dynamics(arm, q, qd, qdd) for arm in (chain.placed(base), pulled))
    assert_allclose(turned, seen_from_the_base, rtol=1e-12)


def test_bodies_that_are_fixed_to_one_frame_are_one_body() -> None:
    rng = np.random.default_rng(4)
    bodies = tuple(body(joint, rng) for joint in ("phi3", "effector", "phi6"))
    masses = [link.mass for link in links.chain_to_links(replace(load_robot("urm6"), inertials=bodies)).links]
    assert masses == [0.0, 0.0, bodies[0].mass, 0.0, 0.0, bodies[1].mass + bodies[2].mass]


def test_long_logs_are_as_each_row() -> None:
    chain = with_masses(load_robot("urm6"))
    q, qd, qdd = np.random.default_rng(5).normal(size=(3, 40_000, 6))  # more than two blocks
    tau = equations.torques_over_log(chain, q, qd, qdd)
    terms = equations.torque_terms_over_log(chain, q, qd, qdd)
    assert_allclose(sum(terms.values()), tau, rtol=0.0, atol=1e-11)
    kinetic, potential = equations.energies_over_log(chain, q, qd)
    for k in (0, 20_000, 39_999):
        assert_array_equal(tau[k], inverse_dynamics(chain, q[k], qd[k], qdd[k]))
        assert kinetic[k] == kinetic_energy(chain, q[k], qd[k])
        assert potential[k] == potential_energy(chain, q[k])


@pytest.mark.slow
def test_energy_is_kept_over_a_second() -> None:
    """urm6 swings from its side without friction: 1e-8 of the energy it swings with."""
    chain = with_masses(load_robot("urm6"))
    start = np.concatenate((np.full(6, 0.5), np.linspace(-1.0, 1.0, 6)))

    def rates(_t: float, x: FloatArray) -> FloatArray:
        return np.concatenate((x[6:], forward_dynamics(chain, list(x[:6]), list(x[6:]), [0.0] * 6)))

    states = solve_ivp(rates, (0.0, 1.0), start, "DOP853", rtol=1e-10, atol=1e-10).y.T
    kinetic, potential = equations.energies_over_log(chain, *map(np.ascontiguousarray, np.hsplit(states, 2)))
    total = kinetic + potential
    assert np.ptp(kinetic) > 5.0  # it swings
    assert np.abs(total - total[0]).max() <= 1e-8 * np.ptp(kinetic)


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(1, 7))
def test_positive_definite_systems_are_solved(seed: int, size: int) -> None:
    root, right = np.split(np.random.default_rng(seed).normal(size=(size + 1, size)), [size])
    matrix = root @ root.T + 0.1 * np.eye(size)
    solution = equations.solve_ldl(matrix.tolist(), right[0].tolist())
    assert_allclose(matrix @ solution, right[0], rtol=0.0, atol=1e-13 * np.linalg.cond(matrix))


@pytest.mark.parametrize("seed", range(20))
def test_a_point_on_the_axis_of_the_last_joint_is_found_wherever_the_arm_stands(seed: int) -> None:
    chain = with_masses(load_robot("ur5e"), seed)
    others = tuple(body for body in chain.inertials if body.joint != "wrist_3_joint")
    far = from_offset((100.0 * np.random.default_rng(seed).normal(size=3)).tolist())
    point = Inertial("wrist_3_joint", 0.5, (0.0, 0.0, 0.05))
    speck = Inertial("wrist_3_joint", 1e-3, (0.0, 0.0, 0.05), (1e-9, 1e-9, 1e-9, 0.0, 0.0, 0.0))
    message = refusal(RobotError, check_solvable, replace(chain, inertials=(*others, point)).placed(far))
    assert message.startswith("robot ur5e: joint wrist_3_joint: no inertia resists its own motion")
    assert len(message.splitlines()) == 1
    check_solvable(replace(chain, inertials=(*others, speck)).placed(far))


def test_a_frame_far_before_the_first_joint_costs_no_digits() -> None:
    chain = with_masses(load_robot("ur5e"))
    far = replace(chain, joints=(Joint("rail", "fixed", from_offset((1e4, 0.0, 0.0))), *chain.joints))
    q, qd, qdd = (list(row) for row in random_state(chain, 8))
    on_rail, near = (forward_dynamics(arm, q, qd, qdd) for arm in (far, chain))
    assert_allclose(on_rail, near, rtol=1e-12)  # M's condition is some 1e4
