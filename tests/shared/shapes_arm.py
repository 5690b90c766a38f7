"""An arm whose links have shapes of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def arm_of_shapes(folder: Path) -> Path:
    """Write a URDF of six turning joints, its links a box, a cylinder, a mesh, ... each in its own colour.

    The first four shapes lie around z = 0.1 m of the frame that carries them, as far as 0.1 m from it.
    """
    (folder / "meshes").mkdir()
    (folder / "meshes" / "bar.stl").write_bytes(box_stl((0.05, 0.05, 0.2)))
    shapes = [
        ("0.4 0.4 0.4", "0 0 -0.05", '<box size="0.3 0.3 0.1"/>'),
        ("1 0.2 0.2", "0 0 0.1", '<cylinder radius="0.06" length="0.2"/>'),
        ("0.2 1 0.2", "0 0 0.1", '<box size="0.08 0.08 0.2"/>'),
        ("0.2 0.4 1", "-0.025 -0.025 0", '<mesh filename="meshes/bar.stl"/>'),
        ("1 1 0.2", "0 0 0.1", '<capsule radius="0.04" length="0.12"/>'),
        ("0.2 1 1", "0 0 0", '<sphere radius="0.06"/>'),
        ("0.9 0.9 0.9", "0 0 0", '<sphere radius="0.05"/>'),
    ]
    axes = ["0 0 1", "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1"]  # those that turn far, along the arm
    lines = ['<robot name="shapes">']
    for k, (colour, place, shape) in enumerate(shapes):
        material = f'<material name="m{k}"><color rgba="{colour} 1"/></material>'
        visual = f'<visual><origin xyz="{place}"/><geometry>{shape}</geometry>{material}</visual>'
        lines.append(f'<link name="link{k}">{visual}</link>')
    for k, axis in enumerate(axes, start=1):
        ends = f'<parent link="link{k - 1}"/><child link="link{k}"/>'
        frame = f'<origin xyz="0 0 {0.2 if k > 1 else 0}"/><axis xyz="{axis}"/>'
        lines.append(f'<joint name="turn{k}" type="continuous">{ends}{frame}</joint>')
    path = folder / "shapes.urdf"
    path.write_text("\n".join([*lines, "</robot>"]), encoding="utf-8")
    return path


def box_stl(size: tuple[float, float, float]) -> bytes:
    """Return a box with a corner at the origin as binary STL."""
    corners = np.array([[x, y, z] for x in (0, size[0]) for y in (0, size[1]) for z in (0, size[2])])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([corner for a, b, c, d in sides for corner in ((a, b, c), (a, c, d))])
    facets = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    facets["corners"] = corners[triangles]
    return bytes(80) + np.uint32(len(facets)).tobytes() + facets.tobytes()
