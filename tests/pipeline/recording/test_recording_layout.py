"""The views of a recording: which plots stand where, what is open, and at which time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from recording_contents import views
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.recording.entities import places_of
from urmpipe_pipeline.recording.layout import eye_and_target, viewer_layout
from urmpipe_pipeline.recording.plots import SHARED_AXIS, Plots
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.shown_units import MARGIN, span_with_numbers
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.views.camera import FIELD_OF_VIEW, FILLED, WIDE
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def test_what_is_doubtful_is_counted_in_the_title(make_run: MakeRun) -> None:
    doubt = AuditEntry("phi2", 2, 0.005, 0.0, -1.5, 0, 0, "unexplained")
    run = make_run(rows=50)
    titles = []
    for audit in ((), run.audit, (*run.audit, doubt), (doubt,)):
        *_, (view, *_) = Plots(run).joints(replace(run, audit=audit), places_of(run)[0])
        titles.append(view.name)
    assert titles == [
        "Joints, no repolarization needed [rad]",
        "Joints repolarized (1 marked) [rad]",
        "Joints repolarized (1 marked, 1 doubtful) [rad]",
        "Joints repolarized (0 marked, 1 doubtful) [rad]",
    ]


def test_joints_that_needed_no_repolarization_are_one_plot_with_the_file_behind_it(make_run: MakeRun) -> None:
    run = replace(make_run(rows=50), audit=())
    (row,) = Plots(run).joints(run, places_of(run)[0])
    assert [view.name for view in row] == [
        "Joints, no repolarization needed [rad]",
        "Joints in the file [rad]",
    ]


@pytest.mark.parametrize("rows", [1, 2, 1500])
def test_all_of_the_scene_is_in_view(rows: int, make_run: MakeRun) -> None:
    scene = scene_of(make_run(rows=rows))
    eye, target = eye_and_target(scene)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    above = np.cross(right, forward)
    seen = (scene.points() - eye) @ np.column_stack((right, above, forward))
    edge = np.tan(FIELD_OF_VIEW / 2)
    reach = np.abs(seen[:, :2] / seen[:, 2:]).max(axis=0) / [WIDE * edge, edge]
    assert reach.max() == pytest.approx(FILLED)


def test_a_comparison_opens_where_the_verdict_on_the_worst_log_was_decided(
    make_run: MakeRun, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(("solidworks", "coppeliasim"))
    worst = comparison.ranking[-1]
    path = write_recording(comparison, tmp_path / "both.rrd")
    assert Store(path).opens_at_ns / 1e9 == worst.decisive.t_max > 0
    assert Store(write_recording(make_run(), tmp_path / "run.rrd")).opens_at_ns == 0


def test_the_layout_is_in_the_file(make_comparison: MakeComparison, tmp_path: Path) -> None:
    found = views(write_recording(make_comparison(("a b", "reference")), tmp_path / "both.rrd"))
    names = found["ViewBlueprint:display_name"]
    assert {
        "Arm of reference and paths [m], in crimson the deviation x50",
        "delta = asked for - a b [mm]",
        "Distance from the path [mm]",
        "Angle between the orientations [deg]",
        "Joints, reference - log [deg]",
        "Joints in the file [rad]",
        "Joints repolarized (2 marked) [rad]",
        "Speed of the TCP [m/s]",
    } <= set(names)
    assert all("[" in name for name in names if name != "Summary")
    assert {"PASS a b", "PASS reference"} <= set(found["ContainerBlueprint:display_name"])
    assert {"/overview/delta/a\\ b", "/overview/delta/reference\\ \\(2\\)", "/tolerance/delta/**"} <= set(
        found["ViewContents:query"]
    )


def test_the_worst_log_and_what_decides_are_open(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("far", "near", "farther"))
    far, near, farther = comparison.runs
    layout = viewer_layout(replace(comparison, runs=(far, farther, near)), scene_of(comparison))
    tabs: Any = list(layout.root_container.contents)[1]
    assert (tabs.contents[tabs.active_tab].name, len(tabs.contents)) == ("FAIL farther", 3)
    assert tabs.contents[0].contents[0].active_tab == 0
    path = replace(far.statistics["path"], tolerance=1e-9)
    decided = replace(far, statistics={**far.statistics, "path": path})
    alone = viewer_layout(replace(comparison, runs=(decided,)), scene_of(comparison))
    column: Any = list(alone.root_container.contents)[1]
    first, joints, *_ = column.contents
    assert first.contents[first.active_tab].name == "Distance from the path [mm]"
    assert joints.name == "Joints, reference - log [deg]"


def test_an_axis_shows_more_numbers_than_0() -> None:
    """The viewer writes powers of ten and, where there is room, their multiples."""
    for low, high, most, reach in (
        (-0.9, 0.5, 8, (-1.0, 0.5)),
        (-0.2, 0.9, 8, (-0.2, 1.0)),
        (-0.25, 0.15, 8, (-0.25, 0.15)),
        (0.0, 0.6, 4, (0.0, 1.0)),
        (2.0, 3.0, 8, (0.0, 3.0)),
    ):
        found = span_with_numbers(low, high, most)
        margin = MARGIN * (reach[1] - reach[0])
        assert found == pytest.approx((reach[0] - margin, reach[1] + margin))
    assert span_with_numbers(0.0, 0.0, 8) is None


def time_axis(run: Run, path: Path) -> list[int]:
    """Return from when to when in [ns] the one view that linked plots follow shows a run."""
    reader = RrdReader(write_recording(run, path))
    (entry,) = reader.blueprints()
    (batch,) = (
        chunk.to_record_batch()
        for chunk in reader.stream(store=entry)
        if chunk.entity_path == f"/view/{SHARED_AXIS}/TimeAxis"
    )
    (axis,) = batch.column("TimeAxis:view_range").to_pylist()
    return [axis[0][end] for end in ("start", "end")]


def test_every_plot_shows_the_whole_time(make_run: MakeRun, make_solved: MakeRun, tmp_path: Path) -> None:
    """Else the viewer opens a long log on a minute of it; linked plots take the range of one known view."""
    assert time_axis(make_run(rows=2001), tmp_path / "run.rrd") == [-100_000_000, 12_400_000_000]
    assert time_axis(make_solved(rows=51), tmp_path / "solved.rrd") == [-10_000_000, 1_240_000_000]
