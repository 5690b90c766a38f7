"""One panel of a figure as plotly.js draws it: lines, points, marks, the limit, what is tinted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.presentation.curves import (
    Curve,
    Span,
    across,
    choose_point_count,
    cloud_rows,
    curves_of,
    decimate,
    is_switch,
    logarithmic_ends,
    out_of_limit,
    place_of,
    shown_unit,
)
from urmpipe_pipeline.presentation.figure import Mark, Over, Panel, Shape
from urmpipe_pipeline.presentation.layout import TwoScales, two_scales
from urmpipe_pipeline.presentation.palette import rgb
from urmpipe_pipeline.report import spec
from urmpipe_pipeline.report.spec import MUTED, Spec, typed
from urmpipe_pipeline.report.traces import (
    DASHES,
    band,
    label,
    level,
    line,
    marks,
    pointer_digits,
    precision,
    shaded,
    stroke,
    told,
)

LOW = 3.0
"""Largest values above so many limits leave no room for words between the limit and 0."""

MARKED = 1000
"""Marks of a panel at most: a browser draws no more of them with ease."""

FEW = 100
"""Rows of a line over a quantity that are drawn as points, too, at most."""

WIDTHS = (1.4, 2.8)
"""Of lines over a quantity, and of the one that decides, in pixels."""

AREA = 0.6
"""Opacity of the parts of a sum."""

SYMBOLS: Mapping[Shape, str] = {
    "up": "triangle-up",
    "down": "triangle-down",
    "cross": "x",
    "diamond": "diamond",
}
"""The shapes of marks in plotly.js's words."""


@dataclass(frozen=True, slots=True)
class Names:
    """What the legend of a figure calls its lines.

    Attributes:
        first: Number of the first panel in which a line of a name stands beside others.
        often: Names of lines that several panels have.
    """

    first: dict[str, int]
    often: frozenset[str]

    @classmethod
    def of(cls, panels: Sequence[Panel]) -> Names:
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

    def extra(self, name: str, panel: str) -> str:
        """Return how the pointer tells a line from those of its name in panels of other titles."""
        return f"<extra>{label(panel)} {label(name)}</extra>" if name in self.often else ""


def drawn_panel(panel: Panel, number: int, names: Names, span: Span) -> spec.Panel:
    """Return a panel of a figure, the first of number 0, for `stacked`: its axis spans what it is given."""
    unit, factor = shown_unit(panel)
    curves, scales = list(curves_of(panel, factor)), two_scales(panel)
    title = f"{label(panel.title)} [{label(unit) if unit not in ('', '1') else '-'}]"
    look: Spec = {"rangemode": "normal" if panel.signed else "tozero"}
    if panel.logarithmic:
        joined = panel.over is not None and panel.over.joined
        ends = logarithmic_ends(curves, (panel.limit or 0.0) * factor, all_values=joined)
        look = {"type": "log", "range": np.log10(ends).tolist()}
    elif scales is not None:
        look = _broken(panel, scales, factor)
    elif is_switch(curves):
        look = {"range": [-0.1, 1.1], "tickvals": [0, 1]}  # yes or no
    if panel.over is not None:
        return _over(panel, panel.over, curves, spec.Panel(title, (), (), panel.share, look), names, number)
    traces = [
        *_areas(panel, [one for one in curves if one.line.stacked], number, names, unit),
        *_lines(panel, [one for one in curves if not one.line.stacked], number, names, unit, scales),
        *_peaks(panel, curves, scales),
        *_marks(panel, factor, names, number, scales),
    ]
    shapes = _shapes(panel, curves, span, unit, factor, scales)
    return spec.Panel(title, traces, shapes, panel.share, look)


def _broken(panel: Panel, scales: TwoScales, factor: float) -> Spec:
    """Return an axis of two scales: its ticks tell the values that stand at their heights."""
    sizes = np.array(scales.ticks())
    ticks = np.unique(np.concatenate((-sizes, sizes))) if panel.signed else sizes
    return {
        "range": [-1.05 if panel.signed else 0.0, 1.05],
        "tickvals": scales.height(ticks).tolist(),
        "ticktext": [f"{value:.4g}".replace("-", "−") for value in factor * ticks + 0.0],  # no -0
    }


def _at(curve: Curve, scales: TwoScales | None) -> FloatArray:
    """Return where the values of a curve stand on the vertical axis, shape (n,)."""
    return curve.values if scales is None else scales.height(curve.raw)


