"""One panel of a figure: lines, points, areas, marks, the limit, what is tinted."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullLocator

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.figures.letters import drawable
from urmpipe_pipeline.figures.sheet import BAND, FAULT, INK, MUTED
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
    stretches,
)
from urmpipe_pipeline.presentation.figure import Mark, Over, Panel, Shape
from urmpipe_pipeline.presentation.layout import TwoScales, two_scales
from urmpipe_pipeline.presentation.scene import BoolArray

Entries: TypeAlias = dict[str, Artist]
"""What stands in a legend: each artist by its words."""

DASHES = ("-", "--", ":", "-.")
"""Tells the ninth joint from the first: colours repeat, dashes do not."""

MARKERS: Mapping[Shape, str] = {"up": "^", "down": "v", "cross": "x", "diamond": "D"}
"""The shapes of marks in matplotlib's words."""

WIDE = 1.8
"""Of a line that decides, in widths of the others."""

FEW = 100
"""Rows of a line over a quantity that are drawn as points, too, at most."""

AREA, TINT, CLOUD = 0.6, 0.13, 0.55
"""Opacity of the parts of a sum, of tinted rows, of the points of a cloud."""

APART = 0.15
"""Between two ticks of an axis of two scales at least, in heights of the axis."""

LETTER = 0.62
"""Width of a letter on average, in sizes of the font."""


def draw_panel(axes: Axes, panel: Panel, span: Span, *, legend: bool = True) -> Entries:
    """Draw a panel, and return what a legend says of it: of lines only where they are several.

    Args:
        axes: Where.
        panel: What.
        span: From where to where the horizontal axis of a panel over time or rows goes.
        legend: Whether a legend names the lines.
    """
    unit, factor = shown_unit(panel)
    curves = list(curves_of(panel, factor))
    entries: Entries = {}
    _scale(axes, panel, curves, factor)
    if panel.over is None:
        _tint(axes, panel, curves, span)
        entries |= _areas(axes, [one for one in curves if one.line.stacked])
        entries |= _lines(axes, panel, [one for one in curves if not one.line.stacked])
        _peaks(axes, panel, curves)
    elif panel.over.joined:
        entries |= _joined(axes, curves, panel.over)
    else:
        _clouds(axes, curves, panel.over, panel.peaks)
    _marks(axes, panel, factor)
    told = entries if legend and len(curves) > 1 else {}
    if not panel.signed and not panel.logarithmic:
        axes.set_ylim(bottom=0.0)
    return told | _limit(axes, panel, unit, factor)


def in_unit(title: str, unit: str) -> str:
    """Return the words at an axis: its quantity and the unit, where it has one."""
    return drawable(title if unit in ("", "1") else f"{title} [{unit}]")


def wrapped(words: str, letters: int) -> str:
    """Return words on lines of at most so many letters; a unit stays with the word before it."""
    together = words.replace(" [", "\N{NO-BREAK SPACE}[")
    return "\n".join(textwrap.wrap(together, max(letters, 4))).replace("\N{NO-BREAK SPACE}", " ")


def _scale(axes: Axes, panel: Panel, curves: Sequence[Curve], factor: float) -> None:
    """Choose the vertical axis: yes or no, logarithmic, of two scales, or linear."""
    limit = factor * (panel.limit or 0.0)
    if panel.logarithmic:
        joined = panel.over is not None and panel.over.joined
        axes.set_yscale("log")
        axes.set_ylim(*logarithmic_ends(curves, limit, all_values=joined))
        axes.yaxis.set_major_locator(LogLocator(numticks=6))
        axes.yaxis.set_major_formatter(FuncFormatter(_plain))
        axes.yaxis.set_minor_locator(NullLocator())
    elif is_switch(curves):
        axes.set_ylim(-0.15, 1.15)
        axes.yaxis.set_major_locator(FixedLocator([0, 1]))
    elif (scales := two_scales(panel)) is not None:
        shown = replace(scales, inner=factor * scales.inner, top=factor * scales.top)
        axes.set_yscale("function", functions=(shown.height, shown.value))
        axes.yaxis.set_major_locator(FixedLocator(_ticks(shown, signed=panel.signed)))
        axes.yaxis.set_major_formatter(FuncFormatter(_plain))
    else:
        axes.yaxis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 2.5, 5, 10], min_n_ticks=3))


def _ticks(scales: TwoScales, *, signed: bool) -> list[float]:
    """Return the ticks of an axis of two scales that have room for their words, the limit first."""
    zero, inner, outer = scales.ticks()
    apart = float(np.diff(scales.height(np.array([inner, outer])))[0])
    limit = outer if scales.close else inner
    found = [inner, outer] if apart >= APART * (1 + signed) else [limit]
    return sorted([zero, *found, *(-one for one in found if signed)])


def _plain(value: float, _: float | None = None) -> str:
    """Return a number at a tick without mathematical markup, which a name with a $ would be read as, too."""
    return f"{value + 0.0:.6g}".replace("-", "−")


def _lines(axes: Axes, panel: Panel, curves: Sequence[Curve]) -> Entries:
    """Draw each curve as a line, or as points where nothing joins the rows."""
    seen: Counter[str] = Counter()
    found: Entries = {}
    for one in curves:
        dash = DASHES[1 if one.line.dashed else seen[one.colour] % len(DASHES)]
        seen[one.colour] += not one.line.dashed
        kept = np.union1d(decimate(one.values, choose_point_count(one.t_ns), one.x), _rows(panel.peaks))
        alone = np.count_nonzero(np.isfinite(one.values)) == 1  # a line through one point is nothing to see
        points = one.line.points or one.t_ns is None
        (line,) = axes.plot(
            one.x[kept],
            one.values[kept],
            color=one.colour,
            linestyle="none" if points else dash,
            marker="o" if points or alone else "none",
            drawstyle="steps-post" if one.line.steps else "default",
            zorder=2.5 if one.line.dashed else 2.0,  # what was asked for shows on what follows it
            clip_on=not points,
        )
        found[drawable(one.name)] = line
    return found


