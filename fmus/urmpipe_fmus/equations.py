"""A unit's functions on flat lists of scalars: the form in which they are run, traced and looked into."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from urmpipe_fmus.table import Rows
from urmpipe_fmus.unit import Function, Unit
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Variable
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import Finding, UnitError, UrmpipeError


class Equations:
    """What a unit computes, from one element a scalar to one element a scalar.

    Each method takes the elements of `unit.given` in their order: parameters, inputs, states, memories.

    Attributes:
        unit: The unit.
    """

    def __init__(self, unit: Unit) -> None:
        self.unit = unit

    def outputs(self, time: Element, given: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the elements of `unit.computed`."""
        return self._called("outputs", self.unit.outputs, self.unit.computed, time, given, rows)

    def derivatives(self, time: Element, given: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the derivatives of `unit.states` in [unit/s]."""
        return self._called("derivatives", self.unit.derivatives, self.unit.states, time, given, rows)

    def update(self, time: Element, given: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the next values of `unit.memories`."""
        return self._called("update", self.unit.update, self.unit.memories, time, given, rows)

    def _called(
        self,
        what: str,
        function: Function | None,
        variables: Sequence[Variable],
        time: Element,
        given: Sequence[Element],
        rows: Rows | None,
    ) -> list[Element]:
        """Return what a function of the unit gives for some variables, flat."""
        if function is None:
            return []
        where = f"unit {self.unit.name}: {what}"
        values = Values(time, named(self.unit.given, given), rows)
        try:
            with np.errstate(all="ignore"):  # 1/0 is inf, as in C; who uses it asks whether it is finite
                result = function(values)
            return flat(result, variables)
        except Exception as error:
            raise UnitError(*_told(where, function, error)) from error


def _told(where: str, function: Function, error: Exception) -> Iterator[Finding]:
    """Yield what went wrong in a unit's function, and in which line of its file; else where it begins."""
    code = getattr(function, "__code__", None)
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if code and frame.filename == code.co_filename]
    place = {"file": code.co_filename, "line": [code.co_firstlineno, *lines][-1]} if code else {}
    if isinstance(error, UrmpipeError):
        said = error.findings
    else:
        said = (Finding(f"{type(error).__name__}: {error}"),)
    return (replace(one, message=": ".join(filter(None, (where, one.message))), **place) for one in said)


def named(variables: Sequence[Variable], elements: Sequence[Element]) -> dict[str, Any]:
    """Return the elements of variables by name: one, or a tuple of them for a variable with a size."""
    rest = iter(elements)
    return {one.name: next(rest) if one.size is None else tuple(islice(rest, one.size)) for one in variables}


def flat(result: Any, variables: Sequence[Variable]) -> list[Element]:
    """Return what a function gave by name as one element a scalar, in the order of the variables.

    Raises:
        UnitError: If it is no mapping, a name is missing or unknown, or one has not its variable's size.
    """
    if not isinstance(result, Mapping):
        raise UnitError(
            f"returns {_kind(result)}, allowed: a dict of {', '.join(one.name for one in variables)}"
        )
    faults = list(_faults(result, variables))
    if faults:
        raise UnitError(*faults)
    return [
        element
        for one in variables
        for element in ((result[one.name],) if one.size is None else result[one.name])
    ]


def _faults(result: Mapping[str, Any], variables: Sequence[Variable]) -> Iterator[str]:
    expected = {one.name: one for one in variables}
    for name in sorted(set(result) - set(expected), key=str):
        yield f"{name}: found in what it returns, allowed: {', '.join(expected)}"
    for name, one in expected.items():
        if name not in result:
            yield f"{name}: not found in what it returns, allowed: all of {', '.join(expected)}"
            continue
        found = result[name]
        if one.size is None:
            yield from _element_faults(name, found)
        elif not isinstance(found, (tuple, list)):
            yield f"{name}: found {_kind(found)}, allowed: a tuple of {one.size} elements"
        elif len(found) != one.size:
            yield f"{name}: found {len(found)} elements, allowed: {one.size}"
        else:
            for scalar, element in zip(one.names, found, strict=True):
                yield from _element_faults(scalar, element)


def _element_faults(name: str, found: Any) -> Iterator[str]:
    if found is None or isinstance(found, (str, complex, tuple, list, dict)):
        yield f"{name}: found {_kind(found)}, allowed: one element"


def _kind(value: Any) -> str:
    return "nothing (None)" if value is None else f"{type(value).__name__}"
