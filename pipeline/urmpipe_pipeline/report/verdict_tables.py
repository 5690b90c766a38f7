"""The tables of a comparison: the logs from best to worst, and the statistics of every quantity of a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES, Deviation, Statistics
from urmpipe_pipeline.comparison.symbols import SYMBOLS, size_of, symbol
from urmpipe_pipeline.report.facts import alignment_value, made, speed_correlation
from urmpipe_pipeline.report.tables import (
    Cell,
    Column,
    Table,
    judged,
    numbers,
    without_empty_columns,
    words,
)

ABOUT = {"axis": "position", "norm": "position", "path": "path", "angle": "orientation", "joint": "joints"}
"""What the kinds of deviation are about."""


def ranking_tables(comparison: Comparison, links: Sequence[str]) -> tuple[Table, ...]:
    """Return one line a log, best to worst: how far off it is; when, where and under which conditions.

    Args:
        comparison: Some logs.
        links: Where each is told of, best to worst.
    """
    return (
        _how_far(comparison, links),
        _when_and_where(comparison, links),
    )


def side_by_side(comparisons: Sequence[Comparison], links: Sequence[Sequence[str]]) -> Table:
    """Return one line a log of each comparison, those of one name below each other, in the order given.

    Args:
        comparisons: Some comparisons, perhaps of one log each month.
        links: Where each log of each is told of, best to worst.
    """
    columns: tuple[Column, ...] = (
        *words("Log", "Recording", "Made", "Reference", "Verdict", "Worse than its baseline"),
        *numbers(*(f"max |{SYMBOLS[axis]}| [mm]" for axis in "xyz"), "max ‖Δ‖ [mm]", "max path [mm]"),
        *numbers("max angle [deg]", "max joint [deg]", "max joint [mm]", "Share out", "Covered"),
    )
    lines = [
        (run.name, _beside(comparison, run, link))
        for comparison, some in zip(comparisons, links, strict=True)
        for run, link in zip(comparison.ranking, some, strict=True)
    ]
    first = list(dict.fromkeys(name for name, _ in lines))
    lines.sort(key=lambda line: first.index(line[0]))
    note = "The bars show how much of a tolerance is used up: each comparison has its own."
    table = Table("Largest deviations", columns, tuple(row for _, row in lines), note=note)
    return without_empty_columns(table)


def _beside(comparison: Comparison, run: Deviation, link: str) -> tuple[Cell, ...]:
    name, verdict, _, *sizes = _how_far_row(run, link, comparison.covered(run))
    baseline = comparison.baseline
    lost = [*(one.run for one in baseline.worse), *(one.run for one in baseline.gone)] if baseline else []
    worse = lost.count(run.name)
    return (
        name,
        Cell(str(comparison.recording or text.NOTHING)),
        Cell(made(comparison)),
        Cell(comparison.reference.name),
        verdict,
        Cell(f"in {worse} quantities" if worse > 1 else f"in {worse} quantity" if worse else text.NOTHING),
        *sizes,
    )


def statistics_tables(deviation: Deviation) -> tuple[Table, ...]:
    """Return the statistics of every quantity: a table of those in [mm] and one of those in [deg]."""
    starts = [float(values[0]) for values in deviation.values]
    tables = []
    for unit, (shown, _) in text.SHOWN.items():
        pairs = zip(deviation.all_statistics, starts, strict=True)
        joint = deviation.furthest_joint(unit)
        rows = tuple(
            _statistics_row(one, start, most=one is joint and one.max > 0.0)
            for one, start in pairs
            if one.unit == unit
        )
        if rows:
            about = dict.fromkeys(ABOUT[one.kind] for one in deviation.all_statistics if one.unit == unit)
            title = f"Statistics of {text.enumerated(tuple(about))}"
            table = Table(title, _statistics_columns(shown), rows, note=_statistics_note(deviation))
            tables.append(without_empty_columns(table))
    return tuple(tables)


def _how_far(comparison: Comparison, links: Sequence[str]) -> Table:
    """Return the largest deviation of each kind and how much is out of tolerance, one line a log."""
    columns: tuple[Column, ...] = (
        *words("Log", "Verdict", "Decided by"),
        *numbers(*(f"max |{SYMBOLS[axis]}| [mm]" for axis in "xyz"), "max ‖Δ‖ [mm]", "max path [mm]"),
        *numbers("max angle [deg]", "max joint [deg]", "max joint [mm]", "Share out", "Covered"),
    )
    rows = tuple(
        _how_far_row(run, link, comparison.covered(run))
        for run, link in zip(comparison.ranking, links, strict=True)
    )
    note = "The bars show how much of a tolerance is used up; the logs are ranked by the fullest of theirs."
    note += " Covered: share of the reference within the log's time."
    return without_empty_columns(Table("Largest deviations, best to worst", columns, rows, note=note))


def _how_far_row(run: Deviation, link: str, covered: float) -> tuple[Cell, ...]:
    found = [*(run.statistics[axis] for axis in AXES), run.statistics["path"], run.statistics.get("angle")]
    found += map(run.furthest_joint, ("rad", "m"))
    return (
        Cell(run.name, href=link),
        judged(run.verdict),
        Cell(size_of(run.decisive)),
        *(_largest(one) for one in found),
        Cell(text.percent(run.share_out)),
        Cell(text.percent(covered)),
    )


def _when_and_where(comparison: Comparison, links: Sequence[str]) -> Table:
    """Return when and where each log is worst, and how it was put together with the reference."""
    columns = (
        *words("Log"),
        *numbers("Decided at t [s]", "Log there at x, y, z [m]", "Longest out [s]", "Longest out from t [s]"),
        *numbers("Sync offset [s]", "r(‖Δ‖, speed)", "Left out", "Warnings"),
        *words("Alignment"),
    )
    rows = tuple(
        _when_and_where_row(run, link, len(comparison.warnings_of(run)))
        for run, link in zip(comparison.ranking, links, strict=True)
    )
    note = "Left out: samples of the log without a counterpart or without a value."
    return without_empty_columns(Table("When, where and how compared", columns, rows, note=note))


def _when_and_where_row(run: Deviation, link: str, warnings: int) -> tuple[Cell, ...]:
    longest = run.longest_out
    stretch = (text.NOTHING,) * 2
    if longest is not None:
        stretch = (text.seconds(longest.duration), text.seconds(longest.t))
    return (
        Cell(run.name, href=link),
        Cell(text.seconds(run.decisive.t_max)),
        Cell(text.point(run.place(run.decisive))),
        *(Cell(value) for value in stretch),
        Cell(text.seconds(run.sync.offset)),
        Cell(speed_correlation(run) or text.NOTHING),
        Cell(str(run.left_out)),
        Cell(str(warnings)),
        Cell(alignment_value(run)),
    )


def _statistics_columns(unit: str) -> tuple[Column, ...]:
    return (
        *words("Quantity", "Verdict"),
        *numbers(f"tolerance [{unit}]", f"max |Δ| [{unit}]", "at t [s]", f"rms [{unit}]"),
        *numbers(
            f"p95 |Δ| [{unit}]",
            f"mean [{unit}]",
            f"std [{unit}]",
            f"at start [{unit}]",
            "samples out",
            "share out",
            "no value",
        ),
    )


def _statistics_row(one: Statistics, start: float, *, most: bool) -> tuple[Cell, ...]:
    return (
        Cell(symbol(one)),
        judged(one.verdict),
        Cell(text.limit(one.tolerance, one.unit)),
        replace(_largest(one), most=most),
        Cell(text.seconds(one.t_max)),
        *(Cell(text.number(value, one.unit)) for value in (one.rms, one.p95, one.mean, one.std, start)),
        Cell(text.NOTHING if one.out_of_tolerance is None else str(one.out_of_tolerance)),
        Cell(text.NOTHING if one.share_out is None else text.percent(one.share_out)),
        Cell(str(one.missing) if one.missing else text.NOTHING),
    )


def _statistics_note(deviation: Deviation) -> str:
    return (
        "max, rms and p95 are of absolute values, mean and std signed. At start: the agreement of the start"
        f" poses (mutual calibration) at t = {text.seconds(float(deviation.t[0]))} s."
    )


def _largest(statistics: Statistics | None) -> Cell:
    """Return the largest value, marked where it is out of tolerance."""
    if statistics is None:
        return Cell(text.NOTHING)
    used = None if statistics.used is None else min(statistics.used, 1.0)
    state = "fail" if statistics.verdict == "fail" else ""
    return Cell(text.number(statistics.max, statistics.unit, statistics.tolerance), state, used=used)
