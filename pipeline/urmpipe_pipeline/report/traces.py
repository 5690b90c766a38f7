"""What stands on a time axis: lines, marks, tolerances and shaded stretches, as plotly.js draws them."""

from __future__ import annotations

import html
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.decimate import POINTS, decimate
from urmpipe_pipeline.report.spec import BAND, FAULT, INK, MUTED, Spec, typed

DASHES = ("solid", "dash", "dot", "dashdot")
"""Tells the ninth joint from the first: colours repeat, dashes do not."""

DIGITS = 4
"""Digits after the point of a value under the pointer, as many as the tables have."""

SMALL = 1e-3
"""Values below this are told in exponent form, as in the tables."""

EXPONENT = ".3e"
"""Exponent form with four digits."""

NEAR = 1 / 200
"""Stretches of time nearer to each other than this share of the whole are shaded as one."""

THINNEST = 1 / 1000
"""What is shaded is at least this share of the whole wide, so that a single sample is seen."""


def label(text: str) -> str:
    """Return a text from a file so that plotly.js, which reads HTML, draws it letter by letter."""
    return html.escape(text, quote=False)


def line(
    t: FloatArray,
    values: FloatArray,
    name: str,
    colour: str,
    unit: str,
    *,
    digits: int = DIGITS,
    points: int = POINTS,
    **more: Any,
) -> Spec:
    """Return a line over time, decimated.

    Args:
        t: Times in [s], shape (n,).
        values: In `unit`, shape (n,).
        name: What the legend and the pointer call it.
        colour: As CSS writes it.
        unit: Unit of the values; empty without one.
        digits: Digits after the point under the pointer.
        points: How many of its samples may stay.
        **more: Further settings of the trace.
    """
    kept = decimate(values, points, t)
    drawn = values[kept]
    alone = np.count_nonzero(np.isfinite(drawn)) == 1  # a line through one point is nothing to see
    settings = {"line": stroke(colour), "mode": "lines+markers" if alone else "lines"} | more
    return {
        "type": "scatter",
        "name": label(name),
        "x": typed(t[kept], "f8"),
        "y": typed(drawn, precision(drawn, digits)),
        "hovertemplate": f"%{{y:{told(drawn, digits)}}} {unit}".rstrip(),
        "showlegend": False,
    } | settings


def told(values: FloatArray, digits: int = DIGITS) -> str:
    """Return how values are written under the pointer: as the tables write the largest of them.

    Args:
        values: In the unit of the figure, shape (n,).
        digits: Digits after the point.
    """
    largest = _largest(values)
    return EXPONENT if 0.0 < largest < SMALL else f".{digits}f"


def precision(values: FloatArray, digits: int = DIGITS) -> Literal["f4", "f8"]:
    """Return "f4" if single precision tells the same digits, else "f8".

    A tenth of the last digit may be lost, but the least and the largest value are told exactly as they are:
    they also stand in tables.

    Args:
        values: In the unit of the figure, shape (n,).
        digits: Digits after the point under the pointer.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return "f4"
    form = told(known, digits)
    with np.errstate(over="ignore"):  # what single precision cannot hold differs from itself
        single = known.astype(np.float32).astype(np.float64)
    if form != EXPONENT and np.max(np.abs(single - known)) > 0.1 * 10.0**-digits:
        return "f8"
    ends = (int(np.argmin(known)), int(np.argmax(known)))
    return "f4" if all(f"{single[end]:{form}}" == f"{known[end]:{form}}" for end in ends) else "f8"


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
        "y": typed(np.asarray(values), "f8"),
        "marker": {"color": colour, "size": 10, "symbol": symbols, "line": {"color": "#ffffff", "width": 1}},
        "cliponaxis": False,
        "hoverinfo": "skip",
        "showlegend": False,
    } | more


def level(value: float, text: str = "", *, above: bool = False) -> Spec:
    """Return a dashed line at one value, as wide as the plot, with a word at its end, below it or above."""
    ends = {"xref": "x domain", "x0": 0, "x1": 1, "y0": value, "y1": value}
    word: Spec = {"text": text, "textposition": "end", "font": {"color": MUTED, "size": 10}}
    word["yanchor"] = "bottom" if above else "top"
    return {"type": "line", "line": {"color": INK, "width": 1, "dash": "dash"}, "label": word} | ends


def band(low: float, high: float) -> Spec:
    """Return a tinted band between two values, behind the lines."""
    ends = {"xref": "x domain", "x0": 0, "x1": 1, "y0": low, "y1": high}
    return {"type": "rect", "fillcolor": BAND, "line": {"width": 0}, "layer": "below"} | ends


def shaded(t: FloatArray, where: NDArray[np.bool_], duration: float, colour: str = FAULT) -> list[Spec]:
    """Return the stretches of time in which something holds, tinted over the height of their panel.

    Args:
        t: Times in [s], shape (n,).
        where: Whether it holds, shape (n,).
        duration: Of the time axis in [s]; what is nearer than a two-hundredth of it is drawn as one.
        colour: As CSS writes it.
    """
    at = t[where]
    if not len(at):
        return []
    apart = np.flatnonzero(np.diff(at) > NEAR * duration)
    starts, ends = at[np.append(0, apart + 1)], at[np.append(apart, len(at) - 1)]
    wider = np.maximum(THINNEST * duration - (ends - starts), 0.0) / 2.0
    look = {"type": "rect", "fillcolor": colour, "opacity": 0.13, "line": {"width": 0}, "layer": "below"}
    height = {"xref": "x", "yref": " domain", "y0": 0, "y1": 1}
    spans = zip((starts - wider).tolist(), (ends + wider).tolist(), strict=True)
    return [look | height | {"x0": start, "x1": end} for start, end in spans]


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


def _largest(values: FloatArray) -> float:
    """Return the largest absolute value; 0 where there is none."""
    known = values[np.isfinite(values)]
    return float(np.max(np.abs(known))) if len(known) else 0.0
