"""What changed since an earlier comparison, in the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from urmpipe.printing.columns import Column, print_columns
from urmpipe.printing.terminal import LISTED, judged_line
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import Absent, BaselineComparison, Change
from urmpipe_pipeline.comparison.change_wording import (
    ARROW,
    WORDS,
    samples_words,
    share_words,
    since_words,
    statistic_words,
)
from urmpipe_pipeline.comparison.symbols import symbol
from urmpipe_pipeline.json_values import plain

if TYPE_CHECKING:
    from rich.console import Console


def print_baseline(console: Console, found: BaselineComparison) -> None:
    """Print whether anything is worse, what changed beyond the noise, and what was made otherwise."""
    console.print()
    _print_verdict(console, found)
    changed = [change for change in found.changes if change.changed]
    if changed:
        title = f"Changed since {found.name} by more than the noise"
        print_columns(console, title, list(_columns(changed[:LISTED])))
    if len(changed) > LISTED:
        console.print(f"... and {len(changed) - LISTED} more; --json lists all")
    for line_of in _lines(found):
        console.print(f"  {line_of}", soft_wrap=True)


def print_worse(console: Console, found: BaselineComparison) -> None:
    """Print the verdict of a baseline and what decides it, a line each."""
    _print_verdict(console, found)
    worse = [f"{symbol(one.now)} of {one.run} ({_how(one)})" for one in found.worse]
    for word, named in (("worse", worse), ("gone", found.gone)):
        if named:
            console.print(f"      {word}: {_listed(named)}", soft_wrap=True)


def _print_verdict(console: Console, found: BaselineComparison) -> None:
    """Print whether anything is worse, and how much of it."""
    said = f"against the baseline {found.name}: {since_words(found)}"
    console.print(judged_line(found.verdict, said), soft_wrap=True)


def _how(change: Change) -> str:
    """Return what of a quantity is worse: "max, rms"."""
    return ", ".join(WORDS[name] for name in change.worse)


def _columns(changes: Sequence[Change]) -> Iterator[Column]:
    """Yield the columns of the table of changes."""
    yield Column("Log", [one.run for one in changes], key=True)
    yield Column(
        "Quantity", [f"{symbol(one.now)} [{text.SHOWN[one.now.unit][0]}]" for one in changes], key=True
    )
    yield Column("worse", [_how(one) or None for one in changes])
    for name in ("max", "rms"):
        yield Column(name, [statistic_words(one, name) for one in changes])
    if any("samples" in (*one.worse, *one.better) for one in changes):
        yield Column("samples", [samples_words(one) for one in changes])
    if any(one.before.share_out or one.now.share_out for one in changes):
        yield Column("out", [share_words(one) for one in changes])
    yield Column("most at\none sample", [text.number(one.largest, one.now.unit) for one in changes])
    times = [one.t_largest for one in changes]
    yield Column("at t\n[s]", [None if t is None else text.seconds(t) for t in times])
    if any(one.before.verdict != one.now.verdict for one in changes):
        yield Column("verdict", [_verdicts(one) for one in changes])


def _verdicts(change: Change) -> str:
    found = dict.fromkeys((one.verdict or text.NOTHING).upper() for one in (change.before, change.now))
    return ARROW.join(found)


def _lines(found: BaselineComparison) -> Iterator[str]:
    """Yield what else is to be known of the two, a line each."""
    levels = [(kind, value, _unit(kind)) for kind, value in found.noise.items()]
    noise = ", ".join(
        f"{kind} {text.limit(value, unit)} {text.SHOWN[unit][0]}" for kind, value, unit in levels
    )
    yield f"noise: {noise}"
    for word, absent in (("new", found.new), ("gone", found.gone)):
        if absent:
            yield f"{word}: {_listed(absent)}"
    for one in found.differences:
        yield f"made otherwise: {one.what}: {plain(one.before)}{ARROW}{plain(one.now)}"


def _unit(kind: str) -> str:
    return "rad" if kind in ("angle", "joint") else "m"


def _listed(absent: Sequence[Absent | str]) -> str:
    more = f" and {len(absent) - LISTED} more" if len(absent) > LISTED else ""
    return ", ".join(map(str, absent[:LISTED])) + more
