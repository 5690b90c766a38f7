"""A log through an elementwise function, in memory that stays in the cache.

A model is written once, for one element per coordinate (see `elementwise`). Over an array, each of its
operations would make an array of its own, and memory would cost more than arithmetic. So the function runs
once on elements that record its operations; these then run block by block, in a few arrays that all blocks
share. They are the same operations on the same numbers, so the results are the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import count
from operator import itemgetter
from typing import Any, TypeAlias

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from urmpipe_models.elementwise import WORK, Element, FloatArray, cosine_sine_into, row_blocks

BLOCK = 12288
"""Rows in a block: some 20 arrays of 96 kB stay in a core's cache, and a call of NumPy costs a tenth."""

LONG = 2 * BLOCK
"""Fewer rows take less time than recording, which takes a millisecond or two."""

_LINE = 8
"""Doubles in a line of the cache, 64 bytes: NumPy is half as fast again on arrays that start with one."""

Function: TypeAlias = Callable[[Sequence[Element]], Iterable[Element]]
Operation: TypeAlias = tuple[Callable[..., object], Callable[[Sequence[FloatArray]], Sequence[FloatArray]]]


def aligned(rows: int, length: int) -> FloatArray:
    """Return an empty array in any unit, shape (rows, length); each row starts at a line of the cache."""
    width = -(-length // _LINE) * _LINE
    memory = np.empty(rows * width + _LINE)
    start = -memory.ctypes.data // memory.itemsize % _LINE
    return memory[start : start + rows * width].reshape(rows, width)[:, :length]


def fill_over_log(function: Function, q: FloatArray, targets: Sequence[FloatArray]) -> None:
    """Write the elements that a function returns for the columns of a log, one per target; constants fill it.

    Args:
        function: Of one element per coordinate, by + - *, their like among NumPy's ufuncs, and `cosine_sine`.
        q: Joint values in [rad] or [m], shape (n, coordinates).
        targets: For each element that the function returns an array in its unit, shape (n,).
    """
    if len(q) < LONG:
        columns = np.ascontiguousarray(q.T, dtype=np.float64)
        for target, element in zip(targets, function([*columns]), strict=True):
            target[:] = element
        return
    tape = Tape(function, q.shape[1], len(targets))
    columns, arrays = aligned(q.shape[1], BLOCK), aligned(tape.arrays, BLOCK)
    for block in row_blocks(len(q), BLOCK):
        rows = slice(block.stop - block.start)
        np.copyto(columns[:, rows], q[block].T)
        places = [*columns[:, rows], *(one[block] for one in targets), *arrays[:, rows], *tape.constants]
        for operation, chosen in tape.operations:
            operation(*chosen(places))


class Tape:
    """The operations of a function in order, each with the choice of its arrays from the list of all.

    All are the inputs, the outputs, the arrays in between, and the constants.

    Attributes:
        operations: What to call, and what chooses its arguments from the list of all arrays.
        arrays: How many arrays in between there are: one holds many values, one after the other.
        constants: Each an array of no dimension, which NumPy takes faster than a float.
    """

    def __init__(self, function: Function, inputs: int, outputs: int) -> None:
        """Record a function."""
        self._recorded: list[tuple[Callable[..., object], list[int], range]] = []
        self._numbers: list[float] = []
        self._count = inputs
        self._turns: dict[int, tuple[_Value, _Value]] = {}
        targets: dict[int, int] = {}
        elements = function([_Value(self, k) for k in range(inputs)])
        for place, element in zip(range(inputs, inputs + outputs), elements, strict=True):
            copy = not isinstance(element, _Value) or element.at < inputs or element.at in targets
            targets[self.add(np.positive, [element])[0].at if copy else element.at] = place
        places = {**{k: k for k in range(inputs)}, **targets}
        self.operations, self.arrays = self._placed(places, inputs + outputs)
        self.constants = [np.array(number) for number in reversed(self._numbers)]

    def add(
        self, operation: Callable[..., object], operands: Sequence[_Value | float], results: int = 1
    ) -> list[_Value]:
        """Record an operation and return its results."""
        numbers = []
        for operand in operands:
            if not isinstance(operand, _Value):
                self._numbers.append(float(operand))
            numbers.append(operand.at if isinstance(operand, _Value) else -len(self._numbers))
        made = range(self._count, self._count + results)
        self._count = made.stop
        self._recorded.append((operation, numbers, made))
        return [_Value(self, k) for k in made]

    def turn(self, angle: _Value) -> tuple[_Value, _Value]:
        """Record cos and sin of an angle, once."""
        if angle.at not in self._turns:
            cosine, sine = self.add(cosine_sine_into, [angle], 2)
            self._turns[angle.at] = cosine, sine
        return self._turns[angle.at]

    def _placed(self, places: dict[int, int], first: int) -> tuple[list[Operation], int]:
        """Return the operations with their arrays, and the number of intermediate arrays from `first`.

        An array is free again after the last operation that needs its value; the one freed last is taken
        first, while the cache has it. A ufunc may write over its operands, cosine and sine may not.
        """
        last = {k: i for i, (_, operands, _) in enumerate(self._recorded) for k in operands}
        operations: list[Operation] = []
        free: list[int] = []
        fresh = count(first)
        for i, (operation, operands, results) in enumerate(self._recorded):
            over = [places[k] for k in dict.fromkeys(operands) if last[k] == i and places.get(k, 0) >= first]
            turn = operation is cosine_sine_into
            free += [] if turn else over
            for k in results:
                places.setdefault(k, free.pop() if free else next(fresh))
            work = [free.pop() if free else next(fresh) for _ in range(WORK if turn else 0)]
            chosen = [places.get(k, k) for k in [*operands, *results]] + work
            operations.append((operation, itemgetter(*chosen)))
            free += work + (over if turn else [])
            free += [places[k] for k in results if k not in last and places[k] >= first]
        return operations, next(fresh) - first


class _Value(NDArrayOperatorsMixin):
    """An element that is a value of a tape."""

    def __init__(self, tape: Tape, at: int) -> None:
        """Keep its number."""
        self.tape, self.at = tape, at

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *operands: Any, **options: Any) -> _Value:
        """Record an operation; cos and sin are those of `cosine_sine`, by which models take them."""
        if method != "__call__" or options or ufunc.nout != 1:
            raise TypeError(f"np.{ufunc.__name__} is not recorded; allowed: one result, no options")
        if ufunc in (np.cos, np.sin):
            return self.tape.turn(self)[ufunc is np.sin]
        return self.tape.add(ufunc, operands)[0]

    def __bool__(self) -> bool:
        """Refuse: what a function does may not depend on a value."""
        raise TypeError("a choice by a value is not recorded; allowed: operations on every value")
