"""MATLAB's MAT (version 5), which MATLAB, Octave and SciPy load: one struct by the result's kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.export.metadata import MARK, as_json
from urmpipe_pipeline.export.tables import Table
from urmpipe_pipeline.export.times import Times
from urmpipe_pipeline.recording.entities import printable
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Simulation

DESCRIPTION = 116
"""Bytes at the start of a MAT file that are free text."""

LARGEST = 2**31 - 1
"""Bytes that a variable of version 5 may have."""


def write_mat(name: str, fields: Mapping[str, Any], path: Path, target: Path) -> list[str]:
    """Write one struct and return how the file differs from it, read back.

    Args:
        name: Name of the variable.
        fields: Its fields, with the numbers of a table in their rows.
        path: Where to write.
        target: The name it is to have, for messages.

    Raises:
        OutputError: If it is larger than the format allows.
    """
    from scipy.io import savemat

    size = _size(fields)
    if size > LARGEST:
        found = f"found {size} bytes, allowed: {LARGEST} in a MAT file of version 5; --to parquet takes all"
        raise OutputError(Finding(found, str(target)))
    savemat(path, {name: dict(fields)}, appendmat=False, oned_as="column", long_field_names=True)
    with path.open("r+b") as file:
        file.write(f"MATLAB 5.0 MAT-file, {MARK}".encode().ljust(DESCRIPTION))
    return differences(name, fields, path)


def run_fields(run: Run, about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a run on its grid, in SI: t, q, qd, qdd, p, v, a, euler_zyx, p_recorded.

    What a run does not have is empty: the point without kinematics, times and derivatives of single poses.
    """
    units = run.joint_units
    tcp = run.tcp
    nothing = np.empty((0, 0))
    moves = run.timed
    return {
        "name": printable(run.name),
        "rows": "grid",
        "t": run.t if moves else nothing,
        "clock_ns": run.log.clock_start_ns + run.t_ns if moves else nothing,
        "q": run.q,
        "qd": run.qd if moves else nothing,
        "qdd": run.qdd if moves else nothing,
        "p": nothing if tcp is None else tcp.position,
        "v": tcp.velocity if tcp is not None and moves else nothing,
        "a": tcp.acceleration if tcp is not None and moves else nothing,
        "euler_zyx": nothing if tcp is None else tcp.euler_zyx,
        "p_recorded": nothing if run.tcp_recorded is None else run.tcp_recorded,
        "joints": cells([printable(name) for name in run.log.joints]),
        "units": {
            "t": "s", "clock_ns": "ns", "q": cells(units), "qd": cells([f"{unit}/s" for unit in units]),
            "qdd": cells([f"{unit}/s2" for unit in units]), "p": "m", "v": "m/s", "a": "m/s2",
            "euler_zyx": "rad", "p_recorded": "m",
        },
        "metadata": as_json(dict(about)),
    }  # fmt: skip


def file_fields(run: Run, table: Table, about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of the file's own rows: values in its own units, their names, and the exact clock."""
    columns = [column for column in table.columns if not isinstance(column.values, Times)]
    clock = [column for column in table.columns if isinstance(column.values, Times)]
    return {
        "name": printable(run.name),
        "rows": "file",
        "t": run.log.t,
        "clock_ns": np.empty((0, 0)) if table.clock_ns is None else table.clock_ns,
        "values": np.column_stack([np.asarray(column.values) for column in columns]),
        "names": cells([column.name for column in columns]),
        "units": cells([column.unit for column in columns]),
        "clock_names": cells([column.name for column in clock]),
        "clock_units": cells([column.unit for column in clock]),
        "metadata": as_json(dict(about)),
    }


def comparison_fields(comparison: Comparison, about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a comparison in SI, with a struct a log in the cell `runs`."""
    return {
        "name": printable(comparison.name),
        "reference": printable(comparison.reference.name),
        "verdict": comparison.verdict,
        "tolerance": dict(comparison.tolerance),
        "runs": cells([_deviation(run) for run in comparison.runs]),
        "metadata": as_json(dict(about)),
    }


def simulation_fields(simulation: Simulation, table: Table, about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a simulation in the units of its signals: a column a scalar, and their names.

    The system file and why it failed stand in the metadata, in ASCII.
    """
    signals = [column for column in table.columns if not isinstance(column.values, Times)]
    values = [np.asarray(column.values) for column in signals]
    return {
        "name": printable(simulation.name),
        "t": simulation.t[:, np.newaxis],  # a vector without a row would be written as 0 x 0
        "clock_ns": simulation.t_ns[:, np.newaxis],
        "values": np.column_stack(values) if values else np.empty((len(simulation.t_ns), 0)),
        "names": cells([column.name for column in signals]),
        "units": cells([column.unit for column in signals]),
        "metadata": as_json(dict(about)),
    }


def _deviation(run: Deviation) -> dict[str, Any]:
    return {
        "name": printable(run.name),
        "verdict": run.verdict,
        "sample": run.sample,
        "t": run.t,
        "clock_ns": run.run.log.clock_start_ns + run.t_ns,
        "delta": run.delta,
        "reference": run.reference,
        "actual": run.actual,
        "out_of_tolerance": run.outside,
    }


def cells(items: Sequence[Any]) -> np.ndarray[tuple[int, int], np.dtype[np.object_]]:
    """Return items as a row of MATLAB's cells [-], shape (1, n).

    Args:
        items: n texts, numbers or structs.
    """
    row = np.empty((1, len(items)), dtype=object)
    for k, item in enumerate(items):
        row[0, k] = item
    return row


def _size(value: Any) -> int:
    """Return the bytes of all numbers below a value."""
    if isinstance(value, Mapping):
        return sum(map(_size, value.values()))
    if isinstance(value, np.ndarray) and value.dtype == object:
        return sum(map(_size, value.ravel()))
    return value.nbytes if isinstance(value, np.ndarray) else 0


def differences(name: str, fields: Mapping[str, Any], path: Path) -> list[str]:
    """Return the places of a struct that a file holds otherwise: texts, shapes, first and last rows."""
    from scipy.io import loadmat

    found = loadmat(path, appendmat=False, struct_as_record=False, variable_names=[name])
    return list(_different(name, dict(fields), found[name]))


def _different(place: str, wanted: Any, found: Any) -> Iterator[str]:
    """Yield the places that read back otherwise: structs and cells in depth, arrays by shape and ends."""
    if isinstance(wanted, dict):
        struct = found.item()
        for key, value in wanted.items():
            yield from _different(f"{place}.{key}", value, getattr(struct, key))
    elif isinstance(wanted, np.ndarray) and wanted.dtype == object:
        if wanted.shape != found.shape:
            yield place
            return
        for k, (one, other) in enumerate(zip(wanted.ravel(), found.ravel(), strict=True), start=1):
            yield from _different(f"{place}{{{k}}}", one, other)
    elif isinstance(wanted, np.ndarray):
        if not _same_ends(wanted, found):
            yield place
    elif (found.item() if found.size else "") != wanted:
        yield place


def _same_ends(wanted: Any, found: Any) -> bool:
    """Tell whether two arrays have the same shape (a vector as a column) and the same first and last row."""
    if (wanted.shape if wanted.ndim > 1 else (len(wanted), 1)) != found.shape:
        return False
    found = found.reshape(wanted.shape)
    ends = (0, -1) if len(wanted) else ()
    return all(np.array_equal(wanted[k], found[k], equal_nan=wanted.dtype.kind == "f") for k in ends)
