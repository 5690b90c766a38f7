"""Lagrange's equations of the second kind, term by term."""

from __future__ import annotations

from typing import Literal, get_args

from urmpipe_models.lagrange.energies import Energies
from urmpipe_models.lagrange.variables import Monomial, Polynomial, Variables, total

TermName = Literal["inertia", "centrifugal", "coriolis", "gravity", "tool"]
TERMS: tuple[TermName, ...] = get_args(TermName)
"""The terms of an equation, in the order of eq. 13."""

NOTHING = 1e-14
"""A coefficient below this share of the largest of its kind is what rounding left of a sum that cancels."""

Equation = dict[TermName, Polynomial]
"""The terms of one coordinate, in [N.m], or in [N] where it slides."""


def equations(energies: Energies, variables: Variables) -> list[Equation]:
    """Return the terms of each coordinate's equation, whose sum is what its drive must give.

    tau_i = d/dt dT/dq_i' - dT/dq_i + dU/dq_i - dP/dq_i'. Of it, inertia: what has a q_j'';
    centrifugal: what has a q_j'^2; Coriolis: what has a q_j' q_k'; gravity: dU/dq_i; tool: -dP/dq_i', which
    is -(J^T F)_i, with the power P of a wrench F that acts on the tool from outside.

    Source: [Iso9283]_ eq. 13, whose F is the opposite: the force that the tool exerts.
    """
    return [_equation(energies, variables, i) for i in range(variables.coordinates)]


def _equation(energies: Energies, variables: Variables, i: int) -> Equation:
    """Return the terms of a coordinate's equation."""
    rates = variables.rates
    momentum = energies.kinetic.diff(rates[i])
    scale = largest(momentum)
    inertia = total(
        (momentum.diff(rate) * second for rate, second in zip(rates, variables.accelerations, strict=True)),
        variables,
    )
    moved = total((variables.derivative(momentum, j) * rate for j, rate in enumerate(rates)), variables)
    speeds = variables.by_motion(cleaned(moved - variables.derivative(energies.kinetic, i), scale))
    centrifugal, coriolis = (
        total(
            (factor * motion(key, variables) for key, factor in speeds.items() if (max(key) == 2) == square),
            variables,
        )
        for square in (True, False)
    )
    gravity, tool = variables.derivative(energies.potential, i), -energies.power.diff(rates[i])
    return {
        "inertia": cleaned(inertia, scale),
        "centrifugal": centrifugal,
        "coriolis": coriolis,
        "gravity": cleaned(gravity, largest(gravity)),
        "tool": cleaned(tool, largest(tool)),
    }


def motion(exponents: Monomial, variables: Variables) -> Polynomial:
    """Return a product of rates, accelerations and wrench."""
    found = variables.constant(1.0)
    for variable, exponent in zip(variables.ring.gens[variables.shape :], exponents, strict=True):
        found *= variable**exponent
    return found


def largest(of: Polynomial) -> float:
    """Return the largest absolute coefficient of a polynomial."""
    return max((abs(float(one)) for one in of.coeffs()), default=0.0)


def cleaned(of: Polynomial, scale: float) -> Polynomial:
    """Return a polynomial without what rounding left of sums that cancel.

    Args:
        of: The polynomial.
        scale: The largest coefficient of the same kind.
    """
    return of.ring.from_dict({key: one for key, one in of.items() if abs(float(one)) > NOTHING * scale})
