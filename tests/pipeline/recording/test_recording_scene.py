"""The 3D view of a recording: arms at 50 Hz and as they look, paths broken and dashed, all of it in view."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from recordable import build_comparison, build_run
from recorded import columns, entities, static, times_of, views
from toys import STEP_NS, eye_of, recorded, shown, toy
from urmpipe_models.arm.chain import Box, Chain, Inertial, Joint, Mesh, Sphere, Visual
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.dynamics.equations import centres_of_mass_over_log
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import frames_over_log, points_over_log
from urmpipe_models.math3d import from_offset, to_quaternions
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_pipeline.presentation.palette import JOINT_COLOURS, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.presentation.scene import ArmMark, Balls, Scene, Spot
from urmpipe_pipeline.presentation.scene import Path as Way
from urmpipe_pipeline.recording.reader import Store
from urmpipe_pipeline.recording.views.camera import FIELD_OF_VIEW, FILLED, WIDE
from urmpipe_pipeline.recording.views.geometry import drawn_arm, drawn_path, extent
from urmpipe_pipeline.recording.views.shapes import SEEN_THROUGH, bodies_over_log, own_shapes
from urmpipe_pipeline.recording.views.tracks import DASHES, LEAST_DASH, MOST, POSE_PERIOD
from urmpipe_pipeline.results import present, read_recording, write_recording

SCENE = "/shown/scene"


def scene_of(result: Any) -> Scene:
    """Return the scene of a result that has one."""
    return there(there(present(result).scene)())


def column(path: Path, entity: str, name: str) -> Any:
    """Return one component of an entity of the scene, row by row, as numbers."""
    return np.array(columns(path, f"{SCENE}/{entity}", name))


def below(path: Path, root: str) -> set[str]:
    """Return what stands below an entity of the scene, without that entity's path."""
    return {name.removeprefix(f"{SCENE}/{root}/") for name in entities(path, f"{SCENE}/{root}")}


# --- which rows are drawn --------------------------------------------------------------------------


def test_the_arm_moves_at_50_hz_through_its_own_kinematics() -> None:
    run = build_run()
    arm = there(drawn_arm(scene_of(run).arms[0]))
    t_ns = run.t_ns[arm.moving.rows]
    assert np.unique(np.diff(t_ns[:-1])).tolist() == [round(POSE_PERIOD * 1e9)] == [20_000_000]
    assert t_ns[-1] == run.t_ns[-1]
    np.testing.assert_array_equal(arm.skeleton, points_over_log(there(run.robot), run.q[arm.moving.rows]))
    assert arm.colours == (*JOINT_COLOURS[:6], REFERENCE_COLOUR, run_colour(0))


def test_what_is_long_is_thinned_out_but_for_the_last_and_what_is_kept() -> None:
    run, kept = build_run(rows=200_000), 123_457
    arm, way = scene_of(run).arms[0], scene_of(run).paths[0]
    drawn, path = there(drawn_arm(replace(arm, kept=(kept,)))), drawn_path(replace(way, kept=(kept,)))
    for rows in (drawn.moving.rows, path.moving.rows):
        assert MOST - 1 <= len(rows) <= MOST + 2  # the last and the one that is kept, besides
        assert {0, kept, 199_999} <= set(rows.tolist())
    (strip,) = path.strips
    assert len(strip) <= MOST + 2
    for row in (0, kept, 199_999):
        assert (strip == way.position[row]).all(axis=1).any()


def test_what_decides_is_drawn() -> None:
    """Not one of the samples that are drawn anyway, which are every fourth."""
    comparison = build_comparison(("coppeliasim",))
    one = comparison.runs[0]
    x = replace(one.statistics["x"], max=1.0, sample_max=int(one.sample[465]))
    scene = scene_of(replace(comparison, runs=(replace(one, statistics={**one.statistics, "x": x}),)))
    assert 465 in there(drawn_arm(scene.arms[0])).moving.rows
    moving = [drawn_path(way) for way in scene.paths if way.t_ns is not None]
    assert len(moving) == 3 and all(465 in way.moving.rows for way in moving)


