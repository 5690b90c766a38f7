"""Laws of the equations of motion that hold for any arm: with slides, mimics, fixed frames, odd axes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from asserting import refusal
from made_masses import body, with_masses
from random_arms import random_arm
from sliding_arm import sliding_arm
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.dynamics.equations import (
    check_solvable,
    energies_over_log,
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    solve_ldl,
    torque_terms,
    torque_terms_over_log,
    torques_over_log,
)
from urmpipe_models.dynamics.links import (
    Wrench,
    centres_of_mass,
    chain_to_links,
    kinetic_energy,
    mass_motions,
    potential_energy,
    wrench_power,
)
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.kinematics.forward import point_motions
from urmpipe_models.math3d import from_offset
from urmpipe_models.robots.catalogue import load_robot

ROUNDED = 1e-11
"""Sums of some thousand products, of values up to some hundred."""


def seeded_arm(seed: int) -> Chain:
    """An arm of one to four coordinates, with fixed joints and mimics, at any base, under any gravity."""
    return random_arm(np.random.default_rng(seed), 1 + seed % 4)


def random_state(chain: Chain, seed: int, count: int = 3) -> FloatArray:
    """Some sets of numbers, one a coordinate: shape (count, coordinates)."""
    return np.random.default_rng(seed + 1).normal(size=(count, len(chain.coordinates)))


SEEDS = st.integers(0, 10**6)


@settings(max_examples=50, deadline=None)
@given(SEEDS)
def test_the_power_of_the_torques_is_the_change_of_the_energy(seed: int) -> None:
    """tau . q' = dT/dt + dU/dt + what the tool takes, by a complex step along the motion."""
    chain = seeded_arm(seed)
    q, qd, qdd = random_state(chain, seed)
    wrench = Wrench((1.0, -2.0, 3.0), (0.5, 0.2, -0.4))
    tau = inverse_dynamics(chain, q, qd, qdd, wrench)
    step = 1e-20j  # of a complex step the difference is exact to rounding
    moved, faster = q + step * qd, qd + step * qdd
    change = np.imag(kinetic_energy(chain, moved, faster) + potential_energy(chain, moved)) / 1e-20
    power = np.dot(tau, qd) + wrench_power(chain, q, qd, wrench)
    assert power == pytest.approx(change, rel=ROUNDED, abs=ROUNDED * (1.0 + np.abs(tau) @ np.abs(qd)))


@settings(max_examples=50, deadline=None)
@given(SEEDS)
def test_mass_matrix_terms_and_recursion_are_one_equation(seed: int) -> None:
    chain = seeded_arm(seed)
    q, qd, qdd = random_state(chain, seed)
    wrench = Wrench((1.0, -2.0, 3.0), (0.5, 0.2, -0.4))
    terms = torque_terms(chain, q, qd, qdd, wrench)
    total = np.array(inverse_dynamics(chain, q, qd, qdd, wrench), dtype=float)
    size = ROUNDED * (1.0 + np.abs(np.array(terms, dtype=float)).sum())
    np.testing.assert_allclose(np.sum(terms, axis=0), total, rtol=0.0, atol=size)
    M = np.array(mass_matrix(chain, q), dtype=float)
    np.testing.assert_array_equal(M, M.T)
    np.testing.assert_allclose(M @ qdd, np.array(terms.inertia, dtype=float), rtol=0.0, atol=size)
    energy = kinetic_energy(chain, q, qd)
    assert 0.5 * qd @ M @ qd == pytest.approx(energy, rel=ROUNDED)


