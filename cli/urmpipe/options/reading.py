"""Options of the arm, and of how tables and logs are read: each is a keyword of the public functions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from urmpipe.options.grouped import Command, with_options
from urmpipe.options.types import DURATION, ROBOT, NamesType, OffsetType, OneOf
from urmpipe_models.errors import shown

FORMS = ["vector", "rpy", "zyx", "xyz", "zyz", "zxz", "quat_xyzw", "quat_wxyz", "matrix"]
"""Forms of a recorded orientation (a test holds them against those of the models)."""


def _units(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str] | None:
    """Return UNIT (all joint angles) and COLUMN=UNIT options as a mapping."""
    units: dict[str, str] = {}
    for value in values:
        column, _, unit = value.rpartition("=")
        several = value.split(",")
        if len(several) > 1 and all("=" in one for one in several):
            apart = " ".join(f"--unit {one.strip()}" for one in several)
            raise click.BadParameter(f"found {value!r}, allowed: one COLUMN=UNIT an option: {apart}")
        if units.setdefault(column, unit) != unit:
            found = f"found {units[column]} and {unit} {f'for {column}' if column else 'without a column'}"
            raise click.BadParameter(f"{found}, allowed: one; that of another column as COLUMN=UNIT")
    return units or None


def _intervals(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, tuple[float, float]] | None:
    """Return LOW:HIGH (all joints that turn) and JOINT=LOW:HIGH options as a mapping."""
    intervals = {}
    for value in values:
        joint, _, ends = value.rpartition("=")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            raise click.BadParameter(f"found {shown(value)}, allowed: LOW:HIGH or JOINT=LOW:HIGH") from None
        intervals[joint] = low, high
    return intervals or None


ROBOT_OPTION = click.option(
    "--robot", type=ROBOT, help="The arm: a name of `urmpipe robot list`, a TOML or a URDF."
)
MAP_OPTION = click.option(
    "--log-map",
    "--map",
    metavar="FILE.toml",
    type=click.Path(dir_okay=False, path_type=Path),
    help="How to read the log, as ingest --write-map wrote it; options given here come first.",
)
STRICT_OPTION = click.option("--strict", is_flag=True, help="Warnings are errors (exit 2).")

PLACING = (
    click.option("--base", type=OffsetType(), help="Where the arm stands in the world (m, rad)."),
    click.option(
        "--tool", type=OffsetType(), help="Tool centre point in the tip's frame (m, rad), as 0,0,150mm."
    ),
    click.option("--base-link", metavar="LINK", help="Link of a URDF where it begins [default: the root]."),
    click.option(
        "--tip-link", "--tip", metavar="LINK", help="Link of a URDF where the arm ends [default: its end]."
    ),
)


def _unit_option(help: str) -> Callable[[Command], Command]:
    """Return the option --unit."""
    return click.option("--unit", multiple=True, callback=_units, metavar="[COLUMN=]UNIT", help=help)


UNTIMED = (
    MAP_OPTION,
    click.option("--rotation", type=OneOf(FORMS), help="Form of the recorded orientation, if it is open."),
    click.option(
        "--delimiter",
        metavar="comma|semicolon|tab|spaces|bar",
        help="What parts the columns, or the sign itself in quotes.",
    ),
    click.option("--decimal", type=OneOf(["point", "comma", ".", ","]), help="The decimal sign."),
)


def _of_table(time: str) -> tuple[Callable[[Command], Command], ...]:
    """Return the options of a table; `time` is what --time takes."""
    return (
        *UNTIMED,
        click.option("--time", metavar=time, help="The time column; none if there is none."),
        _unit_option("Unit of angles whose names tell none (rad, deg), or of one column."),
    )


TABLE = _of_table("COLUMN")
ROWS = (
    click.option("--source", metavar="NAME", help="Who wrote the log: coppeliasim, solidworks, ..."),
    click.option(
        "--joints", type=NamesType(), help="The joint columns, in the robot's order; of numbers also 2-7."
    ),
    *_of_table("[FILE:]COLUMN"),
    click.option(
        "--layout",
        metavar="table|transposed|flat:N|flat-by-joint:N",
        help="What rows are: samples, joints, or numbers one by one, N a sample [default: table].",
    ),
    click.option("--period", type=DURATION, help="Period of a log without a time column [default: 5ms]."),
    click.option("--skip-bad", is_flag=True, help="Leave out rows that cannot be read, up to 1 %."),
)
JOINTS = (
    click.option(
        "--interval",
        multiple=True,
        callback=_intervals,
        metavar="[JOINT=]LOW:HIGH",
        help="What the joints are limited to, in their own unit [default: by the wraps].",
    ),
    click.option(
        "--repair", is_flag=True, help="Put samples that were left on a wrap on the line of their neighbours."
    ),
    click.option("--poses", is_flag=True, default=None, help="The rows are still poses: they have no time."),
    click.option(
        "--measured",
        type=NamesType(),
        help="Columns of the tool measured from outside: x, y, z[, orientation].",
    ),
    click.option("--tsp", type=DURATION, help="Period of the grid [default: the log's own]."),
    click.option(
        "--derivative",
        type=OneOf(["central", "savgol"]),
        help="How joints are differentiated [default: by the digits].",
    ),
)

OF_LOGS = {
    "log_map", "rotation", "delimiter", "decimal", "time", "unit", "source", "joints", "layout", "period",
    "skip_bad", "interval", "repair", "poses", "measured", "tsp", "derivative",
}  # fmt: skip
"""Parameters that say how a log becomes a run: a recording is one already."""


def placing_options(command: Command) -> Command:
    """Add what places and cuts an arm."""
    return with_options(command, *PLACING)


def table_options(command: Command) -> Command:
    """Add the arm, how any table is read, and --strict."""
    return with_options(command, STRICT_OPTION, *TABLE, ROBOT_OPTION, *PLACING)


def path_options(command: Command) -> Command:
    """Add the arm, how the rows of a path are read, and --strict."""
    unit = _unit_option("Unit of x, y, z and r (mm), of angles (deg), or of one column (COLUMN=mm).")
    return with_options(command, STRICT_OPTION, *UNTIMED, unit, ROBOT_OPTION, *PLACING)


def row_options(command: Command) -> Command:
    """Add how the rows of logs are read."""
    return with_options(command, *ROWS)


def log_options(command: Command) -> Command:
    """Add the arm, how a log becomes a run, and --strict."""
    return with_options(command, ROBOT_OPTION, *PLACING, *ROWS, *JOINTS, STRICT_OPTION)