# --- balls -----------------------------------------------------------------------------------------


def test_balls_are_seen_through_and_in_view(tmp_path: Path) -> None:
    centre, radius = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]), np.array([0.5, 2.0])
    way = Way("one", centre, None, "#000000")
    scene = Scene("s", paths=(way,), balls=Balls("b", centre, radius, "#21c3ff"))
    path = recorded(shown(scene=scene), tmp_path)
    np.testing.assert_array_equal(static(path, f"{SCENE}/balls", "Ellipsoids3D:centers"), centre)
    sizes = static(path, f"{SCENE}/balls", "Ellipsoids3D:half_sizes")
    np.testing.assert_array_equal(sizes, np.repeat(radius[:, np.newaxis], 3, axis=1))
    (colour,) = static(path, f"{SCENE}/balls", "Ellipsoids3D:colors")
    assert 0 < colour & 0xFF < 255
    points = extent(None, (), [drawn_path(way)], None, balls=Balls("", centre, radius, ""))
    assert points.min(axis=0).tolist() == [-1.0, -0.5, -0.5]
    assert points.max(axis=0).tolist() == [3.0, 4.0, 5.0]


# --- lines -----------------------------------------------------------------------------------------


def test_lines_are_broken_where_values_or_samples_are_missing() -> None:
    position = np.random.default_rng(1).normal(size=(100, 3))
    position[[40, 41, 60]] = np.nan
    sample = np.arange(100) + 5 * (np.arange(100) >= 80)
    strips = drawn_path(Way("one", position, None, "#000000", sample=sample)).strips
    for strip, rows in zip(strips, (range(40), range(42, 60), range(61, 80), range(80, 100)), strict=True):
        np.testing.assert_array_equal(strip, position[rows])


def length(strips: Sequence[FloatArray]) -> float:
    """Return the length of lines in [m]."""
    return sum(float(np.linalg.norm(np.diff(strip, axis=0), axis=1).sum()) for strip in strips)


@pytest.mark.parametrize(("turns", "dashes"), [(20, DASHES), (1, 55)])
def test_what_was_asked_for_is_dashed(turns: int, dashes: int) -> None:
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


def test_paths_and_places_are_drawn_with_their_words(tmp_path: Path) -> None:
    """Labels are points of no size beside those that they name: in the colour of these they are not read."""
    one = toy(columns=3)
    ways = [Way(name, one.values + k, one.t_ns, "#c25000", label="word") for k, name in enumerate("aab")]
    ways.append(Way("still", one.values, None, "#c25000"))
    spots = Spot((1.0, 2.0, 3.0), "here", "#fe046c"), Spot((0.0, 0.0, 0.0), "end", "#fe046c", always=False)
    path = recorded(shown(scene=Scene("Paths", paths=tuple(ways), spots=spots)), tmp_path, one)
    assert below(path, "path") == {"a", "a-2", "b", "still"}
    assert below(path, "point") == {name + more for name in ("a", "a-2", "b") for more in ("", "/label")}
    assert static(path, f"{SCENE}/point/a-2/label", "Points3D:labels") == ["word"]
    drawn = np.array(times_of(path, f"{SCENE}/point/b")) // STEP_NS
    moved = column(path, "point/b", "Points3D:positions")[:, 0]
    np.testing.assert_allclose(moved, one.values[drawn] + 2, atol=1e-6)  # single precision
    assert times_of(path, f"{SCENE}/point/b") == times_of(path, f"{SCENE}/point/b/label")
    assert column(path, "spot\\ 0", "Points3D:positions").tolist() == [[[1.0, 2.0, 3.0]]]
    assert static(path, f"{SCENE}/spot\\ 0/label", "Points3D:labels") == ["here"]
    assert not entities(path, f"{SCENE}/spot\\ 1")


