"""Which figures presentations have, in the order of the report, and which of them are wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from urmpipe_models.errors import Finding, OptionError, format_unknown_name
from urmpipe_pipeline.presentation.curves import Span, axis_of, by_axis, panels_of, span_of
from urmpipe_pipeline.presentation.figure import Drawing, Figure, Panel, SpaceFigure
from urmpipe_pipeline.presentation.section import Presentation, Section


@dataclass(frozen=True, slots=True, eq=False)
class Plot:
    """Panels of a figure on one horizontal axis.

    Attributes:
        figure: The figure that they belong to.
        over: What the axis measures: t, row or a quantity.
        panels: From the top.
        span: From where to where the axis goes, where it is no quantity.
    """

    figure: Figure
    over: str
    panels: tuple[Panel, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Listed:
    """A figure with its names.

    Attributes:
        part: The heading of the part of the report that it stands in.
        title: Its own.
        alt: What it shows, for who does not see it.
        content: What is drawn.
    """

    part: str
    title: str
    alt: str
    content: Plot | SpaceFigure | Drawing

    @property
    def names(self) -> tuple[str, str]:
        """What it may be chosen by: its title, and that behind its part."""
        return self.title, f"{self.part}/{self.title}"


def listed(presentations: Sequence[Presentation]) -> Iterator[Listed]:
    """Yield every figure of some presentations in the order of the report."""
    return (found for one in presentations for found in _in_section(one.body))


def chosen(figures: Sequence[Listed], names: Sequence[str], parameter: str) -> list[Listed]:
    """Return the figures that one of some names or patterns (`*`, `?`) stands for, in their own order.

    Args:
        figures: Those that there are.
        names: Titles, or PART/TITLE, in small or capital letters; none chooses all.
        parameter: What gives them, for messages.

    Raises:
        OptionError: With every name that stands for no figure, and those that there are.
    """
    unknown = [name for name in names if not any(_stands_for(name, one) for one in figures)]
    if unknown:
        titles = [one.title for one in figures]
        raise OptionError(
            *(Finding(format_unknown_name(name, titles), parameter=parameter) for name in unknown)
        )
    return [one for one in figures if not names or any(_stands_for(name, one) for name in names)]


def _stands_for(name: str, figure: Listed) -> bool:
    wanted = name.casefold()
    return any(wanted == one or fnmatchcase(one, wanted) for one in map(str.casefold, figure.names))


def _in_section(section: Section) -> Iterator[Listed]:
    blocks = [*section.figures(), *section.blocks()]
    plots = [one for one in blocks if isinstance(one, Figure)]
    span = span_of(panel for one in plots for panel in panels_of(one) if axis_of(panel) == "t")
    for block in blocks:
        match block:
            case Figure():
                yield from _plots(section.title, block, span)
            case SpaceFigure() | Drawing():
                yield Listed(section.title, block.title, block.alt, block)
    for below in sorted(section.sections, key=lambda one: one.rank):
        yield from _in_section(below)


def _plots(part: str, figure: Figure, times: Span) -> Iterator[Listed]:
    """Yield a figure, one for each kind of horizontal axis that its panels have."""
    alt = figure.alt if isinstance(figure.alt, str) else figure.alt()
    for title, over, panels in by_axis(figure):
        span = times if over == "t" else span_of(panels)
        yield Listed(part, title, alt, Plot(figure, over, tuple(panels), span))
