"""What the viewer opens with: verdict, arm and paths at the left; the plots and the events at the right.

No blueprint says at which time the viewer opens: a `time_selection` moves the cursor only while it plays, and
keeps it there. So `urmpipe view` sets the time, and in every plot stands a line through the instant by which
the verdict was decided. Opened otherwise the viewer stands at the first sample: the summary says where to go.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

from urmpipe_pipeline.presentation.figure import Figure, Text
from urmpipe_pipeline.presentation.section import Event, Presentation, Section
from urmpipe_pipeline.recording.layout import ROW, TIME, Opening, keys, shown_path
from urmpipe_pipeline.recording.views.axes import LOW, TALL, whole_axis
from urmpipe_pipeline.recording.views.events import events_view
from urmpipe_pipeline.recording.views.plots import EntityOf, Plots
from urmpipe_pipeline.recording.views.scene_drawing import scene_view
from urmpipe_pipeline.recording.views.summary import summary
from urmpipe_pipeline.text import drop_surrogates

if TYPE_CHECKING:
    from rerun import RecordingStream
    from rerun.blueprint import Blueprint, Container, View

    Row: TypeAlias = tuple[View | Container, float]

EVENTS_SHARE = 2.2
"""Share of the height that the row with the events has, relative to the rows of figures."""

HEAD_SHARE, LINE_SHARE, MOST_TEXT = 0.12, 0.022, 0.45
"""Shares of the height for the summary: its title, each line, and all of it at most."""

PEEK = 3
"""Lines of further tables that are seen without scrolling where an arm stands below: it needs the room."""

LINE_LENGTH = 115
"""Characters that fit in a line of the summary where it has half of a usual window's width."""

BESIDE = [1, 2]
"""Shares of the width for a long summary and the plots, where no arm stands below the summary."""

SHORT = 0.5
"""A tab that lasts less than this share of the longest has a time axis of its own."""

HIGH = 0.16
"""Share of the height from which a plot has room for many numbers at its axis."""

SEEN_AT_ONCE, COLUMNS = 8, 2
"""Plots of several sections that stand beside each other, and how many abreast; of more, each section is a
tab."""


def send_views(
    stream: RecordingStream, shown: Presentation, entity_of: EntityOf
) -> tuple[Blueprint, Opening, set[str]]:
    """Send what is there to be looked at of a presentation, and return the layout and where it opens.

    Where arrays of the result stand as scalars in their own unit, their entities are drawn.

    Returns:
        The layout, where it opens, and the entities of the arrays of the result that it plots.
    """
    import rerun as rr

    scene = shown.scene() if shown.scene is not None else None
    space = None if scene is None else scene_view(stream, scene, shown.opens_at_ns)
    parts = _parts(shown.body)
    whole, timed = whole_axis(figure for part in parts for figure in part.figures)
    timed = shown.opens_at_row is None if whole is None else timed
    opening = Opening(TIME, shown.opens_at_ns) if timed else Opening(ROW, (shown.opens_at_row or 0) + 1)
    plots = Plots(stream, entity_of, whole, timed)
    words = summary(shown, scene)
    text = "\n".join(words)
    stream.log(shown_path("summary"), rr.TextDocument(text, media_type="text/markdown"), static=True)
    layout = _blueprint(_words(plots, parts), words, space, _plots(plots, parts), opening.timeline)
    return layout, opening, plots.plotted


@dataclass(frozen=True, eq=False)
class _Part:
    """A section with what the viewer shows of it, its views computed once."""

    title: str
    verdict: str
    key: str
    figures: tuple[Figure, ...]
    texts: tuple[Text, ...]
    events: tuple[Event, ...]
    opened: bool

    @property
    def instants(self) -> dict[int, str]:
        """All that its figures mark: a line stands in each of them."""
        return {at: words for figure in self.figures for at, words in figure.instants.items()}


def _parts(body: Section) -> list[_Part]:
    """Return the sections that have anything to plot, the body first."""
    sections = [body, *body.sections]
    found = []
    for section, key in zip(sections, keys([one.title for one in sections]), strict=True):
        blocks = tuple(section.figures())
        figures = tuple(_joined(one for one in blocks if isinstance(one, Figure)))
        texts = tuple(one for one in blocks if isinstance(one, Text))
        events = tuple(section.events())
        found.append(
            _Part(section.title, (section.verdict or "").upper(), key, figures, texts, events, section.opened)
        )
    return found


def _joined(figures: Iterable[Figure]) -> list[Figure]:
    """Return figures, the views of those that stand beside the one before as further tabs of it."""
    found: list[Figure] = []
    for one in figures:
        if one.beside and found:
            found[-1] = replace(found[-1], views=(*found[-1].views, *one.views))
        else:
            found.append(one)
    return found


