"""The units that urmpipe ships, by name.

The unit NAME is made by the function NAME of a module of `urmpipe_fmus.blocks`. The module's constant
NAME_OPTIONS has a line of help for each argument of the function. A new unit is such a function and a line
below.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import Parameter, signature
from types import ModuleType
from typing import Any, cast

from urmpipe_fmus.block import BlockModel
from urmpipe_models.errors import UnitError, format_suggestion, format_unknown_name

# Of each unit its module, and what it does.
_UNITS: dict[str, tuple[str, str]] = {
    "kinematic_chain": (
        "kinematic_chain",
        "points of an arm, and velocities and angles of its sensors, from the joints",
    ),
    "repolarizer": ("logs", "joint angles without the jumps of limited joints"),
    "delta_meter": ("logs", "deviation of a point from where it should be, and whether it is tolerated"),
    "log_source": ("logs", "columns of a log over time, held or interpolated"),
    "dc_drive": ("drives", "DC motor with gear and a flexible damped shaft"),
    "inertia": ("drives", "load of a drive: an inertia in a bearing with friction"),
    "drive_controller": ("drives", "sampled control of a drive's voltage"),
    "chain_dynamics": ("chain_dynamics", "motion of an arm with masses under the torques of its joints"),
    "driven_arm": (
        "driven_arm",
        "an arm with masses, a flexible drive and a sampled controller on each joint",
    ),
    "network_motion": ("network_motion", "joints and points of a kinematic network, from its controls"),
    "set_point": ("drives", "set position, velocity and acceleration over time: step, ramp, trapezoid"),
}


def block_names() -> tuple[str, ...]:
    """Return the names of the units."""
    return tuple(_UNITS)


def normalise_block_name(name: str) -> str:
    """Return the name of a unit whose words are joined by - or _; what is no unit's name as it is."""
    joined = name.replace("-", "_")
    return joined if joined in _UNITS else name


def block_summary(name: str) -> str:
    """Return what a unit does, in a line.

    Raises:
        UnitError: If there is no such unit.
    """
    return _UNITS[_known(name)][1]


def block_option_help(name: str) -> Mapping[str, str]:
    """Return a line of help for each option of a unit.

    Raises:
        UnitError: If there is no such unit.
    """
    known = _known(name)
    return cast("Mapping[str, str]", getattr(_module(known), f"{known.upper()}_OPTIONS", {}))


def make_block(name: str, /, **options: Any) -> BlockModel:
    """Return a unit.

    Args:
        name: Its name.
        options: See `block_option_help`.

    Raises:
        UnitError: If there is no such unit, or with all that is wrong with its options.
    """
    name = _known(name)
    known = block_option_help(name)
    make = cast("Callable[..., BlockModel]", getattr(_module(name), name))
    needed = [one.name for one in signature(make).parameters.values() if one.default is Parameter.empty]
    allowed = ", ".join(known) or "none, it has no options"
    faults = [
        f"option {one}: found{format_suggestion(one, known)}, allowed: {allowed}; a parameter is set where"
        f" the unit runs, in a system by start = {{ {one} = ... }}, in another tool as the FMU's start value"
        for one in options
        if one not in known
    ]
    faults += [f"option {one}: not found, it needs {known[one]}" for one in needed if one not in options]
    if faults:
        raise UnitError(*(f"unit {name}: {fault}" for fault in faults))
    return make(**options)


def _module(name: str) -> ModuleType:
    return import_module(f"{__name__}.{_UNITS[name][0]}")


def _known(name: str) -> str:
    """Return the name of a unit; `UnitError` if there is none."""
    if (found := normalise_block_name(name)) not in _UNITS:
        raise UnitError(f"unit: {format_unknown_name(name, _UNITS)}, or a .py file with a unit in it")
    return found
