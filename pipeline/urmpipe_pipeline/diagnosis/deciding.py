"""Which joint would have to move so that two explanations of a log can be told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.diagnosis.arm import ArmModel
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.diagnosis.motion import Clock, Motion
from urmpipe_pipeline.diagnosis.result import rms

SWEEP = 1.5
"""How far each joint is moved to both sides, in [rad]; one that slides by so many fifths of a [m]."""

TELLING = 2.0
"""A joint decides if its motion sets two explanations so many times further apart than the log does."""

GOLDEN = 0.6180339887498949
"""Multiples of the golden ratio, without their whole part, fill an interval evenly in mixed order."""


def deciding_joint(model: ArmModel, first: State, second: State, rows: IntArray) -> int | None:
    """Return the joint whose motion sets two explanations furthest apart; None if none does clearly.

    Args:
        model: The arm, beside where it should be.
        first: An explanation.
        second: Another.
        rows: Poses of the log from which each joint is moved in turn, shape (n,).
    """
    own = _apart(model, first, second, rows)
    swept = np.arange(len(rows))
    count = len(model.chain.moving)
    apart = [_apart(_with_moved(model, j, rows), first, second, swept) for j in range(count)]
    best = int(np.argmax(apart))
    return best if apart[best] > TELLING * own else None


def _apart(model: ArmModel, first: State, second: State, rows: IntArray) -> float:
    """Return how far two explanations put the tool centre point apart, root mean square in [m]."""
    return rms((model.deviation(first, rows) - model.deviation(second, rows)).T)


def _with_moved(model: ArmModel, j: int, rows: IntArray) -> ArmModel:
    """Return the same poses with one joint moved far to both sides."""
    q = model.motion.at(model.clock.t[rows])[0].copy()
    reach = SWEEP / 5.0 if model.chain.moving[j].kind == "prismatic" else SWEEP
    q[j] += reach * (2.0 * np.modf(np.arange(len(rows)) * GOLDEN)[0] - 1.0)
    t, none = np.arange(len(rows), dtype=float), np.zeros_like(q)
    rotation = None if model.rotation is None else model.rotation[:, :, rows]
    return replace(
        model, motion=Motion(t, q, none, none), clock=Clock(t, -1.0, t), sample=model.sample[rows],
        position=model.position[:, rows], rotation=rotation, judged=None,
    )  # fmt: skip
