"""A drawing of a system shows all of it, without boxes or texts on top of each other."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foreign_fmus import COUNTER, INTEGRATOR, ZEROS, Foreign, Scalar, follow, gain, planned
from urmpipe_fmus.cosim import Plan, system_svg
from urmpipe_fmus.cosim.drawing import Box, Diagram, Layout, Pin, Wire, build_diagram
from urmpipe_models.elementwise import FloatArray

SVG = "{http://www.w3.org/2000/svg}"


@st.composite
def diagrams(draw: st.DrawFn) -> Diagram:
    """Boxes with ports, wired anyhow: rings, long wires, boxes apart."""
    counts = draw(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=7))
    boxes = {
        f"b{i}": Box(
            f"b{i}", "unit", [Pin(f"u{k}") for k in range(inputs)], [Pin(f"y{k}") for k in range(outputs)]
        )
        for i, (inputs, outputs) in enumerate(counts)
    }
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
        assert np.allclose(
            way[[0, -1]], [start, (target.x, target.y + target.offset(target.left, wire.input))]
        )
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


def arm_plan() -> Plan:
    arm = Foreign(
        name="arm",
        scalars=(
            *(Scalar(f"phi[{i}]", i, "input", unit="rad") for i in (1, 2)),
            *(Scalar(f"p[{i}]", 20 + i, unit="m") for i in (1, 2, 3)),
            *(Scalar(f"idle{i}", 30 + i) for i in range(14)),
        ),
    )
    source = Foreign(name="source", scalars=tuple(Scalar(f"q[{i}]", i, unit="rad") for i in (1, 2)))
    return planned(
        {"arm": arm, "source": source, "g": gain(), "i": INTEGRATOR},
        {"arm.phi": "source.q", "i.u": "g.y"},
        None,
        [follow("g.u", log="a<b>&.csv")],
        column=lambda _: ZEROS,
        description="An arm & <more>",
    )


@pytest.mark.slow
def test_arrays_are_one_port_and_one_wire_and_idle_outputs_are_counted() -> None:
    shown = build_diagram(arm_plan())
    assert shown.wires == (
        Wire("source", "q", "arm", "phi", 2),
        Wire("g", "y", "i", "u"),
        Wire("a<b>&.csv", "u", "g", "u", is_stepwise=True),
    )
    arm = shown.boxes["arm"]
    assert arm.left == [Pin("phi", 2, "rad")]
    assert [pin.name for pin in arm.right] == ["p", *(f"idle{i}" for i in range(9))]
    assert arm.hidden == 5


def test_a_log_is_called_by_its_file_whole_paths_tell_two_of_one_name_apart() -> None:
    names = ["far/away/in/a/folder/u.csv", "one/v.csv", "two/v.csv", "a.csv"]
    blocks = {f"b{i}": gain() for i in range(4)}
    inputs = [follow(f"b{i}.u", log=log) for i, log in enumerate(names)]
    shown = build_diagram(planned(blocks, None, None, inputs, column=lambda _: ZEROS))
    displayed = ["u.csv", "one/v.csv", "two/v.csv", "a.csv"]
    assert [name for name in shown.boxes if name not in blocks] == displayed
    assert [wire.source for wire in shown.wires] == displayed


def test_a_drawing_holds_names_units_and_connections_and_nothing_from_elsewhere() -> None:
    plan = arm_plan()
    svg = system_svg(plan)
    assert svg == system_svg(plan)
    texts = ["".join(one.itertext()) for one in ET.fromstring(svg).iter(f"{SVG}text")]
    for text in ("test", "An arm & <more>", "arm.fmu", "phi ×2 rad", "p ×3 m", "a<b>&.csv", "5 more"):
        assert text in texts
    ways = [one.text for one in ET.fromstring(svg).iter(f"{SVG}title")]
    assert ways == ["test", "source.q → arm.phi", "g.y → i.u", "a<b>&.csv.u → g.u"]
    assert svg.count("http") == 1  # the name space


def held_plan(**period: float) -> Plan:
    """Return a system in which a log is held and interpolated, a block samples, and an input stands still."""
    sampled = Foreign(
        name="sampled",
        scalars=(
            Scalar("e", 0, "input"),
            Scalar("y", 1),
            Scalar("period", 2, "parameter", start="0.005", unit="s"),
        ),
    )
    turned = Foreign(
        name="turned",
        scalars=(
            *(Scalar(f"a[{i}]", i, "input", unit="rad") for i in (1, 2, 3)),
            Scalar("b", 4, "input", unit="m"),
            Scalar("period", 5, "parameter", start="6.28", unit="rad"),  # no time
            Scalar("z", 6),
        ),
    )
    return planned(
        {"g": gain(), "i": INTEGRATOR, "s": sampled, "t": turned, "h": gain()},
        {"s.e": "g.y", "t.b": "s.y", "h.u": "t.z"},
        {"t": {"a": [0.5, 1.0 / 3.0, 0.5]}, "s": period},
        [follow("g.u", log="x.csv"), follow("i.u", "v", "x.csv", interpolate=True)],
        column=lambda _: ZEROS,
    )


def test_what_is_held_is_dashed_and_what_never_changes_has_its_value() -> None:
    shown = build_diagram(held_plan())
    assert [(wire.source, wire.target) for wire in shown.wires if wire.is_stepwise] == [
        ("s", "t"),
        ("x.csv", "g"),
    ]
    assert [(wire.source, wire.target) for wire in shown.wires if not wire.is_stepwise] == [
        ("g", "s"),
        ("t", "h"),
        ("x.csv", "i"),
    ]
    assert (shown.boxes["s"].kind, shown.boxes["t"].kind) == ("sampled.fmu, every 5 ms", "turned.fmu")
    assert [pin.label for pin in shown.boxes["t"].left] == ["a ×3 = 0.5, 0.333333, …", "b"]
    drawn = ET.fromstring(system_svg(held_plan(period=0.02)))
    dashed = [one for one in drawn.iter(f"{SVG}path") if "held" in (one.get("class") or "").split()]
    assert len(dashed) == 2
    texts = ["".join(one.itertext()) for one in drawn.iter(f"{SVG}text")]
    assert "sampled.fmu, every 20 ms" in texts
    assert texts[-2:] == [
        "Dashed: held between two samples, or two rows of a log.",
        "name = value: an input that nothing changes.",
    ]


def test_whole_numbers_and_truths_that_never_change_are_spelled_as_in_a_system_file() -> None:
    for by, on, said in (
        (2_000_000, True, ["by = 2000000", "on = true"]),
        (-1, False, ["by = -1", "on = false"]),
    ):
        shown = build_diagram(planned({"n": COUNTER}, {}, {"n": {"by": by, "on": on}}))
        assert [pin.label for pin in shown.boxes["n"].left] == said


def test_the_log_of_a_source_is_named_with_how_it_is_read() -> None:
    plan = planned({"a": INTEGRATOR, "b": gain()}, {"a.u": "b.y"}, {"b": {"u": 0.0}})
    for options, said in (
        ({"log": "far/run.csv"}, "gain.fmu, held: run.csv"),
        ({"log": "far/run.csv", "interpolate": True}, "gain.fmu, interpolated: run.csv"),
    ):
        first, source = plan.system.blocks
        played = replace(plan.system, blocks=(first, replace(source, options=options)))
        shown = build_diagram(replace(plan, system=played))
        assert shown.boxes["b"].kind == said
        assert [wire.is_stepwise for wire in shown.wires] == [said.count("held") == 1]


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

    page = tmp_path / "drawing.svg"
    page.write_text(system_svg(arm_plan()), encoding="utf-8")
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
