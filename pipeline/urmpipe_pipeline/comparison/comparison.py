"""What `compare` returns: the deviations of some logs and the verdict on all, as tables and JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar

from urmpipe_models.display import format_count, format_headline
from urmpipe_models.errors import Finding, UrmpipeError
from urmpipe_pipeline.comparison.deviation import Deviation, Share, Statistics, Verdict
from urmpipe_pipeline.iso9283.criteria import Criterion
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.iso9283.tables import not_judged_findings
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.run import SCHEMA, Run
from urmpipe_pipeline.trajectories import Trajectory

if TYPE_CHECKING:
    import pandas as pd

ROW = ("run", "sync_offset", *(one.name for one in fields(Statistics)), "value")
"""The columns of `Comparison.rows`: of a share its `value`, of a deviation its statistics."""


def by_tolerance(run: Deviation) -> tuple[bool, float, float]:
    """Return how far out of its tolerance a log is, the furthest last: share used up, then the rms norm."""
    return (
        run.verdict == "fail",
        run.decisive.utilisation or 0.0,
        run.statistics.get("norm", run.worst_statistics).rms,
    )


def _decided(run: Deviation) -> str:
    one = run.decisive
    return f"{one.quantity} {one.value:.1%}" if isinstance(one, Share) else f"{one.max:.4g} {one.unit}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Comparison(Result):
    """Some logs held against one reference.

    Attributes:
        name: Its name.
        reference: Where the arm was asked to be.
        runs: One deviation a log.
        tolerance: Largest absolute deviation allowed in [m] or [rad], by kind, or by x, y, z.
        warnings: What a person should know about the comparison itself.
        provenance: How to repeat it.
        recording: Where it was written.
        baseline: What changed since an earlier comparison, if it was held against one.
        assumptions: What the verdict takes for granted, each as the end of "assuming ...".
        on_rows: Whether the logs were judged on their own rows; before that was so, on the grid.
        iso: The test after ISO 9283 whose cycles the runs are; its criteria are judged, the runs are not.
        failed_logs: The logs without a verdict, where the others were judged all the same.
    """

    name: str
    reference: Trajectory
    runs: tuple[Deviation, ...]
    tolerance: Mapping[str, float]
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    recording: Path | None = field(default=None, metadata={"stored": False})
    baseline: BaselineComparison | None = None
    assumptions: tuple[str, ...] = ()
    on_rows: bool = False
    iso: IsoTest | None = None
    failed_logs: tuple[FailedLog, ...] = ()

    @property
    def within_tolerance(self) -> bool:
        """Whether every log passes, or all criteria do, whatever a baseline says."""
        if self.iso is not None:
            return self.iso.verdict != "fail"
        return all(run.verdict == "pass" for run in self.runs)

    @property
    def verdict(self) -> Verdict | None:
        """Pass if every log passes and, where there is a baseline, nothing is worse than there.

        Of a test after ISO 9283 its criteria and failed cycles count; None if no criterion has a tolerance,
        without a baseline. None, too, if a log or a criterion could not be judged, and nothing else failed.
        """
        kept = self.baseline is None or self.baseline.verdict == "pass"
        if not (self.within_tolerance and kept):
            return "fail"
        measured = self.iso is not None and self.iso.verdict is None and self.baseline is None
        return None if measured or self.errors else "pass"

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Why some logs, or some criteria after ISO 9283, have no verdict."""
        criteria = () if self.iso is None else not_judged_findings(self.iso)
        return (*(error for log in self.failed_logs for error in log.errors), *criteria)

    def warnings_of(self, run: Deviation) -> tuple[LogWarning, ...]:
        """Return the warnings of a log: those from before, and what the comparison says of it."""
        return (*run.run.warnings, *(one for one in self.warnings if one.about == run.name))

    @property
    def general_warnings(self) -> tuple[LogWarning, ...]:
        """The warnings that are about no single log."""
        return tuple(one for one in self.warnings if one.about not in [run.name for run in self.runs])

    @property
    def ranking(self) -> tuple[Deviation, ...]:
        """The logs from best to worst.

        Those that pass come first, and among them (as among the others) those that were seen as a whole; then
        the share of a tolerance that is used up decides, then the rms norm.
        """
        by_used = sorted(self.runs, key=by_tolerance)
        return tuple(sorted(by_used, key=lambda run: (run.verdict == "fail", bool(run.incomplete_shares))))

    @property
    def worst(self) -> Deviation:
        """The log that is furthest out of its tolerance, or closest to it: by it the verdict is told.

        It need not be the last of the ranking, where logs that were seen in part stand behind.
        """
        return sorted(self.runs, key=by_tolerance)[-1]

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield one row a log and quantity: the offset of the clocks, the statistics and the verdict.

        Of a test after ISO 9283 one row a criterion and place.
        """
        if self.iso is not None:
            yield from self.iso.rows()
            return
        for run in self.runs:
            for one in run.quantities:
                offset = run.sync.offset if run.run.timed else None
                yield dict.fromkeys(ROW) | {"run": run.name, "sync_offset": offset} | one.fields()

    def _headline(self) -> str:
        """Return its verdict, and that of each log: the worst first, so that it is not what is cut."""
        if self.iso is not None:
            worst = (
                f"{one.name} {one.value:.4g} {one.unit}" for one in self.iso.overall if one.value is not None
            )
            return format_headline(
                f"{self.name}: {self.verdict or 'not judged'}", self.iso.cycle_count, *worst
            )
        logs = (f"{one.name} {one.verdict} ({_decided(one)})" for one in reversed(self.ranking))
        failed = sum(one.verdict == "fail" for one in self.runs)
        share = f" ({failed} of {len(self.runs)} logs)" if failed and len(self.runs) > 1 else ""
        worse = ", worse than the baseline" if self.baseline and self.baseline.verdict == "fail" else ""
        count = len(self.assumptions)
        assumed = f", on {format_count(count, 'assumption')}" if count else ""
        lost = (f"{one.name} not judged" for one in self.failed_logs)
        return format_headline(
            f"{self.name}: {self.verdict or 'incomplete'}{share}{worse}{assumed}", *lost, *logs
        )

    def _notes(self) -> list[str]:
        """Return what is to be known of it, and of its logs."""
        of_logs = [one.of(run.name) for run in self.runs for one in run.run.warnings]
        return [str(one) for one in (*self.errors, *self.warnings, *of_logs)]

    def to_frame(self) -> pd.DataFrame:
        """Return one row a log and quantity, as `rows`."""
        import pandas as pd

        return pd.DataFrame(list(self.rows()))

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe compare --json` prints."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "assumptions": list(self.assumptions),
            "tolerance": dict(self.tolerance),
            "reference": self.reference.name,
            "runs": [run.to_dict() for run in self.runs],
            "ranking": [run.name for run in self.ranking],
            "warnings": [one.to_dict() for one in self.warnings],
            "baseline": None if self.baseline is None else self.baseline.to_dict(),
            "iso": None if self.iso is None else self.iso.to_dict(),
            "failed_logs": [
                {"name": log.name, "errors": [one.to_dict() for one in log.errors]}
                for log in self.failed_logs
            ],
            "recording": str(self.recording) if self.recording else None,
        }


Worse: TypeAlias = Literal["max", "rms", "out_fraction", "samples"]

KEPT = 0.9
"""A log that keeps a smaller share of its samples lost some: one program, recorded by hand, varies less.

