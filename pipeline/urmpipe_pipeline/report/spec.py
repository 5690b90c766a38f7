"""Plotly figures as plain dicts: typed arrays, axes, stacked panels, one look for all."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

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

DARK = {
    INK: "#e3e8eb",
    MUTED: "#a5b1b9",
    GRID: "#2a333a",
    FRAME: "#4a5760",
    WASH: "#1c242a",
    FAULT: "#ff8a65",
    BAND: "rgba(88, 174, 230, 0.14)",
    "#ffffff": "#12181c",
}
"""The same colours, on white, for who reads on a dark ground; what is drawn of data keeps its colour."""

MANY_ROWS = 10
"""With fewer rows each of them has its number at the axis."""

MARGIN = {"l": 64, "r": 12, "t": 24, "b": 48}


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of the page.

    Attributes:
        title: Its heading.
        caption: What is drawn and what to look for, one or two sentences.
        alt: What it shows, for who does not see it.
        spec: data and layout for plotly.js.
        height: In [px].
        space: True for a scene in 3D.
        over: What its horizontal axis measures: figures of one part that share it move together.
        folded: Whether it is closed until someone opens it.
    """

    title: str
    caption: str
    alt: str
    spec: Spec
    height: int
    space: bool = False
    over: str = "t"
    folded: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """One of some plots that stand on one horizontal axis.

    Attributes:
        title: The quantity and its unit.
        traces: Its lines; the axes are filled in by `stacked`.
        shapes: What stands behind its lines, from `level`, `band` and `shaded`.
        share: Height relative to the others.
        look: Further settings of its vertical axis.
    """

    title: str
    traces: Sequence[Spec]
    shapes: Sequence[Spec] = ()
    share: float = 1.0
    look: Spec = field(default_factory=dict)


def typed(values: NDArray[Any], dtype: Literal["f4", "f8"] = "f4") -> Spec:
    """Return an array in the unit of its axis, shape (n,) or (n, k), as base64 of little-endian floats.

    plotly.js reads that without parsing. Single precision (7 digits) is enough for values that are drawn;
    times take "f8", because a long log would run out of digits.
    """
    with np.errstate(over="ignore"):  # beyond 3e38, which is infinite in single precision, nothing is drawn
        written = np.ascontiguousarray(values, f"<{dtype}")
    data = base64.b64encode(written.tobytes()).decode("ascii")
    spec: Spec = {"dtype": dtype, "bdata": data}
    return spec if values.ndim == 1 else spec | {"shape": ", ".join(map(str, values.shape))}


def stacked(panels: Sequence[Panel], across: Spec, shapes: Sequence[Spec] = ()) -> Spec:
    """Return panels one under the other on a common horizontal axis.

    Args:
        panels: From the top.
        across: That axis, from `time_axis`, `row_axis` or `axis`.
        shapes: Drawn through all of them.
    """
    layout = base_layout() | {"hovermode": "x unified", "hoversubplots": "axis"}
    data: list[Spec] = []
    drawn = list(shapes)
    for number, (panel, domain) in enumerate(zip(panels, _domains(panels), strict=True), start=1):
        suffix = "" if number == 1 else str(number)
        layout[f"yaxis{suffix}"] = axis(panel.title) | {"domain": domain} | panel.look
        data += [trace | {"xaxis": "x", "yaxis": f"y{suffix}"} for trace in panel.traces]
        drawn += [shape | {"yref": f"y{suffix}{shape.get('yref', '')}"} for shape in panel.shapes]
    layout["xaxis"] = across | {"anchor": "y" if len(panels) == 1 else f"y{len(panels)}"}
    layout["shapes"] = drawn
    return {"data": data, "layout": layout}


def time_axis(start: float, end: float) -> Spec:
    """Return an axis of time from `start` to `end`, both in [s]."""
    return axis("t [s]") | {
        "range": [start, end if end > start else start + 1.0],
        "hoverformat": ".6~f",
        "unifiedhovertitle": {"text": "t = %{x} s"},
        "nticks": 10,
    }


def row_axis(start: float, end: float) -> Spec:
    """Return an axis of row numbers from 1, with room for the points at both ends."""
    return axis("row") | {
        "range": [start - 0.5, end + 0.5],
        "unifiedhovertitle": {"text": "row %{x}"},
        "tickformat": "d",
        **({"dtick": 1} if end - start < MANY_ROWS else {"nticks": 10}),
    }


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
