"""Catalogue of robots, and the robot of a name or a file."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path

from urmpipe_datasets import ROBOTS
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import OptionError, RobotError, format_suggestion, format_value
from urmpipe_models.math3d import Transform, from_offset
from urmpipe_models.robots.toml import read_robot_file
from urmpipe_models.robots.urdf import read_urdf


def robot_names() -> tuple[str, ...]:
    """Return the names of the catalogue, families together and small arms first."""

    def by_size(name: str) -> tuple[str, str, int]:
        """Order urm4 before urm6, ur5 before ur10, and ur10 before ur3e."""
        family, size, generation = re.fullmatch(r"(\D*)(\d*)(.*)", name).groups()  # type: ignore[union-attr]
        return family, generation, int(size or 0)

    return tuple(sorted((path.stem for path in ROBOTS.glob("*.toml")), key=by_size))


@cache
def kinematically_distinct_names() -> tuple[str, ...]:
    """Return the names without those of arms that differ from an earlier one in masses or drives only."""
    geometries = []
    names = []
    for name in robot_names():
        arm = _load_catalogue_robot(name)
        geometry = arm.joints, arm.base, arm.tip
        if geometry not in geometries:
            geometries.append(geometry)
            names.append(name)
    return tuple(names)


def load_robot(
    name_or_path: str | Path, *, base_link: str | None = None, tip_link: str | None = None
) -> Chain:
    """Return a robot of the catalogue, or of a .toml or .urdf file.

    Args:
        name_or_path: The robot's name, in capitals or not, or its file.
        base_link: Link of a URDF where the chain begins; its root by default.
        tip_link: Link of a URDF where the chain ends; see `read_urdf`.

    Raises:
        RobotError: If there is no such robot, or with all errors of its file.
        OptionError: If links are chosen of a robot that is no URDF.
    """
    path = Path(name_or_path)
    suffix = path.suffix.lower()
    if suffix in {".urdf", ".xacro"}:
        return read_urdf(path, base_link=base_link, tip_link=tip_link)
    if base_link or tip_link:
        raise OptionError(f"robot {name_or_path}: found a base or tip link, allowed only for a .urdf file")
    if suffix == ".toml":
        return read_robot_file(path)
    names = robot_names()
    if (name := str(name_or_path).lower()) in names:
        return _load_catalogue_robot(name)
    hint = format_suggestion(str(name_or_path), names)
    raise RobotError(
        f"unknown robot {format_value(str(name_or_path))}{hint};"
        f" allowed: {', '.join(names)}, or a .toml or .urdf file"
    )


@cache
def _load_catalogue_robot(name: str) -> Chain:
    """Return a robot of the catalogue, read once: a log may be compared with all of them."""
    return read_robot_file(ROBOTS / f"{name}.toml")


def parse_offset(text: str) -> Transform:
    """Return the frame of X,Y,Z or X,Y,Z,RX,RY,RZ, in [m] and [rad]: Rz(RZ) Ry(RY) Rx(RX).

    Raises:
        OptionError: If the text has another form.
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in {3, 6} or not all(map(math.isfinite, values)):
        raise OptionError(
            f"found {format_value(text)}, allowed: X,Y,Z or X,Y,Z,RX,RY,RZ in m and rad, such as 0,0,0.15"
        )
    return from_offset(values)
