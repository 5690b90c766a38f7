"""The tables of a report: the numbers of the results, each with its unit in the column's head."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from urmpipe_pipeline.audit_entry import AuditKind
from urmpipe_pipeline.comparison import AXES, Comparison, Deviation, Statistics
from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.report import text
from urmpipe_pipeline.results import Run

LONG = 12
"""A table with more rows is folded away."""

MOST = 500
"""Rows of a table at most; what is left out is counted. The JSON output holds them all."""


AUDIT_NOTES: dict[AuditKind, str] = {
    "in-between": "in-between: a sample that a linear resampling left on a wrap, Step rad off the line of its"
    " neighbours; it stands as it is.",
    "repaired": "repaired: a sample that a linear resampling left on a wrap, put on the line of its"
    " neighbours, Step rad away.",
    "unexplained": "unexplained: a step above a quarter period that is no wrap; it stays.",
    "ambiguous": "ambiguous: a gap in which the joint can have turned more than half a period.",
}
"""What the kinds that are no wraps mean."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell.

    Attributes:
        text: What stands there.
        state: pass or fail, shown as a sign and a word; empty where it is no judgement.
        href: Where it leads, such as "#r1".
        used: Share of the tolerance that is used up, 0..1, shown as a bar under the number.
    """

    text: str
    state: str = ""
    href: str = ""
    used: float | None = None


@dataclass(frozen=True, slots=True)
class Column:
    """One column: its head, and whether it holds numbers (set to the right) or words."""

    title: str
    number: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """One table; the first cell of a row is the row's head.

    Attributes:
        title: Its heading.
        columns: From the left.
        rows: One cell a column.
        folded: True if it is closed until someone opens it.
        note: A line under it.
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    folded: bool = False
    note: str = ""
    kind: Literal["table"] = "table"


def words(*titles: str) -> tuple[Column, ...]:
    """Return columns of words."""
    return tuple(Column(title) for title in titles)


def numbers(*titles: str) -> tuple[Column, ...]:
    """Return columns of numbers."""
    return tuple(Column(title, True) for title in titles)


def listing(
    title: str, columns: tuple[Column, ...], rows: Iterable[Sequence[str]], *, folded: bool | None = None
) -> Table:
    """Return a table of plain cells: folded when it is long, cut with a note when it is very long."""
    cells = [tuple(Cell(value) for value in row) for row in rows]
    left = len(cells) - MOST
    note = f"{left} more; the JSON output lists them all." if left > 0 else ""
    return Table(title, columns, tuple(cells[:MOST]), len(cells) > LONG if folded is None else folded, note)


def verdict_table(comparison: Comparison, links: Sequence[str]) -> Table:
    """Return one line a log: the largest deviations, how much is out, when and where it is worst."""
    head = numbers(*(f"max |{text.SYMBOLS[axis]}| [mm]" for axis in "xyz"), "max ‖Δ‖ [mm]")
    columns = (*words("Log", "Verdict"), *head, *numbers("Samples out", "Worst at t [s]"))
    rows = tuple(_verdict_row(run, link) for run, link in zip(comparison.runs, links, strict=True))
    note = f"Tolerance: {text.tolerance(comparison.tolerance)}. The bars show how much of it is used up."
    return Table(
        f"Verdict against {comparison.reference.name}",
        (*columns, *numbers("Worst at x, y, z [m]")),
        rows,
        note=note,
    )


def ingest_table(runs: Sequence[Run], links: Sequence[str]) -> Table:
    """Return one line an ingested log."""
    columns = (
        *words("Log", "Robot", "Source"),
        *numbers("Rows", "Duration [s]", "Joints", "Repolarizations", "Warnings"),
    )
    rows = tuple(
        (
            Cell(run.name, href=link),
            Cell(run.robot.name if run.robot else "none"),
            Cell(run.log.source),
            Cell(str(run.log.rows)),
            Cell(text.seconds(run.duration)),
            Cell(str(len(run.log.joints))),
            Cell(str(len(run.repolarizations))),
            Cell(str(len(run.warnings))),
        )
        for run, link in zip(runs, links, strict=True)
    )
    return Table("Ingested logs", columns, rows)


