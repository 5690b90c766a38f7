"""What the viewer opens with: the arm and the paths at the left, the series and the events at the right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.recording.entities import SUMMARY, Place, places_of, printable
from urmpipe_pipeline.recording.scene import Scene
from urmpipe_pipeline.results import Run

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint, Container, Spatial3DView, TextLogView, TimeSeriesView, View

    Row: TypeAlias = tuple[View | Container, float]

EYE = np.array([0.62, -0.66, 0.42]) * 1.8
"""From the middle of the scene to the eye, in radii of the scene: from the front right, a little above."""


def viewer_layout(result: Run | Comparison, scene: Scene) -> Blueprint:
    """Return the views of a run or a comparison, each with its unit, on the timeline t."""
    import rerun.blueprint as rrb

    rows = _run_rows(result) if isinstance(result, Run) else _comparison_rows(result)
    # The table in it has a line a run.
    height = 2.0 if isinstance(result, Run) else 1.2 + 0.4 * max(2, len(result.runs))
    text: Row = (rrb.TextDocumentView(origin=SUMMARY, name="Summary"), height)
    if scene.empty:
        root = _stacked([text, *rows])
    else:
        root = rrb.Horizontal(_stacked([(_scene_view(scene), 7), text]), _stacked(rows), column_shares=[1, 1])
    return rrb.Blueprint(
        root,
        rrb.TimePanel(state="collapsed", timeline="t", play_state="paused"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def _scene_view(scene: Scene) -> Spatial3DView:
    import rerun.blueprint as rrb

    centre, radius = scene.ball()
    eye = rrb.EyeControls3D(position=centre + radius * EYE, look_target=centre, eye_up=(0.0, 0.0, 1.0))
    entities = ["/robot/**", "/path/**", "/point/**"]
    return rrb.Spatial3DView(origin="/", contents=entities, name="Arm and paths [m]", eye_controls=eye)


def _run_rows(run: Run) -> list[Row]:
    """Return the views of a run from top to bottom, each with its share of the height."""
    place = places_of(run)[0]
    rows: list[Row] = [(view, 3) for view in _joint_views(run, place, "")]
    if motion := _motion_views(run, place):
        rows.append((_tabs(motion), 3))
    if run.audit or run.warnings:
        rows.append((_events([place]), 2))
    return rows


def _comparison_rows(result: Comparison) -> list[Row]:
    """Return the views of a comparison from top to bottom.

    Where there are several runs, each has a tab, and that of the first that fails is open.
    """
    standing = places_of(result)
    several = len(standing) > 1
    deltas: list[View] = []
    joints: list[list[View]] = []
    for one, place in zip(result.runs, standing, strict=True):
        name = f"delta {'of' if several else '= reference -'} {printable(one.name)} [m]"
        deltas.append(_series(name, place.named("delta"), "/delta/tolerance/**"))
        if views := _joint_views(one.run, place, f", {printable(one.name)}" if several else ""):
            joints.append(views)
    failing = next((i for i, one in enumerate(result.runs) if one.verdict == "fail"), 0)
    rows: list[Row] = [(_tabs(deltas, failing), 4)]
    active = failing if len(joints) == len(deltas) else 0
    rows += [(_tabs(views, active), 3) for views in zip(*joints, strict=True)]
    return [*rows, (_tabs([_events(standing), *_motion_views(result.runs[0].run, standing[0])]), 2)]


def _joint_views(run: Run, place: Place, label: str) -> list[View]:
    """Return the joints before and after; none for a path."""
    if not run.log.joints:
        return []
    unit = run.joint_unit()
    return [
        _series(f"Joints in the file{label} [{unit}]", f"{place.prefix}joints/raw"),
        _series(f"Joints repolarized{label} [{unit}]", f"{place.prefix}joints/repolarized"),
    ]


def _motion_views(run: Run, place: Place) -> list[View]:
    """Return the derivatives and the tool centre point, as far as the run has them."""
    views: list[View] = []
    if run.log.joints:
        views.append(_series(f"Joint rates [{run.joint_unit('/s')}]", f"{place.prefix}joints/velocity"))
        views.append(
            _series(f"Joint accelerations [{run.joint_unit('/s2')}]", f"{place.prefix}joints/acceleration")
        )
    if run.tcp is not None:
        views += [
            _series("TCP [m]", f"{place.prefix}tcp/position"),
            _series("TCP velocity [m/s]", f"{place.prefix}tcp/velocity"),
            _series("TCP acceleration [m/s2]", f"{place.prefix}tcp/acceleration"),
            _series("TCP rz, ry, rx [rad]", f"{place.prefix}tcp/euler_zyx"),
        ]
    elif run.tcp_recorded is not None:
        views.append(_series("Recorded TCP [m]", f"{place.prefix}tcp/recorded"))
    return views


def _events(standing: Sequence[Place]) -> TextLogView:
    """Return the list of the events."""
    import rerun.blueprint as rrb

    entities = [f"{place.prefix}events/**" for place in standing]
    # Its own column of times is too narrow to be read, so each line begins with its time.
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn("t", visible=False)],
        text_log_columns=["LogLevel", "Body"],
    )
    return rrb.TextLogView(origin="/", contents=entities, name="Events, at t [s]", columns=columns)


def _series(name: str, *entities: str) -> TimeSeriesView:
    """Return a plot over time; all plots share their time axis."""
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin="/",
        contents=list(entities),
        name=name,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend("RightTop"),
    )


def _stacked(rows: Sequence[Row]) -> Container:
    """Return views one below the other."""
    import rerun.blueprint as rrb

    return rrb.Vertical(*(view for view, _ in rows), row_shares=[share for _, share in rows])


def _tabs(views: Sequence[View], active: int = 0) -> View | Container:
    """Return the views as tabs, one of them open, or the only one as itself."""
    import rerun.blueprint as rrb

    return rrb.Tabs(*views, active_tab=active) if len(views) > 1 else views[0]
