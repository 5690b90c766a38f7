"""Block models in Python: the functions of a model on flat lists, and the rules of a step (fmi2DoStep).

1. `Equations` calls the functions of a model with one element per scalar and checks what they return. Runs,
   traces to C and the search of dependencies all call the functions in this way.
2. `Instance` steps a model through time. Its rules (`do_step` is fmi2DoStep) are those of all FMUs: a Python
   FMU contains it, and native/runtime/stepping.c follows it line by line, with the constants below.

`run.run` steps a model over the samples of a log.
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
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import Finding, UnitError, UrmpipeError

STEP_SLACK = 1e-9  # of an internal step; k h - (k - 1) h is rounded, and must not take one step more
TIME_SLACK = 1e-6  # of a step: allowed distance of the communication point from the time of the instance
# Of the time itself, for short steps: start + k h is rounded here, in the importer, and in the step before.
ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
STOP_SLACK = 0.1  # of a step: allowed excess over the stop time, from adding up steps


class Equations:
    """The functions of a block model, from one element per scalar to one element per scalar.

    Each method takes the elements of `model.arguments` in their order: parameters, inputs, states, memories.

    Attributes:
        model: The block model.
    """

    def __init__(self, model: BlockModel) -> None:
        self.model = model

    def outputs(self, time: Element, arguments: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the elements of `model.computed`."""
        return self._call("outputs", self.model.outputs, self.model.computed, time, arguments, rows)

    def derivatives(
        self, time: Element, arguments: Sequence[Element], rows: Rows | None = None
    ) -> list[Element]:
        """Return the derivatives of `model.states` in [unit/s]."""
        return self._call("derivatives", self.model.derivatives, self.model.states, time, arguments, rows)

    def update(self, time: Element, arguments: Sequence[Element], rows: Rows | None = None) -> list[Element]:
        """Return the next values of `model.memories`."""
        return self._call("update", self.model.update, self.model.memories, time, arguments, rows)

    def _call(
        self,
        name: str,
        function: Function | None,
        variables: Sequence[Variable],
        time: Element,
        arguments: Sequence[Element],
        rows: Rows | None,
    ) -> list[Element]:
        if function is None:
            return []
        values = Values(time, elements_to_dict(self.model.arguments, arguments), rows)
        try:
            with np.errstate(all="ignore"):  # 1/0 is inf, as in C; users of the result check if it is finite
                result = function(values)
            return dict_to_elements(result, variables)
        except Exception as error:
            findings = _locate_error(f"unit {self.model.name}: {name}", function, error)
            raise UnitError(*findings) from error


def _locate_error(where: str, function: Function, error: Exception) -> Iterator[Finding]:
    """Yield the findings of an error in a model's function, at its line, or at the function's first line."""
    code = getattr(function, "__code__", None)
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if code and frame.filename == code.co_filename]
    place = {"file": code.co_filename, "line": [code.co_firstlineno, *lines][-1]} if code else {}
    other = (Finding(f"{type(error).__name__}: {error}"),)
    for finding in error.findings if isinstance(error, UrmpipeError) else other:
        yield replace(finding, message=": ".join(filter(None, (where, finding.message))), **place)


def elements_to_dict(variables: Sequence[Variable], elements: Sequence[Element]) -> dict[str, Any]:
    """Return the elements of variables by name: one, or a tuple of them for a variable with a size."""
    rest = iter(elements)
    return {
        variable.name: next(rest) if variable.size is None else tuple(islice(rest, variable.size))
        for variable in variables
    }


def dict_to_elements(result: Any, variables: Sequence[Variable]) -> list[Element]:
    """Return the result of a function as one element per scalar, in the order of the variables.

    Raises:
        UnitError: If it is no mapping, a name is missing or unknown, or a size differs from its variable's.
    """
    if not isinstance(result, Mapping):
        names = ", ".join(variable.name for variable in variables)
        raise UnitError(f"returns {_kind(result)}, allowed: a dict of {names}")
    faults = list(_result_faults(result, variables))
    if faults:
        raise UnitError(*faults)
    return [
        element
        for variable in variables
        for element in ((result[variable.name],) if variable.size is None else result[variable.name])
    ]


