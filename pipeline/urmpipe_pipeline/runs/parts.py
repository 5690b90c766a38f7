"""Parts of a presentation of a log, alone or compared: facts, audit, inferences, torques, files, events."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.errors import Hint
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogColumn
from urmpipe_pipeline.presentation.parts import (
    Heads,
    columns_of,
    inputs_table,
    provenance_table,
    recording_fact,
    table_of,
)
from urmpipe_pipeline.presentation.section import Advice, Cell, Event, Fact, Level, Table, Value
from urmpipe_pipeline.repolarization.audit import AuditEntry, AuditKind
from urmpipe_pipeline.runs.derivatives import format_acceleration_source
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.runs.torques import PERIOD_ASSUMED

AUDIT_NOTES: dict[AuditKind, str] = {  # of the kinds other than wraps
    "in-between": "in-between: a linear resampling left this sample on a wrap, Step off the line of its"
    " neighbours; it is unchanged.",
    "repaired": "repaired: a linear resampling left this sample on a wrap; it was moved by Step onto the line"
    " of its neighbours.",
    "unexplained": "unexplained: a step of more than a quarter period that is not a wrap; it is unchanged.",
    "ambiguous": "ambiguous: a gap in which the joint may have turned by more than half a period.",
}


def log_facts(run: Run) -> tuple[Fact, ...]:
    """Return the facts about a log: its arm, rows, grid and duration."""
    return (
        Fact("Robot", run.robot.name if run.robot else "none: no kinematics"),
        Fact("Source", run.log.source, brief=False),
        *_time_facts(run),
        recording_fact(run.recording),
    )


def _time_facts(run: Run) -> Iterator[Fact]:
    if not run.timed:
        yield Fact("Rows", f"{run.log.rows}, without times")
        return
    for name, count, noun, period in (
        ("Rows", run.log.rows, "row", run.log.period),
        ("Grid", len(run.t_ns), "sample", run.tsp),
    ):
        every = f" every {text.format_seconds(period)} s" if count > 1 else ""
        yield Fact(name, f"{format_count(count, noun)}{every}")
    yield Fact("Duration", Value(run.duration, "s"))


def log_tables(run: Run) -> Iterator[Table]:
    """Yield the tables about a log: its audit, its inferences, its columns and files."""
    if run.log.joints:
        yield audit_table(run)
    yield inference_table(run)
    yield from file_tables(run)


def audit_table(run: Run, *, brief: bool = False) -> Table:
    """Return the audit of the repolarizer: joint, row, time, step, turns before and after."""
    heads: Heads[AuditEntry] = {
        "kind": ("What", lambda entry: entry.kind),
        "joint": ("Joint", lambda entry: entry.joint),
        "row": ("Row", lambda entry: Value(entry.row)),
        "t": ("Instant t_r", lambda entry: Value(entry.t, "s")),
        "time_uncertainty": ("±", lambda entry: Value(entry.time_uncertainty, "s")),
        "step": ("Step", lambda entry: Value(entry.step, "rad", signed=True)),
        "turns_before": ("Turns k before", lambda entry: Value(entry.turns_before, signed=True)),
        "turns_after": ("Turns k after", lambda entry: Value(entry.turns_after, signed=True)),
    }
    kinds = {entry.kind for entry in run.audit}
    note = " ".join(note for kind, note in AUDIT_NOTES.items() if kind in kinds)
    title = f"Audit of the repolarizer ({format_audit(run)})"
    return Table(title, columns_of(run.audit, heads), note, brief)


def format_audit(run: Run) -> str:
    """Return the counts of an audit: "2 repolarizations, 1 other finding"."""
    wraps = len(run.repolarizations)
    rest = len(run.audit) - wraps
    more = f", {format_count(rest, 'other finding')}" if rest else ""
    return f"{format_count(wraps, 'repolarization')}{more}"


def inference_table(run: Run, *, brief: bool = False) -> Table:
    """Return the inferred properties of a log, and how to change them."""
    rows: list[tuple[Cell, ...]]
    inferences = run.log.inferences
    rows = [(each.what, each.value, each.evidence, Advice(hints=each.hints)) for each in inferences]
    if "robot" not in {each.what for each in inferences} and run.robot is not None:
        rows.append(("robot", run.robot.name, run.robot.description, Advice(hints=(Hint("robot"),))))
    heads = {"what": "Subject", "found": "Found", "evidence": "Why", "alternatives": "To change"}
    table = table_of(f"What was inferred ({len(rows)})", heads, rows, brief=brief, folded=True)
    *columns, last = table.columns
    return replace(table, columns=(*columns, replace(last, brief=False)))


def torque_table(run: Run) -> Iterator[Table]:
    """Yield the largest torque of each joint and its limit; nothing if torques are unknown."""
    if run.tau is None:
        return
    summaries = cache(run.torque_summaries)
    heads: Heads[int] = {
        "joint": ("Joint", lambda j: run.log.joints[j]),
        "max": ("Largest torque", lambda j: Value(float(f"{summaries()[j].max:.4g}"), summaries()[j].unit)),
        "t_max": ("At t", lambda j: Value(summaries()[j].t_max, "s")),
        "rms": ("RMS", lambda j: Value(float(f"{summaries()[j].rms:.4g}"), summaries()[j].unit)),
        "effort": ("Effort limit", lambda j: Value(summaries()[j].effort, summaries()[j].unit, given=True)),
        "effort_share": ("Used", lambda j: Value(summaries()[j].effort_share, "%", limit=1.0)),
        "out_fraction": ("Time beyond", lambda j: Value(summaries()[j].out_fraction, "%")),
    }
    note = "The torque that the motion takes, by inverse dynamics, without friction and load at the tool."
    source = format_acceleration_source(run.derivative, len(run.t_ns))
    note = " ".join(filter(None, (note, source, PERIOD_ASSUMED if run.log.period_assumed else "")))
    yield Table("Joint torques", columns_of(range(len(run.log.joints)), heads), note)


def file_tables(run: Run) -> Iterator[Table]:
    """Yield the used columns with their units, the files, and the provenance."""
    heads: Heads[LogColumn] = {
        "name": ("Column", lambda column: column.name),
        "role": ("Holds", lambda column: column.role),
        "unit": ("Unit", lambda column: column.unit),
    }
    columns = columns_of(run.log.columns, heads)
    yield Table(f"Columns ({len(run.log.columns)})", columns, brief=False, folded=True)
    yield inputs_table("Input files", run.log.files)
    yield provenance_table(run.provenance, "How the log was read")


def log_events(run: Run) -> Iterator[Event]:
    """Yield the audit at its times, and the warnings at their rows."""
    for entry in run.audit:
        level: Level = "info" if entry.kind in ("wrap", "repaired") else "warning"
        yield Event(round(entry.t * 1e9), f"{entry.joint} {_format_entry(entry)}", level)
    for warning in run.warnings:
        row = (warning.row or 1) - 1
        if run.log.file_rows is not None:
            row = int(np.searchsorted(run.log.file_rows, row + 1))
        row = int(np.clip(row, 0, run.log.rows - 1))
        yield Event(int(run.log.t_ns[row]) if run.timed else None, warning, "warning")


def _format_entry(entry: AuditEntry) -> str:
    where, step = f"in row {entry.row}", f"{entry.step:+.4f} rad"
    if entry.kind == "wrap":
        turns = f"{entry.turns_before:+d} to {entry.turns_after:+d} turns"
        return f"repolarized {where}: step {step}, {turns}, ± {1e3 * entry.time_uncertainty:.3g} ms"
    if entry.kind in ("in-between", "repaired"):
        done = "repaired" if entry.kind == "repaired" else "left on a wrap"
        return f"{done} {where}: {step} off the line of its neighbours"
    gap = f"a gap of {2e3 * entry.time_uncertainty:.6g} ms: the number of turns is unknown"
    return f"{entry.kind} {where}: step {step}, {'no wrap' if entry.kind == 'unexplained' else gap}"
