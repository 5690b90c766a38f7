"""How solved targets present themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from urmpipe_models.arrays import IntArray
from urmpipe_models.inverse.closed.closed_form import method_words
from urmpipe_pipeline.solved_targets.result import SolvedTargets
from urmpipe_pipeline.solved_targets.wording import rows_text
from urmpipe_pipeline.text import DIGITS, SHOWN, counted, enumerated

NUMBER = re.compile(r"(?<!\w)-?\d+(\.\d+)?(e[-+]?\d+)?")
"""What may differ in reasons that are one."""


def reach_words(subject: str, arms: Sequence[str], found: int, wanted: int) -> str:
    """Return that arms reach so many targets of some: "poses: ur5e reaches 3 targets"."""
    part = "" if found == wanted else f"{found} of "
    verb = "reaches" if len(arms) == 1 else "reach"
    return f"{subject}: {enumerated(arms)} {verb} {part}{counted(wanted, 'target')}"


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
