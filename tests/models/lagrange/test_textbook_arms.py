"""Open forms against printed ones, and operations against a count by hand."""

from __future__ import annotations

import sympy

from urmpipe_models.arm.chain import Chain, Inertial, Joint, Mimic
from urmpipe_models.lagrange.derivation import TERMS
from urmpipe_models.lagrange.formulas import equations_text, open_form
from urmpipe_models.math3d import from_offset

L1, L2, M1, M2, I1, I2, G = 0.75, 0.5, 3.0, 2.0, 0.25, 0.125, 10.0
"""Sums and products of these are exact in floats: formulas are compared as they are."""


def two_links(reach: float, first: tuple[float, float], second: tuple[float, float]) -> Chain:
    """A planar arm under gravity along -y: of each link its centre as a share of its length, its inertia."""
    (share1, izz1), (share2, izz2) = first, second
    joints = Joint("theta1"), Joint("theta2", origin=from_offset([L1, 0.0, 0.0]))
    inertials = (
        Inertial("theta1", M1, (share1 * L1, 0.0, 0.0), (0.0, izz1, izz1, 0.0, 0.0, 0.0)),
        Inertial("theta2", M2, (share2 * L2, 0.0, 0.0), (0.0, izz2, izz2, 0.0, 0.0, 0.0)),
    )
    tip = from_offset([reach, 0.0, 0.0])
    return Chain("planar", joints, tip=tip, inertials=inertials, gravity=(0.0, -G, 0.0))


def formulas(chain: Chain) -> dict[tuple[str, int], sympy.Expr]:
    """The terms of each coordinate as expressions of SymPy in c1, ..., u1, u2 (rates), a1, a2, fx, ..."""
    text = equations_text(open_form(chain))
    found: dict[tuple[str, int], sympy.Expr] = {}
    for line in filter(lambda one: one.startswith("  "), text.splitlines()):
        term, _, formula = line.strip().partition(" = ")
        for k in (2, 1):
            formula = formula.replace(f"theta{k}''", f"a{k}").replace(f"theta{k}'", f"u{k}")
        found[term, sum(known == term for known, _ in found)] = sympy.sympify(formula.replace("^", "**"))
    return found


def test_two_point_masses_are_those_of_the_textbook() -> None:
    """[Craig2005]_ section 6.7: point masses at the ends of massless links."""
    c1, c2, s2, c12 = sympy.symbols("c1 c2 s2 c12")
    u1, u2, a1, a2 = sympy.symbols("u1 u2 a1 a2")
    coupling = M2 * L1 * L2
    wanted = {
        ("inertia", 0): M2 * L2**2 * (a1 + a2) + coupling * c2 * (2 * a1 + a2) + (M1 + M2) * L1**2 * a1,
        ("centrifugal", 0): -coupling * s2 * u2**2,
        ("coriolis", 0): -2 * coupling * s2 * u1 * u2,
        ("gravity", 0): M2 * L2 * G * c12 + (M1 + M2) * L1 * G * c1,
        ("inertia", 1): coupling * c2 * a1 + M2 * L2**2 * (a1 + a2),
        ("centrifugal", 1): coupling * s2 * u1**2,
        ("coriolis", 1): sympy.Integer(0),
        ("gravity", 1): M2 * L2 * G * c12,
    }
    found = formulas(two_links(L2, (1.0, 0.0), (1.0, 0.0)))
    assert {key: sympy.expand(found[key] - one) for key, one in wanted.items()} == dict.fromkeys(wanted, 0)


def test_two_uniform_links_are_those_of_the_textbook() -> None:
    """The manipulator of two links in the plane, centres at half their lengths, any moment of inertia."""
    c1, c2, s2, c12, s1, s12 = sympy.symbols("c1 c2 s2 c12 s1 s12")
    u1, u2, a1, a2, fx, fy, mz = sympy.symbols("u1 u2 a1 a2 fx fy mz")
    h = M2 * L1 * L2 / 2
    d11 = M1 * L1**2 / 4 + I1 + M2 * (L1**2 + L2**2 / 4) + I2 + 2 * h * c2
    d12, d22 = M2 * L2**2 / 4 + I2 + h * c2, M2 * L2**2 / 4 + I2
    wanted = {
        ("inertia", 0): d11 * a1 + d12 * a2,
        ("inertia", 1): d12 * a1 + d22 * a2,
        ("centrifugal", 0): -h * s2 * u2**2,
        ("centrifugal", 1): h * s2 * u1**2,
        ("coriolis", 0): -2 * h * s2 * u1 * u2,
        ("coriolis", 1): sympy.Integer(0),
        ("gravity", 0): (M1 / 2 + M2) * L1 * G * c1 + M2 * L2 / 2 * G * c12,
        ("gravity", 1): M2 * L2 / 2 * G * c12,
        ("tool", 0): (L1 * s1 + L2 * s12) * fx - (L1 * c1 + L2 * c12) * fy - mz,  # -J^T F
        ("tool", 1): L2 * s12 * fx - L2 * c12 * fy - mz,
    }
    found = formulas(two_links(L2, (0.5, I1), (0.5, I2)))
    assert {key: sympy.expand(found[key] - one) for key, one in wanted.items()} == dict.fromkeys(wanted, 0)


