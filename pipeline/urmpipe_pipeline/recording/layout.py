"""What the viewer opens with: verdict, arm and paths at the left; the plots and the events at the right.

No blueprint says at which time the viewer opens: a `time_selection` moves the cursor only while it plays, and
keeps it there. So `urmpipe view` sets the time, and in every plot stands a line through the sample by which
the verdict was decided. Opened otherwise the viewer stands at the first sample: the summary says where to go.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.decided import decided_row
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.recording.codec import Encoded
from urmpipe_pipeline.recording.entities import SUMMARY, Place, places_of, printable
from urmpipe_pipeline.recording.eye import EYE, eye_distance, seen
from urmpipe_pipeline.recording.ghost_arms import fullest_time
from urmpipe_pipeline.recording.plots import Plots, decisive_plot
from urmpipe_pipeline.recording.scene import Scene
from urmpipe_pipeline.recording.simulation_layout import simulation_plots, simulation_words
from urmpipe_pipeline.recording.simulation_summary import simulation_summary
from urmpipe_pipeline.recording.summary import summary
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint, Container, Spatial3DView, TextLogView, View

    Row: TypeAlias = tuple[View | Container, float]

HEIGHTS = {
    "delta": 4,
    "joints apart": 3,
    "joints in the file": 3.5,
    "joints repolarized": 3,
    "speed": 2,
    "events": 2.2,
}
"""Shares of the height that the plots have."""

HEAD_SHARE, LINE_SHARE, MOST_TEXT = 0.12, 0.022, 0.45
"""Shares of the height for the summary: its title, each line, and all of it at most."""

LINE_LENGTH = 115
"""Characters that fit in a line of the summary where it has half of a usual window's width."""


def viewer_layout(result: Result, scene: Scene, encoded: Encoded) -> Blueprint:
    """Return the views of a result, each with its unit, on the timeline t."""
    import rerun.blueprint as rrb

    if isinstance(result, Simulation):
        plots = simulation_plots(result, encoded)
        if scene.empty:  # there are tables in the words, which are no wider than they must be
            return _blueprint_of(rrb.Horizontal(simulation_words(), plots, column_shares=[1, 2]))
        return _blueprint(simulation_words(), simulation_summary(result), plots, scene)
    right = _of_run(result, encoded) if isinstance(result, Run) else _of_comparison(result, encoded)
    return _blueprint(rrb.TextDocumentView(origin=SUMMARY, name="Summary"), summary(result), right, scene)


def _blueprint(text: View | Container, words: str, right: View | Container, scene: Scene) -> Blueprint:
    """Return the summary and the 3D view at the left, the plots at the right.

    Args:
        text: The view of the summary.
        words: What stands in it, by which it gets its height.
        right: The plots.
        scene: The 3D view; without anything in it, the summary stands above the plots.
    """
    import rerun.blueprint as rrb

    length = 2 * LINE_LENGTH if scene.empty else LINE_LENGTH
    lines = sum(math.ceil(len(line) / length) for line in words.splitlines())
    share = min(MOST_TEXT, HEAD_SHARE + LINE_SHARE * lines)
    shares = [share, 1 - share]
    root: Container = rrb.Vertical(text, right, row_shares=shares)
    if not scene.empty:
        left = rrb.Vertical(text, _scene_view(scene), row_shares=shares)
        root = rrb.Horizontal(left, right, column_shares=[1, 1])
    return _blueprint_of(root)


