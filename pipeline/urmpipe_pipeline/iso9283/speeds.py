"""Speed on the straight legs of a path: accuracy, repeatability and fluctuation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import CommandLeg
from urmpipe_pipeline.iso9283.motion import Motion


@dataclass(frozen=True, slots=True)
class LegSpeed:
    """The speed of all cycles on the middle half of a leg.

    Attributes:
        name: What the leg is called, such as "leg 1".
        begins: Arc length at which its middle half begins in [m].
        ends: Arc length at which it ends in [m].
        commanded: v_c in [m/s].
        mean: Mean speed of all cycles in [m/s].
        accuracy: AV = (mean - v_c) / v_c [-].
        repeatability: RV = 3 S of the cycles' mean speeds / v_c [-]; None of one cycle.
        fluctuation: FV: largest v_max - v_min of a cycle in [m/s]; None where none has two rows there.
    """

    name: str
    begins: float
    ends: float
    commanded: float
    mean: float
    accuracy: float
    repeatability: float | None
    fluctuation: float | None


def leg_speed(name: str, leg: CommandLeg, cycles: Sequence[Motion], times: FloatArray) -> LegSpeed:
    """Return how fast cycles run along a leg, over its middle half.

    The mean speed of a cycle is the length of the middle half over the time between the planes at its ends;
    v_max and v_min are of the speed along the leg from row to row between them.

    Args:
        name: What the leg is called.
        leg: The leg.
        cycles: The cycles.
        times: When each passes the two planes in [s], shape (n, 2).

    Source: after ISO 9283, from common knowledge.
    """
    means = leg.length / (times[:, 1] - times[:, 0])
    spread = 3.0 * float(means.std(ddof=1)) / leg.speed if len(means) > 1 else None
    spans = [
        span for one, ends in zip(cycles, times, strict=True) if (span := _span(one, leg, ends)) is not None
    ]
    mean = float(means.mean())
    return LegSpeed(
        name, leg.begins, leg.ends, leg.speed, mean, (mean - leg.speed) / leg.speed, spread,
        max(spans, default=None),
    )  # fmt: skip


def _span(cycle: Motion, leg: CommandLeg, ends: FloatArray) -> float | None:
    """Return v_max - v_min of a cycle between two times in [s], shape (2,), in [m/s]; None of few rows."""
    rows = np.flatnonzero((cycle.t >= ends[0]) & (cycle.t <= ends[1]))
    if len(rows) < 2:
        return None
    speed = (np.diff(cycle.position[rows], axis=0) @ leg.direction) / np.diff(cycle.t[rows])
    return float(np.ptp(speed))
