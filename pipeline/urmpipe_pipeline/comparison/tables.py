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

MEANING = {"coverage": "of the reference, shown by the log", "judged": "of the log's motion, judged"}
"""What a share is of."""

ABOUT = {"axis": "position", "norm": "position", "path": "path", "angle": "orientation", "joint": "joints"}
"""What the kinds of deviation are about."""


def ranking_tables(result: Comparison) -> tuple[Table, ...]:
    """Return the logs from best to worst: how far off, then when, where and how compared; none of one log."""
    if len(result.runs) < 2:
        return ()
    names: Heads[Deviation] = {"run": ("Log", lambda one: reference_of(result, one))}
    far: Heads[Deviation] = {
        **names,
        "verdict": ("Verdict", lambda one: Judged(one.verdict)),
        "decided_by": ("Decided by", lambda one: absolute_symbol(one.decisive)),
        **_sizes(result),
    }
    note = "The logs are ranked by the largest share of a tolerance that each uses."
    left_out = "Left out: samples of the log without a counterpart or without a value."
    partly = {share.quantity for one in result.runs for share in one.incomplete_shares}
    note += "".join(f" {name.capitalize()}: share {MEANING[name]}." for name in MEANING if name in partly)
    hidden = set(MEANING) - partly
    columns = (
        replace(one, brief=one.key not in hidden, page=one.key not in hidden and _leads(result, one.key))
        for one in columns_of(result.ranking, far)
    )
    return (
        Table(
            "Largest deviations, from best to worst",
            tuple(columns),
            note,
            page_title="Largest deviations, from worst to best",
        ),
        Table("When, where and how compared", tuple(_conditions(result, names)), left_out, page=False),
    )


def _leads(result: Comparison, key: str) -> bool:
    """Tell whether a page shows a column of the largest deviations here, not in the statistics of each log.

    Where joints of a unit are compared, the statistics have the largest values of all in that unit.
    """
    joints = {held.unit for one in result.runs for held in one.joint_statistics.values()}
    if key in ("max_angle", "max_joint", "max_slide"):
        return "rad" not in joints and key == "max_angle"
    return not (key.startswith("max_") and "m" in joints)


def reference_of(result: Comparison, one: Deviation) -> Ref:
    """Return the name of a log, as a reference to its section, in its colour."""
    return Ref(one.name, run_colour(result.runs.index(one)))


def _sizes(result: Comparison) -> Heads[Deviation]:
    """Return the columns of the largest deviations, and of how much was out and seen."""

    def seen(quantity: ShareKind) -> Callable[[Deviation], Cell]:
        return lambda one: share_value(one.shares.get(quantity))

    return {
        "max_x": ("max |Δx|", lambda one: max_value(one.statistics.get("x"))),
        "max_y": ("max |Δy|", lambda one: max_value(one.statistics.get("y"))),
        "max_z": ("max |Δz|", lambda one: max_value(one.statistics.get("z"))),
        "max_norm": ("max ‖Δ‖", lambda one: max_value(one.statistics.get("norm"))),
        "max_path": ("max path", lambda one: max_value(one.statistics.get("path"))),
        "max_angle": ("max angle", lambda one: max_value(one.statistics.get("angle"))),
        "max_joint": ("max joint", lambda one: max_value(one.worst_joint("rad"))),
        "max_slide": ("max slide", lambda one: max_value(one.worst_joint("m"))),
        "out_fraction": ("out", lambda one: Value(one.out_fraction, "%")),
        "coverage": ("coverage", seen("coverage")),
        "judged": ("judged", seen("judged")),
    }


