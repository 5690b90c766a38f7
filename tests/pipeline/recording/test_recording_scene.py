"""The arm as it looks, the deviation enlarged, and the worst place in the 3D view of a recording."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from rerun.chunk import RrdReader

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.chains.visual import Box, Mesh, Sphere, Visual
from urmpipe_models.kinematics.forward import frames_over_log
from urmpipe_models.orientation import matrices, quaternions
from urmpipe_models.robots.urdf_reader import read_urdf
from urmpipe_models.transform import rotation_x, translation
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.trajectory import AlignMode
from urmpipe_pipeline.comparison.wording import amount_words
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.meshes import drawable, missing_visuals
from urmpipe_pipeline.recording.bodies import bodies_over_log, lacks_shapes
from urmpipe_pipeline.recording.enlarged import LEAST_SEEN
from urmpipe_pipeline.recording.scene import Mark, scene_of
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.ingest import kinematics
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def column(path: Path, entity: str, name: str) -> Any:
    """Return one component of an entity, row by row, as numbers."""
    stream = RrdReader(path).store().stream().filter(content=entity, components=name)
    rows = [row for chunk in stream for row in chunk.to_record_batch().column(name).to_pylist()]
    return np.array(rows)


def entities(path: Path, root: str) -> set[str]:
    chunks = RrdReader(path).store().stream().filter(content=f"{root}/**")
    return {chunk.entity_path for chunk in chunks}


# --- the arm as it looks ---------------------------------------------------------------------------


def test_each_link_moves_with_its_frame(make_run: MakeRun, shapes: Path, tmp_path: Path) -> None:
    robot = read_urdf(shapes)
    run = make_run(rows=200, robot=robot)
    path = write_recording(run, tmp_path / "run.rrd")
    arm = scene_of(run).arm
    assert arm is not None
    position, rotation = frames_over_log(robot, run.q[arm.sample])
    for k, joint in enumerate(robot.joints, start=1):
        entity = f"/robot/joint/{joint.name}"
        # Single precision, which the viewer draws with.
        moved = column(path, entity, "Transform3D:translation")[:, 0]
        turned = column(path, entity, "Transform3D:quaternion")[:, 0]
        np.testing.assert_allclose(moved, position[:, k], atol=1e-6)
        expected = quaternions(rotation[:, k].reshape(-1, 9), "matrix")
        np.testing.assert_allclose(turned, expected, atol=1e-6)
    assert entities(path, "/robot") == {
        "/robot/base",
        "/robot/base/visual\\ 1",
        *(f"/robot/joint/turn{k}" for k in range(1, 7)),
        *(f"/robot/joint/turn{k}/visual\\ 1" for k in range(1, 7)),
        "/robot/joints",
    }


def test_shapes_stand_still_in_their_frame(make_run: MakeRun, shapes: Path, tmp_path: Path) -> None:
    path = write_recording(make_run(rows=50, robot=read_urdf(shapes)), tmp_path / "run.rrd")
    box, cylinder, capsule = (f"/robot/{link}/visual\\ 1" for link in ("base", "joint/turn1", "joint/turn4"))
    np.testing.assert_allclose(column(path, box, "Boxes3D:half_sizes"), [[[0.15, 0.15, 0.05]]], atol=1e-7)
    np.testing.assert_allclose(column(path, box, "Transform3D:translation"), [[[0.0, 0.0, -0.05]]], atol=1e-7)
    np.testing.assert_allclose(column(path, cylinder, "Cylinders3D:lengths"), [[0.2]], atol=1e-7)
    assert column(path, cylinder, "Cylinders3D:colors").tolist() == [[0xFF3333FF]]
    # Rerun's capsule goes from its translation along z: ours lies around its origin.
    np.testing.assert_allclose(
        column(path, capsule, "Capsules3D:translations"), [[[0.0, 0.0, -0.06]]], atol=1e-7
    )


def test_meshes_are_in_the_recording_and_not_in_its_metadata(
    make_run: MakeRun, shapes: Path, tmp_path: Path
) -> None:
    robot = read_urdf(shapes)
    path = write_recording(make_run(rows=50, robot=robot), tmp_path / "run.rrd")
    mesh = shapes.parent / "meshes" / "bar.stl"
    blob = column(path, "/robot/joint/turn3/visual\\ 1", "Asset3D:blob")
    assert bytes(blob.reshape(-1).astype(np.uint8)) == mesh.read_bytes()
    told = json.loads(Store(path).metadata)["result"]["robot"]["visuals"][3]
    assert told["shape"] == {"$is": "Mesh", "file": str(mesh), "scale": [1.0, 1.0, 1.0]}


def test_an_arm_read_back_looks_as_it_did_and_without_its_meshes_has_lines(
    make_run: MakeRun, shapes: Path, tmp_path: Path
) -> None:
    robot = read_urdf(shapes)
    path = write_recording(make_run(rows=50, robot=robot), tmp_path / "run.rrd")
    back = read_recording(path)
    assert isinstance(back, Run)
    assert back.robot == robot
    again = write_recording(back, tmp_path / "again.rrd")
    assert entities(again, "/robot") == entities(path, "/robot")
    (shapes.parent / "meshes" / "bar.stl").unlink()
    bare = write_recording(back, tmp_path / "bare.rrd")
    assert entities(bare, "/robot") == {
        *(name for name in entities(path, "/robot") if not name.startswith("/robot/joint/turn3")),
        "/robot/links",
    }


def test_lines_stand_for_links_without_shapes(make_run: MakeRun, shapes: Path) -> None:
    assert make_run(rows=5).robot is not None
    plain = scene_of(make_run(rows=5)).arm
    assert plain is not None
    assert (plain.bodies, plain.bare) == ((), True)
    shown = scene_of(make_run(rows=5, robot=read_urdf(shapes))).arm
    assert shown is not None
    assert (len(shown.bodies), shown.bare) == (7, False)


def test_what_is_fixed_to_a_link_counts_as_the_link() -> None:
    joints = (Joint("mount", "fixed"), Joint("a"), Joint("plate", "fixed"), Joint("b"))
    q = np.zeros((1, 2))

    def bare(*carriers: str | None) -> bool:
        visuals = tuple(Visual(carrier, Sphere(0.1)) for carrier in carriers)
        robot = Chain("arm", joints, visuals=visuals)
        return lacks_shapes(robot, bodies_over_log(robot, q))

    assert bare()
    assert bare(None, "mount", "b")
    assert not bare("a", "b")
    assert not bare("plate", "b")


def test_one_warning_tells_of_all_meshes_that_are_missing(tmp_path: Path) -> None:
    there = tmp_path / "there.STL"
    there.write_bytes(b"solid")
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "picture.png").write_bytes(b"")
    files = [there, tmp_path / "gone.stl", tmp_path / "gone.stl", tmp_path / "folder.stl"]
    meshes = [Mesh(str(file)) for file in [*files, tmp_path / "picture.png", "package://gone/a.dae"]]
    visuals = (Visual(None, Box((1.0, 1.0, 1.0))), *(Visual(None, mesh) for mesh in meshes))
    robot = Chain("arm", (Joint("j"),), visuals=visuals)
    assert missing_visuals(robot) == [
        LogWarning(
            "visual-missing",
            f"4 of 5 mesh files of robot arm cannot be drawn, the first {tmp_path / 'gone.stl'}:"
            " lines stand for the links; allowed: .stl, .obj, .glb, .gltf, .dae files that are there",
        )
    ]
    assert missing_visuals(replace(robot, visuals=visuals[:2])) == []
    assert kinematics(robot, *(np.zeros((1, 1)),) * 3)[1] == missing_visuals(robot)


@pytest.mark.parametrize(
    ("document", "whole"),
    [
        ({"buffers": [{"uri": "data:application/octet-stream;base64,AA=="}]}, True),
        ({"buffers": [{"uri": "arm.bin"}]}, False),
        ({"images": [{"uri": "arm.png"}]}, False),
        ([], False),
        ({"buffers": None}, False),
    ],
)
def test_a_gltf_that_needs_other_files_is_not_drawn(document: object, whole: bool, tmp_path: Path) -> None:
    path = tmp_path / "arm.gltf"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert drawable(Visual(None, Mesh(str(path)), translation(0.0, 0.0, 0.0))) is whole


@pytest.mark.parametrize("align", get_args(AlignMode))
def test_the_arm_stands_where_the_alignment_puts_it(
    align: AlignMode, make_run: MakeRun, shapes: Path
) -> None:
    """Else the arm of a log in a frame of its own would stand beside its path."""
    robot = read_urdf(shapes)
    elsewhere = robot.placed(
        translation(0.3, -0.2, 0.1) @ rotation_x(0.7), translation(0.05, 0.0, 0.02) @ rotation_x(0.2)
    )
    reference, run = make_run("asked for", 400, robot=robot), make_run("log", 400, 0.1, robot=elsewhere)
    comparison = compare_runs(reference, [run], CompareOptions(align=align))
    (one,) = comparison.runs
    arm = scene_of(comparison).arm
    assert arm is not None
    # The same sums in another order: rounding in a space of 2 m.
    np.testing.assert_allclose(arm.skeleton[:, -1], one.actual[arm.sample], rtol=0, atol=1e-13)
    turn, shift = np.array(one.alignment.rotation), np.array(one.alignment.translation)
    assert run.robot is not None
    position, rotation = frames_over_log(run.robot, run.q[arm.sample])
    for k, body in enumerate(arm.bodies):
        np.testing.assert_allclose(body.position, position[:, k] @ turn.T + shift, rtol=0, atol=1e-13)
        np.testing.assert_allclose(matrices(body.quat_xyzw), turn @ rotation[:, k], rtol=0, atol=1e-13)


# --- the deviation ---------------------------------------------------------------------------------


def test_the_deviation_is_drawn_fifty_times_as_large(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("one",))
    (one,) = comparison.runs
    way = scene_of(comparison).enlarged
    assert way is not None
    assert (way.path, way.point, way.factor) == ("/path/enlarged", "/point/enlarged", 50)
    np.testing.assert_array_equal(way.strips[0], one.reference + 50 * (one.actual - one.reference))
    rows = np.searchsorted(one.sample, way.track.sample)
    np.testing.assert_array_equal(way.track.position, way.strips[0][rows])
    assert one.decided_at in rows


def test_of_several_runs_only_the_deviation_of_the_one_whose_arm_stands_there_is_enlarged(
    make_comparison: MakeComparison,
) -> None:
    comparison = make_comparison(("one", "two", "far"))
    one, two, far = comparison.runs
    scene = scene_of(comparison)
    assert (scene.whose, scene.enlarged and scene.enlarged.factor) == ("far", 50)
    assert scene.enlarged is not None
    np.testing.assert_array_equal(scene.enlarged.strips[0], far.reference + 50 * (far.actual - far.reference))
    norm = replace(far.statistics["norm"], max=9.0)
    wide = replace(far, statistics={**far.statistics, "norm": norm})
    scene = scene_of(replace(comparison, runs=(one, two, wide)))
    assert (scene.whose, scene.enlarged) == ("far", None)
    assert scene.worst is not None
    assert scene.worst.text == f"{amount_words(far.decisive)} at t = {far.decisive.t_max:.3f} s, far"


@pytest.mark.parametrize(
    ("largest", "factor"),
    [
        (0.0, None),
        (0.9 * LEAST_SEEN / 50, None),
        (1.1 * LEAST_SEEN / 50, 50),
        (0.99 / 50, 50),
        (1.01 / 50, 20),
        (0.49, 2),
        (0.51, None),
    ],
)
def test_the_factor_keeps_the_deviation_inside_the_scene(
    make_comparison: MakeComparison, largest: float, factor: int | None
) -> None:
    """`largest` is a share of the radius of the scene."""
    comparison = make_comparison(("one",), rows=50)
    (one,) = comparison.runs
    radius = replace(scene_of(comparison), enlarged=None).ball()[1]
    norm = replace(one.statistics["norm"], max=largest * radius)
    told = replace(comparison, runs=(replace(one, statistics={**one.statistics, "norm": norm}),))
    way = scene_of(told).enlarged
    assert (way and way.factor) == factor


def test_the_place_that_decides_has_its_size_and_its_time(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(("one",))
    (one,) = comparison.runs
    decisive, row = one.decisive, one.decided_at
    assert decisive.quantity == "x" and row != one.worst
    assert abs(one.delta[row, 0]) == decisive.max
    x, y, z = one.actual[row].tolist()
    text = f"|Δx| = {1e3 * decisive.max:.4f} mm of 3.5 mm allowed at t = {decisive.t_max:.3f} s"
    assert scene_of(comparison).worst == Mark((x, y, z), text)
    path = write_recording(comparison, tmp_path / "one.rrd")
    assert column(path, "/point/worst/label", "Points3D:labels").tolist() == [[text]]


def test_runs_may_be_called_like_the_enlarged_path(make_comparison: MakeComparison, tmp_path: Path) -> None:
    path = write_recording(make_comparison(("enlarged", "worst")), tmp_path / "both.rrd")
    assert {"/path/enlarged", "/path/enlarged\\ \\(2\\)", "/path/worst\\ \\(2\\)"} < entities(path, "/path")


def test_a_log_against_itself_has_nothing_to_enlarge(
    make_run: MakeRun, make_comparison: MakeComparison
) -> None:
    run = make_run(rows=50)
    scene = scene_of(compare_runs(run, [run], CompareOptions({"axis": 0.0035})))
    assert scene.enlarged is None
    assert scene.worst is not None
    assert scene.worst.text == "|Δx| = 0.0000 mm of 3.5 mm allowed at t = 0.000 s"
