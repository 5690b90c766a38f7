"""Plotly figures as plain dicts: typed arrays, stacked time axes, one look for all."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_pipeline.decimate import decimate
from urmpipe_pipeline.joint_log import FloatArray

Spec: TypeAlias = dict[str, Any]
"""A figure, a trace or a part of a layout, in the words of plotly.js."""

INK = "#1b2329"
MUTED = "#5b6770"
GRID = "#e4e8eb"
FRAME = "#c3cad0"
WASH = "#f5f7f8"
FAULT = "#b32d00"
"""What is out of tolerance: a dark vermilion, legible on white."""

BAND = "rgba(0, 114, 178, 0.06)"
"""The inside of a tolerance."""

MARGIN = {"l": 64, "r": 12, "t": 24, "b": 48}

DASHES = ("solid", "dash", "dot", "dashdot")
"""Tells the ninth joint from the first: colours repeat, dashes do not."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the page.

    Attributes:
        title: Its heading.
        caption: What is drawn and what to look for, one or two sentences.
        alt: What it shows, for who does not see it.
        spec: data and layout for plotly.js.
        height: In [px].
        space: True for a scene in 3D, false for quantities over the run's time.
    """

    title: str
    caption: str
    alt: str
    spec: Spec
    height: int
    space: bool = False
    kind: Literal["figure"] = "figure"


@dataclass(frozen=True, slots=True)
class Panel:
    """One of some plots that stand on one time axis.

    Attributes:
        title: The quantity and its unit.
        traces: Its lines; the axes are filled in by `stacked`.
        shapes: Lines and bands at values of the quantity, from `level` and `band`.
        share: Height relative to the others.
        from_zero: True for a size, whose axis begins at 0.
    """

    title: str
    traces: Sequence[Spec]
    shapes: Sequence[Spec] = ()
    share: float = 1.0
    from_zero: bool = False


def typed(values: NDArray[Any], dtype: Literal["f4", "f8"] = "f4") -> Spec:
    """Return an array as plotly.js reads it without parsing: base64 of little-endian floats.

    Single precision (7 digits) is enough for values that are drawn; times take "f8", because a long
    log would run out of digits.

    Args:
        values: Shape (n,) or (n, k).
        dtype: f4 or f8.
    """
    data = base64.b64encode(np.ascontiguousarray(values, f"<{dtype}").tobytes()).decode("ascii")
    spec: Spec = {"dtype": dtype, "bdata": data}
    return spec if values.ndim == 1 else spec | {"shape": ", ".join(map(str, values.shape))}


def label(text: str) -> str:
    """Return a text from a file so that plotly.js, which reads HTML, draws it letter by letter."""
    return html.escape(text, quote=False)


def line(t: FloatArray, values: FloatArray, name: str, colour: str, unit: str, **more: Any) -> Spec:
    """Return a line over time, decimated.

    Args:
        t: Times in [s], shape (n,).
        values: Shape (n,), in `unit`.
        name: What the legend and the pointer call it.
        colour: As CSS writes it.
        unit: Unit of the values.
        **more: Further settings of the trace.
    """
    kept = decimate(values)
    settings = {"line": stroke(colour)} | more
    return {
        "type": "scatter",
        "mode": "lines",
        "name": label(name),
        "x": typed(t[kept], "f8"),
        "y": typed(values[kept]),
        "hovertemplate": f"%{{y:.4f}} {unit}",
        "showlegend": False,
    } | settings


def stroke(colour: str, dash: str = "solid") -> Spec:
    """Return how a line is drawn: through every point, for `decimate` has chosen them already."""
    return {"color": colour, "width": 1.4, "dash": dash, "simplify": False}


def marks(t: FloatArray, values: FloatArray, colour: str, symbols: str | list[str], **more: Any) -> Spec:
    """Return points over time, every one of them.

    Args:
        t: Times in [s], shape (n,).
        values: In the unit of their panel, shape (n,).
        colour: As CSS writes it.
        symbols: One for all, or one each, in plotly.js's words.
        **more: Further settings of the trace.
    """
    return {
        "type": "scatter",
        "mode": "markers",
        "x": typed(np.asarray(t), "f8"),
        "y": typed(np.asarray(values)),
        "marker": {"color": colour, "size": 10, "symbol": symbols, "line": {"color": "#ffffff", "width": 1}},
        "cliponaxis": False,
        "hoverinfo": "skip",
        "showlegend": False,
    } | more


def level(value: float, text: str = "") -> Spec:
    """Return a dashed line at one value, as wide as the plot, with a word at its end."""
    ends = {"xref": "x domain", "x0": 0, "x1": 1, "y0": value, "y1": value}
    word = {"text": text, "textposition": "end", "yanchor": "top", "font": {"color": MUTED, "size": 10}}
    return {"type": "line", "line": {"color": INK, "width": 1, "dash": "dash"}, "label": word} | ends


def band(low: float, high: float) -> Spec:
    """Return a tinted band between two values, behind the lines."""
    ends = {"xref": "x domain", "x0": 0, "x1": 1, "y0": low, "y1": high}
    return {"type": "rect", "fillcolor": BAND, "line": {"width": 0}, "layer": "below"} | ends


def instant(t: float, text: str, duration: float) -> Spec:
    """Return a line at one time through all panels, with a word at its head that stays inside."""
    ends = {"xref": "x", "x0": t, "x1": t, "yref": "paper", "y0": 0, "y1": 1}
    side = "left" if t < 0.1 * duration else "right" if t > 0.9 * duration else "center"
    head = {"text": text, "textposition": "end", "textangle": 0, "xanchor": side}
    font = {"color": FAULT, "size": 11}
    return {
        "type": "line",
        "line": {"color": FAULT, "width": 1, "dash": "dot"},
        "label": head | {"font": font},
    } | ends


def stacked(panels: Sequence[Panel], duration: float, shapes: Sequence[Spec] = ()) -> Spec:
    """Return panels one under the other on a common time axis.

    Args:
        panels: From the top.
        duration: Where the time axis ends, in [s].
        shapes: Drawn through all of them.
    """
    layout = base_layout() | {"hovermode": "x unified", "hoversubplots": "axis"}
    data: list[Spec] = []
    drawn = list(shapes)
    for number, (panel, domain) in enumerate(zip(panels, _domains(panels), strict=True), start=1):
        suffix = "" if number == 1 else str(number)
        layout[f"yaxis{suffix}"] = axis(panel.title) | {
            "domain": domain,
            "rangemode": "tozero" if panel.from_zero else "normal",
        }
        data += [trace | {"xaxis": "x", "yaxis": f"y{suffix}"} for trace in panel.traces]
        drawn += [shape | {"yref": f"y{suffix}"} for shape in panel.shapes]
    bottom = "y" if len(panels) == 1 else f"y{len(panels)}"
    layout["xaxis"] = axis("t [s]") | {
        "anchor": bottom,
        "range": [0.0, duration or 1.0],
        "hoverformat": ".6~f",
        "unifiedhovertitle": {"text": "t = %{x} s"},
        "nticks": 10,
    }
    layout["shapes"] = drawn
    return {"data": data, "layout": layout}


def base_layout() -> Spec:
    """Return what every figure has in common."""
    return {
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": INK},
        "margin": MARGIN,
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hoverlabel": {"namelength": -1, "font": {"size": 12}},
        "legend": {"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom", "itemwidth": 30},
    }


def axis(title: str) -> Spec:
    """Return an axis with its quantity and unit."""
    return {
        "title": {"text": title, "standoff": 6, "font": {"size": 12}},
        "gridcolor": GRID,
        "zerolinecolor": FRAME,
        "linecolor": FRAME,
        "showline": True,
        "ticks": "outside",
        "tickcolor": FRAME,
        "exponentformat": "power",
        "automargin": True,
    }


def space_axis(title: str) -> Spec:
    """Return an axis of a scene with its quantity and unit."""
    return {
        "title": {"text": title, "font": {"size": 12}},
        "showbackground": True,
        "backgroundcolor": WASH,
        "gridcolor": FRAME,
        "zerolinecolor": FRAME,
        "linecolor": FRAME,
        "tickfont": {"size": 11},
        "nticks": 6,
    }


def _domains(panels: Sequence[Panel]) -> list[list[float]]:
    """Return the heights of the panels as shares of the whole, from the top, with gaps between."""
    gap = 0.22 / (len(panels) + 1.0)
    usable = 1.0 - gap * (len(panels) - 1)
    total = sum(panel.share for panel in panels)
    domains = []
    top = 1.0
    for panel in panels:
        height = usable * panel.share / total
        domains.append([round(max(top - height, 0.0), 4), round(top, 4)])
        top -= height + gap
    return domains
