"""Tables of named columns: the file as it was read, the run on its grid, the deviations of a comparison."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.errors import Finding, RecordingError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES
from urmpipe_pipeline.export.originals import originals
from urmpipe_pipeline.export.times import DATE, DAY, TIME_OF_DAY, Times, shares
from urmpipe_pipeline.joint_log import JointLog, LogColumn, LogWarning, Role
from urmpipe_pipeline.recording.entities import printable
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.sources.vocabulary import split_unit, vocabulary

Values: TypeAlias = FloatArray | IntArray | NDArray[np.str_] | Times

ATTRIBUTES: dict[Role, str] = {
    "joint": "q",
    "rate": "qd",
    "acceleration": "qdd",
    "position": "tcp_position",
    "rotation": "tcp_rotation",
}
"""Where a `JointLog` keeps the columns of a role."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column that leaves.

    Attributes:
        name: Its name, unique in the table.
        unit: Its unit; empty for counts and names.
        values: In the column's own unit, shape (n,); NaN where a sample is missing.
    """

    name: str
    unit: str
    values: Values


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """What leaves, as a table.

    Attributes:
        columns: Its columns, at least one.
        clock_ns: The file's own clock at every row in integer [ns], shape (n,); None if it has none.
        warnings: What could not leave.
    """

    columns: tuple[Column, ...]
    clock_ns: IntArray | None
    warnings: tuple[LogWarning, ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        values = self.columns[0].values
        return len(values.ns if isinstance(values, Times) else values)


def file_table(log: JointLog, *, units_told: bool = True) -> Table:
    """Return the columns of the file that were used: its names, its units, its rows, its numbers.

    Nothing is repolarized or resampled; times are those of the file's clock.

    Args:
        log: The log.
        units_told: Whether the format keeps the units beside the names; else those that the names do not
            tell are warned of.

    Raises:
        RecordingError: If the log came from no file.
    """
    if not log.columns:
        found = "found a log that was not read from a file, allowed: --rows grid"
        raise RecordingError(Finding(found, log.name))
    kept = sorted((c for c in log.columns if _kept(log, c)), key=lambda column: column.number)
    names = _names(kept)
    clock_ns = log.clock_start_ns + log.t_ns
    timed = [column.unit for column in kept if column.role == "time"]
    clock = iter(shares(_as_told(log, clock_ns, timed), timed))
    columns = [
        Column(name, column.unit, next(clock) if column.role == "time" else _numbers(log, column))
        for name, column in zip(names, kept, strict=True)
    ]
    warnings = [*_lost(log, kept), *([] if units_told else _unsaid_units(kept))]
    return Table(tuple(columns), clock_ns if timed else None, tuple(warnings))


def _as_told(log: JointLog, clock_ns: IntArray, timed: Sequence[str]) -> IntArray:
    """Return the clock as its columns tell it: a time of day that passed midnight began anew there."""
    began_anew = any(inference.what == "nights passed" for inference in log.inferences)
    return clock_ns % DAY if began_anew and timed == [TIME_OF_DAY] else clock_ns


def grid_table(run: Run) -> Table:
    """Return the run on its grid in SI, each name with its unit: t, q, q', q'', and the tool centre point.

    Of single poses the row stands for t, and there is nothing per second: no motion joins them.
    """
    moves = run.timed
    columns = [Column("t [s]", "s", Times(run.t_ns, "s"))]
    if not moves:
        columns = [Column("row", "", np.arange(1, len(run.t_ns) + 1))]
    units = run.joint_units
    joints = [printable(name) for name in run.log.joints]
    orders = (("", "", run.q), ("d_", "/s", run.qd), ("dd_", "/s2", run.qdd))
    for prefix, order, values in orders[: 3 if moves else 1]:
        names = [prefix + name for name in joints]
        columns += _group(names, [unit + order for unit in units], values)
    if run.tcp is not None:
        points = (
            ("p", "m", run.tcp.position), ("v", "m/s", run.tcp.velocity), ("a", "m/s2", run.tcp.acceleration),
        )  # fmt: skip
        for name, unit, values in points[: 3 if moves else 1]:
            columns += _group([name + axis for axis in AXES[:3]], [unit] * 3, values)
        columns += _group(["rz", "ry", "rx"], ["rad"] * 3, run.tcp.euler_zyx)
    if run.tcp_recorded is not None:
        columns += _group([f"recorded_tcp_{axis}" for axis in AXES[:3]], ["m"] * 3, run.tcp_recorded)
    if run.rotation_recorded is not None:
        unit = "rad" if len(run.rotation_names) == 3 else "1"
        names = [f"recorded_{name}" for name in run.rotation_names]
        columns += _group(names, [unit] * len(names), run.rotation_recorded)
    return Table(tuple(columns), run.log.clock_start_ns + run.t_ns if moves else None)


def delta_table(comparison: Comparison) -> Table:
    """Return the compared samples of all logs, one below the other: deviation, reference and actual in SI."""
    runs = comparison.runs
    names = np.repeat([printable(run.name) for run in runs], [len(run.sample) for run in runs])
    columns = [
        Column("run", "", names),
        Column("sample", "", np.concatenate([run.sample for run in runs])),
        Column("t [s]", "s", Times(np.concatenate([run.t_ns for run in runs]), "s")),
    ]
    for what, axes in (("delta", AXES), ("reference", AXES[:3]), ("actual", AXES[:3])):
        values = np.concatenate([getattr(run, what) for run in runs])
        columns += _group([f"{what}_{axis}" for axis in axes], ["m"] * len(axes), values)
    outside = np.concatenate([run.outside for run in runs]).astype(np.int64)
    columns.append(Column("out_of_tolerance", "", outside))
    clock = np.concatenate([run.run.log.clock_start_ns + run.t_ns for run in runs])
    return Table(tuple(columns), clock)


def simulation_table(simulation: Simulation) -> Table:
    """Return every signal of a simulation, a column a scalar: t, then `block.variable` with its unit."""
    columns = [Column("t [s]", "s", Times(simulation.t_ns, "s"))]
    for one in simulation.signals:
        unit = printable(one.unit)
        columns += [
            Column(
                f"{printable(name)} [{unit}]" if unit else printable(name), unit, np.ascontiguousarray(values)
            )
            for name, values in zip(one.names, one.columns.T, strict=True)
        ]
    return Table(tuple(columns), simulation.t_ns)


def _group(names: Sequence[str], units: Sequence[str], values: FloatArray) -> list[Column]:
    """Return a column for each column of an array, its unit behind its name."""
    return [
        Column(f"{name} [{unit}]", unit, values[:, k])
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
    ]


def _kept(log: JointLog, column: LogColumn) -> bool:
    """Tell whether the log holds the values of a column: a recorded group with an empty column is dropped."""
    return column.role == "time" or getattr(log, ATTRIBUTES[column.role]) is not None


def _numbers(log: JointLog, column: LogColumn) -> FloatArray:
    values: FloatArray = getattr(log, ATTRIBUTES[column.role])
    return originals(np.ascontiguousarray(values[:, column.index]), column)


def _names(columns: Sequence[LogColumn]) -> list[str]:
    """Return the headers as the file has them; where it has none, or several files share one, other names."""
    count = Counter(column.header for column in columns)
    return [
        column.header if column.header and count[column.header] == 1 else _own_name(column)
        for column in columns
    ]


def _own_name(column: LogColumn) -> str:
    """Return our name of a column with its unit; without a header a clock has only its place for a name."""
    name = "t" if column.role == "time" and not column.header else printable(column.name)
    return f"{name} [{column.unit}]"


def _lost(log: JointLog, kept: Sequence[LogColumn]) -> Iterator[LogWarning]:
    """Yield what of the file is not in the recording."""
    empty = [column.name for column in log.columns if column not in kept]
    if empty:
        yield LogWarning(
            "not-exported", f"{', '.join(empty)}: not ingested, since a column of them was empty"
        )
    for inference in log.inferences:
        if inference.what == "columns not used":
            said = f"{inference.value}: not ingested ({inference.evidence}), so they cannot leave"
            yield LogWarning("not-exported", said)
    for warning in log.warnings:
        if warning.kind == "clock-rebuilt":
            said = f"the file's own times, which were not kept: {warning.message}"
            yield LogWarning("not-exported", said, warning.row)
        elif warning.kind in ("skipped-row", "other-lines"):
            yield LogWarning("not-exported", warning.message, warning.row)
    form = next((one for one in log.inferences if one.what == "form of the time"), None)
    if form and "without a time zone" not in form.evidence and any(one.unit == DATE for one in kept):
        yield LogWarning("clock-in-utc", f"{form.value} with a time zone: the dates leave in UTC")


def _unsaid_units(columns: Sequence[LogColumn]) -> list[LogWarning]:
    """Return a warning for each unit that is not of SI and that the names of its columns do not tell."""
    unsaid: dict[str, list[str]] = {}
    for column in columns:
        told = not column.header or vocabulary().unit(split_unit(column.header)[1] or "")
        if column.role != "time" and column.factor != 1.0 and not told:
            unsaid.setdefault(column.unit, []).append(column.name)
    return [
        LogWarning("unit-not-in-name", f"{', '.join(names)}: in {unit}, which their names do not tell")
        for unit, names in unsaid.items()
    ]
