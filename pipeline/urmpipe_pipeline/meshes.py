"""The mesh files that show what an arm looks like: which can be drawn, and what to say of the others."""

from __future__ import annotations

import json
from pathlib import Path

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.visual import Mesh, Visual
from urmpipe_pipeline.joint_log import LogWarning

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


def drawable(visual: Visual) -> bool:
    """Tell whether a shape can be drawn: a mesh if its file is there, of a known form, and needs no other."""
    if not isinstance(visual.shape, Mesh):
        return True
    path = Path(visual.shape.file)
    suffix = path.suffix.lower()
    try:
        there = suffix in MEDIA_TYPES and path.is_file()
    except OSError:  # such as a folder that may not be looked into
        return False
    return there and (suffix != ".gltf" or _self_contained(path))


def missing_visuals(robot: Chain) -> list[LogWarning]:
    """Return one warning if meshes of an arm cannot be drawn, with their number and the first of them."""
    meshes = {visual.shape.file: visual for visual in robot.visuals if isinstance(visual.shape, Mesh)}
    missing = [file for file, visual in meshes.items() if not drawable(visual)]
    if not missing:
        return []
    count = f"{len(missing)} of {len(meshes)} mesh files of robot {robot.name}"
    said = f"{count} cannot be drawn, the first {missing[0]}: lines stand for the links"
    return [LogWarning(VISUAL_MISSING, f"{said}; allowed: {', '.join(MEDIA_TYPES)} files that are there")]


def _self_contained(path: Path) -> bool:
    """Tell whether a glTF file names no other file, which would not be in the recording."""
    try:
        document = json.loads(path.read_bytes())
        parts = [*document.get("buffers", []), *document.get("images", [])]
        return all(part.get("uri", "data:").startswith("data:") for part in parts)
    except (OSError, ValueError, TypeError, AttributeError):  # cannot be read, or is no glTF
        return False
