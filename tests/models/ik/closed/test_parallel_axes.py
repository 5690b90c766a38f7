"""Arms with three parallel axes: every pose is met, alone and among others, by any such arm."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import there
from parallel_arms import EXACT, UR, WRISTS, apart, assert_every_solution_meets, form_of, poses, random_arm
from urmpipe_models.errors import OptionError
from urmpipe_models.ik.parallel import parallel_axes
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.kinematics.forward import chain_to_screws
from urmpipe_models.robots.catalogue import load_robot


@pytest.mark.slow
@pytest.mark.parametrize("name", UR)
def test_fk_of_ik_is_the_pose_of_ten_thousand_and_the_joints_it_came_from_are_found(name: str) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 10_000)
    solutions = form_of(chain).solve(targets)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    # of 10,000 poses the one nearest to a singular pose parts from its joints by the root of the rounding
    assert apart(solutions, q).max() < 1e-6
    assert solutions.reached.all(axis=1).mean() > 0.6


@pytest.mark.slow
@pytest.mark.parametrize("wrist", WRISTS)
def test_random_arms_with_any_twist_base_and_tool_are_solved(wrist: str) -> None:
    rng = np.random.default_rng(7)
    for number in range(40):
        chain = random_arm(rng, wrist, ((1, 1), (1, -1), (-1, 1), (-1, -1))[number % 4])
        q, targets = poses(chain, 100, number)
        solutions = form_of(chain).solve(targets)
        assert_every_solution_meets(chain, targets, solutions, EXACT)
        assert apart(solutions, q).max() < 1e-6  # near singular poses: the root of the rounding


@pytest.mark.slow
def test_axes_5_and_6_that_pass_each_other_closely_leave_all_digits() -> None:
    rng = np.random.default_rng(9)
    for number in range(30):
        chain = random_arm(rng, "pass", spread=0.05)
        q, targets = poses(chain, 100, number)
        solutions = form_of(chain).solve(targets)
        assert_every_solution_meets(chain, targets, solutions, 1e-12)  # 1e-11 without the last polish
        assert apart(solutions, q).max() < 1e-5


@pytest.mark.parametrize("passing", [1e-3, 1e-4, 1e-5, 1e-7, 1e-9])
def test_axes_5_and_6_that_all_but_meet_are_left_to_the_iterative_solver(passing: float) -> None:
    of_chain = there(chain_to_screws(load_robot("ur5e")))
    point = of_chain.point.copy()
    point[5] += passing * np.cross(of_chain.direction[4], of_chain.direction[5])
    assert parallel_axes(replace(of_chain, point=point), ("a",) * 6) is None


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(WRISTS))
def test_one_pose_alone_is_solved_as_among_many(seed: int, wrist: str) -> None:
    chain = random_arm(np.random.default_rng(seed), wrist)
    _, targets = poses(chain, 5, seed)
    form = form_of(chain)
    together = form.solve(targets)
    for row in range(5):
        alone = form.solve(targets.rows(slice(row, row + 1)))
        np.testing.assert_array_equal(alone.reached[0], together.reached[row])
        np.testing.assert_allclose(alone.q[0], together.q[row], atol=1e-9)


def test_positions_alone_are_refused() -> None:
    form = form_of(load_robot("ur5e"))
    with pytest.raises(OptionError) as caught:
        form.solve(Targets(np.zeros((1, 3))))
    assert str(caught.value) == "three parallel axes: found positions with any orientation, allowed: poses"


@pytest.mark.parametrize(
    "fault", ["axis 3 tilted", "axis 4 tilted", "links of no length", "axis 1 parallel", "axis 5 parallel"]
)
def test_what_has_another_geometry_is_not_recognised(fault: str) -> None:
    of_chain = there(chain_to_screws(load_robot("ur5e")))
    direction, point = of_chain.direction.copy(), of_chain.point.copy()
    if fault in {"axis 3 tilted", "axis 4 tilted"}:  # a calibrated arm: 1e-6 rad is 1 um at 1 m
        tilted = int(fault.split()[1]) - 1
        direction[tilted] = np.array((math.sin(1e-6), *direction[tilted][1:]))
        direction[tilted] /= np.linalg.norm(direction[tilted])
    if fault == "links of no length":
        point[2] = point[1]
    if fault == "axis 1 parallel":
        direction[0] = direction[1]
    if fault == "axis 5 parallel":
        direction[4] = direction[1]
    assert parallel_axes(replace(of_chain, direction=direction, point=point), ("a",) * 6) is None
