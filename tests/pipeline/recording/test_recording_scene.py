"""Laws of the 3D view: what is thinned out, dashed, coloured and in view, and where arms move."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from made_plans import CONTOUR, planned
from presented import scene_of
from recordable import build_comparison, build_run, build_solved
from recorded import columns, entities, static
from shapes_arm import arm_of_shapes
from solved import solved
from toys import eye_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.kinematics.forward import frames_over_log
from urmpipe_models.math3d import to_quaternions
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_pipeline.presentation.palette import value_colours
from urmpipe_pipeline.presentation.scene import Path as Way
from urmpipe_pipeline.recording.reader import Store
from urmpipe_pipeline.recording.views.camera import FIELD_OF_VIEW, FILLED, WIDE
from urmpipe_pipeline.recording.views.geometry import (
    NEAR,
    ball,
    drawn_arm,
    drawn_ghosts,
    drawn_path,
    drawn_targets,
    extent,
)
from urmpipe_pipeline.recording.views.tracks import COLOURED, DASHES, LEAST_DASH, LEVELS, MOST, SEEN
from urmpipe_pipeline.results import present, read_recording, write_recording


def column(path: Path, entity: str, name: str) -> Any:
    """Return one component of an entity of the robot, row by row, as numbers."""
    return np.array(columns(path, f"/shown/scene/robot/{entity}", name))


def test_what_is_long_is_thinned_out_but_for_the_last_and_what_is_kept() -> None:
    scene, kept = scene_of(present(build_run(rows=200_000))), (123_457,)
    drawn = there(drawn_arm(replace(scene.arms[0], kept=kept)))
    path = drawn_path(replace(scene.paths[0], kept=kept))
    for rows in (drawn.moving.rows, path.moving.rows):
        assert MOST - 1 <= len(rows) <= MOST + 2  # the last and the one that is kept, besides
        assert {0, *kept, 199_999} <= set(rows.tolist())
    (strip,) = path.strips
    assert len(strip) <= MOST + 2
    for row in (0, *kept, 199_999):
        assert (strip == scene.paths[0].position[row]).all(axis=1).any()


def test_what_decides_is_drawn() -> None:
    """Not one of the samples that are drawn anyway, which are every fourth."""
    comparison = build_comparison(("coppeliasim",))
    one = comparison.runs[0]
    x = replace(one.statistics["x"], max=1.0, sample_max=int(one.sample[465]))
    decided = replace(comparison, runs=(replace(one, statistics={**one.statistics, "x": x}),))
    scene = scene_of(present(decided))
    assert 465 in there(drawn_arm(scene.arms[0])).moving.rows
    moving = [drawn_path(way) for way in scene.paths if way.t_ns is not None]
    assert len(moving) == 3 and all(465 in way.moving.rows for way in moving)


def length(strips: Sequence[FloatArray]) -> float:
    """Return the length of lines in [m]."""
    return sum(float(np.linalg.norm(np.diff(strip, axis=0), axis=1).sum()) for strip in strips)


@pytest.mark.parametrize(("turns", "dashes"), [(20, DASHES), (1, 55)])
def test_a_requested_path_is_dashed(turns: int, dashes: int) -> None:
    """A short path has fewer dashes: they would run together."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 9000)
    position = np.column_stack((np.cos(angle), np.sin(angle), 0.01 * angle))
    strips = drawn_path(Way("one", position, None, "#000000", asked=True)).strips
    assert dashes <= len(strips) <= dashes + 1  # the last may begin at the very end, by rounding
    # Only the corners at the ends of a dash are cut off; the last dash may be cut short.
    assert length(strips) == pytest.approx(length([position]) / 2, rel=0.02)
    lengths = [length([strip]) for strip in strips[:-1]]
    assert min(lengths) == pytest.approx(max(lengths), rel=1e-2)
    assert min(lengths) >= 0.99 * LEAST_DASH * float(np.linalg.norm(np.ptp(position, axis=0))) / 2


def along_x(values: FloatArray, kept: tuple[int, ...] = ()) -> list[FloatArray]:
    """Return the lines of a path with values, its places a metre apart, by x in [m]."""
    places = np.arange(len(values))[:, None] * [1.0, 0.0, 0.0]
    drawn = drawn_path(Way("speed", places, None, "#000000", values=values, kept=kept))
    assert len(drawn.strips) == len(drawn.colours)
    return [strip[:, 0] for strip in drawn.strips]


def test_values_that_change_all_the_time_have_fewer_levels_not_fewer_places() -> None:
    rows = 50 * COLOURED
    strips = along_x(np.abs(np.sin(np.arange(rows) / 300.0)))
    assert COLOURED / LEVELS[0] < len(strips) <= COLOURED
    begins, ends = (np.array([strip[k] for strip in strips]) for k in (0, -1))
    assert (begins[0], ends[-1]) == (0, rows - 1)
    np.testing.assert_array_equal(begins[1:], ends[:-1])  # one line without a gap
    assert sum(map(len, strips)) - len(strips) + 1 >= MOST / 2


def test_kept_rows_are_vertices_of_a_long_path() -> None:
    rows, kept = 20 * MOST + 7, (3, 5_555, 11_111)
    (strip,) = along_x(np.ones(rows), kept)
    assert {*kept, 0, rows - 1} <= {*strip.astype(int).tolist()}
    assert len(strip) <= MOST + 1 + len(kept)