@settings(max_examples=50, deadline=None)
@given(SEEDS)
def test_centrifugal_is_what_squares_and_coriolis_what_products_of_rates_need(seed: int) -> None:
    chain = seeded_arm(seed)
    q, qd, _ = random_state(chain, seed)
    still, count = np.zeros_like(q), len(q)

    def of_rates(rates: FloatArray) -> FloatArray:
        """What rates need without gravity."""
        free = replace(chain, gravity=(0.0, 0.0, 0.0))
        return np.array(inverse_dynamics(free, q, list(rates), still), dtype=np.float64)

    alone = [of_rates(np.where(np.arange(count) == k, qd, 0.0)) for k in range(count)]
    terms = torque_terms(chain, q, qd, still)
    size = ROUNDED * (1.0 + np.abs(alone).sum())
    np.testing.assert_allclose(np.array(terms.centrifugal, float), np.sum(alone, axis=0), rtol=0.0, atol=size)
    products = of_rates(qd) - np.sum(alone, axis=0)
    np.testing.assert_allclose(np.array(terms.coriolis, float), products, rtol=0.0, atol=10.0 * size)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_centres_move_as_points_of_the_chain_do(seed: int) -> None:
    """A mass at the tool centre point, and omega, as the kinematics have them."""
    chain = seeded_arm(seed)
    q, qd, _ = random_state(chain, seed)
    last = chain.joints[-1].name
    tool = (chain.tip @ chain.tool).translation
    carrying = replace(chain, inertials=(Inertial(last, 1.0, tool),))
    *_, motion = point_motions(chain, q, qd, [0.0] * len(q))
    (found,) = mass_motions(carrying, q, qd)
    np.testing.assert_allclose(found.centre, motion.pose.translation, rtol=0.0, atol=ROUNDED)
    np.testing.assert_allclose(found.velocity, motion.velocity, rtol=0.0, atol=ROUNDED)
    assert np.linalg.norm(found.omega) == pytest.approx(np.linalg.norm(motion.omega), abs=ROUNDED)
    (centre,) = centres_of_mass(carrying, q)
    np.testing.assert_array_equal(centre, found.centre)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_forward_dynamics_undo_the_inverse(seed: int) -> None:
    chain = seeded_arm(seed)
    try:
        check_solvable(chain)
    except RobotError:  # slides along one line, with no mass between them
        return
    q, qd, tau = random_state(chain, seed)
    wrench = Wrench((1.0, -2.0, 3.0), (0.5, 0.2, -0.4))
    qdd = forward_dynamics(chain, q, qd, tau, wrench)
    again = inverse_dynamics(chain, q, qd, qdd, wrench)
    terms = np.array(torque_terms(chain, q, qd, qdd, wrench), dtype=float)
    # the residual of a positive definite system is rounding of the terms, whatever its condition
    np.testing.assert_allclose(again, tau, rtol=0.0, atol=1e-12 * (1.0 + np.abs(terms).sum()))


def test_the_base_turns_the_arm_under_gravity() -> None:
    chain = with_masses(load_robot("ur5e"))
    q, qd, qdd = random_state(chain, 3)
    turned = chain.placed(from_offset((1.0, 2.0, 3.0, 0.4, -0.8, 1.2)))
    back = from_offset((1.0, 2.0, 3.0, 0.4, -0.8, 1.2)).inverse()
    pulled = replace(chain, gravity=back.rotate((0.0, 0.0, -9.81)), base=from_offset((0.0, 0.0, 0.0)))
    here, there = (inverse_dynamics(one, q, qd, qdd) for one in (turned, replace(pulled)))
    np.testing.assert_allclose(here, there, rtol=1e-12)  # the same arm seen from another frame


def test_bodies_that_are_fixed_to_one_frame_are_one_body() -> None:
    chain = load_robot("urm6")
    rng = np.random.default_rng(4)
    some = [body("phi3", rng), body("effector", rng), body("phi6", rng)]
    links = chain_to_links(replace(chain, inertials=tuple(some))).links
    assert [link.mass for link in links] == [0.0, 0.0, some[0].mass, 0.0, 0.0, some[1].mass + some[2].mass]


def test_long_logs_are_as_each_row() -> None:
    chain = with_masses(load_robot("urm6"))
    rng = np.random.default_rng(5)
    q, qd, qdd = rng.normal(size=(3, 40_000, 6))  # more than two blocks
    tau, terms = torques_over_log(chain, q, qd, qdd), torque_terms_over_log(chain, q, qd, qdd)
    np.testing.assert_allclose(sum(terms.values()), tau, rtol=0.0, atol=1e-11)
    kinetic, potential = energies_over_log(chain, q, qd)
    for k in (0, 20_000, 39_999):
        np.testing.assert_array_equal(tau[k], inverse_dynamics(chain, q[k], qd[k], qdd[k]))
        assert kinetic[k] == kinetic_energy(chain, q[k], qd[k])
        assert potential[k] == potential_energy(chain, q[k])


@pytest.mark.slow
def test_energy_is_kept_over_a_second() -> None:
    """urm6 swings from its side without friction: 1e-8 of the energy it swings with."""
    chain = with_masses(load_robot("urm6"))
    start = np.concatenate((np.full(6, 0.5), np.linspace(-1.0, 1.0, 6)))

    def rates(_t: float, x: FloatArray) -> FloatArray:
        return np.concatenate((x[6:], forward_dynamics(chain, list(x[:6]), list(x[6:]), [0.0] * 6)))

    found = solve_ivp(rates, (0.0, 1.0), start, "DOP853", rtol=1e-10, atol=1e-10)
    kinetic, potential = energies_over_log(
        chain, np.ascontiguousarray(found.y[:6].T), np.ascontiguousarray(found.y[6:].T)
    )
    total = kinetic + potential
    assert np.ptp(kinetic) > 5.0  # it swings
    assert np.abs(total - total[0]).max() <= 1e-8 * np.ptp(kinetic)


