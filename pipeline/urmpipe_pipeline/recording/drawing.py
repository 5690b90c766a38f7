"""Send what the viewer draws: series with names and colours, overviews, marks, events, arm and paths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.palette import rgb
from urmpipe_pipeline.recording.columns import block_columns, time_columns
from urmpipe_pipeline.recording.entities import SUMMARY, Block, Place, places_of
from urmpipe_pipeline.recording.events import draw_comparison_events, draw_log_events
from urmpipe_pipeline.recording.marks import draw_repolarizations, draw_worst
from urmpipe_pipeline.recording.overview import overviews
from urmpipe_pipeline.recording.scene import Arm, Scene, Way
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.recording.tolerances import draw_tolerances
from urmpipe_pipeline.results import Run

if TYPE_CHECKING:
    from rerun import RecordingStream

LINK_RADIUS, JOINT_RADIUS, POINT_RADIUS = 0.012, 0.022, 0.018
WANTED_RADIUS, DONE_RADIUS = 0.0065, 0.0035
"""Sizes in the 3D view, as shares of the radius of everything in it."""

STRIPS = 256
"""Poses of the skeleton sent at a time: decoding a chunk of strips takes time by the square of its rows."""

LINE_WIDTH = 2.0
"""Width of a series in points of the screen."""

LINK_COLOUR = "#c8d0d4"
"""The links of the arm: neutral, so that the joints stand out in their own colours."""


def draw(stream: RecordingStream, result: Run | Comparison, every: Sequence[Block], scene: Scene) -> None:
    """Send everything that is there to be looked at."""
    import rerun as rr

    stream.log(SUMMARY, rr.TextDocument(summary(result), media_type="text/markdown"), static=True)
    few = list(overviews(result, every))
    _draw_styles(stream, [*every, *few])
    for block in few:
        times, values = block_columns(block, slice(None))
        stream.send_columns(block.entity, times, [values])
    standing = places_of(result)
    if isinstance(result, Run):
        _draw_run(stream, standing[0], result)
    else:
        draw_tolerances(stream, result)
        for place, one in zip(standing, result.runs, strict=True):
            _draw_run(stream, place, one.run)
            draw_comparison_events(stream, place, one)
            draw_worst(stream, place, one)
    _draw_scene(stream, scene)


def _draw_run(stream: RecordingStream, place: Place, run: Run) -> None:
    """Mark and list what was done to a log."""
    draw_repolarizations(stream, place, run)
    draw_log_events(stream, place, run)


def _draw_styles(stream: RecordingStream, every: Sequence[Block]) -> None:
    """Give every series its name and its colour."""
    import rerun as rr

    for block in every:
        if block.names:
            style = rr.SeriesLines(
                colors=[rgb(colour) for colour in block.colours],
                names=list(block.names),
                widths=[LINE_WIDTH] * len(block.names),
                # Where samples are closer than pixels, the default draws their mean: peaks would vanish.
                aggregation_policy=rr.components.AggregationPolicy.MinMax,
            )
            stream.log(block.entity, style, static=True)


def _draw_scene(stream: RecordingStream, scene: Scene) -> None:
    import rerun as rr

    if scene.empty:
        return
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    size = scene.ball()[1]
    for way in scene.ways:
        _draw_way(stream, way, size)
    if scene.arm is not None:
        _draw_arm(stream, scene.arm, size)


def _draw_arm(stream: RecordingStream, arm: Arm, size: float) -> None:
    """Draw the skeleton: a line through the points, a ball at each in the colour of its joint."""
    import rerun as rr

    skeleton = arm.skeleton.astype(np.float32)
    count, points = skeleton.shape[:2]
    links = rr.LineStrips3D.from_fields(colors=[rgb(LINK_COLOUR)], radii=[LINK_RADIUS * size])
    stream.log("/robot/links", links, static=True)
    for start in range(0, count, STRIPS):
        rows = slice(start, start + STRIPS)
        times = time_columns(arm.t_ns[rows], "sample", arm.sample[rows])
        stream.send_columns("/robot/links", times, rr.LineStrips3D.columns(strips=skeleton[rows]))
    joints = rr.Points3D.from_fields(
        colors=[rgb(colour) for colour in arm.colours], radii=[JOINT_RADIUS * size]
    )
    stream.log("/robot/joints", joints, static=True)
    columns = rr.Points3D.columns(positions=skeleton.reshape(-1, 3)).partition(np.full(count, points))
    stream.send_columns("/robot/joints", time_columns(arm.t_ns, "sample", arm.sample), columns)


def _draw_way(stream: RecordingStream, way: Way, size: float) -> None:
    """Draw a path as lines, broad if it is what was asked for, and the point that moves on it."""
    import rerun as rr

    colour = rgb(way.colour)
    radius = (WANTED_RADIUS if way.wanted else DONE_RADIUS) * size
    lines = rr.LineStrips3D(
        [strip.astype(np.float32) for strip in way.strips], colors=[colour], radii=[radius]
    )
    stream.log(way.path, lines, static=True)
    style = rr.Points3D.from_fields(colors=[colour], radii=[POINT_RADIUS * size])
    stream.log(way.point, style, static=True)
    track = way.track
    columns = rr.Points3D.columns(positions=track.position.astype(np.float32))
    stream.send_columns(way.point, time_columns(track.t_ns, "sample", track.sample), columns)
