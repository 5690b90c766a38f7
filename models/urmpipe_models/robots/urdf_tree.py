"""XML in, as a plain tree with line numbers; documents that could expand are refused unread.

What a URDF file says: its links, its joints, and everything that is wrong with them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple
from xml.parsers import expat

from urmpipe_models.arm.chain import Joint, JointKind, Mimic
from urmpipe_models.errors import Finding, Hint, RobotError, format_suggestion, format_value
from urmpipe_models.files import read_contents
from urmpipe_models.math3d import Transform, from_xyz_rpy

LONGEST = 10_000
"""Letters of an attribute at most."""


@dataclass(slots=True)
class Node:
    """One element.

    Attributes:
        tag: Its name as written, prefix included.
        attributes: Its attributes.
        line: Where it starts in the file, from 1.
        children: The elements in it.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Node] = field(default_factory=list)

    def all(self, tag: str) -> list[Node]:
        """Return the children of that name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Node | None:
        """Return the first child of that name, or None."""
        return next(iter(self.all(tag)), None)

    def walk(self) -> Iterator[Node]:
        """Yield this element and all below it, in the order of the file."""
        waiting = [self]
        while waiting:
            node = waiting.pop()
            yield node
            waiting.extend(reversed(node.children))


def read_xml(path: Path) -> Node:
    """Return the root element of an XML file.

    Entities can be declared only in a document type, so a document with one is refused at its first
    character: nothing is ever expanded or fetched.

    Raises:
        RobotError: If the file cannot be read, is not well-formed, or has a document type or an attribute of
            more than `LONGEST` letters.
    """
    return _parsed(read_contents(path, RobotError, (".urdf",)), path)


def _parsed(content: bytes, path: Path) -> Node:
    """Return the root element of a document, whose path is for the errors."""
    parser = expat.ParserCreate()
    document = Node("", {}, 0)
    ancestors = [document]

    def start(tag: str, attributes: dict[str, str]) -> None:
        """Hang a new node below the open one."""
        if (longest := max(map(len, attributes.values()), default=0)) > LONGEST:
            message = f"found an attribute of {longest} letters, allowed: {LONGEST} at most"
            raise RobotError(Finding(message, str(path), line=parser.CurrentLineNumber))
        node = Node(tag, attributes, parser.CurrentLineNumber)
        ancestors[-1].children.append(node)
        ancestors.append(node)

    def end(_: str) -> None:
        """Close the open node."""
        ancestors.pop()

    def doctype(*_: object) -> None:
        """Refuse what could define entities."""
        message = "found a document type (<!DOCTYPE ...>); allowed: XML without document type and entities"
        raise RobotError(Finding(message, str(path), line=parser.CurrentLineNumber))

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise RobotError(Finding(f"not well-formed XML: {reason}", str(path), line=error.lineno)) from error
    except (LookupError, ValueError) as error:  # an encoding that expat does not know, or cannot use
        raise RobotError(Finding(f"cannot be decoded: {error}; allowed: UTF-8", str(path))) from error
    return document.children[0]


KINDS: dict[str, JointKind] = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed",
}  # fmt: skip
"""URDF's joint types that a chain can hold."""

UNSUPPORTED_TYPES = ("floating", "planar")
"""URDF's joint types that it cannot; they may stand beside the chain."""

UNLIMITED = 1.7976931348623157e308
"""The largest double: stands for infinity where URDF wants a number."""

BASE_JOINT, TIP_JOINT, TOOL_JOINT = "urmpipe_base", "urmpipe_tip", "urmpipe_tool"
"""Names of the fixed joints that stand for a chain's base, tip and tool."""

MASS_JOINT = "urmpipe_mass_"
"""What the names of the fixed joints begin with that hold a further mass of a link."""

STAND_IN = "urmpipe"
"""Name of the material of the shapes that `write_urdf` gives an arm that has none."""

MAX_LINKS = 1000
"""Links of a file, and joints of an arm, at most: a humanoid has a hundred."""

ASKED = 20
"""So many faults of links ask whether another may be meant: nobody reads more."""

COUNTS = {1: "a number", 3: "three numbers", 4: "four numbers"}


@dataclass(frozen=True, slots=True)
class Edge:
    """A joint of the file, between two links.

    Attributes:
        joint: The joint; of a type that no chain can hold, a fixed one.
        type: URDF's type.
        parent: The link it sits on.
        child: The link it carries.
        line: Where it stands in the file.
    """

    joint: Joint
    type: str
    parent: str
    child: str
    line: int


class CarrierLink(NamedTuple):
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


