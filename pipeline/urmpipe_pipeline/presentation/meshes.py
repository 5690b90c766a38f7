"""The mesh files of an arm: which can be drawn, and warnings about the others."""

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
}  # of the meshes that the viewer reads, by suffix

VISUAL_MISSING = "visual-missing"  # kind of the warning about meshes that cannot be drawn

# Of meshes that a description may use; the name of the variable that lists folders follows.
ALLOWED_FOLDERS = "files in the folder of its description, in ROS packages around it, and in folders of"


def is_drawable(visual: Visual) -> bool:
    """Return whether a shape can be drawn: a mesh if its file exists, is readable and needs no other."""
    if not isinstance(visual.shape, Mesh):
        return True
    if visual.shape.file.startswith(FILE):  # the description may not use it
        return False
    path = Path(visual.shape.file)
    suffix = path.suffix.lower()
    try:
        exists = suffix in MEDIA_TYPES and path.is_file()
    except OSError:  # such as a folder that may not be searched
        return False
    return exists and (suffix != ".gltf" or _self_contained(path))


def mesh_warnings(robot: Chain) -> list[LogWarning]:
    """Return warnings about meshes of an arm that cannot be drawn, and about those that it may not use."""
    meshes = {visual.shape.file: visual for visual in robot.visuals if isinstance(visual.shape, Mesh)}
    outside = [file for file in meshes if file.startswith(FILE)]
    missing = [file for file, visual in meshes.items() if file not in outside and not is_drawable(visual)]
    problems = (
        (missing, "cannot be drawn", f"{', '.join(MEDIA_TYPES)} files that are there"),
        (outside, "are outside its folder and not drawn", f"{ALLOWED_FOLDERS} {PACKAGE_PATH}"),
    )
    return [
        LogWarning(
            VISUAL_MISSING,
            f"{len(files)} of {len(meshes)} mesh files of robot {robot.name} {problem}, the first"
            f" {unquote(files[0].removeprefix(FILE))}: solids stand for the links; allowed: {allowed}",
        )
        for files, problem, allowed in problems
        if files
    ]


def _self_contained(path: Path) -> bool:
    """Return whether a glTF file names no other file, which would not be in the recording."""
    try:
        document = parse_json(path.read_bytes())
        parts = [*document.get("buffers", []), *document.get("images", [])]
        return all(part.get("uri", "data:").startswith("data:") for part in parts)
    except (OSError, ValueError, TypeError, AttributeError):  # cannot be read, or is no glTF
        return False
