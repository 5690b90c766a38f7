"""Diagnoses of whole logs: joints on both sides, a path against joints, paths alone, too little to tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from altered_arm import DURATION, demo_motion, poses, rich_motion, times, uniform
from altered_log import POSES, TRACKER, diagnosed, diagnosed_record, drawn, tracked
from made_runs import path_run, run_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.result import Diagnosis

URM6 = load_robot("urm6")
SAMPLES = 1000
PERIOD = DURATION / (SAMPLES - 1)


def joints(motion: str = "rich") -> FloatArray:
    moved = demo_motion() if motion == "demo" else rich_motion(URM6)
    return np.asarray(moved(times(SAMPLES)))


def against_joints(q: FloatArray, seed: int = 1) -> Diagnosis:
    """A log of joints with 0.02 deg of noise against those that were asked for."""
    noise = np.random.default_rng(seed).normal(0.0, np.radians(0.02), q.shape)
    asked = run_of(joints(), URM6, name="asked", tsp=PERIOD)
    return diagnosed(asked, run_of(q + noise, URM6, tsp=PERIOD))


def against_path(q: FloatArray, motion: str = "rich") -> Diagnosis:
    """A log of joints against the path that was asked for, +-3.5 mm."""
    position, _ = poses(URM6, joints(motion), oriented=False)
    noisy = uniform(np.random.default_rng(1), position)
    return diagnosed(path_run(noisy.T, tsp=PERIOD), run_of(q, URM6, tsp=PERIOD))


def answer(found: Diagnosis) -> list[tuple[str, tuple[str, ...], int | None]]:
    """The causes, of which none is undecided."""
    assert not found.undecided
    return [(one.kind, one.joints, one.from_sample) for one in found.causes]


def test_joints_that_agree_have_no_cause() -> None:
    assert answer(against_joints(joints())) == []


@pytest.mark.parametrize(("kind", "step"), [("joint_sign", 0), ("joint_sign", 97), ("joint_offset", 97)])
def test_one_cause_is_named_alone_also_where_cells_of_a_joint_that_moves_no_point_are_empty(
    kind: str, step: int
) -> None:
    chain = load_robot("ur5e")
    s = np.clip((times(400) / DURATION - 0.2) / 0.6, 0.0, 1.0)
    q = np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), np.linspace(0.5, 1.2, 6)) + np.linspace(0.1, 0.3, 6)
    position = poses(chain, q, oriented=False)[0] + np.random.default_rng(1).normal(0.0, 5e-5, (3, 400))
    q[:, 1] = -q[:, 1] if kind == "joint_sign" else q[:, 1] + 0.01
    if step:
        q[::step, 5] = np.nan
    found = diagnosed(path_run(position.T, tsp=DURATION / 399), run_of(q, chain, tsp=DURATION / 399))
    assert answer(found) == [(kind, ("q2",), None)]


@pytest.mark.slow
@pytest.mark.parametrize(("j", "seed"), [(0, 0), (3, 1), (5, 2)])
def test_a_joint_that_counts_the_other_way_is_named_and_not_by_a_factor(j: int, seed: int) -> None:
    q = joints()
    q[:, j] *= -1.0
    assert answer(against_joints(q, seed=seed)) == [("joint_sign", (f"q{j + 1}",), None)]


@pytest.mark.slow
@pytest.mark.parametrize(("j", "seed"), [(1, 0), (4, 1), (4, 2)])
def test_a_whole_turn_is_named_though_the_tool_centre_point_lacks_nothing(j: int, seed: int) -> None:
    q = joints()
    q[300:, j] -= 2.0 * np.pi
    assert answer(against_joints(q, seed=seed)) == [("turns", (f"q{j + 1}",), 300)]


def test_an_exchange_of_joints_is_named() -> None:
    q = joints()
    assert answer(against_joints(q[:, [0, 4, 2, 3, 1, 5]])) == [("joints_swapped", ("q2", "q5"), None)]


def test_an_offset_of_a_joint_is_named_with_its_size() -> None:
    q = joints()
    q[:, 2] += np.radians(0.1)
    found = against_joints(q)
    assert answer(found) == [("joint_offset", ("q3",), None)]
    (cause,) = found.causes
    assert cause.low[0] < -np.radians(0.1) < cause.high[0]


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["demo", "rich"])
@pytest.mark.parametrize("j", [0, 3, 5])
def test_half_a_turn_is_found_at_the_tool_centre_point_to_the_sample(motion: str, j: int) -> None:
    q = joints(motion)
    q[400:, j] += np.pi
    assert answer(against_path(q, motion)) == [("half_turn", (f"q{j + 1}",), 400)]


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["demo", "rich"])
@pytest.mark.parametrize("j", [1, 2, 4])
def test_a_mirrored_angle_is_found_there_within_seven_samples(motion: str, j: int) -> None:
    q = joints(motion)
    q[600:, j] *= -1.0
    ((kind, names, first),) = answer(against_path(q, motion))
    assert (kind, names) == ("mirrored", (f"q{j + 1}",))
    assert first is not None
    assert abs(first - 600) <= 7


def test_a_path_that_stands_elsewhere_has_another_base() -> None:
    position = poses(URM6, joints(), oriented=False)[0].T
    shift = np.array([1.5e-3, -1.2e-3, 1.6e-3])
    log = path_run(position + shift, name="log", tsp=PERIOD)
    found = diagnosed(path_run(position, tsp=PERIOD), log)
    assert answer(found) == [("base_shift", (), None)]
    (cause,) = found.causes
    # what is added to the log so that the sides agree; told to a hundredth of the tolerance
    np.testing.assert_allclose(cause.value, -shift, atol=3.5e-5)


@pytest.mark.slow
def test_the_remainder_is_what_the_mended_log_leaves() -> None:
    q = joints()
    q[:, 1] += 0.01
    found = against_path(q)
    known = np.isfinite(found.residual).all(axis=1)
    assert found.unexplained.rms == pytest.approx(
        float(np.sqrt((found.residual[known] ** 2).sum(axis=1).mean()))
    )
    assert found.causes[-1].rms_after == pytest.approx(found.unexplained.rms)


@pytest.mark.parametrize(("samples", "words"), [(1, "1 sample"), (9, "9 samples")])
def test_of_fewer_than_ten_samples_nothing_is_named(samples: int, words: str) -> None:
    q = joints()[:samples]
    position = poses(URM6, q, oriented=False)[0].T
    found = diagnosed(path_run(position + 0.1, tsp=PERIOD), run_of(q, URM6, tsp=PERIOD))
    assert not found.causes
    assert not found.undecided
    assert found.untested[0].reason == f"{words}: fewer than 10"
    assert found.rms == pytest.approx(0.1 * np.sqrt(3.0))
    assert found.unexplained.rms == found.rms


def test_of_a_log_at_rest_nothing_is_named() -> None:
    q = np.tile(joints()[300], (100, 1))
    position = poses(URM6, q, oriented=False)[0].T
    found = diagnosed(path_run(position + 0.1, tsp=PERIOD), run_of(q, URM6, tsp=PERIOD))
    assert not found.causes
    assert not found.undecided
    assert found.untested[0].reason == "the log is at rest: one pose"


@pytest.mark.parametrize("seed", range(2))
def test_lines_between_the_samples_of_the_reference_are_no_cause(seed: int) -> None:
    """125 Hz, read at 100 Hz: lines lie h^2 q'' / 12 from the motion, as a joint that yields would."""

    def moved(t: FloatArray) -> FloatArray:
        """Return joints that swing by 18 to 40 deg, 5 to 9 s a period."""
        wide = np.radians([35.0, 20.0, 25.0, 18.0, 22.0, 40.0])
        often = np.array([0.11, 0.17, 0.13, 0.23, 0.19, 0.29])
        rest = np.radians([0.0, -90.0, 90.0, -90.0, -90.0, 0.0])
        return np.asarray(rest + wide * np.sin(2.0 * np.pi * often * t[:, np.newaxis] + np.arange(6)))

    arm = load_robot("ur5e")
    asked = run_of(moved(np.linspace(0.0, 2499 * 0.008, 2500)), arm, name="asked", tsp=0.008)
    q = moved(np.linspace(-0.04, 19.85, 1990))
    q[:, 2] += np.radians(0.5)
    noise = np.random.default_rng(seed).normal(0.0, np.radians(0.003), q.shape)
    found = diagnosed(asked, run_of(q + noise, arm, tsp=0.01))
    assert {kind for kind, *_ in answer(found)} == {"time_lag", "joint_offset"}


SCARA = """
kind = "dh"
name = "scara"
joints = [
    { name = "shoulder", d = 0.3, a = 0.325 },
    { name = "elbow", a = 0.275, alpha = 3.141592653589793 },
    { name = "quill", kind = "prismatic", d = 0.05 },
    { name = "wrist" },
]
tool = { translation = [0, 0, 0.08] }
"""


def test_of_twins_that_of_full_size_is_named(tmp_path: Path) -> None:
    """A tilt below the elbow moves the tool as the elbow's zero does, up to 1.2 deg squared."""
    (tmp_path / "scara.toml").write_text(SCARA, "utf-8")
    scara = load_robot(tmp_path / "scara.toml")
    t = np.arange(400) * PERIOD * 2.0
    waves = [0.8 * np.sin(t), 0.5 + 0.6 * np.sin(1.7 * t), 0.05 + 0.04 * np.sin(2.3 * t), np.sin(0.9 * t)]
    q = np.column_stack(waves)
    position, _ = poses(scara, q, oriented=False)
    q += np.random.default_rng(3).normal(0.0, 1e-5, q.shape)
    q[:, 1] -= np.radians(1.2)
    found = diagnosed(path_run(position.T, tsp=2.0 * PERIOD), run_of(q, scara, tsp=2.0 * PERIOD))
    assert answer(found) == [("joint_offset", ("q2",), None)]
    # what shifts the forearm sideways by 5.8 mm leaves less than the floor; a tilt does not
    assert found.causes[0].equivalents == ("segment 2 sideways y", "segment 3 sideways y")
    assert found.causes[0].value[0] == pytest.approx(np.radians(1.2), abs=1e-5)  # noise is 1e-5 a sample


