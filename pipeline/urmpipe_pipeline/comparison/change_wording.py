"""What changed since a baseline in words: the same in the terminal and in JUnit."""

from __future__ import annotations

from typing import Literal

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import Change, Worse

ARROW = " → "

WORDS: dict[Worse, str] = {"max": "max", "rms": "rms", "share_out": "out", "samples": "samples"}
"""What people call what may be worse."""

FINEST = 15
"""Digits of a share at most: more are not in it."""


def statistic_words(change: Change, name: Literal["max", "rms"]) -> str:
    """Return a statistic before and now, by digits that differ; that of now alone where it did not change."""
    before, now, unit = getattr(change.before, name), getattr(change.now, name), change.now.unit
    if abs(now - before) <= change.noise:
        return text.number(now, unit)
    return f"{text.number(before, unit, now)}{ARROW}{text.number(now, unit, before)}"


def share_words(change: Change) -> str:
    """Return the share out of tolerance before and now, by digits that differ; that of now alone likewise."""
    before, now = change.before.share_out, change.now.share_out
    if before is None and now is None:
        return text.NOTHING
    if before is not None and now is not None:
        if "share_out" not in (*change.worse, *change.better):
            return text.percent(now)
        if float(text.percent(before)[:-1]) == float(text.percent(now)[:-1]):
            digits = next((n for n in range(3, FINEST) if f"{before:.{n}g}" != f"{now:.{n}g}"), FINEST)
            return ARROW.join(f"{100.0 * share:.{digits}g} %" for share in (before, now))
    return ARROW.join(text.NOTHING if share is None else text.percent(share) for share in (before, now))


def samples_words(change: Change) -> str:
    """Return on how many samples a quantity rested before and rests now."""
    return f"{change.before.samples}{ARROW}{change.now.samples}"


def worse_words(change: Change) -> str:
    """Return what of a quantity is worse, before and now: "max 1.0000 → 2.0000 mm, out 1.0 % → 3.0 %"."""
    unit = text.SHOWN[change.now.unit][0]
    told: dict[Worse, str] = {"share_out": share_words(change), "samples": samples_words(change)}
    for name in ("max", "rms"):
        told[name] = f"{statistic_words(change, name)} {unit}"
    return ", ".join(f"{WORDS[name]} {told[name]}" for name in change.worse)


def noise_words(change: Change) -> str:
    """Return what of a change means nothing: "noise 0.001 mm"."""
    return f"noise {text.limit(change.noise, change.now.unit)} {text.SHOWN[change.now.unit][0]}"
