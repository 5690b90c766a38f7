"""Fits and selections of subsets, against SciPy's least squares, and every subset fitted by NumPy."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, combinations
from math import comb, log

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from altered_arm import altered, called, nominal, rich_motion, state_of, times, uniform
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis import fit
from urmpipe_pipeline.diagnosis.fit import (
    NormalEquations,
    WeightedRows,
    autocorrelation_time,
    fit_parameters,
    normal_equations,
)
from urmpipe_pipeline.diagnosis.hypotheses import Group, State
from urmpipe_pipeline.diagnosis.models import ArmModel
from urmpipe_pipeline.diagnosis.selection import MAX_GROUPS, Selection, Subset, drop_equivalent_groups

URM6 = load_robot("urm6")
SAMPLES = 400
ALL = WeightedRows(np.arange(SAMPLES), np.ones(3))
WEIGHTED = ALL._replace(weight=np.array([1.0, 2.0, 0.5]))
CAUSES = {
    "link_length:r3": np.array([0.02]),
    "tilt:theta5": np.array([-0.05]),
    "joint_offset:phi2": np.array([0.1]),
    "joint_scale:phi4": np.array([0.02]),
    "base_rotation:base": np.array([0.05, -0.1, 0.2]),
    "time_lag:clock": np.array([0.08]),
}
"""Large ones: a step from no change is not enough."""


@pytest.fixture(scope="module")
def model() -> ArmModel:
    """A log with these causes and +-3.5 mm."""
    clean = nominal(URM6, rich_motion(URM6), times(SAMPLES))
    position, _ = altered(clean, rich_motion(URM6), CAUSES)
    return replace(clean, position=uniform(np.random.default_rng(5), position))


def groups_of(model: ArmModel, *causes: str) -> list[Group]:
    return [group for group in model.groups if called(group) in causes]


def test_a_fit_is_that_of_scipy(model: ArmModel) -> None:
    groups, zero = groups_of(model, *CAUSES), state_of(model, {})
    columns = [c for group in groups for c in group.columns]
    rows = WEIGHTED._replace(at=np.arange(20, SAMPLES - 20))

    def left(x: FloatArray) -> FloatArray:
        values = np.zeros_like(zero.values)
        values[columns] = x
        return (model.residual(State(values), rows.at) * rows.weight[:, np.newaxis]).ravel()

    theirs = least_squares(left, np.zeros(len(columns)), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    ours = fit_parameters(model, zero, groups, rows)
    # ours rests where a step takes 1e-8 of the square: 1e-4 of a standard deviation
    slopes = np.asarray(theirs.jac)
    variance = 2.0 * theirs.cost / len(theirs.fun)
    deviations = np.sqrt(variance * np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert np.abs((ours.values[columns] - theirs.x) / deviations).max() < 0.02
    assert fit.cost(model, ours, rows) <= variance * (1.0 + 1e-8)
    assert not np.delete(ours.values, columns).any()


def test_other_parameters_stay_if_they_are_kept(model: ArmModel) -> None:
    start = state_of(model, CAUSES)
    (group,) = groups_of(model, "joint_offset:phi2")
    kept, single = (fit_parameters(model, start, [group], ALL, keep_others=keep) for keep in (True, False))
    others = np.delete(np.arange(len(start.values)), group.columns)
    np.testing.assert_array_equal(kept.values[others], start.values[others])
    assert not single.values[others].any()


def test_normal_equations_are_those_of_the_rows_that_are_known(model: ArmModel) -> None:
    state = state_of(model, CAUSES)
    normal = normal_equations(model, state, WEIGHTED)
    left, jacobian = model.linear(state, WEIGHTED.at)
    known = np.isfinite(left).all(axis=0)
    assert not known.all()  # the lag leads out of the log
    y = (left + np.tensordot(state.values, jacobian, 1))[:, known] * WEIGHTED.weight[:, np.newaxis]
    flat = (jacobian[:, :, known] * WEIGHTED.weight[:, np.newaxis]).reshape(len(jacobian), -1)
    size = np.sqrt(np.diag(normal.gram))
    size[size == 0.0] = 1.0
    # of two ways to add a thousand products up
    np.testing.assert_allclose(
        normal.gram / np.outer(size, size), flat @ flat.T / np.outer(size, size), atol=1e-12
    )
    np.testing.assert_allclose(normal.moment / size, flat @ y.ravel() / size, atol=1e-12)
    assert normal.square == pytest.approx(float((y**2).sum()), rel=1e-12)
    assert normal.size == y.size


def normal_of(jacobian: FloatArray, y: FloatArray) -> NormalEquations:
    """Return the normal equations of columns, shape (n, p), and data, shape (n,)."""
    return NormalEquations(jacobian.T @ jacobian, jacobian.T @ y, float(y @ y), len(y))


@pytest.mark.parametrize("damping", [(0.0, 0.0), (3.0, 5.0)])
def test_equations_without_columns_are_those_of_the_residual_of_ridge_regression(
    damping: tuple[float, float],
) -> None:
    rng = np.random.default_rng(6)
    jacobian, y = rng.normal(size=(50, 6)), rng.normal(size=50)
    normal = normal_of(jacobian, y).without([1, 4], np.array(damping))
    penalty = np.zeros((2, 6))
    penalty[[0, 1], [1, 4]] = np.sqrt(damping)
    stacked, data = np.vstack([jacobian, penalty]), np.append(y, [0.0, 0.0])
    q, _ = np.linalg.qr(stacked[:, [1, 4]])
    expected = normal_of(stacked - q @ (q.T @ stacked), data - q @ (q.T @ data))
    free = [0, 2, 3, 5]
    np.testing.assert_allclose(
        normal.gram[np.ix_(free, free)], expected.gram[np.ix_(free, free)], atol=1e-12 * 50
    )
    np.testing.assert_allclose(normal.moment[free], expected.moment[free], atol=1e-12 * 50)
    assert normal.square == pytest.approx(expected.square, rel=1e-12)
    assert normal.size == (50 if any(damping) else 48)


def test_outliers_are_left_out_and_gaussian_noise_is_not() -> None:
    noise = np.random.default_rng(8).normal(size=(3, 10_000))
    assert fit.find_inliers(noise).all()
    noise[:, ::100] += 60.0
    noise[1, 5] = np.nan
    kept = fit.find_inliers(noise)
    assert not kept[::100].any()
    assert not kept[5]
    assert kept.sum() == 10_000 - 100 - 1


ROWS, GROUPS = 90, 7
COLUMNS: tuple[IntArray, ...] = tuple(np.array(c) for c in ([0], [1], [2, 3, 4], [5], [6], [7, 8, 9], [10]))


def problem(seed: int, *groups: int) -> tuple[FloatArray, FloatArray]:
    """A Jacobian with columns of differing units, and noise with some of the groups."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(ROWS, 11)) * 10.0 ** rng.integers(-3, 4, 11)
    y = rng.normal(size=ROWS)
    for g in groups:
        of_group = jacobian[:, COLUMNS[g]]
        y = y + (of_group / np.linalg.norm(of_group, axis=0)).sum(axis=1) * 12.0
    return jacobian, y


