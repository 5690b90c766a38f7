"""Paths: laws of lines and arcs, both meanings of a radius, rows that make no path, the cube of ISO 9283."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import refusal
from random_paths import by_first_points, corner_rows
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError, PathError
from urmpipe_models.math3d import from_offset, rotation_angle, to_matrices, to_quaternions
from urmpipe_models.planning.from_rows import rows_to_path, validate_rows
from urmpipe_models.planning.path import PLANES, LineArcPath, PathRows, cube_rows

some = settings(max_examples=40)

ROUNDING = 1e-12
"""Of coordinates of up to 1 m through some tens of operations, and of unit vectors, in [m] and [-]."""

CONTOUR = [[1.7, 0.3, 1], [1.97, 0.3, 1], [2, -0.27, 1], [1.43, -0.3, 1], [1.4, 0.27, 1], [1.7, 0.3, 1]]
"""The rows of the paper, section 5: a cube of 0.6 m about (1.7, 0, 1), R = 0.03 m."""


def along(path: LineArcPath, count: int = 400) -> FloatArray:
    return np.linspace(0.0, path.total, count)


def test_the_papers_contour() -> None:
    """Five lines and four arcs that close; lengths after errata of the paper."""
    path = rows_to_path(PathRows(np.array(CONTOUR), 0.03))
    assert path.kinds == ["line", "arc"] * 4 + ["line"]
    assert len(path) == 9
    arc = 0.015 * np.pi
    np.testing.assert_allclose(path.length, [0.27, arc, 0.54, arc, 0.54, arc, 0.54, arc, 0.27], atol=ROUNDING)
    assert path.total == pytest.approx(2.348496, abs=5e-7)  # the printed digits
    np.testing.assert_allclose(
        path.points(np.array([0.0, path.total])).position, [CONTOUR[0]] * 2, atol=ROUNDING
    )
    corners = [[2, 0.3, 1], [2, -0.3, 1], [1.4, -0.3, 1], [1.4, 0.3, 1]]
    np.testing.assert_allclose(path.corners, corners, atol=ROUNDING)


@pytest.mark.slow
@some
@given(corner_rows(variants=True))
def test_the_direction_goes_on_where_segments_meet(rows: PathRows) -> None:
    path = rows_to_path(rows)
    inner = path.bounds[1:-1]
    moving = inner[~np.isin(inner, path.stops)]
    before, after = path.points(moving, before=True), path.points(moving)
    np.testing.assert_allclose(before.tangent, after.tangent, atol=ROUNDING)
    met = path.points(inner, before=True).position - path.points(inner).position
    np.testing.assert_allclose(met, 0.0, atol=ROUNDING * (1.0 + np.abs(path.start).max()))


@pytest.mark.slow
@some
@given(corner_rows(variants=True))
def test_points_are_on_their_arc_at_unit_speed(rows: PathRows) -> None:
    path = rows_to_path(rows)
    s = along(path)
    points, k = path.points(s), path.segment_at(s)
    np.testing.assert_allclose(np.linalg.norm(points.tangent, axis=1), 1.0, atol=ROUNDING)
    arc = np.isfinite(path.radius[k])
    radius = path.radius[k][arc]
    centre = path.start[k][arc] + radius[:, None] * path.normal[k][arc]
    away = np.linalg.norm(points.position[arc] - centre, axis=1)
    np.testing.assert_allclose(away, radius, rtol=ROUNDING, atol=ROUNDING)
    bent = np.linalg.norm(points.curvature, axis=1)
    np.testing.assert_allclose(bent, np.where(arc, 1.0 / path.radius[k], 0.0), rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.slow
@some
@given(corner_rows(variants=True), st.floats(0.01, 0.99))
def test_derivatives_are_those_of_the_place(rows: PathRows, share: float) -> None:
    """By central differences inside every segment, whose error is h^2 / (6 r^2) and h^2 / (6 r^3)."""
    path = rows_to_path(rows)
    s = path.bounds[:-1] + share * path.length
    h = 1e-4 * np.minimum(np.minimum(share, 1.0 - share) * path.length, np.minimum(path.radius, 1.0))
    ahead, behind, here = path.points(s + h), path.points(s - h), path.points(s)
    slope = (ahead.position - behind.position) / (2.0 * h)[:, None]
    # the error of the difference, and the rounding of s over h
    allowed = 1e-8 + 2e-16 * (1.0 + path.total) / h.min()
    np.testing.assert_allclose(slope, here.tangent, atol=allowed)
    bend = (ahead.tangent - behind.tangent) / (2.0 * h)[:, None] * np.minimum(path.radius, 1.0)[:, None]
    np.testing.assert_allclose(bend, here.curvature * np.minimum(path.radius, 1.0)[:, None], atol=allowed)


@pytest.mark.slow
@some
@given(corner_rows())
def test_the_length_is_that_of_a_fine_polygon(rows: PathRows) -> None:
    """A polygon through all bounds is shorter by less than (step / r)^2 / 24 of each arc."""
    path = rows_to_path(rows)
    s = np.unique(np.concatenate((along(path, 2000), path.bounds)))
    polygon = float(np.linalg.norm(np.diff(path.points(s).position, axis=0), axis=1).sum())
    arcs = path.arcs
    step = np.diff(s).max()
    lost = float((np.minimum((step / path.radius[arcs]) ** 2 / 24.0, 1.0) * path.length[arcs]).sum())
    assert path.total - lost - ROUNDING <= polygon <= path.total + 1e-9  # rounding of 2000 sums
    assert path.total == pytest.approx(float(path.length.sum()), rel=ROUNDING)


@pytest.mark.slow
@some
@given(corner_rows(variants=True))
def test_both_meanings_of_a_radius_give_one_curve(rows: PathRows) -> None:
    one, other = rows_to_path(rows), rows_to_path(by_first_points(rows))
    assert one.kinds == other.kinds
    s = along(one)
    # the lines of the other follow from one another: what rounds in one, the next has at its end
    np.testing.assert_allclose(other.points(s).position, one.points(s).position, atol=1e-9)


@pytest.mark.slow
@some
@given(corner_rows(variants=True))
def test_reversed_rows_give_the_reversed_curve(rows: PathRows) -> None:
    path = rows_to_path(rows)
    back = PathRows(rows.position[::-1], rows.radius[::-1], corner=True, variant=rows.variant[::-1])
    s = along(path)
    there, returned = path.points(s), rows_to_path(back).points(path.total - s)
    np.testing.assert_allclose(returned.position, there.position, atol=1e-11)  # sums of up to 20 m of path
    inside = np.abs(s[:, None] - path.bounds).min(axis=1) > 1e-11
    np.testing.assert_allclose(returned.tangent[inside], -there.tangent[inside], atol=1e-9)


@pytest.mark.slow
@some
@given(corner_rows())
def test_reversed_first_points_are_the_last_points(rows: PathRows) -> None:
    """Told by the paper's meaning, the way back begins its arcs where the way there ends them."""
    path = rows_to_path(rows)
    arcs = path.arcs
    position = rows.position.copy()
    ends = path.points(path.bounds[arcs + 1], before=True).position
    position[path.row[arcs]] = ends
    back = rows_to_path(PathRows(position[::-1], rows.radius[::-1]))
    s = along(path)
    np.testing.assert_allclose(back.points(path.total - s).position, path.points(s).position, atol=1e-9)