def _lines(
    panel: Panel,
    curves: Sequence[Curve],
    number: int,
    names: Names,
    unit: str,
    scales: TwoScales | None,
) -> Iterator[Spec]:
    """Yield each curve as a line, or as points where nothing joins the rows."""
    seen: Counter[str] = Counter()  # colours repeat, dashes do not
    for one in curves:
        style = stroke(one.colour, DASHES[1 if one.line.dashed else seen[one.colour] % len(DASHES)])
        style |= {"shape": "hv"} if one.line.steps else {}
        seen[one.colour] += not one.line.dashed
        more: Spec = names.entry(one.name, number) | {"line": style}
        if one.line.points or one.t_ns is None:
            more |= {"mode": "markers", "marker": {"color": one.colour, "size": 7}, "cliponaxis": False}
        points = choose_point_count(one.t_ns)
        more |= {"points": points, "keep": panel.peaks, "at": _at(one, scales)}
        trace = line(one.x, one.values, one.name, one.colour, unit, **more)
        trace["hovertemplate"] += names.extra(one.name, panel.title)
        yield trace


def _areas(panel: Panel, curves: Sequence[Curve], number: int, names: Names, unit: str) -> Iterator[Spec]:
    """Yield the parts of a sum as areas from 0 upwards and from 0 downwards, at the same rows in all.

    What the pointer tells is the part, not the height of the stack.
    """
    if not curves:
        return
    values = np.column_stack([one.values for one in curves])
    kept = decimate(values, choose_point_count(curves[0].t_ns), curves[0].x)
    for one, column in zip(curves, values[kept].T, strict=True):
        digits = pointer_digits(unit, column)
        area: Spec = {
            "type": "scatter",
            "mode": "lines",
            "name": label(one.name),
            "x": typed(one.x[kept], "f8"),
            "line": {"width": 0, "simplify": False},
            "fillcolor": f"rgba{(*rgb(one.colour), AREA)}",
            "showlegend": False,
            **names.entry(one.name, number),
        }
        hover = f"%{{customdata:{told(column, digits)}}} {label(unit)}".rstrip()
        yield area | {
            "y": typed(np.fmax(column, 0.0)),
            "stackgroup": f"up {number}",
            "customdata": typed(column, precision(column, digits)),
            "hovertemplate": hover + names.extra(one.name, panel.title),
        }
        below = np.fmin(column, 0.0)
        if below.any():
            yield area | {
                "y": typed(below), "stackgroup": f"down {number}", "hoverinfo": "skip", "showlegend": False,
            }  # fmt: skip


def _peaks(panel: Panel, curves: Sequence[Curve], scales: TwoScales | None) -> Iterator[Spec]:
    """Yield a diamond at each row that is marked as the largest, on each curve that was measured."""
    rows = np.asarray(panel.peaks, dtype=np.int64)
    for one in curves:
        if len(rows) and not one.line.dashed:
            name = label(f"largest {one.name}")
            yield marks(one.x[rows], _at(one, scales)[rows], one.colour, SYMBOLS["diamond"], name=name)


def _marks(
    panel: Panel, factor: float, names: Names, number: int, scales: TwoScales | None = None
) -> Iterator[Spec]:
    """Yield the marks, those on one line together so that the legend hides them with it."""
    some: dict[tuple[str, str], list[Mark]] = {}
    for one in panel.marks[:MARKED]:
        some.setdefault((one.name, one.colour), []).append(one)
    for (name, colour), items in some.items():
        values = np.array([one.value for one in items])
        yield marks(
            np.array([place_of(panel, one.t_ns) for one in items]),
            factor * values if scales is None else scales.height(values),
            colour,
            [SYMBOLS[one.shape] for one in items],
            name=label(f"{name}, marked"),
            text=[label(one.words) for one in items],
            hoverinfo="text",
            hovertemplate="%{text}<extra></extra>",
            **(names.entry(name, number) | {"showlegend": False}),
        )


