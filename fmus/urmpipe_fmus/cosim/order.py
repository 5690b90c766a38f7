"""In which order inputs are set and outputs are read at a communication point.

An output that depends on an input at once can be read only when that input is that of the same instant.
So outputs are read in topological order of their dependencies, as many of a block together as can be. Where
outputs depend on themselves there is an algebraic loop: some of its inputs are torn from their sources, and
found by iteration.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from urmpipe_fmus.cosim.system import Port


@dataclass(frozen=True, slots=True)
class Exchange:
    """Inputs of a block that are set, then outputs of it that are read.

    Attributes:
        block: Name of the block.
        inputs: Names of its inputs.
        outputs: Names of its outputs.
    """

    block: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Loop:
    """An algebraic loop: exchanges that are repeated until the torn inputs are what their sources give.

    Attributes:
        exchanges: One sweep through the loop.
        torn: The inputs that are guessed.
        ring: The loop, or the shortest of it: `a.y -> b.u -> b.y -> a.u`.
    """

    exchanges: tuple[Exchange, ...]
    torn: tuple[Port, ...]
    ring: str


class Order:
    """The order for some blocks.

    Args:
        outputs: Every output of every block, the blocks in their order.
        depends: The inputs that each output depends on at once.
        sources: The source of each connected input.
        given: Inputs that are known beforehand: from logs.
    """

    def __init__(
        self,
        outputs: Sequence[Port],
        depends: Mapping[Port, Iterable[Port]],
        sources: Mapping[Port, Port],
        given: Iterable[Port] = (),
    ) -> None:
        self._outputs = list(outputs)
        self._sources = sources
        self._depends = {one: [i for i in depends[one] if i in sources] for one in outputs}
        self._inputs: dict[str, list[Port]] = {}
        for port in (*sources, *given):
            self._inputs.setdefault(port.block, []).append(port)
        self._given = set(given)
        self._known: set[Port] = set()
        self._set: set[Port] = set()

    def steps(self) -> list[Exchange | Loop]:
        """Return the exchanges and loops of a communication point, in order."""
        loops = [part for part in components(self._outputs, self._before) if self._loops(part)]
        looped = {port for part in loops for port in part}
        left = [port for port in self._outputs if port not in looped]
        found: list[Exchange | Loop] = []
        while left or loops:
            ready = self._ready(left)
            if ready:
                found.append(self._exchange(ready))
                left = [port for port in left if port not in self._known]
            else:
                part = next(part for part in loops if self._reachable(part))
                loops.remove(part)
                found.append(self._loop(part))
        rest = [(name, self._settable(name, self._set)) for name in self._inputs]
        return found + [Exchange(name, inputs, ()) for name, inputs in rest if inputs]

    def _before(self, output: Port) -> list[Port]:
        """Return the outputs that an output depends on at once."""
        return [self._sources[one] for one in self._depends[output]]

    def _loops(self, part: Sequence[Port]) -> bool:
        return len(part) > 1 or part[0] in self._before(part[0])

    def _reachable(self, part: Sequence[Port]) -> bool:
        """Return whether all that goes into a loop from outside is known."""
        return all(one in self._known or one in part for port in part for one in self._before(port))

    def _ready(self, left: Sequence[Port]) -> list[Port]:
        """Return outputs of one block that can be read; if there is a choice, all that are left of it."""
        by_block: dict[str, list[Port]] = {}
        for port in left:
            by_block.setdefault(port.block, []).append(port)
        ready = {
            name: [port for port in ports if self._known.issuperset(self._before(port))]
            for name, ports in by_block.items()
        }
        whole = (ports for name, ports in ready.items() if len(ports) == len(by_block[name]))
        return next(whole, None) or next((ports for ports in ready.values() if ports), [])

    def _settable(self, block: str, but: Collection[Port]) -> tuple[str, ...]:
        """Return the inputs of a block that are known."""
        return tuple(
            port.variable
            for port in self._inputs.get(block, ())
            if port not in but and (port in self._given or self._sources[port] in self._known)
        )

    def _exchange(self, outputs: Sequence[Port]) -> Exchange:
        """Return an exchange that reads some outputs of a block."""
        block = outputs[0].block
        inputs = self._settable(block, self._set)
        self._set.update(Port(block, name) for name in inputs)
        self._known.update(outputs)
        return Exchange(block, inputs, tuple(port.variable for port in outputs))

    def _loop(self, part: Sequence[Port]) -> Loop:
        """Return a loop with as few torn inputs as one finds by tearing where the least are unknown.

        Its exchanges set all inputs that are known, again: a block that goes back in time forgets them.
        """
        torn: dict[Port, None] = {}
        exchanges: list[Exchange] = []
        left = list(part)

        def unknown(port: Port) -> list[Port]:
            """Return the inputs of an output that are neither torn nor fed by what is known."""
            return [i for i in self._depends[port] if i not in torn and self._sources[i] not in self._known]

        while left:
            first = min(left, key=lambda port: len(unknown(port)))
            torn.update(dict.fromkeys(unknown(first)))
            ready = [port for port in left if port.block == first.block and not unknown(port)]
            known = {*self._settable(first.block, ()), *(i.variable for i in torn if i.block == first.block)}
            inputs = tuple(i.variable for i in self._inputs.get(first.block, ()) if i.variable in known)
            exchanges.append(Exchange(first.block, inputs, tuple(port.variable for port in ready)))
            self._set.update(Port(first.block, name) for name in inputs)
            self._known.update(ready)
            left = [port for port in left if port not in ready]
        return Loop(tuple(exchanges), tuple(torn), self._ring(part))

    def _ring(self, part: Sequence[Port]) -> str:
        """Return the shortest way around a loop from its first output."""
        after: dict[Port, list[tuple[Port, Port]]] = {port: [] for port in part}
        for output in part:
            for one in self._depends[output]:
                if self._sources[one] in after:
                    after[self._sources[one]].append((one, output))
        ways: deque[tuple[Port, tuple[str, ...]]] = deque([(part[0], (str(part[0]),))])
        seen: set[Port] = set()
        while ways:
            here, way = ways.popleft()
            for through, output in after[here]:
                if output == part[0]:
                    return " -> ".join((*way, str(through)))
                if output not in seen:
                    seen.add(output)
                    ways.append((output, (*way, str(through), str(output))))
        raise AssertionError(part)  # a strongly connected part has a way around


def components(nodes: Iterable[Port], before: Callable[[Port], Iterable[Port]]) -> list[list[Port]]:
    """Return the strongly connected parts of a graph, each in the order of the nodes.

    Args:
        nodes: The nodes.
        before: The nodes from which edges lead to a node.

    Source: R. Tarjan, Depth-first search and linear graph algorithms, SIAM J. Comput. 1 (1972), 146-160;
    here with a stack of its own, so that long chains do not end in Python's recursion limit.
    """
    place = {node: i for i, node in enumerate(nodes)}
    number: dict[Port, int] = {}
    lowest: dict[Port, int] = {}
    open_nodes: dict[Port, None] = {}
    parts: list[list[Port]] = []
    for root in place:
        stack = [] if root in number else [(root, iter(before(root)))]
        while stack:
            node, edges = stack[-1]
            if node not in number:
                number[node] = lowest[node] = len(number)
                open_nodes[node] = None
            following = next(edges, None)
            if following is None:
                stack.pop()
                if stack:
                    parent = stack[-1][0]
                    lowest[parent] = min(lowest[parent], lowest[node])
                if lowest[node] == number[node]:
                    parts.append(sorted(_closed(open_nodes, node), key=place.__getitem__))
            elif following not in number:
                stack.append((following, iter(before(following))))
            elif following in open_nodes:
                lowest[node] = min(lowest[node], number[following])
    return parts


def _closed(open_nodes: dict[Port, None], root: Port) -> list[Port]:
    """Take the nodes from a root to the end off the open ones."""
    part: list[Port] = []
    while root in open_nodes:
        node, _ = open_nodes.popitem()
        part.append(node)
    return part
