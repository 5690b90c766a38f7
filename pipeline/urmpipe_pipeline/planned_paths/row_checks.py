"""What no rows of a path may be: rows given as arrays that are none, and rows that make no curve."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray
from urmpipe_models.errors import Finding, OptionError, PathError
from urmpipe_models.inverse.checks import checked
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.planning.from_rows import end_faults, path_of
from urmpipe_models.planning.rows import PathRows
from urmpipe_pipeline.sources.tables.numbers import capped
from urmpipe_pipeline.text import counted

FEWEST = 2
"""Rows of a path: where it starts and where it ends."""

VARIANTS = (1, 2)


def curve_faults(rows: PathRows) -> tuple[Finding, ...]:
    """Return why rows make no curve: too few, a radius that fits nowhere; what is known of unknown places."""
    if len(rows) < FEWEST:
        few = Finding(found=counted(len(rows), "row"), allowed=f"{FEWEST} or more")
        return (few, *end_faults(rows))
    if not np.isfinite(rows.position).all():
        return tuple(end_faults(rows))
    try:
        path_of(rows)
    except PathError as error:
        return error.findings
    return ()


def checked_rows(rows: PathRows) -> PathRows:
    """Return rows as arrays of numbers, with the rotations that are nearest to theirs.

    Raises:
        OptionError: With all that is wrong with the arrays.
        PathError: With all that is wrong with the curve that they would make.
    """
    faults: list[Finding] = []
    position = _array("position", rows.position, (3,), faults)
    radius = _array("radius", rows.radius, (), faults)
    variant = _array("variant", rows.variant, (), faults)
    rotation = None if rows.rotation is None else _array("rotation", rows.rotation, (3, 3), faults)
    arrays = {"position": position, "radius": radius, "variant": variant, "rotation": rotation}
    lengths = {name: len(array) for name, array in arrays.items() if array is not None}
    if not faults and len(set(lengths.values())) > 1:
        found = ", ".join(f"{length} of {name}" for name, length in lengths.items())
        faults.append(Finding(found=found, allowed="as many rows of each"))
    if not faults:
        rotation, reasons = _checked_poses(position, rotation)
        faults += reasons
        faults += _unfit(radius, "radius", " m", (radius >= 0.0) & (radius < np.inf), "finite, 0 or more")
        faults += _unfit(variant, "variant", "", np.isin(variant, VARIANTS), "1 or 2")
    made = PathRows(position, radius, rows.corner, variant.astype(np.int64), rotation)
    if faults:
        raise OptionError(*capped([replace(fault, parameter="path") for fault in faults], ""))
    if of_curve := curve_faults(made):
        raise PathError(*capped([replace(fault, file="path") for fault in of_curve], "path"))
    return made


def _array(name: str, values: Any, behind: tuple[int, ...], faults: list[Finding]) -> FloatArray:
    """Return values as an array of rows; none, and a fault added, if they are no numbers of that shape."""
    allowed = f"numbers of shape ({', '.join(map(str, ('n', *behind)))}{',' * (not behind)})"
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        faults.append(Finding(found=f"{name} that is no array of numbers", allowed=allowed))
        return np.empty((0, *behind))
    if array.ndim == 0 or array.shape[1:] != behind:
        faults.append(Finding(found=f"{name} of shape {array.shape}", allowed=allowed))
        return np.empty((0, *behind))
    return array


def _checked_poses(
    position: FloatArray, rotation: FloatArray | None
) -> tuple[FloatArray | None, list[Finding]]:
    """Return the nearest rotations, shape (n, 3, 3) [-], and which rows are no pose: positions in [m]."""
    said = [checked(Targets(position))[1]]
    if rotation is not None:
        targets, reasons = checked(Targets(np.zeros_like(position), rotation))
        rotation = targets.rotation
        said.append(reasons)
    return rotation, [
        Finding(reason, row=row) for reasons in said for row, reason in enumerate(reasons, start=1) if reason
    ]


def _unfit(values: FloatArray, column: str, unit: str, fits: BoolArray, allowed: str) -> Iterator[Finding]:
    """Yield the values, shape (n,), that do not fit."""
    for row in np.flatnonzero(~fits).tolist():
        yield Finding(row=row + 1, column=column, found=f"{values[row]:g}{unit}", allowed=allowed)
