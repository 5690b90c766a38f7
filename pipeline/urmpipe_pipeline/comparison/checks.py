"""What a comparison judges: a check a quantity with a tolerance, and one a quantity of the baseline."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from urmpipe_pipeline.comparison.baseline_section import baseline_checks
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.wording import decided_words, out_words, quantity_name
from urmpipe_pipeline.presentation.section import Check


def log_checks(result: Comparison, one: Deviation) -> Iterator[Check]:
    """Yield the checks of a log: its tolerances, then its quantities against the baseline."""
    for held in one.all_statistics:
        if held.verdict is not None:
            row = "" if held.missing else f" (row {one.row(held)})"
            out = out_words(held.out_of_tolerance or 0, len(one.sample))
            said = f"{decided_words(held)}{row}; out of tolerance: {out}"
            yield Check(quantity_name(held), held.verdict, said if held.verdict == "fail" else "", one.name)
    if result.baseline:
        yield from baseline_checks(result.baseline, one.name)


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
