"""What the links of a URDF weigh: its <inertial> elements, on the joints of a chain that carry them.

What a link of a URDF looks like: its <visual> elements.

URDF in: the serial chain between two links of a robot description.
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
    STAND_IN,
    TIP_JOINT,
    TOOL_JOINT,
    UNSUPPORTED_TYPES,
    CarrierLink,
    Edge,
    Node,
    UrdfTree,
    read_numbers,
    read_origin,
    read_tree,
)

MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""URDF's attributes of an inertia, in the order of `Inertial.inertia`."""


class _Mass(NamedTuple):
    """A link's mass in [kg], the frame of its centre in the link's, and its inertia along it in [kg.m2]."""

    mass: float
    origin: Transform
    inertia: Symmetric
    line: int


class ChainMasses(NamedTuple):
    """The masses that a chain carries: `inertials`, `left_out` and `mass_faults` of `Chain`."""

    inertials: tuple[Inertial, ...]
    left_out: tuple[str, ...]
    faults: tuple[str, ...]


def chain_masses(tree: UrdfTree, carriers: Sequence[CarrierLink]) -> ChainMasses:
    """Return the masses that a chain carries.

    What is fixed to a link of the chain is carried by what carries the link. What moves against a moving
    link by a joint of its own is left out with all that it carries. A mass that stands still and is not right
    is left out: it has no part in the motion. With one that moves, none is kept: many files have masses
    that nobody ever used, and their kinematics are right all the same.

    Args:
        tree: The file.
        carriers: The links of the chain, from the base outwards.
    """
    chain = {one.link for one in carriers}
    inertials: list[Inertial] = []
    left_out: list[str] = []
    faults: list[str] = []
    for carrier in carriers:
        for one in _fixed_to(tree, carrier, chain):
            found, wrong = _inertial(tree, one)
            inertials += found
            if one.moves:
                faults += wrong
                left_out += _moving_on(tree, one.link, chain)
    return ChainMasses(() if faults else tuple(inertials), tuple(left_out), tuple(faults))


def _fixed_to(tree: UrdfTree, carrier: CarrierLink, chain: Set[str]) -> Iterator[CarrierLink]:
    """Yield a link of the chain and all that is fixed to it beside the chain."""
    waiting = [carrier]
    while waiting:
        one = waiting.pop()
        yield one
        waiting += [
            one._replace(link=edge.child, frame=one.frame @ edge.joint.origin)
            for edge in reversed(tree.below(one.link))
            if edge.type == "fixed" and edge.child not in chain
        ]


def _moving_on(tree: UrdfTree, link: str, chain: Set[str]) -> Iterator[str]:
    """Yield the links with a mass that move against a link by joints beside the chain."""
    waiting = [
        edge.child for edge in reversed(tree.below(link)) if edge.type != "fixed" and edge.child not in chain
    ]
    while waiting:
        one = waiting.pop()
        mass, wrong = _mass(tree, one)
        if mass is not None or wrong:
            yield one
        waiting += [edge.child for edge in reversed(tree.below(one))]


def _inertial(tree: UrdfTree, carrier: CarrierLink) -> tuple[list[Inertial], list[str]]:
    """Return the inertial of a link in the frame that carries it, if there is one, and what is wrong."""
    found, wrong = _mass(tree, carrier.link)
    if found is None:
        return [], wrong
    frame = carrier.frame @ found.origin
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = rotate_inertia(frame, found.inertia)
    inertial = Inertial(
        carrier.joint, found.mass, frame.translation, (ixx, iyy, izz, ixy, ixz, iyz), f"link {carrier.link}"
    )
    wrong = [
        str(Finding(f"link {carrier.link}: {fault}", tree.file, line=found.line))
        for fault in inertial.faults()
    ]
    return ([] if wrong else [inertial]), wrong


def _mass(tree: UrdfTree, link: str) -> tuple[_Mass | None, list[str]]:
    """Return the mass of a link, None without one, and what is wrong with it."""
    nodes = [*tree.links[link].all("inertial")]
    if not nodes:
        return None, []
    node, place, before = nodes[0], f"link {link}: inertial", len(tree.faults)
    for other in nodes[1:]:
        tree.fault(f"link {link}: found a second <inertial>; allowed: one", other.line)
    (mass,) = _numbers(tree, node, place, "mass", ("value",))
    ixx, iyy, izz, ixy, ixz, iyz = _numbers(tree, node, place, "inertia", MOMENTS)
    origin = read_origin(tree, node, place)
    wrong = [str(fault) for fault in tree.faults[before:]]
    del tree.faults[before:]
    if wrong or not any((mass, ixx, iyy, izz, ixy, ixz, iyz)):
        return None, wrong
    return _Mass(mass, origin, ((ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz)), node.line), []


