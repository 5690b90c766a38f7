"""What an arm looks like: shapes on its frames, as a robot description tells them."""

from __future__ import annotations

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
    """A file of triangles in [m], times `scale`: `file` is a path, or a package:// that was not found."""

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
    """Return where a mesh file stands.

    Args:
        reference: A path, relative to the folder or absolute, or file://PATH, or package://PACKAGE/PATH. The
            folder of a package is looked for beside and above the folder of the description.
        folder: Where the description stands.

    Returns:
        An absolute path; a reference to a package that is not there as it was written.
    """
    if not reference.startswith(PACKAGE):
        path = unquote(reference.removeprefix(FILE)) if reference.startswith(FILE) else reference
        return str((folder / path).absolute())
    package, _, path = reference.removeprefix(PACKAGE).partition("/")
    above = folder.absolute()
    for place in (above, *above.parents):
        root = place if place.name == package else place / package
        if package and root.is_dir():
            return str(root / path)
    return reference
