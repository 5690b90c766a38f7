"""What the links of a URDF weigh: its <inertial> elements, on the joints of a chain that carry them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from typing import NamedTuple

from urmpipe_models.chains.inertial import Inertial
from urmpipe_models.dynamics.links import Symmetric, turned
from urmpipe_models.errors import Finding
from urmpipe_models.files.xml_tree import Node
from urmpipe_models.robots.urdf_tree import Carrier, UrdfTree, numbers_of, origin_of
from urmpipe_models.transform import Transform

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


def chain_masses(tree: UrdfTree, carriers: Sequence[Carrier]) -> ChainMasses:
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


def _fixed_to(tree: UrdfTree, carrier: Carrier, chain: Set[str]) -> Iterator[Carrier]:
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


def _inertial(tree: UrdfTree, carrier: Carrier) -> tuple[list[Inertial], list[str]]:
    """Return the inertial of a link in the frame that carries it, if there is one, and what is wrong."""
    found, wrong = _mass(tree, carrier.link)
    if found is None:
        return [], wrong
    frame = carrier.frame @ found.origin
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = turned(frame, found.inertia)
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
    origin = origin_of(tree, node, place)
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
    return [numbers_of(tree, element, f"{place}: {tag}", name, (0.0,))[0] for name in names]
