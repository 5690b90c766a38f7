"""A drawing of a system shows all of it, without boxes or texts on top of each other."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foreign_fmus import INTEGRATOR, ZEROS, Foreign, Scalar, follow, gain, planned
from urmpipe_fmus.cosim import system_svg
from urmpipe_fmus.cosim.drawing import Box, Diagram, Layout, Pin, Wire
from urmpipe_models.elementwise import FloatArray

SVG = "{http://www.w3.org/2000/svg}"


@st.composite
def diagrams(draw: st.DrawFn) -> Diagram:
    """Boxes with ports, wired anyhow: rings, long wires, boxes apart."""
    counts = draw(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=7))
    boxes = {}
    for i, (inputs, outputs) in enumerate(counts):
        left, right = [Pin(f"u{k}") for k in range(inputs)], [Pin(f"y{k}") for k in range(outputs)]
        boxes[f"b{i}"] = Box(f"b{i}", "unit", left, right)
    sources = [(name, pin.name) for name, box in boxes.items() for pin in box.right]
    targets = [(name, pin.name) for name, box in boxes.items() for pin in box.left]
    wires = []
    for target in targets if sources else ():
        if draw(st.booleans()):
            source = draw(st.sampled_from(sources))
            wires.append(Wire(*source, *target))
    return Diagram(boxes, tuple(wires))


def sampled(points: list[tuple[float, float]]) -> FloatArray:
    """Points along the cubic curves of a wire, shape (n, 2)."""
    t = np.linspace(0.0, 1.0, 33)[:, np.newaxis]
    weights = ((1.0 - t) ** 3, 3.0 * t * (1.0 - t) ** 2, 3.0 * t**2 * (1.0 - t), t**3)
    corners = [points[k : k + 4] for k in range(0, len(points) - 1, 3)]
    curves = [sum(w * np.array(p) for w, p in zip(weights, one, strict=True)) for one in corners]
    return np.concatenate(curves)


@pytest.mark.slow
@settings(deadline=None)  # a slow computer is no fault
@given(diagrams())
def test_boxes_stand_apart_and_wires_go_from_port_to_port_around_them(shown: Diagram) -> None:
    layout, boxes = Layout(shown), shown.boxes.values()
    for a, b in combinations(boxes, 2):
        beside = a.x + a.width <= b.x or b.x + b.width <= a.x
        assert beside or a.y + a.height <= b.y or b.y + b.height <= a.y
    corners = [(box.x, box.y) for box in boxes] + [(box.x + box.width, box.y + box.height) for box in boxes]
    for wire in shown.wires:
        source, target = shown.boxes[wire.source], shown.boxes[wire.target]
        way = sampled(layout.route(wire))
        start = (source.x + source.width, source.y + source.offset(source.right, wire.output))
        end = (target.x, target.y + target.offset(target.left, wire.input))
        assert np.allclose(way[[0, -1]], [start, end])
        corners += [(x, y) for x, y in way]
        for box in boxes:
            inside = (way > (box.x + 1e-6, box.y)) & (way < (box.x + box.width - 1e-6, box.y + box.height))
            assert not inside.all(axis=1).any()
    assert all(0.0 <= x <= layout.width and 0.0 <= y <= layout.height for x, y in corners)


def test_wires_lead_to_the_right_but_for_those_that_close_a_ring() -> None:
    names = ["set", "control", "drive", "load"]
    boxes = {name: Box(name, "unit", [Pin("u"), Pin("v")], [Pin("y")]) for name in reversed(names)}
    ahead = [Wire(a, "y", b, "u") for a, b in pairwise(names)]
    layout = Layout(Diagram(boxes, (*ahead, Wire("load", "y", "control", "v"))))
    assert [boxes[name].layer for name in names] == [0, 1, 2, 3]
    assert [layout.is_feedback(wire) for wire in layout.wires] == [False, False, False, True]


def test_a_long_name_is_broken_into_lines_that_the_drawing_has_room_for() -> None:
    plan = planned({"i": INTEGRATOR}, {"i.u": "i.y"})
    plain = ET.fromstring(system_svg(plan))
    object.__setattr__(plan.system, "name", "N" * 120)
    drawn = ET.fromstring(system_svg(plan))
    titles = [one.text or "" for one in drawn.iter(f"{SVG}text") if one.get("class") == "title"]
    assert "".join(titles) == "N" * 120
    assert max(len(one) for one in titles) * 9.7 <= float(drawn.attrib["width"])  # 0.6 em of 16 px
    assert float(drawn.attrib["height"]) == float(plain.attrib["height"]) + 22.0 * (len(titles) - 1)


@pytest.mark.slow
def test_texts_fit_into_their_boxes_in_a_browser(tmp_path: Path) -> None:
    chromium = Path("/usr/bin/chromium")
    if not chromium.exists():
        pytest.skip("needs a browser: chromium")
    from playwright.sync_api import sync_playwright

    arm = (
        *(Scalar(f"phi[{i}]", i, "input", unit="rad") for i in (1, 2)),
        *(Scalar(f"idle{i}", 30 + i, unit="m") for i in range(14)),
    )
    source = tuple(Scalar(f"q[{i}]", i, unit="rad") for i in (1, 2))
    blocks = {"arm": Foreign("arm", arm), "source": Foreign("source", source), "g": gain()}
    log = follow("g.u", log="a<b>&.csv")
    plan = planned(blocks, {"arm.phi": "source.q"}, None, [log], column=lambda _: ZEROS)
    page = tmp_path / "drawing.svg"
    page.write_text(system_svg(plan), encoding="utf-8")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(chromium), args=["--no-sandbox"])
        tab = browser.new_page()
        tab.goto(page.as_uri())
        outside = tab.evaluate(
            """[...document.querySelectorAll('g > g')].flatMap(group => {
                const box = group.querySelector('rect.box').getBBox();
                return [...group.querySelectorAll('text')].filter(text => {
                    const b = text.getBBox();
                    const right = box.x + box.width, low = box.y + box.height;
                    return b.x < box.x || b.x + b.width > right || b.y + b.height > low;
                }).map(text => text.textContent);
            })"""
        )
        count = tab.evaluate("document.querySelectorAll('g > g text').length")
        browser.close()
    assert outside == []
    assert count > 20
