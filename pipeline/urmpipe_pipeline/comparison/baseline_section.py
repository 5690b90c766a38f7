"""What changed since an earlier comparison, as a section: what is worse first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Literal

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import BaselineComparison, Change
from urmpipe_pipeline.comparison.change_wording import WORDS, since_words
from urmpipe_pipeline.comparison.checks import gone_check
from urmpipe_pipeline.comparison.symbols import symbol
from urmpipe_pipeline.json_values import plain
from urmpipe_pipeline.presentation.parts import columns_of, table_of
from urmpipe_pipeline.presentation.section import Cell, Fact, Judged, Ref, Section, Table, Value

NAMED = 30
"""Quantities and logs that a fact names; more are counted."""


def baseline_section(found: BaselineComparison, rank: int) -> Section:
    """Return what changed since an earlier comparison.

    Args:
        found: What changed.
        rank: The place of the section among its neighbours.
    """
    gone = (one for one in found.gone if one.quantity is None)
    return Section(
        f"Against the baseline {found.name}",
        found.verdict,
        tuple(_facts(found)),
        tuple(_tables(found)),
        sections=tuple(Section(one.run, "fail", checks=(gone_check(one),)) for one in gone),
        rank=rank,
    )


def _facts(found: BaselineComparison) -> Iterator[Fact]:
    yield Fact("Since then", since_words(found))
    worse = [f"{symbol(one.now)} of {one.run} ({_words(one.worse)})" for one in found.worse]
    yield Fact("Worse", _listed(worse))
    yield Fact("Gone", _listed(list(map(str, found.gone))))
    yield Fact("New", _listed(list(map(str, found.new))))
    levels = [
        (kind, value, "rad" if kind in ("angle", "joint") else "m") for kind, value in found.noise.items()
    ]
    noise = (f"{kind} {text.limit(value, unit)} {text.SHOWN[unit][0]}" for kind, value, unit in levels)
    yield Fact("Noise", ", ".join(noise), "smaller changes are not listed")
    yield Fact("Recording of the baseline", str(found.recording or ""), brief=False)


def _tables(found: BaselineComparison) -> Iterator[Table]:
    """Yield the quantities that changed by more than the noise, and what was made differently."""
    changed = sorted((one for one in found.changes if one.changed), key=lambda one: not one.worse)
    if changed:
        yield Table(f"Changed since {found.name} by more than the noise", columns_of(changed, _HEADS))
    if found.differences:
        rows = [(one.what, plain(one.before), plain(one.now)) for one in found.differences]
        heads = {"what": "What", "before": "before", "now": "now"}
        yield table_of("Made differently", heads, rows, brief=True)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _words(found: tuple[Literal["max", "rms", "share_out", "samples"], ...]) -> str:
    return ", ".join(WORDS[name] for name in found)


def _statistic(name: Literal["max", "rms"], when: Literal["before", "now"]) -> Callable[[Change], Cell]:
    """Return what makes the cell of a statistic: with digits that tell before and now apart if it changed."""

    def cell(one: Change) -> Cell:
        before, now = getattr(one.before, name), getattr(one.now, name)
        quiet = abs(now - before) <= one.noise
        value, other = (before, now) if when == "before" else (now, before)
        return Value(value, one.now.unit, None if quiet else other)

    return cell


def _share(when: Literal["before", "now"]) -> Callable[[Change], Cell]:
    """Return what makes the cell of the share out of tolerance, where that changed."""

    def cell(one: Change) -> Cell:
        if "share_out" not in (*one.worse, *one.better):
            return None
        before, now = one.before.share_out, one.now.share_out
        return Value(before, "%", now) if when == "before" else Value(now, "%", before)

    return cell


def _samples(when: Literal["before", "now"]) -> Callable[[Change], Cell]:
    """Return what makes the cell of the samples that a quantity rests on, where that changed."""

    def cell(one: Change) -> Cell:
        return Value(getattr(one, when).samples) if "samples" in (*one.worse, *one.better) else None

    return cell


def _verdict(when: Literal["before", "now"]) -> Callable[[Change], Cell]:
    """Return what makes the cell of a verdict, where that changed."""

    def cell(one: Change) -> Cell:
        return Judged(getattr(one, when).verdict if one.before.verdict != one.now.verdict else None)

    return cell


_HEADS: dict[str, tuple[str, Callable[[Change], Cell]]] = {
    "run": ("Log", lambda one: Ref(one.run)),
    "quantity": ("Quantity", lambda one: symbol(one.now)),
    "worse": ("worse", lambda one: _words(one.worse)),
    "better": ("better", lambda one: _words(one.better)),
    "max_before": ("max before", _statistic("max", "before")),
    "max_now": ("max now", _statistic("max", "now")),
    "rms_before": ("rms before", _statistic("rms", "before")),
    "rms_now": ("rms now", _statistic("rms", "now")),
    "out_before": ("out before", _share("before")),
    "out_now": ("out now", _share("now")),
    "samples_before": ("samples before", _samples("before")),
    "samples_now": ("samples now", _samples("now")),
    "largest_change": ("most at one sample", lambda one: Value(one.largest, one.now.unit)),
    "t_largest_change": ("at t", lambda one: Value(one.t_largest, "s")),
    "verdict_before": ("verdict before", _verdict("before")),
    "verdict_now": ("verdict now", _verdict("now")),
}
"""The columns of what changed, by their keys."""
