"""Equations 8 to 13 of the paper on accuracy, as printed, against the model of this package."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain, Inertial
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain
from urmpipe_models.dynamics.equations import inverse_dynamics, mass_matrix, torque_terms
from urmpipe_models.dynamics.links import Wrench, kinetic_energy, mass_motions, potential_energy
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import jacobian

ROUNDED = 1e-13
"""Products of four matrices of values of about 1."""

ROWS = [
    DHRow(d=0.4, alpha=math.pi / 2),
    DHRow(a=0.5, theta=0.3),
    DHRow(a=0.2, d=0.1, alpha=-math.pi / 2),
    DHRow(d=0.3, a=0.1, alpha=0.4),
]
"""An arm with revolute pairs, its axes parallel, perpendicular and oblique."""

CENTRES = np.array([[0.0, 0.1, 0.02], [-0.2, 0.01, 0.0], [0.03, 0.02, 0.1], [-0.05, 0.04, -0.1]])
"""Mass centres in the frames of the elements in [m]: r_s,i,i."""

MASSES = (4.0, 3.0, 2.0, 1.0)

Q = np.array([0.4, -0.7, 1.1, 0.5])
QD = np.array([0.9, -1.3, 0.6, 2.0])
QDD = np.array([-0.4, 1.2, 3.0, -2.5])


def element_matrix(row: DHRow, theta: float) -> FloatArray:
    """A_i: the frame of element i in that of element i - 1."""
    c, s = math.cos(row.theta + theta), math.sin(row.theta + theta)
    ca, sa = math.cos(row.alpha), math.sin(row.alpha)
    return np.array(
        [
            [c, -s * ca, s * sa, row.a * c],
            [s, c * ca, -c * sa, row.a * s],
            [0.0, sa, ca, row.d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def arm() -> Chain:
    """The same arm, its centres seen from the frames that the joints move (before theta, d, a and alpha)."""
    inertials = []
    for k, (row, centre, mass) in enumerate(zip(ROWS, CENTRES, MASSES, strict=True), start=1):
        rest = element_matrix(row, 0.0)
        turn = rest[:3, :3]
        diagonal = turn @ np.diag([0.02, 0.03, 0.015]) @ turn.T
        inertia = [float(diagonal[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        x, y, z = (rest @ [*centre, 1.0])[:3].tolist()
        inertials.append(Inertial(f"q{k}", mass, (x, y, z), tuple(inertia)))  # type: ignore[arg-type]
    return replace(dh_chain("arm", rows=ROWS), inertials=tuple(inertials))


def test_eq_8_to_11_give_places_and_velocities_of_the_mass_centres() -> None:
    T, D = np.eye(4), np.zeros((4, 4))
    for k, (row, motion) in enumerate(zip(ROWS, mass_motions(arm(), list(Q), list(QD)), strict=True)):
        A = element_matrix(row, Q[k])
        derivative = np.zeros((4, 4))
        derivative[0, 1], derivative[1, 0] = -QD[k], QD[k]  # Q_i, eq. 11
        D = (D + T @ derivative) @ A  # eq. 10
        T = T @ A  # eq. 8
        r = np.append(CENTRES[k], 1.0)
        np.testing.assert_allclose((T @ r)[:3], motion.centre, rtol=0.0, atol=ROUNDED)
        np.testing.assert_allclose((D @ r)[:3], motion.velocity, rtol=0.0, atol=10 * ROUNDED)  # eq. 9


def test_eq_12_gives_the_angular_velocity_in_the_axes_of_the_element() -> None:
    omega = np.zeros(3)
    for k, (row, motion) in enumerate(zip(ROWS, mass_motions(arm(), list(Q), list(QD)), strict=True)):
        B = element_matrix(row, Q[k])[:3, :3]
        omega = (omega + np.array([0.0, 0.0, QD[k]])) @ B  # eq. 12: a row vector
        rest = element_matrix(row, 0.0)[:3, :3]
        np.testing.assert_allclose(
            omega, rest.T @ np.array(motion.omega, dtype=float), rtol=0.0, atol=ROUNDED
        )


def test_eq_13_is_lagrange_of_these_energies_term_by_term() -> None:
    """M_i = D1 theta'' + D2 theta'^2 + D_(1+k) theta'_(j-1) theta'_k + g E + J^T F, by slopes of M and U."""
    chain, still = arm(), [0.0] * 4
    wrench = Wrench((3.0, -1.0, 2.0), (0.2, 0.4, -0.3))
    terms = torque_terms(chain, list(Q), list(QD), list(QDD), wrench)
    step = 1e-6
    slopes = np.array([(M_at(chain, Q + e) - M_at(chain, Q - e)) / (2 * step) for e in step * np.eye(4)])
    # Christoffel symbols: of the pair j, k in row i
    c = 0.5 * (slopes.transpose(1, 2, 0) + slopes.transpose(1, 0, 2) - slopes)
    near = 1e-8  # central differences: step^2 and rounding over step
    np.testing.assert_allclose(terms.inertia, M_at(chain, Q) @ QDD, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(terms.centrifugal, np.einsum("ijj,j->i", c, QD**2), rtol=0.0, atol=near)
    pairs = sum(2.0 * c[:, j, k] * QD[j] * QD[k] for j in range(4) for k in range(j + 1, 4))
    np.testing.assert_allclose(terms.coriolis, pairs, rtol=0.0, atol=near)
    heights = [
        (potential_energy(chain, Q + e) - potential_energy(chain, Q - e)) / (2 * step)
        for e in step * np.eye(4)
    ]
    np.testing.assert_allclose(np.array(terms.gravity, dtype=float), heights, rtol=0.0, atol=near)
    J = np.array(jacobian(chain, list(Q)), dtype=np.float64).T
    outside = np.array([*wrench.force, *wrench.moment])
    np.testing.assert_allclose(
        terms.tool, -J.T @ outside, rtol=0.0, atol=1e-12
    )  # F of eq. 13 is what the arm exerts
    total = inverse_dynamics(chain, list(Q), list(QD), list(QDD), wrench)
    np.testing.assert_allclose(np.sum(terms, axis=0), np.array(total, dtype=float), rtol=0.0, atol=1e-12)
    twice = QD @ M_at(chain, Q) @ QD
    np.testing.assert_allclose(2.0 * kinetic_energy(chain, list(Q), list(QD)), twice, rtol=1e-13)
    assert not np.any(torque_terms(chain, list(Q), still, still).coriolis)


def M_at(chain: Chain, q: FloatArray) -> FloatArray:  # noqa: N802 - the paper's letter
    return np.array(mass_matrix(chain, list(q)), dtype=np.float64)
