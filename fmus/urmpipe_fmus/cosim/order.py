"""The order in which inputs are set and outputs are read at a communication point.

An output that depends on an input at once can be read only after that input is set for the same instant.
So outputs are read in topological order of their dependencies, as many of a block together as possible.
Outputs that depend on themselves form an algebraic loop, a strongly connected component of the graph of
outputs: some of its inputs are torn from their sources, and found by iteration.

Source: R. Tarjan, Depth-first search and linear graph algorithms, SIAM J. Comput. 1 (1972), 146-160.
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
    """An algebraic loop: exchanges that are repeated until the torn inputs equal their sources.

    Attributes:
        exchanges: One sweep through the loop.
        torn: The inputs that are iterated.
        ring: The loop, or the shortest one of it, as text: `a.y -> b.u -> b.y -> a.u`.
    """

    exchanges: tuple[Exchange, ...]
    torn: tuple[Port, ...]
    ring: str


class ExchangeOrder:
    """The order of the exchanges of some blocks.

    Args:
        outputs: Every output of every block, the blocks in their order.
        depends: The inputs that each output depends on at once.
        sources: The source of each connected input.
        logged: Inputs from logs, known beforehand.
    """

    def __init__(
        self,
        outputs: Sequence[Port],
        depends: Mapping[Port, Iterable[Port]],
        sources: Mapping[Port, Port],
        logged: Iterable[Port] = (),
    ) -> None:
        self._outputs = list(outputs)
        self._sources = sources
        self._depends = {output: [port for port in depends[output] if port in sources] for output in outputs}
        self._inputs: dict[str, list[Port]] = {}
        for port in (*sources, *logged):
            self._inputs.setdefault(port.block, []).append(port)
        self._logged = set(logged)
        self._known: set[Port] = set()  # outputs that were read
        self._set: set[Port] = set()  # inputs that were set

    def steps(self) -> list[Exchange | Loop]:
        """Return the exchanges and loops of a communication point, in order."""
        components = strongly_connected_components(self._outputs, self._outputs_before)
        loops = [part for part in components if len(part) > 1 or part[0] in self._outputs_before(part[0])]
        looped = {port for part in loops for port in part}
        remaining = [port for port in self._outputs if port not in looped]
        steps: list[Exchange | Loop] = []
        while remaining or loops:
            ready = self._ready(remaining)
            if ready:
                inputs = self._settable(ready[0].block, self._set)
                steps.append(self._exchange(inputs, ready))
                remaining = [port for port in remaining if port not in self._known]
            else:
                part = next(part for part in loops if self._is_reachable(part))
                loops.remove(part)
                steps.append(self._loop(part))
        last = [(block, self._settable(block, self._set)) for block in self._inputs]
        return steps + [Exchange(block, inputs, ()) for block, inputs in last if inputs]

    def _outputs_before(self, output: Port) -> list[Port]:
        """Return the outputs that an output depends on at once."""
        return [self._sources[port] for port in self._depends[output]]

    def _is_reachable(self, part: Sequence[Port]) -> bool:
        """Return whether all inputs of a loop from outside are known."""
        sources = (source for port in part for source in self._outputs_before(port))
        return all(source in self._known or source in part for source in sources)

    def _ready(self, remaining: Sequence[Port]) -> list[Port]:
        """Return outputs of one block that can be read, preferably all that remain of it."""
        by_block: dict[str, list[Port]] = {}
        for port in remaining:
            by_block.setdefault(port.block, []).append(port)
        ready = {
            name: [port for port in ports if self._known.issuperset(self._outputs_before(port))]
            for name, ports in by_block.items()
        }
        complete = (ports for name, ports in ready.items() if len(ports) == len(by_block[name]))
        return next(complete, None) or next((ports for ports in ready.values() if ports), [])

    def _settable(self, block: str, already_set: Collection[Port]) -> tuple[str, ...]:
        """Return the inputs of a block whose values are known, except those already set."""
        return tuple(
            port.variable
            for port in self._inputs.get(block, ())
            if port not in already_set and (port in self._logged or self._sources[port] in self._known)
        )

    def _exchange(self, inputs: tuple[str, ...], outputs: Sequence[Port]) -> Exchange:
        """Return an exchange of a block, and note what it sets and reads."""
        block = outputs[0].block
        self._set.update(Port(block, name) for name in inputs)
        self._known.update(outputs)
        return Exchange(block, inputs, tuple(port.variable for port in outputs))

    def _loop(self, part: Sequence[Port]) -> Loop:
        """Return a loop with few torn inputs: the output with the fewest unknown inputs is torn first.

        Its exchanges set all known inputs again: a block that restores an earlier state loses them.
        """
        torn: dict[Port, None] = {}
        exchanges: list[Exchange] = []
        remaining = list(part)

        def unknown(port: Port) -> list[Port]:
            """Return the inputs of an output that are neither torn nor fed by a known output."""
            return [i for i in self._depends[port] if i not in torn and self._sources[i] not in self._known]

        while remaining:
            first = min(remaining, key=lambda port: len(unknown(port)))
            block = first.block
            torn.update(dict.fromkeys(unknown(first)))
            ready = [port for port in remaining if port.block == block and not unknown(port)]
            known = {*self._settable(block, ()), *(port.variable for port in torn if port.block == block)}
            names = (port.variable for port in self._inputs.get(block, ()))
            exchanges.append(self._exchange(tuple(name for name in names if name in known), ready))
            remaining = [port for port in remaining if port not in ready]
        return Loop(tuple(exchanges), tuple(torn), self._ring(part))

    def _ring(self, part: Sequence[Port]) -> str:
        """Return the shortest way around a loop from its first output, as text."""
        after: dict[Port, list[tuple[Port, Port]]] = {port: [] for port in part}
        for output in part:
            for port in self._depends[output]:
                if self._sources[port] in after:
                    after[self._sources[port]].append((port, output))
        paths: deque[tuple[Port, tuple[str, ...]]] = deque([(part[0], (str(part[0]),))])
        seen: set[Port] = set()
        while paths:
            port, path = paths.popleft()
            for through, output in after[port]:
                if output == part[0]:
                    return " -> ".join((*path, str(through)))
                if output not in seen:
                    seen.add(output)
                    paths.append((output, (*path, str(through), str(output))))
        raise AssertionError(part)  # a strongly connected component has a way around


def strongly_connected_components(
    nodes: Iterable[Port], before: Callable[[Port], Iterable[Port]]
) -> list[list[Port]]:
    """Return the strongly connected components of a graph, each in the order of the nodes.

    Tarjan's algorithm (see above) with an explicit stack: long chains do not reach Python's recursion limit.

    Args:
        nodes: The nodes.
        before: Returns the nodes from which edges lead to a node.
    """
    place = {node: i for i, node in enumerate(nodes)}
    number: dict[Port, int] = {}
    lowest: dict[Port, int] = {}
    open_nodes: dict[Port, None] = {}
    components: list[list[Port]] = []
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
                    component: list[Port] = []
                    while node in open_nodes:
                        component.append(open_nodes.popitem()[0])
                    components.append(sorted(component, key=place.__getitem__))
            elif following not in number:
                stack.append((following, iter(before(following))))
            elif following in open_nodes:
                lowest[node] = min(lowest[node], number[following])
    return components
