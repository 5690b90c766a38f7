"""Tables of a comparison, for display and for export.

1. `ranking_tables`, `statistics_tables`: the logs from best to worst, and the statistics of each.
2. `comparison_lines`, `statistics_rows`: its lines among those of other results, and what --csv writes.
3. `exports`: the compared samples and both trajectories of all logs, and the criteria after ISO 9283.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, RecordingError
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import format_alignment
from urmpipe_pipeline.comparison.baseline import count_quantities
from urmpipe_pipeline.comparison.comparison import ROW, Comparison
from urmpipe_pipeline.comparison.deviation import AXES, Deviation, Share, ShareKind, Statistics
from urmpipe_pipeline.comparison.verdict import absolute_symbol, symbol
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.iso9283.tables import COLUMNS
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.exports import ExportColumn, Exports, ExportTable, Poses, Rows, Times
from urmpipe_pipeline.presentation.exports import columns_of as export_columns
from urmpipe_pipeline.presentation.palette import run_colour
from urmpipe_pipeline.presentation.parts import Heads, columns_of, minute_of, rows_table
from urmpipe_pipeline.presentation.section import Cell, Column, Judged, Place, Ref, Table, Value
from urmpipe_pipeline.runs.exports import clock_stamps, export_metadata
from urmpipe_pipeline.text import drop_surrogates
from urmpipe_pipeline.trajectories import joint_order

# What a share is of.
MEANING = {"coverage": "of the reference, shown by the log", "judged": "of the log's motion, judged"}
# The subjects of the kinds of deviation.
ABOUT = {"axis": "position", "norm": "position", "path": "path", "angle": "orientation", "joint": "joints"}


def ranking_tables(comparison: Comparison) -> tuple[Table, ...]:
    """Return the deviations of the logs, best first, and when, where and how compared; empty for one log."""
    if len(comparison.runs) < 2:
        return ()
    names: Heads[Deviation] = {"run": ("Log", lambda deviation: reference_of(comparison, deviation))}
    far: Heads[Deviation] = {
        **names,
        "verdict": ("Verdict", lambda deviation: Judged(deviation.verdict)),
        "decided_by": ("Decided by", lambda deviation: absolute_symbol(deviation.decisive)),
        **_sizes(comparison),
    }
    note = "The logs are ranked by the largest share of a tolerance that each uses."
    left_out = "Not compared: samples of the log without a counterpart or without a value."
    partly = {share.quantity for deviation in comparison.runs for share in deviation.incomplete_shares}
    note += "".join(f" {name.capitalize()}: share {MEANING[name]}." for name in MEANING if name in partly)
    hidden = set(MEANING) - partly
    columns = (
        replace(
            column,
            brief=column.key not in hidden,
            page=column.key not in hidden and _is_on_page(comparison, column.key),
        )
        for column in columns_of(comparison.ranking, far)
    )
    return (
        Table(
            "Largest deviations, from best to worst",
            tuple(columns),
            note,
            page_title="Largest deviations, from worst to best",
        ),
        Table("When, where and how compared", tuple(_conditions(comparison, names)), left_out, page=False),
    )


def _is_on_page(comparison: Comparison, key: str) -> bool:
    """Return whether a page shows a column of the largest deviations here, not in the logs' statistics.

    Where joints of a unit are compared, the statistics have the largest values of all in that unit.
    """
    joints = {
        statistics.unit for deviation in comparison.runs for statistics in deviation.joint_statistics.values()
    }
    if key in ("max_angle", "max_joint", "max_slide"):
        return "rad" not in joints and key == "max_angle"
    return not (key.startswith("max_") and "m" in joints)


def reference_of(comparison: Comparison, deviation: Deviation) -> Ref:
    """Return the name of a log, as a reference to its section, in its colour."""
    return Ref(deviation.name, run_colour(comparison.runs.index(deviation)))


def _sizes(comparison: Comparison) -> Heads[Deviation]:
    """Return the columns of the largest deviations, and of the fractions out of tolerance and seen."""

    def seen(quantity: ShareKind) -> Callable[[Deviation], Cell]:
        return lambda deviation: share_value(deviation.shares.get(quantity))

    return {
        "max_x": ("max |Δx|", lambda deviation: max_value(deviation.statistics.get("x"))),
        "max_y": ("max |Δy|", lambda deviation: max_value(deviation.statistics.get("y"))),
        "max_z": ("max |Δz|", lambda deviation: max_value(deviation.statistics.get("z"))),
        "max_norm": ("max ‖Δ‖", lambda deviation: max_value(deviation.statistics.get("norm"))),
        "max_path": ("max path", lambda deviation: max_value(deviation.statistics.get("path"))),
        "max_angle": ("max angle", lambda deviation: max_value(deviation.statistics.get("angle"))),
        "max_joint": ("max joint", lambda deviation: max_value(deviation.worst_joint("rad"))),
        "max_slide": ("max slide", lambda deviation: max_value(deviation.worst_joint("m"))),
        "out_fraction": ("out", lambda deviation: Value(deviation.out_fraction, "%")),
        "coverage": ("coverage", seen("coverage")),
        "judged": ("judged", seen("judged")),
    }


def _conditions(comparison: Comparison, names: Heads[Deviation]) -> Iterator[Column]:
    """Yield the columns of the time and place of the worst sample of each log, and how it was compared."""
    runs = comparison.ranking
    heads: Heads[Deviation] = {
        **names,
        "t": ("decided at t", lambda deviation: Value(_decided_t(deviation), "s")),
        "place": ("position of the log then", _decided_place),
        "longest_out_interval": (
            "longest out of tolerance",
            lambda deviation: _longest_out(deviation, "duration"),
        ),
        "longest_out_interval_t": ("from t", lambda deviation: _longest_out(deviation, "t")),
        "sync_offset": ("offset", lambda deviation: Value(deviation.sync.offset, "s", signed=True)),
        "speed_correlation": (
            "r(‖Δ‖, speed)",
            lambda deviation: Value(deviation.speed_correlation, "1", signed=True),
        ),
        "left_out": ("not compared", lambda deviation: Value(deviation.left_out)),
        "warnings": ("warnings", lambda deviation: Value(len(comparison.warnings_of(deviation)))),
        "alignment": ("alignment", lambda deviation: format_alignment(deviation)[0]),
    }
    if not all(deviation.run.timed for deviation in runs):
        row = ("decided in row", lambda deviation: Value(_decided_row(deviation)))
        heads = {
            **names,
            "t": row,
            **{key: heads[key] for key in ("place", "left_out", "warnings", "alignment")},
        }
    brief = {"run", "t", "longest_out_interval", "longest_out_interval_t", "speed_correlation"}
    brief |= {"sync_offset"} if any(deviation.sync.offset for deviation in runs) else set()
    brief |= {"left_out"} if any(deviation.left_out for deviation in runs) else set()
    for column in columns_of(runs, heads):
        yield replace(column, brief=column.key in brief)


def _decided_t(deviation: Deviation) -> float | None:
    """Return the time in [s] that decided the verdict: of a share when its longest unseen part starts."""
    decisive = deviation.decisive
    if isinstance(decisive, Statistics):
        return decisive.t_max
    return decisive.longest_unseen.t if decisive.longest_unseen else None


def _decided_place(deviation: Deviation) -> Place | None:
    worst = deviation.worst_statistics
    return max_place(deviation, worst) if deviation.decisive is worst else None


def _decided_row(deviation: Deviation) -> int | None:
    """Return the row, from 1, that decided the verdict: of a share the first of its longest unseen rows."""
    decisive = deviation.decisive
    if isinstance(decisive, Statistics):
        return deviation.row(decisive)
    return decisive.longest_unseen.sample + 1 if decisive.longest_unseen else None


def _longest_out(deviation: Deviation, name: str) -> Value | None:
    longest = deviation.longest_out_interval
    return None if longest is None else Value(getattr(longest, name), "s")


def comparison_lines(comparison: Comparison) -> Iterator[dict[str, Cell]]:
    """Yield the lines of a comparison among several: one per log, from best to worst."""
    lost: list[str] = []
    if comparison.baseline:
        lost += [change.run for change in comparison.baseline.worse]
        lost += [quantity.run for quantity in comparison.baseline.missing]
    for deviation in comparison.ranking:
        worse = lost.count(deviation.name)
        yield {
            "Log": reference_of(comparison, deviation),
            "Recording": comparison.recording.name if comparison.recording else "",
            "Robot": deviation.run.robot.name if deviation.run.robot else "",
            "Verdict": Judged(deviation.verdict),
            "Worse than its baseline": f"in {count_quantities(worse)}" if worse else "",
            **{title: cell(deviation) for title, cell in _sizes(comparison).values()},
            "Reference": comparison.reference.name,
            "Assuming": "; ".join(comparison.assumptions),
            "Made [UTC]": minute_of(comparison.provenance.created),
        }


def statistics_tables(deviation: Deviation, *, ranked: bool = False) -> Iterator[Table]:
    """Yield the statistics of every quantity of a log: those in m, then those in rad, then the shares.

    Args:
        deviation: The log.
        ranked: Whether a table of all logs has their largest deviations.
    """
    starts = dict(
        zip(map(id, deviation.all_statistics), (float(values[0]) for values in deviation.values), strict=True)
    )
    for unit in text.SHOWN:
        same_unit = [statistics for statistics in deviation.all_statistics if statistics.unit == unit]
        if same_unit:
            about = text.join_list(list(dict.fromkeys(ABOUT[statistics.kind] for statistics in same_unit)))
            start = (
                f"t = {text.format_seconds(float(deviation.t_ns[0]) / 1e9)} s"
                if deviation.run.timed
                else "the first row"
            )
            note = (
                "max, rms and p95 are of absolute values, mean and std signed. At start: the difference of"
                f" the start poses (mutual calibration) at {start}."
            )
            known = {"tolerance"} | (
                {"max"} if ranked and all(statistics.kind != "joint" for statistics in same_unit) else set()
            )
            columns = (
                replace(column, page=column.key not in known)
                for column in _statistics(deviation, same_unit, starts)
            )
            yield Table(f"Statistics of {about}", tuple(columns), note)
    if deviation.shares:
        note = " ".join(f"{name.capitalize()}: share {MEANING[name]}." for name in deviation.shares)
        yield Table("How much was judged", _shares(deviation), note, brief=False)


def _shares(deviation: Deviation) -> tuple[Column, ...]:
    """Return the columns of the shares of a log."""

    def unseen(name: str, unit: str = "") -> Callable[[Share], Cell]:
        return lambda share: (
            None if share.longest_unseen is None else Value(getattr(share.longest_unseen, name), unit)
        )

    heads: Heads[Share] = {
        "quantity": ("Quantity", lambda share: share.quantity),
        "verdict": ("Verdict", lambda share: Judged(share.verdict)),
        "tolerance": ("at least", lambda share: Value(share.tolerance, "%", given=True)),
        "value": ("share", share_value),
        "samples": ("samples", lambda share: Value(share.samples)),
        "total": ("total", lambda share: Value(share.total)),
        "unseen_t": ("longest part not compared from t", unseen("t", "s")),
        "longest_unseen": ("not compared for", unseen("duration", "s")),
        "unseen_samples": ("samples not compared", unseen("samples")),
    }
    return columns_of(list(deviation.shares.values()), heads)


def _statistics(
    deviation: Deviation, same_unit: list[Statistics], starts: Mapping[int, float]
) -> tuple[Column, ...]:
    """Return the columns of the statistics of some quantities in one unit."""
    worst_joint = deviation.worst_joint(same_unit[0].unit)

    def number(key: str) -> tuple[str, Callable[[Statistics], Cell]]:
        return key, lambda statistics: Value(getattr(statistics, key), statistics.unit)

    heads: Heads[Statistics] = {
        "quantity": ("Quantity", symbol),
        "verdict": ("Verdict", lambda statistics: Judged(statistics.verdict)),
        "tolerance": (
            "tolerance",
            lambda statistics: Value(statistics.tolerance, statistics.unit, given=True),
        ),
        "max": (
            "max",
            lambda statistics: max_value(statistics, most=statistics is worst_joint and statistics.max > 0.0),
        ),
        "t_max": ("at t", lambda statistics: Value(statistics.t_max, "s"))
        if deviation.run.timed
        else ("in row", lambda statistics: Value(deviation.row(statistics))),
        **{key: number(key) for key in ("rms", "p95", "mean", "std")},
        "start": ("at start", lambda statistics: Value(starts[id(statistics)], statistics.unit)),
        "out_of_tolerance": ("samples out", lambda statistics: Value(statistics.out_of_tolerance)),
        "out_fraction": ("out", lambda statistics: Value(statistics.out_fraction, "%")),
        "missing": ("no value", lambda statistics: Value(statistics.missing or None)),
    }
    return columns_of(same_unit, heads)


def statistics_rows(comparison: Comparison) -> Table:
    """Return what --csv writes: one row per log and quantity, in [m], [rad] and [s]."""
    return rows_table("Statistics", ROW, comparison.rows())


def max_place(deviation: Deviation, statistics: Statistics) -> Place | None:
    """Return the position of a log at the largest value of a quantity; None if joints alone are compared."""
    place = deviation.place(statistics)
    return None if place is None else Place(place)


def max_value(statistics: Statistics | None, *, most: bool = False) -> Value | None:
    """Return the largest absolute value of a quantity, with its tolerance; None without a quantity."""
    if statistics is None:
        return None
    value, used = statistics.max, statistics.utilisation
    return Value(value, statistics.unit, statistics.tolerance, statistics.verdict, used, most=most)


def share_value(share: Share | None) -> Value | None:
    """Return a share with its least value; None without a share."""
    if share is None:
        return None
    used = math.inf if share.verdict == "fail" else share.utilisation
    return Value(share.value, "%", share.tolerance, share.verdict, used, least=True)


NO_ORIENTATION = LogWarning(
    "no-orientation",
    "a comparison holds positions: every orientation is written as 0 0 0 1, compare translations only",
)


def exports(comparison: Comparison) -> Exports:
    """Return the exports of a comparison: its samples, its criteria and its poses."""
    about = export_metadata(comparison.name, comparison.provenance) | {
        "reference": comparison.reference.name,
        "tolerance": dict(comparison.tolerance),
        "verdict": comparison.verdict,
        "runs": [run.name for run in comparison.runs],
    }
    rows = {"compared": Rows(partial(delta_table, comparison), lambda table: _fields(comparison))}
    if comparison.iso is not None:
        rows["criteria"] = Rows(partial(criteria_table, comparison.iso), partial(_criteria, comparison))
    poses = {"": lambda rows: _poses(comparison)}
    return Exports("comparison", about, rows, poses, {}, (NO_ORIENTATION,))


def delta_table(comparison: Comparison) -> ExportTable:
    """Return the compared samples of all logs, one below the other: deviation, reference and actual in SI.

    Where joints alone are compared, their deviations, under the names that the reference has for them.
    """
    runs = comparison.runs
    names = np.repeat([drop_surrogates(run.name) for run in runs], [len(run.sample) for run in runs])
    columns = [
        ExportColumn("run", "", names),
        ExportColumn("sample", "", np.concatenate([run.sample for run in runs])),
    ]
    timed = all(run.run.timed for run in runs)
    if timed:
        columns.append(ExportColumn("t [s]", "s", Times(np.concatenate([run.t_ns for run in runs]), "s")))
    placed = all(run.statistics for run in runs)
    if not placed:
        joints, units = comparison.reference.joints, comparison.reference.joint_units
        values = np.concatenate([_joint_delta(comparison, run) for run in runs])
        columns += export_columns([f"delta_{name}" for name in joints], units, values)
    for what, axes in (("delta", AXES), ("reference", AXES[:3]), ("actual", AXES[:3])) if placed else ():
        values = np.concatenate([getattr(run, what) for run in runs])
        columns += export_columns([f"{what}_{axis}" for axis in axes], ["m"] * len(axes), values)
    outside = np.concatenate([run.out_of_tolerance for run in runs]).astype(np.int64)
    columns.append(ExportColumn("out_of_tolerance", "", outside))
    clock = np.concatenate([run.run.log.clock_start_ns + run.t_ns for run in runs])
    return ExportTable(tuple(columns), clock if timed else None)


def criteria_table(test: IsoTest) -> ExportTable:
    """Return one row per criterion and place of a test after ISO 9283, then per failed cycle, in SI.

    A missing value is NaN or empty. Each row has its own unit: 1 of a share.
    """
    rows = list(test.rows())
    texts = {
        name: np.array([str(row[name] or "") for row in rows]) for name in ("name", "at", "unit", "verdict")
    }
    numbers = {
        name: np.array([math.nan if row[name] is None else row[name] for row in rows])
        for name in ("value", "tolerance")
    }
    every = texts | numbers | {"cycles": np.array([row["cycles"] for row in rows])}
    columns = (ExportColumn(name, "", every[name]) for name in COLUMNS)
    return ExportTable(tuple(columns), None)


def _criteria(comparison: Comparison, table: ExportTable) -> dict[str, Any]:
    """Return the fields of a table of criteria: its texts as cells, its numbers as arrays."""
    columns = {column.name: np.asarray(column.values) for column in table.columns}
    return {
        "comparison": drop_surrogates(comparison.name),
        "reference": drop_surrogates(comparison.reference.name),
        **{name: values.tolist() if values.dtype.kind == "U" else values for name, values in columns.items()},
    }


def _joint_delta(comparison: Comparison, run: Deviation) -> FloatArray:
    """Return a log's deviations in the order of the reference's joints [rad] or [m], shape (m, joints)."""
    order = joint_order(comparison.reference.joints, run.run.log.joints) or ()
    return np.column_stack(run.values)[:, np.argsort(order)]


def _fields(comparison: Comparison) -> dict[str, Any]:
    """Return the fields of a comparison in SI, with one struct per log in the cell `runs`."""
    return {
        "name": drop_surrogates(comparison.name),
        "reference": drop_surrogates(comparison.reference.name),
        "verdict": comparison.verdict,
        "tolerance": dict(comparison.tolerance),
        "runs": [_deviation(comparison, run) for run in comparison.runs],
    }


def _deviation(comparison: Comparison, run: Deviation) -> dict[str, Any]:
    """Return the fields of a log; where joints alone are compared, their names and deviations."""
    timed, nothing = run.run.timed, np.empty((0, 0))
    joints = [*map(drop_surrogates, comparison.reference.joints)]
    placed = {"delta": run.delta, "reference": run.reference, "actual": run.actual}
    return {
        "name": drop_surrogates(run.name),
        "verdict": run.verdict,
        "sample": run.sample,
        "t": run.t if timed else nothing,
        "clock_ns": run.run.log.clock_start_ns + run.t_ns if timed else nothing,
        **(placed if run.statistics else {"joints": joints, "delta": _joint_delta(comparison, run)}),
        "out_of_tolerance": run.out_of_tolerance,
    }


def _poses(comparison: Comparison) -> list[Poses]:
    """Return the reference and the log at the compared samples of each log, both on the log's clock.

    Raises:
        RecordingError: If joints alone are compared.
    """
    if not comparison.worst.statistics:
        where = str(comparison.recording or comparison.name)
        raise RecordingError(Finding("a comparison of joints alone, so no pose", where))
    poses = []
    for deviation in comparison.runs:
        clock = clock_stamps(deviation.run, deviation.t_ns)
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(clock), 1))
        prefix = "" if len(comparison.runs) == 1 else f"{deviation.name}-"
        poses.append(Poses(f"{prefix}reference", clock, deviation.reference, upright))
        poses.append(Poses(f"{prefix}actual", clock, deviation.actual, upright))
    return poses