@pytest.mark.slow
@some
@given(corner_rows(variants=True), st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_a_rigid_motion_of_the_rows_moves_the_curve(rows: PathRows, motion: list[float]) -> None:
    frame = from_offset(motion)
    R: FloatArray = np.array(frame.rotation)
    p: FloatArray = np.array(frame.translation)
    moved = PathRows(rows.position @ R.T + p, rows.radius, corner=True, variant=rows.variant)
    s = along(rows_to_path(rows))
    found, wanted = rows_to_path(moved).points(s), rows_to_path(rows).points(s).position @ R.T + p
    np.testing.assert_allclose(
        found.position, wanted, atol=1e-9
    )  # radii are sharpened by up to 20 of a corner


@pytest.mark.slow
@some
@given(corner_rows())
def test_rows_stand_where_they_say(rows: PathRows) -> None:
    """Stops at their own points, corners at the middle of their arcs, first points where these begin."""
    path = rows_to_path(rows)
    np.testing.assert_allclose(path.points(path.stops).position, rows.position[path.stop_row], atol=1e-11)
    rounded = np.flatnonzero(rows.radius > 0.0)
    middle = 0.5 * (path.bounds[path.arcs] + path.bounds[path.arcs + 1])
    np.testing.assert_allclose(path.at[rounded], middle, atol=ROUNDING)
    first = rows_to_path(by_first_points(rows))
    np.testing.assert_allclose(first.at[rounded], first.bounds[first.arcs], atol=ROUNDING)


def test_an_improper_arc_turns_away_and_round() -> None:
    """A right angle to the left by an arc to the right: 270 deg, from behind the corner."""
    rows = PathRows(
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.0]]), np.array([0, 0.1, 0]), corner=True, variant=1
    )
    path = rows_to_path(rows)
    np.testing.assert_allclose(path.length, [1.1, 0.15 * np.pi, 1.1], atol=ROUNDING)
    np.testing.assert_allclose(path.normal[1], [0.0, -1.0, 0.0], atol=ROUNDING)
    np.testing.assert_allclose(
        path.points(path.bounds[1:3]).position, [[1.1, 0, 0], [1, -0.1, 0]], atol=ROUNDING
    )


