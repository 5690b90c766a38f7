"""The robots that urmpipe brings along, and the one way to get a robot from a name or a file."""

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
    return tuple(sorted((path.stem for path in ROBOTS.glob("*.toml")), key=_by_size))


@cache
def kinematically_distinct_names() -> tuple[str, ...]:
    """Return the names without those of arms that move as an earlier one, and differ in masses or drives."""
    found: dict[str, Chain] = {}
    for name in robot_names():
        arm = _of_catalogue(name)
        if not any(
            (one.joints, one.base, one.tip) == (arm.joints, arm.base, arm.tip) for one in found.values()
        ):
            found[name] = arm
    return tuple(found)


def load_robot(
    name_or_path: str | Path, *, base_link: str | None = None, tip_link: str | None = None
) -> Chain:
    """Return a robot of the catalogue, or of a .toml or .urdf file.

    Args:
        name_or_path: The robot's name, in capitals or not, or its file.
        base_link: Link of a URDF where the chain begins; its root by default.
        tip_link: Link of a URDF where the chain ends; see `read_urdf`.

    Raises:
        RobotError: If there is no such robot, or with everything that is wrong with its file.
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
        return _of_catalogue(name)
    hint = format_suggestion(str(name_or_path), names)
    raise RobotError(
        f"unknown robot {format_value(str(name_or_path))}{hint};"
        f" allowed: {', '.join(names)}, or a .toml or .urdf file"
    )


@cache
def _of_catalogue(name: str) -> Chain:
    """Return a robot of the catalogue, read once: a log may be held against all of them."""
    return read_robot_file(ROBOTS / f"{name}.toml")


def parse_offset(text: str) -> Transform:
    """Return the frame written as X,Y,Z or X,Y,Z,RX,RY,RZ, in [m] and [rad]: Rz(RZ) Ry(RY) Rx(RX).

    Raises:
        OptionError: If the text is anything else.
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


def _by_size(name: str) -> tuple[str, str, int]:
    """Order urm4 before urm6, ur5 before ur10, and ur10 before ur3e."""
    family, size, generation = re.fullmatch(r"(\D*)(\d*)(.*)", name).groups()  # type: ignore[union-attr]
    return family, generation, int(size or 0)
