"""A path in the terminal: its branch, jumps, joints too fast, and how near it comes to a singularity."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from urmpipe.printing.columns import Column, print_columns
from urmpipe_models.chains.chain import Joint
from urmpipe_pipeline import text
from urmpipe_pipeline.solved_targets.presenter import joint_number
from urmpipe_pipeline.solved_targets.result import SolvedTargets
from urmpipe_pipeline.solved_targets.wording import in_words

if TYPE_CHECKING:
    from rich.console import Console

    from urmpipe_models.inverse.along_path.joint_path import JointPath
    from urmpipe_models.inverse.along_path.jumps import Jump

SHOWN = 10
"""Branches, jumps and stretches of joints too fast that are printed of each; the others are counted."""


def print_path(console: Console, result: SolvedTargets, path: JointPath) -> None:
    """Print how the joints follow a path: a summary, not its samples."""
    nearest = path.nearest_singularity
    if nearest is None:
        return
    for line in _lines(result, path, nearest):
        console.print(f"      {line}", soft_wrap=True)
    print_columns(console, "Joints along the path", list(_columns(result)))


def _lines(result: SolvedTargets, path: JointPath, nearest: int) -> Iterator[str]:
    """Yield what is to be said of the way."""
    yield f"branch: {'; '.join(_capped(list(_branches(result))))}"
    yield from _capped([_jump(result, one) for one in path.jumps])
    yield from _capped([
        f"{one.joint} too fast: {in_words(one.speed, one.unit)} of {in_words(one.allowed, one.unit)}"
        f" allowed, {_at(result, one.first)} to row {result.row[one.last]}"
        for one in path.too_fast
    ])  # fmt: skip
    yield _nearest_singular(result, path, nearest)
    yield _furthest(result)


def _capped(lines: list[str]) -> list[str]:
    """Return the first lines, and how many more there are."""
    more = len(lines) - SHOWN
    return [*lines[:SHOWN], f"and {more} more; --json has all"] if more > 0 else lines


def _branches(result: SolvedTargets) -> Iterator[str]:
    """Yield the branches in the order of the path, with their rows if there are several."""
    reached = np.flatnonzero(result.reached)
    branch, row = result.branch[reached], result.row[reached]
    first = np.flatnonzero(np.r_[True, branch[1:] != branch[:-1]])
    last = np.append(first[1:], len(branch)) - 1
    for a, b in zip(first, last, strict=True):
        yield str(branch[a]) + ("" if len(first) == 1 else f" ({_rows(row[a], row[b])})")


def _rows(first: int, last: int) -> str:
    """Return a stretch of rows in words."""
    return f"row {first}" if first == last else f"rows {first}-{last}"


def _jump(result: SolvedTargets, jump: Jump) -> str:
    """Return a jump with its time, its place and what moves."""
    steps = ", ".join(f"{one.joint} by {in_words(one.step, one.unit)}" for one in jump.joints)
    ways = "" if jump.from_branch == jump.to_branch else f"{jump.from_branch} → {jump.to_branch}: "
    since = f", since row {result.row[jump.last]}" if jump.last < jump.sample - 1 else ""
    return f"jump {_at(result, jump.sample)}{since}, at ({text.point(jump.position)}) m: {ways}{steps}"


def _nearest_singular(result: SolvedTargets, path: JointPath, nearest: int) -> str:
    """Return where the path comes nearest to a singular pose, and how near."""
    found = path.singularity
    return (
        f"nearest to a singularity {_at(result, nearest)}: smallest singular value"
        f" {found.smallest[nearest]:.4g}, manipulability {found.manipulability[nearest]:.4g}"
    )


def _furthest(result: SolvedTargets) -> str:
    """Return how far the tool is from its targets at most, by forward kinematics."""
    miss = result.miss[:, 0]
    said = f"off by {text.quantity(float(np.nanmax(miss)), 'm')}"
    if result.angle is not None:
        said += f" and {text.quantity(float(np.nanmax(result.angle)), 'rad')}"
    return f"{said} at most, by forward kinematics; {_at(result, int(np.nanargmax(miss)))}"


def _at(result: SolvedTargets, sample: int) -> str:
    """Return when a sample is."""
    t = result.t
    return (
        f"at row {result.row[sample]}"
        if t is None
        else f"at t = {text.seconds(t[sample])} s (row {result.row[sample]})"
    )


def _columns(result: SolvedTargets) -> Iterator[Column]:
    """Yield the columns of the table of joints: a row a joint."""
    joints, q = result.robot.moving, result.q
    reached = q[result.reached]
    units = ["rad" if joint.kind == "revolute" else "m" for joint in joints]
    yield Column(
        "Joint", [f"{one.name} [{text.SHOWN[u][0]}]" for one, u in zip(joints, units, strict=True)], key=True
    )
    for head, values in (
        ("start", reached[0]), ("min", reached.min(axis=0)),
        ("max", reached.max(axis=0)), ("end", reached[-1]),
    ):  # fmt: skip
        yield Column(head, [joint_number(value, unit) for value, unit in zip(values, units, strict=True)])
    yield from _speeds(result, joints, units)


def _speeds(result: SolvedTargets, joints: tuple[Joint, ...], units: list[str]) -> Iterator[Column]:
    """Yield how fast each joint is at most, and how fast it may be."""
    t = result.t
    if t is None or len(t) < 2:
        return
    speed = np.abs(np.diff(result.q[result.reached], axis=0)) / np.diff(t[result.reached])[:, None]
    fastest = speed.max(axis=0, initial=0.0)
    yield Column(
        "fastest\n[1/s]", [joint_number(value, unit) for value, unit in zip(fastest, units, strict=True)]
    )
    if any(np.isfinite(joint.velocity) for joint in joints):
        limits = [
            f"{joint.velocity * text.SHOWN[unit][1]:.6g}" if np.isfinite(joint.velocity) else None
            for joint, unit in zip(joints, units, strict=True)
        ]
        yield Column("allowed\n[1/s]", limits)
