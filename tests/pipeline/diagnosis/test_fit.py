"""Explanations and normal equations, against SciPy's least squares and plain NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from altered_arm import altered, arm_model, called, nominal, rich_motion, spoilt, state_of, times, uniform
from normal_equations import normal_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.fit import (
    WeightedRows,
    cost,
    find_inliers,
    fit_parameters,
    normal_equations,
    residual,
)
from urmpipe_pipeline.diagnosis.hypotheses import Group, State
from urmpipe_pipeline.diagnosis.models import ArmModel

URM6 = load_robot("urm6")
SAMPLES = 400
CAUSES = {
    "link_length:r3": np.array([0.02]),
    "tilt:theta5": np.array([-0.05]),
    "joint_offset:phi2": np.array([0.1]),
    "joint_scale:phi4": np.array([0.02]),
    "base_rotation:base": np.array([0.05, -0.1, 0.2]),
    "time_lag:clock": np.array([0.08]),
}
"""Large ones: a step from no change is not enough."""


def log_with(causes: dict[str, FloatArray]) -> ArmModel:
    """A log with some causes and +-3.5 mm."""
    moved = rich_motion(URM6)
    clean = nominal(URM6, moved, times(SAMPLES))
    position, _ = altered(clean, moved, causes)
    return replace(clean, position=uniform(np.random.default_rng(5), position))


def groups_of(model: ArmModel, causes: dict[str, FloatArray]) -> list[Group]:
    return [group for group in model.groups if called(group) in causes]


def zero_of(model: ArmModel) -> State:
    return state_of(model, {})


def test_a_fit_is_that_of_scipy() -> None:
    model = log_with(CAUSES)
    groups = groups_of(model, CAUSES)
    columns = [c for group in groups for c in group.columns]
    rows = WeightedRows(np.arange(20, SAMPLES - 20), np.array([1.0, 2.0, 0.5]))

    def left(x: FloatArray) -> FloatArray:
        values = np.zeros_like(zero_of(model).values)
        values[columns] = x
        return (model.residual(State(values), rows.at) * rows.weight[:, np.newaxis]).ravel()

    theirs = least_squares(left, np.zeros(len(columns)), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    ours = fit_parameters(model, zero_of(model), groups, rows)
    # ours rests where a step takes 1e-8 of the square: 1e-4 of a standard deviation
    slopes = np.asarray(theirs.jac)
    variance = 2.0 * theirs.cost / len(theirs.fun)
    deviations = np.sqrt(variance * np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert np.abs((ours.values[columns] - theirs.x) / deviations).max() < 0.02
    assert cost(model, ours, rows) <= variance * (1.0 + 1e-8)
    assert not np.delete(ours.values, columns).any()


def test_other_numbers_stay_if_they_are_kept() -> None:
    model = log_with(CAUSES)
    start = state_of(model, CAUSES)
    (group,) = groups_of(model, {"joint_offset:phi2": np.zeros(1)})
    rows = WeightedRows(np.arange(SAMPLES), np.ones(3))
    kept = fit_parameters(model, start, [group], rows, keep_others=True)
    alone = fit_parameters(model, start, [group], rows)
    others = np.delete(np.arange(len(start.values)), group.columns)
    np.testing.assert_array_equal(kept.values[others], start.values[others])
    assert not alone.values[others].any()


def test_normal_equations_are_those_of_the_rows_that_are_known() -> None:
    model = log_with(CAUSES)
    state = state_of(model, CAUSES)
    rows = WeightedRows(np.arange(SAMPLES), np.array([1.0, 2.0, 0.5]))
    normal = normal_equations(model, state, rows)
    left, jacobian = model.linear(state, rows.at)
    known = np.isfinite(left).all(axis=0)
    assert not known.all()  # the lag leads out of the log
    y = (left + np.tensordot(state.values, jacobian, 1))[:, known] * rows.weight[:, np.newaxis]
    flat = (jacobian[:, :, known] * rows.weight[:, np.newaxis]).reshape(len(jacobian), -1)
    size = np.sqrt(np.diag(normal.gram))
    size[size == 0.0] = 1.0
    # of two ways to add a thousand products up
    np.testing.assert_allclose(
        normal.gram / np.outer(size, size), flat @ flat.T / np.outer(size, size), atol=1e-12
    )
    np.testing.assert_allclose(normal.moment / size, flat @ y.ravel() / size, atol=1e-12)
    assert normal.square == pytest.approx(float((y**2).sum()), rel=1e-12)
    assert normal.size == y.size


def test_equations_without_columns_are_those_of_what_they_leave() -> None:
    rng = np.random.default_rng(6)
    jacobian, y = rng.normal(size=(50, 6)), rng.normal(size=50)
    normal = normal_of(jacobian, y).without([1, 4], np.zeros(2))
    q, _ = np.linalg.qr(jacobian[:, [1, 4]])
    rest, left = jacobian - q @ (q.T @ jacobian), y - q @ (q.T @ y)
    wanted = normal_of(rest, left)
    np.testing.assert_allclose(normal.gram, wanted.gram, atol=1e-12 * 50)
    np.testing.assert_allclose(normal.moment, wanted.moment, atol=1e-12 * 50)
    assert normal.square == pytest.approx(wanted.square, rel=1e-12)
    assert normal.size == 48


def test_columns_that_are_held_back_are_ridge_regression() -> None:
    rng = np.random.default_rng(7)
    jacobian, y = rng.normal(size=(50, 4)), rng.normal(size=50)
    held = normal_of(jacobian, y).without([0, 2], np.array([3.0, 5.0]))
    stacked = np.vstack([jacobian, [[np.sqrt(3.0), 0, 0, 0], [0, 0, np.sqrt(5.0), 0]]])
    wanted = normal_of(stacked, np.append(y, [0.0, 0.0])).without([0, 2], np.zeros(2))
    free = np.ix_([1, 3], [1, 3])
    np.testing.assert_allclose(held.gram[free], wanted.gram[free], atol=1e-12 * 50)
    np.testing.assert_allclose(held.moment[[1, 3]], wanted.moment[[1, 3]], atol=1e-12 * 50)
    assert held.square == pytest.approx(wanted.square, rel=1e-12)


def test_outliers_are_left_out_and_gaussian_noise_is_not() -> None:
    rng = np.random.default_rng(8)
    noise = rng.normal(size=(3, 10_000))
    assert find_inliers(noise).all()
    noise[:, ::100] += 60.0
    noise[1, 5] = np.nan
    kept = find_inliers(noise)
    assert not kept[::100].any()
    assert not kept[5]
    assert kept.sum() == 10_000 - 100 - 1


def test_a_fit_to_the_rows_that_are_no_outliers_is_not_led_astray() -> None:
    moved = rich_motion(URM6)
    clean = nominal(URM6, moved, times(SAMPLES))
    causes = {"joint_offset:phi2": np.array([0.01])}
    position, _ = altered(clean, moved, causes)
    model = arm_model(URM6, moved, times(SAMPLES), spoilt(np.random.default_rng(9), position))
    groups, rows = groups_of(model, causes), WeightedRows(np.arange(SAMPLES), np.ones(3))
    start = fit_parameters(model, zero_of(model), groups, rows)
    some = rows.without_outliers(residual(model, start, rows.at))
    assert SAMPLES * 0.97 < len(some.at) < SAMPLES
    (found,) = fit_parameters(model, start, groups, some).of(groups[0])
    # 2 mm of noise a coordinate, 400 samples, a lever of 0.5 m: 0.1 mrad
    assert abs(found - 0.01) < 5e-4
