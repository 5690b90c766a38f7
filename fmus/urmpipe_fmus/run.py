"""A unit's functions on flat lists of scalars: the form in which they are run, traced and looked into.

An instance of a unit in Python: the rules of a step, which the native runtime follows line by line.

A unit over a log: all samples at once where it remembers nothing, else sample by sample.
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from urmpipe_fmus.block import (
    INTERNAL_STEP,
    MAX_INTEGER,
    BlockModel,
    Function,
    Memory,
    Output,
    Parameter,
    Rows,
    State,
    Values,
    Variable,
)
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.errors import Finding, UnitError, UrmpipeError


class Equations:
    """What a unit computes, from one element a scalar to one element a scalar.

    Each method takes the elements of `model.arguments` in their order: parameters, inputs, states, memories.

    Attributes:
        model: The block model.
    """

    def __init__(self, model: BlockModel) -> None:
        self.model = model

    def outputs(self, time: Element, given: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the elements of `model.computed`."""
        return self._called("outputs", self.model.outputs, self.model.computed, time, given, rows)

    def derivatives(self, time: Element, given: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the derivatives of `model.states` in [unit/s]."""
        return self._called("derivatives", self.model.derivatives, self.model.states, time, given, rows)

    def update(self, time: Element, given: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the next values of `model.memories`."""
        return self._called("update", self.model.update, self.model.memories, time, given, rows)

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
        where = f"unit {self.model.name}: {what}"
        values = Values(time, elements_to_dict(self.model.arguments, given), rows)
        try:
            with np.errstate(all="ignore"):  # 1/0 is inf, as in C; who uses it asks whether it is finite
                result = function(values)
            return dict_to_elements(result, variables)
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


def elements_to_dict(variables: Sequence[Variable], elements: Sequence[Element]) -> dict[str, Any]:
    """Return the elements of variables by name: one, or a tuple of them for a variable with a size."""
    rest = iter(elements)
    return {one.name: next(rest) if one.size is None else tuple(islice(rest, one.size)) for one in variables}


def dict_to_elements(result: Any, variables: Sequence[Variable]) -> list[Element]:
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


STEP_SLACK = 1e-9
"""A step of n internal steps but for this share of one takes n of them: k h - (k-1) h is not quite h."""

TIME_SLACK = 1e-6
"""A communication point may differ by this share of the step from where the instance stands."""

ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""And by this share of itself, however short the step: start + k h is rounded here, in the master, and again
in where the step before ended."""

STOP_SLACK = 0.1
"""This share of a step past the stop time is what adding up steps may bring."""


class Instance:
    """A unit that is stepped through time.

    Values are NumPy's doubles, which compute as C's do: 1/0 is inf, and raises nothing. They may be elements
    of shape (runs,) as well, which step many runs side by side.

    Attributes:
        model: The block model.
        time: Where it stands in [s].
        stop: Where the simulation ends in [s]; infinite if that is not said.
        running: Whether fixed parameters are fixed: from the first step on.
    """

    def __init__(self, model: BlockModel, time: Element = 0.0) -> None:
        self.model = model
        self.time: Element = np.float64(time)
        self.stop = math.inf
        self.running = False
        self._equations = Equations(model)
        self._owner = [variable for _, variable in model.scalars]
        self._index = {name: index for index, (name, _) in enumerate(model.scalars)}
        self._values: list[Element] = [np.float64(start) for one in model.variables for start in one.starts]
        self._given = self._places(model.arguments)
        self._states = self._places(model.states)
        self._memories = self._places(model.memories)
        self._computed = self._places(model.computed)
        self._stale = True

    def reference(self, name: str) -> int:
        """Return the value reference of a scalar.

        Raises:
            UnitError: If the unit has no such scalar.
        """
        if name not in self._index:
            allowed = ", ".join(self._index)
            raise UnitError(f"unit {self.model.name}: no variable {name}; allowed: {allowed}")
        return self._index[name]

    def set(self, references: Sequence[int], values: Sequence[Element]) -> None:
        """Set scalars: all of them, or none if one is refused.

        Raises:
            UnitError: With all that is refused: no such reference, an output, a value not finite or out of
                range, a fixed parameter or a state of a running instance.
        """
        faults = [
            fault
            for reference, value in zip(references, values, strict=True)
            for fault in self._refusals(reference, value)
        ]
        if faults:
            raise UnitError(*(f"unit {self.model.name}: {fault}" for fault in faults))
        for reference, value in zip(references, values, strict=True):
            self._values[reference] = _doubles(value)
        self._stale = True

    def get(self, references: Sequence[int]) -> list[Element]:
        """Return scalars; outputs are those of the inputs as they stand now.

        Raises:
            UnitError: If there is no such reference, or an output is not finite.
        """
        for reference in references:
            if not 0 <= reference < len(self._owner):
                raise UnitError(f"unit {self.model.name}: {self._no_reference(reference)}")
            if self._stale and isinstance(self._owner[reference], Output):
                self._refresh()
        return [self._values[reference] for reference in references]

    def do_step(self, time: float, step: float) -> None:
        """Take the sample at a communication point, and go to the next.

        Args:
            time: The communication point in [s].
            step: To the next one in [s], above 0.

        Raises:
            UnitError: If the step is not above 0, does not begin where the instance stands, goes past the
                stop time or is too long for its internal steps, or a state is not finite after it; then
                nothing changed, but that what is fixed from the first step on stays fixed.
        """
        if not (math.isfinite(time + step) and step > 0.0):
            raise UnitError(
                f"unit {self.model.name}: found a step of {step:g} s at {time:g} s, allowed: finite, above 0"
            )
        if not abs(time - self.time) <= max(TIME_SLACK * step, ROUNDING * abs(time)):
            raise UnitError(
                f"unit {self.model.name}: found a step from {time:.15g} s,"
                f" allowed: from where it stands, {self.time:.15g} s"
            )
        if time + step - self.stop > STOP_SLACK * step:
            raise UnitError(
                f"unit {self.model.name}: found a step to {time + step:g} s,"
                f" allowed: to the stop time, {self.stop:g} s"
            )
        before = (self.time, list(self._values), self._stale)
        self.running = True
        try:
            with np.errstate(all="ignore"):  # what is not finite is told
                self._sample(np.float64(time))
                self._integrate(np.float64(time), np.float64(step))
        except BaseException:
            self.time, self._values, self._stale = before
            raise
        self.time, self._stale = np.float64(time) + step, True

    def setup_experiment(self, time: float, stop: float | None = None) -> None:
        """Put the instance at its start time in [s], before the first step; no step may go past `stop`.

        Raises:
            UnitError: If the time is not finite, or the stop time before it.
        """
        if not math.isfinite(time):
            raise UnitError(f"unit {self.model.name}: startTime: found {time:g}, allowed: a finite number")
        if stop is not None and not stop >= time:
            raise UnitError(
                f"unit {self.model.name}: stopTime: found {stop:g}, allowed: from the start time {time:g} on"
            )
        self.time, self._stale = np.float64(time), True
        self.stop = math.inf if stop is None else stop

    def save(self) -> Any:
        """Return all that the instance remembers, to be given to `restore`."""
        return self.time, self.running, list(self._values)

    def restore(self, saved: Any) -> None:
        """Go back to where `save` was called."""
        self.time, self.running, values = saved
        self._values, self._stale = list(values), True

    def _places(self, variables: Sequence[Variable]) -> list[int]:
        return [self._index[name] for one in variables for name in one.names]

    def _no_reference(self, reference: int) -> str:
        return f"value reference {reference}: found, allowed: 0 to {len(self._owner) - 1}"

    def _refusals(self, reference: int, value: Element) -> list[str]:
        """Return why a scalar cannot be set."""
        if not 0 <= reference < len(self._owner):
            return [self._no_reference(reference)]
        one, name = self._owner[reference], self.model.scalars[reference][0]
        if isinstance(one, Output):
            return [f"{name}: set, allowed: an output is computed, not set"]
        if self.running and isinstance(one, (State, Memory)):
            return [f"{name}: set while it runs, allowed: a state before the first step"]
        if self.running and isinstance(one, Parameter) and not one.tunable:
            return [f"{name}: set while it runs, allowed: a fixed parameter before the first step"]
        return [
            f"{name}: {fault}" for each in _extremes(one, value) for fault in one.rejection_reasons(each)
        ][:1]

    def _rows(self, time: Element) -> Rows | None:
        return None if self.model.table is None else self.model.table.rows_at(time)

    def _elements(self) -> list[Element]:
        return [self._values[place] for place in self._given]

    def _refresh(self) -> None:
        """Compute the outputs."""
        found = self._equations.outputs(self.time, self._elements(), self._rows(self.time))
        self._put(self._computed, found, "output")
        self._stale = False

    def _sample(self, time: float) -> None:
        """Take the sample: the memories' next values from the values at the communication point."""
        found = self._equations.update(time, self._elements(), self._rows(time))
        self._put(self._memories, found, "next value")

    def _integrate(self, time: float, step: float) -> None:
        """Integrate the states over a step with the classical Runge-Kutta method (RK4)."""
        if not self._states:
            return
        largest = self._values[self._index[INTERNAL_STEP]]
        if step / largest > MAX_INTEGER:
            raise UnitError(
                f"unit {self.model.name}: found a step of {step:g} s in internal steps of {largest:g} s,"
                f" allowed: {MAX_INTEGER} internal steps"
            )
        count = max(1, math.ceil(step / largest - STEP_SLACK))
        h = step / count
        for k in range(count):
            t = time + k * h
            x = [self._values[place] for place in self._states]
            k1 = self._rates(t, x)
            k2 = self._rates(t + 0.5 * h, [a + 0.5 * h * b for a, b in zip(x, k1, strict=True)])
            k3 = self._rates(t + 0.5 * h, [a + 0.5 * h * b for a, b in zip(x, k2, strict=True)])
            k4 = self._rates(t + h, [a + h * b for a, b in zip(x, k3, strict=True)])
            slopes = zip(x, k1, k2, k3, k4, strict=True)
            self._put(
                self._states,
                [a + h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4) for a, b1, b2, b3, b4 in slopes],
                "state",
            )

    def _rates(self, time: float, states: Sequence[Element]) -> list[Element]:
        """Return the derivatives at a time and for some states, the rest as it stands."""
        values = list(self._values)
        for place, state in zip(self._states, states, strict=True):
            values[place] = state
        return self._equations.derivatives(time, [values[place] for place in self._given], self._rows(time))

    def _put(self, places: Sequence[int], found: Sequence[Element], what: str) -> None:
        """Take new values over.

        Raises:
            UnitError: If one is not finite.
        """
        taken = [_doubles(value) for value in found]
        faults = [
            f"unit {self.model.name}: {what} {self.model.scalars[place][0]} is not finite at"
            f" {self._first_not_finite(value):g} s"
            for place, value in zip(places, taken, strict=True)
            if not _all_finite(value)
        ]
        if faults:
            raise UnitError(*faults)
        for place, value in zip(places, taken, strict=True):
            self._values[place] = value

    def _first_not_finite(self, value: Element) -> float:
        """Return the time of the first of some values that is not finite."""
        times, values = np.broadcast_arrays(self.time, value)
        return float(times[~np.isfinite(values)][0])


