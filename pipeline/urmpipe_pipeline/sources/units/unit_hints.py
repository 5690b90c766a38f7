"""What to give so that columns have another unit."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.messages import Hint
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.sources.columns.columns import Column

OTHER_UNIT = {"rad": "deg", "deg": "rad", "m": "mm", "mm": "m", "cm": "m"}
"""The unit that a wrong one would most likely be."""


def unit_hints(columns: Sequence[Column], unit: str, does: str = "reads them otherwise") -> tuple[Hint, ...]:
    """Return the hint that gives all of some columns a unit."""
    return (Hint("unit", {column.called: unit for column in columns}, does),)


def unit_inference(columns: Sequence[Column], unit: str, evidence: str) -> Inference:
    """Return what is said of the unit of some columns, and why; with the other unit that it may be."""
    names, other = tuple(column.name for column in columns), OTHER_UNIT.get(unit)
    turning = len(columns) > 1 and unit in ("rad", "deg")
    hints = (Hint("unit", {"" if turning else columns[0].called: other}),) if other else ()
    return Inference(f"unit of {', '.join(names)}", unit, evidence, "unit", names, hints)
