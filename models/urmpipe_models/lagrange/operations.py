"""Formulas as they are computed: products drawn out, common parts once; and the operations that they take."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from urmpipe_models.display import number_of
from urmpipe_models.lagrange.variables import Terms

Expression: TypeAlias = Any
"""An expression of SymPy."""


class Operations(NamedTuple):
    """How many operations a formula takes; subtractions count as additions, sines and cosines not at all."""

    additions: int
    multiplications: int

    def __str__(self) -> str:
        return f"{number_of(self.additions, 'addition')}, {number_of(self.multiplications, 'multiplication')}"


@dataclass(frozen=True, eq=False)
class Program:
    """Formulas with their common parts computed once.

    Attributes:
        shared: The common parts in the order of their use, each a symbol and its expression.
        results: The formulas.
    """

    shared: Sequence[tuple[Expression, Expression]]
    results: Sequence[Expression]

    def operations(self) -> list[Operations]:
        """Return the operations of each formula; a common part counts where it is first used."""
        waiting = dict(self.shared)
        found = []
        for result in self.results:
            parts = [result]
            for part in parts:  # grows by what each part uses
                parts += [waiting.pop(symbol) for symbol in part.free_symbols & waiting.keys()]
            found.append(summed(map(of_expression, parts)))
        return found


def summed(counts: Iterable[Operations]) -> Operations:
    """Return the operations of several formulas together."""
    additions, multiplications = zip(Operations(0, 0), *counts, strict=True)
    return Operations(sum(additions), sum(multiplications))


def program(formulas: Sequence[Terms], symbols: Sequence[Expression]) -> Program:
    """Return formulas with their products drawn out and their common parts computed once.

    Args:
        formulas: Polynomials.
        symbols: The symbol of each variable.
    """
    from sympy import cse, numbered_symbols

    expressions = [_nested(one, symbols) for one in formulas]
    return Program(*cse(expressions, numbered_symbols("x"), order="none"))


def of_terms(of: Terms) -> Operations:
    """Return the operations of an expanded sum: of c x^2 y three multiplications, with c = 1 or -1 two."""
    factors = (sum(key) + (abs(coefficient) != 1.0) for key, coefficient in of.items())
    return Operations(max(len(of) - 1, 0), sum(max(count - 1, 0) for count in factors))


def of_expression(of: Expression) -> Operations:
    """Return the operations of an expression of sums, products and whole powers."""
    from sympy import preorder_traversal

    additions = multiplications = 0
    for part in preorder_traversal(of):
        if part.is_Add:
            additions += len(part.args) - 1
        elif part.is_Mul:
            multiplications += sum(one != -1 for one in part.args) - 1
        elif part.is_Pow:
            multiplications += int(part.exp) - 1
    return Operations(additions, multiplications)


def _nested(of: Terms, symbols: Sequence[Expression]) -> Expression:
    """Return a polynomial with the variable of most monomials drawn out, again and again."""
    from sympy import Add

    uses = Counter(k for key in of for k, exponent in enumerate(key) if exponent)
    k, times = max(uses.items(), key=lambda item: (item[1], -item[0]), default=(0, 0))
    if times < 2:
        return Add(*(_product(key, coefficient, symbols) for key, coefficient in of.items()))
    inside = {(*key[:k], key[k] - 1, *key[k + 1 :]): one for key, one in of.items() if key[k]}
    rest = {key: one for key, one in of.items() if not key[k]}
    return symbols[k] * _nested(inside, symbols) + _nested(rest, symbols)


def _product(key: Sequence[int], coefficient: float, symbols: Sequence[Expression]) -> Expression:
    """Return a monomial with its coefficient."""
    from sympy import Float, Integer, Mul

    number = Integer(int(coefficient)) if abs(coefficient) == 1.0 else Float(coefficient)
    return Mul(number, *(symbol**exponent for symbol, exponent in zip(symbols, key, strict=True) if exponent))
