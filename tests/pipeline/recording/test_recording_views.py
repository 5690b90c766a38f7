"""The series of a recording: their names, colours and marks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader

from recording_contents import columns, packed, times_of
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, REFERENCE_COLOUR
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry, AuditKind
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def test_series_have_the_names_and_colours_of_the_joints(make_run: MakeRun, tmp_path: Path) -> None:
    run = make_run(rows=50)
    path = write_recording(run, tmp_path / "run.rrd")
    for entity in ("/log/q", "/q", "/qd", "/qdd"):
        assert columns(path, entity, "SeriesLines:names") == [list(run.log.joints)]
        wanted = [packed(colour) for colour in JOINT_COLOURS[:6]]
        assert columns(path, entity, "SeriesLines:colors") == [wanted]
    assert columns(path, "/tcp/euler_zyx", "SeriesLines:names") == [["rz", "ry", "rx"]]


def test_peaks_are_drawn_where_samples_are_closer_than_pixels(make_run: MakeRun, tmp_path: Path) -> None:
    path = write_recording(make_run(rows=50), tmp_path / "run.rrd")
    wanted = rr.components.AggregationPolicy.MinMax.value
    assert columns(path, "/log/q", "SeriesLines:aggregation_policy") == [[wanted]]


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
    assert columns(path, "/runs/coppeliasim/delta", "SeriesLines:names") == [["x", "y", "z", "norm"]]
    wanted = [packed(colour) for colour in AXIS_COLOURS.values()]
    assert columns(path, "/runs/matlab/delta", "SeriesLines:colors") == [wanted]
    turned = math.degrees(0.01)
    lines = {
        "delta/axis": ([3.5, -3.5], ["+tolerance 3.5 mm", "-tolerance 3.5 mm"], REFERENCE_COLOUR),
        "delta/z": ([2.0, -2.0], ["+tolerance of z 2 mm", "-tolerance of z 2 mm"], AXIS_COLOURS["z"]),
        "delta/norm": ([5.0], ["tolerance of norm 5 mm"], AXIS_COLOURS["norm"]),
        "path/path": ([3.0], ["tolerance 3 mm"], REFERENCE_COLOUR),
        "angle/angle": ([turned], ["tolerance 0.573 deg"], REFERENCE_COLOUR),
        "joints/joint": (
            [2 * turned, -2 * turned],
            ["+tolerance 1.146 deg", "-tolerance 1.146 deg"],
            REFERENCE_COLOUR,
        ),
    }
    for entity, (values, names, colour) in lines.items():
        drawn = columns(path, f"/tolerance/{entity}", "Scalars:scalars")
        np.testing.assert_allclose(drawn, [values] * 2, rtol=1e-15)  # a rounding of pi / 180
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
    for entity in ("/log/q", "/q"):
        assert columns(path, entity, "SeriesPoints:names") == [list(run.log.joints)]
        assert columns(path, entity, "SeriesPoints:colors") == [[packed(c) for c in JOINT_COLOURS[:6]]]
        assert columns(path, entity, "SeriesLines:names") == []
    assert "one.csv, read as table: 1 row, 0 s. Arm: urm6.\n\nGrid: 1 sample. " in summary(make_run("one", 1))


def test_a_line_through_the_sample_that_decides_stands_in_every_plot(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(rows=400)
    path = write_recording(comparison, tmp_path / "both.rrd")
    one = comparison.runs[1]
    assert one.joint_delta is not None and one.angle is not None
    plots = {
        "delta": 1e3 * one.delta, "raw": one.run.log.q, "repolarized": one.run.q, "speed": one.speed,
        "path": 1e3 * one.path, "angle": np.degrees(one.angle), "joints": np.degrees(one.joint_delta),
    }  # fmt: skip
    at = round(one.decisive.t_max * 1e9)
    for plot, values in plots.items():
        entity = f"/runs/matlab/marks/worst/{plot}"
        assert times_of(path, entity) == [at, at + 1]
        ends = [[values.min()], [values.max()]]
        np.testing.assert_allclose(columns(path, entity, "Scalars:scalars"), ends, rtol=1e-15)  # pi / 180


def test_times_are_exact_and_rows_count_from_one(make_run: MakeRun, tmp_path: Path) -> None:
    path = write_recording(make_run(rows=40_000), tmp_path / "run.rrd")
    found: dict[str, list[int]] = {"t": [], "row": []}
    for entity in ("/q", "/log/q"):
        for chunk in RrdReader(path).store().stream().filter(content=entity, is_static=False):
            batch = chunk.to_record_batch()
            for name in set(found) & set(batch.schema.names):
                found[name] += batch.column(name).cast("int64").to_pylist()
    assert sorted(found["t"]) == sorted([*range(0, 200_000_000_000, 5_000_000)] * 2)
    assert sorted(found["row"]) == sorted([*range(1, 40_001)] * 2)


def test_nothing_stands_on_the_clock_of_the_writer(make_comparison: MakeComparison, tmp_path: Path) -> None:
    path = write_recording(make_comparison(rows=50), tmp_path / "both.rrd")
    timelines = {name for chunk in RrdReader(path).store().stream() for name in chunk.timeline_names}
    assert timelines == {"t", "row", "sample"}