def selection_of(jacobian: FloatArray, y: FloatArray, independent: float = 60.0) -> Selection:
    return Selection(normal_of(jacobian, y), COLUMNS, independent, 1e-6, 1, 2, 20)


def ebic(jacobian: FloatArray, y: FloatArray, subset: Subset) -> float:
    """n ln(RSS / N) + k ln n + 2 ln C(K, s) of 20 causes, besides one edit with two numbers, n = 60."""
    columns = jacobian[:, [c for g in sorted(subset) for c in COLUMNS[g]]]
    columns = columns / np.linalg.norm(columns, axis=0)
    square = float(((y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) ** 2).sum())
    parameters = columns.shape[1] + 2
    return float(60.0 * log(square / ROWS) + parameters * log(60.0) + 2 * log(comb(20, len(subset) + 1)))


@pytest.mark.parametrize("groups", [(), (1,), (2,), (0, 5), (1, 2, 6), (0, 2, 4, 5)])
def test_scores_are_those_of_least_squares_and_the_best_of_all_subsets_is_found(
    groups: tuple[int, ...],
) -> None:
    jacobian, y = problem(1, *groups)
    selection = selection_of(jacobian, y)
    sizes = range(MAX_GROUPS + 1)
    subsets = [frozenset(s) for s in chain(*(combinations(range(GROUPS), size) for size in sizes))]
    theirs = np.array([ebic(jacobian, y, subset) for subset in subsets])
    # 60 ln(RSS) of squares from normal equations, to 1e-9 of y's
    np.testing.assert_allclose(selection.scores(subsets), theirs, atol=1e-5)
    assert selection.best(range(GROUPS)) == subsets[int(np.argmin(theirs))] == frozenset(groups)


def test_nothing_is_found_in_noise_by_fewer_independent_rows_either() -> None:
    silent = [selection_of(*problem(seed), 30.0).best(range(GROUPS)) == frozenset() for seed in range(200)]
    assert np.mean(silent) > 0.97


