"""What to give so that columns have another unit."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.errors import Hint
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.sources.columns.columns import Column

OTHER_UNIT = {"rad": "deg", "deg": "rad", "m": "mm", "mm": "m", "cm": "m"}
"""The unit that a wrong one would most likely be."""


def unit_hints(columns: Sequence[Column], unit: str, does: str = "overrides this") -> tuple[Hint, ...]:
    """Return the hint that gives all of some columns a unit."""
    return (Hint("unit", {column.called: unit for column in columns}, does),)


def which_unit(columns: Sequence[Column], unit: str, *, every: bool) -> tuple[Hint, ...]:
    """Return the hints that give some columns the other unit or confirm theirs, as every angle's or each."""
    given = [
        {"": one} if every else {column.called: one for column in columns} for one in (OTHER_UNIT[unit], unit)
    ]
    return tuple(Hint("unit", one, "specifies it") for one in given)


def unit_inference(columns: Sequence[Column], unit: str, evidence: str, *, every: bool) -> Inference:
    """Return what is said of the unit of some columns, and why; with the other unit that it may be.

    What is given for every angle reaches some columns, and others are given one by one, as the first is.
    """
    names, other = tuple(column.name for column in columns), OTHER_UNIT.get(unit)
    every = every and len(columns) > 1 and unit in ("rad", "deg")
    hints = (Hint("unit", {"" if every else columns[0].called: other}),) if other else ()
    return Inference(f"unit of {', '.join(names)}", unit, evidence, "unit", names, hints)
