"""Everything of a result that is not an array, as JSON and back.

The JSON is what Python's json module writes: floats survive bit for bit, and the few values that JSON
itself lacks stand as NaN and Infinity. Options come back as JSON has them: a tuple as a list.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from urmpipe_models.chains.chain import Chain
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Statistics
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync, Trajectory
from urmpipe_pipeline.joint_log import Inference, JointLog, LogColumn, LogWarning, SourceFile
from urmpipe_pipeline.json_values import flat
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.recording.baseline_data import baseline_data, baseline_from
from urmpipe_pipeline.recording.entities import (
    LAYOUTS,
    Block,
    Place,
    branch_entity,
    branch_keys,
    places_of,
)
from urmpipe_pipeline.repolarization.audit_entry import AuditEntry
from urmpipe_pipeline.runs.results import Run


def to_json(result: Run | Comparison, blocks: list[Block]) -> str:
    """Return the metadata of a result as JSON, with the shape of every array that belongs to it."""
    standing = places_of(result)
    if isinstance(result, Run):
        return document("run", _run(result, standing[0]), blocks)
    return document("comparison", _comparison(result, standing), blocks)


def document(kind: str, data: Mapping[str, Any], blocks: list[Block]) -> str:
    """Return the metadata of a kind of result as JSON, with the shape of every array."""
    shapes = {block.entity: list(block.values.shape) for block in blocks}
    about = {"layout_version": LAYOUTS[kind], "kind": kind, "arrays": shapes, "result": data}
    return json.dumps(about, default=_plain)


def provenance_from(data: Mapping[str, Any]) -> Provenance:
    """Return the provenance that a JSON object tells of."""
    return Provenance(**{**data, "inputs": files_from(data["inputs"])})


def log_fields(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a `JointLog` that are no arrays."""
    return {
        **data,
        "files": files_from(data["files"]),
        "joints": tuple(data["joints"]),
        "columns": tuple(LogColumn(**one) for one in data["columns"]),
        "inferences": tuple(Inference(**one) for one in data["inferences"]),
        "warnings": warnings_from(data["warnings"]),
    }


