"""What stands in space of a plan: the path by its speed, planes, rows, the arm, what is in the way."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from asserting import there
from made_plans import CONTOUR, DOWN, FAILED, over_its_axis, planned
from presented import scene_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.math3d import to_matrices
from urmpipe_models.planning.path import PathRows, cube_rows
from urmpipe_pipeline.planned_paths.obstacles import ObstacleKind
from urmpipe_pipeline.planned_paths.planes import outlines
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.planned_paths.scene import ARCS, NAMED, samples_of_rows
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure
from urmpipe_pipeline.presentation.scene import Path
from urmpipe_pipeline.results import present

SVG = "{http://www.w3.org/2000/svg}"


def path_figure(plan: PlannedPath) -> SpaceFigure:
    (figure,) = (one for one in present(plan).body.blocks() if isinstance(one, SpaceFigure))
    return figure


def places(plan: PlannedPath) -> dict[str, Path]:
    """What stands beside the path on the page, by name."""
    speed, *others = path_figure(plan).paths
    assert (speed.name, speed.unit) == ("speed", "m/s")
    np.testing.assert_array_equal(speed.values, plan.motion.v)
    np.testing.assert_array_equal(speed.position, plan.position)
    assert not any(one.line for one in others)
    return {one.name: one for one in others}


# --- planes ------------------------------------------------------------------------------------------


def off(points: FloatArray, rectangle: FloatArray) -> FloatArray:
    """How far points in [m], shape (n, 3), are off a rectangle, shape (4, 3): 0 within it."""
    a, b, c, d = rectangle
    sides = np.stack((b - a, d - a))
    np.testing.assert_allclose(c - a, sides.sum(axis=0), atol=1e-12)  # it is one
    assert abs(sides[0] @ sides[1]) < 1e-12
    share = (points - a) @ (sides / np.square(sides).sum(axis=1, keepdims=True)).T
    flat = np.linalg.norm((points - a) - share @ sides, axis=1)
    return np.asarray(np.maximum(flat, np.maximum(-share, share - 1.0).max(axis=1)))


def test_a_contour_in_one_plane_has_one_rectangle_around_it() -> None:
    for section in ("xy", "xz", "yz"):
        plan = planned(None, cube_rows("wall", 0.6, 0.03, np.array([1.7, 0.0, 1.0]), section))
        (rectangle,) = outlines(plan.path)
        assert off(plan.position, rectangle).max() < 1e-12
        normal = "xyz".index(next(axis for axis in "xyz" if axis not in section))
        assert np.ptp(rectangle[:, normal]) < 1e-12
        assert np.ptp(rectangle, axis=0).max() == pytest.approx(0.6 * (1.0 + 2 * 0.06))


def test_an_arc_in_a_plane_of_its_own_has_a_rectangle(alone: PlannedPath) -> None:
    path = alone.path
    found = outlines(path)
    assert len(found) == len(path.arcs) == 2
    for k, rectangle in zip(path.arcs.tolist(), found, strict=True):
        with_lines = np.linspace(path.bounds[k - 1], path.bounds[k + 2], 300)
        assert off(path.points(with_lines).position, rectangle).max() < 1e-12


def test_arcs_of_more_than_half_a_turn_have_finite_planes() -> None:
    """There the tangents meet behind the arc, or nowhere."""
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.2, 0.0]])
    for radius in (0.05, 0.1):  # beyond half a turn, and half of one
        path = planned(None, PathRows(points, np.array([0.0, radius, 0.0]))).path
        (rectangle,) = outlines(path)
        assert off(path.points(np.linspace(0.0, path.total, 200)).position, rectangle).max() < 1e-12
        assert np.ptp(rectangle, axis=0).max() < 1.0


@pytest.mark.slow
def test_of_many_arcs_or_none_no_planes_are_drawn(ring: PlannedPath) -> None:
    assert len(ring.path.arcs) > ARCS
    for plan in (ring, over_its_axis()):
        assert path_figure(plan).sheets is None
        assert list(places(plan)) == ["stops"]
        assert "planes" not in path_figure(plan).caption


# --- places on the page ------------------------------------------------------------------------------


def test_places_are_tangent_points_corners_and_stops(alone: PlannedPath, contour: PlannedPath) -> None:
    found = places(alone)
    assert list(found) == ["tangent points", "corners", "stops"]
    np.testing.assert_array_equal(found["corners"].position, alone.rows.position[[1, 2]])
    np.testing.assert_array_equal(found["stops"].position, alone.rows.position[[0, 3, 4]])
    touching = found["tangent points"].position
    lines = [k for k, kind in enumerate(alone.path.kinds) if kind == "line"]
    ends = alone.path.bounds[[lines[0] + 1, lines[1], lines[1] + 1, lines[2]]]
    np.testing.assert_allclose(touching, alone.path.points(ends).position, atol=1e-15)
    contours = places(contour)  # its rows are the first tangent points
    assert list(contours) == ["tangent points", "stops"]
    away = contours["tangent points"].position[:, None] - CONTOUR.position[1:5]
    assert np.linalg.norm(away, axis=2).min(axis=0).max() < 1e-12


# --- the drawing -------------------------------------------------------------------------------------


def drawings(plan: PlannedPath) -> list[ET.Element]:
    return [ET.fromstring(one.svg) for one in present(plan).body.blocks() if isinstance(one, Drawing)]


def lines_of(svg: ET.Element) -> list[FloatArray]:
    """The points of all lines in pixels."""
    texts = [there(line.get("points")) for line in svg.findall(f"{SVG}polyline")]
    return [np.array([pair.split(",") for pair in text.split()], float) for text in texts]


@pytest.mark.parametrize(("name", "rows"), [("contour", 6), ("slowed", 6), ("ring", NAMED)])
def test_the_arm_is_drawn_at_the_rows(name: str, rows: int, request: pytest.FixtureRequest) -> None:
    plan: PlannedPath = request.getfixturevalue(name)
    (svg,) = drawings(plan)
    chain, lines = there(plan.robot), lines_of(svg)
    arms = [line for line in lines if len(line) == len(chain.joints) + 1]
    assert (len(lines), len(arms)) == (3 * (rows + 1), 3 * rows)  # three projections; the path beside
    # each view is a picture of the first arm, and all are of one scale
    points = points_over_log(chain, there(plan.joints).q[:1])[0]
    scale = np.ptp(arms[0][:, 1]) / np.ptp(points[:, 2])
    for first, axes in zip(arms[::rows], ([0, 2], [1, 2], [0, 1]), strict=True):
        wanted = (points - points[0])[:, axes] * (scale, -scale)
        np.testing.assert_allclose(first - first[0], wanted, rtol=0, atol=0.3)  # places are whole 0.1 px


def test_rows_are_numbered_once_where_they_are_at_one_place(contour: PlannedPath) -> None:
    (svg,) = drawings(contour)
    texts = [there(text.text) for text in svg.findall(f"{SVG}text")]
    from_above = [text for text in texts if text[0] in "123456" and "m" not in text][-5:]
    assert from_above == ["1, 6", "2", "3", "4", "5"]


def test_rows_without_a_pose_have_no_arm() -> None:
    """The arm stands at both rows; the samples between them that it does not reach draw nothing."""
    lines = lines_of(drawings(FAILED["unreachable"]())[0])
    assert len(lines) == 3 * (2 + 1)
    assert all(np.isfinite(line).all() for line in lines)


# --- the 3D view -------------------------------------------------------------------------------------


def test_the_scene_of_a_plan(contour: PlannedPath) -> None:
    scene = scene_of(present(contour))
    (arm,), (path,), targets = scene.arms, scene.paths, there(scene.targets)
    assert scene.title == "Arm and path [m], coloured by speed: blue 0, red 0.5 m/s"
    np.testing.assert_array_equal(arm.q, there(contour.joints).q)
    np.testing.assert_array_equal(arm.t_ns, contour.t_ns)
    np.testing.assert_array_equal(path.values, contour.motion.v)
    np.testing.assert_allclose(targets.position, CONTOUR.position, rtol=0, atol=1e-14)
    assert [spot.words for spot in scene.spots] == [
        "rows 1, 6: stop", "row 2", "row 3", "row 4", "row 5",
    ]  # fmt: skip
    np.testing.assert_allclose([spot.position for spot in scene.spots], CONTOUR.position[:5], atol=1e-6)
    assert targets.reached.all()
    # an orientation that is left open is the arm's own, at the sample nearest to the row: level, and
    # turned by theta1 about z
    turns = there(contour.joints).q[samples_of_rows(contour), 0]
    axes = to_matrices(there(targets.quat_xyzw))[:, :, 0]
    np.testing.assert_allclose(axes, np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1), atol=1e-14)


def test_samples_of_rows_are_the_nearest_ones(ring: PlannedPath, contour: PlannedPath) -> None:
    for plan in (ring, contour):
        away = np.abs(plan.motion.s[None] - plan.path.at[:, None])
        nearest = away[np.arange(len(plan.rows)), samples_of_rows(plan)]
        np.testing.assert_array_equal(nearest, away.min(axis=1))
        assert scene_of(present(plan)).arms[0].kept == tuple(samples_of_rows(plan).tolist())


def test_frames_at_rows_are_turned_as_the_rows_say(slowed: PlannedPath) -> None:
    quat = there(there(scene_of(present(slowed)).targets).quat_xyzw)
    np.testing.assert_allclose(to_matrices(quat), np.broadcast_to(DOWN, (6, 3, 3)), rtol=0, atol=1e-15)


def test_the_scene_without_a_robot_is_the_path(alone: PlannedPath) -> None:
    scene = scene_of(present(alone))
    assert scene.title.startswith("Path [m], ")
    assert scene.arms == ()
    assert there(scene.targets).quat_xyzw is None
    assert [spot.words for spot in scene.spots] == [
        "row 1: stop", "row 2", "row 3", "row 4: stop", "row 5: stop",
    ]  # fmt: skip


def test_of_many_rows_the_stops_are_named(ring: PlannedPath) -> None:
    assert [spot.words for spot in scene_of(present(ring)).spots] == ["rows 1, 100: stop"]
    stops = planned(None, PathRows(np.arange(3.0 * (NAMED + 1)).reshape(-1, 3) ** 1.5))
    assert scene_of(present(stops)).spots == ()


@pytest.mark.slow
@pytest.mark.parametrize("kind", FAILED)
def test_what_is_in_the_way_is_marked(kind: ObstacleKind) -> None:
    plan = FAILED[kind]()
    wanted = [
        (f"{one.kind}, row {one.row}", tuple(plan.path.points(np.array([one.s])).position[0]))
        for one in plan.infeasibilities
    ]
    shown = [(spot.words, spot.position) for spot in scene_of(present(plan)).spots]
    assert shown[-len(wanted) :] == wanted
    assert [(spot.words, spot.position) for spot in path_figure(plan).spots] == wanted
