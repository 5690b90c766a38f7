"""Facts, tables and events of a plan: how long it is and takes, what limits it, what is in its way."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.planned_paths.obstacles import Infeasibility
from urmpipe_pipeline.planned_paths.planned_joints import FOLLOWED, PlannedJoints
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.presentation.parts import columns_of
from urmpipe_pipeline.presentation.section import Cell, Event, Fact, Table, Value

MANY = 10
"""Obstacles that are facts of each, the others are counted; segments up to which all are seen at once."""

LIMITS = "Limits"
"""The fact about what is used of them."""

ROUNDED = 9
"""Digits after the point of joint values in SI: what is less is rounding."""

Cells = Callable[[int], Cell]


def facts(plan: PlannedPath) -> Iterator[Fact]:
    """Yield how long the path is and takes, by which law, what limits the arm, and what is in its way."""
    yield from (Fact("Infeasible", obstacle_words(one)) for one in plan.infeasibilities[:MANY])
    if (more := len(plan.infeasibilities) - MANY) > 0:
        yield Fact("Infeasible", f"and {more} more")
    stops_often = len(plan.path.stop_row) == len(plan.rows) > 2  # as where the name of a radius is misspelt
    yield Fact("Rows", _rows_words(plan), brief=stops_often)
    yield Fact("Length", f"{plan.path.total:.6f} m")
    yield Fact("Duration", Value(plan.duration, "s"))
    yield Fact("Law", law_words(plan))
    joints = plan.joints
    if joints is None or not plan.reached.any():
        return
    if not plan.infeasibilities:  # else the speeds stand as they were requested, whatever the joints allow
        yield Fact("Reduced", reduced_words(plan, joints))
        yield Fact(LIMITS, limit_words(plan, joints))
    yield Fact("Nearest to a singularity", _singular_words(plan, joints))


def law_words(plan: PlannedPath) -> str:
    """Return the law with what it was given: "trapezoid, up to 0.5 m/s and 6 m/s² along the path"."""
    given = ((plan.velocity, "m/s"), (plan.acceleration, "m/s²"), (plan.jerk, "m/s³"))
    values = [f"{value:.6g} {unit}" for value, unit in given if value is not None]
    held = " in total" if plan.arcs == "total" else " along the path"
    within = f"up to {text.join_list(values)}{held}" if values else ""
    return ", ".join(filter(None, ("limits of the joints" if plan.law == "limits" else plan.law, within)))


def reduced_words(plan: PlannedPath, joints: PlannedJoints) -> str:
    """Return what the speeds were reduced to, and what a joint would have needed; empty if they were not."""
    if plan.speed_factor == 1.0:
        return ""
    name, limit, _, _ = joints.most_used
    needed = plan.speed_factor ** (-1 if limit == "largest rate" else -2)
    left = f"to {text.format_percent(plan.speed_factor)} of the speed, {plan.speed:.4g} m/s"
    return f"{left}: {name} would need {text.format_portion(needed)} its {limit}"


def limit_words(plan: PlannedPath, joints: PlannedJoints) -> str:
    """Return which joint uses most of its limits, and when."""
    if not joints.limited:
        return "the robot has no velocity or acceleration limits"
    name, limit, share, sample = joints.most_used
    used = text.format_portion(round(share, ROUNDED))
    return f"{name} uses {used} its {limit}, at t = {text.format_seconds(float(plan.t[sample]))} s"


def decisive_fact(plan: PlannedPath) -> Iterator[Fact]:
    """Yield the largest share of a limit that a plan uses; nothing where none is known, or it fails."""
    joints = plan.joints
    if joints is not None and not plan.infeasibilities and joints.limited:
        name, limit, share, _ = joints.most_used
        yield Fact(f"{limit.capitalize()}: {name}", _share(share), brief=False)


def obstacle_words(one: Infeasibility) -> str:
    """Return an obstacle in words: its time to 1 ms, segment, row, and the joint unless the words name it."""
    joint = f", joint {one.joint}" if one.joint and one.joint not in one.message else ""
    return f"at t = {one.t:.3f} s (segment {one.segment + 1}, row {one.row}{joint}): {one.message}"


def segments_table(plan: PlannedPath) -> Table:
    """Return the lines and arcs with their lengths and times."""
    found = plan.segments()
    heads: dict[str, tuple[str, Cells]] = {
        "segment": ("Segment", lambda k: Value(k + 1)),
        "kind": ("Kind", lambda k: str(found[k]["kind"])),
        "row": ("Row", lambda k: Value(found[k]["row"])),
        "length": ("Length", lambda k: Value(found[k]["length"], "m")),
        "radius": ("Radius", lambda k: Value(found[k]["radius"], "m", given=True)),
        "t": ("t", lambda k: Value(found[k]["t"], "s")),
        "duration": ("Duration", lambda k: Value(found[k]["duration"], "s")),
    }
    columns, many = columns_of(range(len(found)), heads), len(found) > MANY
    return Table(f"Segments ({len(found)})", columns, brief=plan.joints is None and not many, folded=many)


def joints_table(plan: PlannedPath, joints: PlannedJoints) -> Table:
    """Return the range of each joint, and its largest rate and acceleration beside their limits."""
    moving, units, used = joints.chain.moving, plan.joint_units, plan.limits()
    q, rate, rise = (
        np.round(some[plan.reached], ROUNDED) + 0.0  # no -0.0
        for some in (joints.q, np.abs(joints.qd), np.abs(joints.qdd))
    )

    def largest(values: FloatArray, per: str) -> Cells:
        """Return the cells of the largest values, shape (N, n), of the joints."""
        return lambda j: Value(float(values[:, j].max()), f"{units[j]}/{per}")

    def limit(key: str, per: str) -> Cells:
        """Return the cells of a limit of the joints."""
        return lambda j: _limit(getattr(moving[j], key), f"{units[j]}/{per}")

    heads: dict[str, tuple[str, Cells]] = {
        "joint": ("Joint", lambda j: moving[j].name),
        "min": ("min", lambda j: Value(float(q[:, j].min()), units[j])),
        "max": ("max", lambda j: Value(float(q[:, j].max()), units[j])),
        "rate": ("rate", largest(rate, "s")),
        "rate_limit": ("limit", limit("velocity", "s")),
        "velocity_share": ("used", lambda j: _share(used[j]["velocity_share"])),
        "acceleration": ("acceleration", largest(rise, "s2")),
        "acceleration_limit": ("limit", limit("acceleration", "s2")),
        "acceleration_share": ("used", lambda j: _share(used[j]["acceleration_share"])),
    }
    return Table("Joints along the path", columns_of(range(len(moving)), heads))


def events(plan: PlannedPath) -> Iterator[Event]:
    """Yield the rows that the path passes, its stops, what is in the way, and warnings."""
    count = len(plan.rows)
    for row, at in enumerate(passes_ns(plan)):
        stops = f"{'starts' if row == 0 else 'ends' if row == count - 1 else 'stops'} at row {row + 1}"
        yield Event(at, stops if plan.rows.radius[row] == 0.0 else f"passes row {row + 1}")
    for one in plan.infeasibilities:
        yield Event(round(one.t * 1e9), f"{one.kind}: {one.message}", "error")
    for warning in plan.warnings:
        row = min(warning.row or 0, count)
        yield Event(passes_ns(plan)[row - 1] if row else None, warning, "warning")


def passes_ns(plan: PlannedPath) -> list[int]:
    """Return when each row is passed, in [ns]."""
    return [round(1e9 * t) for t in plan.row_times.tolist()]


def _rows_words(plan: PlannedPath) -> str:
    """Return how many rows there are, and what those with a radius are."""
    count = format_count(len(plan.rows), "row")
    if not (plan.rows.radius > 0.0).any():
        return f"{count}, a stop each"
    meant = "corners that arcs round" if plan.rows.corner else "first points of arcs"
    return f"{count}; with a radius they are {meant}"


def _singular_words(plan: PlannedPath, joints: PlannedJoints) -> str:
    """Return where the arm comes nearest to a singular pose."""
    nearest, near = joints.nearest_singularity, joints.singularity
    if nearest is None:
        return ""
    at = f"at t = {text.format_seconds(float(plan.t[nearest]))} s (row {plan.row[nearest]})"
    value, volume = near.smallest[nearest], near.manipulability[nearest]
    return f"{at}: smallest singular value {value:.4g}, manipulability {volume:.4g}"


def _share(share: float | None) -> Value:
    """Return the share of a limit that is used, as a judged value; no value where there is no limit."""
    if share is None:
        return Value(None)
    used = round(share, ROUNDED)
    return Value(used, "%", 1.0, "fail" if used > FOLLOWED else "pass", used)


def _limit(limit: float, unit: str) -> Value:
    """Return a limit; no value where there is none."""
    return Value(limit if np.isfinite(limit) else None, unit, given=True)
