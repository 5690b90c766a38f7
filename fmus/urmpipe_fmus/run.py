"""A block model over a log: its outputs at each sample, all at once if it has no states and no memories."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from urmpipe_fmus.block import BlockModel, Variable
from urmpipe_fmus.instance import Instance, elements_to_dict
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.errors import UnitError


def run(
    model: BlockModel,
    t: FloatArray,
    inputs: Mapping[str, Any] | None = None,
    start: Mapping[str, Any] | None = None,
) -> dict[str, FloatArray]:
    """Run a block model over the samples of a log: the outputs at each sample for the inputs of that sample.

    A model without states and memories computes all samples at once, any other steps from sample to sample.

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
        UnitError: If times do not rise, a name is unknown, a shape does not fit, a value is rejected, or an
            output is not finite.
    """
    t = np.asarray(t, dtype=np.float64)
    if t.ndim != 1 or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any():
        allowed = "rising times, shape (n,)"
        raise UnitError(f"unit {model.name}: found times of shape {t.shape}, allowed: {allowed}")
    instance = Instance(model, t[0] if len(t) else 0.0)
    for name, value in (start or {}).items():
        variable = _find_variable(model, name)
        values = np.ravel(np.asarray(value, dtype=np.float64)).tolist()
        counts = sorted({1, variable.width})
        if len(values) not in counts:
            allowed = " or ".join(map(str, counts))
            raise UnitError(f"unit {model.name}: {name}: found {len(values)} values, allowed: {allowed}")
        references = [instance.reference(scalar) for scalar in variable.names]
        instance.set(references, values * (variable.width // len(values)))
    columns = _read_columns(model, inputs or {}, len(t))
    outputs = [variable for variable in model.variables if variable.causality == "output"]
    input_references = [instance.reference(name) for name in columns]
    output_references = [instance.reference(name) for variable in outputs for name in variable.names]
    elements: list[Element]
    if model.states or model.memories:
        rows = np.column_stack(list(columns.values())).tolist() if columns else [[]] * len(t)
        samples = np.empty((len(output_references), len(t)))
        for k, time in enumerate(t.tolist()):
            instance.set(input_references, rows[k])
            samples[:, k] = instance.get(output_references)
            if k + 1 < len(t):
                instance.do_step(time, float(t[k + 1]) - time)
        elements = list(samples)
    else:
        instance.time = t
        instance.set(input_references, list(columns.values()))
        elements = [np.broadcast_to(value, t.shape).copy() for value in instance.get(output_references)]
    return {
        name: np.column_stack(value) if isinstance(value, tuple) else np.asarray(value)
        for name, value in elements_to_dict(outputs, elements).items()
    }


def _find_variable(model: BlockModel, name: str) -> Variable:
    """Return a variable by name; `UnitError` if there is no such variable."""
    variables = {variable.name: variable for variable in model.variables}
    if name not in variables:
        raise UnitError(f"unit {model.name}: no variable {name}; allowed: {', '.join(variables)}")
    return variables[name]


def _read_columns(model: BlockModel, inputs: Mapping[str, Any], count: int) -> dict[str, FloatArray]:
    """Return the column, shape (n,), of every scalar of the inputs."""
    columns: dict[str, FloatArray] = {}
    for name, value in inputs.items():
        variable, values = _find_variable(model, name), np.asarray(value, dtype=np.float64)
        shape = (count,) if variable.size is None else (count, variable.size)
        if variable not in model.inputs or values.shape != shape:
            raise UnitError(
                f"unit {model.name}: {name}: found {variable.causality} with values of shape {values.shape},"
                f" allowed: an input, shape {shape}"
            )
        columns |= zip(variable.names, values.reshape(count, variable.width).T, strict=True)
    return columns
