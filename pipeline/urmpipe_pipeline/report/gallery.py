"""The gallery: which figures stand in a part of the page, in order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.report.figures_deviation import deviation_figure, pose_figure, speed_figure
from urmpipe_pipeline.report.figures_motion import motion_figure, pose_by_row_figure
from urmpipe_pipeline.report.figures_overview import overview_figure
from urmpipe_pipeline.report.figures_repolarization import joints_figure, point_figure
from urmpipe_pipeline.report.figures_signals import signals_figure
from urmpipe_pipeline.report.paths import (
    arms_path_figure,
    path_figure,
    repolarized_path_figure,
    run_path_figure,
)
from urmpipe_pipeline.report.spec import Figure, unjoined
from urmpipe_pipeline.runs.playback import play_back
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.signal_groups import Group
from urmpipe_pipeline.simulations.simulation import Simulation


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
    """Return the figures of a log that was only ingested: how it was repolarized, then how it moves.

    Of single poses the joints and the tool centre point, as points.
    """
    if not run.timed:
        return [unjoined(one) for one in _those_there([joints_figure(run), pose_by_row_figure(run)])]
    return _those_there([*_repolarization_figures(run), motion_figure(run), run_path_figure(run)])


def simulation_figures(simulation: Simulation) -> list[Figure]:
    """Return the figures of a whole simulation: where its arms were."""
    return _those_there([arms_path_figure(simulation)])


def signal_figures(simulation: Simulation, groups: Sequence[Group]) -> list[Figure]:
    """Return the figures of the signals of one block, one a unit."""
    return _those_there(signals_figure(simulation, group) for group in groups)


def _repolarization_figures(run: Run) -> list[Figure | None]:
    """Return Figure 5 of the paper: joints, tool centre point and path, before and after repolarization."""
    played = play_back(run)
    if played is None:
        return [joints_figure(run)]
    return [joints_figure(run), point_figure(run, played), repolarized_path_figure(run, played)]


def _those_there(figures: Iterable[Figure | None]) -> list[Figure]:
    """Return the figures without what a log does not have."""
    return [figure for figure in figures if figure is not None]