def _blueprint_of(root: Container) -> Blueprint:
    """Return the views with the panels about them collapsed, on the timeline t."""
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        root,
        rrb.TimePanel(state="collapsed", timeline="t", play_state="paused"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def opening_time(result: Result) -> int:
    """Return where the viewer should stand in [ns]: where the verdict was decided, else at the first sample.

    A simulation that failed opens where it ended, solved joint values where most branches are.
    """
    if isinstance(result, Simulation):
        worst = result.judged_worst.sample if result.judged_worst is not None else 0
        shown = worst if result.failed is None else -1
        return int(result.t_ns[shown]) if len(result.t_ns) else 0
    if isinstance(result, Run):
        return fullest_time(result) if result.goals is not None else int(result.t_ns[0])
    return int(result.worst.t_ns[decided_row(result.worst)])


def eye_and_target(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return where the eye is and what it looks at in [m], shape (3,) each: all of the scene is in view."""
    centre, radius = scene.ball()
    return centre + max(radius, eye_distance(seen(scene.points() - centre))) * EYE, centre


def _scene_view(scene: Scene) -> Spatial3DView:
    import rerun.blueprint as rrb

    position, target = eye_and_target(scene)
    eye = rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0))
    entities = ["/robot/**", "/path/**", "/point/**"]
    entities += ["/branches/**"] if scene.ghosts else []
    entities += ["/targets/**"] if scene.goals else []
    return rrb.Spatial3DView(origin="/", contents=entities, name=_scene_name(scene), eye_controls=eye)


def _scene_name(scene: Scene) -> str:
    """Return whose arm is drawn, and what the crimson line is."""
    arm = f"Arm of {scene.whose}" if scene.whose else "Arm"
    if scene.enlarged is None:
        return f"{arm} and paths [m]"
    return f"{arm} and paths [m], in crimson the deviation x{scene.enlarged.factor}"


def _of_run(run: Run, encoded: Encoded) -> Container:
    """Return the plots of an ingested log from top to bottom."""
    plots, place = Plots(run, encoded), places_of(run)[0]
    rows = _joint_rows(plots, run, place)
    if speed := plots.speed(run, place):
        rows.append((_tabs(speed), HEIGHTS["speed"]))
    motion, events = plots.motion(run), _events(place)
    if not rows and motion:  # a path: there is room for where it was
        return _stacked([(_tabs(motion), HEIGHTS["delta"]), (events, HEIGHTS["events"])])
    rows.append((_tabs([events, *motion]), HEIGHTS["events"]))
    return _stacked(rows)


def _of_comparison(result: Comparison, encoded: Encoded) -> Container:
    """Return the plots of each log; of several, each has a tab, and that of the worst is open."""
    import rerun.blueprint as rrb

    plots, standing = Plots(result, encoded), places_of(result)
    columns = [_of_log(plots, one, place, result) for one, place in zip(result.runs, standing, strict=True)]
    if len(columns) == 1:
        return columns[0]
    return rrb.Tabs(*columns, active_tab=result.runs.index(result.worst))


def _of_log(plots: Plots, one: Deviation, place: Place, result: Comparison) -> Container:
    """Return the plots of a compared log from top to bottom, what decides on it open in the first.

    Where the joints were compared their deviation stands below, and those of the file behind a tab.
    """
    deviations = plots.deviations(one, place, result.reference.name, result.tolerance)
    apart = deviations.pop("joints", [])
    kinds = [plot for plot, views in deviations.items() for _ in views]
    decisive = decisive_plot(one)
    first = [view for views in deviations.values() for view in views]
    rows: list[Row] = [(_tabs(first, kinds.index(decisive) if decisive in kinds else 0), HEIGHTS["delta"])]
    if apart:
        rows.append((_tabs(apart), HEIGHTS["joints apart"]))
        joints = [view for views in reversed(list(plots.joints(one.run, place))) for view in views]
        rows += [(_tabs(joints), HEIGHTS["joints repolarized"])] if joints else []
    else:
        rows += _joint_rows(plots, one.run, place)
    rows.append((_tabs(plots.compared_speed(one, place)), HEIGHTS["speed"]))
    rows.append((_tabs([_events(place), *plots.motion(one.run)]), HEIGHTS["events"]))
    return _stacked(rows, f"{one.verdict.upper()} {printable(one.name)}")


def _joint_rows(plots: Plots, run: Run, place: Place) -> list[Row]:
    """Return the joints before and after; nothing for a path."""
    heights = HEIGHTS["joints in the file"], HEIGHTS["joints repolarized"]
    return [(_tabs(views), height) for views, height in zip(plots.joints(run, place), heights, strict=False)]


def _events(place: Place) -> TextLogView:
    """Return the list of the events of a log."""
    import rerun.blueprint as rrb

    # Its own column of times is too narrow to be read, so each line begins with its time.
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn("t", visible=False)],
        text_log_columns=["LogLevel", "Body"],
    )
    entities = f"{place.prefix}events/**"
    return rrb.TextLogView(origin="/", contents=entities, name="Events, at t [s]", columns=columns)


def _stacked(rows: Sequence[Row], name: str | None = None) -> Container:
    """Return views one below the other."""
    import rerun.blueprint as rrb

    return rrb.Vertical(*(view for view, _ in rows), row_shares=[share for _, share in rows], name=name)


def _tabs(views: Sequence[View], active: int = 0) -> View | Container:
    """Return the views as tabs, one of them open, or the only one as itself."""
    import rerun.blueprint as rrb

    return rrb.Tabs(*views, active_tab=active) if len(views) > 1 else views[0]
