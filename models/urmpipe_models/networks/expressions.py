"""Arithmetic in a text, such as `2 * s + 0.1`: parsed to a tree, never executed, with exact derivatives."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import accumulate
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import Element, minus, plus, times
from urmpipe_models.errors import shown
from urmpipe_models.names import not_among

LONGEST = 1000
"""Letters of an expression: more are no formula that a person wrote."""

DEEPEST = 50
"""Brackets and operators within each other."""

ALLOWED = "numbers, names of controls, pi, + - * / ** and brackets, sin, cos, tan, atan2, sqrt, exp"

Slopes: TypeAlias = dict[str, Element]
"""The partial derivative by each name that there is one of, in the expression's unit a unit of the name."""

Valued: TypeAlias = tuple[Element, Slopes]


@dataclass(frozen=True)
class Expression:
    """A formula of names.

    Attributes:
        text: As it is written; what is no arithmetic raises a `ValueError` that says what is allowed.

    """

    text: str

    def __post_init__(self) -> None:
        _ = self._tree

    @cached_property
    def names(self) -> frozenset[str]:
        """The names in it but for pi."""
        found = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(found - {"pi", *_FUNCTIONS})

    def value(self, values: Mapping[str, Element]) -> Element:
        """Return its value at values of its names, any elements."""
        return self.with_slopes(values)[0]

    def with_slopes(self, values: Mapping[str, Element]) -> Valued:
        """Return its value and its partial derivatives at values of its names, any elements.

        By the rules of differentiation along its tree, so that they are exact to rounding.
        """
        with np.errstate(all="ignore"):  # what is no number is found by who uses it
            return _valued(self._tree, values)

    @cached_property
    def _tree(self) -> ast.expr:
        return _parsed(self.text)


@cache
def _parsed(text: str) -> ast.expr:
    """Return the tree of an expression whose parts are all arithmetic; raise a `ValueError` of any other."""
    if len(text) > LONGEST:
        raise ValueError(f"found {shown(text)} of {len(text)} letters, allowed: {LONGEST} at most")
    if (nested := _nested(text)) > DEEPEST:
        raise ValueError(f"found {shown(text)}, nested {nested} deep; allowed: {DEEPEST}")
    try:
        if "#" in text:  # the rest would be a remark
            raise SyntaxError("a remark")
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f"found {shown(text)}, no arithmetic; allowed: {ALLOWED}") from error
    _refuse(tree, text, 0)
    return tree


def _nested(text: str) -> int:
    """Return how many brackets of a text are open at most."""
    open_ones = accumulate((sign == "(") - (sign == ")") for sign in text)
    return max(open_ones, default=0)


def _refuse(node: ast.expr, text: str, depth: int) -> None:
    """Raise a `ValueError` if a tree holds anything but arithmetic, or is nested too deep."""
    if depth > DEEPEST:
        raise ValueError(f"found {shown(text)}, nested {depth} deep; allowed: {DEEPEST}")
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool) and _finite(value):
            parts: list[ast.expr] = []
        case ast.Name(id=name) if name not in _FUNCTIONS:
            parts = []
        case ast.BinOp(left, ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right):
            parts = [left, right]
        case ast.UnaryOp(ast.UAdd() | ast.USub(), operand):
            parts = [operand]
        case ast.Call(ast.Name(id=name), args, []):
            if name not in _FUNCTIONS:
                raise ValueError(f"function {not_among(name, _FUNCTIONS)}")
            if len(args) != _arguments(name):
                allowed = f"{_arguments(name)}"
                raise ValueError(f"found {len(args)} arguments of {name}, allowed: {allowed}")
            parts = args
        case _:
            found = ast.get_source_segment(text.strip(), node) or text
            hint = (
                "; a power is **" if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor) else ""
            )
            raise ValueError(f"found {shown(found)}, no arithmetic; allowed: {ALLOWED}{hint}")
    for part in parts:
        _refuse(part, text, depth + 1)


def _finite(value: float) -> bool:
    """Return whether a constant is a number that a float holds."""
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _arguments(name: str) -> int:
    return 2 if name == "atan2" else 1