def _numbers(tree: UrdfTree, node: Node, place: str, tag: str, names: Sequence[str]) -> list[float]:
    """Return the attributes of an element of <inertial>, which must all be there."""
    element = node.first(tag)
    missing = [name for name in names if element is None or name not in element.attributes]
    if missing:
        tree.fault(f"{place}: {tag}: no {', '.join(missing)}; allowed: a number each", (element or node).line)
    if element is None:
        return [0.0] * len(names)
    return [read_numbers(tree, element, f"{place}: {tag}", name, (0.0,))[0] for name in names]


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
        yield Visual(joint, shape, read_origin(tree, node, place), _colour(tree, material, place))


def _shape(tree: UrdfTree, node: Node, place: str) -> Shape:
    """Return the shape that an element describes, in [m]."""
    if node.tag == "mesh":
        scale = read_numbers(tree, node, place, "scale", (1.0, 1.0, 1.0))
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
    sizes = read_numbers(tree, node, place, attribute, (0.0,) * count)
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
    rgba = read_numbers(tree, node, f"{place}: color", "rgba", (1.0, 1.0, 1.0, 1.0))
    return cast("Colour", tuple(min(max(share, 0.0), 1.0) for share in rgba))


def read_urdf(path: str | Path, *, base_link: str | None = None, tip_link: str | None = None) -> Chain:
    """Return the chain from a base link to a tip link of a URDF file.

    Every joint between the two is kept, the fixed ones as frames that may carry a sensor. Only the
    three fixed joints that `write_urdf` adds for base, tip and tool become these again. What the links
    between the two look like is kept, too; mesh files are looked up but not opened. Masses are those of the
    links between the two, and of all that is fixed to them; if one that moves is not right, none is kept
    (`Chain.mass_faults`).

    Args:
        path: The file.
        base_link: Where the chain begins; the root by default.
        tip_link: Where it ends. By default the only leaf; of several, the one with the most moving
            joints on its way, if there is a single one and the arm carries no other moving joints.

    Raises:
        RobotError: With everything that is wrong with the file or the choice of links.
    """
    tree = read_tree(Path(path))
    edges = _choose(tree, base_link, tip_link) if tree.sound else []
    joints = [_joint(tree, edge, edges) for edge in edges]
    base, tool, tip = (
        _take(joints, BASE_JOINT, 0),
        _take(joints, TOOL_JOINT, -1),
        _take(joints, TIP_JOINT, -1),
    )
    carriers = list(_carriers(edges, joints, base))
    visuals = [visual for carrier in carriers for visual in _visuals(tree, carrier)]
    masses = chain_masses(tree, carriers)
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
            inertials=masses.inertials,
            left_out=masses.left_out,
            mass_faults=masses.faults,
        )
    except RobotError as error:
        raise RobotError(*(replace(fault, file=tree.file) for fault in error.findings)) from error


def _choose(tree: UrdfTree, base: str | None, tip: str | None) -> list[Edge]:
    """Return the joints from base to tip; nothing, and a fault noted, where there is no such way."""
    known = [_is_link(tree, role, link) for role, link in (("base", base), ("tip", tip)) if link]
    root = base or _root(tree)
    if not all(known) or root is None:
        return []
    ways = _ways(tree, root)
    if tip is None:
        tip = _default_tip(tree, ways)
    elif tip not in ways:
        tree.fault(f"tip link {tip} does not follow base link {root}; allowed: {_listed(ways)}")
    return ways.get(tip, []) if tip else []


def _is_link(tree: UrdfTree, role: str, link: str) -> bool:
    """Tell whether a chosen link is in the file, and note a fault if not."""
    if link in tree.links:
        return True
    hint = format_suggestion(link, tree.links)
    allowed = format_names(link, tree.links)
    tree.fault(f"{role} link {format_value(link)} is not in the file{hint}; allowed: {allowed}")
    return False


def _root(tree: UrdfTree) -> str | None:
    """Return the only link that no joint carries; nothing, and a fault noted, if there is none."""
    carried = {edge.child for edge in tree.edges.values()}
    roots = [link for link in tree.links if link not in carried]
    if len(roots) == 1:
        return roots[0]
    found = f"{len(roots)} root links: {_listed(roots)}" if roots else "no link"
    tree.fault(f"found {found}; allowed: one root, or a base link chosen by name")
    return None


def _ways(tree: UrdfTree, root: str) -> dict[str, list[Edge]]:
    """Return the joints from the root to every link that follows it."""
    ways: dict[str, list[Edge]] = {root: []}
    waiting = [root]
    while waiting:
        link = waiting.pop()
        for edge in tree.below(link):
            ways[edge.child] = [*ways[link], edge]
            waiting.append(edge.child)
    return ways


