"""Joints among columns without names: as many as the arm has, proved by their rates, or asked about."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.errors import Hint
from urmpipe_pipeline.logs.columns.blocks import SURE, proved_blocks
from urmpipe_pipeline.logs.columns.columns import Column, listed
from urmpipe_pipeline.logs.columns.questions import TIMES_OF_ANOTHER, UNKNOWN, which_joints
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.whole import Whole

TWO_TURNS = 720.0, 2.0 * math.tau
"""No joint of an arm goes further either way in [deg] and in [rad], as clocks, wheels and counts do."""

SELDOM = 0.2
"""A column that moves in a smaller share of the rows than others do, by this factor, may be a gripper's."""

MOST_UNASKED = 7
"""So many columns without names are joints where no robot tells how many there are; more may be blocks."""

FEW = 3
"""So few joints may go on as others say by chance, where no robot tells how many there are."""

USUAL = (6, 7, 5, 4)
"""How many joints arms have, the usual first."""

Found = tuple[tuple[Column, ...], tuple[Column, ...], str]
"""Joints, their rates, and why."""


def joints_among(free: Sequence[Column], layout: Layout, whole: Whole | None, robot: Chain | None) -> Found:
    """Return the joints among columns without names, their rates, and why.

    They are all columns, if these are as many as the robot has joints; those whose rates stand beside them;
    without a robot all of a few columns that move alike.

    Raises:
        LogError: With the question which they are, if none of that holds.
    """
    count = len(robot.coordinates) if robot else None
    if whole is None or (count is not None and len(free) <= count):
        return tuple(free), (), f"no header: joints in order{', as many as the robot has' if robot else ''}"
    values = whole.values([column.index for column in free])
    if count is None and len(layout.names) == 1 and len(values) > FEW and (np.diff(values[:, 0]) > 0).all():
        found = "one column, which always increases, as times do"
        raise which_joints(layout.file, found, [free], UNKNOWN, TIMES_OF_ANOTHER)
    blocks = proved_blocks(values, count)
    if (
        len(blocks) == 1
        and blocks[0].fills(len(free))
        and (count or len(blocks[0].joints) > FEW or blocks[0].weakest >= SURE)
    ):
        joints, rates = (tuple(free[k] for k in some) for some in (blocks[0].joints, blocks[0].rates))
        alike = f"steps and rates correlate by {blocks[0].correlation:.3g}"
        return joints, rates, f"columns {listed(rates)} are their rates: {alike}"
    odd = unlike_joints(values)
    if not blocks and count is None and len(free) <= MOST_UNASKED and not odd.any():
        return tuple(free), (), "no header: joints in order"
    groups = [[free[k] for k in block.joints] for block in blocks] + _groups(free, odd, count)
    others = [column for column, is_odd in zip(free, odd, strict=True) if is_odd]
    found = f"{len(free)} columns that no header names"
    found += f", of which {listed(others)} may be no joints" if others else ""
    found += f", and robot {robot.name} has {count} joints" if robot else ""
    path = (Hint("source", "path", "reads them as x, y, z"),) if len(free) == 3 else ()
    raise which_joints(layout.file, found, groups, UNKNOWN, *path)


def unlike_joints(values: FloatArray) -> BoolArray:
    """Return which columns are unlike joints, or unlike the others, shape (columns,).

    They go further than any arm's joint, or than one in rad where most of the others do not; they move seldom
    while others do; or they count.

    Args:
        values: The columns in the file's own units, shape (n, columns); NaN where a sample is missing.
    """
    if len(values) < 2:
        return np.zeros(values.shape[1], dtype=bool)
    size = np.sort(np.abs(values), axis=0)[math.ceil(0.9 * (len(values) - 1))]  # NaN counts as the largest
    in_rad = int(2 * np.count_nonzero(size <= TWO_TURNS[1]) > len(size))
    steps = np.diff(values, axis=0)
    moves = (steps != 0.0).mean(axis=0)
    with np.errstate(invalid="ignore"):  # infinite numbers have no remainder
        whole = (values[0] % 1.0 == 0.0) & (steps[0] % 1.0 == 0.0)
    counts = whole & (steps[0] > 0.0) & (steps == steps[0]).all(axis=0)
    seldom = (moves > 0.0) & (moves < SELDOM * np.median(moves))
    return np.asarray((size > TWO_TURNS[in_rad]) | seldom | (counts & (len(values) > FEW)))


def _groups(free: Sequence[Column], odd: BoolArray, count: int | None) -> list[Sequence[Column]]:
    """Return the columns that may be all joints: those between odd ones, or blocks of one size."""
    runs = [
        [free[k] for k, _ in run]
        for is_odd, run in groupby(enumerate(odd), lambda pair: bool(pair[1]))
        if not is_odd
    ]
    near = sorted((run for run in runs if 1 < len(run) < len(free)), key=len, reverse=True)
    if count:
        return [run for run in (*near, free[:count], free[-count:]) if len(run) == count]
    if len(free) <= MOST_UNASKED:
        return [*near[:1], free]
    groups = [
        free[k : k + size]
        for size in USUAL
        for k in (range(0, len(free), size) if len(free) % size == 0 else (0,))
    ]
    return [*groups, *near[:1], free]