def _areas(axes: Axes, curves: Sequence[Curve]) -> Entries:
    """Draw the parts of a sum as areas from 0 upwards and from 0 downwards, at the same rows in all."""
    found: Entries = {}
    if not curves:
        return found
    values = np.column_stack([one.values for one in curves])
    kept = decimate(values, choose_point_count(curves[0].t_ns), curves[0].x)
    shown = np.nan_to_num(values[kept])
    for sign in (np.fmax, np.fmin):
        parts = sign(shown, 0.0)
        ends = np.cumsum(parts, axis=1)
        for one, end, part in zip(curves, ends.T, parts.T, strict=True):
            area = axes.fill_between(
                one.x[kept], end - part, end, color=one.colour, alpha=AREA, linewidth=0, zorder=1.9
            )
            found.setdefault(drawable(one.name), area)
    return found


def _joined(axes: Axes, curves: Sequence[Curve], over: Over) -> Entries:
    """Draw each curve over a quantity as a line through its known rows, or as points."""
    quantity = np.asarray(over.values[:], dtype=np.float64)
    found: Entries = {}
    for one in curves:
        known = np.isfinite(one.values)
        few = not one.line.dashed and known.sum() <= FEW
        (line,) = axes.plot(
            quantity[known],
            one.values[known],
            color=one.colour,
            linestyle="none" if one.line.points else DASHES[one.line.dashed],
            marker="o" if one.line.points or few else "none",
        )
        line.set_linewidth(line.get_linewidth() * (WIDE if one.line.strong else 1.0))
        found[drawable(one.name)] = line
    return found


def _clouds(axes: Axes, curves: Sequence[Curve], over: Over, peaks: Sequence[int]) -> None:
    """Draw each curve over a quantity as points spread evenly over the rows; no peak is missing."""
    for one in curves:
        kept = cloud_rows(one, over, peaks)
        style = {"color": one.colour, "alpha": CLOUD, "markeredgewidth": 0.0, "markersize": 3.0}
        axes.plot(over.values[:][kept], one.values[kept], "o", **style)  # type: ignore[arg-type]


def _peaks(axes: Axes, panel: Panel, curves: Sequence[Curve]) -> None:
    """Mark the rows that are the largest on each curve that was measured."""
    rows = _rows(panel.peaks)
    for one in curves:
        if len(rows) and not one.line.dashed:
            _points(axes, one.x[rows], one.values[rows], one.colour, "diamond")


def _marks(axes: Axes, panel: Panel, factor: float) -> None:
    """Draw the marks, those of one shape and colour together."""
    some: dict[tuple[Shape, str], list[Mark]] = {}
    for one in panel.marks:
        some.setdefault((one.shape, one.colour), []).append(one)
    for (shape, colour), items in some.items():
        at = np.array([place_of(panel, one.t_ns) for one in items])
        _points(axes, at, factor * np.array([one.value for one in items]), colour, shape)


def _points(axes: Axes, x: FloatArray, y: FloatArray, colour: str, shape: Shape) -> None:
    """Draw points above the lines, which stand out by a white edge, or a cross, which has none."""
    edge = colour if shape == "cross" else "white"
    axes.plot(x, y, MARKERS[shape], color=colour, markeredgecolor=edge, clip_on=False, zorder=3)


def _tint(axes: Axes, panel: Panel, curves: Sequence[Curve], span: Span) -> None:
    """Tint the rows that are doubtful, and those out of the limit."""
    if panel.tinted is not None:
        _spans(axes, across(panel, panel.lines[0]), np.asarray(panel.tinted[:]), span, MUTED)
    if not panel.logarithmic:
        out = out_of_limit(panel, curves)
        _spans(axes, out, np.ones(len(out), dtype=np.bool_), span, FAULT)


def _spans(axes: Axes, x: FloatArray, where: BoolArray, span: Span, colour: str) -> None:
    for start, end in stretches(x, where, span.length):
        axes.axvspan(start, end, color=colour, alpha=TINT, linewidth=0, zorder=0.3)


def _limit(axes: Axes, panel: Panel, unit: str, factor: float) -> Entries:
    """Draw the limit as a band between dashed lines, or as the upper one alone where there is no low end."""
    if panel.limit is None:
        return {}
    high = factor * panel.limit
    above = panel.logarithmic or panel.over is not None
    stroke: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 3))}
    stroke["linewidth"] = axes.spines["left"].get_linewidth()
    for value in (-high, high) if panel.signed and not above else (high,):
        line = axes.axhline(value, zorder=1.8, **stroke)
    sign = "±" if panel.signed and not above else ""
    words = f"{panel.limit_name} {sign}{_plain(high)} {unit}".rstrip()
    if above:
        return {drawable(words): line}
    axes.axhspan(-high if panel.signed else 0.0, high, color=BAND, linewidth=0, zorder=0.4)
    scales = two_scales(panel)
    beyond = "" if scales is None else ", on a smaller scale" if scales.close else ", smaller scale beyond"
    patch = Patch(facecolor=BAND, edgecolor=INK, linestyle=(0, (2, 1.5)), linewidth=line.get_linewidth())
    return {drawable(f"{words}{beyond}"): patch}


def _rows(rows: Sequence[int]) -> IntArray:
    return np.asarray(rows, dtype=np.int64)
