"""What is plotted of what is long, and deviations in the units that people read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rerun.chunk import RrdReader

from recording_contents import columns, times_of, views
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.recording.overview import LONG, ROWS, SPEED_ROWS
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.runs.results import Run

MakeRun = Callable[..., Run]
MakeComparison = Callable[..., Comparison]


def test_a_long_array_has_an_overview_that_keeps_every_extreme(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(("coppeliasim",), rows=LONG + 1)
    path = write_recording(comparison, tmp_path / "long.rrd")
    one = comparison.runs[0]
    arrays = {
        "run/log/q": one.run.log.q, "run/q": one.run.q, "delta": 1e3 * one.delta,
        "speed": one.speed[:, np.newaxis],
    }  # fmt: skip
    for entity, values in arrays.items():
        few = np.array(columns(path, f"/overview/runs/coppeliasim/{entity}", "Scalars:scalars"))
        times = times_of(path, f"/overview/runs/coppeliasim/{entity}")
        assert len(few) <= ROWS
        np.testing.assert_array_equal(few, values[np.searchsorted(one.run.t_ns, times)])
        np.testing.assert_array_equal(few.min(axis=0), values.min(axis=0))
        np.testing.assert_array_equal(few.max(axis=0), values.max(axis=0))
    names = views(path)["ViewBlueprint:display_name"]
    assert "delta = asked for - coppeliasim [mm], every peak of 50,001 rows" in names
    assert "all 50,001 rows [m]" in names


def test_deviations_are_plotted_with_all_their_rows_in_the_units_of_the_summary(
    make_comparison: MakeComparison, tmp_path: Path
) -> None:
    comparison = make_comparison(("coppeliasim",), rows=50)
    path = write_recording(comparison, tmp_path / "short.rrd")
    one = comparison.runs[0]
    assert one.angle is not None and one.joint_delta is not None
    wanted = {
        "delta": 1e3 * one.delta,
        "path": 1e3 * one.path[:, np.newaxis],
        "angle": np.degrees(one.angle)[:, np.newaxis],
        "joint_delta": np.degrees(one.joint_delta),
    }
    for entity, values in wanted.items():
        found = np.array(columns(path, f"/overview/runs/coppeliasim/{entity}", "Scalars:scalars"))
        np.testing.assert_allclose(found, values, rtol=1e-15)  # a rounding of pi / 180


def test_a_long_path_has_an_overview_of_its_positions(make_run: MakeRun, tmp_path: Path) -> None:
    run = make_run(rows=LONG + 1)
    assert run.tcp is not None
    position, none = run.tcp.position, np.empty((LONG + 1, 0))
    log = replace(run.log, joints=(), q=none, columns=(), tcp_position=position)
    path = replace(
        run, log=log, robot=None, tcp=None, q=none, qd=none, qdd=none, tcp_recorded=position, audit=()
    )
    file = write_recording(path, tmp_path / "path.rrd")
    few = np.array(columns(file, "/overview/log/tcp_position", "Scalars:scalars"))
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
