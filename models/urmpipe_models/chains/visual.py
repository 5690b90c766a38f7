"""What an arm looks like: shapes on its frames, as a robot description tells them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TypeAlias
from urllib.parse import unquote

import numpy as np

from urmpipe_models.transform import Transform

Colour: TypeAlias = tuple[float, float, float, float]
"""Red, green, blue and opacity, each 0..1."""

PACKAGE, FILE = "package://", "file://"
"""What a reference to a mesh may begin with."""

PACKAGE_PATH = "ROS_PACKAGE_PATH"
"""The environment variable that lists folders of which meshes may be taken, as ROS has it."""


@dataclass(frozen=True, slots=True)
class Box:
    """A box around its origin, with its edges along the axes: `size` in [m]."""

    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder along z around its origin: `radius` and `length` in [m]."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Capsule:
    """A cylinder along z with half a ball at each end: `radius`, and `length` without the balls, in [m]."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball around its origin: `radius` in [m]."""

    radius: float


@dataclass(frozen=True, slots=True)
class Mesh:
    """A file of triangles in [m], times `scale`: `file` is a path, or a URL that `mesh_file` did not take."""

    file: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Shape: TypeAlias = Box | Cylinder | Capsule | Sphere | Mesh


@dataclass(frozen=True, slots=True)
class Visual:
    """A shape that a frame of the arm carries.

    Attributes:
        joint: Name of the joint whose moving frame carries it; None for the base of the arm.
        shape: What it is.
        origin: The shape's frame in the frame that carries it.
        colour: Its colour; None where the description gives none.
    """

    joint: str | None
    shape: Shape
    origin: Transform = field(default_factory=Transform)
    colour: Colour | None = None

    def faults(self) -> Iterator[str]:
        """Yield what no shape can have: a negative size, or a share of a colour beyond 0..1."""
        mesh = isinstance(self.shape, Mesh)  # a negative scale mirrors
        sizes: list[float] = [] if mesh else np.ravel([*asdict(self.shape).values()]).tolist()
        if any(size < 0.0 for size in sizes):
            yield f"a {type(self.shape).__name__.lower()} of negative size {min(sizes):g}; allowed: 0 or more"
        if self.colour is not None and not all(0.0 <= share <= 1.0 for share in self.colour):
            yield f"colour {', '.join(f'{share:g}' for share in self.colour)}; allowed: shares from 0 to 1"

    def located(self, folder: Path) -> Visual:
        """Return the same shape with its mesh file looked up from the folder of the description."""
        if not isinstance(self.shape, Mesh):
            return self
        return replace(self, shape=replace(self.shape, file=mesh_file(self.shape.file, folder)))


def mesh_file(reference: str, folder: Path) -> str:
    """Return where a mesh file stands, if a description in a folder may take it.

    A description takes files from its own folder, from the ROS package that it stands in, from those around,
    and from folders that the user lists in ROS_PACKAGE_PATH, all links followed: nothing else gets into a
    recording, whoever wrote the description. A ROS package is a folder with a file package.xml.

    Args:
        reference: A path, relative to the folder or absolute, or file://PATH, or package://PACKAGE/PATH.
        folder: Where the description stands.

    Returns:
        An absolute path; a reference to a package that is not there as it was written; of a file that may not
        be taken its URL, which begins with file://.
    """
    if "\0" in reference:  # which no path holds
        return reference
    folder = folder.absolute()
    if not reference.startswith(PACKAGE):
        path = unquote(reference.removeprefix(FILE)) if reference.startswith(FILE) else reference
        file, package = folder / path, next((one for one in folder.parents if _is_package(one)), folder)
    elif (root := _package(reference, folder)) is not None:
        file, package = root / reference.removeprefix(PACKAGE).partition("/")[2], root
    else:
        return reference
    roots = [folder, *([package] if _is_package(package) else []), *_listed_folders()]
    try:
        taken = any(file.resolve().is_relative_to(one.resolve()) for one in roots)
    except (OSError, RuntimeError):  # links in a circle
        taken = False
    return str(file) if taken else file.as_uri()


def _package(reference: str, folder: Path) -> Path | None:
    """Return the folder of the package of a reference: beside or above a folder, or a listed one."""
    name = reference.removeprefix(PACKAGE).partition("/")[0]
    if not name.strip("."):  # a step up is no name
        return None
    around = (one if one.name == name else one / name for one in (folder, *folder.parents))
    listed = (one if one.name == name else one / name for one in _listed_folders())
    return next((one for one in (*around, *listed) if one.is_dir()), None)


def _is_package(folder: Path) -> bool:
    return (folder / "package.xml").is_file()


def _listed_folders() -> list[Path]:
    """Return the folders that the user lists in ROS_PACKAGE_PATH."""
    return [Path(one).absolute() for one in os.environ.get(PACKAGE_PATH, "").split(os.pathsep) if one]
