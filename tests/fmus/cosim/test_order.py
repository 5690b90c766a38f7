"""At a communication point every input is set from an output of the same instant, with few calls."""

from __future__ import annotations

from collections.abc import Sequence
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
    inputs = [Port(f"b{i}", f"u{k}") for i, (n, _) in enumerate(counts) for k in range(n)]
    depends = {y: [u for u in inputs if u.block == y.block and draw(st.booleans())] for y in outputs}
    sources = {u: draw(st.sampled_from(outputs)) for u in inputs if draw(st.booleans())}
    return outputs, depends, sources


def assert_fresh(steps: Sequence[Exchange | Loop], wiring: Wired) -> None:
    """Assert that what an output depends on is set before it is read, from what is already read."""
    outputs, depends, sources = wiring
    known: set[Port] = set()
    current: set[Port] = set()
    read: list[Port] = []
    for step in steps:
        torn = set(step.torn) if isinstance(step, Loop) else set()
        for exchange in step.exchanges if isinstance(step, Loop) else (step,):
            ports = [Port(exchange.block, name) for name in exchange.inputs]
            assert all(port in torn or sources[port] in known for port in ports)
            current.update(ports)
            for output in (Port(exchange.block, name) for name in exchange.outputs):
                assert all(port in current for port in depends[output] if port in sources)
                known.add(output)
                read.append(output)
    assert sorted(read) == sorted(outputs)
    assert current == set(sources)


@settings(deadline=None)  # a slow computer is no fault
@given(wired())
def test_every_input_is_that_of_the_instant_and_loops_are_what_leads_back_to_itself(wiring: Wired) -> None:
    steps = ExchangeOrder(*wiring).steps()
    assert_fresh(steps, wiring)
    outputs, depends, sources = wiring
    before = {y: [sources[u] for u in depends[y] if u in sources] for y in outputs}
    place = {port: i for i, port in enumerate(outputs)}
    edges = np.array([(place[x], place[y]) for y in outputs for x in before[y]], int).reshape(-1, 2)
    size = (len(place), len(place))
    _, label = connected_components(csr_array((np.ones(len(edges)), edges.T), size), connection="strong")
    parts = strongly_connected_components(outputs, before.__getitem__)
    expected = sorted(np.flatnonzero(label == part).tolist() for part in np.unique(label))
    assert sorted(sorted(place[port] for port in part) for part in parts) == expected
    rings = {part for part in label.tolist() if (label == part).sum() > 1}
    rings |= {int(label[x]) for x, y in edges if x == y}
    assert sum(isinstance(step, Loop) for step in steps) == len(rings)


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
