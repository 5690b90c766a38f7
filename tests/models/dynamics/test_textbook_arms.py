"""Arms whose equations of motion stand in textbooks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_models.arm.chain import Chain, Inertial, Joint, Mimic
from urmpipe_models.dynamics.equations import forward_dynamics, inverse_dynamics, torque_terms
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.math3d import translation

ROUNDED = 1e-12
"""Some ten products of values up to some hundred."""

G = 9.81
UPRIGHT = (0.0, -1.0, 0.0)
"""An axis about which angles count from x towards z: the arm moves in the vertical plane."""

ANGLES = st.lists(st.floats(-4.0, 4.0), min_size=2, max_size=2)


def rod(joint: str, mass: float, centre: float, moment: float) -> Inertial:
    """A mass on the x axis of a joint, with a moment of inertia about y."""
    return Inertial(joint, mass, (centre, 0.0, 0.0), (moment / 2, moment, moment / 2, 0.0, 0.0, 0.0))


@settings(max_examples=50, deadline=None)
@given(ANGLES, ANGLES, ANGLES)
def test_a_two_link_arm_has_the_printed_closed_form(
    q: list[float], qd: list[float], qdd: list[float]
) -> None:
    """Point masses at the ends of the links: [Craig2005]_ eq. 6.58 and 6.59."""
    l1, l2, m1, m2 = 0.7, 0.4, 3.0, 2.0
    chain = Chain(
        "two-link",
        (Joint("q1", axis=UPRIGHT), Joint("q2", origin=translation(l1, 0.0, 0.0), axis=UPRIGHT)),
        tip=translation(l2, 0.0, 0.0),
        inertials=(rod("q1", m1, l1, 0.0), rod("q2", m2, l2, 0.0)),
    )
    s2, c2 = math.sin(q[1]), math.cos(q[1])
    c1, c12 = math.cos(q[0]), math.cos(q[0] + q[1])
    both, elbow = qdd[0] + qdd[1], m2 * l1 * l2
    second = elbow * c2 * qdd[0] + elbow * s2 * qd[0] ** 2 + m2 * l2 * G * c12 + m2 * l2**2 * both
    first = m2 * l2**2 * both + elbow * c2 * (2 * qdd[0] + qdd[1]) + (m1 + m2) * l1**2 * qdd[0]
    first += -elbow * s2 * qd[1] ** 2 - 2 * elbow * s2 * qd[0] * qd[1]
    first += m2 * l2 * G * c12 + (m1 + m2) * l1 * G * c1
    size = ROUNDED * (1.0 + 100.0)
    assert inverse_dynamics(chain, q, qd, qdd) == pytest.approx([first, second], abs=size)
    terms = torque_terms(chain, q, qd, qdd)
    squares = [-elbow * s2 * qd[1] ** 2, elbow * s2 * qd[0] ** 2]
    assert terms.centrifugal == pytest.approx(squares, abs=size)
    assert terms.coriolis == pytest.approx([-2 * elbow * s2 * qd[0] * qd[1], 0.0], abs=size)


L1, L2 = 0.6, 0.25
"""Upper arm and crank of the parallelogram in [m]."""


def parallelogram() -> Chain:
    """A planar parallelogram, opened into a chain whose angles are absolute.

    Crank 2 turns by q2 and carries rod 3, which stays parallel to the upper arm 1; the chain goes there and
    back again. Then the upper arm turns by q1, and at its end forearm 4 stands along the crank, by q2.
    """

    def absolute(name: str, leader: str, sign: float, shift: float) -> Joint:
        return Joint(name, origin=translation(shift, 0.0, 0.0), axis=UPRIGHT, mimic=Mimic(leader, sign))

    return Chain(
        "parallelogram",
        (
            absolute("crank", "q2", 1.0, 0.0),
            absolute("level", "q2", -1.0, L2),
            absolute("rod", "q1", 1.0, 0.0),
            absolute("level again", "q1", -1.0, 0.0),
            absolute("along the crank", "q2", 1.0, 0.0),
            absolute("back", "q2", -1.0, -L2),
            Joint("q1", axis=UPRIGHT),
            absolute("elbow", "q1", -1.0, L1),
            Joint("q2", axis=UPRIGHT),
        ),
        tip=translation(-0.5, 0.0, 0.0),
        inertials=(
            rod("q1", 8.0, 0.3, 0.3),
            rod("crank", 3.0, -0.1, 0.05),
            rod("rod", 2.0, 0.3, 0.07),
            rod("q2", 5.0, -0.2, 0.12),
        ),
    )


def textbook(q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> FloatArray:
    """The equations of the five-bar linkage in absolute angles (Spong and Vidyasagar, 6.4)."""
    (m1, c1, i1), (m2, c2, i2) = (8.0, 0.3, 0.3), (3.0, -0.1, 0.05)
    (m3, c3, i3), (m4, c4, i4) = (2.0, 0.3, 0.07), (5.0, 0.2, 0.12)
    d11 = m1 * c1**2 + m3 * c3**2 + m4 * L1**2 + i1 + i3
    d22 = m2 * c2**2 + m3 * L2**2 + m4 * c4**2 + i2 + i4
    coupling = m3 * L2 * c3 - m4 * L1 * c4
    d12, slope = coupling * math.cos(q[1] - q[0]), -coupling * math.sin(q[1] - q[0])
    weight1 = G * math.cos(q[0]) * (m1 * c1 + m3 * c3 + m4 * L1)
    weight2 = G * math.cos(q[1]) * (m2 * c2 + m3 * L2 - m4 * c4)
    first = d11 * qdd[0] + d12 * qdd[1] + slope * qd[1] ** 2 + weight1
    second = d12 * qdd[0] + d22 * qdd[1] - slope * qd[0] ** 2 + weight2
    return np.array([first, second])


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(ANGLES, ANGLES, ANGLES)
def test_a_parallelogram_has_the_equations_of_absolute_angles(
    q: list[float], qd: list[float], qdd: list[float]
) -> None:
    chain = parallelogram()
    assert chain.coordinates == ("q1", "q2")
    expected = textbook(q, qd, qdd)
    found = np.array(inverse_dynamics(chain, q, qd, qdd), dtype=float)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=100.0 * ROUNDED)
    terms = torque_terms(chain, q, qd, qdd)
    # in absolute angles the equations have no Coriolis term: the linkage's advantage
    np.testing.assert_allclose(np.array(terms.coriolis, dtype=float), 0.0, rtol=0.0, atol=100.0 * ROUNDED)
    again = forward_dynamics(chain, q, qd, expected.tolist())
    np.testing.assert_allclose(np.array(again, dtype=float), qdd, rtol=0.0, atol=1000.0 * ROUNDED)
    place = forward(chain, q)[-1].translation
    where = [L1 * math.cos(q[0]) - 0.5 * math.cos(q[1]), 0.0, L1 * math.sin(q[0]) - 0.5 * math.sin(q[1])]
    np.testing.assert_allclose(place, where, rtol=0.0, atol=ROUNDED)


def test_a_slide_on_a_turning_table_feels_centrifugal_and_coriolis_forces() -> None:
    m, r, w, v = 2.0, 0.5, 3.0, 0.7
    chain = Chain(
        "table",
        (Joint("turn"), Joint("slide", "prismatic", axis=(1.0, 0.0, 0.0))),
        inertials=(Inertial("slide", m),),
    )
    terms = torque_terms(chain, [0.3, r], [w, v], [0.0, 0.0])
    assert terms.centrifugal == pytest.approx([0.0, -m * r * w**2])
    assert terms.coriolis == pytest.approx([2.0 * m * r * w * v, 0.0])
