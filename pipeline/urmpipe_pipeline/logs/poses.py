"""Rows that are static poses: calibration grids, random configurations, points measured one by one.

No motion joins them, so a clock of theirs is a label. They are known by the steps between rows that differ (a
pose may be measured several times): no joint makes them in the time that is assumed, and they continue in no
direction, or in straight lines with jumps from each to the next. A motion is smooth, however coarse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Hint
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.clocks.clock import PAPER_PERIOD
from urmpipe_pipeline.logs.clocks.clock_columns import GIVEN
from urmpipe_pipeline.logs.clocks.clock_units import in_si
from urmpipe_pipeline.logs.columns.blocks import period_of
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.tables.numbers import UNREADABLE, Numbers

FASTEST = 20.0  # [rad/s] or [m/s], which no joint of an arm exceeds from pose to pose

STEP = (
    FASTEST * PAPER_PERIOD
)  # median step of static poses in [rad] or [m]: none is made in the assumed period
REST = STEP / 10  # rows with smaller steps are of one pose
REST_SHARE = (
    0.1  # ... if these add up to less than this share of the others, which are this share of the rows
)

TURNED = 0.8
"""Static poses change their steps by this share of them at least: of a motion with n samples in its shortest
period it is 2 sin(pi / n), of random configurations 1.4 or more."""

TURNING = 0.75
"""The quantile at which that is told: a grid goes straight on for some poses, a log has single spikes."""

JUMPS = 0.03
"""Share of the steps of a grid, three at least, that are twice as long as those before and after them. In a
motion with n samples in its shortest period these add up to twice the step times cos(2 pi / n)."""

APART = 2e9
"""Rows so many [ns] apart, in the median, are no samples of a motion that steps so."""

IMPOSSIBLE = 0.1
"""Share of the times that repeat or run backwards from which a clock is a label; a damaged one has less."""

LEAST_ROWS = 6
"""Fewer rows tell nothing."""

BLOCKS, BLOCK = 8, 500
"""Blocks of so many rows, spread evenly, decide."""


LIKE_POSES = f"no clock, and half of the steps are of {STEP:g} rad (or m) and more, as between static poses"


def as_poses(plan: Plan, columns: Sequence[Column], numbers: Numbers) -> Numbers:
    """Return numbers as static poses without a clock, if the user says so or they show it; else as they are.

    Args:
        plan: What is read: `poses` says whether they are, or None where the rows are to tell.
        columns: The columns of the numbers.
        numbers: The rows of a table.
    """
    why = "given as an option" if plan.poses else _evidence(plan, columns, numbers)
    if why == LIKE_POSES:
        both = (Hint("poses", True, "reads them as static poses"), Hint("period", None, "confirms a motion"))
        warning = LogWarning("like-poses", f"{why}: read as a motion", hints=both, role="time")
        return replace(numbers, warnings=(*numbers.warnings, warning))
    if not why:
        return numbers
    clock = plan.clock.columns
    moving = Hint("time", clock[0].called) if clock else Hint("period")
    hints = () if plan.poses else (replace(moving, effect="reads them as a motion"),)
    found = Inference("rows", "static poses", why, hints=hints)
    return replace(numbers, clock=None, texts=(), still=True, inferences=(found,), warnings=())


def _evidence(plan: Plan, columns: Sequence[Column], numbers: Numbers) -> str:
    """Return why the rows of a table are static poses, or may be; empty if nothing shows it."""
    if plan.poses is None and _written_untimed(plan):
        return "urmpipe wrote them without times"
    joints = [columns.index(joint) for joint in plan.roles.joints if joint in columns]
    count = len(numbers.values)
    if plan.poses is False or not joints or len(joints) < len(plan.roles.joints) or count < LEAST_ROWS:
        return ""
    rows = np.arange(count)
    if count > BLOCKS * BLOCK:
        rows = np.add.outer(np.linspace(0, count - BLOCK, BLOCKS).astype(np.int64), np.arange(BLOCK)).ravel()
    q, turns = in_si(
        numbers.values[rows[:, np.newaxis], joints], plan.roles.joints, plan.units, plan.tables.known
    )
    rows, q = rows[known := np.isfinite(q).all(axis=1)], q[known]
    steps = np.diff(q, axis=0)
    steps -= np.rint(steps / FULL_TURN) * turns
    size = np.abs(steps).max(axis=1)
    moves = np.flatnonzero(size > REST)
    rests = size.sum() - size[moves].sum()
    if len(moves) < max(LEAST_ROWS - 1, REST_SHARE * len(size)) or rests > REST_SHARE * size[moves].sum():
        return ""
    steps, size = steps[moves], size[moves]
    rates = [columns.index(rate) for rate in plan.roles.rates if rate in columns]
    if _quantile(size, 0.5) <= STEP or (
        rates and period_of(numbers.values[:, joints], numbers.values[:, rates])
    ):
        return ""
    usual, turned = np.linalg.norm(steps, axis=1), np.linalg.norm(np.diff(steps, axis=0), axis=1)
    said = f"the joints step by up to {size.max():.2g} {'rad' if turns.any() else 'm'} from row to row, in"
    aimless = _quantile(turned, TURNING) >= TURNED * _quantile(usual, TURNING)
    if numbers.clock is not None:
        times = numbers.clock[np.stack([rows[moves], rows[moves + 1]])]
        return _label(plan, times, f"{said} no direction") if aimless else ""
    jumps = np.count_nonzero(usual[1:-1] > 2 * np.maximum(usual[:-2], usual[2:]))
    lines = jumps >= max(3, JUMPS * len(usual))
    why = f"no clock, and {said} {'no direction' if aimless else 'lines with jumps between them'}"
    return why if aimless or lines else LIKE_POSES


def _written_untimed(plan: Plan) -> bool:
    """Return whether urmpipe wrote joints without times: it does so of static poses alone."""
    known, clock = plan.tables.known, plan.clock
    named = any(one.evidence == GIVEN for one in clock.inferences)  # left out on request
    return known is not None and known.own and bool(plan.roles.joints) and not (clock.columns or named)


def _label(plan: Plan, times: IntArray, said: str) -> str:
    """Return why a clock is a label; empty if it may be that of a motion.

    Its times before and after some steps of the joints are in integer [ns], shape (2, n).
    """
    timed = (times > UNREADABLE).all(axis=0)
    passed, name = np.diff(times[:, timed], axis=0)[0], plan.clock.columns[0].name
    if not len(passed):
        return ""
    stands = float(np.mean(passed <= 0))
    if stands >= IMPOSSIBLE:
        return f"{said}, and {name} repeats or runs backwards in {stands:.0%} of them"
    apart = _quantile(np.abs(passed), 0.5)
    return f"{said}, and {name} says that {apart / 1e9:.3g} s pass" if apart >= APART else ""


def _quantile(values: FloatArray, share: float) -> float:
    """Return a quantile of some values (np.quantile imports numpy.ma)."""
    at = int(share * (len(values) - 1))
    return float(np.partition(values, at)[at])
