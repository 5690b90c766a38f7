"""At a communication point every input is set from an output of the same instant, with few calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from urmpipe_fmus.cosim.order import Exchange, ExchangeOrder, Loop, strongly_connected_components
from urmpipe_fmus.cosim.system import Port

Wired = tuple[list[Port], dict[Port, list[Port]], dict[Port, Port]]


@st.composite
def wired(draw: st.DrawFn) -> Wired:
    """Some blocks with inputs, outputs, dependencies and connections, loops among them."""
    counts = draw(st.lists(st.tuples(st.integers(0, 3), st.integers(1, 3)), min_size=1, max_size=5))
    outputs = [Port(f"b{i}", f"y{k}") for i, (_, n) in enumerate(counts) for k in range(n)]
    depends = {
        port: [
            Port(port.block, f"u{k}")
            for k in draw(st.sets(st.integers(0, counts[int(port.block[1:])][0])))
            if k < counts[int(port.block[1:])][0]
        ]
        for port in outputs
    }
    inputs = [Port(f"b{i}", f"u{k}") for i, (n, _) in enumerate(counts) for k in range(n)]
    sources = {port: draw(st.sampled_from(outputs)) for port in inputs if draw(st.booleans())}
    return outputs, depends, sources


def assert_fresh(steps: Sequence[Exchange | Loop], wiring: Wired) -> None:
    """Assert that what an output depends on is set before it is read, from what is already read."""
    outputs, depends, sources = wiring
    known: set[Port] = set()
    current: set[Port] = set()
    read: list[Port] = []
    for step in steps:
        torn = set(step.torn) if isinstance(step, Loop) else set()
        for one in step.exchanges if isinstance(step, Loop) else (step,):
            ports = [Port(one.block, name) for name in one.inputs]
            assert all(port in torn or sources[port] in known for port in ports)
            current.update(ports)
            for output in (Port(one.block, name) for name in one.outputs):
                assert all(port in current for port in depends[output] if port in sources)
                known.add(output)
                read.append(output)
    assert sorted(read) == sorted(outputs)
    assert current == set(sources)


@settings(deadline=None)  # a slow computer is no fault
@given(wired())
def test_every_input_is_that_of_the_instant(wiring: Wired) -> None:
    assert_fresh(ExchangeOrder(*wiring).steps(), wiring)


@settings(deadline=None)  # a slow computer is no fault
@given(wired())
def test_loops_are_the_parts_of_the_graph_that_lead_back_to_themselves(wiring: Wired) -> None:
    outputs, depends, sources = wiring
    place = {port: i for i, port in enumerate(outputs)}
    edges = [(place[sources[u]], place[y]) for y in outputs for u in depends[y] if u in sources]
    graph = csr_array(
        (np.ones(len(edges)), ([a for a, _ in edges], [b for _, b in edges])), shape=(len(place), len(place))
    )
    _, label = connected_components(graph, connection="strong")
    ours = strongly_connected_components(outputs, lambda y: [sources[u] for u in depends[y] if u in sources])
    assert sorted(sorted(place[port] for port in part) for part in ours) == sorted(
        sorted(int(i) for i in np.flatnonzero(label == one)) for one in set(label.tolist())
    )
    rings = {one for one in set(label.tolist()) if (label == one).sum() > 1} | {
        int(label[a]) for a, b in edges if a == b
    }
    assert sum(isinstance(step, Loop) for step in ExchangeOrder(*wiring).steps()) == len(rings)


def test_blocks_in_a_row_are_read_once_each_in_their_order_whatever_that_of_the_system() -> None:
    names = [f"b{i}" for i in range(200)]
    outputs = [Port(name, "y") for name in reversed(names)]
    depends = {port: [Port(port.block, "u")] for port in outputs}
    sources = {Port(b, "u"): Port(a, "y") for a, b in pairwise(names)}
    steps = ExchangeOrder(outputs, depends, sources).steps()
    assert [step.block for step in steps if isinstance(step, Exchange)] == names


def test_a_row_may_be_longer_than_pythons_recursion_limit() -> None:
    row = [Port(f"b{i}", "y") for i in range(2000)]
    before = {port: row[max(i - 1, 0) : i] for i, port in enumerate(row)}
    assert strongly_connected_components(row[::-1], lambda port: before[port]) == [[port] for port in row]


def test_a_block_is_called_twice_only_where_it_must() -> None:
    outputs = [Port("plant", "x"), Port("plant", "y"), Port("control", "u")]
    depends: Mapping[Port, list[Port]] = {
        outputs[0]: [],
        outputs[1]: [Port("plant", "u")],
        outputs[2]: [Port("control", "x")],
    }
    sources = {Port("control", "x"): outputs[0], Port("plant", "u"): outputs[2]}
    assert ExchangeOrder(outputs, depends, sources).steps() == [
        Exchange("plant", (), ("x",)),
        Exchange("control", ("x",), ("u",)),
        Exchange("plant", ("u",), ("y",)),
    ]


def test_a_loop_is_torn_where_least_is_unknown_and_named_by_its_shortest_ring() -> None:
    outputs = [Port(name, "y") for name in "abc"]
    depends = {port: [Port(port.block, "u"), Port(port.block, "v")] for port in outputs}
    sources = {
        Port("a", "u"): Port("c", "y"),
        Port("b", "u"): Port("a", "y"),
        Port("c", "u"): Port("b", "y"),
        Port("a", "v"): Port("b", "y"),
    }
    (loop,) = ExchangeOrder(outputs, depends, sources).steps()
    assert isinstance(loop, Loop)
    assert loop.torn == (Port("b", "u"),)
    assert loop.ring == "a.y -> b.u -> b.y -> a.v"
    assert [one.block for one in loop.exchanges] == ["b", "c", "a"]
