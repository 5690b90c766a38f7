"""Links and joints of a URDF file, with the line of each error.

1. `_read_xml`: the file as a tree of elements with line numbers. A document that could expand is rejected.
2. `read_tree`: links, joints and colours. Errors are collected in `UrdfTree.faults`.
3. `_read_joint`: origin, axis, limits, mimic of a joint.
4. `_check_links`, `_check_mimics`: one parent per link, no loops, mimics of existing joints.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from xml.parsers import expat

from urmpipe_models.arm.chain import Joint, JointKind, Mimic
from urmpipe_models.errors import Finding, Hint, RobotError, format_suggestion, format_value
from urmpipe_models.files import read_contents
from urmpipe_models.math3d import Transform, from_xyz_rpy

MAX_ATTRIBUTE = 10_000  # letters of an attribute
MAX_LINKS = 1000  # of a file, and joints of an arm: a humanoid has a hundred
MAX_SUGGESTIONS = 20  # errors of links with a suggestion of a similar name
UNLIMITED = 1.7976931348623157e308  # the largest double represents infinity where URDF requires a number
COUNTS = {1: "a number", 3: "three numbers", 4: "four numbers"}

# Joint types of URDF that a chain can have, and those that only joints next to the chain can have.
KINDS: dict[str, JointKind] = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed",
}  # fmt: skip
UNSUPPORTED_TYPES = ("floating", "planar")

# Names that `write_urdf` gives: the fixed joints for base, tip and tool of a chain, the start of the names of
# those that carry a further mass of a link, and the material of placeholder shapes.
BASE_JOINT, TIP_JOINT, TOOL_JOINT = "urmpipe_base", "urmpipe_tip", "urmpipe_tool"
MASS_JOINT = "urmpipe_mass_"
PLACEHOLDER_MATERIAL = "urmpipe"


@dataclass(slots=True)
class Node:
    """One element.

    Attributes:
        tag: Its name as written, prefix included.
        attributes: Its attributes.
        line: Its line in the file, from 1.
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


def _read_xml(path: Path) -> Node:
    """Return the root element of an XML file.

    Entities can be declared only in a document type, so a document with one is rejected at its first
    character: nothing is ever expanded or fetched.

    Raises:
        RobotError: If the file cannot be read, is not well-formed, or has a document type or an attribute of
            more than `MAX_ATTRIBUTE` letters.
    """
    content = read_contents(path, RobotError, (".urdf",))
    parser = expat.ParserCreate()
    document = Node("", {}, 0)
    ancestors = [document]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if (longest := max(map(len, attributes.values()), default=0)) > MAX_ATTRIBUTE:
            message = f"found an attribute of {longest} letters, allowed: {MAX_ATTRIBUTE} at most"
            raise RobotError(Finding(message, str(path), line=parser.CurrentLineNumber))
        node = Node(tag, attributes, parser.CurrentLineNumber)
        ancestors[-1].children.append(node)
        ancestors.append(node)

    def end(_: str) -> None:
        ancestors.pop()

    def doctype(*_: object) -> None:
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


@dataclass(frozen=True, slots=True)
class Edge:
    """A joint of the file, between two links.

    Attributes:
        joint: The joint; one of an unsupported type is fixed.
        type: URDF's type.
        parent: The link before it.
        child: The link after it.
        line: Its line in the file.
    """

    joint: Joint
    type: str
    parent: str
    child: str
    line: int


