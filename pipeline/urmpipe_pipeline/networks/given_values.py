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

from urmpipe_models.elementwise import Vector
from urmpipe_models.errors import Finding, OptionError, for_each, shown
from urmpipe_models.measure_units import MEASURES, NAMES, WRITTEN, quantity
from urmpipe_models.names import not_among
from urmpipe_models.networks.forces import Wrench
from urmpipe_models.networks.mechanism import mechanism_of
from urmpipe_models.networks.network import Network
from urmpipe_models.networks.parts import POSE_UNITS, Parts

Quantity: TypeAlias = float | str
"""A number, or a text with a unit."""

Range: TypeAlias = Quantity | Sequence[Quantity]
"""From and to; one value holds a variable."""


def drive_factor(network: Parts, name: str) -> float:
    """Return how many SI units one of a drive is: of a control in deg or mm; 1 for all others."""
    unit = network.unit_of(name)
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
                Finding(parameter=parameter, found=f"{name} = {shown(value)}", allowed="a finite number")
            )
        return float(value)
    in_file = {"m": network.length_unit, "rad": network.angle_unit}.get(unit, "")
    units = {key: si / factor for key, si in WRITTEN.get(unit, {}).items()}
    units[""] = MEASURES[unit][in_file] / factor if unit else Decimal(1)
    number = quantity(value, units)
    if not math.isfinite(number):
        allowed = f"a number, or {NAMES[unit].partition(' in ')[0]} with its unit" if unit else "a number"
        raise OptionError(Finding(parameter=parameter, found=f"{name} = {value}", allowed=allowed))
    return number


def _unit_anddrive_factor(network: Network, name: str) -> tuple[str, Decimal]:
    """Return the unit of a drive, and how many of it one of its own units is."""
    if name in {control.name for control in network.controls}:
        return network.unit_of(name) or ("", Decimal(1))
    owner, _, index = name.partition("[")
    joint = next((joint for joint in network.joints if joint.name in (name, owner)), None)
    place = int(index.rstrip("]") or 1) - 1 if index.rstrip("]").isdigit() else 0
    known = joint is not None and place < len(joint.units)
    return (joint.units[place] if joint is not None and known else ""), Decimal(1)


def parse_ranges(network: Network, drives: Mapping[str, Range]) -> list[tuple[float, float]]:
    """Return from and to of each drive in its own unit."""

    def parse(pair: tuple[str, Range]) -> tuple[float, float]:
        name, value = pair
        unit, factor = _unit_anddrive_factor(network, name)
        ends: list[Quantity] = [*value.split(":")] if isinstance(value, str) else []
        ends = ends or ([*value] if isinstance(value, Sequence) else [value])
        if len(ends) not in (1, 2):
            raise OptionError(
                Finding(parameter="drives", found=f"{name} = {shown(value)}", allowed="FROM:TO, or one value")
            )
        read = [parse_quantity(network, "drives", name, end, unit, factor) for end in ends]
        return read[0], read[-1]

    return for_each(parse, drives.items())


def parse_start(network: Network, start: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Return values of joints and of bodies with freedoms of their own in [rad] and [m], by name.

    Values of controls, as an assembly has them, are left out: drives and controls say where these are.
    """
    joints = {joint.name: joint.units for joint in network.joints if joint.units}
    mechanism = mechanism_of(network)
    bodies = dict.fromkeys(mechanism.graph.roots[1:], POSE_UNITS)
    units: dict[str, tuple[str, ...]] = {**bodies, **joints}
    controls = {control.name for control in network.controls}

    def parse(pair: tuple[str, Any]) -> tuple[str, tuple[float, ...]] | None:
        name, value = pair
        if name in controls and name not in units:
            return None
        if name not in units:
            raise OptionError(Finding(f"joint {not_among(name, units)}", parameter="start"))
        values = value.split(",") if isinstance(value, str) else value
        values = [values] if isinstance(values, Real) else [*values]
        if len(values) != len(units[name]):
            allowed = f"{len(units[name])} in {', '.join(units[name])}"
            raise OptionError(Finding(parameter="start", found=f"{name} = {shown(value)}", allowed=allowed))
        read = [
            parse_quantity(network, "start", name, one, unit, Decimal(1))
            for one, unit in zip(values, units[name], strict=True)
        ]
        return name, tuple(read)

    return dict(pair for pair in for_each(parse, start.items()) if pair is not None)


def _parse_vector(parameter: str, given: str, allowed: str, si: str = "m") -> list[float]:
    values = [quantity(part, WRITTEN.get(si, {"": Decimal(1)})) for part in given.split(",")]
    if len(values) not in (3, 6) or not all(map(math.isfinite, values)):
        raise OptionError(Finding(parameter=parameter, found=shown(given), allowed=allowed))
    return values


def parse_point(network: Network, point: Any) -> tuple[str, Vector] | None:
    """Return the body and the place in its frame in [m] of a point to trace."""
    if point is None:
        return None
    allowed = "BODY:X,Y,Z in m, or with units, such as coupler:0.45,0.2,0"
    if isinstance(point, str):
        body, sign, place = point.rpartition(":")
        if not sign:
            body, place = point, "0,0,0"
        values = _parse_vector("point", place, allowed)
    else:
        body, values = point[0], [float(value) for value in point[1]]
    if body not in network.body_names:
        raise OptionError(Finding(f"body {not_among(str(body), network.body_names)}", parameter="point"))
    if len(values) != 3 or not all(map(math.isfinite, values)):
        raise OptionError(Finding(parameter="point", found=shown(point), allowed=allowed))
    return body, (values[0], values[1], values[2])


def parse_wrench(network: Network, wrench: str | Wrench) -> Wrench:
    """Return a load on a body."""
    allowed = "BODY:X,Y,Z:FX,FY,FZ[,MX,MY,MZ] in m, N and N.m, such as coupler:0,0,0:0,-50,0"
    if isinstance(wrench, str):
        body, _, rest = wrench.partition(":")
        place, sign, load = rest.partition(":")
        if not sign:
            raise OptionError(Finding(parameter="wrenches", found=shown(wrench), allowed=allowed))
        at, forces = _parse_vector("wrenches", place, allowed), _parse_vector("wrenches", load, allowed, "1")
        forces += [0.0] * (6 - len(forces))
        wrench = Wrench(
            body, (at[0], at[1], at[2]), (forces[0], forces[1], forces[2]), (forces[3], forces[4], forces[5])
        )
    if wrench.body not in network.body_names:
        raise OptionError(Finding(f"body {not_among(wrench.body, network.body_names)}", parameter="wrenches"))
    return wrench


def parse_torques(network: Network, torques: Mapping[str, float | str]) -> dict[str, float]:
    """Return loads at joints in [N.m] or [N], by name."""
    joints = {joint.name: joint for joint in network.joints if joint.units and joint.kind != "global"}

    def parse(pair: tuple[str, float | str]) -> tuple[str, float]:
        name, value = pair
        if name not in joints:
            raise OptionError(Finding(f"joint {not_among(name, joints)}", parameter="torques"))
        number = (
            quantity(value, {"": Decimal(1), "N": Decimal(1), "N.m": Decimal(1), "Nm": Decimal(1)})
            if isinstance(value, str)
            else value
        )
        if not math.isfinite(number):
            raise OptionError(
                Finding(parameter="torques", found=f"{name} = {value}", allowed="a number in N.m or N")
            )
        return name, float(number)

    return dict(for_each(parse, torques.items()))
