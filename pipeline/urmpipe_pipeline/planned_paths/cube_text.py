"""A test cube in a text: cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1,plane=xz."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError, format_unknown_name
from urmpipe_models.math3d import to_matrices, to_quaternions
from urmpipe_models.measure_units import WRITTEN, quantity_to_si
from urmpipe_models.planning.path import PLANES, PathRows, cube_rows, validate_cube
from urmpipe_pipeline.planned_paths.row_checks import FARTHEST

CUBE = "cube:"
"""How the text begins."""

LENGTH_KEYS = ("a", "r", "x", "y", "z")
ANGLE_KEYS = ("rz", "ry", "rx")
PLANE = "plane"
KEYS = (*LENGTH_KEYS, PLANE, *ANGLE_KEYS)


def read_cube(text: str) -> tuple[str, PathRows]:
    """Return the name and the rows of the contour that a text describes.

    The kind, wall or diagonal, is followed by the edge a, the radius r and the centre x, y, z, in m or with a
    unit (a=600mm). plane= names another section than the first. rz, ry, rx, in rad or with a unit, hold the
    tool at R = Rz Ry Rx.

    Raises:
        OptionError: With everything that is wrong with it.
    """
    kind, *parts = (part.strip() for part in text.removeprefix(CUBE).split(","))
    faults: list[Finding] = []
    given = dict(_pairs(parts, faults))
    values = dict(_values(given, faults))
    plane = given.get(PLANE)
    faults += _missing(given)
    faults += validate_cube(kind, plane, values.get("a", math.nan), values.get("r", math.nan))
    if faults:
        raise OptionError(*(replace(fault, parameter="path") for fault in faults))
    a, r, *centre = (values[key] for key in LENGTH_KEYS)
    section = plane or next(iter(PLANES[kind]))
    return f"cube {kind} {section}", cube_rows(kind, a, r, np.array(centre), section, _rotation(values))


def _pairs(parts: list[str], faults: list[Finding]) -> Iterator[tuple[str, str]]:
    """Yield keys with their texts, having added the others to the faults."""
    seen = set()
    for part in parts:
        key, sign, text = (one.strip() for one in part.partition("="))
        if not sign:
            faults.append(Finding(found=repr(part), allowed="KEY=VALUE with a decimal point, such as a=0.6"))
        elif key not in KEYS:
            faults.append(Finding(f"key: {format_unknown_name(key, KEYS)}"))
        elif key in seen:
            faults.append(Finding(found=f"{key} twice", allowed="each key once"))
        else:
            yield key, text
        seen.add(key)


def _values(given: Mapping[str, str], faults: list[Finding]) -> Iterator[tuple[str, float]]:
    """Yield lengths in [m] and angles in [rad], having added the other values to the faults."""
    for key, text in given.items():
        if key == PLANE:
            continue
        value = quantity_to_si(text, WRITTEN["rad" if key in ANGLE_KEYS else "m"])
        if key in LENGTH_KEYS and FARTHEST < abs(value) < math.inf:
            faults.append(Finding(found=f"{key}={text}", allowed=f"up to {FARTHEST:g} m"))
        elif math.isfinite(value):
            yield key, value
        else:
            allowed = (
                "an angle in rad, such as 1.57 or 90deg"
                if key in ANGLE_KEYS
                else "a length in m, such as 0.6 or 600mm"
            )
            faults.append(Finding(found=f"{key}={text}", allowed=allowed))


def _missing(given: Mapping[str, str]) -> Iterator[Finding]:
    """Yield which keys are missing."""
    missing = [key for key in LENGTH_KEYS if key not in given]
    if missing:
        yield Finding(found=f"no {', '.join(missing)}", allowed=f"all of {', '.join(LENGTH_KEYS)}")
    angles = [key for key in ANGLE_KEYS if key in given]
    if 0 < len(angles) < len(ANGLE_KEYS):
        yield Finding(found=f"{', '.join(angles)} alone", allowed="all of rz, ry, rx, or none")


def _rotation(values: Mapping[str, float]) -> FloatArray | None:
    """Return how the tool is held, a matrix of shape (3, 3) [-]; None if that is left open."""
    if ANGLE_KEYS[0] not in values:
        return None
    turns = np.array([[values[key] for key in ANGLE_KEYS]])
    return np.asarray(to_matrices(to_quaternions(turns, "zyx"))[0])
