"""The mesh files that show what an arm looks like: which can be drawn, and what to say of the others."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote

from urmpipe_models.arm.chain import FILE, PACKAGE_PATH, Chain, Mesh, Visual
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.text import parse_json

MEDIA_TYPES = {
    ".stl": "model/stl",
    ".obj": "model/obj",
    ".glb": "model/gltf-binary",
    ".gltf": "model/gltf+json",
    ".dae": "model/vnd.collada+xml",
}
"""The meshes that the viewer reads, by the end of their name."""

VISUAL_MISSING = "visual-missing"
"""The kind of the warning about meshes that cannot be drawn."""


WITHIN = "files in the folder of its description, in ROS packages around it, and in folders of"
"""Which meshes a description may take, but for the name of the variable that lists folders."""


def drawable(visual: Visual) -> bool:
    """Tell whether a shape can be drawn: a mesh if its file is there, of a known form, and needs no other."""
    if not isinstance(visual.shape, Mesh):
        return True
    if visual.shape.file.startswith(FILE):  # the description may not take it
        return False
    path = Path(visual.shape.file)
    suffix = path.suffix.lower()
    try:
        there = suffix in MEDIA_TYPES and path.is_file()
    except OSError:  # such as a folder that may not be looked into
        return False
    return there and (suffix != ".gltf" or _self_contained(path))


def missing_visuals(robot: Chain) -> list[LogWarning]:
    """Return a warning about meshes of an arm that cannot be drawn, and one about those it may not take."""
    meshes = {visual.shape.file: visual for visual in robot.visuals if isinstance(visual.shape, Mesh)}
    outside = [file for file in meshes if file.startswith(FILE)]
    missing = [file for file, visual in meshes.items() if file not in outside and not drawable(visual)]
    found = (
        (missing, "cannot be drawn", f"{', '.join(MEDIA_TYPES)} files that are there"),
        (outside, "are outside its folder and not drawn", f"{WITHIN} {PACKAGE_PATH}"),
    )
    return [
        LogWarning(
            VISUAL_MISSING,
            f"{len(files)} of {len(meshes)} mesh files of robot {robot.name} {said}, the first"
            f" {unquote(files[0].removeprefix(FILE))}: solids stand for the links; allowed: {allowed}",
        )
        for files, said, allowed in found
        if files
    ]


def _self_contained(path: Path) -> bool:
    """Tell whether a glTF file names no other file, which would not be in the recording."""
    try:
        document = parse_json(path.read_bytes())
        parts = [*document.get("buffers", []), *document.get("images", [])]
        return all(part.get("uri", "data:").startswith("data:") for part in parts)
    except (OSError, ValueError, TypeError, AttributeError):  # cannot be read, or is no glTF
        return False
