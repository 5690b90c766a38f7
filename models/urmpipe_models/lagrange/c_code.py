"""The open form in C99."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from textwrap import fill
from typing import Any

from urmpipe_models.lagrange.equations import TERMS, TermName
from urmpipe_models.lagrange.names import angle_names, angle_words
from urmpipe_models.lagrange.open_form import OpenForm
from urmpipe_models.lagrange.operations import Expression
from urmpipe_models.messages import one_line
from urmpipe_models.robots.written import EXPORT_MARK

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
    parts = [_head(form), "#include <math.h>", *(_function(form, name, term) for term in form.formulas)]
    if tuple(form.formulas) == TERMS:
        parts.append(_torque(form, name))
    return "\n\n".join(parts) + "\n"


def c_name(name: str) -> str:
    """Return a name with which functions of C may begin."""
    found = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"robot_{found}" if not found or found[0].isdigit() else found


def _head(form: OpenForm) -> str:
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
                yield f"{INDENT}const double {kind}{name} = {function}({angle_words(angle, coordinates)});"


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
    return one_line(text).replace("*/", "* /").replace("/*", "/ *")
