"""Figures of a presentation as plotly.js draws them: panels one below the other on a common axis."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.display_unit import display_unit
from urmpipe_pipeline.joint_log import seconds
from urmpipe_pipeline.presentation.figure import Figure, Line, Mark, Over, Panel, Shape
from urmpipe_pipeline.report import spec
from urmpipe_pipeline.report.spec import MUTED, Spec, typed
from urmpipe_pipeline.report.traces import (
    DASHES,
    band,
    instant,
    label,
    level,
    line,
    marks,
    pointer_digits,
    points_for,
    precision,
    shaded,
    stroke,
    told,
)

ALONE_PX, OVER_PX = 236, 300
"""Height of the only panel of a figure, and of one over a quantity."""

AROUND_PX = 64
"""Height of what stands above and below them: legend and axis."""

SMALL_PX = 400
"""Height of a figure at most that stands beside another one."""

PANEL_PX = ((1, 112), (4, 150), (8, 220))
"""Height of one panel among some, by the number of lines that it has at most."""

LEGEND_Y = 1.025
"""Where the legend begins, in heights of the plot: above the words at the head of a line through it."""

LOW = 3.0
"""Largest values above so many limits leave no room for words between the limit and 0."""

DOTS = 1500
"""Points of a cloud: a browser draws no more of them with ease."""

MARKED = 1000
"""Marks of a panel at most: a browser draws no more of them with ease."""

DEPTH = 1000.0
"""So far below the least of the lines' largest values a logarithmic axis reaches."""

SYMBOLS: Mapping[Shape, str] = {
    "up": "triangle-up",
    "down": "triangle-down",
    "cross": "x",
    "diamond": "diamond",
}
"""The shapes of marks in plotly.js's words."""


@dataclass(frozen=True, slots=True)
class Span:
    """From where to where a horizontal axis goes: in [s], or in rows."""

    start: float
    end: float

    @property
    def length(self) -> float:
        """How long it is."""
        return self.end - self.start


def span_of(figures: Iterable[Figure]) -> Span:
    """Return the time from the first to the last row of all panels over time; 0 to 0 without one."""
    return _span(panel for figure in figures for panel in _panels(figure) if _axis_of(panel) == "t")


class Links:
    """Which figures of a result share their time axis: those of a section, and panels with the same times."""

    def __init__(self) -> None:
        """Know no times yet."""
        self._known: list[tuple[IntArray, str]] = []

    def of(self, figures: Iterable[Figure], ident: str) -> str:
        """Return what the figures of a section share their time axis by.

        Args:
            figures: Those of the section.
            ident: Its anchor.
        """
        times = [panel.t_ns for one in figures for panel in _panels(one) if panel.t_ns is not None]
        found = next((link for known, link in self._known if any(known is t_ns for t_ns in times)), ident)
        self._known += [(t_ns, found) for t_ns in times]
        return found


def drawn_figures(figure: Figure, times: Span) -> Iterator[spec.Figure]:
    """Yield a figure, one for each kind of horizontal axis that its panels have.

    Args:
        figure: What is drawn.
        times: From where to where axes of time go, the same for all figures that stand together.
    """
    groups = [(over, list(panels)) for over, panels in groupby(_panels(figure), _axis_of)]
    for over, panels in groups:
        span = times if over == "t" else _span(panels)
        yield spec.Figure(
            figure.title if over == groups[0][0] else f"{figure.title} over {over}",
            f"{figure.caption}{_left_out(panels)}",
            figure.alt,
            _spec(figure, panels, span),
            _height(panels),
            over=over,
        )


def shown_unit(panel: Panel) -> tuple[str, float]:
    """Return the unit that a panel is drawn in, and how many of it one of its own is."""
    if panel.small and panel.unit in text.SHOWN:
        return text.SHOWN[panel.unit]
    unit, factor = display_unit(panel.unit, panel.display_unit)
    return unit.replace("/s2", "/s²"), factor


def columns_of(line_: Line) -> FloatArray:
    """Return the values of a line as columns, shape (n, k)."""
    values = np.asarray(line_.values[:], dtype=np.float64)
    return values if values.ndim == 2 else values[:, np.newaxis]


def _panels(figure: Figure) -> Iterator[Panel]:
    return (panel for view in figure.views for panel in view.panels)


def _axis_of(panel: Panel) -> str:
    """Return what the horizontal axis of a panel measures."""
    if panel.over is not None:
        return panel.over.title
    timed = panel.t_ns is not None or any(one.t_ns is not None for one in panel.lines)
    return "t" if timed else "row"


def _across(panel: Panel, one: Line) -> FloatArray:
    """Return the times of a line in [s] or its row numbers from 1, shape (n,)."""
    t_ns = _times(panel, one)
    return np.arange(1.0, len(one.values) + 1.0) if t_ns is None else seconds(t_ns[:])


def _times(panel: Panel, one: Line) -> IntArray | None:
    return panel.t_ns if one.t_ns is None else one.t_ns


