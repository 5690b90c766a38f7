"""How a comparison is said in words: the same in the terminal, the recording and the report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from urmpipe_models.display import format_count
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES, Deviation, SampleInterval, Share, Statistics
from urmpipe_pipeline.comparison.verdict import MIN_SHARES, DeltaMeterResult
from urmpipe_pipeline.presentation.digits import held, written
from urmpipe_pipeline.presentation.section import Value
from urmpipe_pipeline.provenance import format_assumptions, format_defaults

SYMBOLS = dict(zip(AXES, ("Δx", "Δy", "Δz", "‖Δ‖"), strict=True))
"""The quantities of a deviation as people read them."""

NAMED = 3
"""Logs out of tolerance that a verdict names; more are only counted."""


def format_verdict(one: Comparison) -> str:
    """Return which logs are out of tolerance against what, or that all are within, and what that rests on."""
    failed = [run for run in one.runs if run.verdict == "fail"]
    total = len(one.runs) + len(one.failed_logs)
    said = f"{_who(failed or one.runs, total)} {'out of' if failed else 'within'} tolerance"
    said += f" against {one.reference.name}{_points(one)}{_part(one)}{_clocks(one)}"
    if one.baseline and one.baseline.verdict == "fail":
        said += f", {'and' if failed else 'but'} worse than the baseline {one.baseline.name}"
    lost = f"; not judged: {text.join_list([log.name for log in one.failed_logs])}" if one.failed_logs else ""
    return said + format_assumptions(one.assumptions) + format_defaults(one.provenance) + lost


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
    if not one.worst.statistics:
        return ", by the joints alone"
    every = all(run.run.log.joints for run in one.runs)
    return f", by the joints {'on both sides' if every else 'of the reference'}"


def _part(one: Comparison) -> str:
    """Return what a verdict does not rest on, as "; coverage 0.5 % of 90 % needed, ..."; else nothing."""
    partly = [run for run in one.runs if run.incomplete_shares]
    if len(partly) > NAMED:
        return f"; coverage or judged below 99 % in {len(partly)} logs"
    several = len(one.runs) > 1
    return "".join(
        f"; {format_share(share, run.name if several else '')}"
        for run in partly
        for share in run.incomplete_shares
    )


def _clocks(one: Comparison) -> str:
    """Return which clocks were put together by absolute stamps, the offset of a single log; else nothing."""
    stamped = [run.sync for run in one.runs if run.sync.mode == "stamps"]
    if not stamped:
        return ""
    if len(one.runs) == 1:
        return f"; clocks by their stamps (offset {text.format_seconds(stamped[0].offset)} s)"
    some = "" if len(stamped) == len(one.runs) else f" of {format_count(len(stamped), 'log')}"
    return f"; clocks{some} by their stamps"


def format_share(one: Share, whose: str = "") -> str:
    """Return a share, of one of several logs with its name, and if it is too small what was not seen.

    As in "coverage 0.5 % of 90 % needed, longest unseen: 3.970 s from t = 0.010 s of the reference".
    """
    of = f" of {whose}" if whose else ""
    if one.verdict != "fail":
        return f"{one.quantity}{of} {text.format_percent(one.value)}"
    said = f"{one.quantity}{of} {held(Value(one.value, '%', one.tolerance, least=True))}"
    return said if whose else f"{said}{format_unseen(one)}"


def format_unseen(one: Share) -> str:
    """Return where most was unseen, as ", longest unseen: 3.970 s from t = 0.010 s of the reference"."""
    side = "reference" if one.quantity == "coverage" else "log"
    return (
        ""
        if one.longest_unseen is None
        else f", longest unseen: {format_interval(one.longest_unseen)} of the {side}"
    )


def symbol(one: Statistics | Share | DeltaMeterResult) -> str:
    """Return what a quantity is called: Δx, ‖Δ‖, path, angle, coverage, or a joint by its name."""
    return SYMBOLS[one.quantity] if one.kind in ("axis", "norm") else one.quantity


def absolute_symbol(one: Statistics | Share | DeltaMeterResult) -> str:
    """Return what the absolute value of a quantity is called: |Δx|, ‖Δ‖, path, angle, |Δ phi1|."""
    if one.kind == "joint":
        return f"|Δ {one.quantity}|"
    return f"|{symbol(one)}|" if one.kind == "axis" else symbol(one)


def quantity_name(one: Statistics | Share) -> str:
    """Return the name of a quantity, unique in its log: a joint may be called x."""
    return f"joint {one.quantity}" if one.kind == "joint" else one.quantity


def format_utilisation(one: Statistics | Share | DeltaMeterResult) -> str:
    """Return how much of its tolerance a deviation uses up: "71.0 % of the tolerance"; else nothing."""
    if one.utilisation is None or isinstance(one, Share):
        return ""
    if isinstance(one, Statistics) and one.missing:
        return f"no value at {one.missing} of {(one.samples or 0) + one.missing} samples"
    return "" if math.isinf(one.utilisation) else f"{text.format_portion(one.utilisation)} the tolerance"


def format_value(one: Statistics | Share) -> str:
    """Return how far a quantity goes, and of how much: "|Δx| = 4.2000 mm of 3.5 mm allowed".

    Where a quantity with a tolerance lacks values, that: "angle has no value at 3 of 40 samples".
    """
    if isinstance(one, Share):
        return f"{one.quantity} = {held(Value(one.value, '%', one.tolerance, least=True))}"
    if one.tolerance is not None and one.missing:
        return f"{absolute_symbol(one)} has {format_utilisation(one)}"
    return f"{absolute_symbol(one)} = {held(Value(one.max, one.unit, one.tolerance))}"


def format_decisive(one: Statistics | Share) -> str:
    """Return how much of how much a quantity is, and when; of a share what was not seen.

    As in "|Δx| = 4.2000 mm of 3.5 mm allowed (1.2 times the tolerance) at t = 1.250 s".
    """
    if isinstance(one, Share):
        return (
            f"{format_value(one)} ({one.samples} of {format_count(one.total, 'sample')}){format_unseen(one)}"
        )
    lacks = one.tolerance is not None and one.missing
    used = format_utilisation(one)
    return (
        format_value(one)
        if lacks
        else f"{format_value(one)}{f' ({used})' if used else ''} {format_time_of_max(one)}"
    )


def format_peak(one: Deviation) -> str:
    """Return what the furthest quantity of a log does where it is largest: it decides, if no share does."""
    return "decides" if isinstance(one.decisive, Statistics) else "deviates most"


def format_time_of_max(one: Statistics) -> str:
    """Return when a quantity was largest: "at t = 1.250 s"; of still poses in which row: "in row 3"."""
    timed = not math.isnan(one.t_max)
    return f"at t = {text.format_seconds(one.t_max)} s" if timed else f"in row {one.sample_max + 1}"


def format_delta_meter(one: DeltaMeterResult) -> str:
    """Return what a delta meter found: how much of how much, when, how often it was too much; its doubts."""
    amount = "has no value" if one.utilisation is None else f"= {held(Value(one.worst, 'm', one.allowed))}"
    used = format_utilisation(one)
    said = (
        f"{absolute_symbol(one)} {amount}{f' ({used})' if used else ''} at t = {text.format_seconds(one.t)} s"
    )
    out = f"out of tolerance: {format_out_of_tolerance(one.out_of_tolerance, one.samples)}"
    lacks = (
        f"coverage {text.format_percent(one.coverage)}: {one.missing} without a value" if one.missing else ""
    )
    return "; ".join(filter(None, (said, out, lacks, *one.caveats)))


def format_out_of_tolerance(out: int, of: int) -> str:
    """Return how many samples are out of tolerance: "13 of 100 samples (13.0 %)"."""
    return f"{out} of {format_count(of, 'sample')} ({text.format_percent(out / of)})"


def format_interval(found: SampleInterval) -> str:
    """Return how long and from when a log was out of tolerance or unseen: "0.500 s from t = 1.250 s"."""
    if found.t is None or found.duration is None:
        return f"{format_count(found.samples, 'row')} from row {found.sample + 1}"
    lasts = "1 sample at" if found.samples == 1 else f"{text.format_seconds(found.duration)} s from"
    return f"{lasts} t = {text.format_seconds(found.t)} s"


def format_tolerance(allowed: Mapping[str, float], joint_units: Iterable[str] = ("rad",)) -> str:
    """Return a comparison's tolerance as people read it: "±3.5 mm per axis, 0.5 deg of orientation".

    Args:
        allowed: In [m] or [rad], by kind or coordinate; least shares, named if they are not the default.
        joint_units: The units of the joints that are held to a tolerance, rad or m.
    """
    words = {
        "axis": "±{} per axis",
        "norm": "{} norm",
        "path": "{} from the path",
        "angle": "{} of orientation",
        "joint": "±{} per joint",
        **{axis: f"±{{}} {axis}" for axis in "xyz"},
        **{share: f"{share} {{}}" for share in MIN_SHARES},
    }
    units = {"angle": ["rad"], "joint": sorted(set(joint_units), reverse=True)}
    return ", ".join(
        words[kind].format(
            written(Value(value, "%", given=True), unit=True)
            if kind in MIN_SHARES
            else " or ±".join(text.format_stated(value, unit) for unit in units.get(kind, ["m"]))
        )
        for kind, value in allowed.items()
        if value != MIN_SHARES.get(kind)
    )
