"""The presentation of a run: how it was read, what was repolarized, how it moves."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from urmpipe_models.display import format_count
from urmpipe_pipeline.outputs import AUDIT_COLUMNS
from urmpipe_pipeline.presentation.parts import rows_table
from urmpipe_pipeline.presentation.section import Block, Judged, Presentation, Ref, Section, Table, Value
from urmpipe_pipeline.runs.figures import run_figures
from urmpipe_pipeline.runs.parts import (
    audit_table,
    file_tables,
    format_audit,
    inference_table,
    log_events,
    log_facts,
    torque_table,
)
from urmpipe_pipeline.runs.playback import playback_figures
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.runs.scene import mass_drawing, path_figure, run_scene


def present(run: Run) -> Presentation:
    """Return the presentation of a run, which has no verdict."""
    duration = Value(run.duration, "s") if run.timed else None
    body = Section(
        f"Log {run.name}",
        None,
        log_facts(run),
        (
            inference_table(run, brief=True),
            *([audit_table(run, brief=True)] if run.audit else []),
            *torque_table(run),
        ),
        partial(run_figures, run),
        partial(_page, run),
        events=partial(log_events, run),
        warnings=run.warnings,
    )
    return Presentation(
        name=run.name,
        headline=f"{run.name}: {_headline(run)}",
        verdict=None,
        facts=(),
        body=body,
        word="ingested",
        opens_at_ns=int(run.t_ns[0]) if run.timed else 0,
        opens_at_row=None if run.timed else 0,
        scene=partial(run_scene, run),
        lines=(
            {
                "Log": Ref(body.title),
                "Verdict": Judged(None),
                "Robot": run.robot.name if run.robot else "none",
                "Source": run.log.source,
                "Rows": Value(run.log.rows),
                "Duration": duration,
                "Joints": Value(len(run.log.joints)),
                "Repolarizations": Value(len(run.repolarizations)),
                "Warnings": Value(len(run.warnings)),
            },
        ),
        rows=partial(audit_rows, run),
        created=run.provenance.created,
    )


def _headline(run: Run) -> str:
    if not run.timed:
        return format_count(run.log.rows, "static pose")
    return f"{format_count(run.log.rows, 'row')}, {format_audit(run)}"


def audit_rows(run: Run) -> Table:
    """Return the table that --audit writes: one row per entry."""
    return rows_table("Audit of the repolarizer", AUDIT_COLUMNS, (entry.to_dict() for entry in run.audit))


def _page(run: Run) -> Iterator[Block]:
    """Yield the blocks that only a page shows."""
    yield from playback_figures(run)
    yield from path_figure(run)
    yield from mass_drawing(run)
    yield from file_tables(run)