def test_arcs_may_touch_and_reach_a_stop() -> None:
    """Two half turns of 0.5 m without any line: a path of arcs alone."""
    rows = PathRows(np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [1, 1, 0.0]]), 0.5, corner=True)
    path = rows_to_path(rows)
    assert path.kinds == ["arc", "arc"]
    np.testing.assert_allclose(path.length, 0.25 * np.pi, atol=ROUNDING)
    np.testing.assert_allclose(path.at, [0, np.pi / 8, 3 * np.pi / 8, np.pi / 2], atol=ROUNDING)


@pytest.mark.parametrize("corner", [True, False])
def test_arcs_touch_in_a_plane_of_any_place(corner: bool) -> None:
    """Their coordinates are those of a map: rounding has the size of 1e6 m."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0.0]])
    if not corner:
        points[1:3] = [0.5, 0.0, 0.0], [1.0, 0.5, 0.0]
    for angle in np.linspace(0.1, 6.1, 20):
        frame = from_offset([6e5, 5e6, 100.0, angle, 0.3 * angle, 0.2])
        moved = points @ np.array(frame.rotation).T + np.array(frame.translation)
        path = rows_to_path(PathRows(moved, 0.5, corner))
        assert path.kinds == ["line", "arc", "arc", "line"]
        # a coordinate is known to 1e-9 m
        np.testing.assert_allclose(path.length, [0.5, 0.25 * np.pi, 0.25 * np.pi, 0.5], atol=1e-8)


@pytest.mark.slow
@some
@given(corner_rows(), st.lists(st.floats(-2.0, 2.0), min_size=60, max_size=60))
def test_the_tool_turns_evenly_from_row_to_row(rows: PathRows, angles: list[float]) -> None:
    turned = np.array(angles).reshape(20, 3)[: len(rows)]
    rotation = to_matrices(to_quaternions(turned, "zyx"))
    path = rows_to_path(PathRows(rows.position, rows.radius, corner=True, rotation=rotation))
    assert path.orientation is not None
    at = path.orientation.matrices(path.at)
    np.testing.assert_allclose(at[:-1], rotation[:-1], atol=ROUNDING)
    np.testing.assert_allclose(at[-1], rotation[-1], atol=1e-9)  # after a whole turn by the last rate
    middle = 0.5 * (path.at[1:] + path.at[:-1])
    quats = path.orientation.quaternions(middle)
    ends = to_quaternions(rotation.reshape(-1, 9), "matrix")
    along_it = np.insert(path.orientation.quaternions(path.at), np.arange(1, len(rows)), quats, axis=0)
    turned_by = np.einsum("ij,ij->i", along_it[1:], along_it[:-1])
    assert turned_by.min() >= math.sqrt(0.5) - ROUNDING  # one sign: half of at most half a turn a step
    halves = np.stack((rotation_angle(ends[:-1], quats), rotation_angle(quats, ends[1:])))
    np.testing.assert_allclose(halves[0], halves[1], atol=1e-7)  # acos-like near 0
    speed = np.linalg.norm(path.orientation.rate, axis=1) * np.diff(path.at)
    np.testing.assert_allclose(speed, rotation_angle(ends[:-1], ends[1:]), atol=1e-7)


def faults(points: Sequence[Sequence[float]], radius: Sequence[float], corner: bool = False) -> list[str]:
    rows = PathRows(points, radius, corner=corner)
    with pytest.raises(PathError) as raised:
        rows_to_path(rows)
    assert list(raised.value.findings) == validate_rows(rows)
    return [str(one) for one in raised.value.findings]


@pytest.mark.parametrize(("digits", "uneven"), [(15, False), (6, False), (4, True)])
def test_an_even_turn_may_be_rounded_to_six_digits(digits: int, uneven: bool) -> None:
    points = np.array([[2, 0, 3], [4, 0, 3], [4, 4, 3], [0, 4, 3], [0, 0, 3], [2, 0, 3.0]]) / 10.0
    angle = 2.0 * rows_to_path(PathRows(points, 0.05, corner=True)).at
    turned = to_matrices(to_quaternions(np.round(angle, digits)[:, None] * [0.0, 0.0, 1.0], "vector"))
    path = rows_to_path(PathRows(points, 0.05, corner=True, rotation=turned))
    assert path.orientation is not None
    assert bool(len(path.orientation.uneven_rows)) == uneven


def test_a_half_turn_rounds_no_corner() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 0.2, 0], [0, 1.2, 0], [1, 2, 0.0]])
    path = rows_to_path(PathRows(points, np.array([0, 0.1, 0, 0.2, 0])))
    np.testing.assert_allclose(path.length[path.arcs[0]], 0.1 * np.pi, atol=ROUNDING)
    assert np.isnan(path.corners).all(axis=1).tolist() == [True, False]


INSIDE: list[list[float]] = [[0, 0, 0], [1, 0, 0], [1.1, 0.2, 0]]


def test_radii_that_are_too_large_are_all_told_with_digits_that_differ() -> None:
    corners: list[list[float]] = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0], [2, 1.2, 0]]
    assert faults(corners, [0, 0.6, 0.6, 0.3, 0], corner=True) == [
        "row 3, column corner_r: found 0.6 and 0.6 m, whose arcs need 1.2 m on the line from row 2 to row 3,"
        " allowed: its length, 1 m",
        "row 4, column corner_r: found 0.3 m, whose arc needs 0.3 m on the line from row 4 to row 5,"
        " allowed: its length, 0.2 m",
    ]
    assert faults(corners[:4], [0, 0.5, 0.500000001, 0], corner=True) == [
        "row 3, column corner_r: found 0.5 and 0.5 m, whose arcs need 1.000000001 m on the line from row 2"
        " to row 3, allowed: its length, 1 m"
    ]
    for radius in (0.2, 0.125000001):
        assert faults(INSIDE, [0, radius, 0]) == [
            f"row 2, column r: found {radius} m, with row 3 inside its circle, allowed: up to 0.125 m"
        ]


@pytest.mark.parametrize(("corner", "column"), [(True, "corner_r"), (False, "r")])
def test_arcs_need_a_plane_and_rows_a_place_of_their_own(corner: bool, column: str) -> None:
    line: list[list[float]] = [[0, 0, 0], [1, 0, 0], [3, 0, 0], [2, 0, 0], [2, 0, 1]]
    assert faults(line, [0, 0.1, 0, 0, 0], corner) == [
        f"row 2, column {column}: found a radius of 0.1 m where the path goes straight on,"
        " allowed: 0, or row 3 off that line"
    ]
    assert faults(line, [0, 0, 0.1, 0, 0], corner) == [
        f"row 3, column {column}: found a radius of 0.1 m where the path reverses,"
        " allowed: 0, or row 4 off that line"
    ]
    twice = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]]
    assert faults(twice, [0.1, 0, 0, 0.2], corner) == [
        f"row 1, column {column}: found 0.1 m, allowed: 0, since a path starts and ends at rest",
        f"row 4, column {column}: found 0.2 m, allowed: 0, since a path starts and ends at rest",
        "row 3: found the same point as row 2, allowed: another point",
        "row 4: found the same point as row 3, allowed: another point",
    ]


def test_all_that_is_wrong_is_told_at_once() -> None:
    """Ends, points again, and radii; of both sides of a point again the arcs are not known."""
    points: list[list[float]] = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [3, 1, 0], [4, 1, 0]]
    ends = "row 1, column {}: found 0.3 m, allowed: 0, since a path starts and ends at rest"
    again = "row 3: found the same point as row 2, allowed: another point"
    assert faults(points, [0.3, 0.1, 0.1, 0.6, 0.6, 0.1, 0], corner=True) == [
        ends.format("corner_r"),
        again,
        "row 6, column corner_r: found a radius of 0.1 m where the path goes straight on,"
        " allowed: 0, or row 7 off that line",
        "row 5, column corner_r: found 0.6 and 0.6 m, whose arcs need 1.2 m on the line from row 4 to row 5,"
        " allowed: its length, 1 m",
    ]
    assert faults(points, [0.3, 0, 0, 0.6, 0, 0.1, 0]) == [
        ends.format("r"),
        again,
        "row 4, column r: found 0.6 m, with row 5 inside its circle, allowed: up to 0.5 m",
        "row 6, column r: found a radius of 0.1 m where the path goes straight on,"
        " allowed: 0, or row 7 off that line",
    ]


def test_a_first_point_is_judged_only_where_the_direction_is_known() -> None:
    """After a circle that is too large the path would not go straight to row 4, as the points do."""
    points: list[list[float]] = [[0, 0, 0], [1, 0, 0], [1.1, 0.1, 0], [1.2, 0.2, 0], [2, 0.2, 0], [2, 0.3, 0]]
    assert faults(points, [0, 0.5, 0.01, 0, 0.2, 0]) == [
        "row 2, column r: found 0.5 m, with row 3 inside its circle, allowed: up to 0.1 m",
        "row 5, column r: found 0.2 m, with row 6 inside its circle, allowed: up to 0.05 m",
    ]
    rows_to_path(PathRows(np.array(points), np.array([0, 0.05, 0.01, 0, 0.01, 0])))


def test_a_radius_may_be_wrong_on_the_way_of_an_arc() -> None:
    """Rows 2, 3 and 4 are on no line, but row 4 is ahead of where the arc before row 3 ends."""
    arc: list[list[float]] = [[0, 0, 0], [1, 0, 0], [1.1, 0.5, 0]]
    ahead = rows_to_path(PathRows(np.array(arc), np.array([0, 0.1, 0]))).tangent[-1]
    assert faults([*arc, (np.array(arc[-1]) + 0.5 * ahead).tolist()], [0, 0.1, 0.03, 0]) == [
        "row 3, column r: found a radius of 0.03 m where the path goes straight on,"
        " allowed: 0, or row 4 off that line"
    ]


@given(st.floats(0.01, 3.0), st.floats(-1.0, 1.0), st.floats(0.01, 1.0))
def test_the_largest_radius_is_that_through_the_next_row(a: float, x: float, y: float) -> None:
    """Just below it there is a path, just above there is none."""
    points = np.array([[-a, 0, 0], [0, 0, 0], [x, y, 0]])
    most = (x * x + y * y) / (2.0 * y)
    rows_to_path(PathRows(points, 0.999 * most))
    with pytest.raises(PathError):
        rows_to_path(PathRows(points, 1.001 * most))


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
    found = [rows_to_path(cube_rows(kind, 0.6, 0.03, CENTRE, plane)).total for plane in PLANES[kind]]
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
    ("options", "said"),
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
def test_what_is_no_contour_is_refused(options: dict[str, Any], said: str) -> None:
    arguments = {"kind": "wall", "side": 0.6, "radius": 0.03, "centre": CENTRE, **options}
    assert refusal(OptionError, lambda: cube_rows(**arguments)) == said