Samples count by the time that they stand for: another rate of recording loses nothing."""


@dataclass(frozen=True, slots=True)
class QuantityChange:
    """How one quantity of one log stands to the baseline.

    Attributes:
        run: The log's name now.
        before: The statistics of the baseline.
        now: The statistics now.
        noise: What means nothing, in the unit of the statistics.
        out_fraction_noise: Fraction of the samples, 0..1, that the noise can have put out of tolerance,
            before and now: those that are out by no more than it, and one sample where the times differ;
            None where the fractions do not compare (no tolerance, or another one than before).
        periods: Periods of the samples before and now in [ns]: of another rate, they stand for another time.
        samples_shared: Samples at times that both have, with a value on both sides.
        largest_change: Largest absolute change at one of them; None without any.
        t_largest_change: When that was, in [s] of the log; None without times.
    """

    run: str
    before: Statistics
    now: Statistics
    noise: float
    out_fraction_noise: tuple[float, float] | None
    periods: tuple[float, float]
    samples_shared: int
    largest_change: float | None
    t_largest_change: float | None

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
        moved = self.largest_change is not None and self.largest_change > self.noise
        return bool(self.worse or self.better or moved or self.before.verdict != self.now.verdict)

    def _grown(self, *, before: int, now: int) -> tuple[Worse, ...]:
        """Return what is larger on one side (0 the baseline, 1 now) than on the other, or rests on less."""
        one, other = ((self.before, self.now)[side] for side in (before, now))
        noise, count, lasted = (
            self.out_fraction_noise,
            other.samples,
            (one.samples or 0) * self.periods[before],
        )
        grown: dict[Worse, bool] = {
            "max": other.max > one.max + self.noise,
            "rms": other.rms > one.rms + self.noise,
            "out_fraction": noise is not None
            and (other.out_fraction or 0.0) > (one.out_fraction or 0.0) + noise[now],
            "samples": count is not None and count * self.periods[now] < KEPT * lasted,
        }
        return tuple(name for name, more in grown.items() if more)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        both = {
            name: {"before": getattr(self.before, name), "now": getattr(self.now, name)}
            for name in ("max", "rms", "out_fraction", "samples", "verdict")
        }
        return {
            "run": self.run,
            "quantity": self.now.quantity,
            "kind": self.now.kind,
            "unit": self.now.unit,
            "noise": self.noise,
            **both,
            "samples_shared": self.samples_shared,
            "largest_change": self.largest_change,
            "t_largest_change": self.t_largest_change,
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
class UnmatchedQuantity:
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
class SettingDifference:
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
        missing: What only the earlier one had.
        differences: What differs in the way the two were made.
        criteria: Of tests after ISO 9283: one a criterion that has a value in both; the cycles themselves are
            not held against each other.
    """

    name: str
    recording: Path | None
    noise: Mapping[str, float]
    changes: tuple[QuantityChange, ...]
    new: tuple[UnmatchedQuantity, ...]
    missing: tuple[UnmatchedQuantity, ...]
    differences: tuple[SettingDifference, ...]
    criteria: tuple[CriterionChange, ...] = ()

    @property
    def worse(self) -> tuple[QuantityChange, ...]:
        """The quantities that are worse than before, beyond the noise."""
        return tuple(change for change in self.changes if change.worse)

    @property
    def verdict(self) -> Verdict:
        """Fail if a quantity is worse, or something that was compared before is compared no more."""
        return "fail" if self.worse or self.worse_criteria or self.missing else "pass"

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
            "missing": [asdict(one) for one in self.missing],
            "differences": [asdict(one) for one in self.differences],
            "criteria": [one.to_dict() for one in self.criteria],
        }


Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class FailedLog:
    """A log that was to be compared, and could not be.

    Attributes:
        name: Its name.
        errors: All that is wrong with it, at least one.
    """

    name: str
    errors: tuple[Finding, ...]


def judge_others(
    judge: Callable[[Sequence[Run]], Made], runs: Sequence[Run], failed_logs: list[FailedLog]
) -> Made:
    """Return what a function makes of those runs that it takes, and add the others to a list.

    Raises:
        UrmpipeError: With everything that is wrong, if it takes none, or not all that it takes alone.
    """
    try:
        return judge(runs)
    except UrmpipeError:
        alone = [_lost(judge, run) for run in runs]
        kept = [run for run, lost in zip(runs, alone, strict=True) if lost is None]
        if not kept or len(kept) == len(runs):
            raise
    failed_logs += [lost for lost in alone if lost is not None]
    return judge(kept)


def _lost(judge: Callable[[Sequence[Run]], object], run: Run) -> FailedLog | None:
    """Return why a run cannot be judged, even alone; None if it can."""
    try:
        judge([run])
    except UrmpipeError as error:
        return FailedLog(run.name, error.findings)
    return None