def test_the_recording_has_as_many_colours_as_lines(tmp_path: Path) -> None:
    file, entity = write_recording(planned(None, CONTOUR), tmp_path / "plan.rrd"), "/shown/scene/path/speed"
    strips = static(file, entity, "LineStrips3D:strips")
    packed = np.array(static(file, entity, "LineStrips3D:colors"), dtype=np.uint32)
    assert len(strips) == len(packed)
    colours = np.stack([packed >> shift & 0xFF for shift in (24, 16, 8)], axis=1)
    longest = max(range(len(strips)), key=lambda k: len(strips[k]))  # at the largest speed
    slowest, fastest = value_colours(np.array([0.0, 1.0, 1.0 / SEEN]))[:2]
    np.testing.assert_array_equal(colours[[0, longest]], [slowest, fastest])


@pytest.mark.parametrize("result", [*(build_run(rows=rows) for rows in (1, 2, 1500)), build_solved()])
def test_all_of_the_scene_is_in_view(result: Any) -> None:
    shown = present(result)
    scene, (eye, target) = scene_of(shown), eye_of(shown)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    arm, ghosts = drawn_arm(scene.arms[0]), drawn_ghosts(scene.arms)
    points = extent(arm, ghosts, [drawn_path(way) for way in scene.paths], None)
    seen = (points - eye) @ np.column_stack((right, np.cross(right, forward), forward))
    edge = np.tan(FIELD_OF_VIEW / 2)
    reach = np.abs(seen[:, :2] / seen[:, 2:]).max(axis=0) / [WIDE * edge, edge]
    assert reach.max() == pytest.approx(FILLED, rel=1e-6)  # the eye stands in single precision
    for ghost in ghosts:
        assert {*map(tuple, ghost.end.reshape(-1, 3))} <= {*map(tuple, points)}


def test_a_target_missed_by_far_does_not_make_the_arm_small() -> None:
    def in_view(*far: FloatArray) -> FloatArray:
        """Return all points in view of an arm at a target, and of further ones that are missed."""
        q = np.vstack(([0.1, -1.2, 1.3, -0.4, 0.7, 0.3], *np.full((len(far), 6), np.nan)))
        targets, reasons = Targets(np.array([np.zeros(3), *far])), ("", *("far" for _ in far))
        scene = scene_of(present(solved("one", load_robot("ur5e"), q, reasons=reasons, targets=targets)))
        return extent(drawn_arm(scene.arms[0]), (), (), drawn_targets(there(scene.targets)))

    centre, radius = ball(in_view())
    for far, kept in ((0.9 * NEAR, True), (1.1 * NEAR, False), (1000.0, False)):
        place = centre + np.array([far * radius, 0.0, 0.0])
        assert bool((in_view(place) == place).all(axis=1).any()) is kept


def test_each_link_moves_with_its_frame(tmp_path: Path) -> None:
    robot = read_urdf(arm_of_shapes(tmp_path))
    run = build_run(rows=200, robot=robot)
    path = write_recording(run, tmp_path / "run.rrd")
    arm = there(drawn_arm(scene_of(present(run)).arms[0]))
    position, rotation = frames_over_log(robot, run.q[arm.moving.rows])
    for k, joint in enumerate(robot.joints, start=1):
        # Single precision, which the viewer draws with.
        moved = column(path, f"joint/{joint.name}", "Transform3D:translation")[:, 0]
        turned = column(path, f"joint/{joint.name}", "Transform3D:quaternion")[:, 0]
        np.testing.assert_allclose(moved, position[:, k], atol=1e-6)
        expected = to_quaternions(rotation[:, k].reshape(-1, 9), "matrix")
        np.testing.assert_allclose(turned, expected, atol=1e-6)


def test_meshes_are_in_the_recording_and_a_solid_stands_for_a_lost_mesh(tmp_path: Path) -> None:
    robot, mesh = read_urdf(arm_of_shapes(tmp_path)), tmp_path / "meshes" / "bar.stl"
    path = write_recording(build_run(rows=50, robot=robot), tmp_path / "run.rrd")
    blob = column(path, "joint/turn3/visual\\ 1", "Asset3D:blob")
    assert bytes(blob.reshape(-1).astype(np.uint8)) == mesh.read_bytes()
    told = json.loads(Store(path).metadata)["result"]["robot"]["visuals"][3]
    assert told["shape"] == {"$is": "Mesh", "file": str(mesh), "scale": [1.0, 1.0, 1.0]}
    back: Any = read_recording(path)
    assert back.robot == robot
    assert entities(write_recording(back, tmp_path / "again.rrd")) == entities(path)
    mesh.unlink()
    bare = write_recording(back, tmp_path / "bare.rrd")
    assert entities(bare) - entities(path) == {"/shown/scene/robot/joint/turn3/visual\\ 2"}
    assert column(bare, "joint/turn3/visual\\ 1", "Cylinders3D:lengths").shape == (1, 1)
    found = column(bare, "joint/turn3/visual\\ 2", "Capsules3D:lengths")
    assert found.tolist() == [[pytest.approx(0.2)]]
