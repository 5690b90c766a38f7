"""Tables and sections of a comparison.

1. Tables: the logs from best to worst, the statistics of each, and its line among those of other results.
2. `baseline_section`, `baseline_checks`: what changed since a baseline, the worse first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import (
    ROW,
    BaselineComparison,
    Comparison,
    CriterionChange,
    QuantityChange,
    Worse,
)
from urmpipe_pipeline.comparison.deviation import Deviation, Share, ShareKind, Statistics, Verdict
from urmpipe_pipeline.comparison.facts import MEANING, format_alignment, max_place, max_value, share_value
from urmpipe_pipeline.comparison.verdict import UNITS
from urmpipe_pipeline.comparison.wording import absolute_symbol, quantity_name, symbol
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.palette import run_colour
from urmpipe_pipeline.presentation.parts import (
    Heads,
    columns_of,
    minute_of,
    option_words,
    rows_table,
    table_of,
)
from urmpipe_pipeline.presentation.section import (
    Cell,
    Check,
    Column,
    Fact,
    Judged,
    Place,
    Ref,
    Section,
    Table,
    Value,
)

ABOUT = {"axis": "position", "norm": "position", "path": "path", "angle": "orientation", "joint": "joints"}
"""What the kinds of deviation are about."""


def ranking_tables(result: Comparison) -> tuple[Table, ...]:
    """Return the logs from best to worst: how far off, then when, where and how compared; none of one log."""
    if len(result.runs) < 2:
        return ()
    names: Heads[Deviation] = {"run": ("Log", lambda one: reference_of(result, one))}
    far: Heads[Deviation] = {
        **names,
        "verdict": ("Verdict", lambda one: Judged(one.verdict)),
        "decided_by": ("Decided by", lambda one: absolute_symbol(one.decisive)),
        **_sizes(result),
    }
    note = "The logs are ranked by the largest share of a tolerance that each uses."
    left_out = "Left out: samples of the log without a counterpart or without a value."
    partly = {share.quantity for one in result.runs for share in one.incomplete_shares}
    note += "".join(f" {name.capitalize()}: share {MEANING[name]}." for name in MEANING if name in partly)
    hidden = set(MEANING) - partly
    columns = (
        replace(one, brief=one.key not in hidden, page=one.key not in hidden and _leads(result, one.key))
        for one in columns_of(result.ranking, far)
    )
    return (
        Table(
            "Largest deviations, from best to worst",
            tuple(columns),
            note,
            page_title="Largest deviations, from worst to best",
        ),
        Table("When, where and how compared", tuple(_conditions(result, names)), left_out, page=False),
    )


def _leads(result: Comparison, key: str) -> bool:
    """Tell whether a page shows a column of the largest deviations here, not in the statistics of each log.

    Where joints of a unit are compared, the statistics have the largest values of all in that unit.
    """
    joints = {held.unit for one in result.runs for held in one.joint_statistics.values()}
    if key in ("max_angle", "max_joint", "max_slide"):
        return "rad" not in joints and key == "max_angle"
    return not (key.startswith("max_") and "m" in joints)


def reference_of(result: Comparison, one: Deviation) -> Ref:
    """Return the name of a log, as a reference to its section, in its colour."""
    return Ref(one.name, run_colour(result.runs.index(one)))


def _sizes(result: Comparison) -> Heads[Deviation]:
    """Return the columns of the largest deviations, and of how much was out and seen."""

    def seen(quantity: ShareKind) -> Callable[[Deviation], Cell]:
        return lambda one: share_value(one.shares.get(quantity))

    return {
        "max_x": ("max |Δx|", lambda one: max_value(one.statistics.get("x"))),
        "max_y": ("max |Δy|", lambda one: max_value(one.statistics.get("y"))),
        "max_z": ("max |Δz|", lambda one: max_value(one.statistics.get("z"))),
        "max_norm": ("max ‖Δ‖", lambda one: max_value(one.statistics.get("norm"))),
        "max_path": ("max path", lambda one: max_value(one.statistics.get("path"))),
        "max_angle": ("max angle", lambda one: max_value(one.statistics.get("angle"))),
        "max_joint": ("max joint", lambda one: max_value(one.worst_joint("rad"))),
        "max_slide": ("max slide", lambda one: max_value(one.worst_joint("m"))),
        "out_fraction": ("out", lambda one: Value(one.out_fraction, "%")),
        "coverage": ("coverage", seen("coverage")),
        "judged": ("judged", seen("judged")),
    }


def _conditions(result: Comparison, names: Heads[Deviation]) -> Iterator[Column]:
    """Yield the columns of when and where each log is worst, and how it was compared."""
    runs = result.ranking
    heads: Heads[Deviation] = {
        **names,
        "t": ("decided at t", lambda one: Value(_decided_t(one), "s")),
        "place": ("log there at x, y, z", _decided_place),
        "longest_out_interval": ("longest out", lambda one: _stretch(one, "duration")),
        "longest_out_interval_t": ("longest out from t", lambda one: _stretch(one, "t")),
        "sync_offset": ("offset", lambda one: Value(one.sync.offset, "s", signed=True)),
        "speed_correlation": ("r(‖Δ‖, speed)", lambda one: Value(one.speed_correlation, "1", signed=True)),
        "left_out": ("left out", lambda one: Value(one.left_out)),
        "warnings": ("warnings", lambda one: Value(len(result.warnings_of(one)))),
        "alignment": ("alignment", lambda one: format_alignment(one)[0]),
    }
    if not all(one.run.timed for one in runs):
        row = ("decided in row", lambda one: Value(_decided_row(one)))
        heads = {
            **names,
            "t": row,
            **{key: heads[key] for key in ("place", "left_out", "warnings", "alignment")},
        }
    brief = {"run", "t", "longest_out_interval", "longest_out_interval_t", "speed_correlation"}
    brief |= {"sync_offset"} if any(one.sync.offset for one in runs) else set()
    brief |= {"left_out"} if any(one.left_out for one in runs) else set()
    for column in columns_of(runs, heads):
        yield replace(column, brief=column.key in brief)


def _decided_t(one: Deviation) -> float | None:
    """Return when the verdict was decided in [s]: of a share where most was unseen."""
    held = one.decisive
    return (
        held.t_max if isinstance(held, Statistics) else held.longest_unseen.t if held.longest_unseen else None
    )


def _decided_place(one: Deviation) -> Place | None:
    return max_place(one, one.worst_statistics) if one.decisive is one.worst_statistics else None


def _decided_row(one: Deviation) -> int | None:
    """Return the row, from 1, in which the verdict was decided: of a share the first of those unseen."""
    held = one.decisive
    if isinstance(held, Statistics):
        return one.row(held)
    return held.longest_unseen.sample + 1 if held.longest_unseen else None


def _stretch(one: Deviation, name: str) -> Value | None:
    longest = one.longest_out_interval
    return None if longest is None else Value(getattr(longest, name), "s")


def comparison_lines(result: Comparison) -> Iterator[dict[str, Cell]]:
    """Yield the lines of a comparison among several: one a log, from best to worst."""
    lost: list[str] = []
    if result.baseline:
        lost = [*(one.run for one in result.baseline.worse), *(one.run for one in result.baseline.missing)]
    for one in result.ranking:
        worse = lost.count(one.name)
        yield {
            "Log": reference_of(result, one),
            "Recording": result.recording.name if result.recording else "",
            "Robot": one.run.robot.name if one.run.robot else "",
            "Verdict": Judged(one.verdict),
            "Worse than its baseline": f"in {count_quantities(worse)}" if worse else "",
            **{title: cell(one) for title, cell in _sizes(result).values()},
            "Reference": result.reference.name,
            "Assuming": "; ".join(result.assumptions),
            "Made [UTC]": minute_of(result.provenance.created),
        }


def statistics_tables(one: Deviation, *, ranked: bool = False) -> Iterator[Table]:
    """Yield the statistics of every quantity of a log: those in m, then those in rad, then the shares.

    Args:
        one: The log.
        ranked: Whether a table of all logs has their largest deviations.
    """
    starts = dict(zip(map(id, one.all_statistics), (float(values[0]) for values in one.values), strict=True))
    for unit in text.SHOWN:
        own = [held for held in one.all_statistics if held.unit == unit]
        if own:
            about = text.join_list(list(dict.fromkeys(ABOUT[held.kind] for held in own)))
            start = (
                f"t = {text.format_seconds(float(one.t_ns[0]) / 1e9)} s" if one.run.timed else "the first row"
            )
            note = (
                "max, rms and p95 are of absolute values, mean and std signed. At start: the difference of"
                f" the start poses (mutual calibration) at {start}."
            )
            known = {"tolerance"} | (
                {"max"} if ranked and all(held.kind != "joint" for held in own) else set()
            )
            columns = (
                replace(column, page=column.key not in known) for column in _statistics(one, own, starts)
            )
            yield Table(f"Statistics of {about}", tuple(columns), note)
    if one.shares:
        note = " ".join(f"{name.capitalize()}: share {MEANING[name]}." for name in one.shares)
        yield Table("How much was judged", _shares(one), note, brief=False)


def _shares(one: Deviation) -> tuple[Column, ...]:
    """Return the columns of the shares of a log."""

    def unseen(name: str, unit: str = "") -> Callable[[Share], Cell]:
        return lambda held: (
            None if held.longest_unseen is None else Value(getattr(held.longest_unseen, name), unit)
        )

    heads: Heads[Share] = {
        "quantity": ("Quantity", lambda held: held.quantity),
        "verdict": ("Verdict", lambda held: Judged(held.verdict)),
        "tolerance": ("at least", lambda held: Value(held.tolerance, "%", given=True)),
        "value": ("share", share_value),
        "samples": ("samples", lambda held: Value(held.samples)),
        "total": ("total", lambda held: Value(held.total)),
        "unseen_t": ("longest unseen from t", unseen("t", "s")),
        "longest_unseen": ("unseen for", unseen("duration", "s")),
        "unseen_samples": ("unseen samples", unseen("samples")),
    }
    return columns_of(list(one.shares.values()), heads)


def _statistics(one: Deviation, own: list[Statistics], starts: Mapping[int, float]) -> tuple[Column, ...]:
    """Return the columns of the statistics of some quantities in one unit."""
    joint = one.worst_joint(own[0].unit)

    def number(key: str) -> tuple[str, Callable[[Statistics], Cell]]:
        return key, lambda held: Value(getattr(held, key), held.unit)

    heads: Heads[Statistics] = {
        "quantity": ("Quantity", symbol),
        "verdict": ("Verdict", lambda held: Judged(held.verdict)),
        "tolerance": ("tolerance", lambda held: Value(held.tolerance, held.unit, given=True)),
        "max": ("max", lambda held: max_value(held, most=held is joint and held.max > 0.0)),
        "t_max": ("at t", lambda held: Value(held.t_max, "s"))
        if one.run.timed
        else ("in row", lambda held: Value(one.row(held))),
        **{key: number(key) for key in ("rms", "p95", "mean", "std")},
        "start": ("at start", lambda held: Value(starts[id(held)], held.unit)),
        "out_of_tolerance": ("samples out", lambda held: Value(held.out_of_tolerance)),
        "out_fraction": ("out", lambda held: Value(held.out_fraction, "%")),
        "missing": ("no value", lambda held: Value(held.missing or None)),
    }
    return columns_of(own, heads)


def statistics_rows(result: Comparison) -> Table:
    """Return what --csv writes: a row a log and quantity; lengths in [m], angles in [rad], times in [s]."""
    return rows_table("Statistics", ROW, result.rows())


NAMED = 30
"""Quantities and logs that a fact names; more are counted."""

WORDS: dict[Worse, str] = {"max": "max", "rms": "rms", "out_fraction": "out", "samples": "samples"}
"""What people call what may be worse."""


def baseline_section(found: BaselineComparison, rank: int) -> Section:
    """Return what changed since an earlier comparison."""
    said = "a log of the baseline, not compared any more"
    gone = [
        Section(one.run, "fail", checks=(_check(one.run, "log is there", f"{one.run}: {said}"),))
        for one in found.missing
        if one.quantity is None
    ]
    return Section(
        f"Against the baseline {found.name}",
        found.verdict,
        tuple(_facts(found)),
        tuple(_tables(found)),
        sections=tuple(gone),
        rank=rank,
    )


def baseline_checks(found: BaselineComparison, run: str) -> Iterator[Check]:
    """Yield a check for each quantity of a log that was compared then."""
    for one in found.changes:
        if one.run == run:
            noise = text.format_stated(one.noise, one.now.unit)
            said = f"{absolute_symbol(one.now)}: {format_worse(one)} (noise {noise})" if one.worse else ""
            yield _check(run, quantity_name(one.now), said)
    for lost in found.missing:
        if lost.run == run:
            said = f"{lost.quantity}: in the baseline, not compared any more"
            yield _check(run, f"{lost.quantity} is there", said)


def criterion_checks(found: BaselineComparison) -> Iterator[Check]:
    """Yield a check for each criterion after ISO 9283 that was compared then."""
    for one in found.criteria:
        noise = f" (noise {written(Value(one.noise, _shown(one.now.unit), given=True), unit=True)})"
        said = f"{one.now.name}: {format_criterion_change(one)}{noise}" if one.worse else ""
        yield _check("criteria", one.now.name, said)
    for lost in found.missing:
        said = f"{lost.quantity}: in the baseline, without a value now"
        yield _check("criteria", f"{lost.quantity} is there", said)


def format_criterion_change(one: CriterionChange) -> str:
    """Return a criterion before and now: "0.1000 → 0.2000 mm"."""
    unit = _shown(one.now.unit)
    before, now = abs(one.before.value or 0.0), abs(one.now.value or 0.0)
    return f"{written(Value(before, unit, now))} → {written(Value(now, unit, before), unit=True)}"


def _shown(unit: str) -> str:
    """Return the unit by which a criterion is written: shares as %."""
    return "%" if unit == "1" else unit


def _check(run: str, name: str, said: str) -> Check:
    """Return a check that fails if there is something to say."""
    about = f"{run} against baseline"
    return Check(name, "fail" if said else "pass", said, about, kind="worse-than-baseline")


def format_worse_count(found: BaselineComparison) -> str:
    """Return how much is worse than a baseline: "5 quantities worse, 1 gone", "nothing worse"."""
    said = [f"{count_quantities(len(found.worse))} worse"] if found.worse else []
    criteria = text.join_list([one.now.name for one in found.worse_criteria])
    said += [f"{criteria} worse"] if criteria else []
    said += [f"{len(found.missing)} gone"] if found.missing else []
    return ", ".join(said) or "nothing worse"


def count_quantities(count: int) -> str:
    """Return a count of quantities: "1 quantity", "5 quantities"."""
    return f"{count} {'quantity' if count == 1 else 'quantities'}"


def format_worse(one: QuantityChange) -> str:
    """Return what of a quantity is worse, before and now: "max 1.0000 → 2.0000 mm, out 1.0 % → 3.0 %"."""
    pairs = {name: _pair(one, name) for name in one.worse}
    return ", ".join(
        f"{WORDS[name]} {written(before)} → {written(now, unit=True)}"
        for name, (before, now) in pairs.items()
    )


def _pair(one: QuantityChange, name: Worse) -> tuple[Value, Value]:
    """Return a statistic before and now, with digits that tell them apart if it changed."""
    before, now = getattr(one.before, name), getattr(one.now, name)
    unit = {"out_fraction": "%", "samples": ""}.get(name, one.now.unit)
    told = name in (*one.worse, *one.better)
    return Value(before, unit, now if told else None), Value(now, unit, before if told else None)


def worse_facts(found: BaselineComparison) -> Iterator[Fact]:
    """Yield what decides against a baseline: how much is worse, and what."""
    yield Fact("Since the baseline", format_worse_count(found))
    worse = [f"{symbol(one.now)} of {one.run} ({_words(one.worse)})" for one in found.worse]
    yield Fact("Worse", _listed(worse))
    yield Fact("Gone", _listed(list(map(str, found.missing))))


def _facts(found: BaselineComparison) -> Iterator[Fact]:
    yield from worse_facts(found)
    yield Fact("New", _listed(list(map(str, found.new))))
    noise = (f"{kind} {text.format_stated(value, UNITS[kind])}" for kind, value in found.noise.items())
    yield Fact("Noise", ", ".join(noise), "smaller changes are not listed")
    yield Fact("Recording of the baseline", str(found.recording or ""), brief=False)


def _tables(found: BaselineComparison) -> Iterator[Table]:
    """Yield the quantities that changed by more than the noise, and what was made differently."""
    changed = sorted((one for one in found.changes if one.changed), key=lambda one: not one.worse)
    if changed:
        yield Table(f"Changed since {found.name} by more than the noise", columns_of(changed, _HEADS))
    criteria = sorted(
        (one for one in found.criteria if one.worse or one.better), key=lambda one: not one.worse
    )
    if criteria:
        yield Table(
            f"Criteria changed since {found.name} by more than the noise", columns_of(criteria, _CRITERIA)
        )
    if found.differences:
        rows = [
            (one.what, *(option_words(one.what, value, UNITS) for value in (one.before, one.now)))
            for one in found.differences
        ]
        heads = {"what": "What", "before": "before", "now": "now"}
        yield table_of("Made differently", heads, rows, brief=True)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _words(found: Sequence[Worse]) -> str:
    return ", ".join(WORDS[name] for name in found)


def _columns(name: Worse) -> dict[str, tuple[str, Callable[[QuantityChange], Cell]]]:
    """Return a statistic before and now; a share or a count only where it changed."""

    def cells(one: QuantityChange) -> tuple[Cell, Cell]:
        shown = name in ("max", "rms", *one.worse, *one.better)
        return _pair(one, name) if shown else (None, None)

    word = WORDS[name]
    return {
        f"{word}_before": (f"{word} before", lambda one: cells(one)[0]),
        f"{word}_now": (f"{word} now", lambda one: cells(one)[1]),
    }


def _verdict(one: QuantityChange, verdict: Verdict | None) -> Judged:
    """Return a verdict where it changed."""
    return Judged(verdict if one.before.verdict != one.now.verdict else None)


_CRITERIA: Heads[CriterionChange] = {
    "name": ("Criterion", lambda one: one.now.name),
    "worse": ("worse", lambda one: "worse" if one.worse else "better"),
    "before": ("before", lambda one: Value(one.before.value, _shown(one.now.unit))),
    "now": ("now", lambda one: Value(one.now.value, _shown(one.now.unit))),
}
"""The columns of criteria that changed, by their keys."""

_HEADS: Heads[QuantityChange] = {
    "run": ("Log", lambda one: Ref(one.run)),
    "quantity": ("Quantity", lambda one: symbol(one.now)),
    "worse": ("worse", lambda one: _words(one.worse)),
    "better": ("better", lambda one: _words(one.better)),
    **_columns("max"),
    **_columns("rms"),
    **_columns("out_fraction"),
    **_columns("samples"),
    "largest_change": ("most at one sample", lambda one: Value(one.largest_change, one.now.unit)),
    "t_largest_change": ("at t", lambda one: Value(one.t_largest_change, "s")),
    "verdict_before": ("verdict before", lambda one: _verdict(one, one.before.verdict)),
    "verdict_now": ("verdict now", lambda one: _verdict(one, one.now.verdict)),
}
"""The columns of what changed, by their keys."""
