"""The tables of a log: what it is, what was done to it, what is doubtful, where it comes from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.json_values import plain
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.repolarization.audit_entry import AuditKind
from urmpipe_pipeline.report.tables import (
    Cell,
    Column,
    Table,
    judged,
    listing,
    numbers,
    without_empty_columns,
    words,
)
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result
from urmpipe_pipeline.solved_targets.verdict import reached, verdict_of

AUDIT_NOTES: dict[AuditKind, str] = {
    "in-between": "in-between: a sample that a linear resampling left on a wrap, Step deg off the line of its"
    " neighbours; it stands as it is.",
    "repaired": "repaired: a sample that a linear resampling left on a wrap, put on the line of its"
    " neighbours, Step deg away.",
    "unexplained": "unexplained: a step above a quarter period that is no wrap; it stays.",
    "ambiguous": "ambiguous: a gap in which the joint can have turned more than half a period.",
}
"""What the kinds that are no wraps mean."""


def ingest_table(runs: Sequence[Run], links: Sequence[str]) -> Table:
    """Return one line an ingested log, or the targets of a file with the verdict of ik on them."""
    columns = (
        *words("Targets" if all(run.goals is not None for run in runs) else "Log", "Verdict"),
        *words("Robot", "Source"),
        *numbers("Rows", "Reached", "Duration [s]", "Joints", "Repolarizations", "Warnings"),
    )
    rows = tuple(
        (
            Cell(run.name, href=link),
            judged(verdict_of(run)),
            Cell(run.robot.name if run.robot else "none"),
            Cell(run.log.source),
            Cell(str(run.log.rows)),
            Cell(text.NOTHING if run.goals is None else str(reached(run))),
            Cell(text.NOTHING if not run.timed else text.seconds(run.duration)),
            Cell(str(len(run.log.joints))),
            Cell(str(len(run.repolarizations))),
            Cell(str(len(run.warnings))),
        )
        for run, link in zip(runs, links, strict=True)
    )
    title = "What was solved" if all(run.goals is not None for run in runs) else "What was read"
    return without_empty_columns(Table(title, columns, rows))


def audit_table(run: Run) -> Table:
    """Return the audit: what was found, joint, row, instant, step, turns before and after."""
    columns = (
        *words("What", "Joint"),
        *numbers("Row", "Instant t_r [s]", "± [s]", "Step [deg]", "Turns k before", "Turns k after"),
    )
    rows = [
        (
            item.kind,
            item.joint,
            str(item.row),
            text.seconds(item.t),
            text.seconds(item.half_period),
            f"{math.degrees(item.step):+.4f}",
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


def missed_table(run: Run) -> Table | None:
    """Return the targets of a solved run that the arm has no pose for; None if there are none."""
    goals = run.goals
    if goals is None or not goals.missed.any():
        return None
    rows = [
        (
            str(k + 1),
            text.NOTHING if not run.timed else text.seconds(goals.t_ns[k] / 1e9),
            text.point(goals.position[k]),
            goals.reasons[k],
        )
        for k in np.flatnonzero(goals.missed).tolist()
    ]
    columns = (*numbers("Row", "t [s]"), *words("x, y, z [m]", "Why"))
    table = listing(f"Targets without a solution ({len(rows)})", columns, rows)
    return without_empty_columns(table)


def warnings_table(found: Result) -> Table:
    """Return the warnings of a result."""
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
    return [(f"{word} {name}", plain(value)) for name, value in values.items()]
