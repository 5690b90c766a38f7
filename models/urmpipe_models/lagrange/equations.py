"""Lagrange's equations of the second kind, term by term."""

from __future__ import annotations

from typing import Literal, get_args

from urmpipe_models.lagrange.energies import Energies
from urmpipe_models.lagrange.variables import Polynomial, Variables, scalar_product, total

TermName = Literal["inertia", "centrifugal", "coriolis", "gravity", "tool"]
TERMS: tuple[TermName, ...] = get_args(TermName)
"""The terms of an equation, in the order of eq. 13."""

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
    inertia = scalar_product(map(momentum.diff, rates), variables.accelerations, variables)
    moved = [one * rate for j, rate in enumerate(rates) for one in variables.derivative(momentum, j)]
    still = [-one for one in variables.derivative(energies.kinetic, i)]
    speeds = variables.by_motion(total([*moved, *still], variables))
    centrifugal, coriolis = (
        total((part for motion, part in speeds.items() if (max(motion) == 2) == square), variables)
        for square in (True, False)
    )
    return {
        "inertia": inertia,
        "centrifugal": centrifugal,
        "coriolis": coriolis,
        "gravity": total(variables.derivative(energies.potential, i), variables),
        "tool": -energies.power.diff(rates[i]),
    }