def _valued(node: ast.expr, values: Mapping[str, Element]) -> Valued:
    """Return the value of a part of a tree, and its derivatives."""
    match node:
        case ast.Constant(value=value):
            return float(value), {}  # type: ignore[arg-type]
        case ast.Name(id="pi"):
            return math.pi, {}
        case ast.Name(id=name):
            return values[name], {name: 1.0}
        case ast.UnaryOp(op, operand):
            value, slopes = _valued(operand, values)
            return (value, slopes) if isinstance(op, ast.UAdd) else (minus(0.0, value), _by(slopes, -1.0))
        case ast.BinOp(left, op, right):
            return _OPERATORS[type(op)](_valued(left, values), _valued(right, values))
        case ast.Call(ast.Name(id=name), args):
            return _FUNCTIONS[name](*(_valued(one, values) for one in args))
    raise TypeError(f"{ast.dump(node)} was let through")


def _by(slopes: Slopes, factor: Element) -> Slopes:
    """Return derivatives times a factor."""
    return {name: times(factor, slope) for name, slope in slopes.items()}


def _sum(first: Slopes, second: Slopes) -> Slopes:
    """Return the sums of derivatives."""
    return {name: plus(first.get(name, 0.0), second.get(name, 0.0)) for name in {**first, **second}}


def _add(a: Valued, b: Valued) -> Valued:
    return plus(a[0], b[0]), _sum(a[1], b[1])


def _subtract(a: Valued, b: Valued) -> Valued:
    return minus(a[0], b[0]), _sum(a[1], _by(b[1], -1.0))


def _multiply(a: Valued, b: Valued) -> Valued:
    return times(a[0], b[0]), _sum(_by(a[1], b[0]), _by(b[1], a[0]))


def _divide(a: Valued, b: Valued) -> Valued:
    """(a / b)' = a' / b - a b' / b^2."""
    inverse = np.divide(1.0, b[0])
    value = a[0] * inverse
    return value, _sum(_by(a[1], inverse), _by(b[1], -value * inverse))


def _power(a: Valued, b: Valued) -> Valued:
    """(a^b)' = b a^(b - 1) a' + a^b ln(a) b', the last only where b varies: a may be negative else."""
    value = np.power(a[0], b[0])
    slopes = _by(a[1], times(b[0], np.power(a[0], minus(b[0], 1.0)))) if a[1] else {}
    return value, _sum(slopes, _by(b[1], value * np.log(a[0]))) if b[1] else slopes


_OPERATORS: dict[type[ast.operator], Callable[[Valued, Valued], Valued]] = {
    ast.Add: _add,
    ast.Sub: _subtract,
    ast.Mult: _multiply,
    ast.Div: _divide,
    ast.Pow: _power,
}


def _sin(a: Valued) -> Valued:
    return np.sin(a[0]), _by(a[1], np.cos(a[0]))


def _cos(a: Valued) -> Valued:
    return np.cos(a[0]), _by(a[1], -np.sin(a[0]))


def _tan(a: Valued) -> Valued:
    value = np.tan(a[0])
    return value, _by(a[1], 1.0 + value * value)


def _sqrt(a: Valued) -> Valued:
    value = np.sqrt(a[0])
    return value, _by(a[1], np.divide(0.5, value)) if a[1] else {}


def _exp(a: Valued) -> Valued:
    value = np.exp(a[0])
    return value, _by(a[1], value)


def _atan2(y: Valued, x: Valued) -> Valued:
    """atan2(y, x)' = (x y' - y x') / (x^2 + y^2)."""
    square = np.divide(1.0, y[0] * y[0] + x[0] * x[0])
    return np.arctan2(y[0], x[0]), _sum(_by(y[1], x[0] * square), _by(x[1], -y[0] * square))


_FUNCTIONS: dict[str, Callable[..., Valued]] = {
    "sin": _sin,
    "cos": _cos,
    "tan": _tan,
    "atan2": _atan2,
    "sqrt": _sqrt,
    "exp": _exp,
}
