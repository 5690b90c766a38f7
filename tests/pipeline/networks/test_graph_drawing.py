"""The graph of a network as SVG: all names are in it, nothing hides a word, edges of two bodies bow apart."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from made_networks import NAMES, found
from urmpipe_models.networks.mechanism import build_graph
from urmpipe_models.networks.parts import Body
from urmpipe_pipeline.networks.drives import caption, is_driven, ties
from urmpipe_pipeline.networks.graph_drawing import graph_svg
from urmpipe_pipeline.networks.graph_layout import GAP_PX, Edge, GraphLayout, graph_layout
from urmpipe_pipeline.networks.parts_in_space import CONTROL_COLOUR

SVG = "{http://www.w3.org/2000/svg}"


@cache
def layout_of(name: str) -> GraphLayout:
    """Return the layout of a network's graph, made once a session."""
    result = found(name)
    edges = [Edge(name, caption(one), one.bodies) for name, one in ties(result.network).items()]
    return graph_layout(result.network.body_names, edges)


@cache
def drawn(name: str) -> str:
    """Return the drawing of a network's graph, made once a session."""
    return graph_svg(found(name))


def words(svg: str, kind: str) -> list[str]:
    """The texts of a class."""
    return [
        "".join(one.itertext()) for one in ET.fromstring(svg).iter(f"{SVG}text") if one.get("class") == kind
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_in_it(name: str) -> None:
    result = found(name)
    svg, network = drawn(name), result.network
    assert words(svg, "body") == list(network.body_names)
    assert words(svg, "tie") == [caption(one) for one in ties(network).values()]
    key = " ".join(one.text or "" for one in ET.fromstring(svg).iter(f"{SVG}text"))
    for control in network.controls:
        assert f"control {control.name} = " in key
    assert len([one for one in ET.fromstring(svg).iter() if one.get("class") == "hatch"]) == 1  # the ground's


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_what_controls_drive_is_in_their_colour(name: str) -> None:
    result = found(name)
    driven = [caption(one) for one in ties(result.network).values() if is_driven(one)]
    texts = [one for one in ET.fromstring(drawn(name)).iter(f"{SVG}text") if one.get("class") == "tie"]
    assert ["".join(one.itertext()) for one in texts if one.get("fill") == CONTROL_COLOUR] == driven


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_elements_are_dashed_and_loops_and_clusters_stand_behind(name: str) -> None:
    result = found(name)
    svg = ET.fromstring(drawn(name))
    dashed = [one for one in svg.iter(f"{SVG}polyline") if one.get("stroke-dasharray")]
    assert len(dashed) == len(result.network.elements)
    polygons = [one.get("class") for one in svg.iter(f"{SVG}polygon")]
    clusters = len(result.clusters) if len(result.clusters) > 1 else 0
    assert polygons == ["cluster"] * clusters + ["loop"] * len(result.loops)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_words_hide_neither_bodies_nor_words(name: str) -> None:
    layout = layout_of(name)
    bodies, labels = list(layout.nodes.values()), [one.words for one in layout.lines]
    assert sum(a.shared(b) for a, b in combinations([*bodies, *labels], 2)) == 0.0


def test_edges_between_the_same_bodies_bow_apart() -> None:
    layout = layout_of("stewart-gough")
    middles = np.array([one.curve[len(one.curve) // 2] for one in layout.lines])
    apart = np.linalg.norm(middles[:, np.newaxis] - middles, axis=2)[np.triu_indices(6, 1)]
    assert apart.min() > 15.0  # a line of text and more


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_loop_goes_round_its_bodies(name: str) -> None:
    result = found(name)
    layout, owners = layout_of(name), ties(result.network)
    for loop in result.loops:
        way = layout.loop(loop)
        np.testing.assert_allclose(way[0], way[-1], rtol=0, atol=1e-9)  # it closes, in px
        bodies = {body for one in loop for body in owners[one].bodies}
        middles = np.array([layout.nodes[body].middle for body in bodies])
        nearest = np.linalg.norm(way[:, np.newaxis] - middles, axis=2).min(axis=0)
        assert nearest.max() < 1e-9


@pytest.mark.slow
def test_the_same_graph_gives_the_same_drawing() -> None:
    assert graph_svg(replace(found("chain"))) == drawn("chain")


def test_names_of_a_stranger_are_drawn_letter_by_letter() -> None:
    result, evil = found("tree"), '<b>&"'
    bodies = (*result.network.bodies[:-1], Body(evil))
    joints = [
        replace(one, bodies=(one.bodies[0], evil)) if "tool" in one.bodies else one
        for one in result.network.joints
    ]
    network = replace(result.network, bodies=bodies, joints=tuple(joints))
    svg = graph_svg(replace(result, network=network, clusters=build_graph(network).clusters))
    assert evil in words(svg, "body")


@st.composite
def graphs(draw: st.DrawFn) -> tuple[Sequence[str], list[Edge]]:
    """Bodies, and edges that hold all of them together."""
    names = [f"body{k}" for k in range(draw(st.integers(1, 8)))]
    pairs = [(draw(st.integers(0, k - 1)), k) for k in range(1, len(names))]
    others = list(product(range(len(names)), repeat=2))
    pairs += draw(
        st.lists(st.sampled_from([one for one in others if one[0] != one[1]] or [(0, 0)]), max_size=5)
    )
    pairs = [one for one in pairs if one[0] != one[1]]
    return names, [Edge(f"e{k}", f"e{k} R", (names[a], names[b])) for k, (a, b) in enumerate(pairs)]


@pytest.mark.slow
@given(graphs())
@settings(deadline=None, max_examples=25)
def test_bodies_of_any_graph_are_apart(graph: tuple[Sequence[str], list[Edge]]) -> None:
    layout = graph_layout(*graph)
    assert list(layout.nodes) == list(graph[0])
    assert [one.edge for one in layout.lines] == graph[1]
    for a, b in combinations(layout.nodes.values(), 2):
        assert a.grown(GAP_PX / 2.0 - 0.1).shared(b.grown(GAP_PX / 2.0 - 0.1)) == 0.0
    for one in layout.lines:
        ends = np.array([layout.nodes[body].middle for body in one.edge.bodies])
        np.testing.assert_allclose(one.curve[[0, -1]], ends, rtol=0, atol=1e-6)  # in px