def _conditions(result: Comparison, names: Heads[Deviation]) -> Iterator[Column]:
    """Yield the columns of when and where each log is worst, and how it was compared."""
    runs = result.ranking
    heads: Heads[Deviation] = {
        **names,
        "t": ("decided at t", lambda one: Value(_decided_t(one), "s")),
        "place": ("log there at x, y, z", _decided_place),
        "longest_out_interval": ("longest out", lambda one: _stretch(one, "duration")),
        "longest_out_interval_t": ("longest out from t", lambda one: _stretch(one, "t")),
        "sync_offset": ("offset", lambda one: Value(one.sync.offset, "s", signed=True)),
        "speed_correlation": ("r(‖Δ‖, speed)", lambda one: Value(one.speed_correlation, "1", signed=True)),
        "left_out": ("left out", lambda one: Value(one.left_out)),
        "warnings": ("warnings", lambda one: Value(len(result.warnings_of(one)))),
        "alignment": ("alignment", lambda one: format_alignment(one)[0]),
    }
    if not all(one.run.timed for one in runs):
        row = ("decided in row", lambda one: Value(_decided_row(one)))
        heads = {
            **names,
            "t": row,
            **{key: heads[key] for key in ("place", "left_out", "warnings", "alignment")},
        }
    brief = {"run", "t", "longest_out_interval", "longest_out_interval_t", "speed_correlation"}
    brief |= {"sync_offset"} if any(one.sync.offset for one in runs) else set()
    brief |= {"left_out"} if any(one.left_out for one in runs) else set()
    for column in columns_of(runs, heads):
        yield replace(column, brief=column.key in brief)


def _decided_t(one: Deviation) -> float | None:
    """Return when the verdict was decided in [s]: of a share where most was unseen."""
    held = one.decisive
    return (
        held.t_max if isinstance(held, Statistics) else held.longest_unseen.t if held.longest_unseen else None
    )


def _decided_place(one: Deviation) -> Place | None:
    return max_place(one, one.worst_statistics) if one.decisive is one.worst_statistics else None


def _decided_row(one: Deviation) -> int | None:
    """Return the row, from 1, in which the verdict was decided: of a share the first of those unseen."""
    held = one.decisive
    if isinstance(held, Statistics):
        return one.row(held)
    return held.longest_unseen.sample + 1 if held.longest_unseen else None


def _stretch(one: Deviation, name: str) -> Value | None:
    longest = one.longest_out_interval
    return None if longest is None else Value(getattr(longest, name), "s")


def comparison_lines(result: Comparison) -> Iterator[dict[str, Cell]]:
    """Yield the lines of a comparison among several: one a log, from best to worst."""
    lost: list[str] = []
    if result.baseline:
        lost = [*(one.run for one in result.baseline.worse), *(one.run for one in result.baseline.missing)]
    for one in result.ranking:
        worse = lost.count(one.name)
        yield {
            "Log": reference_of(result, one),
            "Recording": result.recording.name if result.recording else "",
            "Robot": one.run.robot.name if one.run.robot else "",
            "Verdict": Judged(one.verdict),
            "Worse than its baseline": f"in {count_quantities(worse)}" if worse else "",
            **{title: cell(one) for title, cell in _sizes(result).values()},
            "Reference": result.reference.name,
            "Assuming": "; ".join(result.assumptions),
            "Made [UTC]": minute_of(result.provenance.created),
        }


def statistics_tables(one: Deviation, *, ranked: bool = False) -> Iterator[Table]:
    """Yield the statistics of every quantity of a log: those in m, then those in rad, then the shares.

    Args:
        one: The log.
        ranked: Whether a table of all logs has their largest deviations.
    """
    starts = dict(zip(map(id, one.all_statistics), (float(values[0]) for values in one.values), strict=True))
    for unit in text.SHOWN:
        own = [held for held in one.all_statistics if held.unit == unit]
        if own:
            about = text.join_list(list(dict.fromkeys(ABOUT[held.kind] for held in own)))
            start = (
                f"t = {text.format_seconds(float(one.t_ns[0]) / 1e9)} s" if one.run.timed else "the first row"
            )
            note = (
                "max, rms and p95 are of absolute values, mean and std signed. At start: the difference of"
                f" the start poses (mutual calibration) at {start}."
            )
            known = {"tolerance"} | (
                {"max"} if ranked and all(held.kind != "joint" for held in own) else set()
            )
            columns = (
                replace(column, page=column.key not in known) for column in _statistics(one, own, starts)
            )
            yield Table(f"Statistics of {about}", tuple(columns), note)
    if one.shares:
        note = " ".join(f"{name.capitalize()}: share {MEANING[name]}." for name in one.shares)
        yield Table("How much was judged", _shares(one), note, brief=False)


