"""Paths: laws of lines and arcs, both meanings of a radius, the cube of ISO 9283."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from asserting import there
from random_paths import by_first_points, corner_rows, slow_law
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import PathError
from urmpipe_models.math3d import from_offset, rotation_angle, to_matrices, to_quaternions
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.path import PLANES, LineArcPath, PathRows, cube_rows

# Of coordinates of up to 1 m through some tens of operations, and of unit vectors, in [m] and [-]
ROUNDING = 1e-12
# In halves of an edge of 0.05 m: a rounding of 1e-15 m, which a first line of 0.01 a prolongs 49 times
WITHIN = 1e-11
# The rows of the paper, section 5: a cube of 0.6 m about CENTRE, R = 0.03 m
CONTOUR = [[1.7, 0.3, 1], [1.97, 0.3, 1], [2, -0.27, 1], [1.43, -0.3, 1], [1.4, 0.27, 1], [1.7, 0.3, 1]]
CENTRE = np.array([1.7, 0.0, 1.0])
SECTIONS = [(kind, plane) for kind, planes in PLANES.items() for plane in planes]
centres = st.tuples(*[st.floats(-5.0, 5.0)] * 3)


def along(path: LineArcPath, count: int = 400) -> FloatArray:
    return np.linspace(0.0, path.total, count)


def test_the_papers_contour() -> None:
    """Five lines and four arcs that close, [Iso9283]_ section 5; lengths after errata of the paper."""
    rows = cube_rows("wall", 0.6, 0.03, CENTRE)
    assert_allclose(rows.position, CONTOUR, rtol=0, atol=1e-15)  # a few roundings by 2^-53 of 2 m
    assert rows.radius.tolist() == [0.0, 0.03, 0.03, 0.03, 0.03, 0.0]
    assert (rows.corner, rows.variant.tolist(), rows.rotation) == (False, [2] * 6, None)
    path = rows_to_path(PathRows(np.array(CONTOUR), 0.03))
    assert path.kinds == ["line", "arc"] * 4 + ["line"]
    assert len(path) == 9
    arc = 0.015 * np.pi
    assert_allclose(path.length, [0.27, arc, 0.54, arc, 0.54, arc, 0.54, arc, 0.27], atol=ROUNDING)
    assert path.total == pytest.approx(2.348496, abs=5e-7)  # the printed digits
    ends = path.points(np.array([0.0, path.total])).position
    assert_allclose(ends, [CONTOUR[0]] * 2, atol=ROUNDING)
    corners = [[2, 0.3, 1], [2, -0.3, 1], [1.4, -0.3, 1], [1.4, 0.3, 1]]
    assert_allclose(path.corners, corners, atol=ROUNDING)


@slow_law(corner_rows(variants=True), st.floats(0.01, 0.99))
def test_a_path_is_a_smooth_curve_of_unit_speed(rows: PathRows, share: float) -> None:
    path = rows_to_path(rows)
    inner = path.bounds[1:-1]
    moving = inner[~np.isin(inner, path.stops)]
    before, after = path.points(moving, before=True), path.points(moving)
    assert_allclose(before.tangent, after.tangent, atol=ROUNDING)
    jumps = path.points(inner, before=True).position - path.points(inner).position
    assert_allclose(jumps, 0.0, atol=ROUNDING * (1.0 + np.abs(path.start).max()))
    # points are on their arc
    s = along(path)
    points, k = path.points(s), path.segment_at(s)
    assert_allclose(np.linalg.norm(points.tangent, axis=1), 1.0, atol=ROUNDING)
    arc = np.isfinite(path.radius[k])
    radius = path.radius[k][arc]
    centre = path.start[k][arc] + radius[:, None] * path.normal[k][arc]
    distance = np.linalg.norm(points.position[arc] - centre, axis=1)
    assert_allclose(distance, radius, rtol=ROUNDING, atol=ROUNDING)
    bent = np.linalg.norm(points.curvature, axis=1)
    assert_allclose(bent, np.where(arc, 1.0 / path.radius[k], 0.0), rtol=ROUNDING, atol=ROUNDING)
    # central differences inside every segment, whose error is h^2 / (6 r^2) and h^2 / (6 r^3)
    s = path.bounds[:-1] + share * path.length
    h = 1e-4 * np.minimum(np.minimum(share, 1.0 - share) * path.length, np.minimum(path.radius, 1.0))
    ahead, behind, here = path.points(s + h), path.points(s - h), path.points(s)
    slope = (ahead.position - behind.position) / (2.0 * h)[:, None]
    # the error of the difference, and the rounding of s over h
    allowed = 1e-8 + 2e-16 * (1.0 + path.total) / h.min()
    assert_allclose(slope, here.tangent, atol=allowed)
    size = np.minimum(path.radius, 1.0)[:, None]
    bend = (ahead.tangent - behind.tangent) / (2.0 * h)[:, None] * size
    assert_allclose(bend, here.curvature * size, atol=allowed)
    # a polygon through all bounds is shorter by less than (step / r)^2 / 24 of each arc
    s = np.unique(np.concatenate((along(path, 2000), path.bounds)))
    polygon = float(np.linalg.norm(np.diff(path.points(s).position, axis=0), axis=1).sum())
    shares = np.minimum((np.diff(s).max() / path.radius[path.arcs]) ** 2 / 24.0, 1.0)
    lost = float((shares * path.length[path.arcs]).sum())
    assert path.total - lost - ROUNDING <= polygon <= path.total + 1e-9  # rounding of 2000 sums
    assert path.total == pytest.approx(float(path.length.sum()), rel=ROUNDING)


@slow_law(corner_rows(variants=True), st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_one_curve_by_corners_or_first_points_reversed_or_moved(rows: PathRows, motion: list[float]) -> None:
    path, first = rows_to_path(rows), rows_to_path(by_first_points(rows))
    assert path.kinds == first.kinds
    s = along(path)
    points = path.points(s)
    # the lines of the other follow from one another: what rounds in one, the next has at its end
    assert_allclose(first.points(s).position, points.position, atol=1e-9)
    back = PathRows(rows.position[::-1], rows.radius[::-1], corner=True, variant=rows.variant[::-1])
    returned = rows_to_path(back).points(path.total - s)
    assert_allclose(returned.position, points.position, atol=1e-11)  # sums of up to 20 m of path
    inside = np.abs(s[:, None] - path.bounds).min(axis=1) > 1e-11
    assert_allclose(returned.tangent[inside], -points.tangent[inside], atol=1e-9)
    # by the paper's meaning, the way back begins its arcs where the way there ends them
    position = rows.position.copy()
    position[path.row[path.arcs]] = path.points(path.bounds[path.arcs + 1], before=True).position
    last = rows_to_path(PathRows(position[::-1], rows.radius[::-1], variant=rows.variant[::-1]))
    assert_allclose(last.points(path.total - s).position, points.position, atol=1e-9)
    frame = from_offset(motion)
    R, p = np.array(frame.rotation, dtype=float), np.array(frame.translation, dtype=float)
    moved = PathRows(rows.position @ R.T + p, rows.radius, corner=True, variant=rows.variant)
    # radii are sharpened by up to 20 of a corner
    assert_allclose(rows_to_path(moved).points(s).position, points.position @ R.T + p, atol=1e-9)
    # stops are at their points, corners at the middle of their arcs, first points where these begin
    assert_allclose(path.points(path.stops).position, rows.position[path.stop_row], atol=1e-11)
    rounded = np.flatnonzero(rows.radius > 0.0)
    middle = 0.5 * (path.bounds[path.arcs] + path.bounds[path.arcs + 1])
    assert_allclose(path.at[rounded], middle, atol=ROUNDING)
    assert_allclose(first.at[rounded], first.bounds[first.arcs], atol=ROUNDING)


@pytest.mark.parametrize("corner", [True, False])
def test_arcs_touch_in_a_plane_of_any_place(corner: bool) -> None:
    """Their coordinates are those of a map: rounding has the size of 1e6 m."""
    middle = [[1, 0, 0], [1, 1, 0]] if corner else [[0.5, 0, 0], [1, 0.5, 0]]
    points = np.array([[0, 0, 0], *middle, [2, 1, 0.0]])
    for angle in np.linspace(0.1, 6.1, 20):
        frame = from_offset([6e5, 5e6, 100.0, angle, 0.3 * angle, 0.2])
        moved = points @ np.array(frame.rotation).T + np.array(frame.translation)
        path = rows_to_path(PathRows(moved, 0.5, corner))
        assert path.kinds == ["line", "arc", "arc", "line"]
        # a coordinate is known to 1e-9 m
        assert_allclose(path.length, [0.5, 0.25 * np.pi, 0.25 * np.pi, 0.5], atol=1e-8)


@slow_law(corner_rows(), st.lists(st.floats(-2.0, 2.0), min_size=60, max_size=60))
def test_the_tool_turns_evenly_from_row_to_row(rows: PathRows, angles: list[float]) -> None:
    rotation = to_matrices(to_quaternions(np.array(angles).reshape(20, 3)[: len(rows)], "zyx"))
    path = rows_to_path(PathRows(rows.position, rows.radius, corner=True, rotation=rotation))
    orientation = there(path.orientation)
    at = orientation.matrices(path.at)
    assert_allclose(at[:-1], rotation[:-1], atol=ROUNDING)
    assert_allclose(at[-1], rotation[-1], atol=1e-9)  # after a whole turn by the last rate
    quats = orientation.quaternions(0.5 * (path.at[1:] + path.at[:-1]))
    ends = to_quaternions(rotation.reshape(-1, 9), "matrix")
    in_order = np.insert(orientation.quaternions(path.at), np.arange(1, len(rows)), quats, axis=0)
    cosines = np.einsum("ij,ij->i", in_order[1:], in_order[:-1])
    assert cosines.min() >= math.sqrt(0.5) - ROUNDING  # one sign: half of at most half a turn a step
    first_half, second_half = rotation_angle(ends[:-1], quats), rotation_angle(quats, ends[1:])
    assert_allclose(first_half, second_half, atol=1e-7)  # acos-like near 0
    speed = np.linalg.norm(orientation.rate, axis=1) * np.diff(path.at)
    assert_allclose(speed, rotation_angle(ends[:-1], ends[1:]), atol=1e-7)


@pytest.mark.parametrize(("digits", "uneven"), [(15, False), (6, False), (4, True)])
def test_an_even_turn_may_be_rounded_to_six_digits(digits: int, uneven: bool) -> None:
    points = np.array([[2, 0, 3], [4, 0, 3], [4, 4, 3], [0, 4, 3], [0, 0, 3], [2, 0, 3.0]]) / 10.0
    angle = 2.0 * rows_to_path(PathRows(points, 0.05, corner=True)).at
    turned = to_matrices(to_quaternions(np.round(angle, digits)[:, None] * [0.0, 0.0, 1.0], "vector"))
    path = rows_to_path(PathRows(points, 0.05, corner=True, rotation=turned))
    assert bool(len(there(path.orientation).uneven_rows)) == uneven


@given(st.floats(0.01, 3.0), st.floats(-1.0, 1.0), st.floats(0.01, 1.0))
def test_the_largest_radius_is_that_through_the_next_row(a: float, x: float, y: float) -> None:
    """Just below it there is a path, just above there is none."""
    points = np.array([[-a, 0, 0], [0, 0, 0], [x, y, 0]])
    largest = (x * x + y * y) / (2.0 * y)
    rows_to_path(PathRows(points, 0.999 * largest))
    with pytest.raises(PathError):
        rows_to_path(PathRows(points, 1.001 * largest))


def test_the_tangent_points_of_a_diagonal_are_those_of_equation_5() -> None:
    """On the sides along face diagonals 0.5 (a - R sqrt 2), on the edges 0.5 a - R (errata).

    Source: [Iso9283]_ eq. 5.
    """
    first, second = cube_rows("diagonal", 0.6, 0.03, CENTRE).position[1:3] - CENTRE
    on_diagonal, on_edge = 0.5 * (0.6 - 0.03 * math.sqrt(2.0)), 0.5 * 0.6 - 0.03
    assert_allclose(first, [on_diagonal, 0.3, on_diagonal], rtol=0, atol=1e-15)
    assert_allclose(second, [0.3, -on_edge, 0.3], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("kind", "length"), [("wall", 2.348496), ("diagonal", 2.845552)])
def test_sections_have_the_length_of_their_kind_and_keep_the_orientation(kind: str, length: float) -> None:
    down = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    for plane in PLANES[kind]:
        rows = cube_rows(kind, 0.6, 0.03, CENTRE, plane, down)
        assert np.array_equal(there(rows.rotation), [down] * 6)
        assert rows_to_path(rows).total == pytest.approx(length, abs=5e-7, rel=0)  # six decimals are printed


@given(st.floats(0.05, 2.0), st.floats(0.0, 0.49), centres, st.sampled_from(SECTIONS))
def test_the_corners_are_those_of_a_rectangle_on_the_cube(
    side: float, share: float, centre: tuple[float, float, float], section: tuple[str, str]
) -> None:
    kind, plane = section
    rows = cube_rows(kind, side, share * side, np.array(centre), plane)
    corners, lines = [rows.position[0]], list[FloatArray]()  # corners that the arcs round, lines between
    for position, radius in zip(rows.position[1:], rows.radius[1:], strict=True):
        line = position - corners[-1]
        lines.append(line * (1.0 + radius / np.linalg.norm(line)))
        corners.append(corners[-1] + lines[-1])
    places = np.abs(np.array(corners[1:5]) - centre) / (0.5 * side)
    assert sorted(np.rint(places).sum(axis=1).tolist()) == [2.0 if kind == "wall" else 3.0] * 4
    assert_allclose(places, np.rint(places), rtol=0, atol=WITHIN)
    cosines = np.einsum("ij,ij->i", lines[:-1], lines[1:]) / side**2
    assert_allclose(cosines, 0.0, rtol=0, atol=WITHIN)
    assert rows.position[0].tolist() == rows.position[-1].tolist()
    assert_allclose(rows.position[0], 0.5 * (corners[1] + corners[4]), rtol=0, atol=WITHIN)


def test_a_plane_names_the_axes_of_a_wall_in_order_and_diagonals_turn_about_the_vertical_axis() -> None:
    flat = cube_rows("wall", 0.6, 0.03, np.zeros(3)).position
    for plane in PLANES["wall"]:
        turned = cube_rows("wall", 0.6, 0.03, np.zeros(3), plane).position
        assert turned[:, ["xyz".index(axis) for axis in plane]].tolist() == flat[:, :2].tolist()
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    diagonals = [cube_rows("diagonal", 0.6, 0.03, CENTRE, plane).position for plane in PLANES["diagonal"]]
    before = (np.array(diagonals) - CENTRE) @ quarter.T
    assert_allclose(before, np.roll(diagonals, -1, axis=0) - CENTRE, rtol=0, atol=1e-15)  # a rounding of 2 m
