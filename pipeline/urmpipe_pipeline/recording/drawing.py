"""Send what the viewer draws: series with names and colours, overviews, marks and events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.palette import rgb
from urmpipe_pipeline.recording.codec import Encoded
from urmpipe_pipeline.recording.columns import block_columns
from urmpipe_pipeline.recording.entities import SUMMARY, Block, Place, blocks, places_of, printable
from urmpipe_pipeline.recording.events import draw_comparison_events, draw_log_events
from urmpipe_pipeline.recording.marks import MARK_SIZE, draw_meter_worst, draw_repolarizations, draw_worst
from urmpipe_pipeline.recording.overview import overviews
from urmpipe_pipeline.recording.scene import Scene
from urmpipe_pipeline.recording.scene_drawing import draw_scene
from urmpipe_pipeline.recording.series import series_lines
from urmpipe_pipeline.recording.signal_entities import SYSTEM_FILE, simulation_blocks
from urmpipe_pipeline.recording.simulation_summary import simulation_summary
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.recording.tolerances import draw_meter_tolerances, draw_tolerances
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation

if TYPE_CHECKING:
    from rerun import RecordingStream


def draw(stream: RecordingStream, result: Result, encoded: Encoded, scene: Scene) -> None:
    """Send everything that is there to be looked at."""
    import rerun as rr

    found = simulation_blocks(result, encoded) if isinstance(result, Simulation) else blocks(result, encoded)
    every = list({block.entity: block for block in found}.values())
    words = simulation_summary(result) if isinstance(result, Simulation) else summary(result)
    stream.log(SUMMARY, rr.TextDocument(words, media_type="text/markdown"), static=True)
    few = list(overviews(result, every, encoded))
    _draw_styles(stream, [*every, *few], lone=_lone(result))
    for block in few:
        times, values = block_columns(block, slice(None))
        stream.send_columns(block.entity, times, [values])
    if isinstance(result, Simulation):
        _draw_simulation(stream, result)
    elif isinstance(result, Run):
        _draw_run(stream, places_of(result)[0], result)
    else:
        _draw_comparison(stream, result)
    draw_scene(stream, scene)


def _lone(result: Result) -> bool:
    """Tell whether no motion joins one sample and the next."""
    if isinstance(result, Simulation):
        return False
    runs = [result] if isinstance(result, Run) else [one.run for one in result.runs]
    return all(not run.timed for run in runs)


def _draw_simulation(stream: RecordingStream, result: Simulation) -> None:
    """Show the system file, and what the delta meters allow and found."""
    import rerun as rr

    stream.log(SYSTEM_FILE, rr.TextDocument(printable(result.system_text)), static=True)
    draw_meter_tolerances(stream, result)
    draw_meter_worst(stream, result)


def _draw_comparison(stream: RecordingStream, result: Comparison) -> None:
    """Draw what is allowed, and of each log what was done to it, how it deviates, and where it is worst."""
    draw_tolerances(stream, result)
    for place, one in zip(places_of(result), result.runs, strict=True):
        _draw_run(stream, place, one.run)
        draw_comparison_events(stream, place, one)
        draw_worst(stream, place, one)


def _draw_run(stream: RecordingStream, place: Place, run: Run) -> None:
    """Mark and list what was done to a log."""
    draw_repolarizations(stream, place, run)
    draw_log_events(stream, place, run)


def _draw_styles(stream: RecordingStream, every: Sequence[Block], *, lone: bool) -> None:
    """Give every series its name and its colour; `lone` samples, which nothing joins, are points."""
    import rerun as rr

    for block in every:
        if not block.names:
            continue
        if lone or len(block.t_ns) == 1:  # no line goes through one sample
            colours, names = [rgb(colour) for colour in block.colours], list(block.names)
            points = rr.SeriesPoints(colors=colours, names=names, marker_sizes=[MARK_SIZE] * len(names))
            stream.log(block.entity, points, static=True)
            continue
        stream.log(block.entity, series_lines(block.names, block.colours), static=True)
