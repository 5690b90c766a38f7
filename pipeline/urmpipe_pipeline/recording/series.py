"""How the lines of a plot look."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from urmpipe_pipeline.palette import rgb

if TYPE_CHECKING:
    from rerun import SeriesLines

LINE_WIDTH = 2.0
"""Width of a line in points of the screen."""


def series_lines(names: Sequence[str], colours: Sequence[str]) -> SeriesLines:
    """Return the look of lines.

    Args:
        names: What the legend calls each.
        colours: Theirs, as #rrggbb.
    """
    import rerun as rr

    return rr.SeriesLines(
        colors=[rgb(colour) for colour in colours],
        names=list(names),
        widths=[LINE_WIDTH] * len(names),
        # Where samples are closer than pixels, the default draws their mean: peaks would vanish.
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
