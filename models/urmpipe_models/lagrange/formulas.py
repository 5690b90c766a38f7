"""The names of the variables of an open form, in text and in C.

Formulas as they are computed: products drawn out, common parts once; and the operations that they take.

The equations of motion of an arm in the open form, and what they cost.

The open form as text.

The open form in C99.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from textwrap import fill
from typing import Any, NamedTuple, TypeAlias

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.dynamics.links import check_masses
from urmpipe_models.errors import Finding, RobotError, escape_line
from urmpipe_models.files import EXPORT_MARK
from urmpipe_models.lagrange.derivation import (
    TERMS,
    WRENCH,
    Angle,
    Monomial,
    Polynomial,
    TermName,
    Terms,
    Variables,
    chain_to_variables,
    energies,
    equations,
    iter_joint_steps,
    simplify_polynomial,
)


def angle_names(variables: Variables) -> list[str]:
    """Return what stands behind c and s of each angle: 12 of the first two coordinates, else _1, _2, ..."""
    names = []
    for k, angle in enumerate(variables.angles, start=1):
        plain = set(angle) <= {0.0, 1.0}
        names.append("".join(str(i) for i, one in enumerate(angle, start=1) if one) if plain else f"_{k}")
    return names


def coordinate_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the names of the coordinates in text, or q1, q2, ... where a formula would be unclear."""
    taken = {f"{kind}{name}" for kind in "cs" for name in angle_names(variables)}
    taken |= {"cos", "sin", *WRENCH}
    plain = all(name.isidentifier() and name not in taken for name in coordinates)
    return list(coordinates) if plain else [f"q{k}" for k in range(1, len(coordinates) + 1)]


def variable_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the name of each variable in text.

    Args:
        variables: The variables.
        coordinates: The names of the coordinates in text.
    """
    rates = [f"{name}{mark}" for mark in ("'", "''") for name in coordinates]
    return [*_pose_names(variables, coordinates), *rates, *WRENCH]


def c_symbols(variables: Variables) -> list[Any]:
    """Return the symbol of each variable in C: c12, s12, q[0], qd[0], qdd[0], force[0], ..."""
    from sympy import Symbol

    def elements(name: str, count: int) -> list[str]:
        """Return the elements of an array."""
        return [f"{name}[{k}]" for k in range(count)]

    count = variables.coordinates
    names = _pose_names(variables, elements("q", count))
    names += elements("qd", count) + elements("qdd", count) + elements("force", len(WRENCH))
    return [Symbol(name) for name in names]


def format_angle(angle: Angle, coordinates: Sequence[str]) -> str:
    """Return an angle as a sum, such as theta1 + theta2 or 0.5*theta1 - theta2."""
    words = ""
    for factor, name in zip(angle, coordinates, strict=True):
        if factor:
            size = "" if abs(factor) == 1.0 else f"{abs(factor)!r}*"
            sign = (" - " if factor < 0.0 else " + ") if words else ""
            words += f"{sign}{size}{name}"
    return words


def legend(coordinates: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return a line for each coordinate whose name in the formulas is another one."""
    pairs = zip(names, coordinates, strict=True)
    return [f"{name}: {escape_line(own)}" for name, own in pairs if name != own]


