"""Which subset of causes is selected, against every subset fitted by NumPy."""

from __future__ import annotations

from itertools import chain, combinations
from math import comb, log

import numpy as np
import pytest

from altered_arm import called, nominal, rich_motion, times
from normal_equations import normal_of
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.fit import WeightedRows, autocorrelation_time, normal_equations
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.diagnosis.selection import MAX_GROUPS, Selection, Subset, drop_equivalent_groups

ROWS, GROUPS = 90, 7
COLUMNS: tuple[IntArray, ...] = tuple(np.array(c) for c in ([0], [1], [2, 3, 4], [5], [6], [7, 8, 9], [10]))


def problem(seed: int, *taken: int) -> tuple[FloatArray, FloatArray]:
    """A Jacobian with columns of differing units, and noise with some of the groups."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(ROWS, 11)) * 10.0 ** rng.integers(-3, 4, 11)
    y = rng.normal(size=ROWS)
    for g in taken:
        own = jacobian[:, COLUMNS[g]]
        y = y + (own / np.linalg.norm(own, axis=0)).sum(axis=1) * 12.0
    return jacobian, y


def selection_of(jacobian: FloatArray, y: FloatArray, independent: float = 60.0) -> Selection:
    return Selection(normal_of(jacobian, y), COLUMNS, independent, 1e-6, 1, 2, 20)


def scored(jacobian: FloatArray, y: FloatArray, subset: Subset, independent: float = 60.0) -> float:
    """n ln(RSS / N) + k ln n + 2 ln C(K, s) of 20 causes, besides one edit with two numbers."""
    columns = [c for g in sorted(subset) for c in COLUMNS[g]]
    square = float(y @ y)
    if columns:
        own = jacobian[:, columns]
        x = np.linalg.lstsq(own / np.linalg.norm(own, axis=0), y, rcond=None)[0]
        square = float(((y - own / np.linalg.norm(own, axis=0) @ x) ** 2).sum())
    count = len(subset) + 1
    return independent * log(square / ROWS) + (len(columns) + 2) * log(independent) + 2 * log(comb(20, count))


def every_subset() -> list[Subset]:
    return [
        frozenset(s) for s in chain(*(combinations(range(GROUPS), size) for size in range(MAX_GROUPS + 1)))
    ]


@pytest.mark.parametrize("taken", [(), (1,), (2,), (0, 5), (1, 2, 6), (0, 2, 4, 5)])
def test_scores_are_those_of_least_squares_and_the_best_of_all_subsets_is_found(
    taken: tuple[int, ...],
) -> None:
    jacobian, y = problem(1, *taken)
    selection = selection_of(jacobian, y)
    subsets = every_subset()
    ours = selection.scores(subsets)
    theirs = np.array([scored(jacobian, y, one) for one in subsets])
    # 60 ln(RSS) of squares told from normal equations, to 1e-9 of y's
    np.testing.assert_allclose(ours, theirs, atol=1e-5)
    assert selection.best(range(GROUPS)) == subsets[int(np.argmin(theirs))] == frozenset(taken)


def test_nothing_is_found_in_noise_by_fewer_independent_rows_either() -> None:
    silent = [selection_of(*problem(seed), 30.0).best(range(GROUPS)) == frozenset() for seed in range(200)]
    assert np.mean(silent) > 0.97


def test_what_lies_below_the_floor_is_not_fitted_any_further() -> None:
    jacobian, y = problem(1, 1)
    selection = Selection(normal_of(jacobian, 1e-9 * y), COLUMNS, 60.0, 1e-6, 0, 0, 20)
    assert selection.best(range(GROUPS)) == frozenset()


@pytest.mark.parametrize(("moved", "wanted"), [(2.0, frozenset({1, 2})), (0.5, frozenset({1}))])
def test_a_group_that_moves_less_than_the_floor_is_dropped_under_larger_noise(
    moved: float, wanted: Subset
) -> None:
    """Of 9000 values with noise of 1, a mean square of 0.01 is 90 times its chance; the floor is as large."""
    rng = np.random.default_rng(5)
    jacobian = rng.normal(size=(9000, 11))
    y = rng.normal(size=9000) + jacobian[:, 1] + np.sqrt(0.01 * moved / 3.0) * jacobian[:, 2:5].sum(axis=1)
    selection = Selection(normal_of(jacobian, y), COLUMNS, 9000.0, 0.01, 0, 0, 7)
    best = selection.best(range(GROUPS))
    assert best == {1, 2}
    assert selection.moving(best) == wanted


def test_twins_are_told_by_the_first_and_what_moves_nothing_not_at_all() -> None:
    jacobian, _ = problem(2)
    jacobian[:, 5] = -3.0 * jacobian[:, 1]
    jacobian[:, 6] = 0.0
    normal = normal_of(jacobian, np.zeros(ROWS))
    stand, twins = drop_equivalent_groups(normal, COLUMNS, np.diag(normal.gram))
    assert stand == [0, 1, 2, 5, 6]
    assert twins == {3: 1}
    stand, twins = drop_equivalent_groups(normal, COLUMNS, np.diag(normal.gram), (3,))
    assert stand == [0, 2, 3, 5, 6]
    assert twins == {1: 3}


PLAIN = (
    "link_length", "tilt", "joint_offset", "joint_scale", "time_lag", "clock_drift",
    "base_shift", "base_rotation", "tool_shift",
)  # fmt: skip
"""What an arm is known by, its joints, base, tool and clock."""


def urm6_gram() -> tuple[FloatArray, dict[str, int]]:
    """The Gram matrix of urm6's numbers on a rich motion, columns of unit length, and their places."""
    arm = load_robot("urm6")
    model = nominal(arm, rich_motion(arm), times(500))
    zero = State(np.zeros(sum(len(group.columns) for group in model.groups)))
    gram = normal_equations(model, zero, WeightedRows(np.arange(500), np.ones(3))).gram
    size = np.maximum(np.sqrt(np.diag(gram)), 1e-9)  # gravity does not pull at an upright axis
    places = {
        f"{group.name} {'xyz'[k]}" if len(group.columns) > 1 and group.kind.endswith("shift") else
        f"{group.kind}:{group.name} {k}": c
        for group in model.groups for k, c in enumerate(group.columns)
        if group.kind in PLAIN and not ("segment" in group.name or called(group).endswith((" x", " y", " z")))
    }  # fmt: skip
    return gram / np.outer(size, size), places


