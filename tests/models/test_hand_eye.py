"""Hand-eye calibration: known frames, SciPy's least squares, and unobservable directions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from asserting import assert_near
from orientation_columns import orientation_columns
from urmpipe_models import hand_eye
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.hand_eye import HandEye, rotation_residual, solve_hand_eye
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import FORMS, RotationForm, column_count, to_matrices, to_quaternions
from urmpipe_models.robots.catalogue import load_robot

ROUNDING = 1e-12  # positions of some metres round at 1e-15, and a fit loses a few digits


class Truth(NamedTuple):
    """Frames, and poses on both sides of them."""

    base: FloatArray
    shift: FloatArray
    tool: FloatArray
    offset: FloatArray
    position: FloatArray
    rotation: FloatArray

    @property
    def measured(self) -> FloatArray:
        return (self.position + self.rotation @ self.offset) @ self.base.T + self.shift

    @property
    def measured_rotation(self) -> FloatArray:
        return np.asarray(self.base @ self.rotation @ self.tool)


def random_truth(seed: int, count: int = 20, robot: str = "ur10", spread: float = np.pi) -> Truth:
    """Poses of an arm whose joints are within a spread, and any frames."""
    rng = np.random.default_rng(seed)
    base, tool = Rotation.random(2, rng).as_matrix()
    chain = load_robot(robot)
    q = rng.uniform(-spread, spread, (count, len(chain.moving)))
    return Truth(base, rng.uniform(-5, 5, 3), tool, rng.uniform(-0.3, 0.3, 3), *poses_over_log(chain, q))


def placed(position: FloatArray, rotation: FloatArray) -> Truth:
    """Some poses between two frames."""
    base, tool = Rotation.from_rotvec([[0.3, -0.5, 0.4], [0.1, 0.2, -0.7]]).as_matrix()
    offset, shift = np.array([0.01, -0.02, 0.15]), np.array([1.0, 2.0, 0.3])
    return Truth(base, shift, tool, offset, position, np.broadcast_to(rotation, (len(position), 3, 3)))


def solve(truth: Truth, *, turned: bool) -> HandEye:
    turns = truth.measured_rotation if turned else None
    return solve_hand_eye(truth.position, truth.rotation, truth.measured, turns)


def noisy(truth: Truth, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return measured positions with a noise of 1 mm and orientations with a noise of 0.01 rad."""
    noise = Rotation.from_rotvec(rng.normal(0.0, 0.01, truth.position.shape)).as_matrix()
    measured = truth.measured + rng.normal(0.0, 1e-3, truth.position.shape)
    return measured, truth.measured_rotation @ noise


def misfits(truth: Truth, measured: FloatArray, turns: FloatArray | None) -> FloatArray:
    """Return what the frames leave of positions and orientations, all in [m]."""
    apart = [] if turns is None else hand_eye.RADIAN_LENGTH / np.sqrt(2) * (turns - truth.measured_rotation)
    return np.concatenate(((measured - truth.measured).ravel(), np.ravel(apart)))


def least_squares_sum(truth: Truth, measured: FloatArray, turns: FloatArray | None = None) -> float:
    """Return the smallest sum of squares that any frames leave, by SciPy from the true frames."""

    def residuals(x: FloatArray) -> FloatArray:
        base_turn, tool_turn = Rotation.from_rotvec([x[:3], x[9:]]).as_matrix()
        base, tool = base_turn @ truth.base, truth.tool @ tool_turn
        moved = Truth(base, truth.shift + x[6:9], tool, truth.offset + x[3:6], truth.position, truth.rotation)
        return misfits(moved, measured, turns)

    return 2.0 * float(least_squares(residuals, np.zeros(12), xtol=1e-15, ftol=1e-15, gtol=1e-15).cost)


def fitted(found: HandEye, truth: Truth) -> Truth:
    base, tool = found.base_rotation, found.tool_rotation
    return Truth(base, found.base_position, tool, found.tool_position, truth.position, truth.rotation)


def rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).sum() / len(values)))


def assert_found(found: HandEye, truth: Truth, *, turned: bool) -> None:
    assert found.unobservable == ()
    assert_near(found.base_rotation, truth.base, ROUNDING)
    assert_near(found.base_position, truth.shift, ROUNDING)
    assert_near(found.tool_position, truth.offset, ROUNDING)
    assert_near(found.tool_rotation, truth.tool if turned else np.eye(3), ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.parametrize("robot", ["ur10", "ur5e", "urm6", "arm6"])
def test_any_frames_are_found_from_exact_poses(robot: str, turned: bool) -> None:
    for seed in range(4):
        truth = random_truth(seed, robot=robot)
        assert_found(solve(truth, turned=turned), truth, turned=turned)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(5, 40), spread=st.floats(0.5, np.pi))
