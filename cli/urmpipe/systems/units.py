"""Units as they are named: by name, from a file or complete, with robot, log and options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from urmpipe.arm_placing import Robot, place_robot
from urmpipe.keyword_checks import PathLike
from urmpipe.log_table import LogTable
from urmpipe.systems.log_tables import read_mapped_table
from urmpipe_datasets import LOGS
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import block_option_help, make_block, normalise_block_name
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import DRIVE_KEYS, GAIN_KEYS, Drive, DrivenJoint, Gains
from urmpipe_models.errors import Finding, Hint, OptionError
from urmpipe_models.robots.catalogue import load_robot

if TYPE_CHECKING:
    from urmpipe_pipeline.sources import LogMap

Backend = Literal["native", "python"]

EXAMPLES: Mapping[str, Mapping[str, Any]] = {
    "kinematic_chain": {"robot": "urm6"},
    "chain_dynamics": {"robot": "ur3"},
    "repolarizer": {"options": {"joints": 6}},
    "network_motion": {"options": {"network": "four-bar"}},
    "log_source": {"log": LOGS / "matlab.csv"},
}
"""What the units are given, where they need it, to show their variables."""

DRIVEN = "ur3"
"""The arm of the example of `driven_arm`, which needs drives."""

FROM_LOG = ("table", "columns")
"""Options of a unit that come from a log."""


def unit_of(
    unit: BlockModel | PathLike,
    *,
    robot: Robot | None = None,
    log: PathLike | LogTable | None = None,
    options: Mapping[str, Any] | None = None,
    log_map: PathLike | LogMap | None = None,
) -> BlockModel:
    """Return a unit by name or from a file, made with its options.

    Args:
        unit: A name, a Python file, or a unit.
        robot: The arm, for a unit that has one; for one that plays a log it tells how to read it.
        log: A log for a unit that plays one, or what `read_table` made of it.
        options: Further options of the unit. Of a log, `columns` names columns of any table; without it
            they are the joints, or the x, y, z of a path.
        log_map: How to read the log where it cannot tell by itself.

    Raises:
        UrmpipeError: With everything that is wrong with the unit or its options.
    """
    given = dict(options or {})
    if isinstance(unit, BlockModel) or Path(unit).suffix == ".py":
        _refuse_options(unit, {"robot": robot, "log": log, **given})
        return unit if isinstance(unit, BlockModel) else _from_file(Path(unit))
    name = normalise_block_name(str(unit))
    refuse_operands(name, robot, log)
    arm = place_robot(robot)
    if log is not None:
        names = column_names(given.pop("columns", None))
        found = (
            log if isinstance(log, LogTable) else read_mapped_table(log, names, robot=arm, log_map=log_map)
        )
        given |= {"table": found.table, "columns": found.columns}
    elif arm is not None:
        given["robot"] = arm
    return make_block(name, **given)


def example_of(unit: str) -> BlockModel:
    """Return a unit with the options of an example, as its variables depend on them; from a file as it is.

    Raises:
        UrmpipeError: If there is no such unit, or with all that is wrong with a file.
    """
    if normalise_block_name(unit) == "driven_arm":
        return unit_of(unit, robot=_driven(load_robot(DRIVEN)))
    return unit_of(unit, **EXAMPLES.get(normalise_block_name(unit), {}))


def example_subject(unit: str) -> tuple[str, str]:
    """Return the arm or the network of a unit's example, and which of them it is; empty if it has none."""
    name = normalise_block_name(unit)
    if name == "network_motion":
        return str(EXAMPLES[name]["options"]["network"]), "network"
    robot = DRIVEN if name == "driven_arm" else EXAMPLES.get(name, {}).get("robot", "")
    return robot, "arm" if robot else ""


def _driven(robot: Chain) -> Chain:
    """Return an arm with the drive and the controller of their units' start values on each joint."""
    starts = {
        one.name: one.starts[0]
        for name in ("dc_drive", "drive_controller")
        for one in make_block(name).parameters
    }
    drive = Drive(*(starts[key] for key in DRIVE_KEYS))
    gains = Gains(*(starts[key] for key in GAIN_KEYS))
    drives = (DrivenJoint(one, drive, starts["period"], gains, starts["u_max"]) for one in robot.coordinates)
    return replace(robot, drives=tuple(drives))


def _from_file(path: Path) -> BlockModel:
    """Return the unit of a user's file."""
    from urmpipe_fmus.blocks.user import load_block_file

    return load_block_file(path)


def column_names(columns: Any) -> list[str] | None:
    """Return names of columns as they stand in an option: one, or a list of them."""
    if columns is None:
        return None
    return [str(one) for one in (columns if isinstance(columns, (list, tuple)) else [columns])]


def refuse_operands(name: str, robot: Robot | None, log: Any) -> None:
    """Raise an error if a unit is not there, lacks its robot or its log, or is given what it does not have.

    Raises:
        UnitError: If there is no such unit.
        OptionError: With all that it lacks and all that it does not have.
    """
    name = normalise_block_name(name)
    known = block_option_help(name)
    takes = {"robot": "robot" in known, "log": FROM_LOG[0] in known}
    faults = []
    for option, value in (("robot", robot), ("log", log)):
        if takes[option] and value is None:
            hint = Hint(option, None, f"sets one, in a system file {option} = ...")
            faults.append(Finding(f"found no {option}", about=f"unit {name}", hints=(hint,)))
        elif not takes[option] and value is not None and not (option == "robot" and takes["log"]):
            said = f"found a {option} ({_shown(value)}), allowed: none, the unit has no such option"
            faults.append(Finding(said, about=f"unit {name}"))
    if faults:
        raise OptionError(*faults)


def _shown(value: Any) -> Any:
    """Return what a robot or a log is called."""
    if isinstance(value, LogTable):
        return value.files[0]
    return value.name if isinstance(value, Chain) else value


def _refuse_options(unit: BlockModel | PathLike, given: Mapping[str, Any]) -> None:
    """Raise an `OptionError` if a unit that is complete is given options."""
    found = [name for name, value in given.items() if value is not None]
    if found:
        who = unit.name if isinstance(unit, BlockModel) else unit
        raise OptionError(f"unit {who}: found {', '.join(found)}, allowed: no options, it is complete")
