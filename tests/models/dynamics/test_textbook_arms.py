"""Arms whose equations of motion stand in textbooks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from urmpipe_models.arm.chain import Chain, Inertial, Joint, Mimic
from urmpipe_models.dynamics.equations import forward_dynamics, inverse_dynamics, torque_terms
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import translation

ROUNDED = 1e-12  # some ten products of values up to some hundred
G = 9.81
UPRIGHT = (0.0, -1.0, 0.0)  # about it angles count from x towards z: the arm moves in the vertical plane
L1, L2 = 0.6, 0.25  # upper arm and crank of the parallelogram in [m]
# Masses in [kg], centres on the x axes of joints in [m], moments of inertia about y in [kg m2]
BODIES = {"q1": (8.0, 0.3, 0.3), "crank": (3.0, -0.1, 0.05), "rod": (2.0, 0.3, 0.07), "q2": (5.0, -0.2, 0.12)}


def parallelogram() -> Chain:
    """A planar parallelogram, opened into a chain whose angles are absolute.

    Crank 2 turns by q2 and carries rod 3, which stays parallel to the upper arm 1; the chain goes there and
    back again. Then the upper arm turns by q1, and at its end forearm 4 stands along the crank, by q2.
    """

    def joint(name: str, leader: str = "", sign: float = 1.0, x: float = 0.0) -> Joint:
        mimic = Mimic(leader, sign) if leader else None
        return Joint(name, origin=translation(x, 0.0, 0.0), axis=UPRIGHT, mimic=mimic)

    crank = joint("crank", "q2"), joint("level", "q2", -1.0, L2), joint("rod", "q1")
    back = joint("level again", "q1", -1.0), joint("along the crank", "q2"), joint("back", "q2", -1.0, -L2)
    forearm = joint("q1"), joint("elbow", "q1", -1.0, L1), joint("q2")
    inertials = [
        Inertial(name, mass, (x, 0.0, 0.0), (moment / 2, moment, moment / 2, 0.0, 0.0, 0.0))
        for name, (mass, x, moment) in BODIES.items()
    ]
    joints, tip = (*crank, *back, *forearm), translation(-0.5, 0.0, 0.0)
    return Chain("parallelogram", joints, tip=tip, inertials=tuple(inertials))


def textbook(q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> FloatArray:
    """The equations of the five-bar linkage in absolute angles (Spong and Vidyasagar, 6.4)."""
    (m1, c1, i1), (m2, c2, i2), (m3, c3, i3), (m4, x4, i4) = BODIES.values()
    c4 = -x4  # from the elbow, away from the tip
    d11 = m1 * c1**2 + m3 * c3**2 + m4 * L1**2 + i1 + i3
    d22 = m2 * c2**2 + m3 * L2**2 + m4 * c4**2 + i2 + i4
    coupling = m3 * L2 * c3 - m4 * L1 * c4
    d12, slope = coupling * math.cos(q[1] - q[0]), -coupling * math.sin(q[1] - q[0])
    first = d11 * qdd[0] + d12 * qdd[1] + slope * qd[1] ** 2
    second = d12 * qdd[0] + d22 * qdd[1] - slope * qd[0] ** 2
    first += G * math.cos(q[0]) * (m1 * c1 + m3 * c3 + m4 * L1)
    second += G * math.cos(q[1]) * (m2 * c2 + m3 * L2 - m4 * c4)
    return np.array([first, second])


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-4.0, 4.0), min_size=6, max_size=6))
def test_a_parallelogram_has_the_equations_of_absolute_angles(state: list[float]) -> None:
    chain, q, qd, qdd = parallelogram(), state[:2], state[2:4], state[4:]
    assert chain.coordinates == ("q1", "q2")
    printed = textbook(q, qd, qdd)
    tau = np.array(inverse_dynamics(chain, q, qd, qdd), dtype=float)
    assert_allclose(tau, printed, rtol=0.0, atol=100.0 * ROUNDED)
    coriolis = np.array(torque_terms(chain, q, qd, qdd).coriolis, dtype=float)
    # in absolute angles the equations have no Coriolis term: the linkage's advantage
    assert_allclose(coriolis, 0.0, rtol=0.0, atol=100.0 * ROUNDED)
    again = forward_dynamics(chain, q, qd, printed.tolist())
    assert_allclose(np.array(again, dtype=float), qdd, rtol=0.0, atol=1000.0 * ROUNDED)
    tip = [L1 * math.cos(q[0]) - 0.5 * math.cos(q[1]), 0.0, L1 * math.sin(q[0]) - 0.5 * math.sin(q[1])]
    assert_allclose(forward(chain, q)[-1].translation, tip, rtol=0.0, atol=ROUNDED)


def test_a_slide_on_a_turning_table_feels_centrifugal_and_coriolis_forces() -> None:
    m, r, w, v = 2.0, 0.5, 3.0, 0.7
    joints = Joint("turn"), Joint("slide", "prismatic", axis=(1.0, 0.0, 0.0))
    chain = Chain("table", joints, inertials=(Inertial("slide", m),))
    terms = torque_terms(chain, [0.3, r], [w, v], [0.0, 0.0])
    assert terms.centrifugal == pytest.approx([0.0, -m * r * w**2])
    assert terms.coriolis == pytest.approx([2.0 * m * r * w * v, 0.0])