def _span(panels: Iterable[Panel]) -> Span:
    """Return from the first to the last row of all lines."""
    found = [x for panel in panels for one in panel.lines if len(x := _across(panel, one))]
    ends = [(float(x[0]), float(x[-1])) for x in found] or [(0.0, 0.0)]
    return Span(min(start for start, _ in ends), max(end for _, end in ends))


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
    names = _Names.of(panels)
    drawn = [_panel(panel, number, names, span) for number, panel in enumerate(panels)]
    over = panels[0].over
    if over is not None:
        found = spec.stacked(drawn, _quantity_axis(over))
        found["layout"] |= {"hovermode": "closest"}
        return found
    timed = _axis_of(panels[0]) == "t"
    across = spec.time_axis if timed else spec.row_axis
    places = ((at / 1e9 if timed else at + 1, words) for at, words in figure.instants.items())
    through = [instant(at, words, span.start, span.end) for at, words in places]
    found = spec.stacked(drawn, across(span.start, span.end), through)
    if through and names.first:
        found["layout"]["legend"] |= {"y": LEGEND_Y}
    return found


def _quantity_axis(over: Over) -> Spec:
    least = np.nanmin(over.values[:], initial=np.inf)
    return spec.axis(f"{label(over.title)} [{label(over.unit) or '-'}]") | {
        "rangemode": "tozero" if least >= 0.0 else "normal"
    }


@dataclass(frozen=True, slots=True)
class _Names:
    """What the legend of a figure calls its lines.

    Attributes:
        first: Number of the first panel in which a line of a name stands beside others.
        often: Names of lines that several panels have.
    """

    first: dict[str, int]
    often: frozenset[str]

    @classmethod
    def of(cls, panels: Sequence[Panel]) -> _Names:
        """Return the names of some panels."""
        each = [[name for one in panel.lines for name in one.names] for panel in panels]
        first: dict[str, int] = {}
        for number, names in enumerate(each):
            for name in names if len(names) > 1 else ():
                first.setdefault(name, number)
        counts = Counter(name for names in each for name in set(names))
        return cls(first, frozenset(name for name, count in counts.items() if count > 1))

    def entry(self, name: str, number: int) -> Spec:
        """Return whether a line in a panel has its entry there, and what else the entry switches."""
        return {"legendgroup": name, "showlegend": self.first[name] == number} if name in self.first else {}


def _panel(panel: Panel, number: int, names: _Names, span: Span) -> spec.Panel:
    unit, factor = shown_unit(panel)
    title = f"{label(panel.title)} [{label(unit) if unit not in ('', '1') else '-'}]"
    columns = [columns_of(one) for one in panel.lines]
    with np.errstate(over="ignore"):
        scaled = [factor * values for values in columns]
    look: Spec = {"rangemode": "normal" if panel.signed else "tozero"}
    if panel.logarithmic:
        look = _logarithmic(panel, scaled, factor)
    elif _is_yes_or_no(panel, columns):
        look = {"range": [-0.1, 1.1], "tickvals": [0, 1]}
    if panel.over is not None:
        return spec.Panel(title, list(_clouds(panel, panel.over, scaled, unit)), (), panel.share, look)
    traces = [*_lines(panel, number, names, scaled), *_peaks(panel, scaled)]
    traces += _marks(panel, factor, names, number)
    return spec.Panel(title, traces, _shapes(panel, columns, span), panel.share, look)


def _lines(panel: Panel, number: int, names: _Names, scaled: Sequence[FloatArray]) -> Iterator[Spec]:
    """Yield every column as a line, or as points where nothing joins the rows."""
    unit = shown_unit(panel)[0]
    seen: Counter[str] = Counter()  # colours repeat, dashes do not
    for one, columns in zip(panel.lines, scaled, strict=True):
        x, t_ns = _across(panel, one), _times(panel, one)
        for name, colour, values in zip(one.names, one.colours, columns.T, strict=True):
            style = stroke(colour, DASHES[1 if one.dashed else seen[colour] % len(DASHES)])
            style |= {"shape": "hv"} if one.steps else {}
            seen[colour] += not one.dashed
            more: Spec = names.entry(name, number) | {"line": style}
            if one.points or t_ns is None:
                more |= {"mode": "markers", "marker": {"color": colour, "size": 7}, "cliponaxis": False}
            trace = line(x, values, name, colour, unit, points=points_for(t_ns), keep=panel.peaks, **more)
            if name in names.often:
                trace["hovertemplate"] += f"<extra>{label(panel.title)} {label(name)}</extra>"
            yield trace


def _is_yes_or_no(panel: Panel, columns: Sequence[FloatArray]) -> bool:
    return all(one.steps for one in panel.lines) and all(
        bool(np.isin(values[np.isfinite(values)], (0.0, 1.0)).all()) for values in columns
    )


