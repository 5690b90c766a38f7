"""A comparison in the terminal: the verdict, the logs from best to worst, the statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from urmpipe.printing.columns import Column, print_columns
from urmpipe.printing.comparison_facts import facts
from urmpipe.printing.terminal import judged, judged_line, new_console
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES, WHOLE, Deviation, Statistics
from urmpipe_pipeline.comparison.symbols import SYMBOLS, size_of, symbol
from urmpipe_pipeline.comparison.wording import correlation, decided_words, verdict_words

if TYPE_CHECKING:
    from rich.console import Console

MANY = 3
"""With more logs than these, the statistics are those of the logs that fail."""

SHOWN = 5
"""Logs whose statistics are printed at most."""


def print_comparison(result: Comparison) -> None:
    """Print the verdict of all, one table of the logs from best to worst, and the statistics of each."""
    from urmpipe.printing.baseline import print_baseline

    console = new_console()
    _print_verdict(console, result)
    ranked = result.ranking
    if len(ranked) > 1:
        print_columns(console, "From best to worst", list(_ranking(result)))
    detailed = ranked if len(ranked) <= MANY else tuple(one for one in ranked if one.verdict == "fail")
    for run in detailed[-SHOWN:]:
        title = f"{run.name} against {result.reference.name}"
        print_columns(console, title, list(_statistics(run)))
        for line in facts(run, result.reference):
            console.print(f"  {line}", soft_wrap=True)
    if left := len(ranked) - len(detailed[-SHOWN:]):
        console.print(f"Statistics of {text.counted(left, 'more log')}: --csv FILE, --json or the report.")
    if result.baseline:
        print_baseline(console, result.baseline)


def print_verdict(result: Comparison, *, err: bool = False) -> None:
    """Print the verdict alone, on standard error if asked to: why a quiet command fails."""
    from urmpipe.printing.baseline import print_worse

    console = new_console()
    console.stderr = err
    _print_verdict(console, result)
    if result.baseline and result.baseline.verdict == "fail":
        print_worse(console, result.baseline)


def _print_verdict(console: Console, result: Comparison) -> None:
    """Print pass or fail, and which quantity uses up most of its tolerance: how much, when and where."""
    console.print(judged_line(result.verdict, verdict_words([result])), soft_wrap=True)
    console.print(f"      {_decisive(result.worst, named=len(result.runs) > 1)}", soft_wrap=True)


def _decisive(run: Deviation, *, named: bool) -> str:
    """Return which quantity uses up most of its tolerance: how much, when and where."""
    one = run.decisive
    of = f"{run.name}: " if named else ""
    if one.tolerance is not None and one.missing:
        return f"{of}{decided_words(one)}"
    return f"{of}{decided_words(one)} (row {run.row(one)}), at ({text.point(run.place(one))}) m"


def _ranking(result: Comparison) -> Iterator[Column]:
    """Yield the columns of the table of logs; those that no log has are left out."""
    runs = result.ranking
    yield Column("Log", [run.name for run in runs], key=True)
    yield Column("Verdict", [judged(run.verdict) for run in runs])
    quantities: dict[str, Callable[[Deviation], Statistics | None]] = {
        f"max |{SYMBOLS[axis]}|": lambda run, axis=axis: run.statistics[axis]  # type: ignore[misc]
        for axis in "xyz"
    }
    quantities |= {
        f"max {SYMBOLS['norm']}": lambda run: run.statistics["norm"],
        "max path": lambda run: run.statistics["path"],
        "max angle": lambda run: run.statistics.get("angle"),
        "max joint": lambda run: run.furthest_joint("rad"),
        "max slide": lambda run: run.furthest_joint("m"),
    }
    for head, find in quantities.items():
        found = [find(run) for run in runs]
        unit = next((text.SHOWN[one.unit][0] for one in found if one), None)
        if unit:
            yield Column(f"{head}\n[{unit}]", [_cell(one) for one in found])
    covered = [result.covered(run) for run in runs]
    if min(covered) < WHOLE:
        yield Column("covered", [text.percent(share) for share in covered])
    yield from _when(runs)


def _when(runs: Sequence[Deviation]) -> Iterator[Column]:
    """Yield the columns that tell how much was out, what decided and when, and what it goes with."""
    stretches = [run.longest_out for run in runs]
    if any(stretches):
        yield Column("out", [text.percent(run.share_out) for run in runs])
        yield Column("longest\nout [s]", [_seconds(one.duration if one else None) for one in stretches])
        yield Column("from t\n[s]", [_seconds(one.t if one else None) for one in stretches])
    yield Column("decided\nby", [size_of(run.decisive) for run in runs])
    yield Column("at t\n[s]", [text.seconds(run.decisive.t_max) for run in runs])
    if any(run.speed_correlation is not None for run in runs):
        yield Column("r(‖Δ‖,\nspeed)", [correlation(run.speed_correlation) for run in runs])
    if any(run.sync.offset for run in runs):
        yield Column("offset\n[s]", [f"{run.sync.offset:+.4f}" for run in runs])
    if any(run.left_out for run in runs):
        yield Column("left\nout", [str(run.left_out) for run in runs])


def _seconds(value: float | None) -> str | None:
    return None if value is None else text.seconds(value)


def _cell(one: Statistics | None) -> str | None:
    return None if one is None else text.number(one.max, one.unit, one.tolerance)


def _statistics(run: Deviation) -> Iterator[Column]:
    """Yield the columns of the statistics of one log, a row a quantity."""
    every = run.all_statistics
    start = dict(zip(AXES, run.start, strict=True))
    yield Column("Quantity", [f"{symbol(one)} [{text.SHOWN[one.unit][0]}]" for one in every], key=True)
    yield Column("Verdict", [judged(one.verdict) for one in every])
    yield Column("tolerance", [text.limit(one.tolerance, one.unit) for one in every])
    yield Column("max", [_cell(one) for one in every])
    yield Column("at t [s]", [text.seconds(one.t_max) for one in every])
    for name in ("rms", "p95", "mean", "std"):
        yield Column(name, [text.number(getattr(one, name), one.unit) for one in every])
    known = [start.get(one.quantity) if one.kind in ("axis", "norm") else None for one in every]
    yield Column("at start", [value if value is None else text.number(value, "m") for value in known])
    if any(one.missing for one in every):
        yield Column("judged", [None if one.samples is None else str(one.samples) for one in every])
    if any(one.share_out for one in every):
        yield Column("out", [None if one.share_out is None else text.percent(one.share_out) for one in every])
