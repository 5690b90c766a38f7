"""Options of the arm, and of how tables and logs are read."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from urmpipe.options.grouped import Command, grouped, names_of, with_options
from urmpipe.options.types import DURATION, ROBOT, NamesType, OffsetType, OneOf
from urmpipe_models.errors import shown

if TYPE_CHECKING:
    from urmpipe_models.chains.chain import Chain
    from urmpipe_models.orientation import RotationForm
    from urmpipe_models.transform import Transform
    from urmpipe_pipeline.sources import LogMap, ReadOptions

FORMS = ["vector", "rpy", "zyx", "xyz", "zyz", "zxz", "quat_xyzw", "quat_wxyz", "matrix"]
"""Forms of a recorded orientation (a test holds them against those of the models)."""


@dataclass(frozen=True, kw_only=True)
class PlacingOptions:
    """What the options say of where an arm stands, begins and ends.

    Attributes:
        base: Where the arm stands in the world.
        tool: The tool centre point in the tip's frame.
        base_link: Link of a URDF where the arm begins.
        tip: Link of a URDF where it ends.
    """

    base: Transform | None
    tool: Transform | None
    base_link: str | None
    tip: str | None

    def arm(self, robot: str | None) -> Chain | None:
        """Return a robot so placed and cut; None without one.

        Raises:
            RobotError: If there is no such robot, or with everything that is wrong with its file.
            OptionError: If it is to be placed, but there is none.
        """
        from urmpipe.guards import place_robot

        return place_robot(robot, self.base, self.tool, base_link=self.base_link, tip_link=self.tip)


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What options and map together say of tables.

    Attributes:
        arm: The arm, if there is one.
        robot: Its name or file.
        options: How a table is read.
        files: The files that said so: no output replaces them.
    """

    arm: Chain | None
    robot: str | None
    options: ReadOptions
    files: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True)
class TableOptions(PlacingOptions):
    """What the options say of how any table is read, and of the arm that it is about.

    Attributes:
        robot: Name or file of the arm.
        log_map: The map that says what no option says.
        The others are those of `urmpipe.ReadOptions`.
    """

    robot: str | None
    log_map: Path | None
    rotation: RotationForm | None
    delimiter: str | None
    decimal: str | None
    time: str | None
    units: dict[str, str] | None

    def reading(self) -> Reading:
        """Return what options and map say; the command line comes before the map.

        Raises:
            UrmpipeError: With everything that is wrong with the robot or the map.
        """
        from urmpipe_pipeline.sources import LogMap, read_map
        from urmpipe_pipeline.sources.options import read_options

        log_map = read_map(self.log_map) if self.log_map else LogMap()
        robot = self.robot or log_map.robot
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return Reading(
            self._placed_as(log_map).arm(robot),
            robot,
            read_options(values, log_map.read),
            (self.log_map,) if self.log_map else (),
        )

    def _placed_as(self, log_map: LogMap) -> PlacingOptions:
        """Return these options with base and tool of a map where none is given."""
        from urmpipe_models.transform import from_offset

        base = from_offset(log_map.base) if log_map.base else None
        tool = from_offset(log_map.tool) if log_map.tool else None
        return replace(self, base=self.base or base, tool=self.tool or tool)


@dataclass(frozen=True, kw_only=True)
class LogOptions(TableOptions):
    """What the options say of how a log is read; the attributes are those of `urmpipe.ReadOptions`."""

    source: str | None
    joints: tuple[str, ...] | None
    period: float | None
    interval: dict[str, tuple[float, float]] | None
    repair: bool
    skip_bad: bool


OF_LOGS = {*names_of(LogOptions), "tsp", "derivative"} - {*names_of(PlacingOptions), "robot"}
"""Parameters that say how a log becomes a run: a recording is one already."""


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
    "--map",
    "log_map",
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
    click.option("--tip", metavar="LINK", help="Link of a URDF where the arm ends [default: its end]."),
)
TABLE = (
    MAP_OPTION,
    click.option("--rotation", type=OneOf(FORMS), help="Form of the recorded orientation, if it is open."),
    click.option(
        "--delimiter",
        metavar="comma|semicolon|tab|spaces|bar",
        help="What parts the columns, or the sign itself in quotes.",
    ),
    click.option("--decimal", type=OneOf(["point", "comma", ".", ","]), help="The decimal sign."),
    click.option("--time", metavar="COLUMN", help="The time column."),
    click.option(
        "--unit",
        "units",
        multiple=True,
        callback=_units,
        metavar="[COLUMN=]UNIT",
        help="Unit of the joint angles (rad, deg), or of one column.",
    ),
)
LOG = (
    click.option("--source", metavar="NAME", help="Who wrote the log: coppeliasim, solidworks, ..."),
    click.option("--joints", type=NamesType(), help="The joint columns, in the robot's order."),
    *TABLE,
    click.option("--period", type=DURATION, help="Period of a log without a time column [default: 5ms]."),
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
    click.option("--tsp", type=DURATION, help="Period of the grid [default: the log's own]."),
    click.option(
        "--derivative",
        type=OneOf(["central", "savgol"]),
        help="How joints are differentiated [default: by the digits].",
    ),
    click.option("--skip-bad", is_flag=True, help="Leave out rows that cannot be read, up to 1 %."),
)


def placing_options(command: Command) -> Command:
    """Add what places and cuts an arm; the command takes it as `placing`."""
    return with_options(grouped(PlacingOptions, "placing")(command), *PLACING)


def table_options(command: Command) -> Command:
    """Add the arm, and how any table is read; the command takes them as `table`."""
    return with_options(
        grouped(TableOptions, "table")(command), STRICT_OPTION, *TABLE, ROBOT_OPTION, *PLACING
    )


def log_options(command: Command) -> Command:
    """Add the arm, and how a log is read, which the command takes as `log`; --tsp, --derivative, --strict."""
    return with_options(grouped(LogOptions, "log")(command), ROBOT_OPTION, *PLACING, *LOG, STRICT_OPTION)
