"""Values that people give with a network: drives, start values, points, loads; texts with units, or numbers.

Of controls numbers are in the units of the network's file, of joints in [rad] and [m]; texts have a unit,
or that of the file. Each function raises an `OptionError` with everything that is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from numbers import Real
from typing import Any, TypeAlias

import numpy as np

from urmpipe_models.elementwise import Vector
from urmpipe_models.errors import (
    Finding,
    OptionError,
    format_unknown_name,
    format_value,
    map_collecting_errors,
)
from urmpipe_models.measure_units import MEASURES, NAMES, QUANTITY, WRITTEN, quantity_to_si
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.forces import Wrench
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.parts import POSE_UNITS, Parts

Quantity: TypeAlias = float | str
"""A number, or a text with a unit."""

Range: TypeAlias = Quantity | Sequence[Quantity]
"""From and to; one value holds a variable."""


def drive_factor(network: Parts, name: str) -> float:
    """Return how many SI units one of a drive is: of a control in deg or mm; 1 for all others."""
    unit = network.control_unit(name)
    return float(unit[1]) if unit and name in {control.name for control in network.controls} else 1.0


def parse_quantity(
    network: Network, parameter: str, name: str, value: Quantity, unit: str, factor: Decimal
) -> float:
    """Return a value in units of which one is `factor` SI units.

    Numbers are in these units; texts have a unit of their own, or the unit of the network's file.

    Raises:
        OptionError: If it is no such value.
    """
    if not isinstance(value, str):
        if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(float(value)):
            raise OptionError(
                Finding(
                    parameter=parameter, found=f"{name} = {format_value(value)}", allowed="a finite number"
                )
            )
        return float(value)
    in_file = {"m": network.length_unit, "rad": network.angle_unit}.get(unit, "")
    units = {key: si / factor for key, si in WRITTEN.get(unit, {}).items()}
    units[""] = MEASURES[unit][in_file] / factor if unit else Decimal(1)
    number = quantity_to_si(value, units)
    if not math.isfinite(number):
        allowed = f"a number, or {NAMES[unit].partition(' in ')[0]} with its unit" if unit else "a number"
        raise OptionError(Finding(parameter=parameter, found=f"{name} = {value}", allowed=allowed))
    return number


def is_word(value: Any) -> bool:
    """Return whether a value names something: a text that is neither a number with a unit nor a range."""
    return isinstance(value, str) and QUANTITY.fullmatch(value.strip()) is None and ":" not in value


def _find_unit(network: Network, name: str) -> tuple[str, Decimal]:
    """Return the SI unit of a drive and its factor from the unit of the file; "" and 1 of other names."""
    if name in {control.name for control in network.controls}:
        return network.control_unit(name) or ("", Decimal(1))
    for joint in network.joints:
        for k, unit in enumerate(joint.units, 1):
            if name in (joint.name, f"{joint.name}[{k}]"):
                return unit, Decimal(1)
    return "", Decimal(1)


def _as_list(value: Any) -> list[Any]:
    """Return the parts of a list, of an array, or of a text with commas; of all else, that alone."""
    if isinstance(value, str):
        return [*value.split(",")]
    return [*value] if isinstance(value, (Sequence, np.ndarray)) else [value]


def parse_ranges(network: Network, drives: Mapping[str, Range]) -> list[tuple[float, float]]:
    """Return from and to of each drive in its own unit."""

    def parse(pair: tuple[str, Range]) -> tuple[float, float]:
        name, value = pair
        unit, factor = _find_unit(network, name)
        ends = value.split(":") if isinstance(value, str) else _as_list(value)
        if len(ends) not in (1, 2):
            found, allowed = f"{name} = {format_value(value)}", "FROM:TO, or one value"
            raise OptionError(Finding(parameter="drives", found=found, allowed=allowed))
        read = [parse_quantity(network, "drives", name, end, unit, factor) for end in ends]
        return read[0], read[-1]

    return map_collecting_errors(parse, drives.items())


def parse_start(network: Network, start: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Return values of joints and of bodies with freedoms of their own in [rad] and [m], by name.

    Values of controls, as an assembly has them, are left out: drives and controls say where these are.
    """
    joints = {joint.name: joint.units for joint in network.joints if joint.units}
    bodies = dict.fromkeys(build_mechanism(network).graph.roots[1:], POSE_UNITS)
    units: dict[str, tuple[str, ...]] = {**bodies, **joints}
    controls = {control.name for control in network.controls}

    def parse(pair: tuple[str, Any]) -> tuple[str, tuple[float, ...]] | None:
        name, value = pair
        if name in controls and name not in units:
            return None
        if name not in units:
            raise OptionError(Finding(f"joint {format_unknown_name(name, units)}", parameter="start"))
        values = _as_list(value)
        if len(values) != len(units[name]):
            allowed = f"{len(units[name])} in {', '.join(units[name])}"
            raise OptionError(
                Finding(parameter="start", found=f"{name} = {format_value(value)}", allowed=allowed)
            )
        pairs = zip(values, units[name], strict=True)
        return name, tuple(
            parse_quantity(network, "start", name, part, unit, Decimal(1)) for part, unit in pairs
        )

    return dict(pair for pair in map_collecting_errors(parse, start.items()) if pair is not None)


