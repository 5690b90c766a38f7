"""What changed since a baseline in words: the same in the terminal, in JUnit and in the report."""

from __future__ import annotations

from typing import Literal

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import BaselineComparison, Change, Worse

ARROW = " → "

WORDS: dict[Worse, str] = {"max": "max", "rms": "rms", "share_out": "out", "samples": "samples"}
"""What people call what may be worse."""

FINEST = 15
"""Digits of a share at most: more are not in it."""


def since_words(found: BaselineComparison) -> str:
    """Return how much is worse than a baseline: "5 quantities worse, 1 gone", "nothing worse"."""
    count = len(found.worse)
    said = [f"{count} {'quantity' if count == 1 else 'quantities'} worse"] if count else []
    said += [f"{len(found.gone)} gone"] if found.gone else []
    return ", ".join(said) or "nothing worse"


def statistic_pair(change: Change, name: Literal["max", "rms"]) -> tuple[str, str]:
    """Return a statistic before and now, by digits that differ where it changed beyond the noise."""
    before, now, unit = getattr(change.before, name), getattr(change.now, name), change.now.unit
    if _is_quiet(change, name):
        return text.number(before, unit), text.number(now, unit)
    return text.number(before, unit, now), text.number(now, unit, before)


def statistic_words(change: Change, name: Literal["max", "rms"]) -> str:
    """Return a statistic before and now in one; that of now alone where it did not change."""
    before, now = statistic_pair(change, name)
    return now if _is_quiet(change, name) else f"{before}{ARROW}{now}"


def _is_quiet(change: Change, name: Literal["max", "rms"]) -> bool:
    """Tell whether a statistic is the same but for the noise."""
    return bool(abs(getattr(change.now, name) - getattr(change.before, name)) <= change.noise)


def share_pair(change: Change) -> tuple[str, str]:
    """Return the share out of tolerance before and now, by digits that differ where it counts as changed."""
    before, now = change.before.share_out, change.now.share_out
    if before is None or now is None:
        return _percent(before), _percent(now)
    alike = float(text.percent(before)[:-1]) == float(text.percent(now)[:-1])
    if not alike or not _share_changed(change):
        return text.percent(before), text.percent(now)
    digits = next((n for n in range(3, FINEST) if f"{before:.{n}g}" != f"{now:.{n}g}"), FINEST)
    return f"{100.0 * before:.{digits}g} %", f"{100.0 * now:.{digits}g} %"


def share_words(change: Change) -> str:
    """Return the share out of tolerance before and now in one; that of now alone where it did not change."""
    before, now = share_pair(change)
    compare = None not in (change.before.share_out, change.now.share_out)
    alike = not _share_changed(change) if compare else before == now
    return now if alike else f"{before}{ARROW}{now}"


def _percent(share: float | None) -> str:
    return text.NOTHING if share is None else text.percent(share)


def _share_changed(change: Change) -> bool:
    """Tell whether the share out of tolerance is another one beyond the noise."""
    return "share_out" in (*change.worse, *change.better)


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
