"""A traced function as C: one line an operation, in the order in which they are done.

Its own writer, not CasADi's: the lines name the variables they read, choices stay choices (`c ? a : b`), and
nothing but the function is defined.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from urmpipe_models.errors import UnitError

Operand = str | int
"""What an operation works on: text of C, or the index of the operation that computes it."""


class Operation(NamedTuple):
    """One operation of a function.

    Attributes:
        form: Its C, with {} for each operand.
        operands: What it works on.
    """

    form: str
    operands: tuple[Operand, ...]


def c_function(declaration: str, function: Any, arguments: Sequence[str], result: str) -> str:
    """Return the C of a function.

    Args:
        declaration: Its head.
        function: CasADi's function, with one vector as its result.
        arguments: How C reads an element of each argument, {} being the index.
        result: The array that takes the result.
    """
    operations, results = _operations(function, arguments)
    for k, one in enumerate(operations):
        operations[k] = _choice(one, operations)
    names = _names(operations, results)
    lines = [
        f"const double {names[k]} = {_text(one, names)};" for k, one in enumerate(operations) if k in names
    ]
    lines += [f"{result}[{k}] = {_operand(one, names)};" for k, one in enumerate(results)]
    unused = dict.fromkeys(one.partition("[")[0].partition("->")[0] for one in (*arguments, result))
    lines.insert(0, " ".join(f"(void){one};" for one in unused))  # not all of them are used by all models
    body = "".join(f"    {line}\n" for line in lines)
    return f"{declaration} {{\n{body}}}\n"


def c_number(value: float) -> str:
    """Return a number as C reads it, to the last bit."""
    value = float(value)  # NumPy's floats too, which Python writes as np.float64(1.0)
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    return repr(value) if math.copysign(1.0, value) > 0 else f"({value!r})"


def _operations(function: Any, arguments: Sequence[str]) -> tuple[list[Operation], list[Operand]]:
    """Return the operations of a function and its results, none named by a register that is used again."""
    import casadi

    forms = _forms()
    register: dict[int, Operand] = {}
    operations: list[Operation] = []
    results: list[Operand] = [c_number(0.0)] * int(function.nnz_out(0))
    for k in range(function.n_instructions()):
        kind, read, written = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if kind == casadi.OP_INPUT:
            register[written[0]] = arguments[read[0]].format(read[1])
        elif kind == casadi.OP_CONST:
            register[written[0]] = c_number(function.instruction_constant(k))
        elif kind == casadi.OP_OUTPUT:
            results[written[1]] = register[read[0]]
        elif kind not in forms:
            raise UnitError(f"CasADi's operation {kind}: found in a trace, allowed: those of c_code.py")
        else:
            operations.append(Operation(forms[kind], tuple(register[one] for one in read)))
            register[written[0]] = len(operations) - 1
    return operations, results


_IF = "{} != 0.0 ? {} : 0.0"
_NOT = "!{}"
_ADD = "{} + {}"

_OPERATORS = {
    **{"ADD": _ADD, "SUB": "{} - {}", "MUL": "{} * {}", "DIV": "{} / {}", "NEG": "-{}"},
    **{"SQ": "{0} * {0}", "TWICE": "2.0 * {}", "INV": "1.0 / {}", "IF_ELSE_ZERO": _IF},
    **{"LT": "{} < {}", "LE": "{} <= {}", "EQ": "{} == {}", "NE": "{} != {}"},
    **{"AND": "{} && {}", "OR": "{} || {}", "NOT": _NOT},
    **{
        "CONSTPOW": "pow_of({}, {})",
        "SIGN": "sign_of({})",
        "FMIN": "lesser({}, {})",
        "FMAX": "greater({}, {})",
    },
}
"""C of CasADi's operations, where it is not a function of the same name."""

_OUR_OWN = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("exp", "expm1", "log", "log1p", "atan2", "hypot", "pow"),
)
"""Functions of elementary.h, named as the C library's with _of: the same to the last bit everywhere."""

_OF_THE_LIBRARY = ("sqrt", "floor", "ceil", "fabs", "fmod", "copysign")
"""The C library's, which are exact."""

_OF_TWO = ("atan2", "hypot", "fmod", "copysign", "pow")


def _forms() -> dict[int, str]:
    """Return the C of CasADi's operations."""
    import casadi

    called = {name: f"{name}_of" for name in _OUR_OWN} | {name: name for name in _OF_THE_LIBRARY}
    forms = {
        name.upper(): c_name + ("({}, {})" if name in _OF_TWO else "({})") for name, c_name in called.items()
    }
    forms |= _OPERATORS
    return {getattr(casadi, f"OP_{name}"): form for name, form in forms.items()}


def _choice(one: Operation, operations: Sequence[Operation]) -> Operation:
    """Return CasADi's form of a choice, (c ? a : 0) + (!c ? b : 0), as c ? a : b: it keeps the sign of 0."""
    if one.form != _ADD:
        return one
    first, second = (operations[k] if isinstance(k, int) else None for k in one.operands)
    if first is None or second is None or first.form != _IF or second.form != _IF:
        return one
    condition, other = first.operands[0], second.operands[0]
    if not isinstance(other, int) or operations[other] != Operation(_NOT, (condition,)):
        return one
    return Operation("{} != 0.0 ? {} : {}", (condition, first.operands[1], second.operands[1]))


def _names(operations: Sequence[Operation], results: Sequence[Operand]) -> dict[int, str]:
    """Return a name for each operation that a result needs."""
    needed = {one for one in results if isinstance(one, int)}
    for k in reversed(range(len(operations))):
        if k in needed:
            needed |= {one for one in operations[k].operands if isinstance(one, int)}
    return {k: f"a{number}" for number, k in enumerate(sorted(needed))}


def _operand(one: Operand, names: dict[int, str]) -> str:
    return names[one] if isinstance(one, int) else one


def _text(one: Operation, names: dict[int, str]) -> str:
    return one.form.format(*(_operand(each, names) for each in one.operands))
