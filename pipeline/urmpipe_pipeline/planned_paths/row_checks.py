"""What no rows of a path may be: rows given as arrays that are none, and rows that make no curve."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, OptionError, PathError
from urmpipe_models.ik.solutions import Targets, validate_targets
from urmpipe_models.planning.from_rows import validate_ends, validate_rows
from urmpipe_models.planning.path import VARIANTS, PathRows
from urmpipe_pipeline.logs.formats.log_table import capped

FARTHEST = 1e9
"""The largest coordinate of a row in [m]."""

FEWEST = 2
"""Rows of a path: where it starts and where it ends."""

ROW: Mapping[str, tuple[int, ...]] = {"position": (3,), "radius": (), "variant": (), "rotation": (3, 3)}
"""Shapes of one row of each array."""


def are_radii(values: FloatArray) -> BoolArray:
    """Return which values are radii in [m], shape (n,): finite, 0 or more."""
    return np.asarray((values >= 0.0) & (values < np.inf))


def are_variants(values: FloatArray | IntArray) -> BoolArray:
    """Return which values are variants of an arc [-], shape (n,)."""
    return np.isin(values, VARIANTS)


def curve_faults(rows: PathRows) -> tuple[Finding, ...]:
    """Return why rows make no curve: too few, too far away, a radius that fits nowhere.

    Rows of which some places are unknown (NaN) are checked as far as possible.
    """
    if len(rows) < FEWEST:
        few = Finding(found=format_count(len(rows), "row"), allowed=f"{FEWEST} or more")
        return (few, *validate_ends(rows))
    if far := [*_far_away(rows)]:
        return (*far, *validate_ends(rows))
    return tuple(validate_rows(rows) if np.isfinite(rows.position).all() else validate_ends(rows))


def _far_away(rows: PathRows) -> Iterator[Finding]:
    """Yield which rows are so far away that their squares leave no digits of the path."""
    for row in np.flatnonzero((np.abs(rows.position) > FARTHEST).any(axis=1)).tolist():
        found = f"a coordinate of {np.nanmax(np.abs(rows.position[row])):g} m"
        yield Finding(row=row + 1, found=found, allowed=f"up to {FARTHEST:g} m")


def checked_rows(rows: PathRows) -> PathRows:
    """Return rows with the rotations that are nearest to theirs.

    Raises:
        OptionError: With all that is wrong with the arrays.
        PathError: With all that is wrong with the curve that they would make.
    """
    faults = [*_shape_faults(rows)]
    rotation = rows.rotation
    if not faults:
        rotation, reasons = _checked_poses(rows.position, rotation)
        faults += reasons
        faults += _unfit(rows.radius, "radius", " m", are_radii(rows.radius), "finite, 0 or more")
        faults += _unfit(rows.variant, "variant", "", are_variants(rows.variant), "1 or 2")
    if faults:
        raise OptionError(*capped([replace(fault, parameter="path") for fault in faults], ""))
    made = replace(rows, rotation=rotation)
    if of_curve := curve_faults(made):
        raise PathError(*capped([replace(fault, file="path") for fault in of_curve], "path"))
    return made


def _shape_faults(rows: PathRows) -> Iterator[Finding]:
    """Yield which arrays are none, have another shape, or not a row for each of the others."""
    arrays = {"position": rows.position, "radius": rows.radius, "variant": rows.variant}
    if rows.rotation is not None:
        arrays["rotation"] = rows.rotation
    wrong = {name: array for name, array in arrays.items() if array.ndim == 0 or array.shape[1:] != ROW[name]}
    for name, array in wrong.items():
        found = f"of shape {array.shape}" if array.ndim else "that is not an array of numbers"
        shape = ", ".join(("n", *map(str, ROW[name]))) + "," * (not ROW[name])
        yield Finding(found=f"{name} {found}", allowed=f"numbers of shape ({shape})")
    if not wrong and len({len(array) for array in arrays.values()}) > 1:
        lengths = ", ".join(f"{len(array)} of {name}" for name, array in arrays.items())
        yield Finding(found=lengths, allowed="as many rows of each")


def _checked_poses(
    position: FloatArray, rotation: FloatArray | None
) -> tuple[FloatArray | None, list[Finding]]:
    """Return the nearest rotations, shape (n, 3, 3) [-], and which rows are no pose: positions in [m]."""
    of_each = [validate_targets(Targets(position))[1]]
    if rotation is not None:
        targets, reasons = validate_targets(Targets(np.zeros_like(position), rotation))
        rotation = targets.rotation
        of_each.append(reasons)
    return rotation, [
        Finding(reason, row=row)
        for reasons in of_each
        for row, reason in enumerate(reasons, start=1)
        if reason
    ]


def _unfit(
    values: FloatArray | IntArray, column: str, unit: str, fits: BoolArray, allowed: str
) -> Iterator[Finding]:
    """Yield the values, shape (n,), that do not fit."""
    for row in np.flatnonzero(~fits).tolist():
        yield Finding(row=row + 1, column=column, found=f"{values[row]:g}{unit}", allowed=allowed)