def _pose_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the names of the variables that tell the pose."""
    angles = [f"{kind}{name}" for name in angle_names(variables) for kind in "cs"]
    return [*angles, *(coordinates[k] for k in variables.slides)]


Expression: TypeAlias = Any
"""An expression of SymPy."""


class Operations(NamedTuple):
    """How many operations a formula takes; subtractions count as additions, sines and cosines not at all."""

    additions: int
    multiplications: int

    def __str__(self) -> str:
        additions = format_count(self.additions, "addition")
        return f"{additions}, {format_count(self.multiplications, 'multiplication')}"


@dataclass(frozen=True, eq=False)
class FactoredExpressions:
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
            found.append(sum_operations(map(count_expression_operations, parts)))
        return found


def sum_operations(counts: Iterable[Operations]) -> Operations:
    """Return the operations of several formulas together."""
    additions, multiplications = zip(Operations(0, 0), *counts, strict=True)
    return Operations(sum(additions), sum(multiplications))


def factor_common_terms(formulas: Sequence[Terms], symbols: Sequence[Expression]) -> FactoredExpressions:
    """Return formulas with their products drawn out and their common parts computed once.

    Args:
        formulas: Polynomials.
        symbols: The symbol of each variable.
    """
    from sympy import cse, numbered_symbols

    expressions = [_nested(one, symbols) for one in formulas]
    return FactoredExpressions(*cse(expressions, numbered_symbols("x"), order="none"))


def count_polynomial_operations(of: Terms) -> Operations:
    """Return the operations of an expanded sum: of c x^2 y three multiplications, with c = 1 or -1 two."""
    factors = (sum(key) + (abs(coefficient) != 1.0) for key, coefficient in of.items())
    return Operations(max(len(of) - 1, 0), sum(max(count - 1, 0) for count in factors))


def count_expression_operations(of: Expression) -> Operations:
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
    programs: dict[TermName, FactoredExpressions]
    costs: tuple[Cost, ...]

    def cost(self, term: TermName) -> tuple[Operations, Operations]:
        """Return what a term of all coordinates costs, before and after the reduction."""
        own = [one for one in self.costs if one.term == term]
        return sum_operations(one.operations for one in own), sum_operations(one.reduced for one in own)


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
    turns = sum(step.begins for step in iter_joint_steps(chain))
    if count + turns > MOST_TURNS:
        found = f"{count} coordinates and {turns} turns about axes that are not parallel to the one before"
        allowed = f"up to {MOST_TURNS} of both in the open form"
        raise RobotError(Finding(about=f"robot {chain.name}", found=found, allowed=allowed))
    variables = chain_to_variables(chain)
    expanded = equations(energies(chain, variables), variables)
    formulas = {
        term: [_numbers(simplify_polynomial(one[term], variables)) for one in expanded] for term in terms
    }
    programs = {term: factor_common_terms(formulas[term], c_symbols(variables)) for term in terms}
    after = {term: programs[term].operations() for term in terms}
    costs = tuple(
        Cost(name, term, count_polynomial_operations(_numbers(expanded[i][term])), after[term][i])
        for i, name in enumerate(chain.coordinates)
        for term in terms
    )
    return OpenForm(chain, variables, formulas, programs, costs)


def _numbers(of: Polynomial) -> Terms:
    """Return the coefficients of a polynomial in the digits that are certain."""
    return {key: float(f"{float(one):.{DIGITS}g}") for key, one in of.terms()}


def equations_text(form: OpenForm) -> str:
    """Return the equations as text: a block a coordinate, a line a term.

    Of a coordinate q, q' is its rate and q'' its acceleration; c and s with the numbers of coordinates are
    cosine and sine of their sum.
    """
    coordinates = coordinate_names(form.variables, form.chain.coordinates)
    names = variable_names(form.variables, coordinates)
    lines = [f"# {line}".rstrip() for line in _head(form, coordinates)]
    for i, name in enumerate(coordinates):
        lines += ["", f"tau_{name} = {' + '.join(form.formulas)}"]
        lines += [f"  {term} = {_formula(form, own[i], names)}" for term, own in form.formulas.items()]
    return "\n".join(lines) + "\n"


def _head(form: OpenForm, coordinates: Sequence[str]) -> Iterator[str]:
    """Yield what the names mean, and what the terms cost."""
    yield f"{EXPORT_MARK}: equations of motion of {escape_line(form.chain.name)}"
    yield "tau: what the drives must give, in N.m, of a joint that slides in N"
    yield "q, q', q'': a coordinate in rad, rad/s, rad/s2, or in m, m/s, m/s2"
    yield from legend(form.chain.coordinates, coordinates)
    used = {
        k // 2
        for own in form.formulas.values()
        for of in own
        for key in of
        for k, one in enumerate(key)
        if one
    }
    for k, (name, angle) in enumerate(zip(angle_names(form.variables), form.variables.angles, strict=True)):
        if k in used:
            words = format_angle(angle, coordinates)
            yield f"c{name} = cos({words}), s{name} = sin({words})"
    if "tool" in form.formulas:
        yield "fx, fy, fz in N, mx, my, mz in N.m: act on the tool centre point from outside, in world axes"
    yield ""
    yield "Operations: of the expanded sums, and as C computes them"
    for term in form.formulas:
        before, after = form.cost(term)
        yield f"{term}: {before}; reduced: {after}"


def _formula(form: OpenForm, of: Terms, names: Sequence[str]) -> str:
    """Return a formula as a sum of products of rates, accelerations and wrench, each with its factor."""
    shape = form.variables.shape
    parts: dict[Monomial, dict[Monomial, float]] = {}
    for key, coefficient in of.items():
        parts.setdefault(key[shape:], {})[key[:shape]] = coefficient
    written = ""
    for key, factor in sorted(parts.items(), key=itemgetter(0), reverse=True):
        product = "*".join(_powers(key, names[shape:]))
        total = _sum(factor, names)
        if product and len(factor) > 1:
            total = f"({total})"
        part = {"1.0": product, "-1.0": f"-{product}"}.get(total, f"{total}*{product}") if product else total
        written = _joined(written, part)
    return written or "0"


def _sum(of: Terms, names: Sequence[str]) -> str:
    """Return a polynomial as a sum."""
    written = ""
    for key, coefficient in of.items():
        powers = _powers(key, names)
        plain = powers and abs(coefficient) == 1.0
        factors = powers if plain else [repr(abs(coefficient)), *powers]
        written = _joined(written, ("-" if coefficient < 0.0 else "") + "*".join(factors))
    return written


def _joined(sum_: str, part: str) -> str:
    """Return a sum with one more part."""
    if not sum_:
        return part
    return f"{sum_} - {part[1:]}" if part.startswith("-") else f"{sum_} + {part}"


def _powers(key: Monomial, names: Sequence[str]) -> list[str]:
    """Return the factors of a monomial, such as c2^2."""
    return [
        name if exponent == 1 else f"{name}^{exponent}"
        for name, exponent in zip(names, key, strict=False)
        if exponent
    ]


WIDTH = 110
"""Columns of a line of C."""

INDENT = "    "

ARGUMENTS: dict[TermName, tuple[str, ...]] = {
    "inertia": ("q", "qdd"),
    "centrifugal": ("q", "qd"),
    "coriolis": ("q", "qd"),
    "gravity": ("q",),
    "tool": ("q", "force"),
}
"""What the function of each term takes."""


def c_code(form: OpenForm) -> str:
    """Return the equations as one file of C99: a function a term and, of all terms, `NAME_torque`.

    void NAME_torque(const double q[], const double qd[], const double qdd[], const double force[6],
                     double tau[])

    The arrays have an element a coordinate, in the units that the comment at the top gives.
    """
    name = c_name(form.chain.name)
    parts = [_c_head(form), "#include <math.h>", *(_function(form, name, term) for term in form.formulas)]
    if tuple(form.formulas) == TERMS:
        parts.append(_torque(form, name))
    return "\n\n".join(parts) + "\n"


def c_name(name: str) -> str:
    """Return a name with which functions of C may begin."""
    found = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"robot_{found}" if not found or found[0].isdigit() else found


def _c_head(form: OpenForm) -> str:
    """Return the comment at the top: what goes in and out."""
    coordinates = form.chain.moving
    lines = [f"{EXPORT_MARK}: equations of motion of {_remark(form.chain.name)}", ""]
    for k, joint in enumerate(coordinates):
        turns = joint.kind == "revolute"
        units = "rad, rad/s, rad/s2; tau in N.m" if turns else "m, m/s, m/s2; tau in N"
        lines.append(f"q[{k}], qd[{k}], qdd[{k}]: {_remark(joint.name)} in {units}")
    lines.append(
        "force: fx, fy, fz in N, mx, my, mz in N.m, which act on the tool centre point from outside,"
    )
    lines.append("in world axes")
    lines.append("tau: what the drives must give")
    return "/* " + "\n * ".join(lines).replace(" * \n", " *\n") + "\n */"


def _function(form: OpenForm, name: str, term: TermName) -> str:
    """Return the function of a term."""
    program = form.programs[term]
    used = {
        str(one)
        for part in (*program.results, *(part for _, part in program.shared))
        for one in part.free_symbols
    }
    before, after = form.cost(term)
    lines = [
        f"/* {term}: {after}; expanded: {before} */",
        f"void {name}_{term}({_parameters(ARGUMENTS[term])})",
        "{",
        *_sines(form, used),
        *(_assignment(f"const double {symbol}", part) for symbol, part in program.shared),
        *(_assignment(f"tau[{k}]", part) for k, part in enumerate(program.results)),
        "}",
    ]
    return "\n".join(lines)


def _torque(form: OpenForm, name: str) -> str:
    """Return the function of all terms together."""
    arguments = ("q", "qd", "qdd", "force")
    calls = []
    for term in TERMS[1:]:
        calls += [f"    {name}_{term}({', '.join(ARGUMENTS[term])}, term);"]
        calls += ["    for (i = 0; i < " + str(len(form.chain.coordinates)) + "; i++) tau[i] += term[i];"]
    lines = [
        "/* the sum of all terms */",
        f"void {name}_torque({_parameters(arguments)})",
        "{",
        f"    double term[{len(form.chain.coordinates)}];",
        "    int i;",
        f"    {name}_{TERMS[0]}({', '.join(ARGUMENTS[TERMS[0]])}, tau);",
        *calls,
        "}",
    ]
    return "\n".join(lines)


def _parameters(names: Sequence[str]) -> str:
    """Return the parameters of a function."""
    given = (f"const double {name}[{6 if name == 'force' else ''}]" for name in names)
    return ", ".join([*given, "double tau[]"])


def _sines(form: OpenForm, used: set[str]) -> Iterator[str]:
    """Yield the cosines and sines that a function uses."""
    coordinates = [f"q[{k}]" for k in range(form.variables.coordinates)]
    for name, angle in zip(angle_names(form.variables), form.variables.angles, strict=True):
        for kind, function in (("c", "cos"), ("s", "sin")):
            if f"{kind}{name}" in used:
                yield f"{INDENT}const double {kind}{name} = {function}({format_angle(angle, coordinates)});"


def _assignment(target: str, value: Expression) -> str:
    """Return an assignment, over several lines where it is long."""
    line = f"{target} = {_printer().doprint(value)};"
    return fill(
        line, WIDTH, initial_indent=INDENT, subsequent_indent=2 * INDENT,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _printer() -> Any:
    """Return what writes expressions in C: numbers with all digits, powers as products."""
    from sympy.printing.c import C99CodePrinter
    from sympy.printing.precedence import PRECEDENCE

    class Printer(C99CodePrinter):  # type: ignore[misc]  # SymPy has no types
        """Writes each number so that it reads back as the same."""

        def _print_Float(self, of: Expression) -> str:  # noqa: N802 - SymPy calls it by the class
            return repr(float(of))

        def _print_Integer(self, of: Expression) -> str:  # noqa: N802
            return repr(float(of))

        def _print_Pow(self, of: Expression) -> str:  # noqa: N802
            return "*".join([self.parenthesize(of.base, PRECEDENCE["Mul"])] * int(of.exp))

    return Printer()


def _remark(text: str) -> str:
    """Return a name as it may stand in a comment."""
    return escape_line(text).replace("*/", "* /").replace("/*", "/ *")
