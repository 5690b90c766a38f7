"""What the viewer opens with: where a verdict was decided, and all that is drawn below one root."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rerun.chunk import RrdReader

from recordable import build_comparison
from recorded import entities
from urmpipe_pipeline.recording.viewer import openings
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.simulations.simulation import Simulation


def test_results_open_where_their_verdict_was_decided(
    make_simulation: Callable[..., Simulation], tmp_path: Path
) -> None:
    comparison = build_comparison(("solidworks", "coppeliasim"))
    path = write_recording(comparison, tmp_path / "both.rrd")
    assert openings([path])[path].at / 1e9 == comparison.worst.worst_statistics.t_max > 0
    path = write_recording(make_simulation(), tmp_path / "simulation.rrd")
    assert openings([path])[path].at == 1_250_000_000


def test_what_is_drawn_stands_below_one_root_and_on_no_clock_of_the_writer(tmp_path: Path) -> None:
    """The other entities are the arrays of the result, at the paths of their fields."""
    path = write_recording(build_comparison(rows=50), tmp_path / "both.rrd")
    roots = {entity.split("/")[1] for entity in entities(path)}
    assert roots == {"shown", "reference", "runs"}
    timelines = {name for chunk in RrdReader(path).store().stream() for name in chunk.timeline_names}
    assert timelines == {"t", "row"}
