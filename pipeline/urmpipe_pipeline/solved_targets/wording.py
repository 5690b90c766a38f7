"""The words of solved targets: rows, how many an arm reaches, and why it does not reach the others."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.arrays import IntArray
from urmpipe_models.inverse.closed.closed_form import method_words
from urmpipe_pipeline.solved_targets.result import SolvedTargets
from urmpipe_pipeline.text import DIGITS, SHOWN, counted, enumerated

NAMED = 6
"""Rows or stretches of rows that are named; the others are counted."""

NUMBER = re.compile(r"(?<!\w)-?\d+(\.\d+)?(e[-+]?\d+)?")
"""What may differ in reasons that are one."""


def rows_text(rows: Sequence[int] | IntArray) -> str:
    """Return rows, shape (n,), for a sentence: "row 3", "rows 3, 7-9 and 40 more"."""
    rows = np.asarray(rows)
    first = np.flatnonzero(np.diff(rows, prepend=rows[0] - 2) != 1)
    last = np.append(first[1:], len(rows)) - 1
    parts = [
        str(rows[a]) if a == b else f"{rows[a]}-{rows[b]}"
        for a, b in zip(first[:NAMED], last[:NAMED], strict=True)
    ]
    more = len(rows) - 1 - last[:NAMED][-1]
    said = ", ".join(parts) + (f" and {more} more" if more else "")
    return f"row{'' if len(rows) == 1 else 's'} {said}"


def reach_words(subject: str, arms: Sequence[str], found: int, wanted: int) -> str:
    """Return that arms reach so many targets of some: "poses: ur5e reaches 3 targets"."""
    part = "" if found == wanted else f"{found} of "
    verb = "reaches" if len(arms) == 1 else "reach"
    return f"{subject}: {enumerated(arms)} {verb} {part}{counted(wanted, 'target')}"


def in_words(value: float, unit: str) -> str:
    """Return an angle, a length or a rate of one in [rad] or [m] with the unit that people read."""
    base, slash, per = unit.partition("/")
    shown, factor = SHOWN[base]
    return f"{value * factor:.4g} {shown}{slash}{per}"


def joint_number(value: float, unit: str) -> str:
    """Return a joint value in [rad] as [deg] or in [m] as [mm]; what is only rounding is 0."""
    return f"{round(float(value) * SHOWN[unit][1], DIGITS) + 0.0:.{DIGITS}f}"


def headline(result: SolvedTargets) -> str:
    """Return how many targets the arm reaches, how they were solved, and why it cannot follow a path."""
    reached = reach_words(result.name, [result.robot.name], int(result.reached.sum()), len(result))
    said = f"{reached} ({method_words(result.method)})"
    if result.path is None:
        return said
    jumps, fast = len(result.path.jumps), len({one.joint for one in result.path.too_fast})
    others = [counted(jumps, "jump")] * bool(jumps) + [f"{counted(fast, 'joint')} too fast"] * bool(fast)
    return f"{said}, with {enumerated(others)}" if others else said


def unreached(result: SolvedTargets, *, every: bool) -> Iterator[str]:
    """Yield why targets have no solution, and, if all branches are asked for, why single branches have none.

    Rows that follow each other for one reason, but for its numbers, are one line.
    """
    reasons = [reason or "" for reason in result.reasons]
    kinds = [NUMBER.sub("#", reason) for reason in reasons]
    start = 0
    for end in range(1, len(kinds) + 1):
        if end == len(kinds) or kinds[end] != kinds[start]:
            if reasons[start]:
                yield _not_reached(result.row[start:end], reasons[start:end])
            elif every and result.method != "iterative":
                yield from _branches_unreached(result, start, end)
            start = end


def _not_reached(row: IntArray, reasons: Sequence[str]) -> str:
    """Return why rows are not reached: by the one in the middle where the numbers of the reasons differ."""
    if len(set(reasons)) == 1:
        return f"{rows_text(row)} not reached: {reasons[0]}"
    middle = len(reasons) // 2
    return f"{rows_text(row)} not reached; row {row[middle]}: {reasons[middle]}"


def _branches_unreached(result: SolvedTargets, start: int, end: int) -> Iterator[str]:
    """Yield why branches of targets that others reach have no solution."""
    for index in range(start, end):
        found: dict[str, list[str]] = {}
        for branch, reason in zip(result.solutions.branches, result.solutions.reasons[index], strict=True):
            if reason:
                found.setdefault(reason, []).append(branch)
        for reason, branches in found.items():
            yield f"{rows_text(result.row[index : index + 1])}: not {'; '.join(branches)}: {reason}"
