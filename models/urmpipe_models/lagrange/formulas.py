"""Open form of the equations of motion: reduced formulas of each term, their cost, as text and as C99.

1. `open_form`: derives the terms (`derivation`), simplifies them and counts their operations.
2. `_factor_common_terms`: variables factored out, common subexpressions computed once, as C computes them.
3. `equations_text`: the formulas as text.
4. `c_code`: the formulas as one file of C99.
5. Names of the variables in text and in C: c12 and s12 are cosine and sine of the sum of coordinates 1 and 2.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
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

MAX_COORDINATES = 4  # with each more the open form grows about tenfold and is unreadable
MAX_COORDINATES_AND_ROTATIONS = 9  # rotations about axes not parallel to the previous; 9 take some 20 s
COEFFICIENT_DIGITS = 15  # certain digits of a coefficient, a sum of rounded products
C_WIDTH = 110  # columns of a line of C
INDENT = "    "

ARGUMENTS: dict[TermName, tuple[str, ...]] = {  # of the C function of each term
    "inertia": ("q", "qdd"),
    "centrifugal": ("q", "qd"),
    "coriolis": ("q", "qd"),
    "gravity": ("q",),
    "tool": ("q", "force"),
}

Expression: TypeAlias = Any  # an expression of SymPy


class Operations(NamedTuple):
    """Number of operations of a formula: subtractions are additions, sines and cosines are not counted."""

    additions: int
    multiplications: int

    def __str__(self) -> str:
        additions = format_count(self.additions, "addition")
        return f"{additions}, {format_count(self.multiplications, 'multiplication')}"


class Cost(NamedTuple):
    """Cost of a term of a coordinate.

    Attributes:
        joint: The coordinate.
        term: The term.
        operations: Of the expanded sum, like monomials collected, without c^2 + s^2 = 1.
        reduced: Of the simplified sum, factored, subexpressions that the coordinates share computed once.
    """

    joint: str
    term: TermName
    operations: Operations
    reduced: Operations


@dataclass(frozen=True, eq=False)
class FactoredExpressions:
    """Formulas with their common subexpressions computed once.

    Attributes:
        shared: The common subexpressions in the order of their use, each a symbol and its expression.
        results: The formulas.
    """

    shared: Sequence[tuple[Expression, Expression]]
    results: Sequence[Expression]

    def operations(self) -> list[Operations]:
        """Return the operations of each formula; a common subexpression counts where it is first used."""
        uncounted = dict(self.shared)
        counts = []
        for result in self.results:
            parts = [result]
            for part in parts:  # grows by the subexpressions of each part
                parts += [uncounted.pop(symbol) for symbol in part.free_symbols & uncounted.keys()]
            counts.append(sum_operations(map(_count_expression_operations, parts)))
        return counts


@dataclass(frozen=True, eq=False)
class OpenForm:
    """The equations of motion of an arm: tau_i as the sum of its terms.

    Attributes:
        chain: The arm.
        variables: The variables of its formulas.
        formulas: The formulas of each term, one per coordinate, in [N.m], or in [N] if it is prismatic.
        programs: The formulas of each term as C computes them.
        costs: Their cost, by coordinate and term.
    """

    chain: Chain
    variables: Variables
    formulas: dict[TermName, list[Terms]]
    programs: dict[TermName, FactoredExpressions]
    costs: tuple[Cost, ...]

    def cost(self, term: TermName) -> tuple[Operations, Operations]:
        """Return the cost of a term of all coordinates, before and after the reduction."""
        costs = [cost for cost in self.costs if cost.term == term]
        before = sum_operations(cost.operations for cost in costs)
        return before, sum_operations(cost.reduced for cost in costs)


def open_form(chain: Chain, terms: Sequence[TermName] = TERMS) -> OpenForm:
    """Return the equations of motion of an arm by Lagrange's equations of the second kind.

    Args:
        chain: The arm, with masses.
        terms: The terms to derive.

    Raises:
        RobotError: If the arm has no masses, or too many coordinates or rotations.
        OptionError: If SymPy is not installed.

    Source: [Iso9283]_ eq. 8-13, section 4.
    """
    check_masses(chain)
    count, about = len(chain.coordinates), f"robot {chain.name}"
    if count > MAX_COORDINATES:
        allowed = f"up to {MAX_COORDINATES} in the open form"
        raise RobotError(Finding(about=about, found=f"{count} coordinates", allowed=allowed))
    rotations = sum(step.begins for step in iter_joint_steps(chain))
    if count + rotations > MAX_COORDINATES_AND_ROTATIONS:
        size = f"{count} coordinates and {rotations} turns about axes that are not parallel to the one before"
        allowed = f"up to {MAX_COORDINATES_AND_ROTATIONS} of both in the open form"
        raise RobotError(Finding(about=about, found=size, allowed=allowed))
    variables = chain_to_variables(chain)
    expanded = equations(energies(chain, variables), variables)
    formulas = {
        term: [_to_terms(simplify_polynomial(equation[term], variables)) for equation in expanded]
        for term in terms
    }
    programs = {term: _factor_common_terms(formulas[term], _c_symbols(variables)) for term in terms}
    reduced = {term: programs[term].operations() for term in terms}
    costs = tuple(
        Cost(name, term, _count_polynomial_operations(_to_terms(expanded[i][term])), reduced[term][i])
        for i, name in enumerate(chain.coordinates)
        for term in terms
    )
    return OpenForm(chain, variables, formulas, programs, costs)


def _to_terms(polynomial: Polynomial) -> Terms:
    """Return the coefficients of a polynomial, rounded to their certain digits."""
    return {key: float(f"{float(value):.{COEFFICIENT_DIGITS}g}") for key, value in polynomial.terms()}


def _factor_common_terms(formulas: Sequence[Terms], symbols: Sequence[Expression]) -> FactoredExpressions:
    """Return formulas with variables factored out and common subexpressions computed once.

    Args:
        formulas: Polynomials.
        symbols: The symbol of each variable.
    """
    from sympy import cse, numbered_symbols

    expressions = [_factor(formula, symbols) for formula in formulas]
    return FactoredExpressions(*cse(expressions, numbered_symbols("x"), order="none"))


def _factor(formula: Terms, symbols: Sequence[Expression]) -> Expression:
    """Return a polynomial with the variable of most monomials factored out, recursively."""
    from sympy import Add

    uses = Counter(k for key in formula for k, exponent in enumerate(key) if exponent)
    k, times = max(uses.items(), key=lambda item: (item[1], -item[0]), default=(0, 0))
    if times < 2:
        return Add(*(_monomial(key, coefficient, symbols) for key, coefficient in formula.items()))
    inside = {(*key[:k], key[k] - 1, *key[k + 1 :]): value for key, value in formula.items() if key[k]}
    rest = {key: value for key, value in formula.items() if not key[k]}
    return symbols[k] * _factor(inside, symbols) + _factor(rest, symbols)


def _monomial(key: Sequence[int], coefficient: float, symbols: Sequence[Expression]) -> Expression:
    """Return a monomial with its coefficient."""
    from sympy import Float, Integer, Mul

    number = Integer(int(coefficient)) if abs(coefficient) == 1.0 else Float(coefficient)
    return Mul(number, *(symbol**exponent for symbol, exponent in zip(symbols, key, strict=True) if exponent))


def sum_operations(counts: Iterable[Operations]) -> Operations:
    """Return the operations of several formulas together."""
    additions, multiplications = zip(Operations(0, 0), *counts, strict=True)
    return Operations(sum(additions), sum(multiplications))


def _count_polynomial_operations(formula: Terms) -> Operations:
    """Return the operations of an expanded sum: of c x^2 y three multiplications, with c = 1 or -1 two."""
    factors = (sum(key) + (abs(coefficient) != 1.0) for key, coefficient in formula.items())
    return Operations(max(len(formula) - 1, 0), sum(max(count - 1, 0) for count in factors))


def _count_expression_operations(expression: Expression) -> Operations:
    """Return the operations of an expression of sums, products and integer powers."""
    from sympy import preorder_traversal

    additions = multiplications = 0
    for part in preorder_traversal(expression):
        if part.is_Add:
            additions += len(part.args) - 1
        elif part.is_Mul:
            multiplications += sum(factor != -1 for factor in part.args) - 1
        elif part.is_Pow:
            multiplications += int(part.exp) - 1
    return Operations(additions, multiplications)


def equations_text(form: OpenForm) -> str:
    """Return the equations as text: one block per coordinate, one line per term.

    Of a coordinate q, q' is its rate and q'' its acceleration; c and s with the numbers of coordinates are
    cosine and sine of their sum.
    """
    coordinates = _coordinate_names(form.variables, form.chain.coordinates)
    rates = [f"{name}{mark}" for mark in ("'", "''") for name in coordinates]
    names = [*_pose_names(form.variables, coordinates), *rates, *WRENCH]
    lines = [f"# {line}".rstrip() for line in _text_head(form, coordinates)]
    for i, name in enumerate(coordinates):
        lines += ["", f"tau_{name} = {' + '.join(form.formulas)}"]
        lines += [f"  {term} = {_formula(form, rows[i], names)}" for term, rows in form.formulas.items()]
    return "\n".join(lines) + "\n"


def _text_head(form: OpenForm, coordinates: Sequence[str]) -> Iterator[str]:
    """Yield the meaning of the names, and the cost of the terms."""
    yield f"{EXPORT_MARK}: equations of motion of {escape_line(form.chain.name)}"
    yield "tau: what the drives must give, in N.m, of a joint that slides in N"
    yield "q, q', q'': a coordinate in rad, rad/s, rad/s2, or in m, m/s, m/s2"
    for name, joint in zip(coordinates, form.chain.coordinates, strict=True):
        if name != joint:
            yield f"{name}: {escape_line(joint)}"
    keys = (key for rows in form.formulas.values() for formula in rows for key in formula)
    used = {k // 2 for key in keys for k, exponent in enumerate(key) if exponent}
    for k, (name, angle) in enumerate(zip(_angle_names(form.variables), form.variables.angles, strict=True)):
        if k in used:
            text = _format_angle(angle, coordinates)
            yield f"c{name} = cos({text}), s{name} = sin({text})"
    if "tool" in form.formulas:
        yield "fx, fy, fz in N, mx, my, mz in N.m: act on the tool centre point from outside, in world axes"
    yield ""
    yield "Operations: of the expanded sums, and as C computes them"
    for term in form.formulas:
        before, after = form.cost(term)
        yield f"{term}: {before}; reduced: {after}"


def _formula(form: OpenForm, formula: Terms, names: Sequence[str]) -> str:
    """Return a formula as a sum of products of rates, accelerations and wrench, each with its factor."""
    shape = form.variables.shape
    parts: dict[Monomial, dict[Monomial, float]] = {}
    for key, coefficient in formula.items():
        parts.setdefault(key[shape:], {})[key[:shape]] = coefficient
    text = ""
    for key, factor in sorted(parts.items(), key=itemgetter(0), reverse=True):
        product = "*".join(_powers(key, names[shape:]))
        total = _sum(factor, names)
        if product and len(factor) > 1:
            total = f"({total})"
        part = {"1.0": product, "-1.0": f"-{product}"}.get(total, f"{total}*{product}") if product else total
        text = _append(text, part)
    return text or "0"


def _sum(formula: Terms, names: Sequence[str]) -> str:
    """Return a polynomial as a sum."""
    text = ""
    for key, coefficient in formula.items():
        powers = _powers(key, names)
        factors = powers if powers and abs(coefficient) == 1.0 else [repr(abs(coefficient)), *powers]
        text = _append(text, ("-" if coefficient < 0.0 else "") + "*".join(factors))
    return text


def _append(text: str, part: str) -> str:
    """Return a sum with one more summand."""
    if not text:
        return part
    return f"{text} - {part[1:]}" if part.startswith("-") else f"{text} + {part}"


def _powers(key: Monomial, names: Sequence[str]) -> list[str]:
    """Return the factors of a monomial, such as c2^2."""
    return [
        name if exponent == 1 else f"{name}^{exponent}"
        for name, exponent in zip(names, key, strict=False)
        if exponent
    ]


def c_code(form: OpenForm) -> str:
    """Return the equations as one file of C99: one function per term and, of all terms, `NAME_torque`.

    void NAME_torque(const double q[], const double qd[], const double qdd[], const double force[6],
                     double tau[])

    The arrays have one element per coordinate, in the units that the comment at the top gives.
    """
    name = c_name(form.chain.name)
    functions = [_c_function(form, name, term) for term in form.formulas]
    parts = [_c_head(form), "#include <math.h>", *functions]
    if tuple(form.formulas) == TERMS:
        parts.append(_c_torque(form, name))
    return "\n\n".join(parts) + "\n"


def c_name(name: str) -> str:
    """Return a name as a valid prefix of C functions."""
    identifier = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"robot_{identifier}" if not identifier or identifier[0].isdigit() else identifier


def _c_head(form: OpenForm) -> str:
    """Return the comment at the top: inputs and outputs."""
    lines = [f"{EXPORT_MARK}: equations of motion of {_c_comment(form.chain.name)}", ""]
    for k, joint in enumerate(form.chain.moving):
        is_revolute = joint.kind == "revolute"
        units = "rad, rad/s, rad/s2; tau in N.m" if is_revolute else "m, m/s, m/s2; tau in N"
        lines.append(f"q[{k}], qd[{k}], qdd[{k}]: {_c_comment(joint.name)} in {units}")
    lines += [
        "force: fx, fy, fz in N, mx, my, mz in N.m, which act on the tool centre point from outside,",
        "in world axes",
        "tau: what the drives must give",
    ]
    return "/* " + "\n * ".join(lines).replace(" * \n", " *\n") + "\n */"


def _c_comment(text: str) -> str:
    """Return a name escaped for a comment."""
    return escape_line(text).replace("*/", "* /").replace("/*", "/ *")


def _c_function(form: OpenForm, name: str, term: TermName) -> str:
    program = form.programs[term]
    parts = (*program.results, *(part for _, part in program.shared))
    used = {str(symbol) for part in parts for symbol in part.free_symbols}
    before, after = form.cost(term)
    lines = [
        f"/* {term}: {after}; expanded: {before} */",
        f"void {name}_{term}({_c_parameters(ARGUMENTS[term])})",
        "{",
        *_c_sines(form, used),
        *(_c_assignment(f"const double {symbol}", part) for symbol, part in program.shared),
        *(_c_assignment(f"tau[{k}]", part) for k, part in enumerate(program.results)),
        "}",
    ]
    return "\n".join(lines)


def _c_torque(form: OpenForm, name: str) -> str:
    """Return the function of the sum of all terms."""
    count = len(form.chain.coordinates)
    calls = []
    for term in TERMS[1:]:
        calls += [f"    {name}_{term}({', '.join(ARGUMENTS[term])}, term);"]
        calls += [f"    for (i = 0; i < {count}; i++) tau[i] += term[i];"]
    lines = [
        "/* the sum of all terms */",
        f"void {name}_torque({_c_parameters(('q', 'qd', 'qdd', 'force'))})",
        "{",
        f"    double term[{count}];",
        "    int i;",
        f"    {name}_{TERMS[0]}({', '.join(ARGUMENTS[TERMS[0]])}, tau);",
        *calls,
        "}",
    ]
    return "\n".join(lines)


def _c_parameters(names: Sequence[str]) -> str:
    inputs = (f"const double {name}[{6 if name == 'force' else ''}]" for name in names)
    return ", ".join([*inputs, "double tau[]"])


def _c_sines(form: OpenForm, used: set[str]) -> Iterator[str]:
    """Yield the declarations of the used cosines and sines."""
    coordinates = [f"q[{k}]" for k in range(form.variables.coordinates)]
    for name, angle in zip(_angle_names(form.variables), form.variables.angles, strict=True):
        for kind, function in (("c", "cos"), ("s", "sin")):
            if f"{kind}{name}" in used:
                yield f"{INDENT}const double {kind}{name} = {function}({_format_angle(angle, coordinates)});"


def _c_assignment(target: str, value: Expression) -> str:
    """Return an assignment, folded at `C_WIDTH`."""
    return fill(
        f"{target} = {_c_printer().doprint(value)};", C_WIDTH, initial_indent=INDENT,
        subsequent_indent=2 * INDENT, break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


@cache
def _c_printer() -> Any:
    """Return the printer of C expressions: numbers with all digits, powers as products."""
    from sympy.printing.c import C99CodePrinter
    from sympy.printing.precedence import PRECEDENCE

    class Printer(C99CodePrinter):  # type: ignore[misc]  # SymPy has no types
        """Prints each number so that it reads back as the same."""

        def _print_Float(self, number: Expression) -> str:  # noqa: N802 - SymPy calls it by the class
            return repr(float(number))

        def _print_Integer(self, number: Expression) -> str:  # noqa: N802
            return repr(float(number))

        def _print_Pow(self, power: Expression) -> str:  # noqa: N802
            return "*".join([self.parenthesize(power.base, PRECEDENCE["Mul"])] * int(power.exp))

    return Printer()


def _c_symbols(variables: Variables) -> list[Any]:
    """Return the symbol of each variable in C: c12, s12, q[0], qd[0], qdd[0], force[0], ..."""
    from sympy import Symbol

    def elements(name: str, count: int) -> list[str]:
        return [f"{name}[{k}]" for k in range(count)]

    count = variables.coordinates
    names = _pose_names(variables, elements("q", count))
    names += elements("qd", count) + elements("qdd", count) + elements("force", len(WRENCH))
    return [Symbol(name) for name in names]


def _pose_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the names of the variables of the pose."""
    angles = [f"{kind}{name}" for name in _angle_names(variables) for kind in "cs"]
    return [*angles, *(coordinates[k] for k in variables.slides)]