def _result_faults(result: Mapping[str, Any], variables: Sequence[Variable]) -> Iterator[str]:
    expected = {variable.name: variable for variable in variables}
    for name in sorted(set(result) - set(expected), key=str):
        yield f"{name}: found in what it returns, allowed: {', '.join(expected)}"
    for name, variable in expected.items():
        if name not in result:
            yield f"{name}: not found in what it returns, allowed: all of {', '.join(expected)}"
            continue
        value = result[name]
        if variable.size is None:
            scalars = [(name, value)]
        elif not isinstance(value, (tuple, list)):
            yield f"{name}: found {_kind(value)}, allowed: a tuple of {variable.size} elements"
            continue
        elif len(value) != variable.size:
            yield f"{name}: found {len(value)} elements, allowed: {variable.size}"
            continue
        else:
            scalars = [*zip(variable.names, value, strict=True)]
        for scalar, element in scalars:
            if element is None or isinstance(element, (str, complex, tuple, list, dict)):
                yield f"{scalar}: found {_kind(element)}, allowed: one element"


def _kind(value: Any) -> str:
    return "nothing (None)" if value is None else type(value).__name__


class Instance:
    """A block model that is stepped through time; the rules of its calls are those of the FMUs.

    Values are NumPy's doubles, which compute as C's do: 1/0 is inf and raises nothing. They may be arrays of
    shape (runs,), which steps many runs in parallel.

    Attributes:
        model: The block model.
        time: The time that it has reached, in [s].
        stop: The stop time in [s]; infinite without one.
        running: Whether a step was begun: then fixed parameters and states can no longer be set.
    """

    def __init__(self, model: BlockModel, time: Element = 0.0) -> None:
        self.model = model
        self.time: Element = np.float64(time)
        self.stop = math.inf
        self.running = False
        self._equations = Equations(model)
        self._owner = [variable for _, variable in model.scalars]
        self._index = {name: index for index, (name, _) in enumerate(model.scalars)}
        self._values: list[Element] = [
            np.float64(start) for variable in model.variables for start in variable.starts
        ]
        self._arguments, self._states, self._memories, self._computed = (
            [self._index[name] for variable in variables for name in variable.names]
            for variables in (model.arguments, model.states, model.memories, model.computed)
        )
        self._stale = True  # whether the outputs must be computed before they are read

    def reference(self, name: str) -> int:
        """Return the value reference of a scalar.

        Raises:
            UnitError: If the model has no such scalar.
        """
        if name not in self._index:
            raise self._error(f"no variable {name}; allowed: {', '.join(self._index)}")
        return self._index[name]

    def setup_experiment(self, time: float, stop: float | None = None) -> None:
        """Set the start time in [s] before the first step, and the stop time (fmi2SetupExperiment).

        Raises:
            UnitError: If the time is not finite, or the stop time before it.
        """
        if not math.isfinite(time):
            raise self._error(f"startTime: found {time:g}, allowed: a finite number")
        if stop is not None and not stop >= time:
            raise self._error(f"stopTime: found {stop:g}, allowed: from the start time {time:g} on")
        self.time, self._stale = np.float64(time), True
        self.stop = math.inf if stop is None else stop

    def set(self, references: Sequence[int], values: Sequence[Element]) -> None:
        """Set scalars (fmi2SetReal and its like): all of them, or none if one is rejected.

        Raises:
            UnitError: With all rejections: no such reference, an output, a value not finite or out of range,
                a fixed parameter or a state of a running instance.
        """
        faults = [
            fault
            for reference, value in zip(references, values, strict=True)
            for fault in self._rejection_reasons(reference, value)
        ]
        if faults:
            raise self._error(*faults)
        for reference, value in zip(references, values, strict=True):
            self._values[reference] = _to_double(value)
        self._stale = True

    def get(self, references: Sequence[int]) -> list[Element]:
        """Return scalars (fmi2GetReal and its like); outputs follow the inputs that are set, without a step.

        Raises:
            UnitError: If there is no such reference, or an output is not finite.
        """
        for reference in references:
            if not 0 <= reference < len(self._owner):
                raise self._error(self._reference_fault(reference))
            if self._stale and isinstance(self._owner[reference], Output):
                outputs = self._equations.outputs(self.time, self._read_arguments(), self._rows(self.time))
                self._put(self._computed, outputs, "output")
                self._stale = False
        return [self._values[reference] for reference in references]

    def do_step(self, time: float, step: float) -> None:
        """Step from a communication point to the next (fmi2DoStep).

        1. The step must be finite and above 0, begin at the time of the instance (`TIME_SLACK`, `ROUNDING`)
           and end at the stop time at the latest (`STOP_SLACK`).
        2. Sample: `update` gives the next values of the memories from the values at the communication point.
        3. Integrate the states (`_integrate`), with inputs and memories held.

        Args:
            time: The communication point in [s].
            step: Distance of the next one in [s], above 0.

        Raises:
            UnitError: If the step is not allowed or too long for its internal steps, or a state is not finite
                after it. Then nothing has changed, except that the instance is running.
        """
        if not (math.isfinite(time + step) and step > 0.0):
            raise self._error(f"found a step of {step:g} s at {time:g} s, allowed: finite, above 0")
        if not abs(time - self.time) <= max(TIME_SLACK * step, ROUNDING * abs(time)):
            stands = f"from where it stands, {self.time:.15g} s"
            raise self._error(f"found a step from {time:.15g} s, allowed: {stands}")
        if time + step - self.stop > STOP_SLACK * step:
            raise self._error(
                f"found a step to {time + step:g} s, allowed: to the stop time, {self.stop:g} s"
            )
        before = (self.time, list(self._values), self._stale)
        self.running = True
        try:
            with np.errstate(all="ignore"):  # values that are not finite are reported
                t = np.float64(time)
                samples = self._equations.update(t, self._read_arguments(), self._rows(t))
                self._put(self._memories, samples, "next value")
                self._integrate(t, np.float64(step))
        except BaseException:
            self.time, self._values, self._stale = before
            raise
        self.time, self._stale = np.float64(time) + step, True

    def _integrate(self, time: float, step: float) -> None:
        """Integrate the states by the classical Runge-Kutta method (RK4) in n equal steps.

        n = max(1, ceil(step / internal_step - STEP_SLACK)), h = step / n, and with f the derivatives:

            x := x + h / 6 (k1 + 2 k2 + 2 k3 + k4)
            k1 = f(t, x), k2 = f(t + h/2, x + h/2 k1), k3 = f(t + h/2, x + h/2 k2), k4 = f(t + h, x + h k3)
        """
        if not self._states:
            return
        largest = self._values[self._index[INTERNAL_STEP]]
        if step / largest > MAX_INTEGER:
            raise self._error(
                f"found a step of {step:g} s in internal steps of {largest:g} s,"
                f" allowed: {MAX_INTEGER} internal steps"
            )
        count = max(1, math.ceil(step / largest - STEP_SLACK))
        h = step / count
        for k in range(count):
            t = time + k * h
            x = [self._values[index] for index in self._states]
            k1 = self._derivatives(t, x)
            k2 = self._derivatives(t + 0.5 * h, [a + 0.5 * h * b for a, b in zip(x, k1, strict=True)])
            k3 = self._derivatives(t + 0.5 * h, [a + 0.5 * h * b for a, b in zip(x, k2, strict=True)])
            k4 = self._derivatives(t + h, [a + h * b for a, b in zip(x, k3, strict=True)])
            slopes = zip(x, k1, k2, k3, k4, strict=True)
            self._put(
                self._states,
                [a + h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4) for a, b1, b2, b3, b4 in slopes],
                "state",
            )

    def _derivatives(self, time: float, states: Sequence[Element]) -> list[Element]:
        """Return the derivatives at a time for other states and the present values of all else."""
        values = list(self._values)
        for index, state in zip(self._states, states, strict=True):
            values[index] = state
        arguments = [values[index] for index in self._arguments]
        return self._equations.derivatives(time, arguments, self._rows(time))

    def save(self) -> Any:
        """Return the state of the instance for `restore` (fmi2GetFMUstate)."""
        return self.time, self.running, list(self._values)

    def restore(self, saved: Any) -> None:
        """Return to the state at which `save` was called (fmi2SetFMUstate)."""
        self.time, self.running, values = saved
        self._values, self._stale = list(values), True

    def _rejection_reasons(self, reference: int, value: Element) -> list[str]:
        """Return why a scalar cannot be set, if so."""
        if not 0 <= reference < len(self._owner):
            return [self._reference_fault(reference)]
        variable, name = self._owner[reference], self.model.scalars[reference][0]
        if isinstance(variable, Output):
            return [f"{name}: set, allowed: an output is computed, not set"]
        if self.running and isinstance(variable, (State, Memory)):
            return [f"{name}: set while it runs, allowed: a state before the first step"]
        if self.running and isinstance(variable, Parameter) and not variable.tunable:
            return [f"{name}: set while it runs, allowed: a fixed parameter before the first step"]
        return [
            f"{name}: {reason}"
            for extreme in _extremes(variable, value)
            for reason in variable.rejection_reasons(extreme)
        ][:1]

    def _reference_fault(self, reference: int) -> str:
        return f"value reference {reference}: found, allowed: 0 to {len(self._owner) - 1}"

    def _rows(self, time: Element) -> Rows | None:
        return None if self.model.table is None else self.model.table.rows_at(time)

    def _read_arguments(self) -> list[Element]:
        return [self._values[index] for index in self._arguments]

    def _put(self, indices: Sequence[int], results: Sequence[Element], what: str) -> None:
        """Store results of the functions; `UnitError` if one is not finite."""
        values = [_to_double(result) for result in results]
        faults = [
            f"{what} {self.model.scalars[index][0]} is not finite at {self._first_not_finite(value):g} s"
            for index, value in zip(indices, values, strict=True)
            if not _is_finite(value)
        ]
        if faults:
            raise self._error(*faults)
        for index, value in zip(indices, values, strict=True):
            self._values[index] = value

    def _first_not_finite(self, value: Element) -> float:
        """Return the time of the first element that is not finite."""
        times, values = np.broadcast_arrays(self.time, value)
        return float(times[~np.isfinite(values)][0])

    def _error(self, *messages: str) -> UnitError:
        return UnitError(*(f"unit {self.model.name}: {message}" for message in messages))


def _to_double(value: Element) -> Element:
    """Return a value as C's double; of an array a copy, so that callers cannot change it."""
    is_array = isinstance(value, np.ndarray) and value.ndim > 0
    return np.array(value, dtype=np.float64) if is_array else np.float64(value)


def _is_finite(value: Element) -> bool:
    return math.isfinite(value) if isinstance(value, float) else bool(np.isfinite(value).all())


def _extremes(variable: Variable, value: Element) -> list[float]:
    """Return values of which one is rejected if any element is: of an array its bounds."""
    if not isinstance(value, np.ndarray):
        return [float(value)]
    values = np.ravel(np.float64(value))
    if variable.type != "Real":
        values = np.unique(values)
    elif values.size:
        values = np.array([values.min(), values.max()])
    return [float(extreme) for extreme in values]
