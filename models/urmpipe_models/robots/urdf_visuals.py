"""What a link of a URDF looks like: its <visual> elements."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

from urmpipe_models.chains.visual import Box, Capsule, Colour, Cylinder, Mesh, Shape, Sphere, Visual
from urmpipe_models.files.xml_tree import Node
from urmpipe_models.robots.urdf_tree import STAND_IN, UrdfTree, numbers_of, origin_of

SHAPES = ("box", "cylinder", "capsule", "sphere", "mesh")
"""URDF's shapes, and the capsule that several of its readers know."""


def link_visuals(tree: UrdfTree, link: str, joint: str | None) -> Iterator[Visual]:
    """Yield what a link shows, but for what `write_urdf` itself put there to be looked at.

    Args:
        tree: The file; what is wrong is noted there.
        link: Name of the link.
        joint: Name of the joint that carries it; None for the base.
    """
    place = f"link {link}: visual"
    for node in tree.links[link].all("visual"):
        material = node.first("material")
        if material is not None and material.attributes.get("name") == STAND_IN:
            continue
        geometry = node.first("geometry")
        shapes = [child for child in geometry.children if child.tag in SHAPES] if geometry else []
        if len(shapes) != 1:
            found = (geometry and ", ".join(child.tag for child in geometry.children)) or "no shape"
            tree.fault(f"{place}: found {found}; allowed: one of {', '.join(SHAPES)}", node.line)
            continue
        shape = _shape(tree, shapes[0], f"{place}: {shapes[0].tag}")
        yield Visual(joint, shape, origin_of(tree, node, place), _colour(tree, material, place))


def _shape(tree: UrdfTree, node: Node, place: str) -> Shape:
    """Return the shape that an element describes, in [m]."""
    if node.tag == "mesh":
        scale = numbers_of(tree, node, place, "scale", (1.0, 1.0, 1.0))
        if not (file := node.attributes.get("filename", "")):
            tree.fault(f"{place}: no filename; allowed: one", node.line)
        return Mesh(file, cast("tuple[float, float, float]", scale))
    if node.tag == "box":
        return Box(cast("tuple[float, float, float]", _sizes(tree, node, place, "size", 3)))
    (radius,) = _sizes(tree, node, place, "radius")
    if node.tag == "sphere":
        return Sphere(radius)
    (length,) = _sizes(tree, node, place, "length")
    return Cylinder(radius, length) if node.tag == "cylinder" else Capsule(radius, length)


def _sizes(tree: UrdfTree, node: Node, place: str, attribute: str, count: int = 1) -> tuple[float, ...]:
    """Return sizes, which must be there and not be negative."""
    if attribute not in node.attributes:
        tree.fault(f"{place}: no {attribute}; allowed: one", node.line)
    sizes = numbers_of(tree, node, place, attribute, (0.0,) * count)
    if min(sizes) < 0.0:
        tree.fault(f"{place} {attribute}: found {min(sizes):g}; allowed: 0 or more", node.line)
    return sizes


def _colour(tree: UrdfTree, material: Node | None, place: str) -> Colour | None:
    """Return the colour of a material: its own, or that of the first of its name in the file."""
    if material is None:
        return None
    node = material.first("color") or tree.colours.get(material.attributes.get("name", ""))
    if node is None:
        return None
    rgba = numbers_of(tree, node, f"{place}: color", "rgba", (1.0, 1.0, 1.0, 1.0))
    return cast("Colour", tuple(min(max(share, 0.0), 1.0) for share in rgba))
