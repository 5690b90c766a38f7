"""Facts, tables and events of solved targets: what was reached, how the path goes, and why not."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from urmpipe_models.ik.closed import format_method
from urmpipe_models.ik.limits import TURN, joint_periods
from urmpipe_models.ik.path import BranchJump, JointPath, SpeedViolation
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.palette import colour_name, ghost_colour, run_colour
from urmpipe_pipeline.presentation.parts import columns_of, recording_fact, spot_at, table_of
from urmpipe_pipeline.presentation.section import Cell, Column, Event, Fact, Place, Table, Value
from urmpipe_pipeline.solved_targets.result import IkResult
from urmpipe_pipeline.solved_targets.scene import ghosts
from urmpipe_pipeline.text import format_rounded, format_rows

MANY = 10
"""Branches, jumps and stretches of joints too fast that are facts of each; the others are counted."""

NUMBER = re.compile(r"(?<!\w)-?\d+(\.\d+)?(e[-+]?\d+)?")
"""What may differ in reasons that are one."""


def facts(one: IkResult) -> Iterator[Fact]:
    """Yield what was solved, how, and how much of it."""
    yield Fact("Targets", f"{int(one.reached.sum())} of {len(one)} with a solution", brief=False)
    yield Fact("Robot", one.robot.name, brief=False)
    yield Fact("Method", format_method(one.method), brief=False)
    if one.t_ns is None:
        yield Fact("Rows", f"{len(one)}, without times", brief=False)
    else:
        yield Fact("Duration", Value(float(one.t_ns[-1]) / 1e9, "s"), brief=False)
    yield recording_fact(one.recording)


def path_facts(one: IkResult, path: JointPath) -> Iterator[Fact]:
    """Yield how the joints follow a path: a summary, not its samples; nothing where no target is reached."""
    nearest = path.nearest_singularity
    if nearest is None:
        return
    yield Fact("Branch", "; ".join(_capped(list(_branches(one)))))
    yield from (Fact("Jump", words) for words in _capped([jump_words(one, jump) for jump in path.jumps]))
    fast = [fast_words(one, stretch) for stretch in path.speed_violations]
    yield from (Fact("Too fast", words) for words in _capped(fast))
    yield Fact(
        "Nearest to a singularity",
        f"{_at(one, nearest)}: smallest singular value {path.singularity.smallest[nearest]:.4g},"
        f" manipulability {path.singularity.manipulability[nearest]:.4g}",
    )
    yield Fact("Off by", _furthest(one), "how far the tool is from its targets, by forward kinematics")


def jump_words(one: IkResult, jump: BranchJump) -> str:
    """Return a jump with its time, its place and what moves."""
    steps = ", ".join(f"{step.joint} by {format_rounded(step.step, step.unit)}" for step in jump.joints)
    change = "" if jump.from_branch == jump.to_branch else f"{jump.from_branch} → {jump.to_branch}: "
    since = f", since row {one.row[jump.last]}" if jump.last < jump.sample - 1 else ""
    return f"{_at(one, jump.sample)}{since}, at ({text.format_point(jump.position)}) m: {change}{steps}"


def fast_words(one: IkResult, stretch: SpeedViolation) -> str:
    """Return how fast a joint would have to be, how fast it may be, and where."""
    speed, allowed = (format_rounded(value, stretch.unit) for value in (stretch.speed, stretch.allowed))
    rows = f"{_at(one, stretch.first)} to row {one.row[stretch.last]}"
    return f"{stretch.joint} at {speed} of {allowed} allowed, {rows}"


def _capped(lines: list[str]) -> list[str]:
    """Return the first lines, and how many more there are."""
    more = len(lines) - MANY
    return [*lines[:MANY], f"and {more} more"] if more > 0 else lines


def _branches(one: IkResult) -> Iterator[str]:
    """Yield the branches in the order of the path, with their rows if there are several."""
    reached = np.flatnonzero(one.reached)
    stretches = [list(some) for _, some in groupby(reached.tolist(), one.branch.__getitem__)]
    for some in stretches:
        rows = one.row[[some[0], some[-1]]].tolist()
        stretch = f"row {rows[0]}" if rows[0] == rows[1] else f"rows {rows[0]}-{rows[1]}"
        yield str(one.branch[some[0]]) + (f" ({stretch})" if len(stretches) > 1 else "")


def _furthest(one: IkResult) -> str:
    """Return how far the tool is from its targets at most, and where."""
    miss = one.position_error[:, 0]
    said = text.format_quantity(float(np.nanmax(miss)), "m")
    if one.angle is not None:
        said += f" and {text.format_quantity(float(np.nanmax(one.angle)), 'rad')}"
    return f"{said} at most, {_at(one, int(np.nanargmax(miss)))}"


def _at(one: IkResult, sample: int) -> str:
    """Return when a sample is."""
    t = one.t
    row = f"row {one.row[sample]}"
    return f"at {row}" if t is None else f"at t = {text.format_seconds(t[sample])} s ({row})"


def tables(one: IkResult) -> Iterator[Table]:
    """Yield the solutions or how the joints move along the path, and which ghost is which branch."""
    if one.path is None:
        yield solutions_table(one)
    elif one.reached.any():
        yield joints_table(one)
    if found := ghosts(one):
        heads = {"branch": "Branch", "drawn": "Drawn", "rows": "Rows"}
        chosen = ("chosen", f"solid, its tip {colour_name(run_colour(0))}", Value(int(one.reached.sum())))
        others = (
            (ghost.name, colour_name(ghost_colour(i)), Value(int(np.isfinite(ghost.q).all(axis=1).sum())))
            for i, ghost in enumerate(found)
        )
        yield table_of("Branches", heads, [chosen, *others])


def solutions_table(one: IkResult) -> Table:
    """Return the solutions nearest to the start, or every solution if all were requested: a row each."""
    targets = np.flatnonzero(one.reached)
    places = np.nonzero(one.solutions.reached) if one.all_solutions else (targets, one.chosen[targets])
    q, labels, miss, angle = one.solutions.q, one.solutions.labels, one.position_error, one.angle

    def joint(j: int, unit: str) -> Callable[[tuple[int, int]], Cell]:
        return lambda at: _shown(q[*at, j], unit)

    heads: dict[str, tuple[str, Callable[[tuple[int, int]], Cell]]] = {
        "row": ("Row", lambda at: Value(int(one.row[at[0]]))),
        "branch": ("Branch", lambda at: str(labels[at])),
    }
    for j, (name, unit) in enumerate(zip(one.robot.coordinates, one.joint_units, strict=True)):
        heads[name] = name, joint(j, unit)
    heads["position_error"] = "off by", lambda at: Value(float(miss[at]), "m")
    if angle is not None:
        heads["angle"] = "turned by", lambda at: Value(float(angle[at]), "rad")
    title = "Every solution" if one.all_solutions else "The solutions nearest to the start"
    rows, columns = (some.tolist() for some in places)
    made = columns_of(list(zip(rows, columns, strict=True)), heads)
    return Table(title, tuple(replace(one, brief=one.key != "angle") for one in made))


def _shown(value: float, unit: str) -> Value:
    """Return a joint value in [rad] or [m] as a cell: what is only rounding is 0."""
    return Value(round(float(value), 9) + 0.0, unit)


def joints_table(one: IkResult) -> Table:
    """Return how each joint moves along a path: where it starts and ends, and how fast it is at most."""
    joints, q = one.robot.moving, one.q[one.reached]
    units = one.joint_units
    ends = {"start": q[0], "min": q.min(axis=0), "max": q.max(axis=0), "end": q[-1]}
    columns = [Column("joint", "Joint", [joint.name for joint in joints])]
    columns += [Column(key, key, list(map(_shown, values, units))) for key, values in ends.items()]
    if one.t is not None and len(q) > 1:
        step, endless = np.diff(q, axis=0), np.isfinite(joint_periods(one.robot))
        step[:, endless] -= TURN * np.round(step[:, endless] / TURN)  # of values within pi: no joint wraps
        speed = np.abs(step) / np.diff(one.t[one.reached])[:, None]
        speeds = {"fastest": speed.max(axis=0), "allowed": [joint.velocity for joint in joints]}
        for key, values in speeds.items():
            cells = [
                f"{text.format_quantity(round(value, 9), unit)}/s" if np.isfinite(value) else None
                for value, unit in zip(values, units, strict=True)
            ]
            columns.append(Column(key, key, cells))
    return Table("Joints along the path", tuple(columns))


def unreached(one: IkResult) -> Iterator[str]:
    """Yield why rows have no solution; if all are requested also why branches of other rows have none."""
    for rows, why in _stretches(one):
        if why:
            yield f"{format_rows(one.row[rows])}: {why}"
        elif one.all_solutions and one.method != "iterative":
            yield from _branches_unreached(one, rows)


def unreached_facts(one: IkResult) -> Iterator[Fact]:
    """Yield what is not reached and why, as far as there is room."""
    yield from (Fact("Not reached", words) for words in _capped(list(unreached(one))))


def _stretches(one: IkResult) -> Iterator[tuple[list[int], str]]:
    """Yield stretches of rows, from 0, that have no solution for one reason but for its numbers, or have one.

    The reason is the first of the row in the middle where numbers differ; empty of rows with a solution.
    """
    reasons = [(reason or "").split("; ")[0] for reason in one.reasons]
    for _, some in groupby(range(len(reasons)), lambda row: NUMBER.sub("#", reasons[row])):
        rows = list(some)
        middle = rows[len(rows) // 2]
        alike = len({reasons[row] for row in rows}) == 1
        yield rows, reasons[middle] if alike else f"row {one.row[middle]}: {reasons[middle]}"


def _branches_unreached(one: IkResult, rows: Sequence[int]) -> Iterator[str]:
    """Yield why branches of targets that others reach have no solution."""
    for index in rows:
        found: dict[str, list[str]] = {}
        for branch, reason in zip(one.solutions.branches, one.solutions.reasons[index], strict=True):
            if reason:
                found.setdefault(reason, []).append(branch)
        for reason, branches in found.items():
            yield f"row {one.row[index]} by {'; '.join(branches)}: {reason}"


def missed_table(one: IkResult) -> Table:
    """Return every target without a solution, with its time, its place and all its reasons."""
    missed, t = np.flatnonzero(~one.reached).tolist(), one.t
    heads: dict[str, tuple[str, Callable[[int], Cell]]] = {
        "row": ("Row", lambda k: Value(int(one.row[k]))),
        "t": ("t", lambda k: None if t is None else Value(float(t[k]), "s")),
        "position": ("x, y, z", lambda k: Place(spot_at(one.targets.position[k]))),
        "reason": ("Why", one.solutions.reason),
    }
    return Table(f"Targets without a solution ({len(missed)})", columns_of(missed, heads), brief=False)


def events(one: IkResult) -> Iterator[Event]:
    """Yield rows that are not reached, jumps, joints that are too fast, and warnings, each at its row."""
    for rows, why in _stretches(one):
        if why:
            yield Event(_time(one, rows[0]), f"not reached: {format_rows(one.row[rows])}: {why}", "error")
    if one.path is not None:
        for jump in one.path.jumps:
            yield Event(_time(one, jump.sample), f"jump {jump_words(one, jump)}", "error")
        for stretch in one.path.speed_violations:
            yield Event(_time(one, stretch.first), f"too fast: {fast_words(one, stretch)}", "error")
    for warning in one.warnings:
        row = min(max((warning.row or 1) - 1, 0), len(one) - 1)
        yield Event(_time(one, row), f"{warning.kind}: {warning.sentence()}", "warning")


def _time(one: IkResult, row: int) -> int | None:
    """Return the time of a row in [ns]; None without times."""
    return None if one.t_ns is None else int(one.t_ns[row])