def test_motions_that_have_nothing_in_common_are_different() -> None:
    one, other = (rich_motion(URM6, seed)(times(100)) for seed in (1, 2))
    found = diagnosed(run_of(np.asarray(one), URM6), run_of(np.asarray(other), URM6))
    assert found.unexplained.is_unrelated_motion
    assert found.summary.startswith("probably different motions: rms ")


def test_in_one_pose_the_tool_that_a_recorded_position_lacks_is_a_hypothesis() -> None:
    q = np.tile(joints()[300], (20, 1))
    (position,), (rotation,) = poses_over_log(URM6, q[:1])
    tool = np.array([0.0034, 0.0013, 0.15])
    recorded = np.tile(position + rotation @ tool, (20, 1))
    found = diagnosed_record(run_of(q, URM6, recorded))
    assert found.causes == ()
    kinds = [[cause.kind for cause in one.causes] for one in found.undecided]
    assert kinds == [["tool_shift"], ["base_shift"], []]
    assert found.undecided[0].causes[0].value == pytest.approx(tool, abs=1e-12)
    assert found.unexplained.interpretation == "the log is at rest: one pose"
    assert found.unexplained.rms < 1e-12
    near = diagnosed_record(run_of(q, URM6, recorded - 0.99 * (rotation @ tool)))
    assert near.undecided == ()  # 1.5 mm are within the tolerance


@pytest.mark.slow
@pytest.mark.skipif(not TRACKER.exists(), reason=f"no {TRACKER}")
def test_a_sign_and_a_zero_of_a_real_arm_are_found_by_a_laser_tracker() -> None:
    run = tracked()
    rows = np.sort(np.random.default_rng(0).choice(len(run.q), POSES, replace=False))
    assert answer(diagnosed_record(drawn(run, rows))) == []
    turned, off = run.q.copy(), run.q.copy()
    turned[:, 2] *= -1.0
    off[:, 3] += np.radians(0.5)
    own = ("own_geometry", (), None)  # fitted with each cause, and named with it
    wanted = [("joint_sign", ("elbow_joint",), None), own]
    assert answer(diagnosed_record(drawn(run, rows, turned))) == wanted
    wanted = [("joint_offset", ("wrist_1_joint",), None), own]
    assert answer(diagnosed_record(drawn(run, rows, off))) == wanted
