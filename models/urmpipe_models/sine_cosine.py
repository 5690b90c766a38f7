"""Sine and cosine, the same to the last bit on every platform, of a float as of each element of an array.

np.sin and np.cos differ in the last bit between processors and versions of NumPy. Here only +, - and * of
IEEE 754 are used: x = k h + r with h = 2 pi / 4096 and |r| <= h / 2, sine and cosine of k h from a table, and

    sin(x) = s + (s (cos r - 1) + c sin r),    cos(x) = c + (c (cos r - 1) - s sin r)

with the series of sin r up to r^3 and of cos r - 1 up to r^4, which leave out at most r^5 / 120 = 2.3e-18.
Rounding: 0.5 ulp of the table and 0.5 ulp of the last sum, so 1.1e-16 together, and some 1e-19 of the rest.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.elementwise import Element

_STEPS = 4096
_BITS = 128
_PI = 0x3243F6A8885A308D313198A2E03707344
"""pi in units of 2^-128: Python divides whole numbers with a single rounding."""

_COARSE = 90
"""Bits that the first part of a step lacks: it has 29, so that up to 2^24 steps are exact."""

_MOST = 2.5e4
"""Largest angle in [rad] within 2^24 steps: 3979 turns."""

_STEP = 2 * _PI // _STEPS
_STEP_1 = (_STEP >> _COARSE) / (1 << _BITS - _COARSE)
_STEP_2 = (_STEP & (1 << _COARSE) - 1) / (1 << _BITS)
_PER_STEP = (1 << _BITS) / _STEP
_TURN = 2 * _PI / (1 << _BITS)
_TURN_REST = (2 * _PI - int(_TURN * 2**51) * (1 << _BITS - 51)) / (1 << _BITS)
_SHIFT = 1.5 * 2.0**52
"""A number added to it is rounded to a whole one, half to even, which stands in the low bits."""


def cosine_sine(angle: Element) -> tuple[Element, Element]:
    """Return cos and sin of an angle in [rad]: within 1.2e-16 up to 2.5e4 rad, within 6e-16 up to 1e15 rad.

    Beyond, doubles are 0.1 rad apart and more: the results are those of some angle, alike on every platform.
    An angle that is not finite gives NaN. What is neither a float nor an array of float64, such as a symbol,
    goes to np.cos and np.sin.

    Args:
        angle: Any element; an array may have any shape and strides.
    """
    if isinstance(angle, np.ndarray) and angle.dtype == np.float64:
        return _of_array(angle)
    if not isinstance(angle, float):
        return np.cos(angle), np.sin(angle)
    if not abs(angle) <= _MOST:
        cosine, sine = _of_array(np.array([angle]))
        return cosine.item(), sine.item()
    steps = round(angle * _PER_STEP)
    cosines, sines = table()
    at = steps % _STEPS
    return _turned(cosines.item(at), sines.item(at), float(angle - steps * _STEP_1) - steps * _STEP_2)


def _of_array(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cos and sin of each element, with few arrays of its own: they cost more than the products."""
    if not (x.min(initial=0.0) >= -_MOST and x.max(initial=0.0) <= _MOST):
        x = _less_turns(x)
    steps = np.asarray(x * _PER_STEP)
    steps += _SHIFT
    at = steps.view(np.int64) & (_STEPS - 1)
    steps -= _SHIFT
    rest = np.asarray(x - steps * _STEP_1)
    steps *= _STEP_2
    rest -= steps
    cosines, sines = table()
    return _turned(cosines.take(at, mode="clip"), sines.take(at, mode="clip"), rest)


def _turned(c: Element, s: Element, r: Element) -> tuple[Element, Element]:
    """Return cos and sin of an angle from those of the nearest step and the rest in [rad]."""
    z = r * r
    sine = z * (-1.0 / 6.0)
    sine *= r
    sine += r
    versine = z * (1.0 / 24.0)
    versine -= 0.5
    versine *= z
    z = s * versine
    z += c * sine
    z += s
    versine *= c
    sine *= s
    versine -= sine
    versine += c
    return versine, z


def _less_turns(x: FloatArray) -> FloatArray:
    """Return the angles with those beyond the limit less whole turns; what is not finite is NaN.

    The remainder by 2 pi as a double is exact; what 2 pi lacks counts as often as there were turns.
    """
    while (far := np.abs(x) > _MOST).any():
        rest = np.fmod(x, _TURN)
        x = np.where(far, rest - np.rint((x - rest) / _TURN) * _TURN_REST, x)
    return x


@cache
def table() -> tuple[FloatArray, FloatArray]:
    """Return cos and sin of k 2 pi / 4096, shape (4096,), each the nearest double.

    One step after the other is added in whole numbers of 2^-128, up to an eighth of a turn; the rest is
    symmetry. The errors of 512 steps reach 1e-35, and no value is that close to the middle of two doubles.
    """
    one = 1 << _BITS
    term, powers = one, [one, 0]
    for k in range(1, 16):
        term = (term * _STEP >> _BITS) // k
        powers[k % 2] += -term if k % 4 > 1 else term
    cosine, sine = [one], [0]
    for _ in range(_STEPS // 8):
        c, s = cosine[-1], sine[-1]
        cosine.append(c * powers[0] - s * powers[1] >> _BITS)
        sine.append(s * powers[0] + c * powers[1] >> _BITS)
    quarter = np.array([value / one for value in [*sine, *cosine[-2::-1]]])
    half = np.concatenate((quarter[:-1], quarter[:0:-1]))
    sines = np.concatenate((half, -half))
    return np.roll(sines, -_STEPS // 4), sines
