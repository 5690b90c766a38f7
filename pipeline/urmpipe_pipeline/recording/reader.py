"""Read a recording back: every array bit for bit, and all metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.errors import CosimulationError, RecordingError
from urmpipe_models.kinematics.forward import PointLog
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.recording import metadata
from urmpipe_pipeline.recording.entities import (
    GOAL_ARRAYS,
    GRID_ARRAYS,
    LAYOUT_VERSION,
    LAYOUTS,
    LOG_ARRAYS,
    MATCHED_ARRAYS,
    REFERENCE_ARRAYS,
    SINGULAR,
    TCP_ARRAYS,
    Place,
)
from urmpipe_pipeline.recording.signal_entities import TIMES
from urmpipe_pipeline.recording.simulation_data import simulation_fields
from urmpipe_pipeline.recording.store import Chunk, Store
from urmpipe_pipeline.runs.ghosts import Ghost, Goals
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Arm, Result, Signal, Simulation

Data: TypeAlias = Mapping[str, Any]


def read_recording(path: Path) -> Result:
    """Return the run, the comparison or the simulation that a recording holds.

    The runs inside a comparison come back without the file that they once stood in.

    Args:
        path: A recording (.rrd) that urmpipe wrote.

    Raises:
        RecordingError: If it is no recording, was cut off, is not of urmpipe, or of a newer layout.
    """
    store = Store(path)
    document = _document(store)
    try:
        arrays = _Arrays(store, document["arrays"])
        if document["kind"] == "run":
            return _run(arrays, document["result"], path)
        if document["kind"] == "simulation":
            return _simulation(arrays, document["result"], path)
        return _comparison(arrays, document["result"], path)
    except (KeyError, TypeError, ValueError, AttributeError, CosimulationError) as error:
        raise _damaged(store, error) from error


class _Arrays:
    """The arrays of a recording, each with the shape that the metadata tell."""

    def __init__(self, store: Store, shapes: Data) -> None:
        self._store = store
        self._shapes = shapes

    def chunk(self, entity: str) -> Chunk:
        """Return an array with its times."""
        rows, width = self._shapes[entity]
        chunk = self._store.read(entity, width)
        if chunk.values.shape != (rows, width):
            found = " x ".join(map(str, chunk.values.shape))
            raise self._store.error(
                f"found {found} values in {entity}, allowed: {rows} x {width}, as were written"
            )
        return chunk

    def table(self, prefix: str, places: Mapping[str, tuple[str, Any]]) -> dict[str, FloatArray | None]:
        """Return the arrays of a table of `entities` by attribute, None for those that are not there."""
        return {
            attribute: self.chunk(prefix + entity).values if prefix + entity in self._shapes else None
            for entity, (attribute, _) in places.items()
        }

    def flags(self, entity: str, sample: IntArray) -> NDArray[np.bool_]:
        """Return flags at the samples given: those that stand are true."""
        true = self.chunk(entity).numbers if entity in self._shapes else None
        return np.zeros(len(sample), np.bool_) if true is None else np.isin(sample, true)


def _run(arrays: _Arrays, data: Data, path: Path | None) -> Run:
    place = Place(**data["place"])
    rows = arrays.chunk(f"{place.prefix}joints/raw")
    grid = arrays.chunk(f"{place.prefix}joints/repolarized")
    log: dict[str, Any] = {**metadata.log_fields(data["log"]), **arrays.table(place.prefix, LOG_ARRAYS)}
    run: dict[str, Any] = {**metadata.run_fields(data), **arrays.table(place.prefix, GRID_ARRAYS)}
    tcp: dict[str, Any] = arrays.table(place.prefix, TCP_ARRAYS)
    singular = arrays.flags(place.prefix + SINGULAR, np.arange(len(grid.t_ns)))
    return Run(
        **run,
        log=JointLog(**log, t_ns=rows.t_ns),
        t_ns=grid.t_ns,
        tcp=None if tcp["position"] is None else PointLog(**tcp, singular=singular),
        recording=path,
        ghosts=tuple(_ghost(arrays, one) for one in data.get("ghosts", [])),
        goals=_goals(arrays, data, place),
    )


def _ghost(arrays: _Arrays, data: Data) -> Ghost:
    chunk = arrays.chunk(data["entity"])
    return Ghost(data["name"], chunk.t_ns, chunk.values)


def _goals(arrays: _Arrays, data: Data, place: Place) -> Goals | None:
    """Return the targets of solved joint values; None of a log."""
    found: dict[str, Any] = arrays.table(place.prefix, GOAL_ARRAYS)
    if found["position"] is None:
        return None
    t_ns = arrays.chunk(f"{place.prefix}targets/position").t_ns
    reasons = tuple(data["missed"].get(str(row), "") for row in range(1, len(t_ns) + 1))
    branches = metadata.chosen_branches(data["chosen"])
    if len(branches) not in (0, len(t_ns)):
        raise ValueError(f"{len(branches)} branches chosen of {len(t_ns)} targets")
    return Goals(t_ns, **found, reasons=reasons, branches=branches)


def _comparison(arrays: _Arrays, data: Data, path: Path) -> Comparison:
    reference: dict[str, Any] = {
        **metadata.reference_fields(data["reference"]),
        **arrays.table("/", REFERENCE_ARRAYS),
    }
    return Comparison(
        **metadata.comparison_fields(data),
        reference=Trajectory(**reference, t_ns=arrays.chunk("/reference/position").t_ns),
        runs=tuple(_deviation(arrays, one) for one in data["runs"]),
        recording=path,
    )


def _deviation(arrays: _Arrays, data: Data) -> Deviation:
    place = Place(**data["run"]["place"])
    delta = arrays.chunk(place.named("delta"))
    sample = np.empty(0, np.int64) if delta.numbers is None else delta.numbers
    matched: dict[str, Any] = arrays.table(place.named("matched") + "/", MATCHED_ARRAYS)
    for attribute, series in MATCHED_ARRAYS.values():
        if series == "number" and matched[attribute] is not None:
            matched[attribute] = matched[attribute][:, 0]
    return Deviation(
        **metadata.deviation_fields(data),
        run=_run(arrays, data["run"], None),
        sample=sample,
        t_ns=delta.t_ns,
        delta=delta.values,
        **matched,
        outside=arrays.flags(place.named("matched", "outside"), sample),
    )


def _simulation(arrays: _Arrays, data: Data, path: Path) -> Simulation:
    return Simulation(
        **simulation_fields(data),
        t_ns=arrays.chunk(TIMES).t_ns,
        signals=tuple(_signal(arrays, one) for one in data["signals"]),
        arms=tuple(_arm(arrays, one) for one in data["arms"]),
        recording=path,
    )


def _arm(arrays: _Arrays, data: Data) -> Arm:
    from urmpipe_models.robots.robot_file import chain_from_dict

    return Arm(data["block"], chain_from_dict(data["chain"]), arrays.chunk(data["entity"]).values)


def _signal(arrays: _Arrays, data: Data) -> Signal:
    """Return a signal with its values: those of a scalar have no columns."""
    told = dict(data)
    values = arrays.chunk(told.pop("entity")).values
    return Signal(**told, values=values) if told.pop("array") else Signal(**told, values=values[:, 0])


def _document(store: Store) -> dict[str, Any]:
    """Return the metadata, of a layout that is known."""
    try:
        document: dict[str, Any] = json.loads(store.metadata)
        version = document["layout_version"]
        kind = document.get("kind", "")
        newest, oldest = LAYOUTS.get(kind, max(LAYOUTS.values())), LAYOUTS.get(kind, LAYOUT_VERSION)
        newer, older = version > newest, version < oldest
    except (ValueError, KeyError, TypeError) as error:
        raise _damaged(store, error) from error
    if newer:
        raise store.error(
            f"found layout version {version}, allowed: up to {newest}; a newer urmpipe wrote it"
        )
    if older:
        raise store.error(
            f"found layout version {version}, allowed: {oldest}; an older urmpipe wrote it:"
            " make it again from its log"
        )
    return document


def _damaged(store: Store, error: Exception) -> RecordingError:
    return store.error(f"found damaged metadata ({error!r}), allowed: what urmpipe wrote")
