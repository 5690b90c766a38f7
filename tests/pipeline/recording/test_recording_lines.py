"""The arm and the paths of a recording: thinned out, broken where values are missing, dashed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.palette import JOINT_COLOURS, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.ways import DASHES, LEAST_DASH, MOST
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def test_the_arm_moves_at_50_hz_through_its_own_kinematics(make_run: MakeRun) -> None:
    run = make_run()
    arm = scene_of(run).arm
    assert run.robot is not None
    assert arm is not None
    assert np.unique(np.diff(arm.t_ns[:-1])).tolist() == [20_000_000]
    assert arm.t_ns[-1] == run.t_ns[-1]
    np.testing.assert_array_equal(arm.skeleton, points_over_log(run.robot, run.q[arm.sample]))
    assert arm.colours == (*JOINT_COLOURS[:6], REFERENCE_COLOUR, run_colour(0))


def test_a_long_run_is_thinned_out_for_drawing(make_run: MakeRun) -> None:
    scene = scene_of(make_run(rows=200_000))
    assert scene.arm is not None
    # The last sample is always drawn, so there may be one more.
    assert MOST - 1 <= len(scene.arm.t_ns) <= MOST + 1
    assert sum(len(strip) for strip in scene.ways[0].strips) <= MOST + 1


def test_the_sample_that_decides_is_drawn(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("coppeliasim",))
    worst = 465  # not one of the samples that are drawn anyway, which are every fourth
    one = comparison.runs[0]
    x = replace(one.statistics["x"], max=1.0, sample_max=int(one.sample[worst]))
    comparison = replace(comparison, runs=(replace(one, statistics={**one.statistics, "x": x}),))
    scene = scene_of(comparison)
    assert scene.arm is not None
    assert worst in scene.arm.sample
    asked, first = scene.ways
    for way, position in ((asked, comparison.runs[0].reference), (first, comparison.runs[0].actual)):
        np.testing.assert_array_equal(way.track.position[way.track.sample == worst], position[[worst]])


def test_lines_are_broken_where_values_are_missing(make_run: MakeRun) -> None:
    run = make_run(rows=100)
    assert run.tcp is not None
    position = run.tcp.position.copy()
    position[[40, 41, 60]] = np.nan
    (way,) = scene_of(replace(run, tcp=replace(run.tcp, position=position))).ways
    for strip, rows in zip(way.strips, (range(40), range(42, 60), range(61, 100)), strict=True):
        np.testing.assert_array_equal(strip, position[rows])


def length(strips: Sequence[Any]) -> float:
    """Return the length of lines in [m]."""
    return sum(float(np.linalg.norm(np.diff(strip, axis=0), axis=1).sum()) for strip in strips)


@pytest.mark.parametrize(("rows", "dashes"), [(9000, DASHES), (1500, 50)])
def test_what_was_asked_for_is_dashed(make_comparison: MakeComparison, rows: int, dashes: int) -> None:
    """A short path has fewer dashes: they would run together."""
    comparison = make_comparison(rows=rows)
    asked, done, _ = scene_of(comparison).ways
    whole = length([comparison.reference.position])
    assert (asked.wanted, done.wanted) == (True, False)
    assert dashes <= len(asked.strips) <= dashes + 1  # the last may begin at the very end, by rounding
    # Only the corners at the ends of a dash are cut off; the last dash may be cut short.
    assert length(asked.strips) == pytest.approx(whole / 2, rel=0.02)
    assert length(done.strips) == pytest.approx(whole, rel=0.02)  # a neighbouring path
    lengths = [length([strip]) for strip in asked.strips[:-1]]
    extent = float(np.linalg.norm(np.ptp(comparison.reference.position, axis=0))) / 2
    assert min(lengths) == pytest.approx(max(lengths), rel=1e-2)
    assert min(lengths) >= 0.99 * LEAST_DASH * extent


def test_there_is_no_scene_without_positions(make_run: MakeRun, tmp_path: Path) -> None:
    run = replace(make_run(rows=20), robot=None, tcp=None)
    assert scene_of(run).empty
    path = write_recording(run, tmp_path / "run.rrd")
    entities = {chunk.entity_path.split("/")[1] for chunk in RrdReader(path).store().stream()}
    assert entities == {"__properties", "events", "log", "marks", "q", "qd", "qdd", "summary"}