def test_a_speck_on_a_heavy_arm_keeps_its_terms() -> None:
    """1e-12 kg at 1e-6 m from the second joint, 1e4 kg on the first link."""
    joints = Joint("theta1"), Joint("theta2", origin=from_offset([1.0, 0.0, 0.0]))
    inertials = Inertial("theta1", 1e4, (1.0, 0.0, 0.0)), Inertial("theta2", 1e-12, (1e-6, 0.0, 0.0))
    text = equations_text(open_form(Chain("speck", joints, inertials=inertials, gravity=(0.0, -G, 0.0))))
    first, second = text.split("\n\n")[1:]
    assert "  inertia = 10000.0*theta1'' + (1e-18*c2 + 1e-24)*theta2''\n" in first
    assert "  centrifugal = -1e-18*s2*theta2'^2\n  coriolis = -2e-18*s2*theta1'*theta2'\n" in first
    assert "  inertia = (1e-18*c2 + 1e-24)*theta1'' + 1e-24*theta2''\n" in second
    assert "  centrifugal = 1e-18*s2*theta1'^2\n  coriolis = 0\n  gravity = 1e-17*c12\n" in second


def test_of_the_angles_of_a_parallelogram_the_difference_is_left() -> None:
    """The forearm keeps its direction while the upper arm turns, as in [Iso9283]_ section 5."""
    joints = (
        Joint("theta1"),
        Joint("back", origin=from_offset([L1, 0.0, 0.0]), mimic=Mimic("theta1", -1.0)),
        Joint("theta2"),
    )
    chain = Chain("parallelogram", joints, inertials=(Inertial("theta2", M2, (L2, 0.0, 0.0)),))
    text = equations_text(open_form(chain, ("inertia",)))
    assert "# c_3 = cos(theta1 - theta2), s_3 = sin(theta1 - theta2)\n" in text
    assert "  inertia = 1.125*theta1'' + 0.75*c_3*theta2''\n" in text  # m l1^2, m l1 l2
    assert "  inertia = 0.75*c_3*theta1'' + 0.5*theta2''\n" in text  # m l2^2


def test_a_pendulum_is_written_and_counted_as_by_hand() -> None:
    inertial = Inertial("swing", 2.0, (0.5, 0.0, 0.0), (0.0, 0.25, 0.25, 0.0, 0.0, 0.0))
    chain = Chain("pendulum", (Joint("swing"),), inertials=(inertial,), gravity=(0.0, -10.0, 0.0))
    form = open_form(chain)
    assert equations_text(form) == (
        "# urmpipe robot export: equations of motion of pendulum\n"
        "# tau: what the drives must give, in N.m, of a joint that slides in N\n"
        "# q, q', q'': a coordinate in rad, rad/s, rad/s2, or in m, m/s, m/s2\n"
        "# c1 = cos(swing), s1 = sin(swing)\n"
        "# fx, fy, fz in N, mx, my, mz in N.m: act on the tool centre point from outside, in world axes\n"
        "#\n"
        "# Operations: of the expanded sums, and as C computes them\n"
        "# inertia: 2 additions, 7 multiplications; reduced: 0 additions, 1 multiplication\n"
        "# centrifugal: 0 additions, 0 multiplications; reduced: 0 additions, 0 multiplications\n"
        "# coriolis: 0 additions, 0 multiplications; reduced: 0 additions, 0 multiplications\n"
        "# gravity: 0 additions, 1 multiplication; reduced: 0 additions, 1 multiplication\n"
        "# tool: 0 additions, 0 multiplications; reduced: 0 additions, 0 multiplications\n"
        "\n"
        "tau_swing = inertia + centrifugal + coriolis + gravity + tool\n"
        "  inertia = 0.75*swing''\n"  # 0.5 c1 c1 a + 0.5 s1 s1 a + 0.25 a: 3 + 3 + 1 products, 2 sums
        "  centrifugal = 0\n"
        "  coriolis = 0\n"
        "  gravity = 10.0*c1\n"
        "  tool = -mz\n"
    )
    before, after = zip(*(form.cost(term) for term in TERMS), strict=True)
    assert before == ((2, 7), (0, 0), (0, 0), (0, 1), (0, 0))
    assert after == ((0, 1), (0, 0), (0, 0), (0, 1), (0, 0))
