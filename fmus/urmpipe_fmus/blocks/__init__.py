"""The blocks that urmpipe ships, by name.

The block NAME is made by the function NAME of a module of `urmpipe_fmus.blocks`, whose constant NAME_OPTIONS
has a line of help for each argument of the function. A new block is such a function and a line below.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from inspect import Parameter, signature
from types import ModuleType
from typing import Any, cast

from urmpipe_fmus.block import BlockModel
from urmpipe_models.errors import UnitError, format_suggestion, format_unknown_name

# Module and summary of each block.
_BLOCKS: dict[str, tuple[str, str]] = {
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
    """Return the names of the blocks."""
    return tuple(_BLOCKS)


def normalise_block_name(name: str) -> str:
    """Return the name of a block whose words are joined by - or _; any other text unchanged."""
    joined = name.replace("-", "_")
    return joined if joined in _BLOCKS else name


def block_summary(name: str) -> str:
    """Return what a block does, in one line.

    Raises:
        UnitError: If there is no such block.
    """
    return _BLOCKS[_find_name(name)][1]


def block_option_help(name: str) -> Mapping[str, str]:
    """Return a line of help for each option of a block.

    Raises:
        UnitError: If there is no such block.
    """
    name = _find_name(name)
    return cast("Mapping[str, str]", getattr(_module(name), f"{name.upper()}_OPTIONS", {}))


def make_block(name: str, /, **options: Any) -> BlockModel:
    """Return a block.

    Args:
        name: Its name.
        options: See `block_option_help`.

    Raises:
        UnitError: If there is no such block, or with all errors of its options.
    """
    name = _find_name(name)
    known = block_option_help(name)
    make = cast("Callable[..., BlockModel]", getattr(_module(name), name))
    parameters = signature(make).parameters.values()
    required = [parameter.name for parameter in parameters if parameter.default is Parameter.empty]
    allowed = ", ".join(known) or "none, it has no options"
    faults = [
        f"option {option}: found{format_suggestion(option, known)}, allowed: {allowed}; a parameter is set"
        f" where the unit runs, in a system by start = {{ {option} = ... }}, in another tool as the FMU's"
        " start value"
        for option in options
        if option not in known
    ]
    faults += [
        f"option {option}: not found, it needs {known[option]}"
        for option in required
        if option not in options
    ]
    if faults:
        raise UnitError(*(f"unit {name}: {fault}" for fault in faults))
    return make(**options)


def _find_name(name: str) -> str:
    """Return the name of a block; `UnitError` if there is none."""
    if (normal := normalise_block_name(name)) not in _BLOCKS:
        raise UnitError(f"unit: {format_unknown_name(name, _BLOCKS)}, or a .py file with a unit in it")
    return normal


def _module(name: str) -> ModuleType:
    return import_module(f"{__name__}.{_BLOCKS[name][0]}")
