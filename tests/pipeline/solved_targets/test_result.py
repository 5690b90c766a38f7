"""Solved targets: their verdict by data, and what does not fit together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import urmpipe
from solved import solved
from urmpipe_models.errors import LogError
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.robots.catalogue import load_robot

UR5E = load_robot("ur5e")
Q = np.array([[0.1, -0.9, 1.2, -0.5, 0.7, 0.2]])


def test_the_verdict_is_that_of_the_data() -> None:
    """Every target reached, without a jump and without a joint that is too fast: nothing else counts."""
    q = np.tile(Q, (30, 1))
    calm = urmpipe.ik(forward_targets(UR5E, q), UR5E, tsp=0.01, start=q[0].tolist())
    assert calm.verdict == "pass"
    q[:, 0] += 0.05 * np.arange(30)  # 5 rad/s; the joint is allowed 3.14
    fast = urmpipe.ik(forward_targets(UR5E, q), UR5E, tsp=0.01, start=q[0].tolist())
    assert fast.path is not None
    assert (fast.verdict, bool(fast.reached.all()), len(fast.path.jumps)) == ("fail", True, 0)
    assert replace(fast, path=replace(fast.path, speed_violations=())).verdict == "pass"
    assert replace(calm, path=fast.path).verdict == "fail"
    missed = replace(calm.solutions, q=np.where(np.arange(30)[:, None, None] == 7, np.nan, calm.solutions.q))
    assert replace(calm, solutions=missed).verdict == "fail"
    assert replace(calm, warnings=fast.as_run().warnings).verdict == "pass"


def test_all_that_does_not_fit_together_is_told_at_once() -> None:
    good = solved("path", UR5E, np.tile(Q, (3, 1)), np.array([0, 5, 7]))
    with pytest.raises(LogError) as error:
        replace(good, t_ns=np.array([0, 5, 5]), row=np.arange(2), position_error=np.zeros((3, 2)))
    assert {one.file for one in error.value.findings} == {"path"}
    assert [str(one) for one in error.value.findings] == [
        "path: found rows of shape (2,), allowed: (3,)",
        "path: found distances of shape (3, 2), allowed: (3, 1)",
        "path: found times that do not rise, allowed: rising times",
    ]
    with pytest.raises(LogError, match="found no target, allowed: one or more"):
        solved("none", UR5E, np.empty((0, 6)))
    with pytest.raises(LogError, match="found 5 joints, allowed: 6"):
        solved("five", UR5E, np.zeros((2, 5)), targets=forward_targets(UR5E, np.zeros((2, 6))))