def test_labels_of_places_close_to_each_other_are_raised_until_each_is_read(tmp_path: Path) -> None:
    one = toy(columns=3)
    spots = tuple(Spot((1.0, 2.0, 3.0 - k / 100.0), str(k), "#fe046c") for k in range(2))
    ways = (Way("a", one.values, one.t_ns, "#c25000"),)
    path = recorded(shown(scene=Scene("Paths", paths=ways, spots=spots)), tmp_path, one)
    high, low = (
        np.array(static(path, f"{SCENE}/spot\\ {k}/label", "Points3D:positions"))[0] for k in range(2)
    )
    np.testing.assert_allclose(low, spots[1].position, atol=1e-6)
    np.testing.assert_allclose(high[:2], low[:2], atol=1e-6)
    assert high[2] - low[2] > 0.05 * float(np.linalg.norm(np.ptp(one.values, axis=0)))


def test_there_is_no_3d_view_of_nothing(tmp_path: Path) -> None:
    run = replace(build_run(rows=20), robot=None, tcp=None)
    path = write_recording(run, tmp_path / "run.rrd")
    assert not entities(path, SCENE)
    assert "Spatial3DView" not in str(views(path))


# --- what is in view -------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [1, 2, 1500])
def test_all_of_the_scene_is_in_view(rows: int) -> None:
    run = build_run(rows=rows)
    scene = scene_of(run)
    eye, target = eye_of(present(run))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    points = extent(drawn_arm(scene.arms[0]), (), [drawn_path(way) for way in scene.paths], None)
    seen = (points - eye) @ np.column_stack((right, np.cross(right, forward), forward))
    edge = np.tan(FIELD_OF_VIEW / 2)
    reach = np.abs(seen[:, :2] / seen[:, 2:]).max(axis=0) / [WIDE * edge, edge]
    assert reach.max() == pytest.approx(FILLED, rel=1e-6)  # the eye stands in single precision


# --- the arm as it looks ---------------------------------------------------------------------------


def test_each_link_moves_with_its_frame(shapes: Path, tmp_path: Path) -> None:
    robot = read_urdf(shapes)
    run = build_run(rows=200, robot=robot)
    path = write_recording(run, tmp_path / "run.rrd")
    arm = there(drawn_arm(scene_of(run).arms[0]))
    position, rotation = frames_over_log(robot, run.q[arm.moving.rows])
    for k, joint in enumerate(robot.joints, start=1):
        entity = f"robot/joint/{joint.name}"
        # Single precision, which the viewer draws with.
        moved = column(path, entity, "Transform3D:translation")[:, 0]
        turned = column(path, entity, "Transform3D:quaternion")[:, 0]
        np.testing.assert_allclose(moved, position[:, k], atol=1e-6)
        expected = to_quaternions(rotation[:, k].reshape(-1, 9), "matrix")
        np.testing.assert_allclose(turned, expected, atol=1e-6)
    assert below(path, "robot") == {
        "base",
        "base/visual\\ 1",
        *(f"joint/turn{k}" for k in range(1, 7)),
        *(f"joint/turn{k}/visual\\ 1" for k in range(1, 7)),
        "joints",
    }


def test_shapes_stand_still_in_their_frame(shapes: Path, tmp_path: Path) -> None:
    path = write_recording(build_run(rows=50, robot=read_urdf(shapes)), tmp_path / "run.rrd")
    box, cylinder, capsule = (f"robot/{link}/visual\\ 1" for link in ("base", "joint/turn1", "joint/turn4"))
    np.testing.assert_allclose(column(path, box, "Boxes3D:half_sizes"), [[[0.15, 0.15, 0.05]]], atol=1e-7)
    np.testing.assert_allclose(column(path, box, "Transform3D:translation"), [[[0.0, 0.0, -0.05]]], atol=1e-7)
    np.testing.assert_allclose(column(path, cylinder, "Cylinders3D:lengths"), [[0.2]], atol=1e-7)
    assert column(path, cylinder, "Cylinders3D:colors").tolist() == [[0xFF3333FF]]
    # Rerun's capsule goes from its translation along z: ours lies around its origin.
    np.testing.assert_allclose(
        column(path, capsule, "Capsules3D:translations"), [[[0.0, 0.0, -0.06]]], atol=1e-7
    )