def test_any_frames_are_found_from_few_poses_and_small_motions(seed: int, count: int, spread: float) -> None:
    truth = random_truth(seed, count, spread=spread)
    found = solve(truth, turned=True)
    assert_near(found.base_rotation, truth.base, 1e-9)
    assert_near(found.tool_position, truth.offset, 1e-9)


def test_rows_without_a_value_count_nowhere() -> None:
    truth = random_truth(1, 40)
    measured, turns = truth.measured.copy(), truth.measured_rotation.copy()
    position, rotation = truth.position.copy(), truth.rotation.copy()
    measured[0, 1], turns[5:9], position[10], rotation[11, 2, 2] = np.nan, np.nan, np.nan, np.nan
    measured[14, 2] = 1e200
    assert_found(solve_hand_eye(position, rotation, measured, turns), truth, turned=True)
    nowhere = np.full_like(turns, np.nan)
    assert_found(solve_hand_eye(position, rotation, measured, nowhere), truth, turned=False)


@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_no_other_frames_leave_less_of_noisy_positions(seed: int, turned: bool) -> None:
    truth = random_truth(seed, 300)
    measured, turns = noisy(truth, np.random.default_rng(seed))
    found = solve_hand_eye(truth.position, truth.rotation, measured, turns if turned else None)
    least = np.sqrt(least_squares_sum(truth, measured) / 300)
    assert rms(measured - fitted(found, truth).measured) == pytest.approx(least, rel=1e-9)
    if turned:
        left = (Rotation.from_matrix(found.base_rotation @ truth.rotation @ found.tool_rotation)).inv()
        spun = (left * Rotation.from_matrix(turns)).as_rotvec()
        assert np.abs(spun.mean(axis=0)).max() < 1e-5  # of the least squares the mean is 0, but for 0.01^2


def test_orientations_in_a_wrong_form_move_no_position() -> None:
    truth = random_truth(3, 100)
    measured, _ = noisy(truth, np.random.default_rng(3))
    wrong = Rotation.random(100, np.random.default_rng(4)).as_matrix()
    alone = solve_hand_eye(truth.position, truth.rotation, measured)
    found = solve_hand_eye(truth.position, truth.rotation, measured, wrong)
    least = rms(measured - fitted(alone, truth).measured)
    assert rms(measured - fitted(found, truth).measured) == pytest.approx(least, rel=1e-9)


def test_orientations_determine_what_positions_on_a_line_leave_open() -> None:
    """No frames leave less of positions and orientations together, and hardly any less of positions."""
    rng = np.random.default_rng(5)
    line = np.outer(rng.uniform(-0.5, 0.5, 200), [1 / 3, 2 / 3, 2 / 3])
    truth = placed(line, Rotation.from_rotvec(rng.normal(0, 0.3, (200, 3)) * [1, 0, 0]).as_matrix())
    measured, turns = noisy(truth, rng)
    found = solve_hand_eye(truth.position, truth.rotation, measured, turns)
    left = (misfits(fitted(found, truth), measured, turns) ** 2).sum()
    assert left == pytest.approx(least_squares_sum(truth, measured, turns), rel=1e-9)
    (direction,) = found.unobservable
    assert direction.part == "tool offset"  # along the axis of all turns
    assert_near(np.abs(direction.axis), [1.0, 0.0, 0.0], 1e-9)


RNG = np.random.default_rng(0)
POINTS, TURNS = poses_over_log(load_robot("ur10"), RNG.uniform(-3.0, 3.0, (50, 6)))
LINE = np.outer(RNG.uniform(-1.0, 1.0, 50), [1 / 3, 2 / 3, 2 / 3])
POINT = np.broadcast_to(POINTS[0], POINTS.shape)
ABOUT_Z = Rotation.from_rotvec(np.outer(RNG.uniform(-2.0, 2.0, 50), [0.0, 0.0, 1.0])).as_matrix()

