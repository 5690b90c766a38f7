"""The gallery: which figures stand in a part of the page, in order."""

from __future__ import annotations

from urmpipe_pipeline.comparison import Comparison, Deviation
from urmpipe_pipeline.report import figures, paths
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.results import Run


def comparison_figures(comparison: Comparison) -> list[Figure]:
    """Return the figures of all logs of a comparison together; none of a single log."""
    return []


def deviation_figures(deviation: Deviation) -> list[Figure]:
    """Return the figures of a compared log."""
    found = [
        figures.deviation_figure(deviation),
        paths.path_figure(deviation),
        figures.joints_figure(deviation.run),
    ]
    return [figure for figure in found if figure is not None]


def run_figures(run: Run) -> list[Figure]:
    """Return the figures of a log that was only ingested."""
    found = [figures.joints_figure(run), paths.run_path_figure(run), figures.motion_figure(run)]
    return [figure for figure in found if figure is not None]
