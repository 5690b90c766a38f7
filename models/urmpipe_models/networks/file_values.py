"""Values of network files: vectors, numbers and expressions of joints and elements, in SI.

Errors go to the table that is read, and a valid value replaces the faulty one, so that reading continues.
`units` are those of the file, `unit` the one of a value: m, rad, or "" of a number without; `variables` are
the units of the variables of a joint, rad or m.

1. `read_vectors`, `read_points`, `read_frames`: m, n and a of both bodies.
2. `read_start`, `read_limits`, `read_drives`: numbers and functions of each variable of a joint.
3. `read_motion`, `read_expression`, `parse_expression`: functions of controls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

from urmpipe_models.elementwise import ZERO, Vector, dot, scale, subtract
from urmpipe_models.errors import format_value
from urmpipe_models.math3d import Transform
from urmpipe_models.networks.parts import AXES_TOLERANCE, Expression, frame_from_axes, is_control_name
from urmpipe_models.robots.toml import Units
from urmpipe_models.toml_tables import CheckedTable, is_number, is_number_list

VectorCount: TypeAlias = Literal["one", "two", "one or two"]  # under a key: for both bodies, or one for each
_VECTORS: dict[VectorCount, str] = {
    "one": "3 finite numbers",
    "two": "two lists of 3 finite numbers, one for each body",
    "one or two": "3 finite numbers, or two lists of 3",
}

DEFAULT_M: Vector = (1.0, 0.0, 0.0)
DEFAULT_N: Vector = (0.0, 1.0, 0.0)
MAX_ALONG_X = 1.0 - 1e-6  # |n . x|: within 1.4e-3 rad of x its projection loses digits

# m, n and a of a user joint that replaces one of unknown kind
IDENTITY_MOTION = tuple(map(Expression, ("1.0", "0.0", "0.0", "0.0", "1.0", "0.0", "0.0", "0.0", "0.0")))


def read_vectors(
    table: CheckedTable, key: str, count: VectorCount = "one or two", default: Vector | None = None
) -> tuple[Vector, Vector]:
    """Return the vectors of both bodies in the file's unit, twice the same if the key has one.

    The default is that of both if the key is missing; without it the key is required.
    """
    value = table.value(key)
    if value is None and default is not None:
        return default, default
    if count != "two" and is_number_list(value, 3):
        return _vector(value), _vector(value)
    is_pair = isinstance(value, (list, tuple)) and len(value) == 2
    if count != "one" and is_pair and all(is_number_list(vector, 3) for vector in value):
        return _vector(value[0]), _vector(value[1])
    _add_fault(table, key, value, _VECTORS[count])
    return default or ZERO, default or ZERO


def read_points(
    table: CheckedTable, units: Units, count: VectorCount = "one or two"
) -> tuple[Vector, Vector]:
    """Return the points `a` of both bodies in [m], their origins if the key is missing."""
    first, second = read_vectors(table, "a", count, ZERO)
    return _metres(first, units), _metres(second, units)


def read_frames(table: CheckedTable, units: Units) -> tuple[Transform, Transform]:
    """Return A_1 and A_2 of a joint; not rotated if its m or n are no vectors."""
    faults = len(table.faults)
    m, n = read_vectors(table, "m", default=DEFAULT_M), read_vectors(table, "n", default=DEFAULT_N)
    if len(table.faults) > faults:
        m, n = (DEFAULT_M, DEFAULT_M), (DEFAULT_N, DEFAULT_N)
    elif not table.has("m"):
        m = _perpendicular(n[0]), _perpendicular(n[1])
    first, second = read_points(table, units)
    return frame_from_axes(m[0], n[0], first), frame_from_axes(m[1], n[1], second)


def _perpendicular(n: Vector) -> Vector:
    """Return the default of m: the unit vector of x without its part along n; of y if n is along x."""
    if not abs(n[0]) > AXES_TOLERANCE:
        return DEFAULT_M
    axis = DEFAULT_M if abs(n[0]) < MAX_ALONG_X else DEFAULT_N
    projection = subtract(axis, scale(dot(axis, n), n))
    return scale(1.0 / max(math.sqrt(dot(projection, projection)), 1e-300), projection)


def read_start(table: CheckedTable, variables: Sequence[str], units: Units) -> tuple[float, ...]:
    """Return the `start` of a joint in [rad] and [m]: a number of a joint with one variable, else a list."""
    value = table.value("start")
    if value is None:
        return ()
    values = [value] if len(variables) == 1 and is_number(value) else value
    if not is_number_list(values, len(variables)):
        allowed = "a finite number" if len(variables) == 1 else f"{len(variables)} finite numbers"
        _add_fault(table, "start", value, allowed)
        return ()
    return tuple(to_si(float(start), unit, units) for start, unit in zip(values, variables, strict=True))


def read_limits(
    table: CheckedTable, variables: Sequence[str], units: Units
) -> tuple[tuple[float, float], ...]:
    """Return `lower` and `upper` of each variable of a joint in [rad] and [m]; empty if it has neither."""
    count, ends = len(variables), []
    for key, default in (("lower", -math.inf), ("upper", math.inf)):
        value = table.value(key)
        values = [value] if count == 1 and is_number(value, infinite=True) else value
        if not is_number_list(values, count, infinite=True):
            if value is not None:
                _add_fault(table, key, value, "a number" if count == 1 else f"{count} numbers")
            values = [default] * count
        ends.append([to_si(float(end), unit, units) for end, unit in zip(values, variables, strict=True)])
    limits = tuple(zip(*ends, strict=True))
    return limits if any(map(math.isfinite, (*ends[0], *ends[1]))) else ()


def read_drives(table: CheckedTable, variables: Sequence[str], units: Units) -> tuple[Expression | None, ...]:
    """Return the functions that drive the variables of a joint, by `driven` or `value`, if it has one."""
    controls, functions = table.value("driven"), table.value("value")
    key, value = ("value", functions) if controls is None else ("driven", controls)
    if controls is not None and functions is not None:
        table.add_error("value", "found beside driven; allowed: one of the two")  # plain: ok
    if value is None:
        return ()
    count = len(variables)
    values = [value] if count == 1 and not isinstance(value, (list, tuple)) else value
    if value == "" or not isinstance(values, (list, tuple)) or len(values) != count:
        several = f'a list of {count}, one per variable, "" where it is free'
        _add_fault(table, key, value, "one, of its only variable" if count == 1 else several)
        return ()
    return tuple(
        _read_drive(table, key, drive, unit, units) for drive, unit in zip(values, variables, strict=True)
    )


def _read_drive(table: CheckedTable, key: str, value: Any, unit: str, units: Units) -> Expression | None:
    """Return the function of a variable; None of "", and of `driven` without the name of a control."""
    if value == "":
        return None
    if key == "value" or (isinstance(value, str) and is_control_name(value)):
        return parse_expression(table, key, value, unit, units)
    _add_fault(table, key, value, "the name of a control; a function of controls is a `value`")
    return None


def read_motion(table: CheckedTable, units: Units) -> tuple[Expression, ...]:
    """Return m, n [-] and a in [m] of a user joint, each three numbers or functions of controls."""
    faults = len(table.faults)
    axes = [*_read_triple(table, "m", "", units), *_read_triple(table, "n", "", units)]
    if len(table.faults) > faults:  # the others might not be orthonormal to these
        axes = [*IDENTITY_MOTION[:6]]
    return (*axes, *_read_triple(table, "a", "m", units))


def _read_triple(table: CheckedTable, key: str, unit: str, units: Units) -> list[Expression]:
    value = table.value(key)
    if isinstance(value, (list, tuple)) and len(value) == 3:
        return [parse_expression(table, key, entry, unit, units) for entry in value]
    _add_fault(table, key, value, "a list of 3 numbers or expressions")
    return [*IDENTITY_MOTION[6:]]


def read_expression(table: CheckedTable, key: str, unit: str, units: Units) -> Expression:
    """Return the number or function of controls under a key in SI; the key is required."""
    return parse_expression(table, key, table.value(key), unit, units)


def parse_expression(table: CheckedTable, key: str, value: Any, unit: str, units: Units) -> Expression:
    """Return a number or text of a file as a function of controls in SI; 1 if it is no arithmetic."""
    if is_number(value):
        return Expression(repr(to_si(float(value), unit, units)))
    if not isinstance(value, str):
        _add_fault(table, key, value, "a finite number, or an expression as a text")
        return Expression("1.0")
    factor = "0.001" if unit == "m" and units.millimetres else ""
    factor = "pi / 180" if unit == "rad" and units.degrees else factor
    try:
        Expression(value)  # without brackets: with them `1) + (2` would be arithmetic
        return Expression(f"({value}) * {factor}" if factor else value)
    except ValueError as error:
        table.add_error(key, str(error))
        return Expression("1.0")


def to_si(value: float, unit: str, units: Units) -> float:
    """Return a number of the file in [m] or [rad]; without a unit as it is."""
    return {"m": units.length, "rad": units.angle}.get(unit, float)(value)


def _metres(point: Vector, units: Units) -> Vector:
    return units.length(point[0]), units.length(point[1]), units.length(point[2])


def _vector(value: Sequence[float]) -> Vector:
    return float(value[0]), float(value[1]), float(value[2])


def _add_fault(table: CheckedTable, key: str, value: Any, allowed: str) -> None:
    table.add_error(key, f"found {'nothing' if value is None else format_value(value)}, allowed: {allowed}")
