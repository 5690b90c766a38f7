"""Elementwise arithmetic: vectors, sine and cosine of one element per coordinate, and long arrays in blocks.

1. An *element* is a float, an array over samples, or a CasADi symbol. A float is a constant: its products
   and sums with 0 and 1 are folded, so that a chain costs only the entries that its geometry has (an axis
   along z or a tilt about y costs no multiplication by zero). An `np.float64` is a value, as an entry of an
   array: nothing is folded, so that a scalar, a column and C give the same bits.
2. `cosine_sine`: the same bits on every platform, for a float and for each element of an array. np.sin and
   np.cos differ in the last bit between processors and versions of NumPy. Here only +, - and * of IEEE 754
   are used: x = k h + r with h = 2 pi / 4096 and |r| <= h / 2, sine and cosine of k h from a table, and

       sin(x) = s + (s (cos r - 1) + c sin r),    cos(x) = c + (c (cos r - 1) - s sin r)

   with the series of sin r up to r^3 and of cos r - 1 up to r^4, which omit at most r^5 / 120 = 2.3e-18.
   Rounding: 0.5 ulp of the table and 0.5 ulp of the last sum, so 1.1e-16 together, and some 1e-19 of the
   rest.
3. Blocks of rows that stay in the cache, several of them in parallel.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Element: TypeAlias = Any  # a float, an array of shape (n,), or a symbol: operand of `+ - *` and of ufuncs
Vector: TypeAlias = tuple[Element, Element, Element]  # x, y, z

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]  # counts, and times in [ns]
IndexArray: TypeAlias = NDArray[np.intp]  # rows of another array
TextArray: TypeAlias = NDArray[np.object_]

ZERO: Vector = (0.0, 0.0, 0.0)


def times(a: Element, b: Element) -> Element:
    """Return a b, folding the constants 0, 1 and -1."""
    if type(b) is float:
        a, b = b, a
    if type(a) is float:
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
        if a == -1.0:
            return -b
    return a * b


def plus(a: Element, b: Element) -> Element:
    """Return a + b, folding the constant 0."""
    if type(a) is float and a == 0.0:
        return b
    if type(b) is float and b == 0.0:
        return a
    return a + b


def minus(a: Element, b: Element) -> Element:
    """Return a - b, folding the constant 0."""
    if type(b) is float and b == 0.0:
        return a
    if type(a) is float and a == 0.0:
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


_STEPS = 4096  # of the table, in a turn
_BITS = 128
_PI = 0x3243F6A8885A308D313198A2E03707344  # pi in units of 2^-128: Python divides integers with one rounding
_COARSE = 90  # bits omitted from the first part of a step: it has 29, so that up to 2^24 steps are exact
_MAX_ANGLE = 2.5e4  # [rad], within 2^24 steps: 3979 turns

_STEP = 2 * _PI // _STEPS
_STEP_1 = (_STEP >> _COARSE) / (1 << _BITS - _COARSE)
_STEP_2 = (_STEP & (1 << _COARSE) - 1) / (1 << _BITS)
_PER_STEP = (1 << _BITS) / _STEP
_TURN = 2 * _PI / (1 << _BITS)
_TURN_REST = (2 * _PI - int(_TURN * 2**51) * (1 << _BITS - 51)) / (1 << _BITS)
_SHIFT = 1.5 * 2.0**52  # a number added to it is rounded to an integer, half to even, in the low bits

WORK = 4  # arrays of intermediate results in `cosine_sine_into`


def cosine_sine(angle: Element) -> tuple[Element, Element]:
    """Return cos and sin of an angle in [rad]: within 1.2e-16 up to 2.5e4 rad, within 6e-16 up to 1e15 rad.

    Beyond, doubles are 0.1 rad apart and more: the results are those of some angle, equal on every platform.
    An angle that is not finite gives NaN. An angle that is neither a float nor an array of float64, such as a
    symbol, is passed to np.cos and np.sin.

    Args:
        angle: Any element; an array may have any shape and strides.
    """
    if isinstance(angle, np.ndarray) and angle.dtype == np.float64:
        return _of_array(angle)
    if isinstance(angle, np.float64):
        cosine, sine = cosine_sine(float(angle))
        return np.float64(cosine), np.float64(sine)
    if type(angle) is not float:
        return np.cos(angle), np.sin(angle)
    if not abs(angle) <= _MAX_ANGLE:
        cosine, sine = _of_array(np.array([angle]))
        return cosine.item(), sine.item()
    steps = round(angle * _PER_STEP)
    cosines, sines = cosine_sine_table()
    at = steps % _STEPS
    c, s, rest = cosines.item(at), sines.item(at), angle - steps * _STEP_1 - steps * _STEP_2
    z = rest * rest
    sine = z * (-1.0 / 6.0) * rest + rest
    versine = (z * (1.0 / 24.0) - 0.5) * z
    return c + (c * versine - s * sine), s + (s * versine + c * sine)


def _of_array(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    cosine, sine, *work = (np.empty(x.shape) for _ in range(2 + WORK))
    cosine_sine_into(x, cosine, sine, *work)
    return cosine, sine


def cosine_sine_into(x: FloatArray, c: FloatArray, s: FloatArray, *work: FloatArray) -> None:
    """Write cos and sin of each angle x [rad] into c and s, without allocating arrays, which would cost more.

    Args:
        x: Any shape and strides.
        c: An array of the same shape, without common memory.
        s: Another one, of the same shape.
        work: `WORK` more.
    """
    steps, r, sine, other = work
    if not np.abs(x, steps).max(initial=0.0) <= _MAX_ANGLE:
        x = _remove_turns(x)
    np.multiply(x, _PER_STEP, steps)
    steps += _SHIFT
    at = np.bitwise_and(steps.view(np.int64), _STEPS - 1, r.view(np.int64))
    steps -= _SHIFT
    cosines, sines = cosine_sine_table()
    cosines.take(at, out=c, mode="clip")
    sines.take(at, out=s, mode="clip")
    np.multiply(steps, _STEP_1, r)
    np.subtract(x, r, r)
    steps *= _STEP_2
    r -= steps
    z = np.multiply(r, r, steps)
    np.multiply(z, -1.0 / 6.0, sine)
    sine *= r
    sine += r
    versine = np.multiply(z, 1.0 / 24.0, r)
    versine -= 0.5
    versine *= z
    np.multiply(s, versine, other)
    other += np.multiply(c, sine, z)
    sine *= s
    versine *= c
    versine -= sine
    s += other
    c += versine


def _remove_turns(x: FloatArray) -> FloatArray:
    """Return the angles, without whole turns beyond the limit; NaN if an angle is not finite.

    The remainder by 2 pi as a double is exact; the rounding error of 2 pi is subtracted once per turn.
    """
    while (far := np.abs(x) > _MAX_ANGLE).any():
        rest = np.fmod(x, _TURN)
        x = np.where(far, rest - np.rint((x - rest) / _TURN) * _TURN_REST, x)
    return x


@cache
def cosine_sine_table() -> tuple[FloatArray, FloatArray]:
    """Return cos and sin [-] of k 2 pi / 4096, shape (4096,), each the nearest double.

    Steps are added in integers of 2^-128 up to an eighth of a turn; the rest is symmetry. The errors of 512
    steps reach 1e-35, and no value is that close to the middle of two doubles.
    """
    unit = 1 << _BITS  # 1.0
    term, powers = unit, [unit, 0]
    for k in range(1, 16):
        term = (term * _STEP >> _BITS) // k
        powers[k % 2] += -term if k % 4 > 1 else term
    cosine, sine = [unit], [0]
    for _ in range(_STEPS // 8):
        c, s = cosine[-1], sine[-1]
        cosine.append(c * powers[0] - s * powers[1] >> _BITS)
        sine.append(s * powers[0] + c * powers[1] >> _BITS)
    quarter = np.array([value / unit for value in [*sine, *cosine[-2::-1]]])
    half = np.concatenate((quarter[:-1], quarter[:0:-1]))
    sines = np.concatenate((half, -half))
    return np.roll(sines, -_STEPS // 4), sines


BLOCK = 16384  # rows: so many that NumPy outweighs Python, few enough for the cache of a core
THREADS = min(4, os.cpu_count() or 1)  # with more, Python's work, which holds the lock, sets the pace

_Block = TypeVar("_Block")
_Result = TypeVar("_Result")


def row_blocks(count: int, size: int = BLOCK) -> list[slice]:
    """Return the slices of `count` rows in blocks of `size`, the last one shorter."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


def spread_rows(count: int, most: int) -> IntArray:
    """Return at most `most` indices of `count` rows, evenly from first to last, shape (k,)."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def row_norms(vectors: FloatArray) -> FloatArray:
    """Return the lengths of vectors, in their unit, shape (n,), with temporary arrays of a block of rows.

    Args:
        vectors: In any unit, shape (n, k).
    """
    lengths = np.empty(len(vectors))
    with np.errstate(over="ignore"):  # of a coordinate beyond 1e154, whose square is infinite
        for block in row_blocks(len(vectors)):
            lengths[block] = np.linalg.norm(vectors[block], axis=1)
    return lengths


def map_blocks(
    work: Callable[[_Block], _Result], blocks: Sequence[_Block], threads: int = THREADS
) -> list[_Result]:
    """Return the results of a function for all blocks, in parallel: NumPy computes without Python's lock.

    Args:
        work: Called once per block.
        blocks: Slices, indices of rows, or rows.
        threads: Blocks computed at the same time.

    Raises:
        Exception: The error of the first block that failed, in the order of the blocks.
    """
    if len(blocks) < 2 or threads < 2:
        return [work(block) for block in blocks]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, blocks))