def _shapes(
    panel: Panel,
    curves: Sequence[Curve],
    span: Span,
    unit: str,
    factor: float,
    scales: TwoScales | None,
) -> list[Spec]:
    """Return the limit as a band between dashed lines, and what is tinted: out of it, or doubtful."""
    found: list[Spec] = []
    if panel.tinted is not None:
        found += shaded(across(panel, panel.lines[0]), np.asarray(panel.tinted[:]), span.length, MUTED)
    if panel.limit is None:
        return found
    high = factor * panel.limit
    words = f"{'±' if panel.signed else ''}{high:.6g} {label(unit)}".rstrip()
    if panel.logarithmic:  # there is no band around 0, and no low end
        return [*found, level(high, words)]
    out = out_of_limit(panel, curves)
    found += shaded(out, np.ones(len(out), dtype=np.bool_), span.length)
    high = high if scales is None else float(scales.height(np.array(panel.limit)))
    if panel.signed:
        return [band(-high, high), *found, level(high, words), level(-high)]
    measured = (one for one in curves if not one.line.dashed)
    largest = max((float(np.nanmax(np.abs(one.raw), initial=0.0)) for one in measured), default=0.0)
    return [band(0.0, high), *found, level(high, words, above=largest > LOW * panel.limit)]


def _over(
    panel: Panel, over: Over, curves: Sequence[Curve], empty: spec.Panel, names: Names, number: int
) -> spec.Panel:
    """Return a panel over a quantity: clouds of points, or lines with marks and what is allowed."""
    unit, factor = shown_unit(panel)
    if not over.joined:
        return replace(empty, traces=list(_clouds(curves, over, panel.peaks, unit)))
    traces = [*_joined(curves, over, unit, names, number), *_marks(panel, factor, names, number)]
    if panel.limit is None:
        return replace(empty, traces=traces)
    high = factor * panel.limit
    words = f"{high:.6g} {label(unit)}".rstrip()
    return replace(empty, traces=traces, shapes=[level(high, words, above=True)])


def _joined(curves: Sequence[Curve], over: Over, unit: str, names: Names, number: int) -> Iterator[Spec]:
    """Yield each curve over a quantity as a line through its known rows, or as points."""
    quantity = np.asarray(over.values[:], dtype=np.float64)
    for one in curves:
        known = np.isfinite(one.values)
        x, y = quantity[known], one.values[known]
        digits = [pointer_digits(*pair) for pair in ((over.unit, x), (unit, y))]
        yield {
            "type": "scatter",
            "mode": _mode(one, int(known.sum())),
            "name": label(one.name),
            "x": typed(x, precision(x, digits[0])),
            "y": typed(y, precision(y, digits[1])),
            "line": stroke(one.colour, DASHES[one.line.dashed]) | {"width": WIDTHS[one.line.strong]},
            "marker": {"color": one.colour, "size": 7 if one.line.points else 5},
            "hovertemplate": f"{label(over.title)} %{{x:{told(x, digits[0])}}} {label(over.unit)}<br>"
            f"{label(one.name)} %{{y:{told(y, digits[1])}}} {label(unit)}<extra></extra>",
            "showlegend": False,
        } | names.entry(one.name, number)


def _mode(curve: Curve, rows: int) -> str:
    """Return whether a curve over a quantity is points, or a line, its rows as points if they are few."""
    if curve.line.points:
        return "markers"
    return "lines" if curve.line.dashed or rows > FEW else "lines+markers"


def _clouds(curves: Sequence[Curve], over: Over, peaks: Sequence[int], unit: str) -> Iterator[Spec]:
    """Yield each curve over a quantity, as points spread evenly over the rows; no peak is missing."""
    quantity = np.asarray(over.values[:], dtype=np.float64)
    for one in curves:
        kept = cloud_rows(one, over, peaks)
        x, y = quantity[kept], one.values[kept]
        digits = [pointer_digits(*pair) for pair in ((over.unit, x), (unit, y))]
        row = "row %{customdata}" if one.t_ns is None else "t %{customdata:.6~f} s"
        yield {
            "type": "scatter",
            "mode": "markers",
            "name": label(one.name),
            "x": typed(x, precision(x, digits[0])),
            "y": typed(y, precision(y, digits[1])),
            "customdata": typed(one.x[kept], "f8"),
            "marker": {"color": one.colour, "size": 5, "opacity": 0.55, "line": {"width": 0}},
            "hovertemplate": f"{label(over.title)} %{{x:{told(x, digits[0])}}} {label(over.unit)}<br>"
            f"{label(one.name)} %{{y:{told(y, digits[1])}}} {label(unit)}<br>{row}<extra></extra>",
            "showlegend": False,
        }
