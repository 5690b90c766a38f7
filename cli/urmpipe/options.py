"""Options that several commands share."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from urmpipe import __version__

if TYPE_CHECKING:
    from urmpipe_models.chains.chain import Chain
    from urmpipe_pipeline.sources import ReadOptions

Command = TypeVar("Command", bound=Callable[..., Any])


class RobotType(click.ParamType[str]):
    """A robot's name in the catalogue, or a TOML or URDF file; names complete in the shell."""

    name = "NAME|FILE"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the catalogue's names and then files."""
        from urmpipe_models.robots.catalogue import robot_names

        names = [CompletionItem(name) for name in robot_names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


class OffsetType(click.ParamType[Any]):
    """A frame as X,Y,Z or X,Y,Z,RX,RY,RZ in m and rad."""

    name = "X,Y,Z[,RX,RY,RZ]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the transform."""
        from urmpipe_models.robots.catalogue import parse_offset

        return parse_offset(value) if isinstance(value, str) else value


class NamesType(click.ParamType[Any]):
    """Some names, parted by commas."""

    name = "A,B,C"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the names as a tuple."""
        return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value


class JointValuesType(click.ParamType[tuple[float, ...]]):
    """Joint values as Q1,Q2,... in rad and m, one for each joint in the robot's order."""

    name = "Q1,Q2,..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """Return the values."""
        if isinstance(value, tuple):
            return value
        try:
            values = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            values = ()
        if not values or not all(map(math.isfinite, values)):
            self.fail(f"found {value!r}, allowed: numbers in rad and m, such as 0,3.14,0.5", param, ctx)
        return values


class QuantityType(click.ParamType[float]):
    """A positive number in the SI unit, or with its unit behind it: 0.005 or 5ms."""

    def __init__(self, name: str, units: dict[str, float], example: str) -> None:
        self.name = name
        self.units = {"": 1.0} | units
        self.example = example

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the quantity in SI."""
        if isinstance(value, float):
            return value
        match = re.fullmatch(r"(.*?)\s*([a-z]*)", str(value).strip())
        try:
            number = float(match[1]) * self.units[match[2]] if match else math.nan
        except (ValueError, KeyError):
            number = math.nan
        if not 0.0 < number < math.inf:
            self.fail(f"found {value!r}, allowed: {self.example}", param, ctx)
        return number


DURATION = QuantityType(
    "SECONDS", {"s": 1.0, "ms": 1e-3, "us": 1e-6}, "a positive time in s, such as 0.005 or 5ms"
)


def _units(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str] | None:
    """Return UNIT (all joint angles) and COLUMN=UNIT options as a mapping."""
    pairs = (value.rpartition("=") for value in values)
    return {column: unit for column, _, unit in pairs} or None


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
            raise click.BadParameter(f"found {value!r}, allowed: LOW:HIGH or JOINT=LOW:HIGH") from None
        intervals[joint] = low, high
    return intervals or None


def placing_options(command: Command) -> Command:
    """Add what places and cuts an arm: --base, --tool, --base-link, --tip."""
    for option in (
        click.option("--tip", metavar="LINK", help="Link of a URDF where the arm ends [default: its end]."),
        click.option(
            "--base-link", metavar="LINK", help="Link of a URDF where it begins [default: the root]."
        ),
        click.option("--tool", type=OffsetType(), help="Tool centre point in the tip's frame (m, rad)."),
        click.option("--base", type=OffsetType(), help="Where the arm stands in the world (m, rad)."),
    ):
        command = option(command)
    return command


def robot_options(command: Command) -> Command:
    """Add --robot and what places and cuts it."""
    robot = click.option(
        "--robot", type=RobotType(), help="The arm: a name of the catalogue, a TOML or a URDF."
    )
    return robot(placing_options(command))


def take_robot(options: dict[str, Any]) -> Chain | None:
    """Take the options of `robot_options` out of some others; return the arm they stand for.

    Raises:
        RobotError: If there is no such robot, or with everything that is wrong with its file.
        OptionError: If an option needs a robot and none is given.
    """
    from urmpipe.guards import place_robot

    names = ("robot", "base", "tool", "base_link", "tip")
    robot, base, tool, base_link, tip = (options.pop(name) for name in names)
    return place_robot(robot, base, tool, base_link=base_link, tip_link=tip)


READING = (
    "source", "log_map", "rotation", "delimiter", "decimal", "time", "joints", "units", "period", "interval",
    "repair", "tsp", "derivative", "skip_bad",
)  # fmt: skip
"""Parameters of `log_options` that say how a log becomes a run: a recording is one already."""

FORMS = ["vector", "rpy", "zyx", "xyz", "zyz", "zxz", "quat_xyzw", "quat_wxyz", "matrix"]
"""Forms of a recorded orientation (a test holds them against those of the models)."""


def take_log_options(options: dict[str, Any]) -> tuple[Chain | None, ReadOptions]:
    """Take robot, map and reading options out of some others; return the arm and how to read a log.

    What is given on the command line comes before what the map says. The arm's name or file stays among the
    options as `robot_named`.

    Raises:
        UrmpipeError: With everything that is wrong with the robot or the map.
    """
    from urmpipe_models.transform import from_offset
    from urmpipe_pipeline.sources import LogMap, read_map
    from urmpipe_pipeline.sources.options import read_options

    path = options.pop("log_map")
    log_map = read_map(path) if path else LogMap()
    options["robot"] = options["robot_named"] = options["robot"] or log_map.robot
    for name, frame in (("base", log_map.base), ("tool", log_map.tool)):
        if options[name] is None and frame:
            options[name] = from_offset(frame)
    return take_robot(options), read_options(options, log_map.read)


def strict_option(command: Command) -> Command:
    """Add --strict."""
    return click.option("--strict", is_flag=True, help="Warnings are errors (exit 2).")(command)


def table_options(command: Command) -> Command:
    """Add the options that say how any table is read: its map, columns, units and signs."""
    for option in (
        click.option(
            "--unit",
            "units",
            multiple=True,
            callback=_units,
            metavar="[COLUMN=]UNIT",
            help="Unit of the joint angles (rad, deg), or of one column.",
        ),
        click.option("--time", metavar="COLUMN", help="The time column."),
        click.option("--decimal", type=click.Choice([".", ","]), help="The decimal sign."),
        click.option("--delimiter", metavar="CHAR", help="What parts the columns: , ; tab space."),
        click.option(
            "--rotation", type=click.Choice(FORMS), help="Form of the recorded orientation, if it is open."
        ),
        click.option(
            "--map",
            "log_map",
            type=click.Path(dir_okay=False, path_type=Path),
            help="How to read these logs (TOML); options given here come first.",
        ),
    ):
        command = option(command)
    return command


def log_options(command: Command) -> Command:
    """Add the options of every command that takes a log."""
    for option in (
        strict_option,
        click.option("--skip-bad", is_flag=True, help="Leave out rows that cannot be read, up to 1 %."),
        click.option(
            "--derivative",
            type=click.Choice(["central", "savgol"]),
            help="How joints are differentiated [default: by the digits].",
        ),
        click.option("--tsp", type=DURATION, help="Period of the grid [default: the log's own]."),
        click.option(
            "--repair",
            is_flag=True,
            help="Put samples that were left on a wrap on the line of their neighbours.",
        ),
        click.option(
            "--interval",
            multiple=True,
            callback=_intervals,
            metavar="[JOINT=]LOW:HIGH",
            help="What the joints are limited to, in their own unit [default: by the wraps].",
        ),
        click.option("--period", type=DURATION, help="Period of a log without a time column [default: 5ms]."),
        table_options,
        click.option("--joints", type=NamesType(), help="The joint columns, in the robot's order."),
        click.option("--source", metavar="NAME", help="Who wrote the log: coppeliasim, solidworks, ..."),
    ):
        command = option(command)
    return robot_options(command)


def _tell_defaults(ctx: click.Context, param: click.Parameter, quiet: bool) -> bool:
    """Tell what urmpipe.toml says for the command, before anything in it can be found to be wrong."""
    if ctx.obj and not quiet:
        from urmpipe.printing.terminal import say

        say(ctx.obj, err=True)
    return quiet


def about_recordings(ctx: click.Context, operands: Sequence[Path]) -> str | None:
    """Return what is to be said of options that say how a log is read, and of recordings among the operands.

    Args:
        ctx: The command's context, which knows what was given on the command line.
        operands: Recordings, logs and folders of them.

    Raises:
        UsageError: If no operand is a log.
    """
    from urmpipe_pipeline.recording import is_recording

    given = [
        max(param.opts, key=len)
        for param in ctx.command.params
        if param.name in READING and ctx.get_parameter_source(param.name) == ParameterSource.COMMANDLINE
    ]
    recordings = [str(path) for path in operands if path.is_file() and is_recording(path)]
    if not given or not recordings:
        return None
    options, files = ", ".join(given), ", ".join(recordings)
    if len(recordings) == len(operands):
        allowed = "with a log among them; a recording stands as it was ingested"
        raise click.UsageError(f"{options}: found with recordings alone ({files}), allowed: {allowed}")
    return f"{options} of the logs alone: {files} as ingested"


def output_options(command: Command) -> Command:
    """Add --json, -q, --debug and --version."""
    for option in (
        click.version_option(__version__, prog_name="urmpipe"),
        click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error."),
        click.option(
            "-q",
            "--quiet",
            is_flag=True,
            is_eager=True,
            callback=_tell_defaults,
            help="Print nothing but errors.",
        ),
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object on standard output."),
    ):
        command = option(command)
    return command
