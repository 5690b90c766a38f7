"""Figures of a presentation as plotly.js draws them: panels one below the other on a common axis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.presentation.curves import Span, axis_of, by_axis, panels_of, place_of, span_of
from urmpipe_pipeline.presentation.figure import Figure, Over, Panel, View
from urmpipe_pipeline.presentation.layout import small_multiples, two_scales
from urmpipe_pipeline.report import spec
from urmpipe_pipeline.report.panels import MARKED, Names, drawn_panel
from urmpipe_pipeline.report.spec import Spec
from urmpipe_pipeline.report.traces import instant, label

ALONE_PX, OVER_PX = 236, 300
"""Height of the only panel of a figure, and of one over a quantity."""

AROUND_PX = 64
"""Height of what stands above and below them: legend and axis."""

SMALL_PX = 400
"""Height of a figure at most that stands beside another one."""

PANEL_PX = ((1, 112), (4, 150), (8, 220))
"""Height of one panel among some, by the number of lines that it has at most."""

SMALL_MULTIPLE_PX = 150
"""Height of a plot among many small ones."""

BROKEN = " The axis has two scales: a larger one within the {limit}, a smaller one beyond it."
CLOSE = " The axis has two scales: a larger one for the values, a smaller one from there to the {limit}."
"""Said of a figure whose tolerance, or whose values, would vanish on one scale."""

WORDS_PX = 30
"""Height of the words at the head of a line through a plot: the legend begins above them. A legend of many
lines, as in a narrow window, shrinks it with the plot."""


def time_span(figures: Iterable[Figure]) -> Span:
    """Return the time from the first to the last row of all panels over time; 0 to 0 without one."""
    return span_of(panel for figure in figures for panel in panels_of(figure) if axis_of(panel) == "t")


class Links:
    """Which figures of a result share their time axis: those of a section, and panels with the same times."""

    def __init__(self) -> None:
        """Know no times yet."""
        self._known: list[tuple[IntArray, str]] = []

    def of(self, figures: Iterable[Figure], ident: str) -> str:
        """Return what the figures of a section share their time axis by."""
        times = [panel.t_ns for one in figures for panel in panels_of(one) if panel.t_ns is not None]
        found = next((link for known, link in self._known if any(known is t_ns for t_ns in times)), ident)
        self._known += [(t_ns, found) for t_ns in times]
        return found


@dataclass(frozen=True, slots=True)
class Multiples:
    """Small figures side by side, each of an answer with its set point.

    Attributes:
        title: Their heading.
        caption: What is drawn and what to look for.
        figures: One a pair.
        folded: Whether they are closed until someone opens them.
    """

    title: str
    caption: str
    figures: tuple[spec.Figure, ...]
    folded: bool


def drawn_figures(figure: Figure, times: Span) -> Iterator[spec.Figure | Multiples]:
    """Yield a figure, one for each kind of horizontal axis that its panels have; many pairs of lines apart.

    Axes of time span the same times in all figures that stand together.
    """
    whole = tuple(panel for panel in panels_of(figure) if len(small_multiples(panel)) == 1)
    yield from _whole(replace(figure, views=(View("", whole),)), times)
    for panel in panels_of(figure):
        if len(few := small_multiples(panel)) > 1:
            small = tuple(_small(figure, one, times) for one in few)
            yield Multiples(figure.title, figure.caption, small, figure.folded)


def _small(figure: Figure, panel: Panel, times: Span) -> spec.Figure:
    """Return an answer and its set point, which is dashed."""
    wanted, answer = (line.names[0] for line in panel.lines)
    alt = f"{answer} and its set point {wanted}, dashed, over time."
    return spec.Figure(panel.title, "", alt, _spec(figure, [panel], times), SMALL_MULTIPLE_PX + AROUND_PX)


def _whole(figure: Figure, times: Span) -> Iterator[spec.Figure]:
    """Yield panels one below the other."""
    for title, over, panels in by_axis(figure):
        span = times if over == "t" else span_of(panels)
        yield spec.Figure(
            title,
            f"{figure.caption}{_left_out(panels)}{_scales_of(panels)}",
            figure.alt if isinstance(figure.alt, str) else figure.alt(),
            _spec(figure, panels, span),
            _height(panels),
            over=over,
            folded=figure.folded,
        )


def _scales_of(panels: Sequence[Panel]) -> str:
    found = ((two_scales(panel), panel.limit_name) for panel in panels)
    said = ((CLOSE if one.close else BROKEN).format(limit=limit) for one, limit in found if one is not None)
    return "".join(dict.fromkeys(said))


def _left_out(panels: Sequence[Panel]) -> str:
    most = max(len(panel.marks) for panel in panels)
    return f" The first {MARKED} of {most} marks are drawn." if most > MARKED else ""


def _height(panels: Sequence[Panel]) -> int:
    if len(panels) == 1:
        return (OVER_PX if panels[0].over else ALONE_PX) + AROUND_PX
    return sum(map(_panel_px, panels)) + AROUND_PX


def _panel_px(panel: Panel) -> int:
    count = sum(len(one.names) for one in panel.lines)
    return next((px for most, px in PANEL_PX if count <= most), PANEL_PX[-1][1])


def _spec(figure: Figure, panels: Sequence[Panel], span: Span) -> Spec:
    """Return data and layout of panels that share their horizontal axis."""
    names = Names.of(panels)
    drawn = [drawn_panel(panel, number, names, span) for number, panel in enumerate(panels)]
    over = panels[0].over
    if over is not None:
        through = list(_through(figure, panels[0], over)) if over.joined else []
        found = spec.stacked(drawn, _quantity_axis(over), through)
        found["layout"] |= {"hovermode": "closest"}
        return _with_room(found, names, through, panels)
    timed = axis_of(panels[0]) == "t"
    axis = spec.time_axis if timed else spec.row_axis
    places = ((place_of(panels[0], at), words) for at, words in figure.instants.items())
    through = [instant(at, words, span.start, span.end) for at, words in places]
    found = spec.stacked(drawn, axis(span.start, span.end), through)
    if any(one.stacked for panel in panels for one in panel.lines):  # the parts of all sums are too many
        found["layout"]["hoversubplots"] = "overlaying"
    return _with_room(found, names, through, panels)


def _with_room(found: Spec, names: Names, through: Sequence[Spec], panels: Sequence[Panel]) -> Spec:
    """Return a figure with its legend above the words at the head of lines through it."""
    if through and names.first:
        found["layout"]["legend"] |= {"y": 1.0 + WORDS_PX / (_height(panels) - AROUND_PX)}
    return found


def _through(figure: Figure, panel: Panel, over: Over) -> Iterator[Spec]:
    """Yield a line through the panels at each row that a figure over a quantity marks."""
    start, end = float(np.nanmin(over.values[:])), float(np.nanmax(over.values[:]))
    for row, words in figure.instants.items():
        yield instant(place_of(panel, row), words, min(start, 0.0), end)


def _quantity_axis(over: Over) -> Spec:
    least = np.nanmin(over.values[:], initial=np.inf)
    look = {"rangemode": "tozero" if least >= 0.0 else "normal"}
    return spec.axis(f"{label(over.title)} [{label(over.unit) or '-'}]") | look
