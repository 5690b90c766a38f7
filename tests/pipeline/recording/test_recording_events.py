"""The list of events of a recording: each at its time, with its level."""

from __future__ import annotations

from pathlib import Path

from recorded import columns, rows_of
from toys import figure, panel, recorded, shown, toy
from urmpipe_models.errors import Hint
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.section import Event

EVENTS = "/shown/events/toy"
TEXT = "TextLog:text"


def test_events_stand_at_their_times_in_order_and_begin_with_them(tmp_path: Path) -> None:
    warning = LogWarning("gap", "two rows lie apart", row=7, hints=(Hint("tsp", 0.01, "fills it"),))
    events = [
        Event(20_000_000, "last", "error"), Event(5_000_000, "a\udc80b"), Event(None, warning, "warning"),
    ]  # fmt: skip
    path = recorded(shown(figure(panel(toy())), events=lambda: events), tmp_path)
    assert rows_of(path, EVENTS, TEXT) == {
        0: [f"gap: {warning}"],
        5_000_000: ["0.0050 s  a?b"],
        20_000_000: ["0.0200 s  last"],
    }
    assert "--tsp 0.01" in str(warning)
    assert columns(path, EVENTS, "TextLog:level") == [["WARN"], ["INFO"], ["ERROR"]]


def test_without_times_events_stand_in_the_first_row(tmp_path: Path) -> None:
    events = [Event(None, "one"), Event(None, "two")]
    one = shown(events=lambda: events, opens_at_row=3)
    path = recorded(one, tmp_path)
    assert columns(path, EVENTS, TEXT) == [["one"], ["two"]]
    assert list(rows_of(path, EVENTS, TEXT, "row")) == [1]