def _doubles(value: Element) -> Element:
    """Return a value as C has it; a column as one of our own, which nobody else changes."""
    column = isinstance(value, np.ndarray) and value.ndim > 0
    return np.array(value, dtype=np.float64) if column else np.float64(value)


def _all_finite(value: Element) -> bool:
    return math.isfinite(value) if isinstance(value, float) else bool(np.isfinite(value).all())


def _extremes(variable: Variable, value: Element) -> list[float]:
    """Return values of which one is refused if any of an element is: of a column its bounds."""
    if not isinstance(value, np.ndarray):
        return [float(value)]
    values = np.ravel(np.float64(value))
    if variable.type != "Real":
        values = np.unique(values)
    elif values.size:
        values = np.array([values.min(), values.max()])
    return [float(one) for one in values]


def run(
    model: BlockModel,
    t: FloatArray,
    inputs: Mapping[str, Any] | None = None,
    start: Mapping[str, Any] | None = None,
) -> dict[str, FloatArray]:
    """Run a unit over the samples of a log: the outputs at each sample for the inputs of that sample.

    Args:
        model: The block model.
        t: Times of the samples in [s], finite, strictly rising, shape (n,).
        inputs: Values of the inputs by variable name, in their units: shape (n,), or (n, size); an input
            that is not named stays at its start.
        start: Parameters and start values of states by variable name; a sequence for one with a size.

    Returns:
        Every output, and every state or memory that is one, by variable name, in its own unit:
        shape (n,), or (n, size).

    Raises:
        UnitError: If times do not rise, a name is unknown, a shape does not fit, a value is refused, or an
            output is not finite.
    """
    t = np.asarray(t, dtype=np.float64)
    if t.ndim != 1 or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any():
        raise UnitError(
            f"unit {model.name}: found times of shape {t.shape}, allowed: rising times, shape (n,)"
        )
    instance = Instance(model, t[0] if len(t) else 0.0)
    for name, value in (start or {}).items():
        owner = _variable(model, name)
        instance.set([instance.reference(scalar) for scalar in owner.names], _starts(model, owner, value))
    columns = _columns(model, inputs or {}, len(t))
    shown = [one for one in model.variables if one.causality == "output"]
    over = _stepped if model.states or model.memories else _at_once
    found = over(instance, t, columns, [name for one in shown for name in one.names])
    return {
        name: np.column_stack(value) if isinstance(value, tuple) else np.asarray(value)
        for name, value in elements_to_dict(shown, found).items()
    }


