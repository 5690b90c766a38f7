"""What a comparison judges: a check a quantity with a tolerance, and one a quantity of the baseline."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from urmpipe_pipeline.comparison.change import Absent, Change
from urmpipe_pipeline.comparison.change_wording import noise_words, worse_words
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Statistics
from urmpipe_pipeline.comparison.symbols import size_of
from urmpipe_pipeline.comparison.wording import decided_words, out_words
from urmpipe_pipeline.presentation.section import Check

WORSE = "worse-than-baseline"
"""The kind of a check against the baseline."""


def log_checks(result: Comparison, one: Deviation) -> Iterator[Check]:
    """Yield the checks of a log: its tolerances, then its quantities against the baseline."""
    yield from (_judged(one, held) for held in one.all_statistics if held.tolerance is not None)
    if result.baseline:
        yield from (_changed(change) for change in result.baseline.changes if change.run == one.name)
        yield from (_lost(absent) for absent in result.baseline.gone if absent.run == one.name)


def gone_check(absent: Absent) -> Check:
    """Return the check of a log that only the baseline has."""
    said = f"{absent.run}: a log of the baseline, not compared any more"
    return Check("log is there", "fail", said, f"{absent.run} against baseline", WORSE)


def log_properties(result: Comparison, one: Deviation) -> dict[str, Any]:
    """Return what is worth keeping of a log, and every field of the statistics of each quantity."""
    longest = one.longest_out
    return {
        "reference": result.reference.name,
        "verdict": one.verdict,
        "duration": one.duration,
        "samples": len(one.sample),
        "left_out": one.left_out,
        "reference_left_out": one.reference_left_out,
        "sync_offset": one.sync.offset,
        "share_out": one.share_out,
        "longest_out": 0.0 if longest is None else longest.duration,
        "speed_correlation": one.speed_correlation,
    } | {
        f"{quantity_name(held)}.{field}": value
        for held in one.all_statistics
        for field, value in asdict(held).items()
    }


def quantity_name(one: Statistics) -> str:
    """Return the name of a quantity, unique in its log: a joint may be called x."""
    return f"joint {one.quantity}" if one.kind == "joint" else one.quantity


def _judged(one: Deviation, held: Statistics) -> Check:
    row = "" if held.missing else f" (row {one.row(held)})"
    out = out_words(held.out_of_tolerance or 0, len(one.sample))
    said = f"{decided_words(held)}{row}; out of tolerance: {out}"
    verdict = held.verdict or "pass"
    return Check(quantity_name(held), verdict, said if verdict == "fail" else "", one.name)


def _changed(change: Change) -> Check:
    said = f"{size_of(change.now)}: {worse_words(change)} ({noise_words(change)})"
    return Check(
        quantity_name(change.now),
        "fail" if change.worse else "pass",
        said if change.worse else "",
        f"{change.run} against baseline",
        WORSE,
    )


def _lost(absent: Absent) -> Check:
    said = f"{absent.quantity}: in the baseline, not compared any more"
    return Check(f"{absent.quantity} is there", "fail", said, f"{absent.run} against baseline", WORSE)
