"""What changed since an earlier comparison: quantities, what is new or gone, what was made otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

from urmpipe_pipeline.comparison.deviation import Statistics, Verdict
from urmpipe_pipeline.iso9283.criteria import Criterion

Worse: TypeAlias = Literal["max", "rms", "share_out", "samples"]

KEPT = 0.9
"""A log that keeps a smaller share of its samples lost some: one program, recorded by hand, varies less.

Samples count by the time that they stand for: another rate of recording loses nothing."""


@dataclass(frozen=True, slots=True)
class Change:
    """How one quantity of one log stands to the baseline.

    Attributes:
        run: The log's name now.
        before: The statistics of the baseline.
        now: The statistics now.
        noise: What means nothing, in the unit of the statistics.
        share_noise: Share of the samples, 0..1, that the noise can have put out of tolerance, before and now:
            those that are out by no more than it, and one sample where the times differ; None where the
            shares do not compare (no tolerance, or another one than before).
        periods: Periods of the samples before and now in [ns]: of another rate, they stand for another time.
        samples_shared: Samples at times that both have, with a value on both sides.
        largest: Largest absolute change at one of them; None without any.
        t_largest: When that was, in [s] of the log; None without times.
    """

    run: str
    before: Statistics
    now: Statistics
    noise: float
    share_noise: tuple[float, float] | None
    periods: tuple[float, float]
    samples_shared: int
    largest: float | None
    t_largest: float | None

    @property
    def worse(self) -> tuple[Worse, ...]:
        """What of it is larger than before by more than the noise; samples: it rests on far fewer."""
        return self._grown(before=0, now=1)

    @property
    def better(self) -> tuple[Worse, ...]:
        """What of it is smaller than before by more than the noise; samples: it rests on far more."""
        return self._grown(before=1, now=0)

    @property
    def changed(self) -> bool:
        """Whether anything changed beyond the noise: the statistics, the verdict, or one sample."""
        moved = self.largest is not None and self.largest > self.noise
        return bool(self.worse or self.better or moved or self.before.verdict != self.now.verdict)

    def _grown(self, *, before: int, now: int) -> tuple[Worse, ...]:
        """Return what is larger on one side (0 the baseline, 1 now) than on the other, or rests on less."""
        one, other = ((self.before, self.now)[side] for side in (before, now))
        noise, count, lasted = self.share_noise, other.samples, (one.samples or 0) * self.periods[before]
        grown: dict[Worse, bool] = {
            "max": other.max > one.max + self.noise,
            "rms": other.rms > one.rms + self.noise,
            "share_out": noise is not None and (other.share_out or 0.0) > (one.share_out or 0.0) + noise[now],
            "samples": count is not None and count * self.periods[now] < KEPT * lasted,
        }
        return tuple(name for name, more in grown.items() if more)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        both = {
            name: {"before": getattr(self.before, name), "now": getattr(self.now, name)}
            for name in ("max", "rms", "share_out", "samples", "verdict")
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
class CriterionChange:
    """How a criterion after ISO 9283, over all, stands to the baseline.

    Attributes:
        before: That of the baseline.
        now: That of now.
        noise: What means nothing, in its unit.
    """

    before: Criterion
    now: Criterion
    noise: float

    @property
    def worse(self) -> bool:
        """Whether its absolute value grew by more than the noise."""
        return abs(self.now.value or 0.0) > abs(self.before.value or 0.0) + self.noise

    @property
    def better(self) -> bool:
        """Whether its absolute value fell by more than the noise."""
        return abs(self.before.value or 0.0) > abs(self.now.value or 0.0) + self.noise

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "name": self.now.name,
            "unit": self.now.unit,
            "noise": self.noise,
            "before": self.before.value,
            "now": self.now.value,
            "worse": self.worse,
            "better": self.better,
        }


@dataclass(frozen=True, slots=True)
class Absent:
    """What only one of the two comparisons has.

    Attributes:
        run: The log's name; of a quantity, that which the log has now.
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
        criteria: Of tests after ISO 9283: one a criterion that has a value in both; the cycles themselves are
            not held against each other.
    """

    name: str
    recording: Path | None
    noise: Mapping[str, float]
    changes: tuple[Change, ...]
    new: tuple[Absent, ...]
    gone: tuple[Absent, ...]
    differences: tuple[Difference, ...]
    criteria: tuple[CriterionChange, ...] = ()

    @property
    def worse(self) -> tuple[Change, ...]:
        """The quantities that are worse than before, beyond the noise."""
        return tuple(change for change in self.changes if change.worse)

    @property
    def verdict(self) -> Verdict:
        """Fail if a quantity is worse, or something that was compared before is compared no more."""
        return "fail" if self.worse or self.worse_criteria or self.gone else "pass"

    @property
    def worse_criteria(self) -> tuple[CriterionChange, ...]:
        """The criteria that are worse than before, beyond the noise."""
        return tuple(one for one in self.criteria if one.worse)

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
            "criteria": [one.to_dict() for one in self.criteria],
        }
