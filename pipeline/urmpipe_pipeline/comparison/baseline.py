"""Baseline: what changed in a comparison since an earlier one, beyond a stated noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.comparison.comparison import Comparison, Deviation, Statistics, Verdict
from urmpipe_pipeline.comparison.tolerance import allowed_for, check_tolerance, parse_tolerance

LENGTHS = ("axis", "norm", "path")
"""The kinds that a noise without a name is for."""

DEFAULT_NOISE = dict.fromkeys((*LENGTHS, "angle", "joint"), 1e-6)
"""Changes in [m] and [rad] that mean nothing, by kind.

1 um and 1 urad: a twentieth of what the best arms repeat to (0.02 mm), yet more than rounding to the six
digits of a text log, interpolation and other versions of the libraries move a deviation by.
"""

Worse: TypeAlias = Literal["max", "rms", "share_out"]
Key: TypeAlias = tuple[str, str, str]
"""Kind, quantity and unit: a joint may be called x."""


def parse_noise(text: str) -> dict[str, float]:
    """Return the noise in [m] and [rad] by kind, from "2um" (all lengths) or "axis=2um,angle=0.01deg".

    What is not named keeps its default; 0 is allowed.

    Raises:
        OptionError: With everything that is wrong.
    """
    return DEFAULT_NOISE | parse_tolerance(text, "--noise", LENGTHS, zero=True)


def complete_noise(noise: float | Mapping[str, float] | None) -> dict[str, float]:
    """Return the noise of every kind, from one of all lengths in [m], or of some kinds.

    Raises:
        OptionError: With everything that is wrong.
    """
    given = noise if isinstance(noise, Mapping) else {} if noise is None else dict.fromkeys(LENGTHS, noise)
    if given:
        check_tolerance(given, "--noise", zero=True)
    return DEFAULT_NOISE | dict(given)


@dataclass(frozen=True, slots=True)
class Change:
    """How one quantity of one log stands to the baseline.

    Attributes:
        run: The log's name.
        before: The statistics of the baseline.
        now: The statistics now.
        noise: What means nothing, in the unit of the statistics.
        share_noise: Share of the samples, 0..1, that the noise can have put out of tolerance, before and now:
            those that are out by no more than it, and one sample where the times differ; None where the
            shares do not compare (no tolerance, or another one than before).
        samples_shared: Samples at times that both have, with a value on both sides.
        largest: Largest absolute change at one of them; None without any.
        t_largest: When that was, in [s] of the log.
    """

    run: str
    before: Statistics
    now: Statistics
    noise: float
    share_noise: tuple[float, float] | None
    samples_shared: int
    largest: float | None
    t_largest: float | None

    @property
    def worse(self) -> tuple[Worse, ...]:
        """What of it is larger than before by more than the noise."""
        return self._larger(self.before, self.now, self.share_noise and self.share_noise[1])

    @property
    def better(self) -> tuple[Worse, ...]:
        """What of it is smaller than before by more than the noise."""
        return self._larger(self.now, self.before, self.share_noise and self.share_noise[0])

    @property
    def changed(self) -> bool:
        """Whether anything changed beyond the noise: the statistics, the verdict, or one sample."""
        moved = self.largest is not None and self.largest > self.noise
        return bool(self.worse or self.better or moved or self.before.verdict != self.now.verdict)

    def _larger(self, one: Statistics, other: Statistics, share_noise: float | None) -> tuple[Worse, ...]:
        """Return what of the other is larger than of the one by more than the noise."""
        found: list[Worse] = []
        if other.max > one.max + self.noise:
            found.append("max")
        if other.rms > one.rms + self.noise:
            found.append("rms")
        if share_noise is not None and (other.share_out or 0.0) > (one.share_out or 0.0) + share_noise:
            found.append("share_out")
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        both = {
            name: {"before": getattr(self.before, name), "now": getattr(self.now, name)}
            for name in ("max", "rms", "share_out", "verdict")
        }
        return {
            "run": self.run,
            "quantity": self.now.quantity,
            "kind": self.now.kind,
            "unit": self.now.unit,
            "noise": self.noise,
            **both,
            "samples_shared": self.samples_shared,
            "largest_change": self.largest,
            "t_largest_change": self.t_largest,
            "changed": self.changed,
            "worse": list(self.worse),
            "better": list(self.better),
        }


@dataclass(frozen=True, slots=True)
class Absent:
    """What only one of the two comparisons has.

    Attributes:
        run: The log's name.
        quantity: A quantity of it that both logs should have; None if the log itself is absent.
    """

    run: str
    quantity: str | None = None

    def __str__(self) -> str:
        return self.run if self.quantity is None else f"{self.quantity} of {self.run}"


@dataclass(frozen=True, slots=True)
class Difference:
    """What differs in the way the two comparisons were made, as JSON has it."""

    what: str
    before: Any
    now: Any


@dataclass(frozen=True, slots=True)
class BaselineComparison:
    """A comparison held against an earlier one.

    Attributes:
        name: The name of the earlier one.
        recording: Where that stands.
        noise: Changes in [m] and [rad] that mean nothing, by kind.
        changes: One a log and quantity that both have.
        new: What the earlier one did not have.
        gone: What only the earlier one had.
        differences: What differs in the way the two were made.
    """

    name: str
    recording: Path | None
    noise: Mapping[str, float]
    changes: tuple[Change, ...]
    new: tuple[Absent, ...]
    gone: tuple[Absent, ...]
    differences: tuple[Difference, ...]

    @property
    def worse(self) -> tuple[Change, ...]:
        """The quantities that are worse than before, beyond the noise."""
        return tuple(change for change in self.changes if change.worse)

    @property
    def verdict(self) -> Verdict:
        """Fail if a quantity is worse, or something that was compared before is compared no more."""
        return "fail" if self.worse or self.gone else "pass"

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "name": self.name,
            "recording": str(self.recording) if self.recording else None,
            "verdict": self.verdict,
            "noise": dict(self.noise),
            "changes": [change.to_dict() for change in self.changes],
            "new": [asdict(one) for one in self.new],
            "gone": [asdict(one) for one in self.gone],
            "differences": [asdict(one) for one in self.differences],
        }


def against_baseline(
    now: Comparison, before: Comparison, noise: float | Mapping[str, float] | None = None
) -> BaselineComparison:
    """Tell what changed since an earlier comparison: by log and quantity, and in how it was made.

    Logs are the same if their names are. A quantity is worse if its largest value or its rms grew by more
    than the noise, or if more of its samples are out of the same tolerance than the noise can have put there.

    Args:
        now: The comparison to judge.
        before: The baseline.
        noise: Changes that mean nothing: of all lengths in [m], or in [m] and [rad] by kind; what is not
            given is 1 um and 1 urad.

    Raises:
        OptionError: If a noise is none.
    """
    level = complete_noise(noise)
    old, new = ({run.name: run for run in one.runs} for one in (before, now))
    both = [(run, old[name]) for name, run in new.items() if name in old]
    changes = [change for pair in both for change in _changes(*pair, level)]
    return BaselineComparison(
        name=before.name,
        recording=before.recording,
        noise=level,
        changes=tuple(changes),
        new=tuple(_absent(new, old)),
        gone=tuple(_absent(old, new)),
        differences=tuple(_differences(now, before)),
    )


def _keyed(statistics: tuple[Statistics, ...]) -> dict[Key, Statistics]:
    return {(one.kind, one.quantity, one.unit): one for one in statistics}


def _absent(having: Mapping[str, Deviation], lacking: Mapping[str, Deviation]) -> Iterator[Absent]:
    """Yield the logs, and the quantities of common logs, that only the first has."""
    for name, run in having.items():
        if name not in lacking:
            yield Absent(name)
            continue
        others = _keyed(lacking[name].all_statistics)
        yield from (Absent(name, key[1]) for key in _keyed(run.all_statistics) if key not in others)


def _changes(now: Deviation, before: Deviation, noise: Mapping[str, float]) -> Iterator[Change]:
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
        yield Change(
            run=now.name,
            before=old[key],
            now=one,
            noise=level,
            share_noise=_share_noise((old[key], one), (old_values[key], values[key]), level, same),
            samples_shared=len(known),
            largest=None if at is None else float(step[at]),
            t_largest=None if at is None else float(now.t[here[at]]),
        )


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
    sizes = [np.abs(one[np.isfinite(one)]) for one in values]
    # Half a sample more: shares are whole samples, and their sums are rounded.
    spare = (0.5 if same_times else 1.5) / min(map(len, sizes))
    before, now = (float(np.mean((size > allowed) & (size <= allowed + noise))) for size in sizes)
    return before + spare, now + spare


def _differences(now: Comparison, before: Comparison) -> Iterator[Difference]:
    """Yield what differs in how the two were made, in all and log by log."""
    made, was = _made(now), _made(before)
    for what in dict.fromkeys([*was, *made]):
        if was.get(what) != made.get(what):
            yield Difference(what, was.get(what), made.get(what))
    old = {run.name: run for run in before.runs}
    for run in now.runs:
        if run.name not in old:
            continue
        here, there = _facts(run), _facts(old[run.name])
        yield from (
            Difference(f"{what} of {run.name}", there[what], here[what])
            for what in here
            if there[what] != here[what]
        )


def _made(result: Comparison) -> dict[str, Any]:
    """Return how a comparison was made: reference, tolerance, options, versions."""
    reference = result.reference
    options = {name: value for name, value in result.provenance.options.items() if name != "tolerance"}
    versions = {f"version of {name}": value for name, value in result.provenance.versions.items()}
    return {
        "reference": reference.name,
        "files of the reference": [f"{file.name} {file.sha256[:12]}" for file in reference.files],
        "tolerance": dict(result.tolerance),
        **options,
        **versions,
    }


def _facts(run: Deviation) -> dict[str, Any]:
    """Return how a log was compared: its arm, samples, clock and place."""
    return {
        "robot": run.run.robot.name if run.run.robot else None,
        "tsp": run.run.tsp,
        "samples": len(run.sample),
        "sync_offset": run.sync.offset,
        "translation": list(run.alignment.translation),
        "tool": list(run.alignment.tool),
    }
