"""Values with two derivatives by time, as an element: velocity and acceleration of what a model computes.

A `Taylor` passes through elementwise NumPy as a float or a column does, so that velocity and acceleration of
a model's outputs come from the same lines as the outputs: (f(u))' = f' u', (f(u))'' = f'' u'^2 + f' u''.

Source: Griewank and Walther 2008, Evaluating Derivatives, chapter 13.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from urmpipe_models.elementwise import Element


class Taylor(NDArrayOperatorsMixin):
    """A value and its derivatives.

    Attributes:
        value: In its unit, a float or an array of shape (n,).
        first: Its derivative by time, likewise.
        second: Its second derivative by time, likewise.
    """

    __slots__ = ("first", "second", "value")

    def __init__(self, value: Element, first: Element = 0.0, second: Element = 0.0) -> None:
        self.value, self.first, self.second = value, first, second

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply one of NumPy's functions; comparisons are of the values."""
        if method != "__call__" or options:
            return NotImplemented
        terms = [term if isinstance(term, Taylor) else Taylor(term) for term in inputs]
        if ufunc.__name__ in _COMPARISONS:
            return ufunc(*(term.value for term in terms))
        rule = _RULES.get(ufunc.__name__)
        return NotImplemented if rule is None else rule(*terms)

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> Any:
        """Apply `np.where`."""
        if function is not np.where or options:
            return NotImplemented
        condition, *choices = arguments
        return _where(condition, *(term if isinstance(term, Taylor) else Taylor(term) for term in choices))


_COMPARISONS = {"less", "less_equal", "greater", "greater_equal", "equal", "not_equal"}


def _where(condition: Any, u: Taylor, v: Taylor) -> Taylor:
    pairs = ((u.value, v.value), (u.first, v.first), (u.second, v.second))
    return Taylor(*(np.where(condition, *pair) for pair in pairs))


def _chain(u: Taylor, value: Element, slope: Element, curvature: Element) -> Taylor:
    return Taylor(value, slope * u.first, curvature * u.first * u.first + slope * u.second)


def _add(u: Taylor, v: Taylor) -> Taylor:
    return Taylor(u.value + v.value, u.first + v.first, u.second + v.second)


def _negative(u: Taylor) -> Taylor:
    return Taylor(-u.value, -u.first, -u.second)


def _multiply(u: Taylor, v: Taylor) -> Taylor:
    return Taylor(
        u.value * v.value,
        u.first * v.value + u.value * v.first,
        u.second * v.value + 2.0 * u.first * v.first + u.value * v.second,
    )


def _reciprocal(u: Taylor) -> Taylor:
    inverse = np.divide(1.0, u.value)
    return _chain(u, inverse, -inverse * inverse, 2.0 * inverse * inverse * inverse)


def _power(u: Taylor, v: Taylor) -> Taylor:
    """u^v, also of negative u where v is constant: then ln(u) is not computed."""
    if not (np.any(v.first) or np.any(v.second)):
        n = v.value
        factors = n, n * (n - 1.0)
        slope, curvature = (  # of 0^0 and 0^1, too
            factor * np.power(u.value, np.where(factor == 0.0, 0.0, n - order))
            for order, factor in enumerate(factors, 1)
        )
        return _chain(u, np.power(u.value, n), slope, curvature)
    return _exp(_multiply(v, _log(u)))


def _sin(u: Taylor) -> Taylor:
    sine = np.sin(u.value)
    return _chain(u, sine, np.cos(u.value), -sine)


def _cos(u: Taylor) -> Taylor:
    cosine = np.cos(u.value)
    return _chain(u, cosine, -np.sin(u.value), -cosine)


def _tan(u: Taylor) -> Taylor:
    tangent = np.tan(u.value)
    slope = 1.0 + tangent * tangent
    return _chain(u, tangent, slope, 2.0 * tangent * slope)


def _exp(u: Taylor) -> Taylor:
    value = np.exp(u.value)
    return _chain(u, value, value, value)


def _log(u: Taylor) -> Taylor:
    inverse = np.divide(1.0, u.value)
    return _chain(u, np.log(u.value), inverse, -inverse * inverse)


def _sqrt(u: Taylor) -> Taylor:
    root = np.sqrt(u.value)
    inverse = np.divide(0.5, root)
    return _chain(u, root, inverse, -np.divide(inverse, 2.0 * u.value))


def _arctan2(y: Taylor, x: Taylor) -> Taylor:
    """The angle of (x, y): its rate is (x y' - y x') / (x^2 + y^2), differentiated as a product."""
    rate = Taylor(x.value * y.first - y.value * x.first, x.value * y.second - y.value * x.second)
    square = _add(_multiply(x, x), _multiply(y, y))
    first = rate.value / square.value
    second = (rate.first - first * square.first) / square.value
    return Taylor(np.arctan2(y.value, x.value), first, second)


def _choose(larger: bool) -> Callable[[Taylor, Taylor], Taylor]:
    def rule(u: Taylor, v: Taylor) -> Taylor:
        condition = u.value >= v.value if larger else u.value <= v.value
        return _where(condition, u, v)

    return rule


_RULES: dict[str, Callable[..., Taylor]] = {
    "add": _add,
    "subtract": lambda u, v: _add(u, _negative(v)),
    "negative": _negative,
    "multiply": _multiply,
    "divide": lambda u, v: _multiply(u, _reciprocal(v)),
    "square": lambda u: _multiply(u, u),
    "power": _power,
    "sin": _sin,
    "cos": _cos,
    "tan": _tan,
    "exp": _exp,
    "log": _log,
    "sqrt": _sqrt,
    "arctan2": _arctan2,
    "floor": lambda u: Taylor(np.floor(u.value)),
    "remainder": lambda u, period: Taylor(np.remainder(u.value, period.value), u.first, u.second),
    "absolute": lambda u: _where(u.value < 0.0, _negative(u), u),
    "maximum": _choose(larger=True),
    "minimum": _choose(larger=False),
}