def test_meshes_are_in_the_recording_and_not_in_its_metadata(shapes: Path, tmp_path: Path) -> None:
    robot = read_urdf(shapes)
    path = write_recording(build_run(rows=50, robot=robot), tmp_path / "run.rrd")
    mesh = shapes.parent / "meshes" / "bar.stl"
    blob = column(path, "robot/joint/turn3/visual\\ 1", "Asset3D:blob")
    assert bytes(blob.reshape(-1).astype(np.uint8)) == mesh.read_bytes()
    told = json.loads(Store(path).metadata)["result"]["robot"]["visuals"][3]
    assert told["shape"] == {"$is": "Mesh", "file": str(mesh), "scale": [1.0, 1.0, 1.0]}


def test_an_arm_read_back_looks_as_it_did_and_a_solid_stands_for_a_mesh_that_is_gone(
    shapes: Path, tmp_path: Path
) -> None:
    robot = read_urdf(shapes)
    path = write_recording(build_run(rows=50, robot=robot), tmp_path / "run.rrd")
    back: Any = read_recording(path)
    assert back.robot == robot
    again = write_recording(back, tmp_path / "again.rrd")
    assert below(again, "robot") == below(path, "robot")
    (shapes.parent / "meshes" / "bar.stl").unlink()
    bare = write_recording(back, tmp_path / "bare.rrd")
    assert below(bare, "robot") == {*below(path, "robot"), "joint/turn3/visual\\ 2"}
    joint, link = (f"robot/joint/turn3/visual\\ {k}" for k in (1, 2))
    assert column(bare, joint, "Cylinders3D:lengths").shape == (1, 1)
    assert column(bare, link, "Capsules3D:lengths").tolist() == [[pytest.approx(0.2)]]


def test_an_arm_that_shows_nothing_is_drawn_in_solids_that_its_frames_move(tmp_path: Path) -> None:
    run = build_run(rows=200)
    path = write_recording(run, tmp_path / "run.rrd")
    robot = there(run.robot)
    solids = build_placeholder_solids(robot)
    carriers = ["base", *(f"joint/{name}" for name in robot.coordinates)]
    on = [sum(one.joint == joint for one in solids) for joint in (None, *robot.coordinates)]
    shapes = {
        f"{at}/visual\\ {k}" for at, count in zip(carriers, on, strict=True) for k in range(1, count + 1)
    }
    assert sum(on) == len(solids) == len(shapes)
    assert below(path, "robot") == {*carriers, *shapes, "joint/phi6/tool", "tip"}
    drawn = np.searchsorted(run.t_ns, times_of(path, f"{SCENE}/robot/joint/phi4"))
    position, _ = frames_over_log(robot, run.q[drawn])
    moved = column(path, "robot/joint/phi4", "Transform3D:translation")[:, 0]
    np.testing.assert_allclose(moved, position[:, 4], atol=1e-6)  # single precision
    for shape in shapes:  # once, at all times
        assert column(path, f"robot/{shape}", "Transform3D:translation").shape == (1, 1, 3)


def test_solids_of_joints_have_their_colours_and_the_tool_its_axes(tmp_path: Path) -> None:
    run = build_run(rows=20)
    tool = from_offset([0.01, 0.02, 0.1, 0.3, 0.2, 0.1])
    robot = there(run.robot).placed(tool=tool)
    path = write_recording(replace(run, robot=robot), tmp_path / "run.rrd")
    for name, colour in zip(robot.coordinates, JOINT_COLOURS, strict=False):
        (found,) = column(path, f"robot/joint/{name}/visual\\ 1", "Cylinders3D:colors").tolist()
        assert found == [int(colour[1:], 16) << 8 | 0xFF]
    effector = robot.joints[-1].origin @ robot.tip @ tool
    strips = np.array(static(path, f"{SCENE}/robot/joint/phi6/tool", "LineStrips3D:strips"))
    np.testing.assert_allclose(strips[:, 0], np.tile(effector.translation, (3, 1)), atol=1e-6)
    axes = (strips[:, 1] - strips[:, 0]).T
    np.testing.assert_allclose(axes / np.linalg.norm(axes, axis=0), effector.rotation, atol=1e-5)


