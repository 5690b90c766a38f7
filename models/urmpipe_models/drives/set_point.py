"""Set points of one joint as closed forms of time: a step, a ramp, a trapezoid of velocity.

Each starts at `begin` and goes from `initial` to `target`. Values at a corner are those after it.

    step        at once; velocity and acceleration stay 0 (their impulses are left out)
    ramp        with the largest velocity all the way; acceleration stays 0 (its impulses are left out)
    trapezoid   with the largest acceleration to the largest velocity, on with it, and down again; a move
                too short for that is a triangle, which turns back halfway
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import Element

STEP, RAMP, TRAPEZOID = 0, 1, 2
"""The kinds, as numbers, for `set_point`."""


CORNER_SLACK = 1e-9
"""A corner counts as reached so early, in [s]: times that are computed miss it by their rounding."""


class JointMotion(NamedTuple):
    """Where a joint is or shall be.

    Attributes:
        position: Angle in [rad].
        velocity: Its rate in [rad/s].
        acceleration: Its second derivative in [rad/s2].
    """

    position: Element
    velocity: Element
    acceleration: Element


def step(time: Element, begin: Element, initial: Element, target: Element) -> JointMotion:
    """Return the step: `initial` before `begin`, `target` from then on.

    Args:
        time: In [s].
        begin: When it steps, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
    """
    return JointMotion(np.where(_reached(time, begin), target, initial), 0.0 * time, 0.0 * time)


def ramp(time: Element, begin: Element, initial: Element, target: Element, speed: Element) -> JointMotion:
    """Return the ramp, which takes |target - initial| / speed.

    Args:
        time: In [s].
        begin: When it starts, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
        speed: Largest velocity in [rad/s], above 0.
    """
    way, direction = np.abs(target - initial), np.sign(target - initial)
    end = begin + way / speed
    gone = np.maximum(time - begin, 0.0) * speed
    moving = _since(time, begin) - _since(time, end)
    position = np.where(_reached(time, end), target, initial + direction * gone)
    return JointMotion(position, direction * speed * moving, 0.0 * time)


def trapezoid(
    time: Element,
    begin: Element,
    initial: Element,
    target: Element,
    speed: Element,
    acceleration: Element,
) -> JointMotion:
    """Return the move with a trapezoid of velocity.

    It speeds up for t_a = min(v / a, sqrt(way / a)), keeps its velocity for way / v - v / a, but not below
    0, and slows down for t_a. Both t_a and the time between are finite for a way of 0.

    Args:
        time: In [s].
        begin: When it starts, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
        speed: v, the largest velocity in [rad/s], above 0.
        acceleration: a, the largest acceleration in [rad/s2], above 0.
    """
    way, direction = np.abs(target - initial), np.sign(target - initial)
    rise = np.minimum(speed / acceleration, np.sqrt(way / acceleration))
    cruise = np.maximum(way / speed - speed / acceleration, 0.0)
    total = 2.0 * rise + cruise
    since = time - begin
    up = _within(since, rise)
    level = _within(since - rise, cruise)
    down = _within(since - rise - cruise, rise)
    peak = acceleration * rise
    gone = 0.5 * acceleration * up * up + peak * level + (peak - 0.5 * acceleration * down) * down
    # 1 while it speeds up, 0 after that, -1 while it slows down, 0 before and after.
    phase = _since(since, 0.0) - _since(since, rise) - _since(since, rise + cruise) + _since(since, total)
    return JointMotion(
        np.where(_reached(since, total), target, initial + direction * gone),
        direction * acceleration * (up - down),
        direction * acceleration * phase,
    )


def set_point(
    kind: Element,
    time: Element,
    begin: Element,
    initial: Element,
    target: Element,
    speed: Element,
    acceleration: Element,
) -> JointMotion:
    """Return the set point of a kind: where the joint shall be at that time.

    Args:
        kind: 0 for `step`, 1 for `ramp`, 2 for `trapezoid`.
        time: In [s].
        begin: When it starts, in [s].
        initial: Where from, in [rad].
        target: Where to, in [rad].
        speed: Of the ramp, and the largest of the trapezoid, in [rad/s], above 0; a step needs none.
        acceleration: The largest of the trapezoid, in [rad/s2], above 0; the others need none.
    """
    forms = (
        step(time, begin, initial, target),
        ramp(time, begin, initial, target, speed),
        trapezoid(time, begin, initial, target, speed, acceleration),
    )
    return JointMotion(
        *(
            np.where(kind == STEP, stepped, np.where(kind == RAMP, ramped, rounded))
            for stepped, ramped, rounded in zip(*forms, strict=True)
        )
    )


def _within(time: Element, duration: Element) -> Element:
    """Return how much of a stretch that starts at 0 is over."""
    return np.minimum(np.maximum(time, 0.0), duration)


def _reached(time: Element, corner: Element) -> Element:
    """Return whether a time is not before a corner."""
    return time >= corner - CORNER_SLACK


def _since(time: Element, corner: Element) -> Element:
    """Return 1 from a corner on, 0 before it."""
    return np.where(_reached(time, corner), 1.0, 0.0)
