"""What a recording shows: series, colours, events, the scene in 3D, the layout and the summary."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from urmpipe_models.kinematics import points_over_log
from urmpipe_pipeline.audit_entry import AuditEntry, AuditKind
from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, REFERENCE_COLOUR, rgb, run_colour
from urmpipe_pipeline.recording import write_recording
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.recording.ways import DASHES, LEAST_DASH, MOST
from urmpipe_pipeline.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def columns(path: Path, entity: str, component: str) -> list[Any]:
    """Return the values of one component of an entity, row by row."""
    stream = RrdReader(path).store().stream().filter(content=entity, components=component)
    return [row for chunk in stream for row in chunk.to_record_batch().column(component).to_pylist()]


def packed(colour: str) -> int:
    """Return a colour as Rerun stores it: red, green, blue and full alpha in one number."""
    red, green, blue = rgb(colour)
    return (red << 24) + (green << 16) + (blue << 8) + 255


def test_series_have_the_names_and_colours_of_the_joints(make_run: MakeRun, tmp_path: Path) -> None:
    run = make_run(rows=50)
    path = write_recording(run, tmp_path / "run.rrd")
    for entity in ("raw", "repolarized", "velocity", "acceleration"):
        assert columns(path, f"/joints/{entity}", "SeriesLines:names") == [list(run.log.joints)]
        wanted = [packed(colour) for colour in JOINT_COLOURS[:6]]
        assert columns(path, f"/joints/{entity}", "SeriesLines:colors") == [wanted]
    assert columns(path, "/tcp/euler_zyx", "SeriesLines:names") == [["rz", "ry", "rx"]]


def test_peaks_are_drawn_where_samples_are_closer_than_pixels(make_run: MakeRun, tmp_path: Path) -> None:
    path = write_recording(make_run(rows=50), tmp_path / "run.rrd")
    wanted = rr.components.AggregationPolicy.MinMax.value
    assert columns(path, "/joints/raw", "SeriesLines:aggregation_policy") == [[wanted]]


def test_delta_has_axes_and_both_signs_of_the_tolerance(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = replace(make_comparison(rows=50), tolerance={"axis": 0.0035, "norm": 0.005})
    path = write_recording(comparison, tmp_path / "both.rrd")
    assert columns(path, "/delta/coppeliasim", "SeriesLines:names") == [["x", "y", "z", "norm"]]
    wanted = [packed(colour) for colour in AXIS_COLOURS.values()]
    assert columns(path, "/delta/matlab", "SeriesLines:colors") == [wanted]
    assert columns(path, "/delta/tolerance/axis", "Scalars:scalars") == [[0.0035, -0.0035]] * 2
    assert columns(path, "/delta/tolerance/norm", "Scalars:scalars") == [[0.005]] * 2
    assert columns(path, "/delta/tolerance/norm", "SeriesLines:names") == [["+tolerance of norm"]]


def test_times_are_exact_and_samples_count_from_zero(make_run: MakeRun, tmp_path: Path) -> None:
    path = write_recording(make_run(rows=40_000), tmp_path / "run.rrd")
    found: dict[str, list[int]] = {"t": [], "sample": [], "row": []}
    for entity in ("/joints/repolarized", "/joints/raw"):
        for chunk in RrdReader(path).store().stream().filter(content=entity, is_static=False):
            batch = chunk.to_record_batch()
            for name in set(found) & set(batch.schema.names):
                found[name] += batch.column(name).cast("int64").to_pylist()
    assert sorted(found["t"]) == sorted([*range(0, 200_000_000_000, 5_000_000)] * 2)
    assert sorted(found["sample"]) == list(range(40_000))
    assert sorted(found["row"]) == list(range(1, 40_001))


def test_nothing_stands_on_the_clock_of_the_writer(make_comparison: MakeComparison, tmp_path: Path) -> None:
    path = write_recording(make_comparison(rows=50), tmp_path / "both.rrd")
    timelines = {name for chunk in RrdReader(path).store().stream() for name in chunk.timeline_names}
    assert timelines == {"t", "row", "sample"}


def test_events_tell_the_whole_audit(make_run: MakeRun, tmp_path: Path) -> None:
    kinds: tuple[AuditKind, ...] = ("wrap", "in-between", "repaired", "unexplained", "ambiguous")
    audit = tuple(AuditEntry("phi1", 2, 0.005, 0.0025, -1.5, 0, 1, kind) for kind in kinds)
    path = write_recording(replace(make_run(rows=5), audit=audit), tmp_path / "one.rrd")
    said = [row[0] for row in columns(path, "/events/repolarization", "TextLog:text")]
    assert [line.removeprefix("0.0050 s  phi1 ") for line in said] == [
        "repolarized in row 2: step -1.5000 rad, +0 to +1 turns, +-2.5 ms",
        "left on a wrap in row 2: -1.5000 rad off the line of its neighbours",
        "repaired in row 2: -1.5000 rad off the line of its neighbours",
        "unexplained in row 2: step -1.5000 rad, no wrap",
        "ambiguous in row 2: step -1.5000 rad, a gap of 5 ms: turns unknown",
    ]
    levels = [row[0] for row in columns(path, "/events/repolarization", "TextLog:level")]
    assert levels == ["INFO", "WARN", "INFO", "WARN", "WARN"]


def test_events_name_joint_row_and_turns(make_comparison: MakeComparison, tmp_path: Path) -> None:
    comparison = make_comparison()
    path = write_recording(comparison, tmp_path / "both.rrd")
    assert columns(path, "/events/repolarization", "TextLog:text") == [
        ["0.0025 s  coppeliasim: phi6 repolarized in row 2: step +6.2808 rad, +0 to -1 turns, +-2.5 ms"],
        ["6.2625 s  coppeliasim: phi1 repolarized in row 1254: step -6.2817 rad, +0 to +1 turns, +-2.5 ms"],
    ]
    assert columns(path, "/runs/matlab/events/warning", "TextLog:text") == [
        ["0.0300 s  matlab: gap in row 7: two rows lie far apart"]
    ]
    one = comparison.runs[1]
    x, y, z, norm = 1e3 * one.delta[one.worst]
    assert columns(path, "/runs/matlab/events/deviation", "TextLog:text") == [
        [
            f"{one.t[one.worst]:.4f} s  largest deviation of matlab: {norm:.3f} mm"
            f" (x {x:.3f}, y {y:.3f}, z {z:.3f})"
        ]
    ]


def test_the_layout_is_in_the_file(make_comparison: MakeComparison, tmp_path: Path) -> None:
    path = write_recording(make_comparison(("a b", "reference")), tmp_path / "both.rrd")
    reader = RrdReader(path)
    (entry,) = reader.blueprints()
    found: dict[str, list[Any]] = {"ViewBlueprint:display_name": [], "ViewContents:query": []}
    for chunk in reader.stream(store=entry):
        batch = chunk.to_record_batch()
        for name in set(found) & set(batch.schema.names):
            found[name] += itertools.chain.from_iterable(batch.column(name).to_pylist())
    names = found["ViewBlueprint:display_name"]
    assert "Arm and paths [m]" in names
    assert "delta of a b [m]" in names
    assert "Joints in the file, reference [rad]" in names
    assert "Joints repolarized, a b [rad]" in names
    assert all("[" in name for name in names if name != "Summary")
    assert {"/delta/a\\ b", "/delta/reference\\ \\(2\\)", "/delta/tolerance/**"} <= set(
        found["ViewContents:query"]
    )


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


def test_the_worst_sample_is_drawn(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("coppeliasim",))
    worst = 465  # not one of the samples that are drawn anyway, which are every fourth
    comparison.runs[0].delta[worst, 3] = 1.0
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
    assert entities == {"__properties", "events", "joints", "summary"}


def test_the_summary_of_a_run(make_run: MakeRun) -> None:
    assert summary(make_run("a_b|c", rows=201)) == (
        "### a\\_b\\|c\n"
        "a\\_b\\|c.csv, read as table: 201 rows, 1 s. Arm: urm6.\n\n"
        "Grid: 201 samples, one in 5 ms. Repolarizations: 1. Warnings: 1."
    )


def test_the_summary_of_a_comparison(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("coppeliasim", "matlab", "solid*"))
    lines = summary(comparison).splitlines()
    assert lines[:2] == ["### FAIL", "Reference: asked for, drawn grey and dashed. Tolerance: axis 3.5 mm."]
    assert lines[-2].startswith("| matlab | sky blue | 2.667 | ")
    assert lines[-1].startswith("| solid\\* | violet | ")
    assert [line.split(" | ")[-1] for line in lines[-3:]] == ["PASS |", "PASS |", "FAIL |"]
