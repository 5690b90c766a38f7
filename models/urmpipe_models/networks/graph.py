"""The graph of a network: bodies as nodes, joints and constraint elements as edges."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from urmpipe_models.networks.parts import Parts

Structure = Literal["tree", "loops", "closed chain"]


@dataclass(frozen=True, slots=True)
class Branch:
    """A joint of the spanning forest.

    Attributes:
        joint: Its number among the joints.
        parent: The body nearer to the root.
        child: The body that the joint moves.
        sign: 1 where the child is the joint's second body, -1 where it is its first.
    """

    joint: int
    parent: str
    child: str
    sign: int


@dataclass(frozen=True)
class Graph:
    """What hangs on what.

    Attributes:
        network: The network.
        roots: The ground, and of each part that no joint ties to it the body that has its freedoms.
        branches: The joints of the spanning forest, each after those that its parent hangs on.
        cuts: The numbers of the joints that close loops: there these are cut.
        clusters: Names of the bodies of each part that joints hold together, that of the ground first.
    """

    network: Parts
    roots: tuple[str, ...]
    branches: tuple[Branch, ...]
    cuts: tuple[int, ...]
    clusters: tuple[tuple[str, ...], ...]

    @cached_property
    def loops(self) -> tuple[tuple[str, ...], ...]:
        """Names of the joints and elements of each loop: of a cut joint the way between its bodies, and it.

        Then, elements one by one, those that close a loop with what ties the parts already.
        """
        edges = [(one.name, *one.bodies) for one in self.network.joints]
        tree = [edges[one.joint] for one in self.branches]
        found = [(*_way(tree, *edges[k][1:]), edges[k][0]) for k in self.cuts]
        for element in self.network.elements:
            way = _way(tree, *element.bodies)
            if way:
                found.append((*way, element.name))
            else:
                tree.append((element.name, *element.bodies))
        return tuple(found)

    @property
    def structure(self) -> Structure:
        """Tree, closed chain (loops, and at each body two joints or elements or more), or loops."""
        if not self.loops:
            return "tree"
        ends = [name for _, one in self.network.ties for name in one.bodies]
        least = min(ends.count(name) for name in self.network.body_names)
        return "closed chain" if least >= 2 else "loops"


def graph_of(network: Parts) -> Graph:
    """Return the graph of a network, its spanning forest grown joint by joint in breadth."""
    placed = [one.name for one in network.bodies if one.start]
    roots: list[str] = []
    branches: list[Branch] = []
    clusters: list[tuple[str, ...]] = []
    seen: set[str] = set()
    for root in (network.ground, *placed, *network.body_names):
        if root not in seen:
            grown = _grown(network, root, seen)
            roots.append(root)
            branches += grown
            clusters.append((root, *(one.child for one in grown)))
    used = {one.joint for one in branches}
    cuts = tuple(k for k in range(len(network.joints)) if k not in used)
    return Graph(network, tuple(roots), tuple(branches), cuts, tuple(clusters))


def _grown(network: Parts, root: str, seen: set[str]) -> list[Branch]:
    """Return the branches of the part that a body is in; its bodies become seen."""
    branches: list[Branch] = []
    seen.add(root)
    edge = [root]
    while edge:
        body = edge.pop(0)
        for k, joint in enumerate(network.joints):
            for parent, child, sign in ((*joint.bodies, 1), (*joint.bodies[::-1], -1)):
                if parent == body and child not in seen:
                    seen.add(child)
                    edge.append(child)
                    branches.append(Branch(k, parent, child, sign))
    return branches


def _way(tree: Sequence[tuple[str, str, str]], start: str, end: str) -> tuple[str, ...]:
    """Return the names of the edges on the way from a node to another; none if no way leads there."""
    ways: dict[str, tuple[str, ...]] = {start: ()}
    edge = [start]
    while edge and end not in ways:
        node = edge.pop(0)
        for name, first, second in tree:
            for here, there in ((first, second), (second, first)):
                if here == node and there not in ways:
                    ways[there] = (*ways[node], name)
                    edge.append(there)
    return ways.get(end, ())


def parts_without(network: Parts, left_out: Iterable[str]) -> list[set[str]]:
    """Return the sets of bodies that hang together by joints and elements without some of these, by name."""
    out = set(left_out)
    edges = [one.bodies for _, one in network.ties if one.name not in out]
    parts: list[set[str]] = [{name} for name in network.body_names]
    for first, second in edges:
        a, b = (next(part for part in parts if name in part) for name in (first, second))
        if a is not b:
            parts.remove(b)
            a |= b
    return parts