def test_positions_of_urm6_do_not_tell_seven_of_its_numbers() -> None:
    gram, at = urm6_gram()

    def rank(*names: str) -> int:
        own = [at[name] for name in names]
        return int(np.linalg.matrix_rank(gram[np.ix_(own, own)], tol=1e-9, hermitian=True))

    assert rank("link_length:r1 0", "base z") == 1
    assert rank("joint_offset:phi1 0", "base_rotation:base 2") == 1
    assert rank("link_length:r7 0", "tool z") == 1
    assert rank("tilt:theta7 0", "tool x") == 1
    assert rank("joint_offset:phi6 0", "tool y") == 1
    wrist = ("link_length:r6", "link_length:r7", "tilt:theta7", "joint_offset:phi6")
    assert rank(*(f"{name} 0" for name in wrist), "tool x", "tool y", "tool z") == 3
    assert rank(*at) == len(at) - 6


@pytest.mark.parametrize("a", [0.0, 0.5, 0.9, 0.98])
def test_the_autocorrelation_time_of_a_first_order_process(a: float) -> None:
    """Tau = (1 + a) / (1 - a)."""
    from scipy.signal import lfilter

    white = np.random.default_rng(3).normal(size=(120_000, 3))
    wanted = (1.0 + a) / (1.0 - a)
    # relative error of the estimate: sqrt(2 (2 M + 1) / N), with a window M of a few tau and three components
    assert autocorrelation_time(lfilter([1.0], [1.0, -a], white, axis=0)) == pytest.approx(wanted, rel=0.12)


def test_it_does_not_depend_on_the_unit_and_is_one_of_nothing() -> None:
    values = np.cumsum(np.random.default_rng(4).normal(size=(500, 2)), axis=0)
    assert autocorrelation_time(1e-6 * values) == pytest.approx(autocorrelation_time(values), rel=1e-9)
    assert autocorrelation_time(np.zeros((100, 3))) == 1.0
    assert autocorrelation_time(values[:3]) == 1.0
