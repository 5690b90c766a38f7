"""A thousand random logs with wraps, jumps, gaps and in-between samples: no wrong turn in silence.

A step between two values that stand next to each other, but for missing samples, is *decidable* if

- the joint moved by no more than P / 4 meanwhile, and by no more than the robot's limit allows where there is
  one: whatever the file wraps, the nearest turn is the right one then. So it is, over two steps, for the
  values about an in-between sample, which itself has no turn; or
- it is a real jump that no motion explains, above P / 4 and further than P / 4 from a whole period, alone and
  with either of the steps about it, which are decidable motions: the values stay as they stand in the file
  then, and k does not change.

Where a step is not decidable the audit must have an entry: in the row of the value that may be a turn off, or
in the row before, where a pair of steps mends it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.math3d import translation
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import JointLog, LogColumn
from urmpipe_pipeline.repolarization.audit import AuditResult, audit_log

TSP_NS = 5_000_000
APART = 6
"""Rows between two events: each is judged for itself."""

SETTLED = 12
"""Rows of full speed in the beginning, by which the largest speed is known without a robot."""


@dataclass(frozen=True)
class Case:
    """A log of one joint and the truth about it, rows without a value taken out.

    Attributes:
        log: The log.
        speed: The largest speed of the joint in [rad/s].
        true: What the repolarizer should give where it can be known.
        jumps: Rows of the log to which a real jump leads.
        on_jump: Rows of the in-between samples.
    """

    log: JointLog
    speed: float
    true: FloatArray
    jumps: IntArray
    on_jump: IntArray


def random_case(seed: int) -> Case:
    rng = np.random.default_rng(seed)
    count, move = int(rng.integers(60, 200)), float(10.0 ** rng.uniform(-2.5, -0.35))
    steps = move * np.clip(1.5 * np.sin(rng.uniform(0.02, 0.3) * np.arange(count) + rng.uniform(0, 6)), -1, 1)
    steps[:SETTLED] = move * rng.choice([-1.0, 1.0])
    x = np.cumsum(steps) + rng.uniform(-3.0, 3.0)
    k = np.floor((x + np.pi) / FULL_TURN)
    q, k = x - FULL_TURN * k, k - k[0]
    kinds = rng.permutation(np.repeat(["jump", "gap", "missing"], 2))
    places = np.sort(
        rng.choice(np.arange(SETTLED + 2, count - 30, APART), min(5, (count - 50) // 8 + 1), False)
    )
    jumps: list[int] = []
    gone, empty = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    for kind, at in zip(kinds, places, strict=False):
        if kind == "jump":
            q, k = jumped(rng, q, k, int(at), move)
            jumps.append(int(at))
        else:
            length = int(rng.integers(1, APART - 3)) if rng.random() < 0.7 else 25
            (gone if kind == "gap" else empty)[at + 1 : at + 1 + length] = True
    here = np.array(jumps, dtype=np.int64)
    for beside in (here - 1, here):
        gone[beside], empty[beside] = False, False
    true = q + FULL_TURN * k
    busy = gone | empty | np.isin(np.arange(count), here)
    on_jump = [s for s in wraps_about(k) if rng.random() < 0.5 and not busy[max(s - 3, 0) : s + 4].any()]
    for s in on_jump:
        q[s] = q[s - 1] + rng.uniform(0.0, 1.0) * (q[s + 1] - q[s - 1])
    return case_of(np.where(empty, np.nan, q), true, ~gone, move, jumps, on_jump)


def wraps_about(k: FloatArray) -> list[int]:
    """Return the samples between whose neighbours the joint wraps, no two of them within four rows."""
    found: list[int] = []
    for s in (np.flatnonzero(np.abs(k[2:] - k[:-2]) == 1.0) + 1).tolist():
        if not found or s - found[-1] > 4:
            found.append(s)
    return found


def jumped(
    rng: np.random.Generator, q: FloatArray, k: FloatArray, at: int, move: float
) -> tuple[FloatArray, FloatArray]:
    """Let the joint go on from elsewhere in its interval: the step is P / 4 to 3 P / 4 but for the motion."""
    x, before = q + FULL_TURN * k, q[at - 1]
    size = rng.uniform(FULL_TURN / 4.0 + 2.5 * move, 3.0 * FULL_TURN / 4.0 - 2.5 * move)
    target = before - np.copysign(min(size, np.pi + abs(before) - 1e-6), before)
    rest = x[at:] - x[at] + target
    turns = np.floor((rest + np.pi) / FULL_TURN)
    return np.r_[q[:at], rest - FULL_TURN * turns], np.r_[k[:at], k[at - 1] + turns]


def case_of(
    q: FloatArray,
    true: FloatArray,
    kept: NDArray[np.bool_],
    move: float,
    jumps: list[int],
    on_jump: list[int],
) -> Case:
    new_row = np.cumsum(kept) - 1
    t_ns = TSP_NS * np.flatnonzero(kept)
    column = (LogColumn("q1", "q1", "joint", 0, "rad"),)
    log = JointLog("log", "table", (), t_ns, ("q1",), q[kept][:, np.newaxis], columns=column)
    at = (new_row[np.array(rows, dtype=np.int64)] for rows in (jumps, on_jump))
    return Case(log, 1.001 * move / TSP_NS * 1e9, true[kept], *at)


def audited(case: Case, known: bool) -> AuditResult:
    arm = Chain("arm", (Joint("q1", "revolute", velocity=case.speed),), tip=translation(0.1, 0.0, 0.0))
    return audit_log(case.log, arm if known else None)


def hold(case: Case, found: AuditResult) -> int:
    """Hold the law of this module; return how many steps were not decidable."""
    here = np.flatnonzero(~np.isnan(case.log.q[:, 0]))
    here = here[~np.isin(here, case.on_jump)]
    off = np.rint((found.q[here, 0] - case.true[here]) / FULL_TURN)
    motion = np.diff(case.true[here], prepend=np.nan, append=0.0)
    jumps = np.isin(here, case.jumps)
    small = np.nan_to_num(np.abs(motion[:-1])) <= FULL_TURN / 4.0
    about = np.append(True, small[:-1]) & np.append(small[1:], True)
    decidable = np.where(jumps, about & clear_of_wraps(np.nan_to_num(motion)), small)
    told = np.isin(here, [entry.row - 1 for entry in found.entries if entry.kind != "wrap"])
    near = told | np.append(False, told[:-1])  # in this row or in the one before
    changed = np.append(False, np.diff(off) != 0.0)
    undecided = ~decidable
    mended = np.append(False, undecided[:-1])
    assert not (changed & ~undecided & ~mended).any(), "a wrong turn"
    assert not (changed & ~near).any(), "a turn changed in silence"
    assert not (undecided & ~near).any(), "an open question in silence"
    assert not (jumps & decidable & ~told).any(), "a real jump in silence"
    return int(undecided.sum())


def clear_of_wraps(motion: FloatArray) -> NDArray[np.bool_]:
    """Tell which steps are no wraps: alone, with the step before, or with the one after, the last."""
    before, here, after = np.append(0.0, motion[:-2]), motion[:-1], motion[1:]
    sums = np.abs(np.array([here, here + before, here + after]))
    return np.asarray((np.abs(sums - FULL_TURN) > FULL_TURN / 4.0).all(axis=0))


@pytest.mark.slow
def test_no_turn_of_300_random_logs_goes_wrong_in_silence() -> None:
    """Every other log with a robot that tells how fast its joint is."""
    cases = [random_case(seed) for seed in range(300)]
    results = [audited(case, known=seed % 2 == 0) for seed, case in enumerate(cases)]
    undecidable = sum(hold(case, found) for case, found in zip(cases, results, strict=True))
    told = [entry.kind for found in results for entry in found.entries]
    assert {"wrap", "in-between", "unexplained", "ambiguous"} == set(told)
    assert undecidable > 30
    assert sum(len(case.on_jump) for case in cases) > 150
    assert told.count("wrap") > 300
