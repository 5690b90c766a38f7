"""A unit over a log: all samples at once where it remembers nothing, else sample by sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from urmpipe_fmus.equations import named
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.unit import Unit
from urmpipe_fmus.variable import Variable
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.errors import UnitError


def run(
    unit: Unit,
    t: FloatArray,
    inputs: Mapping[str, Any] | None = None,
    start: Mapping[str, Any] | None = None,
) -> dict[str, FloatArray]:
    """Run a unit over the samples of a log: the outputs at each sample for the inputs of that sample.

    Args:
        unit: The unit.
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
            f"unit {unit.name}: found times of shape {t.shape}, allowed: rising times, shape (n,)"
        )
    instance = Instance(unit, t[0] if len(t) else 0.0)
    for name, value in (start or {}).items():
        owner = _variable(unit, name)
        instance.set([instance.reference(scalar) for scalar in owner.names], _starts(unit, owner, value))
    columns = _columns(unit, inputs or {}, len(t))
    shown = [one for one in unit.variables if one.causality == "output"]
    over = _stepped if unit.states or unit.memories else _at_once
    found = over(instance, t, columns, [name for one in shown for name in one.names])
    return {
        name: np.column_stack(value) if isinstance(value, tuple) else np.asarray(value)
        for name, value in named(shown, found).items()
    }


def _variable(unit: Unit, name: str) -> Variable:
    """Return a variable of a unit by name."""
    allowed = [one.name for one in unit.variables]
    if name not in allowed:
        raise UnitError(f"unit {unit.name}: no variable {name}; allowed: {', '.join(allowed)}")
    return unit.variables[allowed.index(name)]


def _starts(unit: Unit, owner: Variable, value: Any) -> list[float]:
    """Return the start value of every scalar of a variable: one for all of them, or one each."""
    values: list[float] = np.ravel(np.asarray(value, dtype=np.float64)).tolist()
    counts = sorted({1, owner.width})
    if len(values) not in counts:
        allowed = " or ".join(map(str, counts))
        raise UnitError(f"unit {unit.name}: {owner.name}: found {len(values)} values, allowed: {allowed}")
    return values * (owner.width // len(values))


def _columns(unit: Unit, inputs: Mapping[str, Any], count: int) -> dict[str, FloatArray]:
    """Return the column of every scalar that is given over the log."""
    columns: dict[str, FloatArray] = {}
    for name, value in inputs.items():
        owner, found = _variable(unit, name), np.asarray(value, dtype=np.float64)
        shape = (count,) if owner.size is None else (count, owner.size)
        if owner not in unit.inputs or found.shape != shape:
            raise UnitError(
                f"unit {unit.name}: {name}: found {owner.causality} with values of shape {found.shape},"
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