def _angle_names(variables: Variables) -> list[str]:
    """Return the suffix of c and s of each angle: 12 of the first two coordinates, else _1, _2, ..."""
    names = []
    for k, angle in enumerate(variables.angles, start=1):
        is_plain_sum = set(angle) <= {0.0, 1.0}
        digits = "".join(str(i) for i, factor in enumerate(angle, start=1) if factor)
        names.append(digits if is_plain_sum else f"_{k}")
    return names


def _coordinate_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the names of the coordinates in text, or q1, q2, ... where a formula would be ambiguous."""
    reserved = {f"{kind}{name}" for kind in "cs" for name in _angle_names(variables)}
    reserved |= {"cos", "sin", *WRENCH}
    is_clear = all(name.isidentifier() and name not in reserved for name in coordinates)
    return list(coordinates) if is_clear else [f"q{k}" for k in range(1, len(coordinates) + 1)]


def _format_angle(angle: Angle, coordinates: Sequence[str]) -> str:
    """Return an angle as a sum, such as theta1 + theta2 or 0.5*theta1 - theta2."""
    text = ""
    for factor, name in zip(angle, coordinates, strict=True):
        if factor:
            size = "" if abs(factor) == 1.0 else f"{abs(factor)!r}*"
            sign = (" - " if factor < 0.0 else " + ") if text else ""
            text += f"{sign}{size}{name}"
    return text
