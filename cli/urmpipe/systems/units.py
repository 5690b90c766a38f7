"""Units of systems and FMUs: by name with robot, log and options, or from a file; their examples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from urmpipe.arm_placing import Robot, place_robot
from urmpipe.public_functions import PathLike
from urmpipe.systems.logs import LogTable, read_mapped_table
from urmpipe_datasets import LOGS
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import block_option_help, make_block, normalise_block_name
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import DRIVE_KEYS, GAIN_KEYS, Drive, DrivenJoint, Gains
from urmpipe_models.errors import Finding, Hint, OptionError
from urmpipe_models.robots.catalogue import load_robot

if TYPE_CHECKING:
    from urmpipe_pipeline.logs import LogMap

Backend = Literal["native", "python"]

EXAMPLES: Mapping[str, Mapping[str, Any]] = {  # arguments of a unit whose variables depend on them
    "kinematic_chain": {"robot": "urm6"},
    "chain_dynamics": {"robot": "ur3"},
    "repolarizer": {"options": {"joints": 6}},
    "network_motion": {"options": {"network": "four-bar"}},
    "log_source": {"log": LOGS / "matlab.csv"},
}
DRIVEN_ROBOT = "ur3"  # of the example of driven_arm, which needs drives
FROM_LOG = ("table", "columns")  # options of a unit that come from a log


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
        robot: The robot, for a unit that has one; for one that plays a log it states the joints of the log.
        log: A log for a unit that plays one, or what `read_table` made of it.
        options: Further options of the unit. Of a log, `columns` names columns of any table; without it
            they are the joints, or the x, y, z of a path.
        log_map: How to read the log where it does not show it.

    Raises:
        UrmpipeError: With everything that is wrong with the unit or its options.
    """
    arguments = dict(options or {})
    if isinstance(unit, BlockModel) or Path(unit).suffix == ".py":
        unexpected = [
            option for option, value in {"robot": robot, "log": log, **arguments}.items() if value is not None
        ]
        if unexpected:
            name = unit.name if isinstance(unit, BlockModel) else unit
            options_text = ", ".join(unexpected)
            raise OptionError(f"unit {name}: found {options_text}, allowed: no options, it is complete")
        if isinstance(unit, BlockModel):
            return unit
        from urmpipe_fmus.blocks.user import load_block_file

        return load_block_file(Path(unit))
    name = normalise_block_name(str(unit))
    check_robot_and_log(name, robot, log)
    arm = place_robot(robot)
    if log is not None:
        names = parse_columns(arguments.pop("columns", None))
        if not isinstance(log, LogTable):
            log = read_mapped_table(log, names, robot=arm, log_map=log_map)
        arguments |= {"table": log.table, "columns": log.columns}
    elif arm is not None:
        arguments["robot"] = arm
    return make_block(name, **arguments)


def example_of(unit: str) -> BlockModel:
    """Return a unit with the options of its example; from a file without any.

    Raises:
        UrmpipeError: If there is no such unit, or with all that is wrong with a file.
    """
    if normalise_block_name(unit) == "driven_arm":
        return unit_of(unit, robot=_driven_robot())
    return unit_of(unit, **EXAMPLES.get(normalise_block_name(unit), {}))


def example_subject(unit: str) -> tuple[str, str]:
    """Return the robot or network of a unit's example, and "arm" or "network"; empty without one."""
    name = normalise_block_name(unit)
    if name == "network_motion":
        return str(EXAMPLES[name]["options"]["network"]), "network"
    robot = DRIVEN_ROBOT if name == "driven_arm" else EXAMPLES.get(name, {}).get("robot", "")
    return robot, "arm" if robot else ""


def _driven_robot() -> Chain:
    """Return a robot with the start values of the drive and controller units on each joint."""
    robot = load_robot(DRIVEN_ROBOT)
    starts = {
        parameter.name: parameter.starts[0]
        for name in ("dc_drive", "drive_controller")
        for parameter in make_block(name).parameters
    }
    drive = Drive(*(starts[key] for key in DRIVE_KEYS))
    gains = Gains(*(starts[key] for key in GAIN_KEYS))
    drives = (
        DrivenJoint(name, drive, starts["period"], gains, starts["u_max"]) for name in robot.coordinates
    )
    return replace(robot, drives=tuple(drives))


def parse_columns(columns: Any) -> list[str] | None:
    """Return the names of columns that an option gives: one, or a list of them."""
    if columns is None:
        return None
    return [str(column) for column in (columns if isinstance(columns, (list, tuple)) else [columns])]


def check_robot_and_log(name: str, robot: Robot | None, log: Any) -> None:
    """Raise an error if a unit is unknown, lacks its robot or log, or has none of those given.

    Raises:
        UnitError: If there is no such unit.
        OptionError: With all missing and all unexpected ones.
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
            label = value.files[0] if isinstance(value, LogTable) else value
            label = value.name if isinstance(value, Chain) else label
            message = f"found a {option} ({label}), allowed: none, the unit has no such option"
            faults.append(Finding(message, about=f"unit {name}"))
    if faults:
        raise OptionError(*faults)