@dataclass(slots=True)
class UrdfTree:
    """The links and joints of a file.

    Attributes:
        file: The file, as the user named it.
        name: The robot's name.
        links: The element of each link by its name.
        edges: The joints by name.
        colours: The <color> of each material that has one, by the material's name.
        faults: All that is wrong.
        sound: Whether links and joints form a forest, so that paths can be followed.
    """

    file: str
    name: str
    links: dict[str, Node] = field(default_factory=dict)
    edges: dict[str, Edge] = field(default_factory=dict)
    colours: dict[str, Node] = field(default_factory=dict)
    faults: list[Finding] = field(default_factory=list)
    sound: bool = True

    def fault(self, message: str, line: int | None = None, hints: tuple[Hint, ...] = ()) -> None:
        """Note that something is wrong."""
        self.faults.append(Finding(message, self.file, line=line, hints=hints))

    def below(self, link: str) -> list[Edge]:
        """Return the joints that sit on a link, in the order of the file."""
        return [edge for edge in self.edges.values() if edge.parent == link]


def read_tree(path: Path) -> UrdfTree:
    """Return the links and joints of a URDF file, with everything that is wrong noted in `faults`.

    Raises:
        RobotError: If the file is no URDF at all.
    """
    root = read_xml(path)
    if path.suffix == ".xacro" or any(node.tag.startswith("xacro:") for node in root.walk()):
        target = path.with_suffix("").stem + (".urdf" if path.suffix == ".xacro" else ".expanded.urdf")
        raise RobotError(Finding(f"is a xacro file; expand it first: xacro {path} -o {target}", str(path)))
    if root.tag != "robot":
        raise RobotError(
            Finding(f"found <{root.tag}>; allowed: a URDF file, <robot>", str(path), line=root.line)
        )
    if (most := max(len(root.all("link")), len(root.all("joint")))) > MAX_LINKS:
        raise RobotError(Finding(f"found {most} links or joints, allowed: {MAX_LINKS} at most", str(path)))
    tree = UrdfTree(str(path), root.attributes.get("name", path.stem))
    for node in root.all("link"):
        _add_link(tree, node)
    for node in root.all("joint"):
        _add_joint(tree, node)
    for node in root.walk():
        name, colour = node.attributes.get("name"), node.first("color")
        if node.tag == "material" and name and colour:
            tree.colours.setdefault(name, colour)
    _check_links(tree)
    _check_mimics(tree)
    return tree


def _add_link(tree: UrdfTree, node: Node) -> None:
    """Note a link of the file."""
    name = node.attributes.get("name")
    if not name:
        tree.fault("link without a name", node.line)
    elif name in tree.links:
        tree.fault(f"link {name}: name stands already in line {tree.links[name].line}", node.line)
    else:
        tree.links[name] = node


def _add_joint(tree: UrdfTree, node: Node) -> None:
    """Note a joint of the file."""
    name, type_ = node.attributes.get("name"), node.attributes.get("type", "")
    if not name:
        tree.fault("joint without a name", node.line)
        return
    if name in tree.edges:
        tree.fault(f"joint {name}: name stands already in line {tree.edges[name].line}", node.line)
        return
    if type_ not in KINDS and type_ not in UNSUPPORTED_TYPES:
        tree.fault(f"joint {name}: found type {format_value(type_)}; allowed: {', '.join(KINDS)}", node.line)
    parent, child = (_link_of(tree, node, name, end) for end in ("parent", "child"))
    kind = KINDS.get(type_, "fixed")
    lower, upper, velocity, acceleration, effort = _limits(tree, node, name, type_)
    joint = Joint(
        name,
        kind,
        read_origin(tree, node, f"joint {name}"),
        (0.0, 0.0, 1.0) if kind == "fixed" else _axis(tree, node, name),
        lower=lower,
        upper=upper,
        velocity=velocity,
        acceleration=acceleration,
        effort=effort,
        mimic=None if kind == "fixed" else _mimic(tree, node, name),
    )
    tree.edges[name] = Edge(joint, type_, parent, child, node.line)


def _link_of(tree: UrdfTree, node: Node, joint: str, end: Literal["parent", "child"]) -> str:
    """Return the link at one end of a joint, which must be in the file."""
    element = node.first(end)
    link = element.attributes.get("link") if element else None
    if not link:
        tree.fault(f'joint {joint}: no <{end} link="...">; allowed: one', node.line)
        tree.sound = False
        return ""
    if link not in tree.links:
        hint = format_suggestion(link, tree.links) if len(tree.faults) < ASKED else ""
        tree.fault(f"joint {joint}: {end} {format_value(link)}; allowed: a link of the file{hint}", node.line)
        tree.sound = False
    return link


def read_origin(tree: UrdfTree, node: Node, place: str) -> Transform:
    """Return the frame that an element's <origin> tells, the identity without one.

    Args:
        tree: The file; what is wrong is noted there.
        node: The element.
        place: What it is, for the faults.
    """
    origin = node.first("origin")
    if origin is None:
        return Transform()
    x, y, z = read_numbers(tree, origin, f"{place}: origin", "xyz", (0.0, 0.0, 0.0))
    rx, ry, rz = read_numbers(tree, origin, f"{place}: origin", "rpy", (0.0, 0.0, 0.0))
    return from_xyz_rpy((x, y, z), (rx, ry, rz), f"URDF {place}")


