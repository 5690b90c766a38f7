"""The equations of motion of an arm in the open form, and what they cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from urmpipe_models.chains.chain import Chain
from urmpipe_models.dynamics.links import check_masses
from urmpipe_models.errors import Finding, RobotError
from urmpipe_models.lagrange.angles import steps
from urmpipe_models.lagrange.energies import energies
from urmpipe_models.lagrange.equations import TERMS, TermName, equations
from urmpipe_models.lagrange.names import c_symbols
from urmpipe_models.lagrange.operations import Operations, Program, of_terms, program, summed
from urmpipe_models.lagrange.simplify import simplified
from urmpipe_models.lagrange.variables import Polynomial, Terms, Variables, variables_of

MOST = 4
"""Coordinates: with each more the open form grows about tenfold, and nobody reads it."""

MOST_TURNS = 9
"""Coordinates and turns about axes that are not parallel to the one before: with each more it takes several
times as long, some 20 s with so many, and joints that follow others turn, too."""

DIGITS = 15
"""Of a coefficient, a sum of rounded products, so many are certain."""


class Cost(NamedTuple):
    """What a term of a coordinate costs.

    Attributes:
        joint: The coordinate.
        term: The term.
        operations: Of the expanded sum, like monomials collected, without c^2 + s^2 = 1.
        reduced: Of the shorter sum, products drawn out and what the coordinates share computed once.
    """

    joint: str
    term: TermName
    operations: Operations
    reduced: Operations


@dataclass(frozen=True, eq=False)
class OpenForm:
    """The equations of motion of an arm: tau_i as the sum of its terms.

    Attributes:
        chain: The arm.
        variables: The variables of its formulas.
        formulas: Of each term the formula of each coordinate, in [N.m], or in [N] where it slides.
        programs: The formulas of each term as they are computed.
        costs: What they cost, a coordinate after the other.
    """

    chain: Chain
    variables: Variables
    formulas: dict[TermName, list[Terms]]
    programs: dict[TermName, Program]
    costs: tuple[Cost, ...]

    def cost(self, term: TermName) -> tuple[Operations, Operations]:
        """Return what a term of all coordinates costs, before and after the reduction."""
        own = [one for one in self.costs if one.term == term]
        return summed(one.operations for one in own), summed(one.reduced for one in own)


def open_form(chain: Chain, terms: Sequence[TermName] = TERMS) -> OpenForm:
    """Return the equations of motion of an arm by Lagrange's equations of the second kind.

    Args:
        chain: The arm, with masses.
        terms: The terms to derive.

    Raises:
        RobotError: If the arm has no masses, or too many coordinates or turns.
        OptionError: If SymPy is not installed.

    Source: [Iso9283]_ eq. 8-13, section 4.
    """
    check_masses(chain)
    count = len(chain.coordinates)
    if count > MOST:
        allowed = f"up to {MOST} in the open form"
        raise RobotError(Finding(about=f"robot {chain.name}", found=f"{count} coordinates", allowed=allowed))
    turns = sum(step.begins for step in steps(chain))
    if count + turns > MOST_TURNS:
        found = f"{count} coordinates and {turns} turns about axes that are not parallel to the one before"
        allowed = f"up to {MOST_TURNS} of both in the open form"
        raise RobotError(Finding(about=f"robot {chain.name}", found=found, allowed=allowed))
    variables = variables_of(chain)
    expanded = equations(energies(chain, variables), variables)
    formulas = {term: [_numbers(simplified(one[term], variables)) for one in expanded] for term in terms}
    programs = {term: program(formulas[term], c_symbols(variables)) for term in terms}
    after = {term: programs[term].operations() for term in terms}
    costs = tuple(
        Cost(name, term, of_terms(_numbers(expanded[i][term])), after[term][i])
        for i, name in enumerate(chain.coordinates)
        for term in terms
    )
    return OpenForm(chain, variables, formulas, programs, costs)


def _numbers(of: Polynomial) -> Terms:
    """Return the coefficients of a polynomial in the digits that are certain."""
    return {key: float(f"{float(one):.{DIGITS}g}") for key, one in of.terms()}
