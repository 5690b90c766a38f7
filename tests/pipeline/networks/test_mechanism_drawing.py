"""The mechanism in three projections, and each assembly as a small picture."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from asserting import there
from made_networks import NAMES, found
from urmpipe_pipeline.networks.drawing import network_svg
from urmpipe_pipeline.networks.gallery import gallery_svg
from urmpipe_pipeline.networks.parts_in_space import body_colour
from urmpipe_pipeline.networks.scene import motion_plane
from urmpipe_pipeline.networks.sketch import JOINT_EDGE, mechanism_svg
from urmpipe_pipeline.presentation.projections import (
    ABOVE,
    FRONT,
    SIDEWAYS,
    Box,
    Piece,
    Sketch,
    convex_hull,
    draw_projections,
    least_overlapping,
    text_box,
)
from urmpipe_pipeline.presentation.scene import Spot

SVG = "{http://www.w3.org/2000/svg}"


def texts(svg: str) -> list[str]:
    return ["".join(one.itertext()) for one in ET.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_each_view_has_every_body_in_its_colour(name: str) -> None:
    result = found(name)
    svg = ET.fromstring(mechanism_svg(result))
    fills = [one.get("fill") for one in svg.iter(f"{SVG}polygon")]
    for body in result.network.body_names:
        assert fills.count(body_colour(result.network, body)) >= (1 if motion_plane(result) else 3)
    said = ", ".join("".join(one.itertext()) for one in svg.iter(f"{SVG}text") if one.get("class") == "name")
    assert all(body in said for body in result.network.body_names)


@pytest.mark.parametrize(("name", "joints", "views"), [("bars", 3, 1), ("rssr", 3, 3), ("tree", 7, 1)])
def test_each_joint_has_its_symbol_in_each_view(name: str, joints: int, views: int) -> None:
    """Those that controls drive have another colour."""
    svg = ET.fromstring(mechanism_svg(found(name)))
    symbols = [one for one in svg.iter(f"{SVG}polygon") if one.get("stroke") == JOINT_EDGE]
    assert len(symbols) == views * joints


def test_a_revolute_joint_is_a_circle_along_its_axis_and_a_rectangle_across() -> None:
    svg = ET.fromstring(mechanism_svg(found("sarrus")))
    symbols = [one for one in svg.iter(f"{SVG}polygon") if one.get("stroke") == JOINT_EDGE]
    corners = [len(there(one.get("points")).split()) for one in symbols]
    assert sorted(set(corners)) == [4, 20]
    assert corners.count(20) == 5  # two joints along y, three along x, each in one of three views


@pytest.mark.slow
def test_every_assembly_has_a_picture() -> None:
    result = found("stewart-gough", every=True)
    assert len(result.assemblies) > 5
    titles = [one for one in texts(gallery_svg(result)) if one.startswith("assembly ")]
    assert titles == [f"assembly {k}" for k in range(1, len(result.assemblies) + 1)]


@pytest.mark.slow
def test_one_file_has_all_drawings_below_each_other() -> None:
    one, every = found("bars"), found("bars", every=True)
    for result, count in ((one, 2), (every, 3), (found("too long"), 2)):
        svg = ET.fromstring(network_svg(result))
        parts = svg.findall(f"{SVG}svg")
        assert len(parts) == count
        tops = np.array([float(there(part.get("y"))) for part in parts])
        ends = tops + [float(there(part.get("height"))) for part in parts]
        assert (tops[1:] >= ends[:-1]).all()
        assert ends[-1] <= float(there(svg.get("height")))


def test_what_is_nearer_hides_what_is_behind() -> None:
    """Seen from the side, along y, what has the smaller y is nearer: it is drawn last."""
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    near, far = (
        Piece(square + np.array([0.0, y, 0.0]), "#000000", fill=fill)
        for y, fill in ((0.0, "#00ff00"), (1.0, "#ff0000"))
    )
    line = Piece(square[:2] + np.array([0.0, 2.0, 0.0]), "#0000ff", front=True)
    for pieces in ([near, far, line], [line, far, near]):
        svg = ET.fromstring(draw_projections(Sketch(pieces=pieces), (SIDEWAYS,), "two"))
        drawn = [
            one.get("fill") or one.get("stroke")
            for one in svg
            if one.tag in (f"{SVG}polygon", f"{SVG}polyline")
        ]
        assert drawn == ["#ff0000", "#00ff00", "none"]


def test_the_outline_of_a_solid_is_its_convex_hull() -> None:
    inner = np.array([[1.0, 1.0], [0.5, 1.5]])
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    assert convex_hull(np.concatenate((inner, corners))) == [tuple(one) for one in corners.tolist()]
    assert convex_hull(np.array([[3.0, 4.0]])) == [(3.0, 4.0)]
    assert sorted(convex_hull(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]))) == [(0.0, 0.0), (2.0, 2.0)]


def test_names_stand_beside_each_other() -> None:
    spots = [Spot((0.02 * k, 0.0, 0.0), f"name {k}", "#000000") for k in range(4)]
    sketch = Sketch(pieces=[Piece(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), "#000000")], names=spots)
    svg = ET.fromstring(draw_projections(sketch, (SIDEWAYS, FRONT, ABOVE), "names"))
    shown = [one for one in svg.iter(f"{SVG}text") if one.get("class") == "name"]
    sideways = {one.text: (float(there(one.get("x"))), float(there(one.get("y")))) for one in shown[:4]}
    boxes = [text_box(x, y - 4.5, "name 0", 12.0) for x, y in sideways.values()]
    assert len(boxes) == 4 or any("," in (one or "") for one in sideways)
    assert sum(a.shared(b) for k, a in enumerate(boxes) for b in boxes[:k]) == 0.0


def test_a_box_is_put_where_most_is_free() -> None:
    taken = [Box(0.0, 0.0, 10.0, 10.0)]
    first, second = Box(5.0, 5.0, 15.0, 15.0), Box(10.0, 10.0, 20.0, 20.0)
    assert least_overlapping([first, second], taken) == second
    assert least_overlapping([first, second], []) == first
