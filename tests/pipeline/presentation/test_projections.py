"""Views of arms and paths along the axes of the world: one scale, aligned, with numbers at the axes."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asserting import there
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.presentation.palette import MASS_COLOUR
from urmpipe_pipeline.presentation.projections import (
    ABOVE,
    FRONT,
    LEGEND_WIDE,
    MASS_PX,
    SIDEWAYS,
    Mass,
    ProjectionView,
    Sketch,
    chain_masses,
    draw_projections,
)
from urmpipe_pipeline.presentation.scene import Spot

VIEWS = (SIDEWAYS, FRONT, ABOVE)
SVG = "{http://www.w3.org/2000/svg}"
ARM = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.8], [0.3, 0.1, 1.4], [1.5, -0.4, 0.7]])
ROUNDED = 0.11
"""Places are written to 0.1 px: two of them differ by as much."""


def drawn(sketch: Sketch, views: tuple[ProjectionView, ...] = VIEWS) -> ET.Element:
    return ET.fromstring(draw_projections(sketch, views, "an arm"))


def points(svg: ET.Element) -> list[FloatArray]:
    """The points of all lines in pixels, x to the right and y down."""
    texts = [there(line.get("points")) for line in svg.findall(f"{SVG}polyline")]
    return [np.array([pair.split(",") for pair in text.split()], float) for text in texts]


def number(element: ET.Element, name: str) -> float:
    return float(there(element.get(name)))


def frames(svg: ET.Element) -> list[FloatArray]:
    """Left, top, right and bottom of each view."""
    boxes = [one for one in svg.findall(f"{SVG}rect") if one.get("fill") == "none"]
    sides = np.array([[number(one, name) for name in ("x", "y", "width", "height")] for one in boxes])
    return list(np.column_stack((sides[:, :2], sides[:, :2] + sides[:, 2:])))


def test_views_have_one_scale_and_stand_as_in_a_technical_drawing() -> None:
    side, front, above = points(drawn(Sketch([ARM])))
    scale = np.ptp(side[:, 0]) / np.ptp(ARM[:, 0])
    for line, axes in ((side, [0, 2]), (front, [1, 2]), (above, [0, 1])):
        wanted = scale * (ARM - ARM[0])[:, axes] * [1.0, -1.0]
        np.testing.assert_allclose(line - line[0], wanted, rtol=0.0, atol=ROUNDED)
    np.testing.assert_allclose(above[:, 0], side[:, 0], rtol=0.0, atol=ROUNDED)  # above each other
    np.testing.assert_allclose(front[:, 1], side[:, 1], rtol=0.0, atol=ROUNDED)  # beside each other
    assert front[:, 0].min() > side[:, 0].max()
    assert above[:, 1].min() > side[:, 1].max()


@given(st.floats(1e-3, 50.0), st.floats(-20.0, 20.0))
def test_everything_is_inside_its_view_whatever_its_size_and_place(size: float, away: float) -> None:
    svg = drawn(Sketch([size * ARM + away]))
    width, height = number(svg, "width"), number(svg, "height")
    for line, (left, top, right, bottom) in zip(points(svg), frames(svg), strict=True):
        assert (line >= [left, top]).all()
        assert (line <= [right, bottom]).all()
        assert right <= width
        assert bottom <= height


def values(svg: ET.Element, view: int) -> tuple[FloatArray, FloatArray]:
    """The numbers at the horizontal axis of a view, and where they stand."""
    left, _, right, bottom = frames(svg)[view]
    texts = [
        (float(there(one.text)), number(one, "x"))
        for one in svg.findall(f"{SVG}text")
        if one.get("text-anchor") == "middle"
        and re.fullmatch(r"-?[\d.]+(e-\d+)?", there(one.text))
        and left <= number(one, "x") <= right
        and 0.0 < number(one, "y") - bottom < 20.0
    ]
    found, places = zip(*texts, strict=True)
    return np.array(found), np.array(places)


@pytest.mark.parametrize("size", [0.01, 0.3, 1.0, 7.0])
def test_numbers_at_an_axis_are_round_and_where_they_belong(size: float) -> None:
    svg = drawn(Sketch([size * ARM]))
    (side, *_) = points(svg)
    told, places = values(svg, 0)
    assert len(told) >= 2
    step = np.diff(told)
    np.testing.assert_allclose(step, step[0], rtol=1e-5)  # six digits
    assert f"{step[0]:e}"[0] in "125"
    scale = np.ptp(side[:, 0]) / np.ptp(size * ARM[:, 0])
    np.testing.assert_allclose(places, side[0, 0] + scale * told, rtol=0.0, atol=2 * ROUNDED)
    assert np.diff(places).min() >= 50.0 - ROUNDED


def test_spots_at_one_place_share_a_name() -> None:
    spots = [Spot((1.5, -0.4, 0.7), "one", "#222"), Spot((1.5, 0.4, 0.7), "two", "#222")]
    names = [one.text for one in drawn(Sketch([ARM], spots=spots)).findall(f"{SVG}text")]
    assert [names.count(one) for one in ("one, two", "one", "two")] == [1, 2, 2]  # they are one from the side


def test_a_path_breaks_no_drawing_where_it_is_not_known() -> None:
    path = np.array([[0.0, 0.0, 0.0], [np.nan] * 3, [1.0, 1.0, 1.0]])
    arm, way = points(drawn(Sketch([ARM], path), (SIDEWAYS,)))
    assert (len(arm), len(way)) == (4, 2)
    assert np.isfinite(way).all()


def test_what_stands_in_one_point_is_drawn() -> None:
    (line,) = points(drawn(Sketch([np.zeros((2, 3))]), (FRONT,)))
    assert np.isfinite(line).all()


def test_masses_are_dots_as_large_as_balls_of_one_density() -> None:
    masses = [Mass((0.0, 0.0, 0.4), 0.5), Mass((0.2, 0.0, 1.0), 4.0)]
    svg = drawn(Sketch([ARM], masses=masses), (SIDEWAYS, FRONT))
    dots = [one for one in svg.findall(f"{SVG}circle") if one.get("fill") == MASS_COLOUR]
    *placed, legend = dots
    assert [number(one, "r") for one in placed] == [MASS_PX / 2, MASS_PX] * 2  # 8 times the mass
    assert number(placed[0], "cx") < number(placed[1], "cx")
    words = [one.text for one in svg.findall(f"{SVG}text")][-1]
    assert words == "mass centres, as large as balls of one density: 0.5 to 4 kg"
    bottom = max(box[3] for box in frames(svg))
    assert bottom < number(legend, "cy") < number(svg, "height")


def test_the_line_about_masses_fits_below_a_slim_arm() -> None:
    upright = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    svg = drawn(Sketch([upright], masses=[Mass((0.0, 0.0, 0.5), 1.0)]), (SIDEWAYS,))
    assert number(svg, "width") == LEGEND_WIDE
    assert number(drawn(Sketch([upright]), (SIDEWAYS,)), "width") < LEGEND_WIDE


def test_the_masses_of_a_chain_stand_where_its_joints_take_them() -> None:
    joint = Joint("q1", axis=(0.0, 0.0, 1.0))
    heavy, none = Inertial("q1", 2.0, (0.5, 0.0, 0.1)), Inertial("q1", 0.0)
    chain = Chain("arm", (joint,), inertials=(heavy, none))
    (mass,) = chain_masses(chain, np.array([np.pi / 2]))
    np.testing.assert_allclose(mass.position, (0.0, 0.5, 0.1), rtol=0.0, atol=1e-15)
    assert mass.mass == 2.0
    assert chain_masses(Chain("bare", (joint,)), np.zeros(1)) == []
