"""What `compare` returns: the deviations of some logs and the verdict on all, as tables and JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe_models.display import format_count, format_headline
from urmpipe_models.errors import Finding, Voice
from urmpipe_pipeline.comparison.change import BaselineComparison
from urmpipe_pipeline.comparison.deviation import Deviation, Share, Statistics, Verdict
from urmpipe_pipeline.comparison.unjudged import Unjudged
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.iso9283.tables import not_judged_findings
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.run import SCHEMA
from urmpipe_pipeline.trajectories import Trajectory

if TYPE_CHECKING:
    import pandas as pd


ROW = ("run", "sync_offset", *(one.name for one in fields(Statistics)), "value")
"""The columns of `Comparison.rows`: of a share its `value`, of a deviation its statistics."""


def by_tolerance(run: Deviation) -> tuple[bool, float, float]:
    """Return how far out of its tolerance a log is, the furthest last: share used up, then the rms norm."""
    return run.verdict == "fail", run.decisive.used or 0.0, run.statistics.get("norm", run.furthest).rms


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
        unjudged: The logs without a verdict, where the others were judged all the same.
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
    unjudged: tuple[Unjudged, ...] = ()

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
        return (*(error for log in self.unjudged for error in log.errors), *criteria)

    def warnings_of(self, run: Deviation) -> tuple[LogWarning, ...]:
        """Return the warnings of a log: those from before, and what the comparison says of it."""
        return (*run.run.warnings, *(one for one in self.warnings if one.about == run.name))

    @property
    def own_warnings(self) -> tuple[LogWarning, ...]:
        """The warnings that are about no single log."""
        return tuple(one for one in self.warnings if one.about not in [run.name for run in self.runs])

    @property
    def ranking(self) -> tuple[Deviation, ...]:
        """The logs from best to worst.

        Those that pass come first, and among them (as among the others) those that were seen as a whole; then
        the share of a tolerance that is used up decides, then the rms norm.
        """
        by_used = sorted(self.runs, key=by_tolerance)
        return tuple(sorted(by_used, key=lambda run: (run.verdict == "fail", bool(run.partly))))

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
        lost = (f"{one.name} not judged" for one in self.unjudged)
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

    def to_dict(self, voice: Voice = "python") -> dict[str, Any]:
        """Return the object that `urmpipe compare --json` prints."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "assumptions": list(self.assumptions),
            "tolerance": dict(self.tolerance),
            "reference": self.reference.name,
            "runs": [run.to_dict(voice) for run in self.runs],
            "ranking": [run.name for run in self.ranking],
            "warnings": [one.to_dict(voice) for one in self.warnings],
            "baseline": None if self.baseline is None else self.baseline.to_dict(),
            "iso": None if self.iso is None else self.iso.to_dict(),
            "unjudged": [
                {"name": log.name, "errors": [one.to_dict(voice) for one in log.errors]}
                for log in self.unjudged
            ],
            "recording": str(self.recording) if self.recording else None,
        }
