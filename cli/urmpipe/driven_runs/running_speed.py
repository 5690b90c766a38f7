"""The running speed: the largest velocity within a limit, looked for from below."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from urmpipe_pipeline.accuracy.result import FASTEST, FINE, SLOWEST

AT_ONCE = 2
"""So many halvings are run at once, with all velocities that they may need: the processors share them."""

Within = Callable[[Sequence[float]], Sequence[bool]]
"""Runs some velocities in [m/s]; tells of each whether it is within the limit."""


def running_speed(within: Within, begun: Sequence[float]) -> float | None:
    """Return the largest velocity within the limit in [m/s], to 1 %; None if none is from 0.01 m/s on.

    From below: of the velocities that were run, the first that is not within the limit bounds it, whatever
    those above it do. Between it and the last one below the ratio is halved until it is 1 % or less. At
    10 m/s the search ends.

    Args:
        within: Runs velocities, and tells of each whether it is within the limit.
        begun: Velocities in [m/s] to begin with.
    """
    low, high = _bracket(within, sorted({min(max(one, SLOWEST), FASTEST) for one in begun}))
    if low is None or high is None:
        return low
    while high / low > FINE:
        middles = _inner(low, high, AT_ONCE)
        held = dict(zip(middles, within(middles), strict=True))
        while middles and high / low > FINE:
            middle = middles[len(middles) // 2]
            low, high = (middle, high) if held[middle] else (low, middle)
            middles = [one for one in middles if low < one < high]
    return low


def _bracket(within: Within, begun: Sequence[float]) -> tuple[float | None, float | None]:
    """Return the last velocity within the limit and the first that is not; None where there is none."""
    held = within(begun)
    if not held[0]:
        high = begun[0]
        while high > SLOWEST:
            low = max(high / 2.0, SLOWEST)
            if within([low])[0]:
                return low, high
            high = low
        return None, high
    first = next((k for k, one in enumerate(held) if not one), None)
    if first is not None:
        return begun[first - 1], begun[first]
    low = begun[-1]
    while low < FASTEST:
        high = min(2.0 * low, FASTEST)
        if not within([high])[0]:
            return low, high
        low = high
    return low, None


def _inner(low: float, high: float, halvings: int) -> list[float]:
    """Return the velocities that part a ratio into 2^halvings equal ones, without its ends."""
    parts = 2**halvings
    return [low * (high / low) ** (k / parts) for k in range(1, parts)]
