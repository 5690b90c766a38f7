"""How a comparison is said in words: the same in the terminal, the recording and the report."""

from __future__ import annotations

import math
from collections.abc import Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.comparison.deviation import WHOLE, Deviation, Statistics, Stretch
from urmpipe_pipeline.comparison.symbols import SYMBOLS, allowed_words, portion_words, size_of, used_words

NAMED = 3
"""Logs out of tolerance that a verdict names; more are only counted."""


def verdict_words(comparisons: Sequence[Comparison]) -> str:
    """Return which logs are out of tolerance against what, or that all are within, and on how much it rests.

    Args:
        comparisons: At least one.
    """
    runs = [run for one in comparisons for run in one.runs]
    failed = [run for run in runs if run.verdict == "fail"]
    references = {one.reference.name for one in comparisons}
    said = f"{_who(failed or runs, len(runs))} {'out of' if failed else 'within'} tolerance"
    said += f" against {references.pop()}" if len(references) == 1 else ""
    points = {_points(one) for one in comparisons}
    said += points.pop() if len(points) == 1 else ""
    said += part_words([one.covered(run) for one in comparisons for run in one.runs])
    return said + _since(comparisons, failed=bool(failed))


def _since(comparisons: Sequence[Comparison], *, failed: bool) -> str:
    """Return that comparisons are worse than their baselines."""
    worse = [one.baseline.name for one in comparisons if one.baseline and one.baseline.verdict == "fail"]
    if not worse:
        return ""
    joined = ", and" if failed else ", but"
    if len(comparisons) == 1:
        return f"{joined} worse than the baseline {worse[0]}"
    than = "is worse than its baseline" if len(worse) == 1 else "are worse than their baselines"
    return f"{joined} {len(worse)} of {len(comparisons)} comparisons {than}"


def _who(runs: Sequence[Deviation], total: int) -> str:
    """Return some of so many logs: the only one by name, else how many, and which if they are few."""
    if total == 1:
        return runs[0].name
    if len(runs) == total:
        return "both logs" if total == 2 else f"all {total} logs"
    names = f" ({', '.join(run.name for run in runs)})" if len(runs) <= NAMED else ""
    return f"{len(runs)} of {total} logs{names}"


def _points(one: Comparison) -> str:
    """Return by which tool centre points a log is held against others; nothing if a path is the reference."""
    if not one.reference.joints:
        return ""
    if one.provenance.options.get("tcp") == "recorded":
        return ", as recorded on both sides"
    every = all(run.run.log.joints for run in one.runs)
    return f", by the joints {'on both sides' if every else 'of the reference'}"


def decided_words(one: Statistics) -> str:
    """Return how much of how much a quantity is, and when.

    As in "|Δx| = 4.2000 mm of 3.5 mm allowed (1.2 times the tolerance) at t = 1.250 s".
    """
    if _lacks(one):
        return amount_words(one)
    used = f" ({used_words(one)})" if one.tolerance is not None else ""
    return f"{amount_words(one)}{used} at t = {text.seconds(one.t_max)} s"


def amount_words(one: Statistics) -> str:
    """Return how far a quantity goes, and of how much: "|Δx| = 4.2000 mm of 3.5 mm allowed".

    Where a quantity with a tolerance lacks values, that: "angle has no value at 3 of 40 samples".
    """
    if _lacks(one):
        return f"{size_of(one)} has {used_words(one)}"
    return f"{size_of(one)} = {text.quantity(one.max, one.unit, one.tolerance)}{of_allowed(one)}"


def _lacks(one: Statistics) -> bool:
    """Tell whether a quantity is out of its tolerance because it lacks values."""
    return one.tolerance is not None and one.missing > 0


def out_words(out: int, of: int) -> str:
    """Return how many samples are out of tolerance: "13 of 100 samples (13.0 %)"."""
    return f"{out} of {text.counted(of, 'sample')} ({text.percent(out / of)})"


def stretch_words(found: Stretch) -> str:
    """Return how long and from when a log was out of tolerance: "0.500 s from t = 1.250 s"."""
    if found.samples == 1:
        return f"1 sample at t = {text.seconds(found.t)} s"
    return f"{text.seconds(found.duration)} s from t = {text.seconds(found.t)} s"


def of_allowed(one: Statistics) -> str:
    """Return of how much a quantity is: " of 3.5 mm allowed"; nothing without a tolerance."""
    if one.tolerance is None:
        return ""
    return f" of {text.limit(one.tolerance, one.unit)} {text.SHOWN[one.unit][0]} allowed"


def tolerance_words(comparison: Comparison) -> str:
    """Return what a comparison allows, that of joints in the units of those that were compared."""
    units = {one.unit for run in comparison.runs for one in run.joint_statistics.values()}
    return allowed_words(comparison.tolerance, units or {"rad"})


def part_words(covered: Sequence[float]) -> str:
    """Return what a verdict does not rest on: "; only 40.0 % of the reference was judged"; else nothing.

    Args:
        covered: Share of the reference that each log covers, 0..1.
    """
    partly = [share for share in covered if share < WHOLE]
    if not partly:
        return ""
    if len(covered) == 1:
        return f"; only {text.percent(partly[0])} of the reference was judged"
    verb = "covers" if len(partly) == 1 else "cover"
    return f"; {text.counted(len(partly), 'log')} {verb} only a part of the reference"


def meter_words(one: DeltaVerdict) -> str:
    """Return what a delta meter found: how much of how much, when, and how often it was too much."""
    used = meter_used(one)
    said = f"{meter_amount(one)}{f' ({used})' if used else ''} at t = {text.seconds(one.t)} s"
    return f"{said}; out of tolerance: {out_words(one.out_of_tolerance, one.samples)}"


def meter_used(one: DeltaVerdict) -> str:
    """Return how much of its tolerance a delta meter uses up; nothing without a value, or if 0 is allowed."""
    return "" if one.used is None or math.isinf(one.used) else portion_words(one.used)


def meter_amount(one: DeltaVerdict) -> str:
    """Return how far a delta meter goes, and of how much: "|Δx| = 4.2000 mm of 3.5 mm allowed"."""
    if one.used is None:
        return f"{meter_size(one)} has no value"
    amount = text.quantity(one.worst, "m", one.allowed)
    return f"{meter_size(one)} = {amount} of {text.limit(one.allowed)} mm allowed"


def meter_size(one: DeltaVerdict) -> str:
    """Return what the absolute value that a delta meter is judged by is called: |Δx| or ‖Δ‖."""
    return SYMBOLS["norm"] if one.quantity == "norm" else f"|{SYMBOLS[one.quantity]}|"


def correlation(r: float | None) -> str:
    """Return a correlation with its sign; a dash where it is not known."""
    return text.NOTHING if r is None else f"{round(r, 3) + 0.0:+.3f}"  # + 0.0: no -0.000