def _default_tip(tree: UrdfTree, ways: dict[str, list[Edge]]) -> str | None:
    """Return the end with the most moving joints before it; nothing, and a fault noted, if in doubt."""
    fixed = [edge for edge in tree.edges.values() if edge.type == "fixed"]
    masses = {edge.child for edge in fixed if edge.joint.name.startswith(MASS_JOINT)}
    parents = {edge.parent for edge in tree.edges.values() if edge.child not in masses}
    moving = {link: sum(map(_moves, way)) for link, way in ways.items() if link not in parents | masses}
    most = [link for link, count in moving.items() if count == max(moving.values())]
    if len(most) > 1:
        found = f"{len(most)} ends with {moving[most[0]]} moving joints"
        tree.fault(f"found {found}", hints=(_choose_tip(moving),))
        return None
    carried = {edge.joint.name: fork for edge, fork in _carried(ways, most[0])}
    if carried:
        found = f"{_listed(carried)} on the arm beside the way to {most[0]}, as of a gripper"
        tree.fault(f"found {found}", hints=(_choose_tip(dict.fromkeys((*carried.values(), *moving))),))
        return None
    return most[0]


def _choose_tip(links: Iterable[str]) -> Hint:
    """Return that one of some links is to be chosen as the tip."""
    return Hint("tip_link", None, f"chooses one: {_listed(links)}")


def _carried(ways: dict[str, list[Edge]], tip: str) -> Iterator[tuple[Edge, str]]:
    """Yield the joints beside the way to a tip that its moving joints carry, and the link they part at."""
    own = ways[tip]
    for way in ways.values():
        if not way or way[-1] in own or way[-1].joint.kind == "fixed":
            continue
        common = [edge for edge, other in zip(own, way, strict=False) if edge is other]
        if any(map(_moves, common)):
            yield way[-1], common[-1].child


def _moves(edge: Edge) -> bool:
    """Tell whether a joint has a coordinate of its own."""
    return edge.joint.kind != "fixed" and edge.joint.mimic is None


def _joint(tree: UrdfTree, edge: Edge, chain: Sequence[Edge]) -> Joint:
    """Return a joint of the chain; one that mimics follows the joint that has the coordinate."""
    if edge.type in UNSUPPORTED_TYPES:
        tree.fault(
            f"joint {edge.joint.name}: is {edge.type}; allowed on a chain: {', '.join(KINDS)}", edge.line
        )
    if edge.joint.mimic is None:
        return edge.joint
    mimic = _followed(tree, edge)
    leader = tree.edges[mimic.joint] if mimic else None
    if leader is not None and leader not in chain:
        ends = f"{chain[0].parent} to {chain[-1].child}"
        tree.fault(
            f"joint {edge.joint.name}: mimics {leader.joint.name}, which is not on the chain {ends};"
            f" allowed: {_listed(other.joint.name for other in chain if _moves(other))}",
            edge.line,
        )
    elif leader is not None and leader.joint.kind == "fixed":
        found = f"mimics {leader.joint.name}, which is {leader.type}"
        tree.fault(f"joint {edge.joint.name}: {found}; allowed: a moving joint", edge.line)
    return replace(edge.joint, mimic=mimic)


def _followed(tree: UrdfTree, edge: Edge) -> Mimic | None:
    """Return the mimic with the mimics that it follows put in: m (m' q + o') + o; None if it follows none."""
    mimic = edge.joint.mimic
    passed = {edge.joint.name}
    while mimic is not None and mimic.joint in tree.edges:
        if mimic.joint in passed:
            tree.fault(f"joint {edge.joint.name}: mimics itself by way of {mimic.joint}", edge.line)
            return None
        further = tree.edges[mimic.joint].joint.mimic
        if further is None:
            return mimic
        passed.add(mimic.joint)
        offset = mimic.multiplier * further.offset + mimic.offset
        mimic = Mimic(further.joint, mimic.multiplier * further.multiplier, offset)
    return None


def _take(joints: list[Joint], name: str, index: int) -> Transform:
    """Remove the fixed joint of that name from that end and return its frame; the identity without one."""
    if joints and joints[index].name == name and joints[index].kind == "fixed":
        return joints.pop(index).origin
    return Transform()


def _carriers(edges: Sequence[Edge], joints: Sequence[Joint], base: Transform) -> Iterator[CarrierLink]:
    """Yield the links of the chain, each with the joint of the chain that carries it.

    Links that hang on a joint which became base, tip or tool are carried by the joint before it.
    """
    if not edges:
        return
    kept = {joint.name for joint in joints}
    carrier = CarrierLink(edges[0].parent, None, base.inverse(), moves=False)
    yield carrier
    for edge in edges:
        name, moves = edge.joint.name, carrier.moves or edge.joint.kind != "fixed"
        on = (name, Transform()) if name in kept else (carrier.joint, carrier.frame @ edge.joint.origin)
        carrier = CarrierLink(edge.child, *on, moves)
        yield carrier


def _visuals(tree: UrdfTree, carrier: CarrierLink) -> Iterator[Visual]:
    """Yield what a link of the chain shows, in the frame that carries it."""
    shapes = link_visuals(tree, carrier.link, carrier.joint)
    return (replace(visual, origin=carrier.frame @ visual.origin) for visual in shapes)


def _listed(names: Iterable[str]) -> str:
    """Return names as a list in a sentence."""
    return format_names("", names)