def run_fields(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a `Run` that are no arrays, its log apart."""
    return {
        "name": data["name"],
        "tsp": data["tsp"],
        "robot": robot_from(data["robot"]),
        "audit": tuple(AuditEntry(**one) for one in data["audit"]),
        "warnings": warnings_from(data["warnings"]),
        "provenance": provenance_from(data["provenance"]),
    }


def deviation_fields(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a `Deviation` that are no arrays, its run apart."""
    return {
        "name": data["name"],
        "joint_turns": tuple(data["joint_turns"]),
        "sync": Sync(**data["sync"]),
        "alignment": _alignment(data["alignment"]),
        "left_out": data["left_out"],
        "reference_left_out": data["reference_left_out"],
        "statistics": {name: Statistics(**one) for name, one in data["statistics"].items()},
        "joint_statistics": {name: Statistics(**one) for name, one in data["joint_statistics"].items()},
        "start": tuple(data["start"]),
        "speed_correlation": data["speed_correlation"],
        "verdict": data["verdict"],
    }


def comparison_fields(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a `Comparison` that are no arrays, its reference and runs apart."""
    return {
        "name": data["name"],
        "tolerance": data["tolerance"],
        "warnings": warnings_from(data["warnings"]),
        "provenance": provenance_from(data["provenance"]),
        "baseline": baseline_from(data.get("baseline")),
    }


def reference_fields(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of the reference `Trajectory` that are no arrays."""
    return {
        "name": data["name"],
        "files": files_from(data["files"]),
        "joints": tuple(data["joints"]),
        "joint_units": tuple(data["joint_units"]),
    }


def _alignment(data: Mapping[str, Any]) -> Alignment:
    """Return the alignment that a JSON object tells of."""
    rotation = tuple(tuple(row) for row in data["rotation"])
    return Alignment(data["mode"], rotation, tuple(data["translation"]), tuple(data["tool"]))


def _run(run: Run, place: Place) -> dict[str, Any]:
    return {
        "place": flat(place),
        "name": run.name,
        "tsp": run.tsp,
        "robot": robot_data(run.robot),
        "audit": [flat(one) for one in run.audit],
        "warnings": [flat(one) for one in run.warnings],
        "provenance": provenance_data(run.provenance),
        "log": _log(run.log),
        **_solved(run, place),
    }


def _solved(run: Run, place: Place) -> dict[str, Any]:
    """Return what solved joint values have beside those of a log; nothing of a log."""
    if run.goals is None and not run.ghosts:
        return {}
    keys = zip(run.ghosts, branch_keys(run), strict=True)
    reasons = run.goals.reasons if run.goals else ()
    chosen = groupby(run.goals.branches if run.goals else ())
    return {
        "ghosts": [{"name": ghost.name, "entity": f"{branch_entity(place, key)}/q"} for ghost, key in keys],
        "missed": {row: reason for row, reason in enumerate(reasons, start=1) if reason},
        "chosen": [[name, sum(1 for _ in rows)] for name, rows in chosen],
    }


def chosen_branches(told: Iterable[tuple[str, int]]) -> tuple[str, ...]:
    """Return what the solution chosen is called, one a row, from the names and how many rows each lasts."""
    return tuple(name for name, rows in told for _ in range(rows))


def _log(log: JointLog) -> dict[str, Any]:
    return {
        "name": log.name,
        "source": log.source,
        "files": [flat(one) for one in log.files],
        "joints": list(log.joints),
        "clock_start_ns": log.clock_start_ns,
        "first_line": log.first_line,
        "rotation_form": log.rotation_form,
        "columns": [flat(one) for one in log.columns],
        "digits": log.digits,
        "inferences": [flat(one) for one in log.inferences],
        "warnings": [flat(one) for one in log.warnings],
        "timed": log.timed,
    }


def _comparison(result: Comparison, standing: list[Place]) -> dict[str, Any]:
    return {
        "name": result.name,
        "reference": _reference(result.reference),
        "runs": [_deviation(one, place) for one, place in zip(result.runs, standing, strict=True)],
        "tolerance": dict(result.tolerance),
        "warnings": [flat(one) for one in result.warnings],
        "provenance": provenance_data(result.provenance),
        "baseline": baseline_data(result.baseline),
    }


def _reference(reference: Trajectory) -> dict[str, Any]:
    return {
        "name": reference.name,
        "files": [flat(one) for one in reference.files],
        "joints": list(reference.joints),
        "joint_units": list(reference.joint_units),
    }


def _deviation(one: Deviation, place: Place) -> dict[str, Any]:
    return {
        "name": one.name,
        "joint_turns": list(one.joint_turns),
        "sync": flat(one.sync),
        "alignment": flat(one.alignment),
        "left_out": one.left_out,
        "reference_left_out": one.reference_left_out,
        "statistics": {name: flat(values) for name, values in one.statistics.items()},
        "joint_statistics": {name: flat(values) for name, values in one.joint_statistics.items()},
        "start": list(one.start),
        "speed_correlation": one.speed_correlation,
        "verdict": one.verdict,
        "run": _run(one.run, place),
    }


def provenance_data(provenance: Provenance) -> dict[str, Any]:
    """Return a provenance as JSON has it."""
    return {
        "command": provenance.command,
        "options": dict(provenance.options),
        "inputs": [flat(one) for one in provenance.inputs],
        "versions": dict(provenance.versions),
        "created": provenance.created,
    }


def robot_data(robot: Chain | None) -> dict[str, Any] | None:
    """Return an arm as JSON has it; None without one."""
    if robot is None:
        return None
    from urmpipe_models.robots.robot_file import chain_to_dict

    return chain_to_dict(robot)


def robot_from(data: Mapping[str, Any] | None) -> Chain | None:
    """Return the arm that a JSON object tells of; None without one."""
    if data is None:
        return None
    from urmpipe_models.robots.robot_file import chain_from_dict

    return chain_from_dict(data)


def files_from(data: list[dict[str, Any]]) -> tuple[SourceFile, ...]:
    """Return the input files that a JSON list tells of."""
    return tuple(SourceFile(**one) for one in data)


def warnings_from(data: list[dict[str, Any]]) -> tuple[LogWarning, ...]:
    """Return the warnings that a JSON list tells of."""
    return tuple(LogWarning(**one) for one in data)


def _plain(value: Any) -> Any:
    """Return what JSON can hold of a path, a mapping or a NumPy number or array."""
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"found {type(value).__name__} in the metadata, allowed: what JSON can hold")
