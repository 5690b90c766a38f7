"""Baseline: what changed in a comparison since an earlier one, beyond a stated noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.math3d import Transform, matrix_to_rpy
from urmpipe_pipeline.comparison.comparison import (
    BaselineComparison,
    Comparison,
    CriterionChange,
    QuantityChange,
    SettingDifference,
    UnmatchedQuantity,
)
from urmpipe_pipeline.comparison.deviation import Deviation, Statistics
from urmpipe_pipeline.comparison.verdict import LEAST_SHARES, allowed_for, check_tolerance, parse_tolerance
from urmpipe_pipeline.iso9283.criteria import Criterion

LENGTHS = ("axis", "norm", "path")
"""The kinds that a noise without a name is for."""

DEFAULT_NOISE = dict.fromkeys((*LENGTHS, "angle", "joint"), 1e-6)
"""Changes in [m] and [rad] that mean nothing, by kind.

1 um and 1 urad: a twentieth of what the best arms repeat to (0.02 mm), yet more than rounding to the six
digits of a text log, interpolation and other versions of the libraries move a deviation by.
"""

OTHER_NOISE = 1e-6
"""Likewise of criteria after ISO 9283 that are no lengths and no angles: in [s], [m/s] and of shares."""

Key: TypeAlias = tuple[str, str, str]
"""Kind, quantity and unit: a joint may be called x."""

Pair: TypeAlias = tuple[Deviation, Deviation]
"""A log, and the log of the other comparison that it is held against."""


def parse_noise(text: str) -> dict[str, float]:
    """Return the noise in [m] and [rad] by kind, from "2um" (all lengths) or "axis=2um,angle=0.01deg".

    What is not named keeps its default; 0 is allowed.

    Raises:
        OptionError: With everything that is wrong.
    """
    return DEFAULT_NOISE | parse_tolerance(text, "noise", LENGTHS, zero=True)


def complete_noise(noise: float | str | Mapping[str, float] | None) -> dict[str, float]:
    """Return the noise of every kind, from one of all lengths in [m], of some kinds, or a text.

    Raises:
        OptionError: With everything that is wrong.
    """
    if isinstance(noise, str):
        return parse_noise(noise)
    given = noise if isinstance(noise, Mapping) else {} if noise is None else dict.fromkeys(LENGTHS, noise)
    if given:
        check_tolerance(given, "noise", zero=True, iso=None)
    return DEFAULT_NOISE | dict(given)


def against_baseline(
    now: Comparison, before: Comparison, noise: float | str | Mapping[str, float] | None = None
) -> BaselineComparison:
    """Tell what changed since an earlier comparison: by log and quantity, and in how it was made.

    Logs are the same if their names are; where both comparisons are of one log, these are held against each
    other whatever they are called. A log of a baseline that was judged on a grid instead of its rows is
    listed as made otherwise: its figures do not compare. A quantity is worse if its largest value or its rms
    grew by more than the noise, if more of its samples are out of the same tolerance than the noise can have
    put there, or if it rests on less than nine tenths of the samples, counted by the time that they stand
    for.

    Args:
        now: The comparison to judge.
        before: The baseline.
        noise: Changes that mean nothing: of all lengths in [m], or in [m] and [rad] by kind; what is not
            given is 1 um and 1 urad.

    Raises:
        OptionError: If a noise is none, or only one of the two is a test after ISO 9283.
    """
    level = complete_noise(noise)
    if now.iso is not None or before.iso is not None:
        return _tests(now, before, level)
    pairs = _pairs(now, before)
    gone = _absent(before, {old.name: (run, old) for run, old in pairs})
    return BaselineComparison(
        name=before.name,
        recording=before.recording,
        noise=level,
        changes=tuple(
            change for pair in pairs if not _on_grid(now, before, pair) for change in _changes(*pair, level)
        ),
        new=tuple(_absent(now, {run.name: (run, old) for run, old in pairs})),
        missing=tuple(
            one for one in gone if one not in [UnmatchedQuantity(log.name) for log in now.failed_logs]
        ),
        differences=tuple(_differences(now, before, pairs)),
    )


def _tests(now: Comparison, before: Comparison, noise: Mapping[str, float]) -> BaselineComparison:
    """Return what changed since an earlier test after ISO 9283: its criteria over all."""
    if now.iso is None or before.iso is None:
        sides = ("a test after ISO 9283", "a comparison log by log")
        found, allowed = sides if now.iso is None else sides[::-1]
        raise OptionError(Finding(parameter="baseline", found=found, allowed=allowed))
    tests = before.iso, now.iso
    old, new = ({one.name: one for one in side.overall if one.value is not None} for side in tests)
    counts = [side.cycle_count for side in tests]
    failed = now.iso.failed_cycles if len(now.iso.failed_cycles) > len(before.iso.failed_cycles) else ()
    return BaselineComparison(
        name=before.name,
        recording=before.recording,
        noise=noise,
        changes=(),
        new=tuple(UnmatchedQuantity(now.name, name) for name in new if name not in old),
        missing=(
            *(UnmatchedQuantity(now.name, name) for name in old if name not in new),
            *(UnmatchedQuantity(now.name, cycle.name) for cycle in failed),
        ),
        differences=(
            *_differing(_made(before), _made(now)),
            *_differing({"cycles": counts[0]}, {"cycles": counts[1]}),
        ),
        criteria=tuple(
            CriterionChange(old[name], one, _noise_of(one, noise)) for name, one in new.items() if name in old
        ),
    )


def _noise_of(one: Criterion, noise: Mapping[str, float]) -> float:
    """Return what of a change of a criterion means nothing, in its unit: its own, else that of its kind."""
    kind = {"m": "norm", "rad": "angle"}.get(one.unit, "")
    return noise.get(one.name, noise.get(kind, OTHER_NOISE))


def _pairs(now: Comparison, before: Comparison) -> list[Pair]:
    """Return the logs of both that are held against each other: by name, or the only ones."""
    if len(now.runs) + len(now.failed_logs) == len(before.runs) == 1:
        return [(now.runs[0], before.runs[0])]
    old = {run.name: run for run in before.runs}
    return [(run, old[run.name]) for run in now.runs if run.name in old]


def _on_grid(now: Comparison, before: Comparison, pair: Pair) -> bool:
    """Tell whether a log was judged on a grid that is not the rows, its own or those of the reference."""
    same = np.array_equal(now.reference.t_ns, before.reference.t_ns)
    return not before.on_rows and (pair[1].run.resampled or not same)


def _keyed(statistics: tuple[Statistics, ...]) -> dict[Key, Statistics]:
    return {(one.kind, one.quantity, one.unit): one for one in statistics}


def _absent(result: Comparison, pairs: Mapping[str, Pair]) -> Iterator[UnmatchedQuantity]:
    """Yield the logs of a comparison that the other lacks, and the quantities that the log of a pair lacks.

    A quantity is that of the log now, whatever the log was called before.
    """
    for run in result.runs:
        if run.name not in pairs:
            yield UnmatchedQuantity(run.name)
            continue
        now, before = pairs[run.name]
        theirs = _keyed((before if run is now else now).all_statistics)
        yield from (
            UnmatchedQuantity(now.name, key[1]) for key in _keyed(run.all_statistics) if key not in theirs
        )


def _changes(now: Deviation, before: Deviation, noise: Mapping[str, float]) -> Iterator[QuantityChange]:
    """Yield the change of each quantity that both have."""
    _, here, there = np.intersect1d(now.t_ns, before.t_ns, assume_unique=True, return_indices=True)
    same = len(here) == len(now.t_ns) == len(before.t_ns)
    old, old_values, values = _keyed(before.all_statistics), _values(before), _values(now)
    for key, one in _keyed(now.all_statistics).items():
        if key not in old:
            continue
        level = allowed_for(one.quantity, one.kind, noise) or 0.0
        step = np.abs(values[key][here] - old_values[key][there])
        known = np.flatnonzero(np.isfinite(step))
        at = known[np.argmax(step[known])] if len(known) else None
        yield QuantityChange(
            run=now.name,
            before=old[key],
            now=one,
            noise=level,
            out_fraction_noise=_share_noise((old[key], one), (old_values[key], values[key]), level, same),
            periods=(_period(before), _period(now)),
            samples_shared=len(known),
            largest_change=None if at is None else float(step[at]),
            t_largest_change=float(now.t[here[at]]) if at is not None and now.run.timed else None,
        )


def _period(run: Deviation) -> float:
    """Return the time from one sample to the next in [ns], whichever were left out between those compared."""
    if len(run.sample) < 2:
        return run.run.tsp * 1e9
    return float(np.median(np.diff(run.t_ns) / np.diff(run.sample)))


def _values(run: Deviation) -> dict[Key, FloatArray]:
    """Return the values of every quantity, each of shape (m,)."""
    return dict(zip(_keyed(run.all_statistics), run.values, strict=True))


def _share_noise(
    statistics: tuple[Statistics, Statistics],
    values: tuple[FloatArray, FloatArray],
    noise: float,
    same_times: bool,
) -> tuple[float, float] | None:
    """Return the shares of the samples, before and now, that the noise can have put out of tolerance."""
    allowed = statistics[1].tolerance
    if allowed is None or allowed != statistics[0].tolerance:
        return None
    sizes = [np.abs(one) for one in values]  # what is missing is out, but the noise has not put it there
    # Half a sample more: shares are whole samples, and their sums are rounded.
    spare = (0.5 if same_times else 1.5) / min(map(len, sizes))
    before, now = (float(np.mean((size > allowed) & (size <= allowed + noise))) for size in sizes)
    return before + spare, now + spare


def _differences(now: Comparison, before: Comparison, pairs: Sequence[Pair]) -> Iterator[SettingDifference]:
    """Yield what differs in how the two were made, in all and log by log."""
    yield from _differing(_made(before), _made(now))
    for run, old in pairs:
        yield from _differing(_facts(old), _facts(run), f" of {run.name}")
        if _on_grid(now, before, (run, old)):
            yield SettingDifference(f"judged on of {run.name}", "the grid", "the log's rows")


def _differing(was: Mapping[str, Any], made: Mapping[str, Any], of: str = "") -> Iterator[SettingDifference]:
    for what in dict.fromkeys([*was, *made]):
        if was.get(what) != made.get(what):
            yield SettingDifference(f"{what}{of}", was.get(what), made.get(what))


def _made(result: Comparison) -> dict[str, Any]:
    """Return how a comparison was made: reference, tolerance, options, versions."""
    reference = result.reference
    unshown = ("tolerance", "diagnose")  # it stands by itself; it changes no figure
    options = {name: value for name, value in result.provenance.options.items() if name not in unshown}
    versions = {f"version of {name}": value for name, value in result.provenance.versions.items()}
    return {
        "reference": reference.name,
        "files of the reference": [f"{file.name} {file.sha256[:12]}" for file in reference.files],
        "tolerance": {kind: one for kind, one in result.tolerance.items() if one != LEAST_SHARES.get(kind)},
        **options,
        **versions,
    }


def _frame(frame: Transform) -> list[float]:
    """Return a frame as `base` and `tool` take it: x, y, z in [m], rx, ry, rz in [rad]."""
    return [
        float(value) + 0.0 for value in (*frame.translation, *matrix_to_rpy(frame.rotation))
    ]  # + 0.0: no -0.0


def _facts(run: Deviation) -> dict[str, Any]:
    """Return how a log was compared: its name, arm, samples, clock and place."""
    arm = run.run.robot
    return {
        "log": run.name,
        "robot": arm.name if arm else None,
        "base": _frame(arm.base) if arm else None,
        "robot tool": _frame(arm.tool) if arm else None,
        "tsp": run.run.tsp,
        "samples": len(run.sample),
        "sync_offset": run.sync.offset,
        "translation": list(run.alignment.translation),
        "tool": list(run.alignment.tool),
    }
