"""The arm of a unit as a file in its FMU, so that a system draws the arm of an FMU like that of a unit."""

from __future__ import annotations

import tomllib
import zipfile
from pathlib import Path

from urmpipe_fmus.fmu_file import DAMAGED
from urmpipe_fmus.unit import Unit
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.robots.toml import chain_from_dict

ROBOT_FILE = "resources/robot.toml"


def robot_file(unit: Unit) -> dict[str, bytes]:
    """Return the file of the arm that a unit was made of, if it was."""
    robot = unit.recipe.arguments.get("robot") if unit.recipe else None
    return {ROBOT_FILE: robot.encode()} if isinstance(robot, str) else {}


def robot_in(fmu: Path) -> Chain | None:
    """Return the arm in an FMU that `open_fmu` accepted; None if it has none that can be read.

    Any tool may have made the FMU, and a file of this name in it is no fault.
    """
    try:
        with zipfile.ZipFile(fmu) as archive:
            return chain_from_dict(tomllib.loads(archive.read(ROBOT_FILE).decode()))
    except (*DAMAGED, KeyError, OSError, UrmpipeError):
        return None
