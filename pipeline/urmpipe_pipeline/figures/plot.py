"""One figure of a presentation, for whoever goes on with it in Python."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_pipeline.figures.files import drawn
from urmpipe_pipeline.figures.listing import Listed, Plot, chosen, listed
from urmpipe_pipeline.figures.size import size_of
from urmpipe_pipeline.presentation.figure import Drawing
from urmpipe_pipeline.presentation.section import Presentation

if TYPE_CHECKING:
    from urmpipe_pipeline.figures.sheet import Sheet


def plot(presentation: Presentation, title: str | None, width: str | float, font: float) -> Sheet:
    """Return a figure of a presentation.

    Args:
        presentation: What a result shows.
        title: Of the figure, or a pattern: the first that it stands for. None for the main one.
        width: column, page, a length with its unit, or a number in [m].
        font: Size of the text in [pt].

    Raises:
        OptionError: If there is no such figure, or a size is out of range.
        OutputError: If matplotlib is missing.
    """
    size = size_of(width, font)
    if not (title is None or isinstance(title, str)):
        raise OptionError(
            Finding(parameter="title", found=format_value(title), allowed="the title of a figure")
        )
    figures = (one for one in listed([presentation]) if not isinstance(one.content, Drawing))
    wanted = _main(figures) if title is None else chosen(list(figures), (title,), "title")[0]
    if wanted is None:
        raise OptionError(Finding(f"{presentation.name} has no figure to plot"))
    assert not isinstance(wanted.content, Drawing)
    return drawn(wanted.content, size)


def _main(figures: Iterable[Listed]) -> Listed | None:
    """Return the first figure with axes of quantities, else the first in space; None without any."""
    in_space = None
    for one in figures:
        if isinstance(one.content, Plot):
            return one
        in_space = in_space or one
    return in_space