@settings(max_examples=50, deadline=None)
@given(SEEDS, st.integers(1, 7))
def test_positive_definite_systems_are_solved(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    matrix, right = root @ root.T + 0.1 * np.eye(size), rng.normal(size=size)
    found = solve_ldl(matrix.tolist(), right.tolist())
    np.testing.assert_allclose(matrix @ found, right, rtol=0.0, atol=1e-13 * np.linalg.cond(matrix))


NO_INERTIA = (
    "no inertia resists its own motion, so that it cannot be solved; allowed: an inertial that only this"
    " joint moves"
)


def test_joints_that_move_no_mass_are_named() -> None:
    chain = Chain(
        "bare",
        (
            Joint("turn", axis=(0.0, 0.0, 1.0)),
            Joint("again", axis=(0.0, 0.0, 1.0)),
            Joint("slide", "prismatic", axis=(1.0, 0.0, 0.0)),
            Joint("spin", axis=(1.0, 0.0, 0.0)),
        ),
        inertials=(Inertial("slide", 1.0, (0.5, 0.0, 0.0)),),
    )
    lines = [f"robot bare: joint {name}: {NO_INERTIA}" for name in ("again", "spin")]
    assert refusal(RobotError, check_solvable, chain).splitlines() == lines
    check_solvable(with_masses(sliding_arm()))


@pytest.mark.parametrize("seed", range(20))
def test_a_point_on_the_axis_of_the_last_joint_is_found_wherever_the_arm_stands(seed: int) -> None:
    chain = with_masses(load_robot("ur5e"), seed)
    some = tuple(one for one in chain.inertials if one.joint != "wrist_3_joint")
    point = Inertial("wrist_3_joint", 0.5, (0.0, 0.0, 0.05))
    far = from_offset((100.0 * np.random.default_rng(seed).normal(size=3)).tolist())
    light = replace(chain, inertials=(*some, point)).placed(far)
    assert refusal(RobotError, check_solvable, light) == f"robot ur5e: joint wrist_3_joint: {NO_INERTIA}"
    speck = Inertial("wrist_3_joint", 1e-3, (0.0, 0.0, 0.05), (1e-9, 1e-9, 1e-9, 0.0, 0.0, 0.0))
    check_solvable(replace(chain, inertials=(*some, speck)).placed(far))


def test_an_arm_that_starts_where_a_joint_moves_nothing_is_refused() -> None:
    """A spherical wrist without masses but of its last joint: with w2 at 0 the axes of w1 and w3 are one."""
    names = ("w1", "w2", "w3")
    joints = [Joint(name, axis=axis) for name, axis in zip(names, np.eye(3)[[2, 1, 2]].tolist(), strict=True)]
    chain = Chain("wrist", tuple(joints), inertials=(body("w3", np.random.default_rng(1)),))
    message = f"robot wrist: joint w3: at its start pose {NO_INERTIA}"
    assert refusal(RobotError, check_solvable, chain) == message
    check_solvable(replace(chain, start=(0.0, 0.5, 0.0)))


def test_a_frame_far_before_the_first_joint_costs_no_digits() -> None:
    chain = with_masses(load_robot("ur5e"))
    far = replace(chain, joints=(Joint("rail", "fixed", from_offset((1e4, 0.0, 0.0))), *chain.joints))
    q, qd, qdd = (list(row) for row in random_state(chain, 8))
    near, there = (forward_dynamics(one, q, qd, qdd) for one in (chain, far))
    np.testing.assert_allclose(there, near, rtol=1e-12)  # M's condition is some 1e4


def test_an_arm_without_masses_says_which_key_is_missing() -> None:
    chain = load_robot("urm6")
    still = [0.0] * 6
    message = "robot urm6: key inertials: found none, allowed: the masses of the arm (in a URDF <inertial>)"
    functions: list[tuple[Callable[..., object], int]] = [
        (inverse_dynamics, 3), (mass_matrix, 1), (forward_dynamics, 3), (torque_terms, 3),
        (kinetic_energy, 2), (check_solvable, 0),
    ]  # fmt: skip
    for function, count in functions:
        assert refusal(RobotError, function, chain, *[still] * count) == message
    assert refusal(RobotError, mass_matrix, replace(chain, mass_faults=("no mass",)), still) == "no mass"
