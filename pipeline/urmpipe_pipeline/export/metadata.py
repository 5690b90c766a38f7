"""What every export tells about itself, where its format can hold it."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.json_values import json_ready
from urmpipe_pipeline.simulations.simulation import Result, Simulation

MARK = "urmpipe export"
"""Stands in every file that can hold it; only such a file is replaced."""


def describe(result: Result, rows: str) -> dict[str, Any]:
    """Return what a reader of the file needs to know: what it is, its clock, where it came from."""
    made = result.provenance
    about: dict[str, Any] = {
        "mark": MARK,
        "schema": 1,
        "name": result.name,
        "rows": rows,
        "inputs": [asdict(one) for one in made.inputs],
        "command": made.command,
        "options": dict(made.options),
        "versions": dict(made.versions),
        "created": made.created,
    }
    if isinstance(result, Comparison):
        return about | {
            "reference": result.reference.name,
            "tolerance": dict(result.tolerance),
            "verdict": result.verdict,
            "runs": [run.name for run in result.runs],
        }
    if isinstance(result, Simulation):
        return about | {
            "description": result.description,
            "step": result.step,
            "failed": result.failed,
            "verdict": result.verdict,
            "verdicts": [one.to_dict() for one in result.verdicts],
            "system": result.system_text,
        }
    return about | {
        "source": result.log.source,
        "robot": result.robot.name if result.robot else None,
        "joints": list(result.log.joints),
        "tsp": result.tsp,
        "clock_start_ns": result.log.clock_start_ns,
        "repolarizations": len(result.repolarizations),
    }


def as_json(about: dict[str, Any]) -> str:
    """Return a description as JSON, which every encoding can hold."""
    return json.dumps(json_ready(about))
