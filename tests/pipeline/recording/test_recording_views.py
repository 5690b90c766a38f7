"""What a recording shows: series, colours, events, the scene in 3D, the layout and the summary."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, REFERENCE_COLOUR, rgb, run_colour
from urmpipe_pipeline.recording import write_recording
from urmpipe_pipeline.recording.entities import places_of
from urmpipe_pipeline.recording.eye import FIELD_OF_VIEW, FILLED, WIDE
from urmpipe_pipeline.recording.layout import eye_and_target, viewer_layout
from urmpipe_pipeline.recording.overview import LONG, ROWS, SPEED_ROWS
from urmpipe_pipeline.recording.plots import SHARED_AXIS, Plots
from urmpipe_pipeline.recording.scene import scene_of
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.recording.ways import DASHES, LEAST_DASH, MOST
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry, AuditKind
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def columns(path: Path, entity: str, component: str) -> list[Any]:
    """Return the values of one component of an entity, row by row."""
    stream = RrdReader(path).store().stream().filter(content=entity, components=component)
    return [row for chunk in stream for row in chunk.to_record_batch().column(component).to_pylist()]


def times_of(path: Path, entity: str) -> list[int]:
    """Return the times of an entity in [ns], in the order of writing."""
    stream = RrdReader(path).store().stream().filter(content=entity, is_static=False)
    return [at for chunk in stream for at in chunk.to_record_batch().column("t").cast("int64").to_pylist()]


def views(path: Path) -> dict[str, list[Any]]:
    """Return what the layout says, by component."""
    reader = RrdReader(path)
    (entry,) = reader.blueprints()
    found: dict[str, list[Any]] = {}
    for chunk in reader.stream(store=entry):
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if ":" in name:
                values = batch.column(name).to_pylist()
                found.setdefault(name, []).extend(itertools.chain.from_iterable(filter(None, values)))
    return found


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


def test_a_colour_is_an_axis_whatever_the_order(make_run: MakeRun, tmp_path: Path) -> None:
    path = write_recording(make_run(rows=50), tmp_path / "run.rrd")
    wanted = [packed(AXIS_COLOURS[axis]) for axis in "zyx"]
    assert columns(path, "/tcp/euler_zyx", "SeriesLines:colors") == [wanted]
    assert columns(path, "/overview/tcp/speed", "SeriesLines:colors") == [[packed(AXIS_COLOURS["norm"])]]


def test_each_tolerance_stands_in_the_plot_of_its_unit(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    allowed = {"axis": 0.0035, "z": 0.002, "norm": 0.005, "path": 0.003, "angle": 0.01, "joint": 0.02}
    path = write_recording(replace(make_comparison(rows=50), tolerance=allowed), tmp_path / "both.rrd")
    assert columns(path, "/delta/coppeliasim", "SeriesLines:names") == [["x", "y", "z", "norm"]]
    wanted = [packed(colour) for colour in AXIS_COLOURS.values()]
    assert columns(path, "/delta/matlab", "SeriesLines:colors") == [wanted]
    lines = {
        "delta/axis": ([0.0035, -0.0035], ["+tolerance 0.0035", "-tolerance 0.0035"], REFERENCE_COLOUR),
        "delta/z": ([0.002, -0.002], ["+tolerance of z 0.002", "-tolerance of z 0.002"], AXIS_COLOURS["z"]),
        "delta/norm": ([0.005], ["tolerance of norm 0.005"], AXIS_COLOURS["norm"]),
        "path/path": ([0.003], ["tolerance 0.003"], REFERENCE_COLOUR),
        "angle/angle": ([0.01], ["tolerance 0.01"], REFERENCE_COLOUR),
        "joints/joint": ([0.02, -0.02], ["+tolerance 0.02", "-tolerance 0.02"], REFERENCE_COLOUR),
    }
    for entity, (values, names, colour) in lines.items():
        assert columns(path, f"/tolerance/{entity}", "Scalars:scalars") == [values] * 2
        assert columns(path, f"/tolerance/{entity}", "SeriesLines:names") == [names]
        assert columns(path, f"/tolerance/{entity}", "SeriesLines:colors") == [[packed(colour)] * len(names)]


def test_repolarizations_are_marked_at_their_instants_on_the_joints_line(
    make_run: MakeRun, tmp_path: Path
) -> None:
    run = make_run()
    path = write_recording(run, tmp_path / "run.rrd")
    up, down = sorted(run.audit, key=lambda one: one.before - one.after)
    assert (up.joint, down.joint) == ("phi1", "phi6")
    for mark, one, shape in (("down", down, "Down"), ("up", up, "Up")):
        entity = f"/marks/repolarization/{mark}"
        j = run.log.joints.index(one.joint)
        assert times_of(path, entity) == [round(one.t * 1e9)]
        (values,) = columns(path, entity, "Scalars:scalars")
        on_line = (run.q[one.sample - 1, j] + run.q[one.sample, j]) / 2
        # Of two samples and the instant half way between them, as interpolated.
        np.testing.assert_allclose(values[j], on_line, rtol=1e-12)
        assert np.isnan(np.delete(values, j)).all()
        assert columns(path, entity, "SeriesPoints:names") == [list(run.log.joints)]
        assert columns(path, entity, "SeriesPoints:colors") == [[packed(c) for c in JOINT_COLOURS[:6]]]
        wanted = rr.components.MarkerShape[shape].value
        assert columns(path, entity, "SeriesPoints:markers") == [[wanted] * 6]


def test_what_is_doubtful_has_a_mark_of_its_own(make_run: MakeRun, tmp_path: Path) -> None:
    kinds: tuple[AuditKind, ...] = ("in-between", "repaired", "unexplained", "ambiguous")
    audit = [
        AuditEntry("phi2", 2 + i, 0.005 * (1 + i), 0.0, -1.5, 0, 0, kind) for i, kind in enumerate(kinds)
    ]
    run = make_run(rows=50)
    path = write_recording(replace(run, audit=tuple(reversed(audit))), tmp_path / "run.rrd")
    entity = "/marks/repolarization/doubt"
    assert times_of(path, entity) == [5_000_000, 10_000_000, 15_000_000, 20_000_000]
    assert [row[1] for row in columns(path, entity, "Scalars:scalars")] == run.q[1:5, 1].tolist()
    wanted = rr.components.MarkerShape.Cross.value
    assert columns(path, entity, "SeriesPoints:markers") == [[wanted] * 6]


def test_a_mark_beside_missing_values_stands_between_the_nearest(make_run: MakeRun, tmp_path: Path) -> None:
    run = make_run(rows=50)
    q = run.q.copy()
    q[9:12, 1] = np.nan
    audit = (AuditEntry("phi2", 11, 0.0475, 0.0, -1.5, 0, 0, "unexplained"),)
    path = write_recording(replace(run, q=q, audit=audit), tmp_path / "run.rrd")
    (values,) = columns(path, "/marks/repolarization/doubt", "Scalars:scalars")
    wanted = q[8, 1] + (0.0475 - 0.040) / 0.020 * (q[12, 1] - q[8, 1])
    np.testing.assert_allclose(values[1], wanted, rtol=1e-12)  # rounding of the interpolation


def test_a_comparison_of_one_sample_has_no_line_through_the_worst(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    path = write_recording(make_comparison(("coppeliasim",), rows=1), tmp_path / "one.rrd")
    assert not [entity for entity in Store(path).rows if entity.startswith("/marks/worst")]
    path = write_recording(make_comparison(("coppeliasim",), rows=2), tmp_path / "two.rrd")
    assert [entity for entity in Store(path).rows if entity.startswith("/marks/worst")]


def test_the_one_sample_of_a_log_is_a_point(make_run: MakeRun, tmp_path: Path) -> None:
    """The viewer draws no line through it."""
    run = make_run(rows=1)
    path = write_recording(run, tmp_path / "one.rrd")
    for entity in ("/joints/raw", "/joints/repolarized"):
        assert columns(path, entity, "SeriesPoints:names") == [list(run.log.joints)]
        assert columns(path, entity, "SeriesPoints:colors") == [[packed(c) for c in JOINT_COLOURS[:6]]]
        assert columns(path, entity, "SeriesLines:names") == []
    assert "one.csv, read as table: 1 row, 0 s. Arm: urm6.\n\nGrid: 1 sample. " in summary(make_run("one", 1))


def test_what_is_doubtful_is_counted_in_the_title(make_run: MakeRun) -> None:
    doubt = AuditEntry("phi2", 2, 0.005, 0.0, -1.5, 0, 0, "unexplained")
    run = make_run(rows=50)
    titles = []
    for audit in ((), run.audit, (*run.audit, doubt), (doubt,)):
        _, (view,) = Plots(run).joints(replace(run, audit=audit), places_of(run)[0])
        titles.append(view.name)
    assert titles == [
        "Joints repolarized (none was needed) [rad]",
        "Joints repolarized (1 marked) [rad]",
        "Joints repolarized (1 marked, 1 doubtful) [rad]",
        "Joints repolarized (0 marked, 1 doubtful) [rad]",
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


def test_a_line_through_the_worst_sample_stands_in_every_plot(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(rows=400)
    path = write_recording(comparison, tmp_path / "both.rrd")
    one = comparison.runs[1]
    assert one.joint_delta is not None and one.angle is not None
    plots = {
        "delta": one.delta, "raw": one.run.log.q, "repolarized": one.run.q, "speed": one.speed,
        "path": one.path, "angle": one.angle, "joints": one.joint_delta,
    }  # fmt: skip
    at = int(one.t_ns[one.worst])
    for plot, values in plots.items():
        entity = f"/runs/matlab/marks/worst/{plot}"
        assert times_of(path, entity) == [at, at + 1]
        assert columns(path, entity, "Scalars:scalars") == [[values.min()], [values.max()]]


def test_a_comparison_opens_at_the_worst_sample_of_the_worst_log(
    make_run: MakeRun, make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(("solidworks", "coppeliasim"))
    worst = comparison.ranking[-1]
    path = write_recording(comparison, tmp_path / "both.rrd")
    assert Store(path).opens_at_ns == worst.t_ns[worst.worst] > 0
    assert Store(write_recording(make_run(), tmp_path / "run.rrd")).opens_at_ns == 0


def test_a_long_array_has_an_overview_that_keeps_every_extreme(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(("coppeliasim",), rows=LONG + 1)
    path = write_recording(comparison, tmp_path / "long.rrd")
    one = comparison.runs[0]
    arrays = {
        "/joints/raw": one.run.log.q, "/joints/repolarized": one.run.q, "/delta/coppeliasim": one.delta,
        "/matched/coppeliasim/speed": one.speed[:, np.newaxis],
    }  # fmt: skip
    for entity, values in arrays.items():
        few = np.array(columns(path, f"/overview{entity}", "Scalars:scalars"))
        times = times_of(path, f"/overview{entity}")
        assert len(few) <= ROWS
        np.testing.assert_array_equal(few, values[np.searchsorted(one.run.t_ns, times)])
        np.testing.assert_array_equal(few.min(axis=0), values.min(axis=0))
        np.testing.assert_array_equal(few.max(axis=0), values.max(axis=0))
    names = views(path)["ViewBlueprint:display_name"]
    assert "delta = asked for - coppeliasim [m], every peak of 50,001 rows" in names
    assert "all 50,001 rows [m]" in names


def test_a_long_path_has_an_overview_of_its_positions(make_run: MakeRun, tmp_path: Path) -> None:
    run = make_run(rows=LONG + 1)
    assert run.tcp is not None
    position, none = run.tcp.position, np.empty((LONG + 1, 0))
    log = replace(run.log, joints=(), q=none, columns=(), tcp_position=position)
    path = replace(
        run, log=log, robot=None, tcp=None, q=none, qd=none, qdd=none, tcp_recorded=position, audit=()
    )
    file = write_recording(path, tmp_path / "path.rrd")
    few = np.array(columns(file, "/overview/tcp/recorded", "Scalars:scalars"))
    assert len(few) <= ROWS
    np.testing.assert_array_equal(few.max(axis=0), position.max(axis=0))
    assert "Recorded TCP [m], every peak of 50,001 rows" in views(file)["ViewBlueprint:display_name"]


def test_of_a_short_log_only_the_speed_is_thinned_out(make_run: MakeRun, tmp_path: Path) -> None:
    run = make_run(rows=8000)
    assert run.tcp is not None
    path = write_recording(run, tmp_path / "short.rrd")
    speed = np.linalg.norm(run.tcp.velocity, axis=1)
    few = np.array(columns(path, "/overview/tcp/speed", "Scalars:scalars"))[:, 0]
    assert len(few) <= SPEED_ROWS
    assert (few.min(), few.max()) == (speed.min(), speed.max())
    entities = {chunk.entity_path for chunk in RrdReader(path).store().stream()}
    assert [entity for entity in entities if entity.startswith("/overview")] == ["/overview/tcp/speed"]


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
    path = write_recording(make_comparison(), tmp_path / "both.rrd")
    assert columns(path, "/events/repolarization", "TextLog:text") == [
        ["0.0025 s  phi6 repolarized in row 2: step +6.2808 rad, +0 to -1 turns, +-2.5 ms"],
        ["6.2625 s  phi1 repolarized in row 1254: step -6.2817 rad, +0 to +1 turns, +-2.5 ms"],
    ]
    assert columns(path, "/runs/matlab/events/warning", "TextLog:text") == [
        ["0.0300 s  gap in row 7: two rows lie far apart"]
    ]


def test_events_tell_how_a_log_compares(make_comparison: MakeComparison, tmp_path: Path) -> None:
    one = replace(
        make_comparison(("solid",)).runs[0],
        sync=Sync("auto", 3.4, "joints", 0.0002, 0.99999),
        alignment=Alignment("tool", tool=(0.001, 0.0, -0.0025)),
        left_out=12,
    )
    outside = np.zeros(1500, dtype=bool)
    outside[[3, 100, 101, 102]] = True
    one = replace(one, outside=outside, verdict="fail")
    path = write_recording(replace(make_comparison(), runs=(one,)), tmp_path / "one.rrd")
    x, y, z, norm = 1e3 * one.delta[one.worst]
    decisive = one.decisive
    wanted = [
        (0.0, "clocks: t_reference = t_log + 3.4 s, estimated from joints, ± 0.2 ms, similarity 1.0000"),
        (0.0, "aligned (tool): tool centre point moved by (1.0000, 0.0000, -2.5000) mm in the tool's frame"),
        (0.0, "12 of 1512 samples left out: no reference or no value"),
        (0.5, "longest stretch out of tolerance begins: 3 samples, 0.010 s"),
        (
            decisive.t_max,
            f"decides: {decisive.quantity} reaches {1e3 * decisive.max:.4f} mm of 3.5 mm allowed",
        ),
        (
            one.t[one.worst],
            f"largest deviation: {norm:.4f} mm (x {x:.4f} mm, y {y:.4f} mm, z {z:.4f} mm)",
        ),
    ]
    said = [row[0] for row in columns(path, "/events/deviation", "TextLog:text")]
    assert said == [f"{t:.4f} s  {text}" for t, text in sorted(wanted, key=lambda event: event[0])]
    levels = [row[0] for row in columns(path, "/events/deviation", "TextLog:level")]
    assert levels == ["INFO", "INFO", "WARN", "ERROR", "ERROR", "ERROR"]


def test_the_layout_is_in_the_file(make_comparison: MakeComparison, tmp_path: Path) -> None:
    found = views(write_recording(make_comparison(("a b", "reference")), tmp_path / "both.rrd"))
    names = found["ViewBlueprint:display_name"]
    assert {
        "Arm of reference and paths [m]",
        "delta = asked for - a b [m]",
        "Distance from the path [m]",
        "Angle between the orientations [rad]",
        "Joints, reference - log [rad]",
        "Joints in the file [rad]",
        "Joints repolarized (2 marked) [rad]",
        "Speed of the TCP [m/s]",
    } <= set(names)
    assert all("[" in name for name in names if name != "Summary")
    assert {"PASS a b", "PASS reference"} <= set(found["ContainerBlueprint:display_name"])
    assert {"/delta/a\\ b", "/delta/reference\\ \\(2\\)", "/tolerance/delta/**"} <= set(
        found["ViewContents:query"]
    )


def test_the_worst_log_and_what_decides_are_open(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("far", "near", "farther"))
    far, near, farther = comparison.runs
    layout = viewer_layout(replace(comparison, runs=(far, farther, near)), scene_of(comparison))
    tabs: Any = list(layout.root_container.contents)[1]
    assert (tabs.contents[tabs.active_tab].name, len(tabs.contents)) == ("FAIL farther", 3)
    assert tabs.contents[0].contents[0].active_tab == 0
    joint = replace(far.joint_statistics["phi2"], tolerance=1e-9)
    decided = replace(far, joint_statistics={"phi2": joint})
    alone = viewer_layout(replace(comparison, runs=(decided,)), scene_of(comparison))
    column: Any = list(alone.root_container.contents)[1]
    first = column.contents[0]
    assert first.contents[first.active_tab].name == "Joints, reference - log [rad]"


def test_every_plot_shows_the_whole_time(make_run: MakeRun, tmp_path: Path) -> None:
    """Else the viewer opens a long log on a minute of it; linked plots take the range of one known view."""
    path = write_recording(make_run(rows=2001), tmp_path / "run.rrd")
    reader = RrdReader(path)
    (entry,) = reader.blueprints()
    (batch,) = (
        chunk.to_record_batch()
        for chunk in reader.stream(store=entry)
        if chunk.entity_path == f"/view/{SHARED_AXIS}/TimeAxis"
    )
    (axis,) = batch.column("TimeAxis:view_range").to_pylist()
    assert [axis[0][end] for end in ("start", "end")] == [-100_000_000, 11_700_000_000]


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
    assert entities == {"__properties", "events", "joints", "marks", "summary"}


def test_the_summary_of_a_run(make_run: MakeRun) -> None:
    assert summary(make_run("a_b|c", rows=201)) == (
        "### a\\_b\\|c\n"
        "a\\_b\\|c.csv, read as table: 201 rows, 1 s. Arm: urm6.\n\n"
        "Grid: 201 samples, one in 5 ms. Repolarizations: 1, marked by triangles in the joint's colour.\n\n"
        "Warnings: 1\n\n"
        "- two rows lie far apart (row 7)"
    )


def test_the_summary_of_a_comparison_says_the_verdict_first(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("coppeliasim", "solid*", "matlab"))
    worst = comparison.runs[2]
    decisive, longest = worst.decisive, worst.longest_out
    assert longest is not None and decisive.used is not None
    lines = summary(comparison).splitlines()
    assert lines[0] == "### FAIL: 1 of 3 logs out of tolerance"
    assert lines[1] == (
        f"**matlab**: {decisive.quantity} reaches {1e3 * decisive.max:.4f} mm of 3.5 mm allowed"
        f" ({decisive.used:.3g} times the tolerance), at {decisive.t_max:.3f} s. Out of tolerance:"
        f" {np.count_nonzero(worst.outside)} of 1500 samples ({100 * worst.share_out:.1f} %), longest for"
        f" {longest.duration:.3f} s from {longest.t:.3f} s."
    )
    assert lines[3] == "Reference: asked for (grey, dashed). Tolerance: ±3.5 mm per axis."
    rows = [line.split(" | ") for line in lines if line.startswith("| ")][2:]
    assert [(row[0], row[1], row[-1]) for row in rows] == [
        ("| coppeliasim", "orange", "PASS |"),
        ("| solid\\*", "sky blue", "PASS |"),
        ("| matlab", "violet", "FAIL |"),
    ]
    assert rows[2][2:6] == [f"{1e3 * worst.statistics[axis].max:.4f}" for axis in ("x", "y", "z", "norm")]
    assert lines[-6:-2] == [
        "- asked for: two rows lie far apart (row 7)",
        "- coppeliasim: two rows lie far apart (row 7)",
        "- solid\\*: two rows lie far apart (row 7)",
        "- matlab: two rows lie far apart (row 7)",
    ]


def test_the_summary_says_each_tolerance_in_its_unit(make_comparison: MakeComparison) -> None:
    allowed = {"axis": 0.0035, "path": 0.002, "angle": math.radians(0.5), "joint": math.radians(0.1)}
    assert (
        "Reference: asked for (grey, dashed)."
        " Tolerance: ±3.5 mm per axis, 2 mm from the path, 0.5 deg of orientation, ±0.1 deg per joint."
    ) in summary(replace(make_comparison(), tolerance=allowed)).splitlines()


def test_what_no_text_can_hold_is_told_all_the_same(make_comparison: MakeComparison, tmp_path: Path) -> None:
    """A file's name or header of undecodable bytes ends up in the verdict's words."""
    one = make_comparison(("coppeliasim",)).runs[0]
    worst = replace(one.joint_statistics["phi2"], quantity="q\udcff", tolerance=1e-9)
    one = replace(one, joint_statistics={"q\udcff": worst})
    path = write_recording(replace(make_comparison(), runs=(one,)), tmp_path / "odd.rrd")
    said = [row[0] for row in columns(path, "/events/deviation", "TextLog:text")]
    assert any("decides: q? reaches 0.1146 deg of 5.72958e-08 deg allowed" in line for line in said)


def test_the_summary_tells_how_clocks_and_places_were_put_together(make_comparison: MakeComparison) -> None:
    comparison = make_comparison(("coppeliasim",))
    turn = 0.01
    rotation = (
        (math.cos(turn), -math.sin(turn), 0.0),
        (math.sin(turn), math.cos(turn), 0.0),
        (0.0, 0.0, 1.0),
    )
    one = replace(
        comparison.runs[0],
        sync=Sync("given", -0.25),
        alignment=Alignment("rigid", rotation, (0.001, 0.002, 0.003)),
        reference_left_out=50,
    )
    assert (
        "clocks: t\\_reference = t\\_log \\- 0.25 s, as given; aligned (rigid): turned by 0.5730 deg about"
        " the origin, then moved by (1.0000, 2.0000, 3.0000) mm; 50 samples of the reference outside its time"
    ) in summary(replace(comparison, runs=(one,))).splitlines()
