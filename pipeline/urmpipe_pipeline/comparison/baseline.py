"""Baseline: the changes of a comparison since an earlier one, beyond a stated noise.

1. Logs are paired by name, or as the only ones (`_pair_logs`), their quantities by kind, name and unit.
2. A quantity is worse if its max or rms grew by more than the noise, if more of its samples are out of
   tolerance than the noise can have put there, or if it has far fewer samples (`QuantityChange`).
3. Logs and quantities that only one side has, and differences in how the two were made, are listed.
4. `baseline_section`, `baseline_checks` and `criterion_checks` present the changes, the worse first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.math3d import Transform, matrix_to_rpy
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import (
    BaselineComparison,
    Comparison,
    CriterionChange,
    QuantityChange,
    SettingDifference,
    UnmatchedQuantity,
    Worse,
)
from urmpipe_pipeline.comparison.deviation import Deviation, Statistics, Verdict
from urmpipe_pipeline.comparison.verdict import (
    MIN_SHARES,
    UNITS,
    absolute_symbol,
    check_tolerance,
    parse_tolerance,
    quantity_name,
    symbol,
    tolerance_for,
)
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.parts import Heads, columns_of, option_words, table_of
from urmpipe_pipeline.presentation.section import Cell, Check, Fact, Judged, Ref, Section, Table, Value

LENGTHS = ("axis", "norm", "path")  # the kinds of a noise without a name
# In [m] and [rad]: a twentieth of the repeatability of the best arms (0.02 mm), yet more than rounding to the
# six digits of a text log, interpolation and other versions of the libraries change a deviation by.
DEFAULT_NOISE = dict.fromkeys((*LENGTHS, "angle", "joint"), 1e-6)
OTHER_NOISE = 1e-6  # s, m/s or 1, of criteria after ISO 9283 that are no lengths and no angles

Key: TypeAlias = tuple[str, str, str]  # kind, quantity and unit: a joint may be called x
Pair: TypeAlias = tuple[Deviation, Deviation]  # a log now, and that of the baseline


def parse_noise(noise: str) -> dict[str, float]:
    """Return the noise in [m] and [rad] by kind, from "2um" (all lengths) or "axis=2um,angle=0.01deg".

    Other kinds keep their default; 0 is allowed.

    Raises:
        OptionError: With all errors.
    """
    return DEFAULT_NOISE | parse_tolerance(noise, "noise", LENGTHS, zero=True)


def complete_noise(noise: float | str | Mapping[str, float] | None) -> dict[str, float]:
    """Return the noise of every kind, from one of all lengths in [m], of some kinds, or a text.

    Raises:
        OptionError: With all errors.
    """
    if isinstance(noise, str):
        return parse_noise(noise)
    levels = noise if isinstance(noise, Mapping) else {} if noise is None else dict.fromkeys(LENGTHS, noise)
    if levels:
        check_tolerance(levels, "noise", zero=True, iso=None)
    return DEFAULT_NOISE | dict(levels)


def compare_with_baseline(
    now: Comparison, before: Comparison, noise: float | str | Mapping[str, float] | None = None
) -> BaselineComparison:
    """Return the changes since an earlier comparison, per log and quantity, and the changed settings.

    Logs are the same if their names are; where both comparisons are of one log, these are compared whatever
    their names. A log of a baseline that was judged on a grid instead of its rows is listed as a difference:
    its figures are not comparable. A quantity is worse if its largest value or its rms grew by more than the
    noise, if more of its samples are out of the same tolerance than the noise can have put there, or if it
    has less than nine tenths of the samples, counted by the time that they cover.

    Args:
        now: The comparison to judge.
        before: The baseline.
        noise: Changes to ignore: of all lengths in [m], or in [m] and [rad] by kind; the others are 1 um and
            1 urad.

    Raises:
        OptionError: If a noise is invalid, or only one of the two is a test after ISO 9283.
    """
    level = complete_noise(noise)
    if now.iso is not None and before.iso is not None:
        return _compare_tests(now, before, (before.iso, now.iso), level)
    if now.iso is not None or before.iso is not None:
        sides = ("a test after ISO 9283", "a comparison log by log")
        baseline, allowed = sides if now.iso is None else sides[::-1]
        raise OptionError(Finding(parameter="baseline", found=baseline, allowed=allowed))
    pairs = _pair_logs(now, before)
    failed = [UnmatchedQuantity(log.name) for log in now.failed_logs]
    gone = _iter_absent(before, {old.name: (run, old) for run, old in pairs})
    return BaselineComparison(
        name=before.name,
        recording=before.recording,
        noise=level,
        changes=tuple(
            change
            for pair in pairs
            if not _is_on_grid(now, before, pair)
            for change in _iter_changes(*pair, level)
        ),
        new=tuple(_iter_absent(now, {run.name: (run, old) for run, old in pairs})),
        missing=tuple(absent for absent in gone if absent not in failed),
        differences=tuple(_iter_differences(now, before, pairs)),
    )


def _compare_tests(
    now: Comparison, before: Comparison, tests: tuple[IsoTest, IsoTest], noise: Mapping[str, float]
) -> BaselineComparison:
    """Return what changed since an earlier test after ISO 9283: its criteria over all cycles."""
    old, new = (
        {criterion.name: criterion for criterion in test.overall if criterion.value is not None}
        for test in tests
    )
    counts = [test.cycle_count for test in tests]
    failed = [cycle.name for cycle in tests[1].failed_cycles]
    gone = [name for name in old if name not in new]
    gone += failed if len(failed) > len(tests[0].failed_cycles) else []
    changes = []
    for name, criterion in new.items():
        if name in old:
            kind = {"m": "norm", "rad": "angle"}.get(criterion.unit, "")
            level = noise.get(name, noise.get(kind, OTHER_NOISE))
            changes.append(CriterionChange(old[name], criterion, level))
    return BaselineComparison(
        name=before.name,
        recording=before.recording,
        noise=noise,
        changes=(),
        new=tuple(UnmatchedQuantity(now.name, name) for name in new if name not in old),
        missing=tuple(UnmatchedQuantity(now.name, name) for name in gone),
        differences=(
            *_differing(_settings(before), _settings(now)),
            *_differing({"cycles": counts[0]}, {"cycles": counts[1]}),
        ),
        criteria=tuple(changes),
    )


def _pair_logs(now: Comparison, before: Comparison) -> list[Pair]:
    """Return the logs of both that are compared: by name, or the only ones."""
    if len(now.runs) + len(now.failed_logs) == len(before.runs) == 1:
        return [(now.runs[0], before.runs[0])]
    old = {run.name: run for run in before.runs}
    return [(run, old[run.name]) for run in now.runs if run.name in old]


def _is_on_grid(now: Comparison, before: Comparison, pair: Pair) -> bool:
    """Return whether a log was judged on a grid that is not the rows, its own or those of the reference."""
    same = np.array_equal(now.reference.t_ns, before.reference.t_ns)
    return not before.on_rows and (pair[1].run.resampled or not same)


def _by_key(run: Deviation) -> dict[Key, Statistics]:
    return {(of.kind, of.quantity, of.unit): of for of in run.all_statistics}


def _iter_absent(comparison: Comparison, pairs: Mapping[str, Pair]) -> Iterator[UnmatchedQuantity]:
    """Yield the logs of a comparison that the other lacks, and the quantities that the log of a pair lacks.

    A quantity is that of the log now, whatever the log was called before.
    """
    for run in comparison.runs:
        if run.name not in pairs:
            yield UnmatchedQuantity(run.name)
            continue
        now, before = pairs[run.name]
        other = _by_key(before if run is now else now)
        yield from (UnmatchedQuantity(now.name, key[1]) for key in _by_key(run) if key not in other)


def _iter_changes(now: Deviation, before: Deviation, noise: Mapping[str, float]) -> Iterator[QuantityChange]:
    """Yield the change of each quantity that both have."""
    _, here, there = np.intersect1d(now.t_ns, before.t_ns, assume_unique=True, return_indices=True)
    same_times = len(here) == len(now.t_ns) == len(before.t_ns)
    old, new = _by_key(before), _by_key(now)
    old_values, values = (dict(zip(_by_key(run), run.values, strict=True)) for run in (before, now))
    for key, statistics in new.items():
        if key not in old:
            continue
        level = tolerance_for(statistics.quantity, statistics.kind, noise) or 0.0
        step = np.abs(values[key][here] - old_values[key][there])
        known = np.flatnonzero(np.isfinite(step))
        at = known[np.argmax(step[known])] if len(known) else None
        out_fraction_noise = None
        if statistics.tolerance is not None and statistics.tolerance == old[key].tolerance:
            out_fraction_noise = _share_noise(
                (old_values[key], values[key]), statistics.tolerance, level, same_times=same_times
            )
        yield QuantityChange(
            run=now.name,
            before=old[key],
            now=statistics,
            noise=level,
            out_fraction_noise=out_fraction_noise,
            periods=(_period(before), _period(now)),
            samples_shared=len(known),
            largest_change=None if at is None else float(step[at]),
            t_largest_change=float(now.t[here[at]]) if at is not None and now.run.timed else None,
        )


def _period(run: Deviation) -> float:
    """Return the time between two samples in [ns], whichever were left out between those compared."""
    if len(run.sample) < 2:
        return run.run.tsp * 1e9
    return float(np.median(np.diff(run.t_ns) / np.diff(run.sample)))


def _share_noise(
    values: tuple[FloatArray, FloatArray], tolerance: float, noise: float, *, same_times: bool
) -> tuple[float, float]:
    """Return the shares of the samples, before and now, that the noise can have put out of tolerance.

    A missing value is out of tolerance, but the noise has not put it there.
    """
    sizes = [np.abs(side) for side in values]
    # Half a sample more: shares are whole samples, and their sums are rounded.
    spare = (0.5 if same_times else 1.5) / min(map(len, sizes))
    before, now = (float(np.mean((size > tolerance) & (size <= tolerance + noise))) for size in sizes)
    return before + spare, now + spare


def _iter_differences(
    now: Comparison, before: Comparison, pairs: Sequence[Pair]
) -> Iterator[SettingDifference]:
    """Yield the differences in how the two were made, in all and log by log."""
    yield from _differing(_settings(before), _settings(now))
    for run, old in pairs:
        yield from _differing(_log_settings(old), _log_settings(run), f" of {run.name}")
        if _is_on_grid(now, before, (run, old)):
            yield SettingDifference(f"judged on of {run.name}", "the grid", "the log's rows")


def _differing(
    before: Mapping[str, Any], now: Mapping[str, Any], of: str = ""
) -> Iterator[SettingDifference]:
    for name in dict.fromkeys([*before, *now]):
        if before.get(name) != now.get(name):
            yield SettingDifference(f"{name}{of}", before.get(name), now.get(name))


def _settings(comparison: Comparison) -> dict[str, Any]:
    """Return how a comparison was made: reference, tolerance, options, versions."""
    reference = comparison.reference
    not_listed = ("tolerance", "diagnose")  # the one has an entry, the other changes no figure
    options = {name: value for name, value in comparison.provenance.options.items() if name not in not_listed}
    versions = {f"version of {name}": value for name, value in comparison.provenance.versions.items()}
    return {
        "reference": reference.name,
        "files of the reference": [f"{file.name} {file.sha256[:12]}" for file in reference.files],
        "tolerance": {
            kind: value for kind, value in comparison.tolerance.items() if value != MIN_SHARES.get(kind)
        },
        **options,
        **versions,
    }


def _log_settings(run: Deviation) -> dict[str, Any]:
    """Return how a log was compared: its name, robot, samples, clock and alignment."""
    robot = run.run.robot
    return {
        "log": run.name,
        "robot": robot.name if robot else None,
        "base": _to_option(robot.base) if robot else None,
        "robot tool": _to_option(robot.tool) if robot else None,
        "tsp": run.run.tsp,
        "samples": len(run.sample),
        "sync_offset": run.sync.offset,
        "translation": list(run.alignment.translation),
        "tool": list(run.alignment.tool),
    }


def _to_option(frame: Transform) -> list[float]:
    """Return a frame as `base` and `tool` take it: x, y, z in [m], rx, ry, rz in [rad]."""
    values = (*frame.translation, *matrix_to_rpy(frame.rotation))
    return [float(value) + 0.0 for value in values]  # + 0.0: no -0.0


MAX_NAMED = 30  # quantities and logs that a fact names; more are counted

# The names of the statistics that may be worse.
STATISTIC_NAMES: dict[Worse, str] = {"max": "max", "rms": "rms", "out_fraction": "out", "samples": "samples"}


def baseline_section(baseline: BaselineComparison, rank: int) -> Section:
    """Return the section of the changes since an earlier comparison."""
    message = "a log of the baseline, not compared any more"
    gone = [
        Section(log.run, "fail", checks=(_check(log.run, "log is there", f"{log.run}: {message}"),))
        for log in baseline.missing
        if log.quantity is None
    ]
    return Section(
        f"Against the baseline {baseline.name}",
        baseline.verdict,
        tuple(_facts(baseline)),
        tuple(_tables(baseline)),
        sections=tuple(gone),
        rank=rank,
    )


def baseline_checks(baseline: BaselineComparison, run: str) -> Iterator[Check]:
    """Yield a check for each quantity of a log that was compared then."""
    for change in baseline.changes:
        if change.run == run:
            noise = text.format_stated(change.noise, change.now.unit)
            message = f"{absolute_symbol(change.now)}: {format_worse(change)} (noise {noise})"
            yield _check(run, quantity_name(change.now), message if change.worse else "")
    for lost in baseline.missing:
        if lost.run == run:
            message = f"{lost.quantity}: in the baseline, not compared any more"
            yield _check(run, f"{lost.quantity} is there", message)


def criterion_checks(baseline: BaselineComparison) -> Iterator[Check]:
    """Yield a check for each criterion after ISO 9283 that was compared then."""
    for change in baseline.criteria:
        noise = f" (noise {written(Value(change.noise, _shown(change.now.unit), given=True), unit=True)})"
        message = f"{change.now.name}: {format_criterion_change(change)}{noise}" if change.worse else ""
        yield _check("criteria", change.now.name, message)
    for lost in baseline.missing:
        message = f"{lost.quantity}: in the baseline, without a value now"
        yield _check("criteria", f"{lost.quantity} is there", message)


def format_criterion_change(change: CriterionChange) -> str:
    """Return a criterion before and now: "0.1000 → 0.2000 mm"."""
    unit = _shown(change.now.unit)
    before, now = abs(change.before.value or 0.0), abs(change.now.value or 0.0)
    return f"{written(Value(before, unit, now))} → {written(Value(now, unit, before), unit=True)}"


def _shown(unit: str) -> str:
    """Return the unit by which a criterion is written: shares as %."""
    return "%" if unit == "1" else unit


def _check(run: str, name: str, message: str) -> Check:
    """Return a check that fails if it has a message."""
    about = f"{run} against baseline"
    return Check(name, "fail" if message else "pass", message, about, kind="worse-than-baseline")


def format_worse_count(baseline: BaselineComparison) -> str:
    """Return how many quantities are worse: "5 quantities worse, 1 gone", "nothing worse"."""
    counts = [f"{count_quantities(len(baseline.worse))} worse"] if baseline.worse else []
    criteria = text.join_list([change.now.name for change in baseline.worse_criteria])
    counts += [f"{criteria} worse"] if criteria else []
    counts += [f"{len(baseline.missing)} gone"] if baseline.missing else []
    return ", ".join(counts) or "nothing worse"


def count_quantities(count: int) -> str:
    """Return a count of quantities: "1 quantity", "5 quantities"."""
    return f"{count} {'quantity' if count == 1 else 'quantities'}"


def format_worse(change: QuantityChange) -> str:
    """Return the worse statistics, before and now: "max 1.0000 → 2.0000 mm, out 1.0 % → 3.0 %"."""
    pairs = {name: _pair(change, name) for name in change.worse}
    return ", ".join(
        f"{STATISTIC_NAMES[name]} {written(before)} → {written(now, unit=True)}"
        for name, (before, now) in pairs.items()
    )


def _pair(change: QuantityChange, name: Worse) -> tuple[Value, Value]:
    """Return a statistic before and now, with digits that distinguish them if it changed."""
    before, now = getattr(change.before, name), getattr(change.now, name)
    unit = {"out_fraction": "%", "samples": ""}.get(name, change.now.unit)
    is_changed = name in (*change.worse, *change.better)
    return Value(before, unit, now if is_changed else None), Value(now, unit, before if is_changed else None)


def worse_facts(baseline: BaselineComparison) -> Iterator[Fact]:
    """Yield the number of quantities that are worse than a baseline, and their names."""
    yield Fact("Since the baseline", format_worse_count(baseline))
    worse = [
        f"{symbol(change.now)} of {change.run} ({_join_names(change.worse)})" for change in baseline.worse
    ]
    yield Fact("Worse", _listed(worse))
    yield Fact("Gone", _listed(list(map(str, baseline.missing))))


def _facts(baseline: BaselineComparison) -> Iterator[Fact]:
    yield from worse_facts(baseline)
    yield Fact("New", _listed(list(map(str, baseline.new))))
    noise = (f"{kind} {text.format_stated(value, UNITS[kind])}" for kind, value in baseline.noise.items())
    yield Fact("Noise", ", ".join(noise), "smaller changes are not listed")
    yield Fact("Recording of the baseline", str(baseline.recording or ""), brief=False)


def _tables(baseline: BaselineComparison) -> Iterator[Table]:
    """Yield the quantities that changed by more than the noise, and the settings that differ."""
    changed = sorted(
        (change for change in baseline.changes if change.changed), key=lambda change: not change.worse
    )
    if changed:
        yield Table(
            f"Changed since {baseline.name} by more than the noise", columns_of(changed, _QUANTITY_COLUMNS)
        )
    criteria = sorted(
        (change for change in baseline.criteria if change.worse or change.better),
        key=lambda change: not change.worse,
    )
    if criteria:
        yield Table(
            f"Criteria changed since {baseline.name} by more than the noise",
            columns_of(criteria, _CRITERION_COLUMNS),
        )
    if baseline.differences:
        rows = [
            (
                setting.what,
                *(option_words(setting.what, value, UNITS) for value in (setting.before, setting.now)),
            )
            for setting in baseline.differences
        ]
        heads = {"what": "What", "before": "before", "now": "now"}
        yield table_of("Made differently", heads, rows, brief=True)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return ", ".join(names[:MAX_NAMED]) + more


def _join_names(statistics: Sequence[Worse]) -> str:
    return ", ".join(STATISTIC_NAMES[name] for name in statistics)


def _columns(name: Worse) -> dict[str, tuple[str, Callable[[QuantityChange], Cell]]]:
    """Return a statistic before and now; a share or a count only where it changed."""

    def cells(change: QuantityChange) -> tuple[Cell, Cell]:
        shown = name in ("max", "rms", *change.worse, *change.better)
        return _pair(change, name) if shown else (None, None)

    word = STATISTIC_NAMES[name]
    return {
        f"{word}_before": (f"{word} before", lambda change: cells(change)[0]),
        f"{word}_now": (f"{word} now", lambda change: cells(change)[1]),
    }


def _verdict(change: QuantityChange, verdict: Verdict | None) -> Judged:
    """Return a verdict where it changed."""
    return Judged(verdict if change.before.verdict != change.now.verdict else None)


_CRITERION_COLUMNS: Heads[CriterionChange] = {
    "name": ("Criterion", lambda change: change.now.name),
    "worse": ("worse", lambda change: "worse" if change.worse else "better"),
    "before": ("before", lambda change: Value(change.before.value, _shown(change.now.unit))),
    "now": ("now", lambda change: Value(change.now.value, _shown(change.now.unit))),
}

_QUANTITY_COLUMNS: Heads[QuantityChange] = {
    "run": ("Log", lambda change: Ref(change.run)),
    "quantity": ("Quantity", lambda change: symbol(change.now)),
    "worse": ("worse", lambda change: _join_names(change.worse)),
    "better": ("better", lambda change: _join_names(change.better)),
    **_columns("max"),
    **_columns("rms"),
    **_columns("out_fraction"),
    **_columns("samples"),
    "largest_change": ("most at one sample", lambda change: Value(change.largest_change, change.now.unit)),
    "t_largest_change": ("at t", lambda change: Value(change.t_largest_change, "s")),
    "verdict_before": ("verdict before", lambda change: _verdict(change, change.before.verdict)),
    "verdict_now": ("verdict now", lambda change: _verdict(change, change.now.verdict)),
}
