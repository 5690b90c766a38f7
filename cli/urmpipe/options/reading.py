"""Options of the arm, and of how tables and logs are read: each is a keyword of the public functions."""

from __future__ import annotations

from collections.abc import Callable

import click

from urmpipe.headings import Heading, option
from urmpipe.options.completion import columns, units, words
from urmpipe.options.grouped import Command, with_options
from urmpipe.options.types import DURATION, ROBOT, FileType, NamesType, OffsetType, OneOf
from urmpipe_models.errors import format_value, shell_quote

FORMS = ["vector", "rpy", "zyx", "xyz", "zyz", "zxz", "quat_xyzw", "quat_wxyz", "matrix"]
"""Forms of a recorded orientation (a test compares them with those of the models)."""

SOURCES = (
    "coppeliasim", "urmpipe", "network", "ur-rtde", "libfranka", "ros", "ros2", "fri", "kuka-rsi", "abb",
    "plotjuggler", "solidworks", "matlab", "path", "table",
)  # fmt: skip
"""Names of sources (a test compares them with those of the pipeline, which is slow to import)."""

DELIMITERS = ("comma", "semicolon", "tab", "spaces", "bar")
"""Names of column separators."""


def _units(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str] | None:
    """Return UNIT (all joint angles) and COLUMN=UNIT options as a mapping."""
    units: dict[str, str] = {}
    for value in values:
        column, _, unit = value.rpartition("=")
        several = value.split(",")
        if len(several) > 1 and all("=" in one for one in several):
            apart = " ".join(f"--unit {shell_quote(one.strip())}" for one in several)
            raise click.BadParameter(f"found {value!r}, allowed: one COLUMN=UNIT per option: {apart}")
        if units.setdefault(column, unit) != unit:
            found = f"found {units[column]} and {unit} {f'for {column}' if column else 'without a column'}"
            raise click.BadParameter(f"{found}, allowed: one unit, or that of a column as COLUMN=UNIT")
    return units or None


def _intervals(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, tuple[float | str, ...]] | None:
    """Return LOW:HIGH (all joints that turn) and JOINT=LOW:HIGH options as a mapping."""
    if not values:
        return None
    from urmpipe_pipeline.sources.options import is_interval

    intervals = {}
    for value in values:
        joint, _, ends = value.rpartition("=")
        found = tuple(map(_end, ends.split(":")))
        if not is_interval(found):
            allowed = "LOW:HIGH or JOINT=LOW:HIGH, in the file's unit or with units, such as -180deg:180deg"
            raise click.BadParameter(f"found {format_value(value)}, allowed: {allowed}")
        intervals[joint] = found
    return intervals


def _end(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


ROBOT_OPTION = option(
    Heading.ROBOT, "--robot", type=ROBOT, help="Robot: a name of `urmpipe robot list`, a TOML file or a URDF."
)
MAP_OPTION = option(
    Heading.READING,
    "--log-map",
    "--map",
    metavar="FILE.toml",
    type=FileType(".toml", dir_okay=False),
    help="Map of the log, written by ingest; other options override it.",
)
STRICT_OPTION = option(
    Heading.JUDGING, "--strict", is_flag=True, help="Treat warnings as errors (exit code 2)."
)

PLACING = (
    option(
        Heading.ROBOT,
        "--tool",
        type=OffsetType(),
        help="Tool centre point (TCP) in the frame of the arm's tip (m, rad), such as 0,0,150mm.",
    ),
    option(Heading.ROBOT, "--base", type=OffsetType(), help="Base of the arm in the world frame (m, rad)."),
    option(
        Heading.ROBOT,
        "--tip-link",
        "--tip",
        metavar="LINK",
        help="Last link of a URDF [default: its only end].",
    ),
    option(Heading.ROBOT, "--base-link", metavar="LINK", help="First link of a URDF [default: its root]."),
)


def _unit_option(help: str) -> Callable[[Command], Command]:
    """Return the option --unit."""
    return option(
        Heading.READING,
        "--unit",
        shell_complete=units,
        multiple=True,
        callback=_units,
        metavar="[COLUMN=]UNIT",
        help=help,
    )


UNTIMED = (
    option(
        Heading.READING,
        "--delimiter",
        metavar="|".join(DELIMITERS),
        shell_complete=words(*DELIMITERS),
        help="Column separator, by name or as the character itself in quotes.",
    ),
    option(Heading.READING, "--decimal", type=OneOf(["point", "comma", ".", ","]), help="Decimal separator."),
    option(
        Heading.READING,
        "--rotation",
        type=OneOf(FORMS),
        help="Form of the recorded orientation, where the column names leave it open.",
    ),
    MAP_OPTION,
)


def _of_table(time: str) -> tuple[Callable[[Command], Command], ...]:
    """Return the options of a table; `time` is what --time takes."""
    return (
        option(
            Heading.READING,
            "--time",
            metavar=time,
            shell_complete=columns("none"),
            help="Time column; none if the log has none.",
        ),
        _unit_option("Unit of angles (rad, deg) where the names give none, or unit of one column."),
        *UNTIMED,
    )


TABLE = _of_table("COLUMN")
ROWS = (
    option(
        Heading.READING,
        "--joints",
        type=NamesType(),
        shell_complete=columns(several=True),
        help="Joint columns in the robot's order: names, or column numbers such as 2-7.",
    ),
    *_of_table("[FILE:]COLUMN"),
    option(
        Heading.READING,
        "--source",
        metavar="NAME",
        shell_complete=words(*SOURCES),
        help="Program that wrote the log: coppeliasim, solidworks, ...",
    ),
    option(
        Heading.READING,
        "--period",
        type=DURATION,
        help="Sample period of a log without a time column [default: 5ms].",
    ),
    option(
        Heading.READING,
        "--layout",
        metavar="table|transposed|flat:N|flat-by-joint:N",
        shell_complete=words("table", "transposed", "flat:", "flat-by-joint:"),
        help="table: one sample per row; transposed: one joint per row; flat: a single list of numbers, N"
        " per sample [default: table].",
    ),
    option(Heading.READING, "--skip-bad", is_flag=True, help="Skip unreadable rows, at most 1 %."),
)
JOINTS = (
    option(
        Heading.READING,
        "--poses",
        is_flag=True,
        default=None,
        help="The rows are static poses without time.",
    ),
    option(
        Heading.READING,
        "--measured",
        type=NamesType(),
        shell_complete=columns(several=True),
        help="Columns of the tool position measured by an external device: x, y, z[, orientation].",
    ),
    option(
        Heading.PROCESSING,
        "--interval",
        multiple=True,
        callback=_intervals,
        metavar="[JOINT=]LOW:HIGH",
        shell_complete=columns(sign="="),
        help="Interval to which the program wraps the joint values, in their own unit or with units, such as"
        " -180deg:180deg [default: found from the wraps].",
    ),
    option(
        Heading.PROCESSING,
        "--repair",
        is_flag=True,
        help="Replace samples recorded in the middle of a wrap by interpolation.",
    ),
    option(
        Heading.PROCESSING,
        "--tsp",
        type=DURATION,
        help="Sample period of the time grid [default: the log's own].",
    ),
    option(
        Heading.PROCESSING,
        "--derivative",
        type=OneOf(["central", "savgol"]),
        help="Method of differentiation: central differences or a Savitzky-Golay filter [default: by the"
        " resolution of the log].",
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


def motion_log_options(command: Command) -> Command:
    """Add how a log that drives a network becomes a motion of its joints, and --strict."""
    return with_options(command, *ROWS, *JOINTS, STRICT_OPTION)
