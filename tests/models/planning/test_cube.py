"""The contours of ISO 9283's cube, against the paper's points and the geometry of a cube."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.planning.path import PLANES, PathRows, cube_rows

CENTRE = np.array([1.7, 0.0, 1.0])
SECTIONS = [(kind, plane) for kind, planes in PLANES.items() for plane in planes]
WITHIN = 1e-11
"""In halves of an edge of 0.05 m: a rounding of 1e-15 m, which a first line of 0.01 a prolongs 49 times."""

lengths = st.floats(0.05, 2.0)
cubes = st.tuples(lengths, st.floats(0.0, 0.49), st.tuples(*[st.floats(-5.0, 5.0)] * 3))
"""Edge in [m], radius as a share of it, centre in [m]."""


def corners_of(rows: PathRows) -> tuple[FloatArray, FloatArray]:
    """Return the corners that the arcs round, shape (4, 3), and the ways between them, shape (5, 3)."""
    corner, corners, ways = rows.position[0], [], []
    for position, radius in zip(rows.position[1:], rows.radius[1:], strict=True):
        way = position - corner
        way *= 1.0 + radius / np.linalg.norm(way)
        corner = corner + way
        corners.append(corner)
        ways.append(way)
    return np.array(corners[:-1]), np.array(ways)


def length_of(rows: PathRows) -> float:
    """Return the length of lines and arcs: a corner takes 2 r from its sides, and its arc adds pi / 2 r."""
    arcs = (math.pi / 2.0 - 2.0) * rows.radius.sum()
    return float(np.linalg.norm(corners_of(rows)[1], axis=1).sum() + arcs)


def test_the_paper_s_contour_has_its_points() -> None:
    """Source: [Iso9283]_ section 5."""
    rows = cube_rows("wall", 0.6, 0.03, CENTRE)
    printed = [[1.7, 0.3], [1.97, 0.3], [2.0, -0.27], [1.43, -0.3], [1.4, 0.27], [1.7, 0.3]]
    # Each coordinate is rounded a few times, by 2^-53 of 2 m.
    np.testing.assert_allclose(rows.position, [[*point, 1.0] for point in printed], rtol=0, atol=1e-15)
    assert rows.radius.tolist() == [0.0, 0.03, 0.03, 0.03, 0.03, 0.0]
    assert (rows.corner, rows.variant.tolist(), rows.rotation) == (False, [2] * 6, None)


def test_the_tangent_points_of_a_diagonal_are_those_of_equation_5() -> None:
    """On the sides along face diagonals 0.5 (a - R sqrt 2), on the edges 0.5 a - R (errata).

    Source: [Iso9283]_ eq. 5.
    """
    first, second = cube_rows("diagonal", 0.6, 0.03, CENTRE).position[1:3] - CENTRE
    on_diagonal, on_edge = 0.5 * (0.6 - 0.03 * math.sqrt(2.0)), 0.5 * 0.6 - 0.03
    np.testing.assert_allclose(first, [on_diagonal, 0.3, on_diagonal], rtol=0, atol=1e-15)
    np.testing.assert_allclose(second, [0.3, -on_edge, 0.3], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("kind", "length"), [("wall", 2.348496), ("diagonal", 2.845552)])
def test_each_section_has_the_length_of_its_kind(kind: str, length: float) -> None:
    found = [length_of(cube_rows(kind, 0.6, 0.03, CENTRE, plane)) for plane in PLANES[kind]]
    assert found == pytest.approx([length] * len(found), abs=5e-7, rel=0)  # six decimals are printed


@given(cube=cubes, section=st.sampled_from(SECTIONS))
def test_the_corners_are_those_of_a_rectangle_on_the_cube(
    cube: tuple[float, float, tuple[float, float, float]], section: tuple[str, str]
) -> None:
    (side, share, centre), (kind, plane) = cube, section
    rows = cube_rows(kind, side, share * side, np.array(centre), plane)
    corners, ways = corners_of(rows)
    places = np.abs(corners - centre) / (0.5 * side)
    assert sorted(np.rint(places).sum(axis=1).tolist()) == [2.0 if kind == "wall" else 3.0] * 4
    np.testing.assert_allclose(places, np.rint(places), rtol=0, atol=WITHIN)
    turns = np.einsum("ij,ij->i", ways[:-1], ways[1:]) / side**2
    np.testing.assert_allclose(turns, 0.0, rtol=0, atol=WITHIN)
    assert rows.position[0].tolist() == rows.position[-1].tolist()
    middle = 0.5 * (corners[0] + corners[3])
    np.testing.assert_allclose(rows.position[0], middle, rtol=0, atol=WITHIN)


def test_a_plane_names_the_axes_of_a_wall_in_their_order() -> None:
    flat = cube_rows("wall", 0.6, 0.03, np.zeros(3)).position
    for plane in PLANES["wall"]:
        axes = ["xyz".index(axis) for axis in plane]
        turned = cube_rows("wall", 0.6, 0.03, np.zeros(3), plane).position
        assert turned[:, axes].tolist() == flat[:, :2].tolist()


def test_the_diagonals_are_turned_about_the_vertical_axis_through_the_centre() -> None:
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    positions = [
        cube_rows("diagonal", 0.6, 0.03, CENTRE, plane).position - CENTRE for plane in PLANES["diagonal"]
    ]
    for before, after in zip(positions, positions[1:] + positions[:1], strict=True):
        np.testing.assert_allclose(before @ quarter.T, after, rtol=0, atol=1e-15)  # a rounding of 2 m


def test_without_a_radius_the_corners_are_stops() -> None:
    rows = cube_rows("wall", 0.6, 0.0, np.zeros(3))
    assert rows.position[1:5, :2].tolist() == [[0.3, 0.3], [0.3, -0.3], [-0.3, -0.3], [-0.3, 0.3]]
    assert rows.radius.tolist() == [0.0] * 6


def test_the_tool_is_held_along_it() -> None:
    rotation = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    rows = cube_rows("diagonal", 0.6, 0.03, CENTRE, rotation=rotation)
    assert rows.rotation is not None
    assert rows.rotation.tolist() == [rotation.tolist()] * 6


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"kind": "floor"}, "found 'floor', allowed: wall, diagonal"),
        ({"plane": "c1"}, "plane of a wall section: found 'c1', allowed: xy, xz, yz"),
        ({"side": 0.06}, "found a = 0.06 m, allowed: more than 2 r = 0.06 m"),
        (
            {"side": -0.6, "radius": -0.03, "plane": "zx"},
            "plane of a wall section: found 'zx', allowed: xy, xz, yz\n"
            "found a = -0.6 m, allowed: more than 0\nfound r = -0.03 m, allowed: 0 or more",
        ),
    ],
)  # fmt: skip
def test_what_is_no_contour_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(OptionError) as caught:
        cube_rows(**{"kind": "wall", "side": 0.6, "radius": 0.03, "centre": CENTRE, **given})
    assert str(caught.value) == said
