"""Vector algebra on one element per coordinate.

An *element* is a float, an array over samples, or a CasADi symbol. Products and sums with a
constant 0.0 or 1.0 are folded away, so that a chain pays only for the entries that its geometry
really has: an axis along z or a tilt about y costs no multiplication by zero.
"""

from __future__ import annotations

from typing import Any, TypeAlias

Element: TypeAlias = Any
"""A float, an array of shape (n,), or a symbol: whatever `+ - *` and NumPy's ufuncs take."""

Vector: TypeAlias = tuple[Element, Element, Element]
"""x, y, z."""

ZERO: Vector = (0.0, 0.0, 0.0)


def times(a: Element, b: Element) -> Element:
    """Return a b, folding the constants 0, 1 and -1."""
    if isinstance(b, float):
        a, b = b, a
    if isinstance(a, float):
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
        if a == -1.0:
            return -b
    return a * b


def plus(a: Element, b: Element) -> Element:
    """Return a + b, folding the constant 0."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def minus(a: Element, b: Element) -> Element:
    """Return a - b, folding the constant 0."""
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return -b
    return a - b


def add(a: Vector, b: Vector) -> Vector:
    """Return the vector a + b."""
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """Return the vector a - b."""
    return minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2])


def scale(factor: Element, a: Vector) -> Vector:
    """Return the vector factor * a."""
    return times(factor, a[0]), times(factor, a[1]), times(factor, a[2])


def dot(a: Vector, b: Vector) -> Element:
    """Return the scalar product a . b."""
    return plus(plus(times(a[0], b[0]), times(a[1], b[1])), times(a[2], b[2]))


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product a x b."""
    return (
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    )
