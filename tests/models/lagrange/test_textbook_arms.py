"""Equations of motion of planar arms, as formulas and as numbers, against printed ones."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.dynamics.equations import torque_terms
from urmpipe_models.dynamics.links import Wrench
from urmpipe_models.lagrange.formulas import equations_text, open_form
from urmpipe_models.math3d import from_offset

L1, L2, M1, M2, I1, I2, G = 0.75, 0.5, 3.0, 2.0, 0.25, 0.125, 10.0
"""Sums and products of these are exact in floats: formulas are compared as they are."""

c1, c2, s2, c12, s1, s12 = sympy.symbols("c1 c2 s2 c12 s1 s12")
u1, u2, a1, a2, fx, fy, mz = sympy.symbols("u1 u2 a1 a2 fx fy mz")  # rates, accelerations, a wrench


def two_links(share: float, izz1: float, izz2: float) -> Chain:
    """A planar arm under gravity along -y, centres at a share of its links' lengths."""
    joints = Joint("theta1"), Joint("theta2", origin=from_offset([L1, 0.0, 0.0]))
    inertials = (
        Inertial("theta1", M1, (share * L1, 0.0, 0.0), (0.0, izz1, izz1, 0.0, 0.0, 0.0)),
        Inertial("theta2", M2, (share * L2, 0.0, 0.0), (0.0, izz2, izz2, 0.0, 0.0, 0.0)),
    )
    tip = from_offset([L2, 0.0, 0.0])
    return Chain("planar", joints, tip=tip, inertials=inertials, gravity=(0.0, -G, 0.0))


def open_formulas(chain: Chain) -> dict[str, sympy.Expr]:
    """Return each term with the number of its coordinate."""
    terms: dict[str, sympy.Expr] = {}
    for line in filter(lambda line: line.startswith("  "), equations_text(open_form(chain)).splitlines()):
        term, _, formula = line.strip().partition(" = ")
        for k in (2, 1):
            formula = formula.replace(f"theta{k}''", f"a{k}").replace(f"theta{k}'", f"u{k}")
        terms[f"{term} {2 if f'{term} 1' in terms else 1}"] = sympy.sympify(formula.replace("^", "**"))
    return terms


E = M2 * L1 * L2
POINT_MASSES = {  # at the ends of massless links: [Craig2005]_ section 6.7, eq. 6.58 and 6.59
    "inertia 1": M2 * L2**2 * (a1 + a2) + E * c2 * (2 * a1 + a2) + (M1 + M2) * L1**2 * a1,
    "centrifugal 1": -E * s2 * u2**2,
    "coriolis 1": -2 * E * s2 * u1 * u2,
    "gravity 1": M2 * L2 * G * c12 + (M1 + M2) * L1 * G * c1,
    "inertia 2": E * c2 * a1 + M2 * L2**2 * (a1 + a2),
    "centrifugal 2": E * s2 * u1**2,
    "coriolis 2": sympy.Integer(0),
    "gravity 2": M2 * L2 * G * c12,
}
H = M2 * L1 * L2 / 2
D12 = M2 * L2**2 / 4 + I2 + H * c2
UNIFORM_LINKS = {  # with centres at half their lengths, and any moment of inertia
    "inertia 1": (M1 * L1**2 / 4 + I1 + M2 * (L1**2 + L2**2 / 4) + I2 + 2 * H * c2) * a1 + D12 * a2,
    "inertia 2": D12 * a1 + (M2 * L2**2 / 4 + I2) * a2,
    "centrifugal 1": -H * s2 * u2**2,
    "centrifugal 2": H * s2 * u1**2,
    "coriolis 1": -2 * H * s2 * u1 * u2,
    "coriolis 2": sympy.Integer(0),
    "gravity 1": (M1 / 2 + M2) * L1 * G * c1 + M2 * L2 / 2 * G * c12,
    "gravity 2": M2 * L2 / 2 * G * c12,
    "tool 1": (L1 * s1 + L2 * s12) * fx - (L1 * c1 + L2 * c12) * fy - mz,  # -J^T F
    "tool 2": L2 * s12 * fx - L2 * c12 * fy - mz,
}
ARMS = [(two_links(1.0, 0.0, 0.0), POINT_MASSES), (two_links(0.5, I1, I2), UNIFORM_LINKS)]


@pytest.mark.parametrize(("chain", "printed"), ARMS)
def test_two_links_are_those_of_textbooks(chain: Chain, printed: dict[str, sympy.Expr]) -> None:
    formulas = open_formulas(chain)
    differences = {term: sympy.expand(formulas[term] - formula) for term, formula in printed.items()}
    assert differences == dict.fromkeys(printed, 0)
    symbols = (c1, c2, c12, s1, s2, s12, u1, u2, a1, a2, fx, fy, mz)
    functions = {term: sympy.lambdify(symbols, formula) for term, formula in printed.items()}
    for state in np.random.default_rng(2).uniform(-4.0, 4.0, (50, 9)):
        q, qd, qdd, (x, y, m) = (part.tolist() for part in np.split(state, [2, 4, 6]))
        terms = torque_terms(chain, q, qd, qdd, Wrench((x, y, 0.0), (0.0, 0.0, m)))
        angles = [*q, sum(q)]
        for name, function in functions.items():
            term, coordinate = name.split()
            value = function(*np.cos(angles), *np.sin(angles), *qd, *qdd, x, y, m)
            # some ten products of values up to some hundred
            assert getattr(terms, term)[int(coordinate) - 1] == pytest.approx(value, abs=1e-10)
