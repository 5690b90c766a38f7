"""The gallery: which figures stand in a part of the page, in order."""

from __future__ import annotations

from collections.abc import Iterable

from urmpipe_pipeline.comparison import Comparison, Deviation
from urmpipe_pipeline.playback import play_back
from urmpipe_pipeline.report.figures_deviation import deviation_figure, pose_figure, speed_figure
from urmpipe_pipeline.report.figures_motion import motion_figure
from urmpipe_pipeline.report.figures_overview import overview_figure
from urmpipe_pipeline.report.figures_repolarization import joints_figure, point_figure
from urmpipe_pipeline.report.paths import path_figure, repolarized_path_figure, run_path_figure
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.results import Run


def comparison_figures(comparison: Comparison) -> list[Figure]:
    """Return the figures of all logs of a comparison together; none of a single log."""
    return _those_there([overview_figure(comparison)])


def deviation_figures(deviation: Deviation) -> list[Figure]:
    """Return the figures of a compared log: how it deviates, then how it moves and how it was repolarized."""
    return _those_there(
        [
            deviation_figure(deviation),
            path_figure(deviation),
            pose_figure(deviation),
            speed_figure(deviation),
            motion_figure(deviation.run),
            *_repolarization_figures(deviation.run),
        ]
    )


def run_figures(run: Run) -> list[Figure]:
    """Return the figures of a log that was only ingested: how it was repolarized, then how it moves."""
    return _those_there([*_repolarization_figures(run), motion_figure(run), run_path_figure(run)])


def _repolarization_figures(run: Run) -> list[Figure | None]:
    """Return Figure 5 of the paper: joints, tool centre point and path, before and after repolarization."""
    played = play_back(run)
    if played is None:
        return [joints_figure(run)]
    return [joints_figure(run), point_figure(run, played), repolarized_path_figure(run, played)]


def _those_there(figures: Iterable[Figure | None]) -> list[Figure]:
    """Return the figures without what a log does not have."""
    return [figure for figure in figures if figure is not None]