def statistics_table(deviation: Deviation) -> Table:
    """Return the statistics per axis and norm, with the deviation at the start pose."""
    columns = (
        *words("Quantity", "Verdict"),
        *numbers("tolerance [mm]", "max |Δ| [mm]", "at t [s]", "rms [mm]", "p95 |Δ| [mm]"),
        *numbers("mean [mm]", "std [mm]", "at start [mm]"),
    )
    rows = tuple(
        _statistics_row(text.SYMBOLS[axis], deviation.statistics[axis], start)
        for axis, start in zip(AXES, deviation.start, strict=True)
    )
    note = (
        "max, rms and p95 are of absolute values, mean and std signed. At start: the agreement of the start"
        f" poses (mutual calibration) at t = {text.seconds(float(deviation.t[0]))} s."
    )
    return Table("Statistics", columns, rows, note=note)


def audit_table(run: Run) -> Table:
    """Return the audit: what was found, joint, row, instant, step, turns before and after."""
    columns = (
        *words("What", "Joint"),
        *numbers("Row", "Instant t_r [s]", "± [s]", "Step [rad]", "Turns k before", "Turns k after"),
    )
    rows = [
        (
            item.kind,
            item.joint,
            str(item.row),
            text.seconds(item.t),
            text.seconds(item.half_period),
            f"{item.step:+.6f}",
            f"{item.before:+d}" if item.before else "0",
            f"{item.after:+d}" if item.after else "0",
        )
        for item in run.audit
    ]
    wraps = text.counted(len(run.repolarizations), "wrap")
    table = listing(f"Audit of the repolarizer ({wraps})", columns, rows)
    kinds = {item.kind for item in run.audit}
    said = (table.note, *(note for kind, note in AUDIT_NOTES.items() if kind in kinds))
    return replace(table, note=" ".join(note for note in said if note))


def warnings_table(found: Comparison | Run) -> Table:
    """Return the warnings of a comparison or a run."""
    columns = (Column("Kind"), *numbers("Row"), Column("What"))
    rows = [
        (warning.kind, text.NOTHING if warning.row is None else str(warning.row), warning.message)
        for warning in found.warnings
    ]
    return listing(f"Warnings ({len(rows)})", columns, rows)


def inference_table(run: Run) -> Table:
    """Return what the reader found out about the file by itself, and the units of its columns."""
    rows = [(item.what, item.value, item.evidence) for item in run.log.inferences]
    rows += [(f"unit of {column}", unit, "as read") for column, unit in run.log.units.items()]
    return listing(f"What was inferred ({len(rows)})", words("Subject", "Found", "Why"), rows, folded=True)


def inputs_table(title: str, files: Iterable[SourceFile]) -> Table:
    """Return the input files by name, length and hash."""
    rows = [(file.name, text.size(file.size), file.sha256) for file in files]
    columns = (Column("File"), *numbers("Size [bytes]"), Column("SHA-256"))
    return listing(title, columns, rows, folded=True)


def provenance_table(provenance: Provenance) -> Table:
    """Return how to repeat it: command, options, versions, when."""
    rows = [("command", provenance.command), ("created", provenance.created)]
    rows += _named("option", provenance.options) + _named("version of", provenance.versions)
    return listing("How it was made", words("What", "Value"), rows, folded=True)


def _named(word: str, values: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [(f"{word} {name}", text.plain(value)) for name, value in values.items()]


def _verdict_row(run: Deviation, link: str) -> tuple[Cell, ...]:
    worst = run.worst
    return (
        Cell(run.name, href=link),
        _judged(run.verdict),
        *(_largest(run.statistics[axis]) for axis in AXES),
        Cell(text.percent(run.share_out)),
        Cell(text.seconds(float(run.t[worst]))),
        Cell(text.point(run.actual[worst])),
    )


def _statistics_row(symbol: str, statistics: Statistics, start: float) -> tuple[Cell, ...]:
    return (
        Cell(symbol),
        _judged(statistics.verdict),
        Cell(text.limit(statistics.tolerance)),
        _largest(statistics),
        Cell(text.seconds(statistics.t_max)),
        *(
            Cell(text.millimetres(value))
            for value in (statistics.rms, statistics.p95, statistics.mean, statistics.std, start)
        ),
    )


def _judged(verdict: str | None) -> Cell:
    return Cell(text.NOTHING) if verdict is None else Cell(verdict.upper(), verdict)


def _largest(statistics: Statistics) -> Cell:
    """Return the largest value, marked where it is out of tolerance."""
    allowed = statistics.tolerance
    used = None if not allowed else min(statistics.max / allowed, 1.0)
    state = "fail" if statistics.verdict == "fail" else ""
    return Cell(text.millimetres(statistics.max, allowed), state, used=used)
