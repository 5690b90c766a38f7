"""What is shown of a log wherever it stands, alone or compared: facts, audit, inferences, events."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

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

AUDIT_NOTES: dict[AuditKind, str] = {
    "in-between": "in-between: a linear resampling left this sample on a wrap, Step off the line of its"
    " neighbours; it is unchanged.",
    "repaired": "repaired: a linear resampling left this sample on a wrap; it was moved by Step onto the line"
    " of its neighbours.",
    "unexplained": "unexplained: a step of more than a quarter period that is not a wrap; it is unchanged.",
    "ambiguous": "ambiguous: a gap in which the joint may have turned by more than half a period.",
}
"""What the kinds that are no wraps mean."""


def log_facts(run: Run) -> tuple[Fact, ...]:
    """Return what a log is: its arm, rows, grid and duration."""
    return (
        Fact("Robot", run.robot.name if run.robot else "none: no kinematics"),
        Fact("Source", run.log.source, brief=False),
        *_time_facts(run),
        recording_fact(run.recording),
    )


def _time_facts(run: Run) -> Iterator[Fact]:
    """Yield how many rows a log has, how far apart, and how long it is."""
    if not run.timed:
        yield Fact("Rows", f"{run.log.rows}, without times")
        return
    for name, count, noun, period in (
        ("Rows", run.log.rows, "row", run.log.period),
        ("Grid", len(run.t_ns), "sample", run.tsp),
    ):
        every = f" every {text.seconds(period)} s" if count > 1 else ""
        yield Fact(name, f"{text.counted(count, noun)}{every}")
    yield Fact("Duration", Value(run.duration, "s"))


def log_tables(run: Run) -> Iterator[Table]:
    """Yield what was done to a log, how it was read, and what it was made from."""
    if run.log.joints:
        yield audit_table(run)
    yield inference_table(run)
    yield from file_tables(run)


def audit_table(run: Run, *, brief: bool = False) -> Table:
    """Return what the repolarizer found: joint, row, instant, step, turns before and after."""
    heads: Heads[AuditEntry] = {
        "kind": ("What", lambda one: one.kind),
        "joint": ("Joint", lambda one: one.joint),
        "row": ("Row", lambda one: Value(one.row)),
        "t": ("Instant t_r", lambda one: Value(one.t, "s")),
        "half_period": ("±", lambda one: Value(one.half_period, "s")),
        "step": ("Step", lambda one: Value(one.step, "rad", signed=True)),
        "from": ("Turns k before", lambda one: Value(one.before, signed=True)),
        "to": ("Turns k after", lambda one: Value(one.after, signed=True)),
    }
    kinds = {one.kind for one in run.audit}
    note = " ".join(note for kind, note in AUDIT_NOTES.items() if kind in kinds)
    title = f"Audit of the repolarizer ({audit_words(run)})"
    return Table(title, columns_of(run.audit, heads), note, brief)


def audit_words(run: Run) -> str:
    """Return how often a log was repolarized, and what else was found: "2 repolarizations"."""
    wraps = len(run.repolarizations)
    others = len(run.audit) - wraps
    more = f", {text.counted(others, 'other finding')}" if others else ""
    return f"{text.counted(wraps, 'repolarization')}{more}"


def inference_table(run: Run, *, brief: bool = False) -> Table:
    """Return what was inferred about a log, and how else it can be read."""
    rows: list[tuple[Cell, ...]]
    rows = [(one.what, one.value, one.evidence, Advice(hints=one.hints)) for one in run.log.inferences]
    known = {one.what for one in run.log.inferences}
    if "robot" not in known and run.robot is not None:
        rows.append(("robot", run.robot.name, run.robot.description, Advice(hints=(Hint("robot"),))))
    heads = {"what": "Subject", "found": "Found", "evidence": "Why", "alternatives": "Otherwise"}
    table = table_of(f"What was inferred ({len(rows)})", heads, rows, brief=brief, folded=True)
    *others, last = table.columns
    return replace(table, columns=(*others, replace(last, brief=False)))


def torque_table(run: Run) -> Iterator[Table]:
    """Yield the largest torque of each joint and its limit; nothing where torques are not known."""
    if run.tau is None:
        return
    found = cache(run.torque_summaries)
    heads: Heads[int] = {
        "joint": ("Joint", lambda j: run.log.joints[j]),
        "max": ("Largest torque", lambda j: Value(float(f"{found()[j].max:.4g}"), found()[j].unit)),
        "t_max": ("At t", lambda j: Value(found()[j].t_max, "s")),
        "rms": ("RMS", lambda j: Value(float(f"{found()[j].rms:.4g}"), found()[j].unit)),
        "effort": ("Effort limit", lambda j: Value(found()[j].effort, found()[j].unit, given=True)),
        "effort_share": ("Used", lambda j: Value(found()[j].effort_share, "%", limit=1.0)),
        "out_fraction": ("Time beyond", lambda j: Value(found()[j].out_fraction, "%")),
    }
    note = "The torque that the motion takes, by inverse dynamics, without friction and load at the tool."
    made, assumed = format_acceleration_source(run.derivative, len(run.t_ns)), run.log.period_assumed
    note = " ".join(filter(None, (note, made, PERIOD_ASSUMED if assumed else "")))
    yield Table("Joint torques", columns_of(range(len(run.log.joints)), heads), note)


def file_tables(run: Run) -> Iterator[Table]:
    """Yield which columns of the files were used, in which units, the files, and how the run was made."""
    heads: Heads[LogColumn] = {
        "name": ("Column", lambda one: one.name),
        "role": ("Holds", lambda one: one.role),
        "unit": ("Unit", lambda one: one.unit),
    }
    columns = columns_of(run.log.columns, heads)
    yield Table(f"Columns ({len(run.log.columns)})", columns, brief=False, folded=True)
    yield inputs_table("Input files", run.log.files)
    yield provenance_table(run.provenance, "How the log was read")


def log_events(run: Run) -> Iterator[Event]:
    """Yield the audit at its instants, and the warnings at their rows."""
    for entry in run.audit:
        level: Level = "info" if entry.kind in ("wrap", "repaired") else "warning"
        yield Event(round(entry.t * 1e9), f"{entry.joint} {_entry_words(entry)}", level)
    for one in run.warnings:
        row = int(np.clip((one.row or 1) - 1, 0, run.log.rows - 1))
        yield Event(int(run.log.t_ns[row]) if run.timed else None, one, "warning")


def _entry_words(one: AuditEntry) -> str:
    """Return what happened to a joint, and in which row."""
    where, step = f"in row {one.row}", f"{one.step:+.4f} rad"
    if one.kind == "wrap":
        turns = f"{one.before:+d} to {one.after:+d} turns"
        return f"repolarized {where}: step {step}, {turns}, ± {1e3 * one.half_period:.3g} ms"
    if one.kind in ("in-between", "repaired"):
        done = "repaired" if one.kind == "repaired" else "left on a wrap"
        return f"{done} {where}: {step} off the line of its neighbours"
    gap = f"a gap of {2e3 * one.half_period:.6g} ms: the number of turns is unknown"
    return f"{one.kind} {where}: step {step}, {'no wrap' if one.kind == 'unexplained' else gap}"
