"""URDF in: the serial chain between two links of a robot description.

1. `_choose_path`: the joints from the base link to the tip link; without a choice, from the root to the only
   end, or the end with the most moving joints.
2. `_chain_joint`, `_resolve_mimic`: the joints of the chain. A joint with a mimic has no coordinate: it
   follows the joint with a coordinate at the end of its mimics, m (m' q + o') + o.
3. `_carriers`: the links of the chain, and the joint that carries each. Joints that `write_urdf` added for
   base, tip and tool become these again.
4. `_link_visuals`, `_chain_masses`: <visual> and <inertial> of these links, in the frames that carry them.

The file itself, its links and joints, are in `urdf_tree`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, cast

from urmpipe_models.arm.chain import (
    Box,
    Capsule,
    Chain,
    Colour,
    Cylinder,
    Inertial,
    Joint,
    Mesh,
    Mimic,
    Shape,
    Sphere,
    Visual,
)
from urmpipe_models.dynamics.links import Symmetric, rotate_inertia
from urmpipe_models.errors import Finding, Hint, RobotError, format_names, format_suggestion, format_value
from urmpipe_models.math3d import Transform
from urmpipe_models.robots.urdf_tree import (
    BASE_JOINT,
    KINDS,
    MASS_JOINT,
    PLACEHOLDER_MATERIAL,
    TIP_JOINT,
    TOOL_JOINT,
    UNSUPPORTED_TYPES,
    Edge,
    Node,
    UrdfTree,
    read_numbers,
    read_origin,
    read_tree,
)

MOMENTS = (
    "ixx",
    "iyy",
    "izz",
    "ixy",
    "ixz",
    "iyz",
)  # attributes of <inertia>, in the order of `Inertial.inertia`
SHAPES = ("box", "cylinder", "capsule", "sphere", "mesh")  # those of URDF, and the capsule of several readers


class _Carrier(NamedTuple):
    """A link that a chain carries.

    Attributes:
        link: Its name.
        joint: Name of the joint of the chain whose moving frame carries it; None for the base.
        frame: The link in that frame.
        moves: Whether a joint before it moves.
    """

    link: str
    joint: str | None
    frame: Transform
    moves: bool


def read_urdf(path: str | Path, *, base_link: str | None = None, tip_link: str | None = None) -> Chain:
    """Return the chain from a base link to a tip link of a URDF file.

    Every joint between the two is kept, the fixed ones as frames that may carry a sensor. Only the
    three fixed joints that `write_urdf` adds for base, tip and tool become these again. The shapes of the
    links between the two are kept, too; mesh files are looked up but not opened. Masses are those of the
    links between the two, and of all links fixed to them; if one that moves has an error, none is kept
    (`Chain.mass_faults`).

    Args:
        path: The file.
        base_link: The link where the chain begins; the root by default.
        tip_link: The link where it ends. By default the only leaf; of several, the one with the most moving
            joints before it, if there is a single one and the arm carries no other moving joints.

    Raises:
        RobotError: With all errors of the file or of the choice of links.
    """
    tree = read_tree(Path(path))
    edges = _choose_path(tree, base_link, tip_link) if tree.sound else []
    joints = [_chain_joint(tree, edge, edges) for edge in edges]
    base, tool, tip = (
        _pop_fixed(joints, BASE_JOINT, 0),
        _pop_fixed(joints, TOOL_JOINT, -1),
        _pop_fixed(joints, TIP_JOINT, -1),
    )
    carriers = list(_carriers(edges, joints, base))
    visuals = [visual for carrier in carriers for visual in _link_visuals(tree, carrier)]
    inertials, left_out, mass_faults = _chain_masses(tree, carriers)
    if tree.faults:
        raise RobotError(*tree.faults)
    try:
        return Chain(
            tree.name,
            tuple(joints),
            tip=tip,
            base=base,
            tool=tool,
            source=Path(path).name,
            visuals=tuple(visual.with_resolved_mesh(Path(path).parent) for visual in visuals),
            inertials=inertials,
            left_out=left_out,
            mass_faults=mass_faults,
        )
    except RobotError as error:
        raise RobotError(*(replace(fault, file=tree.file) for fault in error.findings)) from error


def _choose_path(tree: UrdfTree, base: str | None, tip: str | None) -> list[Edge]:
    """Return the joints from base to tip; an empty list, and an error in the tree, without one."""
    known = [_is_link(tree, role, link) for role, link in (("base", base), ("tip", tip)) if link]
    root = base or _find_root(tree)
    if not all(known) or root is None:
        return []
    paths: dict[str, list[Edge]] = {root: []}  # the joints from the root to every link after it
    waiting = [root]
    while waiting:
        link = waiting.pop()
        for edge in tree.below(link):
            paths[edge.child] = [*paths[link], edge]
            waiting.append(edge.child)
    if tip is None:
        tip = _default_tip(tree, paths)
    elif tip not in paths:
        tree.fault(f"tip link {tip} does not follow base link {root}; allowed: {_join_names(paths)}")
    return paths.get(tip, []) if tip else []


def _is_link(tree: UrdfTree, role: str, link: str) -> bool:
    """Return whether a chosen link is in the file; if not, add an error."""
    if link in tree.links:
        return True
    hint = format_suggestion(link, tree.links)
    allowed = format_names(link, tree.links)
    tree.fault(f"{role} link {format_value(link)} is not in the file{hint}; allowed: {allowed}")
    return False


def _find_root(tree: UrdfTree) -> str | None:
    """Return the only link without a joint before it; None, and an error in the tree, without one."""
    children = {edge.child for edge in tree.edges.values()}
    roots = [link for link in tree.links if link not in children]
    if len(roots) == 1:
        return roots[0]
    message = f"{len(roots)} root links: {_join_names(roots)}" if roots else "no link"
    tree.fault(f"found {message}; allowed: one root, or a base link chosen by name")
    return None


def _default_tip(tree: UrdfTree, paths: dict[str, list[Edge]]) -> str | None:
    """Return the end with the most moving joints before it; None, and an error in the tree, if ambiguous."""
    fixed = [edge for edge in tree.edges.values() if edge.type == "fixed"]
    masses = {edge.child for edge in fixed if edge.joint.name.startswith(MASS_JOINT)}
    parents = {edge.parent for edge in tree.edges.values() if edge.child not in masses}
    moving = {
        link: sum(map(_has_coordinate, path)) for link, path in paths.items() if link not in parents | masses
    }
    longest = [link for link, count in moving.items() if count == max(moving.values())]
    if len(longest) > 1:
        message = f"found {len(longest)} ends with {moving[longest[0]]} moving joints"
        tree.fault(message, hints=(_tip_hint(moving),))
        return None
    tip = longest[0]
    forks = {edge.joint.name: fork for edge, fork in _iter_branches(paths, tip)}
    if forks:
        names = _join_names(forks)
        message = f"found {names} on the arm beside the way to {tip}, as of a gripper"  # plain: ok
        tree.fault(message, hints=(_tip_hint(dict.fromkeys((*forks.values(), *moving))),))
        return None
    return tip


def _tip_hint(links: Iterable[str]) -> Hint:
    return Hint("tip_link", None, f"chooses one: {_join_names(links)}")


def _iter_branches(paths: dict[str, list[Edge]], tip: str) -> Iterator[tuple[Edge, str]]:
    """Yield the moving joints on branches that moving joints of the arm carry, and the link of the fork."""
    arm = paths[tip]
    for path in paths.values():
        if not path or path[-1] in arm or path[-1].joint.kind == "fixed":
            continue
        common = [edge for edge, other in zip(arm, path, strict=False) if edge is other]
        if any(map(_has_coordinate, common)):
            yield path[-1], common[-1].child


def _has_coordinate(edge: Edge) -> bool:
    return edge.joint.kind != "fixed" and edge.joint.mimic is None


def _chain_joint(tree: UrdfTree, edge: Edge, chain: Sequence[Edge]) -> Joint:
    """Return a joint of the chain; a mimic follows a joint of the chain with a coordinate."""
    if edge.type in UNSUPPORTED_TYPES:
        tree.fault(
            f"joint {edge.joint.name}: is {edge.type}; allowed on a chain: {', '.join(KINDS)}", edge.line
        )
    if edge.joint.mimic is None:
        return edge.joint
    mimic = _resolve_mimic(tree, edge)
    leader = tree.edges[mimic.joint] if mimic else None
    if leader is not None and leader not in chain:
        ends = f"{chain[0].parent} to {chain[-1].child}"
        tree.fault(
            f"joint {edge.joint.name}: mimics {leader.joint.name}, which is not on the chain {ends};"
            f" allowed: {_join_names(other.joint.name for other in chain if _has_coordinate(other))}",
            edge.line,
        )
    elif leader is not None and leader.joint.kind == "fixed":
        message = f"mimics {leader.joint.name}, which is {leader.type}"
        tree.fault(f"joint {edge.joint.name}: {message}; allowed: a moving joint", edge.line)
    return replace(edge.joint, mimic=mimic)


def _resolve_mimic(tree: UrdfTree, edge: Edge) -> Mimic | None:
    """Return the mimic of the joint at the end of a series of mimics; None if there is no such joint."""
    mimic = edge.joint.mimic
    visited = {edge.joint.name}
    while mimic is not None and mimic.joint in tree.edges:
        if mimic.joint in visited:
            tree.fault(f"joint {edge.joint.name}: mimics itself by way of {mimic.joint}", edge.line)
            return None
        further = tree.edges[mimic.joint].joint.mimic
        if further is None:
            return mimic
        visited.add(mimic.joint)
        offset = mimic.multiplier * further.offset + mimic.offset
        mimic = Mimic(further.joint, mimic.multiplier * further.multiplier, offset)
    return None


def _pop_fixed(joints: list[Joint], name: str, index: int) -> Transform:
    """Remove the fixed joint of that name from that end and return its frame, or the identity."""
    if joints and joints[index].name == name and joints[index].kind == "fixed":
        return joints.pop(index).origin
    return Transform()


def _carriers(edges: Sequence[Edge], joints: Sequence[Joint], base: Transform) -> Iterator[_Carrier]:
    """Yield the links of the chain, each with the joint of the chain that carries it.

    Links after a joint that became base, tip or tool are carried by the joint before it.
    """
    if not edges:
        return
    names = {joint.name for joint in joints}
    carrier = _Carrier(edges[0].parent, None, base.inverse(), moves=False)
    yield carrier
    for edge in edges:
        name, moves = edge.joint.name, carrier.moves or edge.joint.kind != "fixed"
        at = (name, Transform()) if name in names else (carrier.joint, carrier.frame @ edge.joint.origin)
        carrier = _Carrier(edge.child, *at, moves)
        yield carrier


def _link_visuals(tree: UrdfTree, carrier: _Carrier) -> Iterator[Visual]:
    """Yield the shapes of a link in the frame that carries it, without the placeholders of `write_urdf`."""
    place = f"link {carrier.link}: visual"
    for node in tree.links[carrier.link].all("visual"):
        material = node.first("material")
        if material is not None and material.attributes.get("name") == PLACEHOLDER_MATERIAL:
            continue
        geometry = node.first("geometry")
        shapes = [child for child in geometry.children if child.tag in SHAPES] if geometry else []
        if len(shapes) != 1:
            tags = (geometry and ", ".join(child.tag for child in geometry.children)) or "no shape"
            tree.fault(f"{place}: found {tags}; allowed: one of {', '.join(SHAPES)}", node.line)
            continue
        shape = _read_shape(tree, shapes[0], f"{place}: {shapes[0].tag}")
        origin = carrier.frame @ read_origin(tree, node, place)
        yield Visual(carrier.joint, shape, origin, _read_colour(tree, material, place))


def _read_shape(tree: UrdfTree, node: Node, place: str) -> Shape:
    if node.tag == "mesh":
        scale = read_numbers(tree, node, place, "scale", (1.0, 1.0, 1.0))
        if not (file := node.attributes.get("filename", "")):
            tree.fault(f"{place}: no filename; allowed: one", node.line)
        return Mesh(file, cast("tuple[float, float, float]", scale))
    if node.tag == "box":
        return Box(cast("tuple[float, float, float]", _read_sizes(tree, node, place, "size", 3)))
    (radius,) = _read_sizes(tree, node, place, "radius")
    if node.tag == "sphere":
        return Sphere(radius)
    (length,) = _read_sizes(tree, node, place, "length")
    return Cylinder(radius, length) if node.tag == "cylinder" else Capsule(radius, length)


def _read_sizes(tree: UrdfTree, node: Node, place: str, attribute: str, count: int = 1) -> tuple[float, ...]:
    """Return sizes, which are required and must not be negative."""
    if attribute not in node.attributes:
        tree.fault(f"{place}: no {attribute}; allowed: one", node.line)
    sizes = read_numbers(tree, node, place, attribute, (0.0,) * count)
    if min(sizes) < 0.0:
        tree.fault(f"{place} {attribute}: found {min(sizes):g}; allowed: 0 or more", node.line)
    return sizes


def _read_colour(tree: UrdfTree, material: Node | None, place: str) -> Colour | None:
    """Return the colour of a material: its <color>, or that of the first of its name in the file."""
    if material is None:
        return None
    node = material.first("color") or tree.colours.get(material.attributes.get("name", ""))
    if node is None:
        return None
    rgba = read_numbers(tree, node, f"{place}: color", "rgba", (1.0, 1.0, 1.0, 1.0))
    return cast("Colour", tuple(min(max(share, 0.0), 1.0) for share in rgba))


class _Mass(NamedTuple):
    """A link's mass in [kg], the frame of its centre in the link's, and its inertia along it in [kg.m2]."""

    mass: float
    origin: Transform
    inertia: Symmetric
    line: int


def _chain_masses(
    tree: UrdfTree, carriers: Sequence[_Carrier]
) -> tuple[tuple[Inertial, ...], tuple[str, ...], tuple[str, ...]]:
    """Return `inertials`, `left_out` and `mass_faults` of a chain by the links that it carries.

    A link that is fixed to a link of the chain has the same carrier. A link that another joint moves against
    a moving link is left out with all links after it. A mass with an error is left out if it does not move:
    it has no effect on the motion. If one that moves has an error, none is kept: many files have masses
    that were never used, although their kinematics are right.
    """
    links = {carrier.link for carrier in carriers}
    inertials: list[Inertial] = []
    left_out: list[str] = []
    faults: list[str] = []
    for chain_link in carriers:
        for carrier in _iter_fixed(tree, chain_link, links):
            inertial, errors = _read_inertial(tree, carrier)
            inertials += inertial
            if carrier.moves:
                faults += errors
                left_out += _iter_left_out(tree, carrier.link, links)
    return () if faults else tuple(inertials), tuple(left_out), tuple(faults)


def _iter_fixed(tree: UrdfTree, carrier: _Carrier, chain: Set[str]) -> Iterator[_Carrier]:
    """Yield a link of the chain and all links outside the chain that are fixed to it."""
    waiting = [carrier]
    while waiting:
        fixed = waiting.pop()
        yield fixed
        waiting += [
            fixed._replace(link=edge.child, frame=fixed.frame @ edge.joint.origin)
            for edge in reversed(tree.below(fixed.link))
            if edge.type == "fixed" and edge.child not in chain
        ]


def _iter_left_out(tree: UrdfTree, link: str, chain: Set[str]) -> Iterator[str]:
    """Yield the links with a mass that joints outside the chain move against a link."""
    waiting = [
        edge.child for edge in reversed(tree.below(link)) if edge.type != "fixed" and edge.child not in chain
    ]
    while waiting:
        child = waiting.pop()
        mass, errors = _read_mass(tree, child)
        if mass is not None or errors:
            yield child
        waiting += [edge.child for edge in reversed(tree.below(child))]


def _read_inertial(tree: UrdfTree, carrier: _Carrier) -> tuple[list[Inertial], list[str]]:
    """Return the inertial of a link in the frame that carries it, if it has one, and its errors."""
    mass, errors = _read_mass(tree, carrier.link)
    if mass is None:
        return [], errors
    frame = carrier.frame @ mass.origin
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = rotate_inertia(frame, mass.inertia)
    inertial = Inertial(
        carrier.joint, mass.mass, frame.translation, (ixx, iyy, izz, ixy, ixz, iyz), f"link {carrier.link}"
    )
    errors = [
        str(Finding(f"link {carrier.link}: {fault}", tree.file, line=mass.line))
        for fault in inertial.faults()
    ]
    return ([] if errors else [inertial]), errors


def _read_mass(tree: UrdfTree, link: str) -> tuple[_Mass | None, list[str]]:
    """Return the mass of a link, None without one, and its errors, which are not those of the tree."""
    nodes = tree.links[link].all("inertial")
    if not nodes:
        return None, []
    node, place, count = nodes[0], f"link {link}: inertial", len(tree.faults)
    for other in nodes[1:]:
        tree.fault(f"link {link}: found a second <inertial>; allowed: one", other.line)
    (mass,) = _read_required(tree, node, place, "mass", ("value",))
    ixx, iyy, izz, ixy, ixz, iyz = _read_required(tree, node, place, "inertia", MOMENTS)
    origin = read_origin(tree, node, place)
    errors = [str(fault) for fault in tree.faults[count:]]
    del tree.faults[count:]
    if errors or not any((mass, ixx, iyy, izz, ixy, ixz, iyz)):
        return None, errors
    return _Mass(mass, origin, ((ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz)), node.line), []


def _read_required(tree: UrdfTree, node: Node, place: str, tag: str, names: Sequence[str]) -> list[float]:
    """Return the attributes of an element of <inertial>, all of which are required."""
    element = node.first(tag)
    missing = [name for name in names if element is None or name not in element.attributes]
    if missing:
        tree.fault(f"{place}: {tag}: no {', '.join(missing)}; allowed: a number each", (element or node).line)
    if element is None:
        return [0.0] * len(names)
    return [read_numbers(tree, element, f"{place}: {tag}", name, (0.0,))[0] for name in names]


def _join_names(names: Iterable[str]) -> str:
    return format_names("", names)
