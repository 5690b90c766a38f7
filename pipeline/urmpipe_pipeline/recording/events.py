"""The list of events: what was done to a log and what a comparison found, each at its time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from urmpipe_models.arrays import IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.wording import alignment_words, amount_words, sync_words
from urmpipe_pipeline.recording.columns import time_columns
from urmpipe_pipeline.recording.entities import Place, printable
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry
from urmpipe_pipeline.runs.results import Run

if TYPE_CHECKING:
    from rerun import RecordingStream

Event: TypeAlias = tuple[int, str, str]
"""Its time in [ns], what it says, and its level."""


def draw_log_events(stream: RecordingStream, place: Place, run: Run) -> None:
    """List the audit at its instants and the warnings at their rows, or at the first."""
    told = [f"{printable(one.joint)} {_told(one)}" for one in run.audit]
    t_ns = np.array([round(one.t * 1e9) for one in run.audit], dtype=np.int64)
    levels = ["INFO" if one.kind in ("wrap", "repaired") else "WARN" for one in run.audit]
    _draw(stream, f"{place.prefix}events/repolarization", t_ns, told, levels)
    said = [
        f"{printable(one.kind)}{f' in row {one.row}' if one.row else ''}: {printable(one.message)}"
        for one in run.warnings
    ]
    rows = np.clip([(one.row or 1) - 1 for one in run.warnings], 0, run.log.rows - 1).astype(np.int64)
    entity, levels = f"{place.prefix}events/warning", ["WARN"] * len(said)
    _draw(stream, entity, run.log.t_ns[rows], said, levels, timed=run.timed)


def draw_comparison_events(stream: RecordingStream, place: Place, one: Deviation) -> None:
    """List how a log was put beside the reference, and where it deviates most."""
    found = sorted(_events(one), key=lambda event: event[0])
    t_ns = np.array([event[0] for event in found], dtype=np.int64)
    texts, levels = [printable(event[1]) for event in found], [event[2] for event in found]
    _draw(stream, f"{place.prefix}events/deviation", t_ns, texts, levels)


def _events(one: Deviation) -> Iterator[Event]:
    """Yield what a comparison has to say about one log."""
    start = int(one.t_ns[0])
    yield from ((start, text, "INFO") for text in _set_up(one))
    if one.left_out:
        whole = one.left_out + len(one.sample)
        yield start, f"{one.left_out} of {whole} samples left out: no reference or no value", "WARN"
    level = "INFO" if one.verdict == "pass" else "ERROR"
    if (longest := one.longest_out) is not None:
        lasts = f"{longest.samples} samples, {text.seconds(longest.duration)} s"
        said = f"longest stretch out of tolerance begins: {lasts}"
        yield round(longest.t * 1e9), said, level
    decisive = one.decisive
    if decisive.tolerance is not None:
        yield round(decisive.t_max * 1e9), f"decides: {amount_words(decisive)}", level
    x, y, z, norm = (text.quantity(float(value), "m") for value in one.delta[one.worst])
    yield int(one.t_ns[one.worst]), f"largest deviation: {norm} (x {x}, y {y}, z {z})", level


def _set_up(one: Deviation) -> Iterable[str]:
    """Return how the clocks and the places were put together, where that is not trivial."""
    return filter(None, (sync_words(one.sync), alignment_words(one.alignment)))


def _told(one: AuditEntry) -> str:
    """Return what happened to a joint, in which row."""
    where = f"in row {one.row}"
    if one.kind == "wrap":
        turns = f"{one.before:+d} to {one.after:+d} turns"
        return f"repolarized {where}: step {one.step:+.4f} rad, {turns}, +-{1e3 * one.half_period:.3g} ms"
    if one.kind in ("in-between", "repaired"):
        done = "repaired" if one.kind == "repaired" else "left on a wrap"
        return f"{done} {where}: {one.step:+.4f} rad off the line of its neighbours"
    why = (
        "no wrap" if one.kind == "unexplained" else f"a gap of {2e3 * one.half_period:.6g} ms: turns unknown"
    )
    return f"{one.kind} {where}: step {one.step:+.4f} rad, {why}"


def _draw(
    stream: RecordingStream,
    entity: str,
    t_ns: IntArray,
    texts: Sequence[str],
    levels: Sequence[str],
    *,
    timed: bool = True,
) -> None:
    """Send lines of the list of events, each beginning with its time: the list's own column is too narrow."""
    import rerun as rr

    if not texts:
        return
    heads = [f"{at / 1e9:.4f} s  " if timed else "" for at in t_ns.tolist()]
    lines = [head + said for head, said in zip(heads, texts, strict=True)]
    columns = rr.TextLog.columns(text=lines, level=list(levels))
    stream.send_columns(entity, time_columns(t_ns), columns)