def _parse_vector(parameter: str, value: Any, counts: tuple[int, ...], si: str, allowed: str) -> list[float]:
    """Return the numbers of a text such as 1,2,3 or of a list."""
    numbers = [
        quantity_to_si(part, WRITTEN[si])
        if isinstance(part, str)
        else float(part)
        if isinstance(part, Real)
        else math.nan
        for part in _as_list(value)
    ]
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise OptionError(Finding(parameter=parameter, found=format_value(value), allowed=allowed))
    return numbers


def _check_body(network: Network, parameter: str, body: Any) -> str:
    if body not in network.body_names:
        raise OptionError(
            Finding(f"body {format_unknown_name(str(body), network.body_names)}", parameter=parameter)
        )
    return str(body)


def parse_point(network: Network, point: Any) -> tuple[str, Vector] | None:
    """Return the body and the place in its frame in [m] of a point to trace."""
    if point is None:
        return None
    allowed = "BODY:X,Y,Z in m, or with units, such as coupler:0.45,0.2,0"
    parts = _as_list(point) if not isinstance(point, str) else [*point.rpartition(":")[::2]]
    if isinstance(point, str) and ":" not in point:
        parts = [point, "0,0,0"]
    if len(parts) != 2:
        raise OptionError(Finding(parameter="point", found=format_value(point), allowed=allowed))
    x, y, z = _parse_vector("point", parts[1], (3,), "m", allowed)
    return _check_body(network, "point", parts[0]), (x, y, z)


def parse_wrench(network: Network, wrench: Any) -> Wrench:
    """Return a load on a body."""
    allowed = "BODY:X,Y,Z:FX,FY,FZ[,MX,MY,MZ] in m, N and N.m, such as coupler:0,0,0:0,-50,0"
    parts: list[Any] = wrench.split(":") if isinstance(wrench, str) else []
    if isinstance(wrench, Wrench):
        parts = [wrench.body, wrench.point, [*wrench.force, *wrench.moment]]
    if len(parts) != 3:
        raise OptionError(Finding(parameter="wrenches", found=format_value(wrench), allowed=allowed))
    x, y, z = _parse_vector("wrenches", parts[1], (3,), "m", allowed)
    load = _parse_vector("wrenches", parts[2], (3, 6), "1", allowed) + [0.0] * 3
    body = _check_body(network, "wrenches", parts[0])
    return Wrench(body, (x, y, z), (load[0], load[1], load[2]), (load[3], load[4], load[5]))


def format_wrench(wrench: Wrench) -> str:
    """Return a load as `parse_wrench` reads it."""
    place, load = (
        ",".join(f"{value!r}" for value in values)
        for values in (wrench.point, (*wrench.force, *wrench.moment))
    )
    return f"{wrench.body}:{place}:{load}"


def parse_torques(network: Network, torques: Mapping[str, Any]) -> dict[str, float]:
    """Return loads at joints in [N.m] or [N], by name."""
    joints = {joint.name: joint for joint in network.joints if joint.units and joint.kind != "global"}

    def parse(pair: tuple[str, Any]) -> tuple[str, float]:
        name, value = pair
        if name not in joints:
            raise OptionError(Finding(f"joint {format_unknown_name(name, joints)}", parameter="torques"))
        units = ("N.m", "Nm") if joints[name].units[0] == "rad" else ("N",)
        known = dict.fromkeys(("", *units), Decimal(1))
        number = quantity_to_si(value, known) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, Real) or not math.isfinite(float(number)):
            found = f"{name} = {format_value(value)}"
            raise OptionError(Finding(parameter="torques", found=found, allowed=f"a number in {units[0]}"))
        return name, float(number)

    return dict(map_collecting_errors(parse, torques.items()))
