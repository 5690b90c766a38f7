"""The text beside the arm: the verdict first, then how much, where and when, then what to know about it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.comparison.symbols import size_of
from urmpipe_pipeline.comparison.wording import (
    alignment_words,
    decided_words,
    out_words,
    stretch_words,
    sync_words,
    tolerance_words,
    verdict_words,
)
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.palette import ghost_colour_word, run_colour_word
from urmpipe_pipeline.recording.entities import printable
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.verdict import reached, reached_words, solved

BRANCHES = 8
"""Branches that are listed; the others are counted."""

LISTED = 4
"""Warnings that are listed; the others are counted."""


def summary(result: Run | Comparison) -> str:
    """Return a run or a comparison in a few lines of Markdown; lengths in [mm] here, where people read."""
    lines = _of_run(result) if isinstance(result, Run) else _of_comparison(result)
    return "\n".join(lines)


def _of_run(run: Run) -> Iterator[str]:
    files = ", ".join(shown(file.name) for file in run.log.files) or "no file"
    done = "solved by" if run.goals is not None else "read as"
    robot = "No robot, so no kinematics." if run.log.joints else "A path, without joints."
    if run.robot is not None:
        robot = f"Arm: {shown(run.robot.name)}."
    wraps, others = len(run.repolarizations), len(run.audit) - len(run.repolarizations)
    marked = ", marked by triangles in the joint's colour" if wraps else ""
    doubts = f"; other findings: {others}, marked by crosses" if others else ""
    yield f"### {_headline(run)}"
    rows = text.counted(run.log.rows, "row") + ("" if not run.timed else f", {run.duration:.6g} s")
    yield f"{files}, {done} {shown(run.log.source)}: {rows}. {robot}"
    yield ""
    if not run.timed:
        missing = " Rows that are not reached show no arm." if reached(run) < run.log.rows else ""
        yield f"Without times: the timeline counts rows, t = 0 s is row 1.{missing}"
    else:
        every = f", one in {1e3 * run.tsp:.6g} ms" if len(run.t_ns) > 1 else ""
        grid = f"Grid: {text.counted(len(run.t_ns), 'sample')}{every}."
        yield f"{grid} Repolarizations: {wraps}{marked}{doubts}." if run.log.joints else grid
    yield from _branches(run)
    yield from warning_lines(run.warnings)


def _headline(run: Run) -> str:
    """Return the name, of solved targets behind the verdict and with how many are reached."""
    if run.goals is None:
        return shown(run.name)
    return f"{'PASS' if solved(run) else 'FAIL'}: {shown(reached_words([run]))}"


def _branches(run: Run) -> Iterator[str]:
    """Yield which ghost is which branch, and at how many rows it is another solution: two in a line."""
    if not run.ghosts:
        return
    rows = reached(run)
    names = {name for name in run.goals.branches if name} if run.goals else set()
    chosen = f"chosen: {shown(names.pop())}" if len(names) == 1 else "chosen"
    cells = [(chosen, f"solid, its tip {run_colour_word(0)}", str(rows))]
    for i, ghost in enumerate(run.ghosts[:BRANCHES]):
        cells.append((shown(ghost.name), ghost_colour_word(i), str(len(ghost.t_ns))))
    half = math.ceil(len(cells) / 2)
    yield ""
    yield table_row(("branch", "drawn", "rows") * 2)
    yield table_row("---" for _ in range(6))
    for left, right in zip_longest(cells[:half], cells[half:], fillvalue=("",) * 3):
        yield table_row((*left, *right))
    if len(run.ghosts) > BRANCHES:
        yield ""
        yield f"and {len(run.ghosts) - BRANCHES} more branches"


def _of_comparison(result: Comparison) -> Iterator[str]:
    several = len(result.runs) > 1
    yield f"### {result.verdict.upper()}: {shown(verdict_words([result]))}"
    worst = result.worst
    yield _worst(worst, several)
    yield ""
    yield f"Reference: {shown(result.reference.name)} (grey, dashed). Tolerance: {tolerance_words(result)}."
    yield ""
    yield from _table(result)
    yield from _set_up(result, several)
    told = [warning.of(one.name) for one in result.runs for warning in one.run.warnings]
    yield from warning_lines([*result.warnings, *told])
    yield ""
    at = text.seconds(worst.decisive.t_max)
    yield (
        f"Decided at {at} s: `urmpipe view` opens this there, other programs at the first sample. All"
        " figures, statistics and provenance: `urmpipe report` with this file."
    )


def _worst(one: Deviation, several: bool) -> str:
    """Return how much, where and when of the log that comes out worst."""
    said = f"**{shown(one.name)}**: " if several else ""
    said += f"{shown(decided_words(one.decisive))}."
    if one.verdict == "fail":
        said += f" Out of tolerance: {out_words(int(np.count_nonzero(one.outside)), len(one.sample))}"
        if (longest := one.longest_out) is not None:
            said += f", the longest stretch: {stretch_words(longest)}"
        said += "."
    return said


def _table(result: Comparison) -> Iterator[str]:
    """Yield the logs from best to worst."""
    sizes = (shown(f"max {size_of(result.worst.statistics[axis])} [mm]") for axis in AXES)
    heads = ("log", "drawn", *sizes, "decided by", "at t [s]", "out", "verdict")
    yield table_row(heads)
    yield table_row("---" for _ in heads)
    for one in result.ranking:
        yield table_row(_cells(result.runs.index(one), one))


def _cells(index: int, one: Deviation) -> Iterable[str]:
    yield shown(one.name)
    yield run_colour_word(index)
    for axis in AXES:
        yield text.millimetres(one.statistics[axis].max, one.statistics[axis].tolerance)
    yield shown(size_of(one.decisive))
    yield text.seconds(one.decisive.t_max)
    yield text.percent(one.share_out)
    yield one.verdict.upper()


def _set_up(result: Comparison, several: bool) -> Iterator[str]:
    """Yield how each log was put beside the reference, where that is not trivial, and what was left out."""
    for one in result.runs:
        said = [words for words in (sync_words(one.sync), alignment_words(one.alignment)) if words]
        if one.reference_left_out:
            said.append(f"{one.reference_left_out} samples of the reference outside its time")
        if said:
            yield ""
            yield (f"{shown(one.name)}: " if several else "") + shown("; ".join(said))


def warning_lines(warnings: Sequence[LogWarning]) -> Iterator[str]:
    """Yield the first warnings as a list."""
    if warnings:
        yield ""
        yield f"Warnings: {len(warnings)}"
        yield ""
    for one in warnings[:LISTED]:
        row = f" (row {one.row})" if one.row is not None else ""
        yield f"- {shown(one.message)}{row}"
    if len(warnings) > LISTED:
        yield f"- and {len(warnings) - LISTED} more, all in the report"


def table_row(cells: Iterable[str]) -> str:
    """Return a row of a table in Markdown."""
    return f"| {' | '.join(cells)} |"


def shown(value: str) -> str:
    """Return a text from a file so that Markdown shows it as it is."""
    return re.sub(r"([\\`*_{}\[\]<>#|~!-])", r"\\\1", " ".join(printable(value).split()))