def _peaks(panel: Panel, scaled: Sequence[FloatArray]) -> Iterator[Spec]:
    """Yield a diamond at each row that is marked as the largest, on each line that was measured."""
    rows = np.asarray(panel.peaks, dtype=np.int64)
    for one, columns in zip(panel.lines, scaled, strict=True):
        if not len(rows) or one.dashed:
            continue
        x = _across(panel, one)
        for name, colour, values in zip(one.names, one.colours, columns.T, strict=True):
            yield marks(x[rows], values[rows], colour, SYMBOLS["diamond"], name=label(f"largest {name}"))


def _marks(panel: Panel, factor: float, names: _Names, number: int) -> Iterator[Spec]:
    """Yield the marks, those on one line together so that the legend hides them with it."""
    some: dict[tuple[str, str], list[Mark]] = {}
    for one in panel.marks[:MARKED]:
        some.setdefault((one.name, one.colour), []).append(one)
    for (name, colour), items in some.items():
        yield marks(
            np.array([one.t_ns / 1e9 if panel.t_ns is not None else one.t_ns + 1 for one in items]),
            factor * np.array([one.value for one in items]),
            colour,
            [SYMBOLS[one.shape] for one in items],
            name=label(f"{name}, marked"),
            text=[label(one.words) for one in items],
            hoverinfo="text",
            hovertemplate="%{text}<extra></extra>",
            **(names.entry(name, number) | {"showlegend": False}),
        )


def _shapes(panel: Panel, columns: Sequence[FloatArray], span: Span) -> list[Spec]:
    """Return the limit as a band between dashed lines, and what is tinted: out of it, or doubtful."""
    found: list[Spec] = []
    if panel.tinted is not None:
        found += shaded(_across(panel, panel.lines[0]), np.asarray(panel.tinted[:]), span.length, MUTED)
    if panel.limit is None:
        return found
    unit, factor = shown_unit(panel)
    high = factor * panel.limit
    words = f"{'±' if panel.signed else ''}{high:.6g} {label(unit)}".rstrip()
    if panel.logarithmic:  # there is no band around 0, and no low end
        return [*found, level(high, words)]
    largest = 0.0
    outside: list[tuple[FloatArray, NDArray[np.bool_]]] = []
    for one, values in zip(panel.lines, columns, strict=True):
        if not one.dashed:
            largest = max(largest, float(np.nanmax(np.abs(values), initial=0.0)))
            outside.append((_across(panel, one), np.any(np.abs(values) > panel.limit, axis=1)))
    found += _tinted(outside, span)
    if not panel.signed:
        return [band(0.0, high), *found, level(high, words, above=largest > LOW * panel.limit)]
    return [band(-high, high), *found, level(high, words), level(-high)]


def _tinted(outside: Sequence[tuple[FloatArray, NDArray[np.bool_]]], span: Span) -> list[Spec]:
    """Return the stretches in which any line is out of the limit."""
    if not outside:
        return []
    at = np.concatenate([x[where] for x, where in outside])
    return shaded(np.unique(at), np.ones(len(np.unique(at)), dtype=np.bool_), span.length)


def _logarithmic(panel: Panel, scaled: Sequence[FloatArray], factor: float) -> Spec:
    """Return a logarithmic axis that reaches the limit and far below the least of the largest values."""
    most = np.concatenate([np.nanmax(np.abs(values), axis=0, initial=0.0) for values in scaled])
    most = most[most > 0.0] if (most > 0.0).any() else np.ones(1)
    top = max(float(most.max()), (panel.limit or 0.0) * factor)
    return {"type": "log", "range": np.log10([most.min() / DEPTH, 1.5 * top]).tolist()}


def _clouds(panel: Panel, over: Over, scaled: Sequence[FloatArray], unit: str) -> Iterator[Spec]:
    """Yield every column over a quantity, as points spread evenly over the rows; no peak is missing."""
    across = np.asarray(over.values[:], dtype=np.float64)
    timed = "row %{customdata}" if panel.t_ns is None else "t %{customdata:.6~f} s"
    for one, columns in zip(panel.lines, scaled, strict=True):
        t = _across(panel, one)
        for name, colour, values in zip(one.names, one.colours, columns.T, strict=True):
            known = np.flatnonzero(np.isfinite(across) & np.isfinite(values))
            evenly = np.linspace(0, len(known) - 1, min(DOTS, len(known))).astype(np.int64)
            kept = np.union1d(known[np.unique(evenly)], np.intersect1d(panel.peaks, known)).astype(np.int64)
            x, y = across[kept], values[kept]
            digits = [pointer_digits(*pair) for pair in ((over.unit, x), (unit, y))]
            yield {
                "type": "scatter",
                "mode": "markers",
                "name": label(name),
                "x": typed(x, precision(x, digits[0])),
                "y": typed(y, precision(y, digits[1])),
                "customdata": typed(t[kept], "f8"),
                "marker": {"color": colour, "size": 5, "opacity": 0.55, "line": {"width": 0}},
                "hovertemplate": f"{label(over.title)} %{{x:{told(x, digits[0])}}} {label(over.unit)}<br>"
                f"{label(name)} %{{y:{told(y, digits[1])}}} {label(unit)}<br>{timed}<extra></extra>",
                "showlegend": False,
            }
