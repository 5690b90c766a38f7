"""What changed since an earlier comparison, as a section and as checks: what is worse first."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import BaselineComparison, CriterionChange, QuantityChange, Worse
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.comparison.verdict import UNITS
from urmpipe_pipeline.comparison.wording import quantity_name, size_of, symbol
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.parts import Heads, columns_of, option_words, table_of
from urmpipe_pipeline.presentation.section import Cell, Check, Fact, Judged, Ref, Section, Table, Value

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
            said = f"{size_of(one.now)}: {worse_words(one)} (noise {noise})" if one.worse else ""
            yield _check(run, quantity_name(one.now), said)
    for lost in found.missing:
        if lost.run == run:
            said = f"{lost.quantity}: in the baseline, not compared any more"
            yield _check(run, f"{lost.quantity} is there", said)


def criterion_checks(found: BaselineComparison) -> Iterator[Check]:
    """Yield a check for each criterion after ISO 9283 that was compared then."""
    for one in found.criteria:
        noise = f" (noise {written(Value(one.noise, _shown(one.now.unit), given=True), unit=True)})"
        said = f"{one.now.name}: {criterion_words(one)}{noise}" if one.worse else ""
        yield _check("criteria", one.now.name, said)
    for lost in found.missing:
        said = f"{lost.quantity}: in the baseline, without a value now"
        yield _check("criteria", f"{lost.quantity} is there", said)


def criterion_words(one: CriterionChange) -> str:
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


def since_words(found: BaselineComparison) -> str:
    """Return how much is worse than a baseline: "5 quantities worse, 1 gone", "nothing worse"."""
    said = [f"{quantities(len(found.worse))} worse"] if found.worse else []
    criteria = text.join_words([one.now.name for one in found.worse_criteria])
    said += [f"{criteria} worse"] if criteria else []
    said += [f"{len(found.missing)} gone"] if found.missing else []
    return ", ".join(said) or "nothing worse"


def quantities(count: int) -> str:
    """Return a count of quantities: "1 quantity", "5 quantities"."""
    return f"{count} {'quantity' if count == 1 else 'quantities'}"


def worse_words(one: QuantityChange) -> str:
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
    yield Fact("Since the baseline", since_words(found))
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
