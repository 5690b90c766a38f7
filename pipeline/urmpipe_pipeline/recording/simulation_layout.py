"""The views of a simulation: what it says of itself, and a plot for each block and unit."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from urmpipe_pipeline.recording.codec import Encoded
from urmpipe_pipeline.recording.entities import SUMMARY, printable
from urmpipe_pipeline.recording.plots import Plots
from urmpipe_pipeline.recording.signal_entities import SYSTEM_FILE, verdict_entities
from urmpipe_pipeline.simulations.answers import answers_of
from urmpipe_pipeline.simulations.signal_groups import Group, groups_of
from urmpipe_pipeline.simulations.simulation import Simulation

if TYPE_CHECKING:
    from rerun.blueprint import Container, View

SEEN_AT_ONCE = 8
"""Plots that stand beside each other; of more, those of each block have a tab."""

COLUMNS = 2
"""Plots side by side."""


def simulation_words() -> Container:
    """Return the summary, with the system file behind it."""
    import rerun.blueprint as rrb

    return rrb.Tabs(
        rrb.TextDocumentView(origin=SUMMARY, name="Summary"),
        rrb.TextDocumentView(origin=SYSTEM_FILE, name="System file"),
        active_tab=0,
    )


def simulation_plots(result: Simulation, encoded: Encoded) -> View | Container:
    """Return the plots: all at once if they are few, else a tab a block.

    That of the worst meter is open; without one that of set points and answers, which comes first; else the
    last, to where the signals of most systems flow.
    """
    import rerun.blueprint as rrb

    plots = Plots(result, encoded)
    answers = answers_of(result)
    groups = [*answers, *groups_of(result)]
    if not groups:
        return rrb.TextDocumentView(origin=SYSTEM_FILE, name="No signal was recorded")
    views = [_plot(plots, result, group) for group in groups]
    if len(views) <= SEEN_AT_ONCE:
        return _grid(views)
    paired = list(zip(groups, views, strict=True))
    tabs: list[Container] = []
    judged = result.judged_worst
    opened = 0 if answers else None
    for block, some in groupby(paired, key=lambda pair: pair[0].block):
        if judged is not None and judged.block == block:
            opened = len(tabs)
        tabs.append(_grid([view for _, view in some], printable(block)))
    return rrb.Tabs(*tabs, active_tab=len(tabs) - 1 if opened is None else opened)


def _plot(plots: Plots, result: Simulation, group: Group) -> View | Container:
    """Return the plot of a group, with what is allowed where it is judged; of a long one two as tabs."""
    import rerun.blueprint as rrb

    beside: list[str] = []
    if group.verdict is not None:
        number = result.verdicts.index(group.verdict)
        beside = [
            f"{verdict_entities(result, 'tolerance')[number]}/**",
            verdict_entities(result, "marks/worst")[number],
        ]
    views = plots.signals(group, len(result.t_ns), *beside)
    return rrb.Tabs(*views, active_tab=0) if len(views) > 1 else views[0]


def _grid(views: list[View | Container], name: str | None = None) -> Container:
    """Return plots in two columns; few of them one below the other."""
    import rerun.blueprint as rrb

    columns = COLUMNS if len(views) > 2 * COLUMNS else 1
    return rrb.Grid(*views, grid_columns=columns, name=name)
