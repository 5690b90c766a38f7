"""What stands on a time axis: lines, marks, tolerances and shaded stretches, as plotly.js draws them."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import escape_control_characters
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.curves import MAX_POINTS, decimate, stretches
from urmpipe_pipeline.report.spec import BAND, FAULT, INK, MUTED, Spec, typed
from urmpipe_pipeline.text import MAX_DECIMALS

DASHES = ("solid", "dash", "dot", "dashdot")
"""Tells the ninth joint from the first: colours repeat, dashes do not."""

FINE_DIGITS = 6
"""Digits after the point of a value in SI: micrometres; angles in [rad] and rates have `MAX_DECIMALS`."""

SIGNIFICANT = 7
"""Digits that a value in SI has at most: what single precision holds."""

SMALL = 1e-3
"""Values below this are told in exponent form, as in the tables."""

EXPONENT = ".3e"
"""Exponent form with four digits."""


def label(said: str) -> str:
    """Return a text from a file so that plotly.js, which reads HTML, draws it letter by letter."""
    return html.escape(escape_control_characters(said), quote=False)


def line(
    t: FloatArray,
    values: FloatArray,
    name: str,
    colour: str,
    unit: str,
    *,
    points: int = MAX_POINTS,
    keep: Sequence[int] = (),
    at: FloatArray | None = None,
    **more: Any,
) -> Spec:
    """Return a line over time, decimated.

    Args:
        t: Times in [s], shape (n,).
        values: In `unit`, shape (n,).
        name: What the legend and the pointer call it.
        colour: As CSS writes it.
        unit: Unit of the values; empty without one.
        points: How many of its samples may stay.
        keep: Samples that stay in any case.
        at: Where the values stand on an axis of two scales [-], shape (n,); None: where they are.
        **more: Further settings of the trace.
    """
    kept: IntArray = np.union1d(decimate(values, points, t), np.asarray(keep, dtype=np.int64))
    shown = values[kept]
    digits = pointer_digits(unit, shown)
    alone = np.count_nonzero(np.isfinite(shown)) == 1  # a line through one point is nothing to see
    settings = {"line": stroke(colour), "mode": "lines+markers" if alone else "lines"} | more
    exact = typed(shown, precision(shown, digits))
    apart = at is not None and at is not values
    shows = "customdata" if apart else "y"
    return {
        "type": "scatter",
        "name": label(name),
        "x": typed(t[kept], "f8"),
        "hovertemplate": f"%{{{shows}:{told(shown, digits)}}} {label(unit)}".rstrip(),
        "showlegend": False,
        **({"y": typed(at[kept]), "customdata": exact} if at is not None and apart else {"y": exact}),
    } | settings


def pointer_digits(unit: str, values: FloatArray) -> int:
    """Return how many digits after the point values in a unit, shape (n,), have under the pointer.

    Those in [mm] and [deg] have as many as in the tables.
    """
    if unit in {shown for shown, _ in text.SHOWN.values()}:
        return MAX_DECIMALS
    most = MAX_DECIMALS if unit == "rad" or "/s" in unit else FINE_DIGITS
    return max(min(most, SIGNIFICANT - len(f"{_largest(values):.0f}")), 0)


def told(values: FloatArray, digits: int = MAX_DECIMALS) -> str:
    """Return how values, shape (n,), are written under the pointer: as the tables write the largest of them.

    They are in the unit of the figure.
    """
    largest = _largest(values)
    return EXPONENT if 0.0 < largest < SMALL else f".{digits}f"


def precision(values: FloatArray, digits: int = MAX_DECIMALS) -> Literal["f4", "f8"]:
    """Return "f4" if single precision tells the same digits of values in any unit, shape (n,), else "f8".

    A tenth of the last digit may be lost, but the least and the largest value are told exactly as they are:
    they also stand in tables.
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
    """Return points over times in [s], every one: values in the unit of their panel, shape (n,).

    There is one symbol for all, or one each, in plotly.js's words; further settings are the trace's.
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


def level(value: float, words: str = "", *, above: bool = False) -> Spec:
    """Return a dashed line at one value, as wide as the plot, with words at its end, below it or above."""
    ends = {"xref": "x domain", "x0": 0, "x1": 1, "y0": value, "y1": value}
    word: Spec = {"text": words, "textposition": "end", "font": {"color": MUTED, "size": 10}}
    word["yanchor"] = "bottom" if above else "top"
    return {"type": "line", "line": {"color": INK, "width": 1, "dash": "dash"}, "label": word} | ends


def band(low: float, high: float) -> Spec:
    """Return a tinted band between two values, behind the lines."""
    ends = {"xref": "x domain", "x0": 0, "x1": 1, "y0": low, "y1": high}
    return {"type": "rect", "fillcolor": BAND, "line": {"width": 0}, "layer": "below"} | ends


def shaded(t: FloatArray, where: NDArray[np.bool_], duration: float, colour: str = FAULT) -> list[Spec]:
    """Return the stretches of times in [s] in which something holds, shape (n,), as high as their panel.

    What is nearer than a two-hundredth of the time axis, its duration in [s], is drawn as one.
    """
    look = {"type": "rect", "fillcolor": colour, "opacity": 0.13, "line": {"width": 0}, "layer": "below"}
    height = {"xref": "x", "yref": " domain", "y0": 0, "y1": 1}
    return [look | height | {"x0": start, "x1": end} for start, end in stretches(t, where, duration)]


def instant(at: float, words: str, start: float, end: float) -> Spec:
    """Return a line at one place of an axis through all panels, with words at its head that stay inside."""
    ends = {"xref": "x", "x0": at, "x1": at, "yref": "paper", "y0": 0, "y1": 1}
    share = (at - start) / ((end - start) or 1.0)
    side = "left" if share < 0.25 else "right" if share > 0.75 else "center"  # also in a narrow window
    head = {"text": words, "textposition": "end", "textangle": 0, "xanchor": side}
    head |= {"font": {"color": FAULT, "size": 11}}
    return {"type": "line", "line": {"color": FAULT, "width": 1, "dash": "dot"}, "label": head} | ends


def _largest(values: FloatArray) -> float:
    """Return the largest absolute value; 0 where there is none."""
    known = values[np.isfinite(values)]
    return float(np.max(np.abs(known))) if len(known) else 0.0