def test_deviations_below_the_floor_are_not_fitted_any_further() -> None:
    jacobian, y = problem(1, 1)
    selection = Selection(normal_of(jacobian, 1e-9 * y), COLUMNS, 60.0, 1e-6, 0, 0, 20)
    assert selection.best(range(GROUPS)) == frozenset()


@pytest.mark.parametrize(("moved", "expected"), [(2.0, {1, 2}), (0.5, {1})])
def test_a_group_that_moves_less_than_the_floor_is_dropped_under_larger_noise(
    moved: float, expected: Subset
) -> None:
    """Of 9000 values with noise of 1, a mean square of 0.01 is 90 times its chance; the floor is as large."""
    rng = np.random.default_rng(5)
    jacobian = rng.normal(size=(9000, 11))
    y = rng.normal(size=9000) + jacobian[:, 1] + np.sqrt(0.01 * moved / 3.0) * jacobian[:, 2:5].sum(axis=1)
    selection = Selection(normal_of(jacobian, y), COLUMNS, 9000.0, 0.01, 0, 0, 7)
    best = selection.best(range(GROUPS))
    assert best == {1, 2}
    assert selection.moving(best) == expected


@pytest.mark.parametrize(
    ("first", "distinct", "equal"), [((), [0, 1, 2, 5, 6], {3: 1}), ((3,), [0, 2, 3, 5, 6], {1: 3})]
)
def test_the_first_of_equivalent_groups_represents_them_and_none_without_effect_is_left(
    first: tuple[int, ...], distinct: list[int], equal: dict[int, int]
) -> None:
    jacobian, _ = problem(2)
    jacobian[:, 5] = -3.0 * jacobian[:, 1]
    jacobian[:, 6] = 0.0
    normal = normal_of(jacobian, np.zeros(ROWS))
    assert drop_equivalent_groups(normal, COLUMNS, np.diag(normal.gram), first) == (distinct, equal)


PLAIN = (
    "link_length", "tilt", "joint_offset", "joint_scale", "time_lag", "clock_drift",
    "base_shift", "base_rotation", "tool_shift",
)  # fmt: skip
"""What an arm is known by, its joints, base, tool and clock."""


def test_positions_of_urm6_do_not_determine_seven_of_its_parameters() -> None:
    model = nominal(URM6, rich_motion(URM6), times(500))
    gram = normal_equations(model, state_of(model, {}), WeightedRows(np.arange(500), np.ones(3))).gram
    size = np.maximum(np.sqrt(np.diag(gram)), 1e-9)  # gravity does not pull at an upright axis
    places = {
        called(group): group.columns[0]
        for group in model.groups
        if group.kind in PLAIN and len(group.columns) == 1 and "segment" not in group.name
    }

    def rank(*names: str) -> int:
        at = [places[name] for name in names]
        scaled = (gram / np.outer(size, size))[np.ix_(at, at)]
        return int(np.linalg.matrix_rank(scaled, tol=1e-9, hermitian=True))

    assert rank("link_length:r1", "base_shift:base z") == 1
    assert rank("joint_offset:phi1", "base_rotation:base z") == 1
    assert rank("link_length:r7", "tool_shift:tool z") == 1
    assert rank("tilt:theta7", "tool_shift:tool x") == 1
    assert rank("joint_offset:phi6", "tool_shift:tool y") == 1
    wrist = ("link_length:r6", "link_length:r7", "tilt:theta7", "joint_offset:phi6")
    assert rank(*wrist, *(f"tool_shift:tool {axis}" for axis in "xyz")) == 3
    assert rank(*places) == len(places) - 6


@pytest.mark.parametrize("a", [0.0, 0.5, 0.9, 0.98])
def test_the_autocorrelation_time_of_a_first_order_process(a: float) -> None:
    """Tau = (1 + a) / (1 - a)."""
    white = np.random.default_rng(3).normal(size=(120_000, 3))
    expected = (1.0 + a) / (1.0 - a)
    # relative error of the estimate: sqrt(2 (2 M + 1) / N), with a window M of a few tau and three components
    assert autocorrelation_time(lfilter([1.0], [1.0, -a], white, axis=0)) == pytest.approx(expected, rel=0.12)


def test_it_does_not_depend_on_the_unit_and_is_one_of_nothing() -> None:
    values = np.cumsum(np.random.default_rng(4).normal(size=(500, 2)), axis=0)
    assert autocorrelation_time(1e-6 * values) == pytest.approx(autocorrelation_time(values), rel=1e-9)
    assert autocorrelation_time(np.zeros((100, 3))) == 1.0
    assert autocorrelation_time(values[:3]) == 1.0
