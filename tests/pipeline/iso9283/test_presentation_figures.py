"""What is drawn of a test after ISO 9283: clouds, corners, tube and speeds, also in a recording."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from made_runs import URM6, path_run, run_of
from presented import scene_of
from recorded import entities, static, times_of
from repeated import along, late
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.iso import IsoOptions, measure_iso
from urmpipe_pipeline.iso9283 import figures
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath, IsoTest
from urmpipe_pipeline.presentation.figure import Figure, Panel
from urmpipe_pipeline.results import present, write_recording

SVG = "{http://www.w3.org/2000/svg}"
SQUARE = ((0.0, 0.0, 0.3), (0.2, 0.0, 0.3), (0.2, 0.2, 0.3), (0.0, 0.2, 0.35), (0.0, 0.0, 0.3))
CYCLES = 6
PIXEL = 0.11
"""Places in a drawing are written to a tenth of a pixel: twice half of one, and a little."""


@pytest.fixture(scope="module")
def result() -> Comparison:
    """Cycles of a square with a rest in its middle, off by 0.1 mm and as much at random."""
    path = along(SQUARE, 0.2, rest=1.0, rests=(2,))
    rng, done = np.random.default_rng(7), late(path, 3)
    runs = [path_run(done + 1e-4 + rng.normal(0.0, 1e-4, 3), name=f"c{k}") for k in range(CYCLES)]
    allowed = {"AT": 1e-3, "RT": 5e-3}
    return measure_iso(path_run(path), runs, IsoOptions(allowed, planes=40))


@pytest.fixture(scope="module")
def iso(result: Comparison) -> IsoTest:
    return there(result.iso)


@pytest.fixture(scope="module")
def path(iso: IsoTest) -> CutPath:
    return there(iso.path)


def panels(figure: Figure) -> list[Panel]:
    return [panel for view in figure.views for panel in view.panels]


def views(root: ET.Element) -> int:
    """The number of squares of a drawing."""
    return len([*root.iter(f"{SVG}clipPath")])


def dots(root: ET.Element) -> list[FloatArray]:
    """The attained points of each view in pixels, shape (cycles, 2) each."""
    ways = (one.attrib["d"] for one in root.iter(f"{SVG}path") if one.get("class") == "attained")
    return [np.array([list(map(float, at)) for at in re.findall(r"M(\S+) (\S+)h0", way)]) for way in ways]


def test_a_pose_is_its_cloud_in_three_views_of_one_scale(iso: IsoTest) -> None:
    poses = there(iso.poses)
    root = ET.fromstring(figures.pose_drawing(iso, poses).svg)
    clouds, count = dots(root), len(poses.command)
    assert len(clouds) == views(root) == 3 * count
    for k in range(count):
        off = poses.attained[:, k] - poses.command[k]
        side, front, above = (cloud - cloud.mean(axis=0) for cloud in clouds[3 * k : 3 * k + 3])
        spread = off - off.mean(axis=0)
        scale = float((side[:, 0] @ spread[:, 0]) / (spread[:, 0] @ spread[:, 0]))  # pixels per [m]
        for cloud, axes in ((side, [0, 2]), (front, [1, 2]), (above, [0, 1])):
            np.testing.assert_allclose(cloud * [1.0, -1.0], scale * spread[:, axes], atol=10 * PIXEL)
        rings = [
            float(one.attrib["r"]) for one in root.iter(f"{SVG}circle") if one.get("stroke-width") == "1.5"
        ]
        radius = there(there(iso.at(f"pose {k + 1}", "RP")).value)
        assert rings[3 * k : 3 * k + 3] == pytest.approx([scale * radius] * 3, rel=0.02)


def test_of_many_poses_the_worst_are_drawn(iso: IsoTest) -> None:
    rng = np.random.default_rng(1)
    command = rng.uniform(-0.2, 0.2, (50, 3))
    attained = command + rng.normal(0.0, 1e-4, (3, 50, 3))
    poses = AttainedPoses(command, attained)
    ap = np.linalg.norm(attained.mean(axis=0) - command, axis=1)
    criteria = tuple(replace(iso.criteria[0], at=f"pose {k + 1}", name="AP", value=ap[k]) for k in range(50))
    drawing = figures.pose_drawing(replace(iso, criteria=criteria), poses)
    assert len(dots(ET.fromstring(drawing.svg))) == 3 * figures.MAX_DRAWN
    assert "12 worst of 50 poses" in drawing.alt
    numbers = {int(number) for number in re.findall(r"pose (\d+): AP", drawing.alt)}
    assert numbers == {k + 1 for k in np.argsort(-ap)[: figures.MAX_DRAWN].tolist()}


def lengths(root: ET.Element, name: str) -> Iterator[float]:
    """Yield how long the lines of a name are in pixels."""
    for one in root.iter(f"{SVG}line"):
        if one.get("class") == name:
            x1, y1, x2, y2 = (float(one.attrib[at]) for at in ("x1", "y1", "x2", "y2"))
            yield float(np.hypot(x2 - x1, y2 - y1))


def test_corners_show_their_lengths(iso: IsoTest, path: CutPath) -> None:
    drawing = figures.corner_drawing(path)
    root = ET.fromstring(drawing.svg)
    assert views(root) == len(path.corners) > 1
    rounding, beyond = list(lengths(root, "CR")), list(lengths(root, "CO"))
    for k, one in enumerate(path.corners):
        overshoot = there(one.overshoot)
        assert overshoot > 0.0  # else nothing is held against anything
        # what stands out of the plane of the legs is not seen of a length
        normal = np.cross(one.point - one.command[0], one.command[-1] - one.point)
        normal /= np.linalg.norm(normal)
        seen = [
            np.linalg.norm(np.cross(normal, end))
            for end in (one.nearest - one.point, there(one.overshoot_point) - there(one.nearest_on_leg))
        ]
        assert rounding[k] / beyond[k] == pytest.approx(seen[0] / seen[1], abs=0.02)
        assert f"CR {1e3 * one.rounding:.4f} mm, CO {1e3 * overshoot:.4f} mm" in drawing.svg


def test_a_corner_that_turns_back_has_a_plane(iso: IsoTest, path: CutPath) -> None:
    one = path.corners[0]
    back = replace(
        one, point=np.zeros(3), command=np.array([[-0.1, 0, 0], [0, 0, 0], [-0.1, 0, 0]]),
        mean=np.array([[-0.1, 0, 0], [-1e-4, 0, 0], [-0.1, 0, 0]]), nearest=np.array([-1e-4, 0, 0]),
        rounding=1e-4, overshoot_point=None, nearest_on_leg=None, overshoot=0.0,
    )  # fmt: skip
    root = ET.fromstring(figures.corner_drawing(replace(path, corners=(back,))).svg)
    assert len(list(lengths(root, "CR"))) == 1 and not list(lengths(root, "CO"))


def test_a_small_overshoot_far_from_its_corner_is_told_and_not_drawn(iso: IsoTest, path: CutPath) -> None:
    one = path.corners[0]
    far = one.point + 0.08 * (one.command[-1] - one.point) / np.linalg.norm(one.command[-1] - one.point)
    aside = replace(one, overshoot_point=far + np.array([1e-5, 0.0, 0.0]), nearest_on_leg=far, overshoot=1e-5)
    drawing = figures.corner_drawing(replace(path, corners=(aside,)))
    assert not list(lengths(ET.fromstring(drawing.svg), "CO"))
    assert "CO: 80.00 mm from the corner" in drawing.svg and "CO 0.01000 mm" in drawing.alt


def test_at_and_rt_stand_at_their_planes_with_what_is_allowed(iso: IsoTest, path: CutPath) -> None:
    both = panels(figures.deviation_figure(iso, path))
    for panel, values, allowed in zip(
        both, (path.accuracy, there(path.repeatability)), (1e-3, 5e-3), strict=True
    ):
        over = there(panel.over)
        limit, line = panel.lines
        planes = np.isfinite(over.values)  # the others are gaps about corners
        np.testing.assert_array_equal(over.values[planes], path.s)
        np.testing.assert_array_equal(np.asarray(line.values)[planes], values)
        assert np.count_nonzero(~planes) == len(path.corners) > 1
        known = np.asarray(limit.values)
        assert limit.dashed and set(known[np.isfinite(known)].tolist()) == {allowed}
        (mark,) = panel.marks
        assert (over.values[mark.t_ns], mark.value) == (path.s[values.argmax()], values.max())


def test_without_tolerance_or_repetition_there_is_accuracy_alone(iso: IsoTest, path: CutPath) -> None:
    bare = replace(iso, criteria=tuple(replace(one, tolerance=None) for one in iso.criteria))
    (panel,) = panels(figures.deviation_figure(bare, replace(path, repeatability=None)))
    assert panel.title == "AT" and len(panel.lines) == 1


def test_speeds_stand_over_the_path(path: CutPath) -> None:
    figure = figures.speed_figure(path)
    (panel,) = panels(figure)
    s = np.asarray(there(panel.over).values)
    cycles, commanded, mean = (np.asarray(line.values) for line in panel.lines)
    known = np.isfinite(commanded)
    np.testing.assert_array_equal(s[known], path.speed_s)
    np.testing.assert_array_equal(commanded[known], path.commanded_speed)
    drawn = np.isfinite(mean)
    every = np.isfinite(path.speed).any(axis=0)
    np.testing.assert_array_equal(s[drawn], path.speed_s[every])
    np.testing.assert_allclose(mean[drawn], np.nanmean(path.speed[:, every], axis=0), rtol=1e-15)
    parts = np.flatnonzero(np.isfinite(cycles) & np.isnan(s))
    assert len(parts) == CYCLES  # a gap behind each
    assert np.nanmax(cycles) == np.nanmax(path.speed)  # no peak is missing
    assert [mark.words.partition(":")[0] for mark in panel.marks] == [one.name for one in path.legs]
    assert list(figure.instants.values()) == [one.name for one in path.corners]
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path.path, axis=0), axis=1)))
    for row, corner in zip(figure.instants, path.corners, strict=True):
        at = np.array([np.interp(s[row], length, column) for column in path.path.T])
        assert np.linalg.norm(at - corner.point) < 2.0 * path.total / len(path.speed_s)


def test_the_tube_is_as_wide_as_rt_about_the_mean_path(path: CutPath) -> None:
    factor = 20
    rings = there(figures.tube(path, factor)).position.reshape(len(path.s), figures.RING_PIECES + 2, 3)
    assert np.isnan(rings[:, -1]).all()
    rings = rings[:, :-1]
    centre = path.command + factor * (path.mean - path.command)
    off = rings - centre[:, np.newaxis]
    expected = factor * np.repeat(there(path.repeatability)[:, np.newaxis], figures.RING_PIECES + 1, axis=1)
    np.testing.assert_allclose(np.linalg.norm(off, axis=2), expected, rtol=1e-12)
    np.testing.assert_allclose(np.einsum("rpi,ri->rp", off, path.normal), 0.0, atol=1e-15)
    mean = figures.mean_line(path, factor)
    known = np.isfinite(mean.position).all(axis=1)
    np.testing.assert_array_equal(mean.position[known], centre)
    np.testing.assert_array_equal(np.asarray(mean.values)[known], path.accuracy)


def test_a_deviation_is_enlarged_as_far_as_the_scene_allows(iso: IsoTest, path: CutPath) -> None:
    factor = figures.display_factor(path, None)
    radius = float(np.linalg.norm(np.ptp(path.path, axis=0))) / 2.0
    largest = float((path.accuracy + there(path.repeatability)).max())
    next_factor = figures.FACTORS[figures.FACTORS.index(factor) - 1]
    assert factor * largest <= figures.MAX_DISPLAYED * radius < next_factor * largest
    assert f"x{factor}" in figures.path_figure(path).caption
    poses = there(iso.poses)
    far = replace(poses, attained=poses.attained + 1.0)
    assert figures.display_factor(path, far) == 1


SCENE = "/shown/scene"


def test_the_recording_holds_balls_tube_and_a_point_each_cycle(
    result: Comparison, iso: IsoTest, path: CutPath, tmp_path: Path
) -> None:
    file = tmp_path / "test.rrd"
    write_recording(result, file)
    scene, poses = scene_of(present(result)), there(iso.poses)
    factor = figures.display_factor(path, poses)
    assert f"x{factor}" in scene.title
    radius = [factor * there(there(iso.at(f"pose {k + 1}", "RP")).value) for k in range(len(poses.command))]
    sizes = np.array(static(file, f"{SCENE}/balls", "Ellipsoids3D:half_sizes"))
    np.testing.assert_allclose(sizes, np.repeat(np.array(radius)[:, np.newaxis], 3, axis=1), rtol=1e-6)
    centres = np.array(static(file, f"{SCENE}/balls", "Ellipsoids3D:centers"))
    expected = poses.command + factor * (poses.attained.mean(axis=0) - poses.command)
    np.testing.assert_allclose(centres, expected, rtol=1e-6)
    points = sorted(name for name in entities(file, f"{SCENE}/point"))
    assert len(points) == CYCLES and "/shown/plots" not in "".join(entities(file))
    for name, run in zip(points, result.runs, strict=True):  # all on one clock, from their starts on
        assert (min(times_of(file, name)), max(times_of(file, name))) == (run.t_ns[0], run.t_ns[-1])
    tube = next(name for name in entities(file, f"{SCENE}/path") if "tube" in name)
    rings = static(file, tube, "LineStrips3D:strips")
    assert len(rings) == len(path.s)


def test_the_arm_of_one_cycle_stands_in_the_scene() -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 400)
    q = np.column_stack([0.3 * np.sin(t + k) for k in range(6)])
    rng = np.random.default_rng(1)
    runs = [run_of(q + rng.normal(0.0, 1e-4, 6), URM6, name=f"c{k}") for k in range(3)]
    result = measure_iso(run_of(q, name="wanted"), runs)
    (arm,) = scene_of(present(result)).arms
    assert arm.chain == URM6 and arm.t_ns is not None and arm.t_ns[0] == 0
