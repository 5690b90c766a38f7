"""The list of events: what happened to a result, each at its time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.section import Event
from urmpipe_pipeline.recording.layout import ROW, TIME, times_at

if TYPE_CHECKING:
    from rerun import RecordingStream
    from rerun.blueprint import TextLogView

LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}
"""Rerun's words for the levels."""


def events_view(
    stream: RecordingStream, events: Sequence[Event], entity: str, first_ns: int | None
) -> TextLogView:
    """Send one event or more and return their list, each beginning with its time: its column is too narrow.

    What holds for all of it stands at the first time, in [ns]; None without times: all is in row 1.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    first = first_ns or 0
    ordered = sorted(events, key=lambda one: first if one.t_ns is None else one.t_ns)
    heads = ["" if one.t_ns is None else f"{one.t_ns / 1e9:.4f} s  " for one in ordered]
    at = np.array([first if one.t_ns is None else one.t_ns for one in ordered], dtype=np.int64)
    lines = [head + _words(one) for head, one in zip(heads, ordered, strict=True)]
    columns = rr.TextLog.columns(text=lines, level=[LEVELS[one.level] for one in ordered])
    times = times_at(None, np.zeros_like(at)) if first_ns is None else times_at(at, np.arange(len(at)))
    stream.send_columns(entity, times, columns)
    shown = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(one, visible=False) for one in (TIME, ROW)],
        text_log_columns=["LogLevel", "Body"],
    )
    name = "Events" if first_ns is None else "Events, at t [s]"
    return rrb.TextLogView(origin="/", contents=entity, name=name, columns=shown)


def _words(one: Event) -> str:
    said = one.words if isinstance(one.words, str) else f"{one.words.kind}: {one.words}"
    return text.drop_surrogates(said)