OFFSETS, BASES, TOOLS = (["tool offset"] * 3, ["base turn"] * 3, ["tool turn"] * 3)
# Poses, and their unobservable directions without orientations and with them.
OPEN_SETS: list[tuple[FloatArray, FloatArray, list[str], list[str]]] = [
    (POINTS, TURNS, [], []),
    (POINTS, TURNS[0], OFFSETS, OFFSETS),
    (POINTS, ABOUT_Z @ TURNS[0], OFFSETS[:1], OFFSETS[:1]),
    (LINE, TURNS, [], []),
    (LINE, TURNS[0], [*OFFSETS, "base turn"], [*OFFSETS, "tool turn"]),
    (POINT, TURNS, [], []),
    (POINT, ABOUT_Z @ TURNS[0], ["tool offset", "base turn"], ["tool offset", "tool turn"]),
    (POINT, TURNS[0], OFFSETS + BASES, OFFSETS + TOOLS),
    (POINTS[:1], TURNS[:1], OFFSETS + BASES, OFFSETS + TOOLS),
]


@pytest.mark.slow
@pytest.mark.parametrize(("position", "rotation", "alone", "turned"), OPEN_SETS)
def test_what_poses_leave_open_is_named_and_the_least_of_it_taken(
    position: FloatArray, rotation: FloatArray, alone: list[str], turned: list[str]
) -> None:
    truth = placed(position, rotation)
    for expected, with_turns in ((alone, False), (turned, True)):
        found = solve(truth, turned=with_turns)
        assert [direction.part for direction in found.unobservable] == expected
        assert_near(fitted(found, truth).measured, truth.measured, 1e-9)
        for direction in found.unobservable:
            assert np.linalg.norm(direction.axis) == pytest.approx(1.0)
            assert direction.sensitivity < 1e-7  # the root of rounding
            assert direction.part != "tool offset" or abs(found.tool_position @ direction.axis) <= 1e-9
        if with_turns:
            assert_near(fitted(found, truth).measured_rotation, truth.measured_rotation, 1e-9)
        elif not expected:
            assert_found(found, truth, turned=False)


def test_the_axis_of_all_turns_is_the_one_along_which_the_tool_is_open() -> None:
    found = solve(placed(POINTS, ABOUT_Z @ TURNS[0]), turned=False)
    assert abs(TURNS[0, 2] @ found.unobservable[0].axis) == pytest.approx(1.0)
    assert found.tool_rotation.tolist() == np.eye(3).tolist()


def test_a_tool_that_hardly_turns_is_found_with_a_low_sensitivity() -> None:
    small = Rotation.from_rotvec(RNG.normal(0.0, 0.002, (50, 3))).as_matrix()
    truth = placed(POINTS, small @ TURNS[0])
    found = solve(truth, turned=True)
    assert_near(found.tool_position, truth.offset, 1e-9)
    assert [direction.part for direction in found.unobservable] == OFFSETS
    for direction in found.unobservable:
        spun = truth.rotation @ direction.axis
        assert direction.sensitivity == pytest.approx(np.sqrt(3 * spun.var(axis=0).mean()), rel=0.2)
        assert direction.sensitivity < hand_eye.WEAK_SENSITIVITY


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_the_form_of_orientations_is_the_one_that_leaves_no_angle(form: RotationForm) -> None:
    truth = random_truth(7, 40)
    columns = orientation_columns(Rotation.from_matrix(truth.measured_rotation), form)
    alike = {"zyz", "zxz"}  # these differ by quarter turns of base and tool
    for other in (name for name in FORMS if column_count(name) == columns.shape[1]):
        guess = to_matrices(to_quaternions(columns, other))
        fits = rotation_residual(truth.rotation, guess) < 1e-7
        assert fits == (other == form or {form, other} == alike), other
        if fits:  # else no base fits, and the known one is of them
            known = rotation_residual(truth.rotation, guess, truth.base)
            assert (known < 1e-7) == (other == form), other
    if columns.shape[1] == 3:
        in_degrees = to_matrices(to_quaternions(np.radians(columns), form))
        assert rotation_residual(truth.rotation, in_degrees) > 0.1


def test_the_angle_that_is_left_is_that_of_the_noise() -> None:
    truth = random_truth(8, 500)
    noise = np.random.default_rng(8).normal(0.0, 0.01, (500, 3))
    turns = truth.measured_rotation @ Rotation.from_rotvec(noise).as_matrix()
    turns[3] = np.nan
    expected = rms(np.delete(noise, 3, axis=0))
    residual = rotation_residual(truth.rotation, turns)
    assert residual == pytest.approx(expected, rel=0.01)  # 6 of 1500 are fitted
    assert np.isnan(rotation_residual(truth.rotation, np.full_like(turns, np.nan)))