def _shares(one: Deviation) -> tuple[Column, ...]:
    """Return the columns of the shares of a log."""

    def unseen(name: str, unit: str = "") -> Callable[[Share], Cell]:
        return lambda held: (
            None if held.longest_unseen is None else Value(getattr(held.longest_unseen, name), unit)
        )

    heads: Heads[Share] = {
        "quantity": ("Quantity", lambda held: held.quantity),
        "verdict": ("Verdict", lambda held: Judged(held.verdict)),
        "tolerance": ("at least", lambda held: Value(held.tolerance, "%", given=True)),
        "value": ("share", share_value),
        "samples": ("samples", lambda held: Value(held.samples)),
        "total": ("total", lambda held: Value(held.total)),
        "unseen_t": ("longest unseen from t", unseen("t", "s")),
        "longest_unseen": ("unseen for", unseen("duration", "s")),
        "unseen_samples": ("unseen samples", unseen("samples")),
    }
    return columns_of(list(one.shares.values()), heads)


def _statistics(one: Deviation, own: list[Statistics], starts: Mapping[int, float]) -> tuple[Column, ...]:
    """Return the columns of the statistics of some quantities in one unit."""
    joint = one.worst_joint(own[0].unit)

    def number(key: str) -> tuple[str, Callable[[Statistics], Cell]]:
        return key, lambda held: Value(getattr(held, key), held.unit)

    heads: Heads[Statistics] = {
        "quantity": ("Quantity", symbol),
        "verdict": ("Verdict", lambda held: Judged(held.verdict)),
        "tolerance": ("tolerance", lambda held: Value(held.tolerance, held.unit, given=True)),
        "max": ("max", lambda held: max_value(held, most=held is joint and held.max > 0.0)),
        "t_max": ("at t", lambda held: Value(held.t_max, "s"))
        if one.run.timed
        else ("in row", lambda held: Value(one.row(held))),
        **{key: number(key) for key in ("rms", "p95", "mean", "std")},
        "start": ("at start", lambda held: Value(starts[id(held)], held.unit)),
        "out_of_tolerance": ("samples out", lambda held: Value(held.out_of_tolerance)),
        "out_fraction": ("out", lambda held: Value(held.out_fraction, "%")),
        "missing": ("no value", lambda held: Value(held.missing or None)),
    }
    return columns_of(own, heads)


def statistics_rows(result: Comparison) -> Table:
    """Return what --csv writes: a row a log and quantity; lengths in [m], angles in [rad], times in [s]."""
    return rows_table("Statistics", ROW, result.rows())


def max_place(one: Deviation, held: Statistics) -> Place | None:
    """Return where a log was when a quantity of it was largest; None where joints alone are compared."""
    place = one.place(held)
    return None if place is None else Place(place)


def max_value(one: Statistics | None, *, most: bool = False) -> Value | None:
    """Return the largest absolute value of a quantity, with what is allowed of it; None without one."""
    if one is None:
        return None
    return Value(one.max, one.unit, one.tolerance, one.verdict, one.utilisation, most=most)


def share_value(one: Share | None) -> Value | None:
    """Return a share with what is needed of it; None without one."""
    if one is None:
        return None
    used = math.inf if one.verdict == "fail" else one.utilisation
    return Value(one.value, "%", one.tolerance, one.verdict, used, least=True)


NO_ORIENTATION = LogWarning(
    "no-orientation",
    "a comparison holds positions: every orientation is written as 0 0 0 1, compare translations only",
)


def exports(comparison: Comparison) -> Exports:
    """Return what can leave of a comparison."""
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
    """Return a row a criterion and place of a test after ISO 9283, then a failed cycle, in SI.

    What is not there is NaN or empty. Each row has its own unit: 1 of a share.
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
    columns = {one.name: np.asarray(one.values) for one in table.columns}
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
    """Return the fields of a comparison in SI, with a struct a log in the cell `runs`."""
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
    found = []
    for one in comparison.runs:
        clock = clock_stamps(one.run, one.t_ns)
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(clock), 1))
        prefix = "" if len(comparison.runs) == 1 else f"{one.name}-"
        found.append(Poses(f"{prefix}reference", clock, one.reference, upright))
        found.append(Poses(f"{prefix}actual", clock, one.actual, upright))
    return found
