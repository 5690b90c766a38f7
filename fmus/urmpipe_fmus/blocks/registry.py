"""The units that urmpipe ships, by name.

The unit NAME is made by the function NAME of the module `urmpipe_fmus.units.NAME`, whose constant `OPTIONS`
has a line of help for each of the function's arguments. A new unit is such a module and a line below.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import Parameter, signature
from typing import Any, cast

from urmpipe_fmus.block import Unit
from urmpipe_models.errors import UnitError, did_you_mean, not_among

_UNITS: dict[str, str] = {
    "kinematic_chain": "points of an arm, and velocities and angles of its sensors, from the joints",
    "repolarizer": "joint angles without the jumps of limited joints",
    "delta_meter": "deviation of a point from where it should be, and whether it is tolerated",
    "log_source": "columns of a log over time, held or interpolated",
    "dc_drive": "DC motor with gear and a flexible damped shaft",
    "inertia": "load of a drive: an inertia in a bearing with friction",
    "drive_controller": "sampled control of a drive's voltage",
    "chain_dynamics": "motion of an arm with masses under the torques of its joints",
    "driven_arm": "an arm with masses, a flexible drive and a sampled controller on each joint",
    "network_motion": "joints and points of a kinematic network, from its controls",
    "set_point": "set position, velocity and acceleration over time: step, ramp, trapezoid",
}
"""What each unit does, in a line."""


def unit_names() -> tuple[str, ...]:
    """Return the names of the units."""
    return tuple(_UNITS)


def unit_name(name: str) -> str:
    """Return the name of a unit whose words are joined by - or _; what is no unit's name as it is."""
    joined = name.replace("-", "_")
    return joined if joined in _UNITS else name


def unit_help(name: str) -> str:
    """Return what a unit does, in a line.

    Raises:
        UnitError: If there is no such unit.
    """
    return _UNITS[_known(name)]


def unit_options(name: str) -> Mapping[str, str]:
    """Return a line of help for each option of a unit.

    Raises:
        UnitError: If there is no such unit.
    """
    return cast("Mapping[str, str]", import_module(f"{__name__}.{_known(name)}").OPTIONS)


def make_unit(name: str, /, **options: Any) -> Unit:
    """Return a unit.

    Args:
        name: Its name.
        options: See `unit_options`.

    Raises:
        UnitError: If there is no such unit, or with all that is wrong with its options.
    """
    name = _known(name)
    known = unit_options(name)
    make = cast("Callable[..., Unit]", getattr(import_module(f"{__name__}.{name}"), name))
    needed = [one.name for one in signature(make).parameters.values() if one.default is Parameter.empty]
    allowed = ", ".join(known) or "none, it has no options"
    faults = [
        f"option {one}: found{did_you_mean(one, known)}, allowed: {allowed}; a parameter is set where the"
        f" unit runs, in a system by start = {{ {one} = ... }}, in another tool as the FMU's start value"
        for one in options
        if one not in known
    ]
    faults += [f"option {one}: not found, it needs {known[one]}" for one in needed if one not in options]
    if faults:
        raise UnitError(*(f"unit {name}: {fault}" for fault in faults))
    return make(**options)


def _known(name: str) -> str:
    """Return the name of a unit; `UnitError` if there is none."""
    if (found := unit_name(name)) not in _UNITS:
        raise UnitError(f"unit: {not_among(name, _UNITS)}, or a .py file with a unit in it")
    return found