def test_own_shapes_win_and_only_moving_links_without_any_get_solids() -> None:
    """What is fixed to a link counts as the link."""
    joints = (Joint("mount", "fixed"), Joint("a"), Joint("plate", "fixed"), Joint("b"))
    q = np.zeros((1, 2))

    def added(*carriers: str | None) -> set[str | None]:
        own = tuple(Visual(carrier, Sphere(0.1)) for carrier in carriers)
        robot = Chain("arm", joints, visuals=own)
        bodies = bodies_over_log(robot, q)
        assert [one for body in bodies for one in body.visuals if one in own] == own_shapes(robot)
        return {body.joint for body in bodies if set(body.visuals) - set(own)}

    assert added() == {None, "a", "b"}
    assert added(None, "mount", "b") == {"a"}
    assert added("a", "b") == added("plate", "b") == set()


def test_a_mark_is_seen_around_the_solid_that_it_marks() -> None:
    arm = there(drawn_arm(scene_of(build_run(rows=5)).arms[0]))
    for k, joint in enumerate(arm.chain.coordinates, start=1):
        housing = build_placeholder_solids(arm.chain)
        radii = [
            one.shape.radius
            for one in housing
            if one.joint == joint and not isinstance(one.shape, (Box, Mesh))
        ]
        assert arm.thickness(ArmMark(k, "", "#000000")) == max(radii) > 0.02
    assert arm.thickness(ArmMark(7, "", "#000000")) == 0.0  # the effector, which is fixed


# --- masses ----------------------------------------------------------------------------------------


def test_mass_centres_are_dots_as_large_as_balls_that_move_with_the_arm(tmp_path: Path) -> None:
    chain = load_robot("ur10")
    run = build_run(rows=200, robot=chain)
    path = write_recording(run, tmp_path / "run.rrd")
    drawn = np.searchsorted(run.t_ns, times_of(path, f"{SCENE}/robot/masses"))
    assert len(drawn) > 20
    centres = centres_of_mass_over_log(chain, run.q[drawn])
    moved = column(path, "robot/masses", "Points3D:positions")
    np.testing.assert_allclose(moved, centres, rtol=0, atol=1e-6)  # single precision
    radii = np.array(static(path, f"{SCENE}/robot/masses", "Points3D:radii"))
    masses = np.array([one.mass for one in chain.inertials], float)
    np.testing.assert_allclose((radii / radii.max()) ** 3, masses / masses.max(), rtol=1e-5)
    words = static(path, f"{SCENE}/robot/masses", "Points3D:labels")
    assert words[0] == f"{masses[0]:.4g} kg at {chain.inertials[0].joint or 'the base'}"


def test_an_arm_without_masses_has_no_dots(tmp_path: Path) -> None:
    path = write_recording(build_run(rows=20), tmp_path / "run.rrd")
    assert "masses" not in below(path, "robot")


def test_links_are_seen_through_where_masses_are_in_them(shapes: Path, tmp_path: Path) -> None:
    robot = read_urdf(shapes)
    robot = replace(robot, inertials=(Inertial(robot.coordinates[0], 1.0),))
    path = write_recording(build_run(rows=20, robot=robot), tmp_path / "run.rrd")
    (box,) = column(path, "robot/base/visual\\ 1", "Boxes3D:colors").tolist()
    assert box == [0x66666600 + round(255 * SEEN_THROUGH)]
