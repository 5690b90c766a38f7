"""`urmpipe fmu list|build|check`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

import urmpipe
from urmpipe.options.completion import one_of_each
from urmpipe.options.named import NamedType, named_values, option_names, option_value
from urmpipe.options.output import Terminal, output_options
from urmpipe.options.reading import MAP_OPTION
from urmpipe.options.types import ANY_FILE, DURATION, ROBOT, UNIT, FileType, NamesType, OneOf
from urmpipe.usage import Group
from urmpipe_models.errors import Finding, Hint, OptionError

PLATFORMS = ("linux64", "win64")


def _platforms(
    ctx: click.Context, param: click.Parameter, values: tuple[tuple[str, ...], ...]
) -> tuple[str, ...]:
    """Return the platforms, each known and once."""
    named = tuple(dict.fromkeys(one for value in values for one in value))
    wrong = [one for one in named if one not in PLATFORMS]
    if wrong:
        raise click.BadParameter(f"found {', '.join(wrong)}, allowed: {', '.join(PLATFORMS)}")
    return named


@click.group(cls=Group, short_help="List units, build and check FMUs.")
def fmu() -> None:
    """List the built-in units, package units as FMUs, and check any FMU.

    A unit is a model with FMI variables: the kinematics of an arm, the repolarizer (phase unwrapping that
    keeps real jumps), a DC drive, a log that is played back. Its FMU (FMI 2.0 co-simulation) runs in
    Simulink, Dymola, OpenModelica, OSP and FMPy.
    """


@fmu.command("list", short_help="List the built-in units.")
@click.argument("unit", metavar="[UNIT|FILE.py]", type=UNIT, required=False)
@output_options
def list_(unit: str | None, terminal: Terminal) -> int:
    """List the built-in units with their options, or the variables of one unit.

    \b
    Examples:
      urmpipe fmu list
      urmpipe fmu list dc_drive
      urmpipe fmu list --json
    """
    from urmpipe.printing.units import print_unit, print_units, unit_dict, units_dict

    if unit is None:
        terminal.answer(units_dict, print_units)
    else:
        terminal.answer(lambda: unit_dict(unit), lambda: print_unit(unit))
    return 0


@fmu.command(short_help="Package a unit as an FMU.")
@click.argument("unit", metavar="UNIT|FILE.py", type=UNIT)
@click.option("--robot", type=ROBOT, help="Robot, for units that need one.")
@click.option(
    "--log",
    metavar="LOG",
    type=ANY_FILE,
    help="Log, for units that play one back.",
)
@MAP_OPTION
@click.option(
    "-s",
    "--options",
    "--option",
    type=NamedType(option_names),
    multiple=True,
    callback=named_values,
    metavar="NAME=VALUE",
    help="Another option of the unit, such as joints=6 or rates=true; see `urmpipe fmu list`.",
)
@click.option(
    "--backend",
    type=OneOf(["native", "python"]),
    help="native: compiled C, needs nothing on the target. python: needs Python with NumPy there"
    " [default: native if a compiler is found].",
)
@click.option(
    "--platforms",
    type=NamesType(),
    shell_complete=one_of_each(*PLATFORMS),
    multiple=True,
    callback=_platforms,
    metavar="A,B",
    help="linux64, win64, or both with the extra `cross` [default: this platform; python: all].",
)
@click.option(
    "-o",
    "--output",
    type=FileType(".fmu"),
    default=".",
    metavar="DIR|FILE.fmu",
    help="Folder for UNIT.fmu, or the file to write [default: the working folder].",
)
@output_options
def build(
    unit: str,
    robot: str | None,
    log: Path | None,
    log_map: Path | None,
    options: dict[str, str],
    backend: Literal["native", "python"] | None,
    platforms: tuple[str, ...],
    output: Path,
    terminal: Terminal,
) -> int:
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
    from urmpipe.printing.terminal import prints_apart
    from urmpipe.printing.units import print_built
    from urmpipe.systems.logs import read_mapped_table
    from urmpipe.systems.units import check_robot_and_log, parse_columns

    if log_map and not log:
        hint = Hint("log", None, "sets one")
        raise OptionError(Finding("found without a log", parameter="log_map", hints=(hint,)))
    given = {name: option_value(text) for name, text in options.items()}
    if Path(unit).suffix != ".py":
        check_robot_and_log(unit, robot, log)
    arm = place_robot(robot)
    columns = parse_columns(given.pop("columns", None))
    table = log and read_mapped_table(log, columns, robot=arm, log_map=log_map)
    if table:
        terminal.warn(table.warnings)
    with prints_apart(), terminal.working(f"Building {unit}"):
        made = urmpipe.build_fmu(
            unit,
            robot=robot,
            log=table,
            options=given,
            backend=backend,
            platforms=platforms,
            output=output,
            told=terminal.note,
        )
    terminal.answer(made.to_dict, lambda: print_built(made))
    return 0


@fmu.command(short_help="Validate an FMU, run it and list its variables.")
@click.argument("file", metavar="FILE.fmu", type=FileType(".fmu"))
@click.option(
    "--timeout",
    type=DURATION,
    default=60.0,
    help="Longest time that a call of the FMU may take [default: 60 s].",
)
@output_options
def check(file: Path, timeout: float, terminal: Terminal) -> int:
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
    terminal.answer(lambda: checked_dict(checked), lambda: print_checked(checked))
    return 1 if checked.problems else 0
