"""How a log or a table is read, and the arm that it is about: by keywords, or else as a map says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict

from urmpipe.arm_placing import Frame, Robot, place_robot
from urmpipe.keyword_checks import PathLike
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import map_collecting_errors
from urmpipe_models.math3d import RotationForm, from_offset
from urmpipe_pipeline.sources import LogMap, ReadOptions, read_map
from urmpipe_pipeline.sources.options import GivenInterval, read_options


class UntimedReading(TypedDict, total=False):
    """How a table without times is read where it does not show it itself; None means that it does.

    Attributes:
        log_map: A map (TOML) or what `read_map` returned; what is given beside it comes first.
        rotation: Form of the orientation.
        delimiter: Sign between cells, or comma, semicolon, tab, spaces, bar.
        decimal: Decimal sign, or point, comma.
        unit: Unit of every angle of which neither its name nor the kinematics tell one, such as "deg"; or by
            column, such as {"q1": "deg"}. Of targets and paths
            a length, such as "mm", is the unit of x, y, z.
    """

    log_map: PathLike | LogMap | None
    rotation: RotationForm | None
    delimiter: str | None
    decimal: str | None
    unit: str | Mapping[str, str] | None


class TableReading(UntimedReading, total=False):
    """How a table is read.

    Attributes:
        time: Name or number (from 1) of the time column; "none" if there is none.
    """

    time: str | int | None


class LogReading(TableReading, total=False):
    """How the rows of a log are read.

    Attributes:
        source: Who wrote the log: coppeliasim, solidworks, path, ...
        joints: Names or numbers (from 1) of the joint columns, in the robot's order.
        layout: What a row of the file is: "table" a sample, "transposed" a joint; of a flat array "flat:N" or
            "flat-by-joint:N", with N numbers a sample.
        period: Time between rows in [s], of a log without a time column.
        skip_bad: Leave out rows that cannot be read, up to one in a hundred; each is a warning.
    """

    source: str | None
    joints: Sequence[str | int] | None
    layout: str | None
    period: float | None
    skip_bad: bool


class Reading(LogReading, total=False):
    """How a log is read, and what its joints are limited to.

    Attributes:
        interval: LOW, HIGH that the environment limits all joints that turn to, in the file's own unit or as
            texts with units; or by joint, such as {"q1": (-180, 180)}.
        repair: Put samples that a linear resampling left on a wrap on the line of their neighbours.
        poses: The rows are still poses, which no motion joins: they have no time, and a clock is a label.
        measured: Columns of the tool centre point as it was measured from outside, in a frame of its own: x,
            y, z, and perhaps those of the orientation; names or numbers (from 1).
    """

    interval: GivenInterval | Mapping[str, GivenInterval] | None
    repair: bool
    poses: bool
    measured: Sequence[str | int] | None


@dataclass(frozen=True, slots=True, eq=False)
class Resolved:
    """What keywords and map together say.

    Attributes:
        arm: The arm on its base, with its tool and cut; None without one.
        robot: How it was given.
        options: How a table is read.
    """

    arm: Chain | None
    robot: Robot | None
    options: ReadOptions


def resolved(
    reading: Mapping[str, Any],
    robot: Robot | None = None,
    base: Frame | None = None,
    tool: Frame | None = None,
    base_link: str | None = None,
    tip_link: str | None = None,
    names: Sequence[str] | None = None,
) -> Resolved:
    """Return what keywords and map together say; the keywords come before the map.

    Args:
        reading: Keywords as in `Reading`.
        robot: Name, file or chain of the arm.
        base: Where it stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of its tip, likewise.
        base_link: Link of a URDF where it begins.
        tip_link: Link of a URDF where it ends.
        names: What to call the joints.

    Raises:
        UrmpipeError: With everything that is wrong with the map, the arm or a keyword.
    """
    log_map = _map_of(reading)
    arm = robot if robot is not None else log_map.robot
    base = base if base is not None or not log_map.base else from_offset(log_map.base)
    tool = tool if tool is not None or not log_map.tool else from_offset(log_map.tool)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: place_robot(arm, base, tool, base_link=base_link, tip_link=tip_link),
        lambda: read_options({**reading, "names": names}, log_map.read),
    )
    chain, options = map_collecting_errors(lambda make: make(), parts)
    return Resolved(chain, arm, options)


def options_of(reading: Mapping[str, Any]) -> ReadOptions:
    """Return how a table is read, as keywords and map say, without their arm.

    Raises:
        UrmpipeError: With everything that is wrong with the map or a keyword.
    """
    return read_options(reading, _map_of(reading).read)


def _map_of(reading: Mapping[str, Any]) -> LogMap:
    given = reading.get("log_map")
    return given if isinstance(given, LogMap) else LogMap() if given is None else read_map(Path(given))


def map_files(reading: Mapping[str, Any]) -> list[Path]:
    """Return the file of the map among reading keywords, if there is one: no output replaces it."""
    given = reading.get("log_map")
    return [] if given is None or isinstance(given, LogMap) else [Path(given)]
