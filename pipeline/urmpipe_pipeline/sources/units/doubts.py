"""Units that a name or a source tells, held against the values: contradicted, or no more than likely."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.joint_log import LogWarning, Role
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.units.unit_evidence import (
    ONE_TURN,
    TWO_TURNS,
    Bounds,
    degrees_proof,
    peak,
    radians_proof,
    too_fast,
    usual_peak,
)
from urmpipe_pipeline.sources.units.unit_hints import unit_hints


def contradiction(
    unit: str, values: FloatArray, t_ns: IntArray | None, bounds: Bounds
) -> tuple[str, list[int]] | None:
    """Return why joint values are hardly in a unit, and which columns that is about; None if they may be.

    It is about all columns but those that can only be in that unit. A speed alone excludes no values of less
    than two turns: there it is the clock that may be wrong.

    Args:
        unit: rad or deg.
        values: In the file's own units, shape (n, columns).
        t_ns: Times in [ns], shape (n,), or None.
        bounds: What the joints can do.
    """
    if unit == "rad":
        far = usual_peak(values) > TWO_TURNS
        if why := degrees_proof(values, bounds) or (far and too_fast(values, t_ns, bounds)):
            return why, [j for j, one in enumerate(values.T) if not radians_proof(one[:, np.newaxis])]
    elif why := radians_proof(values):
        return why, [j for j, one in enumerate(values.T) if peak(one) <= TWO_TURNS]
    return None


def doubt(unit: str, values: FloatArray, t_ns: IntArray | None, bounds: Bounds) -> str | None:
    """Return why joint values may well be in the other unit than rad or deg; None if nothing says so.

    Small ones may be in rad, large ones in deg, unless wraps, speeds or the robot's limits tell.

    Args:
        unit: rad or deg.
        values: In the file's own units, shape (n, columns).
        t_ns: Times in [ns], shape (n,), or None.
        bounds: What the joints can do.
    """
    size = usual_peak(values)
    if unit == "rad":
        if size <= ONE_TURN or bounds.keeps(values) or radians_proof(values):
            return None
        return f"values of {size:.6g} are more than a turn as rad"
    if size > TWO_TURNS or not peak(values) > 0:
        return None
    if degrees_proof(values, bounds) or too_fast(values, t_ns, bounds) or bounds.excludes(values):
        return None
    return f"values of no more than {peak(values):.6g} may be rad as well"


def assumed(columns: Sequence[Column], unit: str, whole: str) -> str:
    """Return what a verdict assumes: "the joints are in deg", or of some columns "q1, q2 are in deg"."""
    names = ", ".join(column.name for column in columns)
    return f"{whole} in {unit}" if whole else f"{names} {'are' if len(columns) > 1 else 'is'} in {unit}"


def not_reached(
    columns: Sequence[Column], given: str, unit: str, *, named: bool, role: Role, whole: str
) -> LogWarning:
    """Return what is said of angles that what is given for every angle does not reach.

    Args:
        columns: The columns.
        given: What the user gave.
        unit: What they are taken as.
        named: Whether that is by their names; else by the kinematics.
        role: What they hold.
        whole: What they are together, "the joints are" or "the orientation is"; empty for some of them.
    """
    names = ", ".join(column.name for column in columns)
    why = f"their names say {unit}" if named else f"the kinematics give {unit}"
    said, hints = f"{names}: {given} does not reach them: {why}", unit_hints(columns, given, "does")
    assumption = assumed(columns, unit, whole) if named else ""
    return LogWarning("unit-not-reached", said, hints=hints, assumption=assumption, role=role)
