"""List units, build and check FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import Group, operand
from urmpipe.parameters import kinds
from urmpipe.parameters.param import Param
from urmpipe.parameters.systems import BuildFmu, CheckFmu
from urmpipe_models.errors import Finding, Hint, OptionError
from urmpipe_models.toml_tables import TomlError, parse_toml_text

ROBOT = Param(kinds.ROBOT, "Robot, for units that need one.")


@click.group(cls=Group, short_help="List units, build and check FMUs.")
def fmu() -> None:
    """List the built-in units, package units as FMUs, and check any FMU.

    A unit is a model with FMI variables: the kinematics of an arm, the repolarizer (phase unwrapping that
    keeps real jumps), a DC drive, a log that is played back. Its FMU (FMI 2.0 co-simulation) runs in
    Simulink, Dymola, OpenModelica, OSP and FMPy.
    """


@fmu.add_command
@command(name="list", short_help="List the built-in units.")
@operand("unit", kinds.UNIT_MODEL, metavar="[UNIT|FILE.py]", required=False)
def list_(call: Call, unit: str | None) -> Answer:
    """List the built-in units with their options, or the variables of one unit.

    \b
    Examples:
      urmpipe fmu list
      urmpipe fmu list dc_drive
      urmpipe fmu list --json
    """
    from urmpipe.printing.units import print_unit, print_units, unit_dict, units_dict

    if unit is None:
        return Answer(to_dict=units_dict, print_text=print_units)
    return Answer(to_dict=lambda: unit_dict(unit), print_text=lambda: print_unit(unit))


@fmu.add_command
@command(BuildFmu, robot=ROBOT, short_help="Package a unit as an FMU.")
@operand("unit", kinds.UNIT_MODEL, metavar="UNIT|FILE.py")
def build(
    call: Call, unit: str, robot: str | None, log: str | None, map: str | None, **options: Any
) -> Answer:
    """Package a unit as an FMU: a name of `urmpipe fmu list`, or your own unit in a Python file.

    Building the same unit twice gives identical files. An FMU of another tool is never replaced.

    \b
    Examples:
      urmpipe fmu build kinematic_chain --robot urm6
      urmpipe fmu build kinematic_chain --robot arm.urdf -s points=p6,p7
      urmpipe fmu build repolarizer -s joints=6 --platforms linux64,win64
      urmpipe fmu build log_source --log log.csv -o log.fmu
      urmpipe fmu build my_unit.py
    """
    from urmpipe.arm_placing import place_robot
    from urmpipe.printing.terminal import redirect_prints
    from urmpipe.printing.units import print_built
    from urmpipe.systems.logs import read_mapped_table
    from urmpipe.systems.units import check_robot_and_log, parse_columns

    if map and not log:
        hint = Hint("log", None, "sets one")
        raise OptionError(Finding("found without a log", parameter="map", hints=(hint,)))
    of_unit = {name: option_value(text) for name, text in (options.pop("options") or {}).items()}
    if Path(unit).suffix != ".py":
        check_robot_and_log(unit, robot, log)
    arm = place_robot(robot)
    columns = parse_columns(of_unit.pop("columns", None))
    table = log and read_mapped_table(log, columns, robot=arm, log_map=map)
    with redirect_prints(), call.working(f"Building {unit}"):
        built = urmpipe.build_fmu(
            unit, robot=robot, log=table, options=of_unit, on_message=call.note, **options
        )
    warnings = table.warnings if table else ()
    return Answer(warnings=warnings, to_dict=built.to_dict, print_text=lambda: print_built(built))


def option_value(text: str) -> Any:
    """Return the value of NAME=VALUE: as TOML has it, else words separated by commas, or a word."""
    try:
        return parse_toml_text(f"value = {text}\n")["value"]
    except (TomlError, KeyError):
        words = [part.strip() for part in text.split(",")]
        return words if len(words) > 1 else text.strip()


@fmu.add_command
@command(CheckFmu, short_help="Validate an FMU, run it and list its variables.")
@operand("file", kinds.file("FILE.fmu", ".fmu"), metavar="FILE.fmu")
def check(call: Call, file: Path, timeout: float) -> Answer:
    """Validate an FMU of any tool, run it, and list its variables.

    \b
    Examples:
      urmpipe fmu check kinematic_chain.fmu
      urmpipe fmu check other.fmu --json
      urmpipe fmu check slow.fmu --timeout 600

    Exit codes: 0 no problems, 1 problems found, 2 not an FMU.
    """
    from urmpipe.printing.units import checked_dict, print_checked
    from urmpipe_fmus.check import check_fmu

    checked = check_fmu(file, timeout=timeout)
    return Answer(
        to_dict=lambda: checked_dict(checked),
        print_text=lambda: print_checked(checked),
        verdict="fail" if checked.problems else "pass",
    )
