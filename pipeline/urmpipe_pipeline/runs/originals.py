"""The numbers of the file from the SI values that were made of them."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.joint_log import LogColumn

DIGITS = 15
"""A decimal number of so many digits is told apart from every other one by its double."""

EXACT_POWER = 22
"""Powers of ten up to this one are doubles without rounding."""

NEIGHBOURS = 2
"""The quotient is at most so many doubles away from the number that was multiplied: each of the two
roundings moves it by half a unit in the last place of a number that may be twice as coarse."""


def to_si(numbers: FloatArray, column: LogColumn) -> FloatArray:
    """Return factor (sign value + offset) as the reader computes it, in SI, shape (n,).

    Values are in the unit of the column, shape (n,).
    """
    values = numbers if column.sign == 1 else -numbers
    values = values + column.offset if column.offset else values
    return values if column.factor == 1.0 else values * column.factor


def originals(values: FloatArray, column: LogColumn) -> FloatArray:
    """Return the numbers of a column as the file has them, in its unit, shape (n,); NaN stays.

    Of the doubles whose conversion gives the value in SI, shape (n,), bit by bit, the one with the shortest
    decimal text is taken: of a file with up to 15 digits that is its own number, else one next to it at most.
    Where an offset leaves no such double in reach, it is the nearest to the inverse.
    """
    if column.factor == 1.0 and not column.offset:
        return values if column.sign == 1 else -values
    near = values / column.factor - column.offset
    near = near if column.sign == 1 else -near
    numbers = _rounded(near, np.maximum(np.abs(near), abs(column.offset)))
    off = np.flatnonzero((to_si(numbers, column) != values) & ~np.isnan(values))
    numbers[off] = _shortest(near[off], values[off], column)
    return numbers


def _rounded(numbers: FloatArray, size: FloatArray) -> FloatArray:
    """Round to 15 significant digits of a size, so far as powers of ten are exact.

    Of 1e15 and more these stand before the point: there the double next to one of them is an integer, too.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        power = np.nan_to_num(DIGITS - 1 - np.floor(np.log10(size)), nan=0.0, posinf=0.0, neginf=0.0)
    scale, tens = (10.0 ** np.clip(one, 0, EXACT_POWER) for one in (power, -power))
    with np.errstate(over="ignore"):
        return np.where(numbers == 0.0, numbers, np.rint(numbers * scale / tens) * tens / scale)


def _shortest(near: FloatArray, values: FloatArray, column: LogColumn) -> FloatArray:
    """Return of each number and its neighbours the shortest that converts to the value, or the number."""
    best, shortest = near.copy(), np.where(to_si(near, column) == values, _lengths(near), np.inf)
    for towards in (np.inf, -np.inf):
        candidate = near
        for _ in range(NEIGHBOURS):
            candidate = np.nextafter(candidate, towards)
            kept = np.flatnonzero(to_si(candidate, column) == values)
            length = _lengths(candidate[kept])
            better = length < shortest[kept]
            best[kept[better]], shortest[kept[better]] = candidate[kept][better], length[better]
    return best


def _lengths(numbers: FloatArray) -> FloatArray:
    """Return the length of the shortest decimal text of each number."""
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pa.array(numbers).cast(pa.string())
    return np.asarray(pc.binary_length(text).to_numpy(zero_copy_only=False), dtype=np.float64)
