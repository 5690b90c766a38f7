"""What is plotted: arrays in SI over a time, a row or a quantity, with limits, marks and captions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.presentation.scene import Arrows, BoolArray, Path, PlaneView, Sheets, Solid, Spot

Shape: TypeAlias = Literal["up", "down", "cross", "diamond"]


class Computed:
    """In place of an array, one that is computed where it is drawn and not kept: a long log has many.

    Attributes:
        rows: How many rows it has.
        compute: Returns it in the panel's unit, shape (rows,) or (rows, k).
    """

    def __init__(self, rows: int, compute: Callable[[], FloatArray]) -> None:
        """Stand for what `compute` returns."""
        self.rows, self.compute = rows, compute

    def __len__(self) -> int:
        return self.rows

    def __getitem__(self, key: slice) -> FloatArray:
        return self.compute()[key]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """An array as lines, a line a column. Whoever thins it out keeps every peak.

    Attributes:
        values: In the panel's unit, shape (n,) or (n, k); only `len` and slices are taken of it.
        names: One a column; a name that several panels have is one entry of the legend.
        colours: One a column, as #rrggbb.
        dashed: True for what was asked for, or was before, beside what was measured: no limit holds for it.
        steps: True for what changes only from one row to the next.
        points: True for rows that nothing joins.
        t_ns: Time of each row in [ns], shape (n,), where it is not the panel's.
        strong: True for what decides among lines over a quantity: it is wider.
        stacked: True for the parts of a sum: a page stacks them as areas, those above 0 and those below 0;
            the viewer, which has no areas, draws lines.
    """

    values: FloatArray | Computed
    names: tuple[str, ...]
    colours: tuple[str, ...]
    dashed: bool = False
    steps: bool = False
    points: bool = False
    t_ns: IntArray | None = None
    stacked: bool = False
    strong: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A mark on a line.

    Attributes:
        t_ns: Its time in [ns] (its row, from 0, where the panel has no times or is over a quantity).
        value: In the panel's unit.
        shape: Turned up or down for turns added or taken, a cross for a doubt, a diamond for the largest.
        colour: As #rrggbb.
        words: What it is.
        name: The line it stands on.
    """

    t_ns: int
    value: float
    shape: Shape
    colour: str
    words: str
    name: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Over:
    """A quantity as the horizontal axis.

    Attributes:
        values: In `unit`, shape (n,).
        title: Its symbol or name.
        unit: SI.
        joined: Whether lines join the rows that have a value; the quantity grows from row to row.
    """

    values: FloatArray
    title: str
    unit: str
    joined: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Lines of one unit.

    Attributes:
        title: The quantity, without its unit.
        unit: SI unit of all lines ("m" and "rad" are shown in mm and deg if `small`).
        lines: From the back to the front.
        t_ns: Time of each row in [ns], shape (n,); None: the row number is the axis.
        limit: Largest absolute value allowed, in `unit`.
        signed: False for a size, which is never negative: its axis begins at 0 and has one limit.
        peaks: Rows that are marked on each line as its largest, and kept by whoever thins out.
        marks: Further marks.
        over: A quantity as the horizontal axis instead of the time; rows are points then, or joined.
        logarithmic: Whether the axis is logarithmic.
        small: True for a deviation, shown in mm and deg; False for a place, shown in m and rad.
        tinted: Rows to tint besides those out of the limit, shape (n,); None for none.
        share: Height relative to other panels.
        display_unit: A unit that people prefer to `unit`, such as deg; empty for none.
        limit_name: What a legend calls the limit.
        close: Largest value of all panels of its kind, in `unit`: far within the limit, it is shown close up;
            0 for a panel that is about the limit.
    """

    title: str
    unit: str
    lines: tuple[Line, ...]
    t_ns: IntArray | None = None
    limit: float | None = None
    signed: bool = True
    peaks: tuple[int, ...] = ()
    marks: tuple[Mark, ...] = ()
    over: Over | None = None
    logarithmic: bool = False
    small: bool = False
    tinted: BoolArray | None = None
    share: float = 1.0
    display_unit: str = ""
    limit_name: str = "tolerance"
    close: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Panels that the viewer shows as one plot: they have one unit, or are few."""

    name: str
    panels: tuple[Panel, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """Plots that belong together: a page stacks all panels, the viewer shows each view as a tab of a row.

    Attributes:
        title: Its heading.
        caption: What is drawn and what to look for, one or two sentences.
        alt: What it shows, for who does not see it; a function where that takes a look at all its arrays.
        views: At least one.
        instants: Times in [ns] at which a line goes through all panels, with a word each; rows, from 0, where
            a quantity is the axis that joined lines go along.
        opened: Number of the view that the viewer opens; None: all of them, one below the other.
        share: Height of its row in the viewer relative to others; of each row if all views are open.
        beside: Whether the viewer shows its views as further tabs of the figure before it.
        folded: Whether a page opens it only on request: it explains more than it decides.
    """

    title: str
    caption: str
    alt: str | Callable[[], str]
    views: tuple[View, ...]
    instants: Mapping[int, str] = field(default_factory=dict)
    opened: int | None = 0
    share: float = 1.0
    beside: bool = False
    folded: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class SpaceFigure:
    """Paths and solids in space on a page, with equal scale on all axes; the viewer has its scene instead.

    Attributes:
        title: Its heading.
        caption: What is drawn and what to look for, one or two sentences.
        alt: What it shows, for who does not see it.
        paths: Lines, from the back to the front.
        spots: Single places.
        arrows: Arrows from places, None for none.
        sheets: Flat pieces of planes, None for none.
        solids: Bodies.
        folded: Whether a page opens it only on request.
        plane: The view along the normal of a planar mechanism; None for the general one.
    """

    title: str
    caption: str
    alt: str
    paths: tuple[Path, ...] = ()
    spots: tuple[Spot, ...] = ()
    arrows: Arrows | None = None
    sheets: Sheets | None = None
    solids: tuple[Solid, ...] = ()
    folded: bool = False
    plane: PlaneView | None = None


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawing that is ready (SVG).

    Attributes:
        title: Its heading.
        alt: What it shows, for who does not see it.
        svg: The drawing.
    """

    title: str
    alt: str
    svg: str


@dataclass(frozen=True, slots=True)
class Text:
    """A text that is shown letter by letter, such as a file; a page opens it only on request."""

    title: str
    text: str
