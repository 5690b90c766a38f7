"""Results of `compare`: the deviations of some logs, the verdict on all, and the changes since a baseline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from urmpipe_models.display import format_count, format_headline
from urmpipe_models.errors import Finding
from urmpipe_pipeline.comparison.deviation import Deviation, Share, Statistics, Verdict
from urmpipe_pipeline.iso9283.criteria import Criterion
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.iso9283.tables import not_judged_findings
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.run import SCHEMA
from urmpipe_pipeline.trajectories import Trajectory

if TYPE_CHECKING:
    import pandas as pd

# The columns of `Comparison.rows`: of a share its `value`, of a deviation its statistics.
ROW = ("run", "sync_offset", *(column.name for column in fields(Statistics)), "value")


def tolerance_sort_key(run: Deviation) -> tuple[bool, float, float]:
    """Return verdict, utilisation of the tolerance and rms norm of a log: the best sorts first."""
    return (
        run.verdict == "fail",
        run.decisive.utilisation or 0.0,
        run.statistics.get("norm", run.worst_statistics).rms,
    )


def _decided(run: Deviation) -> str:
    quantity = run.decisive
    return (
        f"{quantity.quantity} {quantity.value:.1%}"
        if isinstance(quantity, Share)
        else f"{quantity.max:.4g} {quantity.unit}"
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Comparison(Result):
    """Some logs compared with one reference.

    Attributes:
        name: Its name.
        reference: The commanded trajectory.
        runs: One deviation per log.
        tolerance: Largest absolute deviation allowed in [m] or [rad], by kind, or by x, y, z.
        warnings: Warnings about the comparison.
        provenance: How to repeat it.
        recording: The file it was written to.
        baseline: What changed since an earlier comparison, if there is one.
        assumptions: Assumptions of the verdict, each as the end of "assuming ...".
        on_rows: Whether the logs were judged on their rows; in old recordings on the grid.
        iso: The test after ISO 9283 whose cycles the runs are; its criteria are judged, the runs are not.
        failed_logs: The failed logs, without a verdict.
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
        """Return the warnings of a log, and those of the comparison about it."""
        return (*run.run.warnings, *(warning for warning in self.warnings if warning.about == run.name))

    @property
    def general_warnings(self) -> tuple[LogWarning, ...]:
        """The warnings that are not about a single log."""
        return tuple(
            warning for warning in self.warnings if warning.about not in [run.name for run in self.runs]
        )

    @property
    def ranking(self) -> tuple[Deviation, ...]:
        """The logs from best to worst.

        Those that pass come first, and among them (as among the others) those with full shares; then the
        utilisation of the tolerance decides, then the rms norm.
        """
        by_used = sorted(self.runs, key=tolerance_sort_key)
        return tuple(sorted(by_used, key=lambda run: (run.verdict == "fail", bool(run.incomplete_shares))))

    @property
    def worst(self) -> Deviation:
        """The log of the largest utilisation of its tolerance, which the verdict line names.

        It need not be the last of the ranking, where logs without full shares come last.
        """
        return sorted(self.runs, key=tolerance_sort_key)[-1]

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield one row per log and quantity: the offset of the clocks, the statistics and the verdict.

        Of a test after ISO 9283 one row per criterion and place.
        """
        if self.iso is not None:
            yield from self.iso.rows()
            return
        for run in self.runs:
            for quantity in run.quantities:
                offset = run.sync.offset if run.run.timed else None
                yield dict.fromkeys(ROW) | {"run": run.name, "sync_offset": offset} | quantity.fields()

    def _headline(self) -> str:
        """Return its verdict, and that of each log: the worst first, because the end may be truncated."""
        if self.iso is not None:
            worst = (
                f"{criterion.name} {criterion.value:.4g} {criterion.unit}"
                for criterion in self.iso.overall
                if criterion.value is not None
            )
            return format_headline(
                f"{self.name}: {self.verdict or 'not judged'}", self.iso.cycle_count, *worst
            )
        logs = (
            f"{deviation.name} {deviation.verdict} ({_decided(deviation)})"
            for deviation in reversed(self.ranking)
        )
        failed = sum(deviation.verdict == "fail" for deviation in self.runs)
        share = f" ({failed} of {len(self.runs)} logs)" if failed and len(self.runs) > 1 else ""
        worse = ", worse than the baseline" if self.baseline and self.baseline.verdict == "fail" else ""
        count = len(self.assumptions)
        assumed = f", on {format_count(count, 'assumption')}" if count else ""
        lost = (f"{log.name} not judged" for log in self.failed_logs)
        return format_headline(
            f"{self.name}: {self.verdict or 'incomplete'}{share}{worse}{assumed}", *lost, *logs
        )

    def _notes(self) -> list[str]:
        of_logs = [warning.of(run.name) for run in self.runs for warning in run.run.warnings]
        return [str(warning) for warning in (*self.errors, *self.warnings, *of_logs)]

    def to_frame(self) -> pd.DataFrame:
        """Return one row per log and quantity, as `rows`."""
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
            "warnings": [warning.to_dict() for warning in self.warnings],
            "baseline": None if self.baseline is None else self.baseline.to_dict(),
            "iso": None if self.iso is None else self.iso.to_dict(),
            "failed_logs": [
                {"name": log.name, "errors": [error.to_dict() for error in log.errors]}
                for log in self.failed_logs
            ],
            "recording": str(self.recording) if self.recording else None,
        }


Worse: TypeAlias = Literal["max", "rms", "out_fraction", "samples"]

# Share of the samples, counted by the time that each covers, below which a log lost some: one program that is
# recorded by hand varies less.
MIN_SAMPLES_KEPT = 0.9


@dataclass(frozen=True, slots=True)
class QuantityChange:
    """Change of one quantity of one log since the baseline.

    Attributes:
        run: The log's name now.
        before: The statistics of the baseline.
        now: The statistics now.
        noise: Change to ignore, in the unit of the statistics.
        out_fraction_noise: Fraction of the samples, 0..1, that the noise can have put out of tolerance,
            before and now: those that are out by no more than it, and one sample where the times differ;
            None where the fractions are not comparable (no tolerance, or another one than before).
        periods: Periods of the samples before and now in [ns], the time that each covers.
        samples_shared: Samples at times that both have, with a value on both sides.
        largest_change: Largest absolute change at one of them; None without any.
        t_largest_change: Its time in [s] of the log; None without times.
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
        """Statistics that are larger than before by more than the noise; samples: far fewer than before."""
        return self._grown(before=0, now=1)

    @property
    def better(self) -> tuple[Worse, ...]:
        """Statistics that are smaller than before by more than the noise; samples: far more than before."""
        return self._grown(before=1, now=0)

    @property
    def changed(self) -> bool:
        """Whether anything changed beyond the noise: the statistics, the verdict, or one sample."""
        moved = self.largest_change is not None and self.largest_change > self.noise
        return bool(self.worse or self.better or moved or self.before.verdict != self.now.verdict)

    def _grown(self, *, before: int, now: int) -> tuple[Worse, ...]:
        """Return the statistics that are larger on side `now` (0 the baseline, 1 now) than on `before`."""
        old, new = ((self.before, self.now)[side] for side in (before, now))
        noise, count, lasted = self.out_fraction_noise, new.samples, (old.samples or 0) * self.periods[before]
        grown: dict[Worse, bool] = {
            "max": new.max > old.max + self.noise,
            "rms": new.rms > old.rms + self.noise,
            "out_fraction": noise is not None
            and (new.out_fraction or 0.0) > (old.out_fraction or 0.0) + noise[now],
            "samples": count is not None and count * self.periods[now] < MIN_SAMPLES_KEPT * lasted,
        }
        return tuple(name for name, is_larger in grown.items() if is_larger)

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
    """Change of a criterion after ISO 9283, over all, since the baseline.

    Attributes:
        before: The criterion of the baseline.
        now: The criterion now.
        noise: Change to ignore, in its unit.
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
    """A log or quantity that only one of the two comparisons has.

    Attributes:
        run: The log's name; of a quantity, its name now.
        quantity: The quantity that one of the logs lacks; None if the log is absent.
    """

    run: str
    quantity: str | None = None

    def __str__(self) -> str:
        return self.run if self.quantity is None else f"{self.quantity} of {self.run}"


@dataclass(frozen=True, slots=True)
class SettingDifference:
    """A difference in how the two comparisons were made, as in the JSON."""

    what: str
    before: Any
    now: Any


@dataclass(frozen=True, slots=True)
class BaselineComparison:
    """The changes of a comparison since an earlier one.

    Attributes:
        name: The name of the earlier one.
        recording: Its file.
        noise: Changes in [m] and [rad] to ignore, by kind.
        changes: One per log and quantity that both have.
        new: Logs and quantities that the earlier one lacks.
        missing: Logs and quantities that only the earlier one has.
        differences: Differences in how the two were made.
        criteria: Of tests after ISO 9283: one per criterion that has a value in both; the cycles are not
            compared.
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
        """Fail if a quantity is worse, or a log or quantity of the baseline is no longer compared."""
        return "fail" if self.worse or self.worse_criteria or self.missing else "pass"

    @property
    def worse_criteria(self) -> tuple[CriterionChange, ...]:
        """The criteria that are worse than before, beyond the noise."""
        return tuple(change for change in self.criteria if change.worse)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "name": self.name,
            "recording": str(self.recording) if self.recording else None,
            "verdict": self.verdict,
            "noise": dict(self.noise),
            "changes": [change.to_dict() for change in self.changes],
            "new": [asdict(absent) for absent in self.new],
            "missing": [asdict(absent) for absent in self.missing],
            "differences": [asdict(difference) for difference in self.differences],
            "criteria": [change.to_dict() for change in self.criteria],
        }


@dataclass(frozen=True, slots=True)
class FailedLog:
    """A failed log, which could not be compared.

    Attributes:
        name: Its name.
        errors: Its errors, at least one.
    """

    name: str
    errors: tuple[Finding, ...]