@dataclass(slots=True)
class UrdfTree:
    """The links and joints of a file.

    Attributes:
        file: The file, as the user named it.
        name: The robot's name.
        links: The element of each link by its name.
        edges: The joints by name.
        colours: The <color> of each material that has one, by the material's name.
        faults: All errors.
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
        """Add an error."""
        self.faults.append(Finding(message, self.file, line=line, hints=hints))

    def below(self, link: str) -> list[Edge]:
        """Return the joints after a link, in the order of the file."""
        return [edge for edge in self.edges.values() if edge.parent == link]


def read_tree(path: Path) -> UrdfTree:
    """Return the links and joints of a URDF file, with all errors in `faults`.

    Raises:
        RobotError: If the file is no URDF.
    """
    root = _read_xml(path)
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
    known: dict[str, Node] | dict[str, Edge]
    for tag, known in (("link", tree.links), ("joint", tree.edges)):
        for node in root.all(tag):
            name = node.attributes.get("name")
            if not name:
                tree.fault(f"{tag} without a name", node.line)
            elif name in known:
                message = f"{tag} {name}: duplicate name; first defined in line {known[name].line}"
                tree.fault(message, node.line)
            elif tag == "link":
                tree.links[name] = node
            else:
                tree.edges[name] = _read_joint(tree, node, name)
    for node in root.walk():
        name, colour = node.attributes.get("name"), node.first("color")
        if node.tag == "material" and name and colour:
            tree.colours.setdefault(name, colour)
    _check_links(tree)
    _check_mimics(tree)
    return tree


def _read_joint(tree: UrdfTree, node: Node, name: str) -> Edge:
    type_ = node.attributes.get("type", "")
    if type_ not in KINDS and type_ not in UNSUPPORTED_TYPES:
        tree.fault(f"joint {name}: found type {format_value(type_)}; allowed: {', '.join(KINDS)}", node.line)
    parent, child = (_read_link_name(tree, node, name, end) for end in ("parent", "child"))
    kind = KINDS.get(type_, "fixed")
    lower, upper, velocity, acceleration, effort = _read_limits(tree, node, name, type_)
    joint = Joint(
        name,
        kind,
        read_origin(tree, node, f"joint {name}"),
        (0.0, 0.0, 1.0) if kind == "fixed" else _read_axis(tree, node, name),
        lower=lower,
        upper=upper,
        velocity=velocity,
        acceleration=acceleration,
        effort=effort,
        mimic=None if kind == "fixed" else _read_mimic(tree, node, name),
    )
    return Edge(joint, type_, parent, child, node.line)


def _read_link_name(tree: UrdfTree, node: Node, joint: str, end: Literal["parent", "child"]) -> str:
    """Return the name of the link at one end of a joint, which must be in the file."""
    element = node.first(end)
    link = element.attributes.get("link") if element else None
    if not link:
        tree.fault(f'joint {joint}: no <{end} link="...">; allowed: one', node.line)
        tree.sound = False
        return ""
    if link not in tree.links:
        hint = format_suggestion(link, tree.links) if len(tree.faults) < MAX_SUGGESTIONS else ""
        tree.fault(f"joint {joint}: {end} {format_value(link)}; allowed: a link of the file{hint}", node.line)
        tree.sound = False
    return link


def _read_axis(tree: UrdfTree, node: Node, joint: str) -> tuple[float, float, float]:
    """Return the unit axis; an axis of unit length keeps its bits."""
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


def _read_limits(
    tree: UrdfTree, node: Node, joint: str, type_: str
) -> tuple[float, float, float, float, float]:
    """Return lower, upper, velocity, acceleration and effort; infinite if the file has no limit."""
    limit = node.first("limit")
    if limit is None or type_ == "fixed":
        return -math.inf, math.inf, math.inf, math.inf, math.inf
    place = f"joint {joint}: limit"
    rates: list[float] = []
    for key in ("velocity", "acceleration", "effort"):
        (value,) = read_numbers(tree, limit, place, key, (math.inf,))
        if value < 0.0:
            tree.fault(f"{place} {key}: found {value:g}; allowed: 0 (not known) or more", limit.line)
        rates.append(value or math.inf)  # 0 is no limit
    velocity, acceleration, effort = rates
    if type_ == "continuous" or not limit.attributes.keys() & {"lower", "upper"}:
        return -math.inf, math.inf, velocity, acceleration, effort
    (lower,), (upper,) = (read_numbers(tree, limit, place, end, (0.0,)) for end in ("lower", "upper"))
    if lower > upper:
        tree.fault(f"{place}: lower {lower:g} above upper {upper:g}", limit.line)
    return lower, upper, velocity, acceleration, effort


def _read_mimic(tree: UrdfTree, node: Node, joint: str) -> Mimic | None:
    element = node.first("mimic")
    if element is None:
        return None
    place = f"joint {joint}: mimic"
    (multiplier,) = read_numbers(tree, element, place, "multiplier", (1.0,))
    (offset,) = read_numbers(tree, element, place, "offset", (0.0,))
    return Mimic(element.attributes.get("joint", ""), multiplier, offset)


def read_origin(tree: UrdfTree, node: Node, place: str) -> Transform:
    """Return the frame of an element's <origin>, the identity without one.

    Args:
        tree: The file; it collects the errors.
        node: The element.
        place: Name of the element in the errors.
    """
    origin = node.first("origin")
    if origin is None:
        return Transform()
    x, y, z = read_numbers(tree, origin, f"{place}: origin", "xyz", (0.0, 0.0, 0.0))
    rx, ry, rz = read_numbers(tree, origin, f"{place}: origin", "rpy", (0.0, 0.0, 0.0))
    return from_xyz_rpy((x, y, z), (rx, ry, rz), f"URDF {place}")


def read_numbers(
    tree: UrdfTree, node: Node, place: str, attribute: str, default: Sequence[float]
) -> tuple[float, ...]:
    """Return the numbers of an attribute, as many as the default has; only limits may be infinite.

    Args:
        tree: The file; it collects the errors.
        node: The element.
        place: Name of the element in the errors.
        attribute: The attribute's name.
        default: The value of a missing or invalid attribute.
    """
    text = node.attributes.get(attribute)
    if text is None:
        return tuple(default)
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    values = tuple(math.copysign(math.inf, value) if abs(value) >= UNLIMITED else value for value in numbers)
    is_finite = node.tag == "limit" or all(math.isfinite(value) for value in values)
    if len(values) != len(default) or any(math.isnan(value) for value in values) or not is_finite:
        tree.fault(
            f"{place} {attribute}: found {format_value(text)}, expected {COUNTS[len(default)]}", node.line
        )
        return tuple(default)
    return values


def _check_links(tree: UrdfTree) -> None:
    """Report links with two parents, and loops."""
    joint_before: dict[str, Edge] = {}
    for edge in tree.edges.values():
        if edge.child and edge.child in joint_before:
            both = f"{joint_before[edge.child].joint.name} and {edge.joint.name}"
            tree.fault(f"link {edge.child}: child of joints {both}; allowed: one parent", edge.line)
            tree.sound = False
        joint_before.setdefault(edge.child, edge)
    visited: set[str] = set()
    for start in tree.links:
        link = start
        path: list[str] = []
        while link in joint_before and link not in visited:
            visited.add(link)
            path.append(link)
            link = joint_before[link].parent
        if link in path:
            loop = [link, *reversed(path[path.index(link) :])]
            tree.fault(f"links {' -> '.join(loop)} form a loop; allowed: a tree", joint_before[link].line)
            tree.sound = False


def _check_mimics(tree: UrdfTree) -> None:
    for edge in tree.edges.values():
        mimic = edge.joint.mimic
        if mimic is not None and mimic.joint not in tree.edges:
            tree.fault(
                f"joint {edge.joint.name}: mimics {format_value(mimic.joint)}; allowed: a joint of the file",
                edge.line,
            )