def _variable(model: BlockModel, name: str) -> Variable:
    """Return a variable of a unit by name."""
    allowed = [one.name for one in model.variables]
    if name not in allowed:
        raise UnitError(f"unit {model.name}: no variable {name}; allowed: {', '.join(allowed)}")
    return model.variables[allowed.index(name)]


def _starts(model: BlockModel, owner: Variable, value: Any) -> list[float]:
    """Return the start value of every scalar of a variable: one for all of them, or one each."""
    values: list[float] = np.ravel(np.asarray(value, dtype=np.float64)).tolist()
    counts = sorted({1, owner.width})
    if len(values) not in counts:
        allowed = " or ".join(map(str, counts))
        raise UnitError(f"unit {model.name}: {owner.name}: found {len(values)} values, allowed: {allowed}")
    return values * (owner.width // len(values))


def _columns(model: BlockModel, inputs: Mapping[str, Any], count: int) -> dict[str, FloatArray]:
    """Return the column of every scalar that is given over the log."""
    columns: dict[str, FloatArray] = {}
    for name, value in inputs.items():
        owner, found = _variable(model, name), np.asarray(value, dtype=np.float64)
        shape = (count,) if owner.size is None else (count, owner.size)
        if owner not in model.inputs or found.shape != shape:
            raise UnitError(
                f"unit {model.name}: {name}: found {owner.causality} with values of shape {found.shape},"
                f" allowed: an input, shape {shape}"
            )
        columns |= zip(owner.names, found.reshape(count, owner.width).T, strict=True)
    return columns


def _at_once(
    instance: Instance, t: FloatArray, columns: Mapping[str, FloatArray], shown: Sequence[str]
) -> list[Element]:
    """Return the outputs of a unit that remembers nothing, each shape (n,)."""
    instance.time = t
    instance.set([instance.reference(name) for name in columns], list(columns.values()))
    found = instance.get([instance.reference(name) for name in shown])
    return [np.broadcast_to(one, t.shape).copy() for one in found]


def _stepped(
    instance: Instance, t: FloatArray, columns: Mapping[str, FloatArray], shown: Sequence[str]
) -> list[Element]:
    """Return what a unit shows at every sample, each shape (n,)."""
    inputs = [instance.reference(name) for name in columns]
    outputs = [instance.reference(name) for name in shown]
    given = np.column_stack(list(columns.values())).tolist() if columns else [[]] * len(t)
    found = np.empty((len(outputs), len(t)))
    for k, time in enumerate(t.tolist()):
        instance.set(inputs, given[k])
        found[:, k] = instance.get(outputs)
        if k + 1 < len(t):
            instance.do_step(time, float(t[k + 1]) - time)
    return list(found)