def _words(plots: Plots, parts: Sequence[_Part]) -> View | Container:
    """Return the summary, behind it texts, and the events that stand beside no plot."""
    import rerun as rr
    import rerun.blueprint as rrb

    views: list[View | Container] = [rrb.TextDocumentView(origin=shown_path("summary"), name="Summary")]
    texts = [text for part in parts for text in part.texts]
    for key, text in zip(keys([one.title for one in texts]), texts, strict=True):
        entity = shown_path("text", key)
        plots.stream.log(entity, rr.TextDocument(drop_surrogates(text.text)), static=True)
        views.append(rrb.TextDocumentView(origin=entity, name=drop_surrogates(text.title)))
    views += [_events(plots, part) for part in parts if part.events and not part.figures]
    return _tabs(views)


def _events(plots: Plots, part: _Part) -> View:
    """Return the list of the events of a section."""
    first = (0 if plots.whole is None else plots.whole[0]) if plots.timed else None
    return events_view(plots.stream, part.events, shown_path("events", part.key), first)


def _plots(plots: Plots, parts: Sequence[_Part]) -> View | Container | None:
    """Return the plots: those of one section as rows, of several side by side if few, else as tabs."""
    import rerun.blueprint as rrb

    shown = [part for part in parts if part.figures]
    if not shown:
        return None
    if len(shown) == 1:
        return _stacked(_rows(plots, shown[0]))
    if sum(len(figure.views) for part in shown for figure in part.figures) <= SEEN_AT_ONCE:
        views = [view for part in shown for view, _ in _rows(plots, part, part.title)]
        return rrb.Grid(*views, grid_columns=COLUMNS if len(views) > 2 * COLUMNS else 1)
    tabs = []
    for part in shown:
        plots.own = _own_axis(plots, part)
        tabs.append(_stacked(_rows(plots, part), f"{part.verdict} {part.title}".strip()))
    return rrb.Tabs(*tabs, active_tab=next((i for i, part in enumerate(shown) if part.opened), 0))


def _own_axis(plots: Plots, part: _Part) -> tuple[int, int] | None:
    """Return from where to where a section goes in [ns] or rows that is much shorter than all; else None."""
    own, _ = whole_axis(part.figures)
    if own is None or plots.whole is None or own[0] == own[1]:
        return None
    return own if own[1] - own[0] < SHORT * (plots.whole[1] - plots.whole[0]) else None


def _rows(plots: Plots, part: _Part, about: str = "") -> list[Row]:
    """Return the figures of a section from top to bottom; the events share the row of the last."""
    rows: list[Row] = []
    last: list[View | Container] = [_events(plots, part)] if part.events else []
    height = sum(one.share * (len(one.views) if one.opened is None else 1) for one in part.figures)
    for number, figure in enumerate(part.figures):
        root = shown_path("plots", part.key, str(number))
        most = TALL if figure.share >= HIGH * height else LOW
        sent = [
            plots.views(view, f"{root}/{i}", part.instants, about, most, opened=figure.opened in (None, i))
            for i, view in enumerate(figure.views)
        ]
        views = [one for some in sent for one in some]
        if last and figure is part.figures[-1] and number:
            rows.append((_tabs([*last, *views]), EVENTS_SHARE))
            last = []
        elif figure.opened is None:
            rows += [(_tabs(some), figure.share) for some in sent if some]
        elif views:
            opened = sum(len(some) for some in sent[: figure.opened])
            rows.append((_tabs(views, opened), figure.share))
    return rows + [(one, EVENTS_SHARE) for one in last]


def _blueprint(
    text: View | Container,
    words: tuple[str, str],
    space: View | None,
    plots: View | Container | None,
    timeline: str,
) -> Blueprint:
    """Return the summary and the 3D view at the left, the plots at the right.

    Without a 3D view the plots stand below the summary, or beside one that is long.
    """
    import rerun.blueprint as rrb

    length = LINE_LENGTH if space is not None else 2 * LINE_LENGTH
    first, below = (sum(math.ceil(len(line) / length) for line in part.splitlines()) for part in words)
    lines = first + (below if space is None else min(below, PEEK))
    share = min(MOST_TEXT, HEAD_SHARE + LINE_SHARE * lines)
    root = text
    if space is not None:
        root = rrb.Vertical(text, space, row_shares=[share, 1 - share])
    if plots is not None and space is None and share < MOST_TEXT:
        root = rrb.Vertical(text, plots, row_shares=[share, 1 - share])
    elif plots is not None:
        root = rrb.Horizontal(root, plots, column_shares=BESIDE if space is None else [1, 1])
    return rrb.Blueprint(
        root,
        rrb.TimePanel(state="collapsed", timeline=timeline, play_state="paused"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def _stacked(rows: Sequence[Row], name: str | None = None) -> Container:
    """Return views one below the other."""
    import rerun.blueprint as rrb

    name = None if name is None else drop_surrogates(name)
    return rrb.Vertical(*(view for view, _ in rows), row_shares=[share for _, share in rows], name=name)


def _tabs(views: Sequence[View | Container], active: int = 0) -> View | Container:
    """Return the views as tabs, one of them open, or the only one as itself."""
    import rerun.blueprint as rrb

    return rrb.Tabs(*views, active_tab=active) if len(views) > 1 else views[0]
