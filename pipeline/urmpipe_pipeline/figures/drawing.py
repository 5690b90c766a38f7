"""One figure on its sheet: panels one below the other, many lines as small plots, the legend above them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation

from urmpipe_pipeline.figures.letters import complete, drawable
from urmpipe_pipeline.figures.listing import Plot
from urmpipe_pipeline.figures.panels import LETTER, Entries, draw_panel, in_unit, wrapped
from urmpipe_pipeline.figures.sheet import FAULT, INCH, SMALLER, Sheet, em, fitting, sheet, sheet_of, styled
from urmpipe_pipeline.figures.size import Size
from urmpipe_pipeline.figures.space import drawn_space
from urmpipe_pipeline.presentation.curves import place_of, shown_unit
from urmpipe_pipeline.presentation.figure import Panel, SpaceFigure
from urmpipe_pipeline.presentation.layout import small_multiples

ALONE, OVER, SMALL = 17.0, 20.0, 8.5
"""Height of the only panel of a figure, of one over a quantity, and of a small plot, in sizes of the font."""

HEIGHTS = ((1, 8.5), (4, 11.0), (8, 15.0))
"""Height of one panel among some, by the number of lines that it has at most."""

AXIS, BETWEEN, WORDS = 3.6, 0.9, 1.5
"""Height of the axis below, of what is between two panels, and of a line of words above them."""

HIGHEST, LEAST = 0.195, 6.0
"""Height of all panels at most in [m]: a page holds them and their legends; of each at least, in sizes of the
font."""

CELL = 14.5
"""Width of a small plot at least, in sizes of the font."""

LEADING = 1.35
"""Height of a line of a legend, in sizes of its font."""


@dataclass(frozen=True, slots=True, eq=False)
class _Row:
    """What stands side by side on a sheet.

    Attributes:
        panels: One, or small plots of one panel.
        whole: The panel that they are of.
        height: In sizes of the font.
    """

    panels: tuple[Panel, ...]
    whole: Panel
    height: float


def drawn(content: Plot | SpaceFigure, size: Size) -> Sheet:
    """Return a figure as it is printed: as wide as it is asked for, as high as what is in it needs."""
    with styled(size):
        made = drawn_space(content, size) if isinstance(content, SpaceFigure) else _panels(content, size)
        complete(made)
    return made


def _panels(plot: Plot, size: Size) -> Sheet:
    """Return panels one below the other on a common horizontal axis."""
    columns = max(int(size.width / em(size) / CELL), 1)
    rows = [row for panel in plot.panels for row in _rows(panel, len(plot.panels), columns)]
    high = sum(row.height + BETWEEN for row in rows) * em(size)
    made = sheet(size, min(high, max(HIGHEST, LEAST * len(rows) * em(size))))
    axes, legends = _fill(made, plot, rows, columns)
    levels = _instants(axes, plot)
    lines = sum(_legend(one, legends[one], levels if one is axes[0] else 0) for one in legends)
    above = lines * SMALLER * LEADING + levels * WORDS
    below = AXIS + sum(row.panels[0] is not row.whole for row in rows) * WORDS
    made.set_figheight(made.get_figheight() + (above + below) * em(size) / INCH)
    return made


def _rows(panel: Panel, count: int, columns: int) -> Iterator[_Row]:
    """Yield the rows of a panel: itself, or its small plots."""
    small = small_multiples(panel)
    if len(small) == 1:
        lines = sum(len(one.names) for one in panel.lines)
        among = next((height for most, height in HEIGHTS if lines <= most), HEIGHTS[-1][1])
        alone = OVER if panel.over else ALONE
        yield _Row((panel,), panel, alone if count == 1 else among * max(panel.share, 1.0) ** 0.5)
        return
    for first in range(0, len(small), columns):
        yield _Row(small[first : first + columns], panel, SMALL)


def _fill(
    made: Sheet, plot: Plot, rows: Sequence[_Row], columns: int
) -> tuple[list[Axes], dict[Axes, Entries]]:
    """Draw all rows; return their axes, and what stands above those that have a name that is new."""
    columns = columns if any(row.panels[0] is not row.whole for row in rows) else 1
    grid = made.add_gridspec(len(rows), columns, height_ratios=[row.height for row in rows])
    found: list[Axes] = []
    legends: dict[Axes, Entries] = {}
    known: set[str] = set()
    for number, row in enumerate(rows):
        alone = row.panels[0] is row.whole
        for place, panel in enumerate(row.panels):
            axes = made.add_subplot(
                grid[number, :] if alone else grid[number, place], sharex=found[0] if found else None
            )
            found.append(axes)
            told = draw_panel(axes, panel, plot.span, legend=alone)
            legends[axes] = told if set(told) - known else {}
            known |= set(told)
            _name(axes, panel, row, first=place == 0)
            below = number + 1 < len(rows) and place < len(rows[number + 1].panels)
            axes.tick_params(labelbottom=not below)
            axes.set_xlabel("" if below else _across(plot))
    _horizontal(found, plot)
    made.align_ylabels(found)
    return found, legends


def _name(axes: Axes, panel: Panel, row: _Row, *, first: bool) -> None:
    """Write the quantity at the vertical axis of a row, and above a small plot which lines it has."""
    letters = int(row.height / LETTER)
    if first:
        axes.set_ylabel(wrapped(in_unit(row.whole.title, shown_unit(row.whole)[0]), letters))
    if panel is not row.whole:
        words = [f"{name} (dashed)" if line.dashed else name for line in panel.lines for name in line.names]
        axes.set_title(wrapped(drawable(", ".join(words)), int(CELL / LETTER / SMALLER)))


def _across(plot: Plot) -> str:
    """Return the words at the horizontal axis."""
    over = plot.panels[0].over
    return in_unit("t", "s") if plot.over == "t" else in_unit(over.title, over.unit) if over else plot.over


def _horizontal(axes: Sequence[Axes], plot: Plot) -> None:
    """Set the horizontal axis, which all panels share: the whole time, room around rows, or a quantity."""
    over, start, end = plot.panels[0].over, plot.span.start, plot.span.end
    if over is not None:
        least = float(np.nanmin(over.values[:], initial=np.inf))
        axes[0].margins(x=0.03)
        if least >= 0.0:
            axes[0].set_xlim(left=0.0)
    elif plot.over == "t":
        axes[0].set_xlim(start, end if end > start else start + 1.0)
    else:
        axes[0].set_xlim(start - 0.5, end + 0.5)
    for one in axes:
        one.xaxis.set_major_locator(MaxNLocator(6, integer=plot.over == "row", steps=[1, 2, 5, 10]))


def _instants(axes: Sequence[Axes], plot: Plot) -> int:
    """Draw a line through all panels at each instant, with its words above; return how many lines of them."""
    over = plot.panels[0].over
    if over is not None and not over.joined:
        return 0
    words: list[Annotation] = []
    start, end = axes[0].get_xlim()
    for at, said in plot.figure.instants.items():
        x = place_of(plot.panels[0], at)
        for one in axes:
            one.axvline(
                x, color=FAULT, linestyle=":", linewidth=one.spines["left"].get_linewidth(), zorder=2.6
            )
        share = (x - start) / (end - start)
        side = "left" if share < 0.15 else "right" if share > 0.85 else "center"
        words.append(
            axes[0].annotate(
                drawable(said), (x, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 1.5),
                textcoords="offset points", ha=side, va="bottom", color=FAULT, fontsize="small",
            )
        )  # fmt: skip
    return _apart(words, axes[0]) if words else 0


def _apart(words: Sequence[Annotation], axes: Axes) -> int:
    """Raise words that would stand on others; return on how many lines they stand."""
    renderer = sheet_of(axes).renderer
    ends: list[float] = []
    for one in sorted(words, key=lambda word: word.xy[0]):
        box = one.get_window_extent(renderer)
        level = next((number for number, end in enumerate(ends) if end < box.x0), len(ends))
        ends[level : level + 1] = [box.x1]
        one.set_position((0.0, 1.5 + level * WORDS * rcParams["font.size"]))
    return len(ends)


def _legend(axes: Axes, entries: Entries, levels: int) -> int:
    """Write a legend above a panel, where it hides nothing; return how many lines it has.

    It stands above so many lines of words.
    """
    if not entries:
        return 0
    made = sheet_of(axes)
    above = ScaledTranslation(
        0.0, (0.35 + levels * WORDS) * rcParams["font.size"] / 72.0, made.dpi_scale_trans
    )

    def write(columns: int) -> Legend:
        """Write the legend in so many columns."""
        return axes.legend(
            [*entries.values()], [*entries], loc="lower left", ncols=columns, borderaxespad=0.0,
            bbox_to_anchor=(0.0, 1.0), bbox_transform=axes.transAxes + above,
        )  # fmt: skip

    return fitting(write, made, len(entries))
