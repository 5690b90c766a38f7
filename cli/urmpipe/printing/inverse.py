"""Inverse kinematics in the terminal: what was reached, and the solutions as a table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from urmpipe.printing.columns import Column, print_columns
from urmpipe.printing.terminal import LISTED, judged_line, new_console
from urmpipe_models.arrays import FloatArray, IndexArray
from urmpipe_pipeline import text
from urmpipe_pipeline.solved_targets.presenter import headline, joint_number, unreached
from urmpipe_pipeline.solved_targets.result import SolvedTargets

if TYPE_CHECKING:
    from rich.console import Console


def print_inverse(result: SolvedTargets, *, every: bool = False) -> None:
    """Print how many targets were reached, the solutions or how the path went, and why targets were not.

    Args:
        result: What was found.
        every: Print all solutions of a target, not only the one nearest to the start.
    """
    from urmpipe.printing.inverse_path import print_path

    console = new_console()
    console.print(judged_line(result.verdict, headline(result)), soft_wrap=True)
    if result.path is not None:
        print_path(console, result, result.path)
    else:
        _print_solutions(console, result, every=every)
    _print_unreached(console, result, every=every)


def _print_solutions(console: Console, result: SolvedTargets, *, every: bool) -> None:
    """Print the solutions, as many as a person reads."""
    targets, columns = _listed(result, every=every)
    if not len(targets):
        return
    title = "Every solution" if every else "The solutions nearest to the start"
    shown = slice(LISTED)
    print_columns(console, title, list(_columns(result, targets[shown], columns[shown])))
    if (more := len(targets) - LISTED) > 0:
        console.print(f"... and {more} more; --json lists all, and -o LOG.csv those nearest to the start")


def _listed(result: SolvedTargets, *, every: bool) -> tuple[IndexArray, IndexArray]:
    """Return target and column of the solutions to print."""
    if every:
        targets, columns = np.nonzero(result.solutions.reached)
        return targets, columns
    targets = np.flatnonzero(result.reached)
    return targets, result.chosen[targets]


def _columns(result: SolvedTargets, targets: IndexArray, columns: IndexArray) -> Iterator[Column]:
    """Yield the columns of the table: a row a solution."""
    yield Column("Row", [str(row) for row in result.row[targets]], key=True)
    yield Column("Branch", result.solutions.labels[targets, columns].tolist(), key=True)
    for j, joint in enumerate(result.robot.moving):
        unit = "rad" if joint.kind == "revolute" else "m"
        values = result.solutions.q[targets, columns, j]
        yield Column(
            f"{joint.name}\n[{text.SHOWN[unit][0]}]", [joint_number(value, unit) for value in values]
        )
    yield Column("off by\n[mm]", _numbers(result.miss[targets, columns], "m"))
    if result.angle is not None:
        yield Column("off by\n[deg]", _numbers(result.angle[targets, columns], "rad"))


def _numbers(values: FloatArray, unit: str) -> list[str]:
    """Return distances in [m] or angles in [rad] as people read them: their size."""
    return [f"{value * text.SHOWN[unit][1]:.1e}" for value in values]


def _print_unreached(console: Console, result: SolvedTargets, *, every: bool) -> None:
    """Print why targets, or branches of them, have no solution."""
    lines = list(unreached(result, every=every))
    for line in lines[:LISTED]:
        console.print(line, soft_wrap=True)
    if len(lines) > LISTED:
        console.print(f"... and {len(lines) - LISTED} more; --json has all reasons")
