"""Values of network files: vectors, numbers or expressions, and what drives a joint, all made SI."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

from urmpipe_models.elementwise import ZERO, Vector, dot, scale, subtract
from urmpipe_models.errors import format_value
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.parts import (
    AXES_TOLERANCE,
    Expression,
    frame_from_axes,
    is_control_name,
)
from urmpipe_models.robots.toml import Units
from urmpipe_models.toml_tables import CheckedTable, is_number, is_number_list

VectorCount: TypeAlias = Literal["one", "two", "one or two"]
"""Whether a key holds a vector, one for each body, or either."""

FORMS: dict[VectorCount, str] = {
    "one": "3 finite numbers",
    "two": "two lists of 3 finite numbers, one for each body",
    "one or two": "3 finite numbers, or two lists of 3",
}


DEFAULT_M: Vector = (1.0, 0.0, 0.0)
DEFAULT_N: Vector = (0.0, 1.0, 0.0)
"""m and n of a body in a joint where its table has none."""

ALONG_X = 1.0 - 1e-6  # |n . x| of an n that lies along x: within 1.4e-3 rad its projection loses digits

IDENTITY_MOTION = tuple(map(Expression, ("1.0", "0.0", "0.0", "0.0", "1.0", "0.0", "0.0", "0.0", "0.0")))
"""The motion of a user joint that stands in for one whose kind is none."""


def read_vectors(
    table: CheckedTable, key: str, form: VectorCount = "one or two", default: Vector | None = None
) -> tuple[Vector, Vector]:
    """Return the vectors of both bodies in the file's unit, twice the same where the key holds one.

    Args:
        table: The table of a joint or an element.
        key: Its key.
        form: How many there may be.
        default: That of both where the key is missing; without it the key is required.
    """
    value = table.value(key)
    if value is None and default is not None:
        return default, default
    if form != "two" and is_number_list(value, 3):
        return _vector(value), _vector(value)
    pair = (
        isinstance(value, (list, tuple)) and len(value) == 2 and all(is_number_list(one, 3) for one in value)
    )
    if form != "one" and pair:
        return _vector(value[0]), _vector(value[1])
    _refuse(table, key, value, FORMS[form])
    return default or ZERO, default or ZERO


def read_points(table: CheckedTable, units: Units, form: VectorCount = "one or two") -> tuple[Vector, Vector]:
    """Return the points `a` of both bodies in [m], their origins where the key is missing."""
    first, second = read_vectors(table, "a", form, ZERO)
    return _metres(first, units), _metres(second, units)


def read_frames(table: CheckedTable, units: Units) -> tuple[Transform, Transform]:
    """Return A_1 and A_2 of a joint; not turned where its m or n are no vectors."""
    many = len(table.faults)
    m, n = read_vectors(table, "m", default=DEFAULT_M), read_vectors(table, "n", default=DEFAULT_N)
    if len(table.faults) > many:
        m, n = (DEFAULT_M, DEFAULT_M), (DEFAULT_N, DEFAULT_N)
    elif not table.has("m"):
        m = perpendicular(n[0]), perpendicular(n[1])
    first, second = read_points(table, units)
    return frame_from_axes(m[0], n[0], first), frame_from_axes(m[1], n[1], second)


def perpendicular(n: Vector) -> Vector:
    """Return m of a joint without one: the unit vector of x without its part along n; of y if n is along x.

    Args:
        n: The axis of the joint, a unit vector [-].
    """
    if not abs(n[0]) > AXES_TOLERANCE:
        return DEFAULT_M
    axis = DEFAULT_M if abs(n[0]) < ALONG_X else DEFAULT_N
    across = subtract(axis, scale(dot(axis, n), n))
    return scale(1.0 / max(math.sqrt(dot(across, across)), 1e-300), across)


def read_start(table: CheckedTable, of: Sequence[str], units: Units) -> tuple[float, ...]:
    """Return the `start` of a joint in [rad] and [m]: a number of a joint with one variable, else a list.

    Args:
        table: The table of the joint.
        of: The unit of each variable, rad or m.
        units: The units of the file.
    """
    value = table.value("start")
    if value is None:
        return ()
    values = [value] if len(of) == 1 and is_number(value) else value
    if not is_number_list(values, len(of)):
        _refuse(table, "start", value, "a finite number" if len(of) == 1 else f"{len(of)} finite numbers")
        return ()
    return tuple(to_si(float(one), unit, units) for one, unit in zip(values, of, strict=True))


def read_limits(table: CheckedTable, of: Sequence[str], units: Units) -> tuple[tuple[float, float], ...]:
    """Return `lower` and `upper` of each variable of a joint in [rad] and [m]; empty where it has neither.

    Args:
        table: The table of the joint.
        of: The unit of each variable, rad or m.
        units: The units of the file.
    """
    ends = []
    for key, default in (("lower", -math.inf), ("upper", math.inf)):
        value = table.value(key)
        values = [value] if len(of) == 1 and is_number(value, infinite=True) else value
        if value is not None and not is_number_list(values, len(of), infinite=True):
            _refuse(table, key, value, "a number" if len(of) == 1 else f"{len(of)} numbers")
        is_right = is_number_list(values, len(of), infinite=True)
        numbers = values if is_right else [default] * len(of)
        ends.append([to_si(float(one), unit, units) for one, unit in zip(numbers, of, strict=True)])
    limits = tuple(zip(*ends, strict=True))
    return limits if any(map(math.isfinite, (*ends[0], *ends[1]))) else ()


def read_drives(table: CheckedTable, of: Sequence[str], units: Units) -> tuple[Expression | None, ...]:
    """Return what drives each variable of a joint, by `driven` or `value`; none where it has neither.

    Args:
        table: The table of the joint.
        of: The unit of each variable, rad or m.
        units: The units of the file.
    """
    controls, functions = table.value("driven"), table.value("value")
    key, value = ("value", functions) if controls is None else ("driven", controls)
    if controls is not None and functions is not None:
        table.add_error("value", "found beside driven; allowed: one of the two")
    if value is None:
        return ()
    values = [value] if len(of) == 1 and not isinstance(value, (list, tuple)) else value
    if value == "" or not isinstance(values, (list, tuple)) or len(values) != len(of):
        many = f'a list of {len(of)}, one per variable, "" where it is free'
        _refuse(table, key, value, "one, of its only variable" if len(of) == 1 else many)
        return ()
    return tuple(_drive(table, key, one, unit, units) for one, unit in zip(values, of, strict=True))


def _drive(table: CheckedTable, key: str, value: Any, unit: str, units: Units) -> Expression | None:
    """Return what drives a variable; None where that is "", or no name of a control under `driven`."""
    if value == "":
        return None
    if key == "value" or (isinstance(value, str) and is_control_name(value)):
        return parse_expression(table, key, value, unit, units)
    _refuse(table, key, value, "the name of a control; a function of controls is a `value`")
    return None


def read_motion(table: CheckedTable, units: Units) -> tuple[Expression, ...]:
    """Return m, n [-] and a in [m] of a user joint, each three numbers or functions of controls."""
    many = len(table.faults)
    turned = [*_three(table, "m", "", units), *_three(table, "n", "", units)]
    if len(table.faults) > many:  # which might not be orthonormal
        turned = [*IDENTITY_MOTION[:6]]
    return (*turned, *_three(table, "a", "m", units))


def _three(table: CheckedTable, key: str, unit: str, units: Units) -> list[Expression]:
    """Return three numbers or functions of controls in SI."""
    value = table.value(key)
    if isinstance(value, (list, tuple)) and len(value) == 3:
        return [parse_expression(table, key, one, unit, units) for one in value]
    _refuse(table, key, value, "a list of 3 numbers or expressions")
    return [*IDENTITY_MOTION[6:]]


def read_expression(table: CheckedTable, key: str, unit: str, units: Units) -> Expression:
    """Return the number or function of controls under a key in SI; the key is required.

    Args:
        table: The table.
        key: The key.
        unit: The unit of the value: m, rad or "" of a number without.
        units: The units of the file.
    """
    return parse_expression(table, key, table.value(key), unit, units)


def parse_expression(table: CheckedTable, key: str, value: Any, unit: str, units: Units) -> Expression:
    """Return a number or text of a file as a function of controls in SI; 1 where it is no arithmetic."""
    if is_number(value):
        return Expression(repr(to_si(float(value), unit, units)))
    if not isinstance(value, str):
        _refuse(table, key, value, "a finite number, or an expression as a text")
        return Expression("1.0")
    try:
        Expression(value)  # alone: in brackets `1) + (2` would be arithmetic
        factor = _factor(unit, units)
        return Expression(f"({value}) * {factor}" if factor else value)
    except ValueError as error:
        table.add_error(key, str(error))
        return Expression("1.0")


def to_si(value: float, unit: str, units: Units) -> float:
    """Return a number of the file in [m] or [rad]; without a unit as it is."""
    return {"m": units.length, "rad": units.angle}.get(unit, float)(value)


def _factor(unit: str, units: Units) -> str:
    """Return what makes an expression of the file one in SI; nothing where it is."""
    if unit == "m" and units.millimetres:
        return "0.001"
    return "pi / 180" if unit == "rad" and units.degrees else ""


def _metres(point: Vector, units: Units) -> Vector:
    return units.length(point[0]), units.length(point[1]), units.length(point[2])


def _vector(value: Sequence[float]) -> Vector:
    return float(value[0]), float(value[1]), float(value[2])


def _refuse(table: CheckedTable, key: str, value: Any, allowed: str) -> None:
    """Note that the value of a key is not allowed."""
    found = "nothing" if value is None else format_value(value)
    table.add_error(key, f"found {found}, allowed: {allowed}")
