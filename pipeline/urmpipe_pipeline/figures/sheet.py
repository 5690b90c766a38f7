"""The sheet that a figure is drawn on: as wide as it is printed, in one font, its text kept as text."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend

from urmpipe_pipeline.figures.letters import FONT
from urmpipe_pipeline.figures.size import Size

INCH = 0.0254
"""An inch in [m]."""

POINT = INCH / 72.0
"""A point in [m]."""

NOTEBOOK_DPI = 150
"""Dots an inch of a figure in a notebook."""

INK, MUTED, GRID, FRAME = "#1b2329", "#5b6770", "#e4e8eb", "#8f9ba0"
FAULT, BAND = "#b32d00", "#d6e8f2"
"""What is out of tolerance, and the inside of a tolerance: both legible in print."""

SMALLER = 0.9
"""Text at ticks and in legends, as a share of the font's size."""

ROOM, MOST_COLUMNS = 0.84, 6
"""Width of a legend at most, in widths of the sheet, and its columns."""

FONTS = [FONT, "Verdana", "Arial", "sans-serif"]
"""The font of figures; the others are for who opens an SVG without it."""

SAVING: dict[str, Any] = {
    "pdf.fonttype": 42,  # TrueType: text is found, copied and edited
    "svg.fonttype": "none",  # text is text
    "svg.hashsalt": "urmpipe",  # names that are random otherwise: one figure is one file
    "font.sans-serif": FONTS,
}
"""How a figure is written."""


class Sheet(Figure):
    """A figure that keeps its size and its text when it is saved, and that a notebook shows."""

    def savefig(self, fname: Any, **settings: Any) -> None:
        """Write it as matplotlib does, but with text as text in PDF and SVG, whatever rcParams say."""
        with _quiet(SAVING):
            super().savefig(fname, **settings)

    def settle(self) -> None:
        """Lay it out once and for all: what is saved in several formats is the same in all, and quicker."""
        with _quiet(SAVING):
            self.draw_without_rendering()
        self.set_layout_engine("none")

    @property
    def renderer(self) -> RendererAgg:
        """What measures its texts."""
        renderer: RendererAgg = FigureCanvasAgg(self).get_renderer()  # type: ignore[no-untyped-call]
        return renderer

    def _repr_png_(self) -> bytes:
        """Return the picture that a notebook shows."""
        data = io.BytesIO()
        self.savefig(data, format="png", dpi=NOTEBOOK_DPI)
        return data.getvalue()


@contextmanager
def styled(size: Size) -> Iterator[None]:
    """Draw in the look of figures; the settings of whoever uses matplotlib are as before afterwards."""
    with _quiet(_look(size.font)):
        yield


@contextmanager
def _quiet(settings: dict[str, Any]) -> Iterator[None]:
    """Let settings hold, and say nothing of letters that no font has: they are drawn as boxes."""
    with style.context(["default", settings]), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        yield


def sheet(size: Size, height: float, *, laid_out: bool = True) -> Sheet:
    """Return an empty figure of a size, its height in [m]; nothing of pyplot knows it.

    Its axes make room for their words if it is laid out, else they stand where they are put.
    """
    layout: Literal["constrained"] | None = "constrained" if laid_out else None
    return Sheet(figsize=(size.width / INCH, height / INCH), layout=layout, facecolor="white")


def sheet_of(axes: Axes) -> Sheet:
    """Return the figure that axes stand on."""
    made = axes.get_figure(root=True)
    assert isinstance(made, Sheet)
    return made


def fitting(write: Callable[[int], Legend], made: Sheet, entries: int) -> int:
    """Write a legend in as many columns as fit onto a sheet; return how many lines it has.

    Args:
        write: Writes it in so many columns, in place of an earlier one.
        made: The sheet.
        entries: How many there are.
    """
    for columns in range(min(MOST_COLUMNS, entries), 0, -1):
        if write(columns).get_window_extent(made.renderer).width <= ROOM * made.bbox.width:
            break
    return -(-entries // columns)


def em(size: Size) -> float:
    """Return the size of the font in [m]."""
    return size.font * POINT


def _look(font: float) -> dict[str, Any]:
    """Return the settings of matplotlib for a font in [pt]: strokes grow with it."""
    small, stroke = SMALLER * font, font / 8.0
    ticks = {
        f"{axis}tick.{key}": value
        for axis in "xy"
        for key, value in (
            ("labelsize", small), ("color", FRAME), ("labelcolor", INK), ("major.width", 0.6 * stroke),
            ("major.size", 2.5 * stroke), ("major.pad", 2.0 * stroke),
        )
    }  # fmt: skip
    return ticks | {
        "font.size": font, "font.family": "sans-serif", "font.sans-serif": FONTS, "text.color": INK,
        "text.parse_math": False,  # a $ in a name is a $
        "axes.labelsize": font, "axes.titlesize": small, "axes.titlepad": 2.5 * stroke,
        "axes.titlelocation": "left", "axes.labelpad": 2.0 * stroke, "axes.labelcolor": INK,
        "axes.edgecolor": FRAME, "axes.linewidth": 0.6 * stroke, "axes.spines.top": False,
        "axes.spines.right": False, "axes.axisbelow": True, "axes.xmargin": 0.0, "axes.ymargin": 0.06,
        "axes.formatter.limits": (-4, 5), "axes.formatter.useoffset": False,
        "axes.grid": True, "grid.color": GRID, "grid.linewidth": 0.5 * stroke,
        "lines.linewidth": stroke, "lines.markeredgewidth": 0.5 * stroke, "lines.markersize": 4.0 * stroke,
        "legend.fontsize": small, "legend.frameon": False, "legend.handlelength": 1.6,
        "legend.columnspacing": 1.2, "legend.handletextpad": 0.5, "legend.borderpad": 0.0,
        "legend.labelspacing": 0.3, "figure.constrained_layout.h_pad": 0.02 * stroke,
        "figure.constrained_layout.w_pad": 0.02 * stroke,
    }  # fmt: skip