def _axis(tree: UrdfTree, node: Node, joint: str) -> tuple[float, float, float]:
    """Return the unit axis; one that has unit length already keeps its bits."""
    element = node.first("axis")
    if element is None:
        return (1.0, 0.0, 0.0)
    x, y, z = read_numbers(tree, element, f"joint {joint}: axis", "xyz", (1.0, 0.0, 0.0))
    length = math.hypot(x, y, z)
    if length == 0.0:
        tree.fault(f"joint {joint}: axis is zero; allowed: a direction", element.line)
        return (1.0, 0.0, 0.0)
    if abs(length - 1.0) < 4e-16:
        return x, y, z
    return x / length, y / length, z / length


def _limits(tree: UrdfTree, node: Node, joint: str, type_: str) -> tuple[float, float, float, float, float]:
    """Return lower, upper, velocity, acceleration and effort; what the file leaves out is not limited."""
    limit = node.first("limit")
    if limit is None or type_ == "fixed":
        return -math.inf, math.inf, math.inf, math.inf, math.inf
    place = f"joint {joint}: limit"
    velocity, acceleration, effort = (
        _largest(tree, limit, place, key) for key in ("velocity", "acceleration", "effort")
    )
    if type_ == "continuous" or not limit.attributes.keys() & {"lower", "upper"}:
        return -math.inf, math.inf, velocity, acceleration, effort
    (lower,), (upper,) = (read_numbers(tree, limit, place, end, (0.0,)) for end in ("lower", "upper"))
    if lower > upper:
        tree.fault(f"{place}: lower {lower:g} above upper {upper:g}", limit.line)
    return lower, upper, velocity, acceleration, effort


def _largest(tree: UrdfTree, limit: Node, place: str, attribute: str) -> float:
    """Return the largest speed, acceleration or effort; 0 is no limit."""
    (value,) = read_numbers(tree, limit, place, attribute, (math.inf,))
    if value < 0.0:
        tree.fault(f"{place} {attribute}: found {value:g}; allowed: 0 (not known) or more", limit.line)
    return value or math.inf


def _mimic(tree: UrdfTree, node: Node, joint: str) -> Mimic | None:
    """Return which joint another follows, if it follows one."""
    element = node.first("mimic")
    if element is None:
        return None
    place = f"joint {joint}: mimic"
    (multiplier,) = read_numbers(tree, element, place, "multiplier", (1.0,))
    (offset,) = read_numbers(tree, element, place, "offset", (0.0,))
    return Mimic(element.attributes.get("joint", ""), multiplier, offset)


def read_numbers(
    tree: UrdfTree, node: Node, place: str, attribute: str, default: Sequence[float]
) -> tuple[float, ...]:
    """Return the numbers of an attribute, as many as the default has; only limits may be infinite.

    Args:
        tree: The file; what is wrong is noted there.
        node: The element.
        place: What it is, for the faults.
        attribute: The attribute's name.
        default: What stands for an attribute that is not there, or is wrong.
    """
    text = node.attributes.get(attribute)
    if text is None:
        return tuple(default)
    try:
        values = tuple(_infinite(float(word)) for word in text.split())
    except ValueError:
        values = ()
    finite = node.tag == "limit" or all(math.isfinite(value) for value in values)
    if len(values) != len(default) or any(math.isnan(value) for value in values) or not finite:
        tree.fault(
            f"{place} {attribute}: found {format_value(text)}, expected {COUNTS[len(default)]}", node.line
        )
        return tuple(default)
    return values


def _infinite(value: float) -> float:
    """Return an infinite limit for one that `write_urdf` wrote in place of it."""
    return math.copysign(math.inf, value) if abs(value) >= UNLIMITED else value


def _check_links(tree: UrdfTree) -> None:
    """Note links with two parents and loops."""
    above: dict[str, Edge] = {}
    for edge in tree.edges.values():
        if edge.child and edge.child in above:
            both = f"{above[edge.child].joint.name} and {edge.joint.name}"
            tree.fault(f"link {edge.child}: child of joints {both}; allowed: one parent", edge.line)
            tree.sound = False
        above.setdefault(edge.child, edge)
    seen: set[str] = set()
    for start in tree.links:
        link = start
        way: list[str] = []
        while link in above and link not in seen:
            seen.add(link)
            way.append(link)
            link = above[link].parent
        if link in way:
            loop = [link, *reversed(way[way.index(link) :])]
            tree.fault(f"links {' -> '.join(loop)} form a loop; allowed: a tree", above[link].line)
            tree.sound = False


def _check_mimics(tree: UrdfTree) -> None:
    """Note mimics of joints that are not there."""
    for edge in tree.edges.values():
        mimic = edge.joint.mimic
        if mimic is not None and mimic.joint not in tree.edges:
            tree.fault(
                f"joint {edge.joint.name}: mimics {format_value(mimic.joint)}; allowed: a joint of the file",
                edge.line,
            )
