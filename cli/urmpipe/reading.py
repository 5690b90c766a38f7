"""The arm and the reading of a log that options state, or else a map."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from urmpipe.arm_placing import Robot, place_robot
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import map_collecting_errors
from urmpipe_models.math3d import from_offset
from urmpipe_pipeline.logs import LogMap, read_map
from urmpipe_pipeline.logs.log_map import read_options


@dataclass(frozen=True, slots=True, eq=False)
class ResolvedReading:
    """The arm and the reading that options and map state together.

    Attributes:
        arm: The arm on its base, with its tool and cut; None without one.
        robot: The robot as it was given.
        options: How a table is read.
    """

    arm: Chain | None
    robot: Robot | None
    options: LogMap


def resolve_reading(options: Mapping[str, Any], robot: Robot | None = None) -> ResolvedReading:
    """Return the arm and the reading that options and their map state; the options come before the map.

    Args:
        options: Values of the parameters `Placing` and `Reading`.
        robot: Name, file or chain of the arm.

    Raises:
        UrmpipeError: With everything that is wrong with the map, the arm or an option.
    """
    log_map = _read_map(options)
    arm = robot if robot is not None else log_map.robot
    base, tool = (
        frame if frame is not None or not offset else from_offset(offset)
        for frame, offset in ((options.get("base"), log_map.base), (options.get("tool"), log_map.tool))
    )
    links = {"base_link": options.get("base_link"), "tip_link": options.get("tip_link")}
    parts: tuple[Callable[[], Any], ...] = (
        lambda: place_robot(arm, base, tool, **links),
        lambda: read_options(options, replace(log_map, robot=None, base=(), tool=())),
    )
    chain, read = map_collecting_errors(lambda part: part(), parts)
    return ResolvedReading(chain, arm, read)


def to_log_map(options: Mapping[str, Any]) -> LogMap:
    """Return how a table is read, as options and their map state, without their arm.

    Raises:
        UrmpipeError: With everything that is wrong with the map or an option.
    """
    return read_options(options, _read_map(options))


def _read_map(options: Mapping[str, Any]) -> LogMap:
    log_map = options.get("map")
    return (
        log_map if isinstance(log_map, LogMap) else LogMap() if log_map is None else read_map(Path(log_map))
    )


def map_files(options: Mapping[str, Any]) -> list[Path]:
    """Return the file of the map among options, if there is one: no output replaces it."""
    log_map = options.get("map")
    return [] if log_map is None or isinstance(log_map, LogMap) else [Path(log_map)]
