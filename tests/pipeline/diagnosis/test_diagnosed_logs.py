"""Diagnoses of runs: joints on both sides, a path against joints, paths alone, too little to name a cause."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from altered_arm import DURATION, demo_motion, poses, rich_motion, times, uniform
from made_runs import path_run, run_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import point_over_log, poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.runs.run import Run

URM6, UR5E = load_robot("urm6"), load_robot("ur5e")
TRACKER = Path(__file__).resolve().parents[4] / "shared/logs/ur10-laser-tracker/measurements_grid.csv"
SAMPLES = 1000
PERIOD = DURATION / (SAMPLES - 1)
Answer = list[tuple[str, tuple[str, ...], int | None]]


def joints(motion: str = "rich") -> FloatArray:
    moved = demo_motion() if motion == "demo" else rich_motion(URM6)
    return np.asarray(moved(times(SAMPLES)))


def against_joints(q: FloatArray, seed: int = 1) -> Diagnosis:
    """A log of joints with 0.02 deg of noise against the commanded ones."""
    noise = np.random.default_rng(seed).normal(0.0, np.radians(0.02), q.shape)
    reference = run_of(joints(), URM6, name="reference", tsp=PERIOD)
    return urmpipe.diagnose(reference, run_of(q + noise, URM6, tsp=PERIOD))


def against_path(q: FloatArray, motion: str = "rich") -> Diagnosis:
    """A log of joints against the commanded path, +-3.5 mm."""
    position, _ = poses(URM6, joints(motion), oriented=False)
    noisy = uniform(np.random.default_rng(1), position)
    return urmpipe.diagnose(path_run(noisy.T, tsp=PERIOD), run_of(q, URM6, tsp=PERIOD))


def answer(diagnosis: Diagnosis) -> Answer:
    """The causes, of which none is undecided."""
    assert not diagnosis.undecided
    return [(cause.kind, cause.joints, cause.from_sample) for cause in diagnosis.causes]


def altered(kind: str, j: int = 0, motion: str = "rich") -> FloatArray:
    """Joints with an error of one of them; `first` has its row."""
    q = joints(motion)
    if kind == "joints_swapped":
        return q[:, [0, 4, 2, 3, 1, 5]]
    first = FIRST.get(kind, 0)
    q[first:, j] *= -1.0 if kind in ("joint_sign", "mirrored") else 1.0
    q[first:, j] += {"turns": -2.0 * np.pi, "half_turn": np.pi, "joint_offset": np.radians(0.1)}.get(
        kind, 0.0
    )
    return q


FIRST = {"turns": 300, "half_turn": 400, "mirrored": 600}
SIGNS = [pytest.param("joint_sign", j, seed, marks=pytest.mark.slow) for seed, j in enumerate((0, 3, 5))]
TURNS = [pytest.param("turns", j, seed, marks=pytest.mark.slow) for seed, j in enumerate((1, 4, 4))]


@pytest.mark.parametrize(("kind", "j", "seed"), [("", 0, 1), ("joint_offset", 2, 1), *SIGNS, *TURNS])
def test_an_error_of_a_joint_is_named_with_its_row_from_joints_on_both_sides(
    kind: str, j: int, seed: int
) -> None:
    diagnosis = against_joints(altered(kind, j), seed=seed)
    assert answer(diagnosis) == ([(kind, (f"q{j + 1}",), FIRST.get(kind))] if kind else [])
    if kind == "joint_offset":
        (cause,) = diagnosis.causes
        assert cause.low[0] < -np.radians(0.1) < cause.high[0]


def test_an_exchange_of_joints_is_named() -> None:
    assert answer(against_joints(altered("joints_swapped"))) == [("joints_swapped", ("q2", "q5"), None)]


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["demo", "rich"])
@pytest.mark.parametrize(
    ("kind", "j", "within"),
    [*(("half_turn", j, 0) for j in (0, 3, 5)), *(("mirrored", j, 7) for j in (1, 2, 4))],
)
def test_half_a_turn_and_a_mirrored_angle_are_found_at_the_tool_centre_point(
    motion: str, kind: str, j: int, within: int
) -> None:
    ((found, names, first),) = answer(against_path(altered(kind, j, motion), motion))
    assert (found, names) == (kind, (f"q{j + 1}",))
    assert first is not None
    assert abs(first - FIRST[kind]) <= within


@pytest.mark.parametrize(("kind", "step"), [("joint_sign", 0), ("joint_sign", 97), ("joint_offset", 97)])
def test_one_cause_is_named_alone_also_where_cells_of_a_joint_that_moves_no_point_are_empty(
    kind: str, step: int
) -> None:
    s = np.clip((times(400) / DURATION - 0.2) / 0.6, 0.0, 1.0)
    q = np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), np.linspace(0.5, 1.2, 6)) + np.linspace(0.1, 0.3, 6)
    position = poses(UR5E, q, oriented=False)[0] + np.random.default_rng(1).normal(0.0, 5e-5, (3, 400))
    q[:, 1] = -q[:, 1] if kind == "joint_sign" else q[:, 1] + 0.01
    if step:
        q[::step, 5] = np.nan
    period = DURATION / 399
    diagnosis = urmpipe.diagnose(path_run(position.T, tsp=period), run_of(q, UR5E, tsp=period))
    assert answer(diagnosis) == [(kind, ("q2",), None)]


def test_a_path_that_stands_elsewhere_has_another_base() -> None:
    position = poses(URM6, joints(), oriented=False)[0].T
    shift = np.array([1.5e-3, -1.2e-3, 1.6e-3])
    log = path_run(position + shift, name="log", tsp=PERIOD)
    diagnosis = urmpipe.diagnose(path_run(position, tsp=PERIOD), log)
    assert answer(diagnosis) == [("base_shift", (), None)]
    # what is added to the log so that the sides agree, to a hundredth of the tolerance
    np.testing.assert_allclose(diagnosis.causes[0].value, -shift, atol=3.5e-5)


@pytest.mark.slow
def test_the_unexplained_rms_is_that_of_the_residual() -> None:
    q = joints()
    q[:, 1] += 0.01
    diagnosis = against_path(q)
    known = diagnosis.residual[np.isfinite(diagnosis.residual).all(axis=1)]
    assert diagnosis.unexplained.rms == pytest.approx(float(np.sqrt((known**2).sum(axis=1).mean())))
    assert diagnosis.causes[-1].rms_after == pytest.approx(diagnosis.unexplained.rms)


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        (slice(1), "1 sample: fewer than 10"),
        (slice(9), "9 samples: fewer than 10"),
        ([300] * 100, "the log is at rest: one pose"),
    ],
)
def test_of_few_samples_or_one_pose_nothing_is_named(rows: Any, reason: str) -> None:
    q = joints()[rows]
    position = poses(URM6, q, oriented=False)[0].T
    diagnosis = urmpipe.diagnose(path_run(position + 0.1, tsp=PERIOD), run_of(q, URM6, tsp=PERIOD))
    assert (diagnosis.causes, diagnosis.undecided) == ((), ())
    assert diagnosis.untested[0].reason == reason
    assert diagnosis.rms == diagnosis.unexplained.rms == pytest.approx(0.1 * np.sqrt(3.0))


@pytest.mark.parametrize("seed", range(2))
def test_lines_between_the_samples_of_the_reference_are_no_cause(seed: int) -> None:
    """125 Hz, read at 100 Hz: lines lie h^2 q'' / 12 from the motion, as a joint that yields would."""

    def moved(t: FloatArray) -> FloatArray:
        """Return joints that swing by 18 to 40 deg, 5 to 9 s a period."""
        wide = np.radians([35.0, 20.0, 25.0, 18.0, 22.0, 40.0])
        often = np.array([0.11, 0.17, 0.13, 0.23, 0.19, 0.29])
        rest = np.radians([0.0, -90.0, 90.0, -90.0, -90.0, 0.0])
        return np.asarray(rest + wide * np.sin(2.0 * np.pi * often * t[:, np.newaxis] + np.arange(6)))

    reference = run_of(moved(np.linspace(0.0, 2499 * 0.008, 2500)), UR5E, name="reference", tsp=0.008)
    q = moved(np.linspace(-0.04, 19.85, 1990))
    q[:, 2] += np.radians(0.5)
    noise = np.random.default_rng(seed).normal(0.0, np.radians(0.003), q.shape)
    diagnosis = urmpipe.diagnose(reference, run_of(q + noise, UR5E, tsp=0.01))
    assert {kind for kind, *_ in answer(diagnosis)} == {"time_lag", "joint_offset"}


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


def test_of_equivalent_causes_that_of_full_size_is_named(tmp_path: Path) -> None:
    """A tilt below the elbow moves the tool as the elbow's zero does, up to 1.2 deg squared."""
    (tmp_path / "scara.toml").write_text(SCARA, "utf-8")
    scara, t = load_robot(tmp_path / "scara.toml"), np.arange(400) * PERIOD * 2.0
    waves = [0.8 * np.sin(t), 0.5 + 0.6 * np.sin(1.7 * t), 0.05 + 0.04 * np.sin(2.3 * t), np.sin(0.9 * t)]
    q = np.column_stack(waves)
    position, _ = poses(scara, q, oriented=False)
    q += np.random.default_rng(3).normal(0.0, 1e-5, q.shape)
    q[:, 1] -= np.radians(1.2)
    path, log = path_run(position.T, tsp=2.0 * PERIOD), run_of(q, scara, tsp=2.0 * PERIOD)
    diagnosis = urmpipe.diagnose(path, log)
    assert answer(diagnosis) == [("joint_offset", ("q2",), None)]
    (cause,) = diagnosis.causes
    # what shifts the forearm sideways by 5.8 mm leaves less than the floor; a tilt does not
    assert cause.equivalents == ("segment 2 sideways y", "segment 3 sideways y")
    assert cause.value[0] == pytest.approx(np.radians(1.2), abs=1e-5)  # noise is 1e-5 a sample


def test_motions_that_have_nothing_in_common_are_unrelated() -> None:
    runs = [run_of(np.asarray(rich_motion(URM6, seed)(times(100))), URM6) for seed in (1, 2)]
    diagnosis = urmpipe.diagnose(runs[0], runs[1])
    assert diagnosis.unexplained.is_unrelated_motion
    assert diagnosis.summary.startswith("probably different motions: rms ")


def test_in_one_pose_the_tool_that_a_recorded_position_lacks_is_a_hypothesis() -> None:
    q = np.tile(joints()[300], (20, 1))
    (position,), (rotation,) = poses_over_log(URM6, q[:1])
    tool = np.array([0.0034, 0.0013, 0.15])
    recorded = np.tile(position + rotation @ tool, (20, 1))
    diagnosis = urmpipe.diagnose(run_of(q, URM6, recorded))
    assert diagnosis.causes == ()
    kinds = [[cause.kind for cause in alternative.causes] for alternative in diagnosis.undecided]
    assert kinds == [["tool_shift"], ["base_shift"], []]
    assert diagnosis.undecided[0].causes[0].value == pytest.approx(tool, abs=1e-12)
    assert diagnosis.unexplained.interpretation == "the log is at rest: one pose"
    assert diagnosis.unexplained.rms < 1e-12
    near = urmpipe.diagnose(run_of(q, URM6, recorded - 0.99 * (rotation @ tool)))
    assert near.undecided == ()  # 1.5 mm are within the tolerance


@pytest.mark.slow
@pytest.mark.skipif(not TRACKER.exists(), reason=f"no {TRACKER}")
def test_a_sign_and_a_zero_of_a_real_arm_are_found_by_a_laser_tracker() -> None:
    run = urmpipe.ingest(TRACKER, robot="ur10")
    rows = np.sort(np.random.default_rng(0).choice(len(run.q), 300, replace=False))
    turned, off = run.q.copy(), run.q.copy()
    turned[:, 2] *= -1.0
    off[:, 3] += np.radians(0.5)
    own = ("own_geometry", (), None)  # fitted with each cause, and named with it
    cases: list[tuple[FloatArray, Answer]] = [
        (run.q, []),
        (turned, [("joint_sign", ("elbow_joint",), None), own]),
        (off, [("joint_offset", ("wrist_1_joint",), None), own]),
    ]
    for q, expected in cases:
        assert answer(urmpipe.diagnose(with_joints(run, q[rows], rows))) == expected


def with_joints(run: Run, q: FloatArray, rows: Any) -> Run:
    """Return some static poses of a run, with other joints in [rad]."""
    assert run.robot is not None

    def arrays_of(record: Any) -> dict[str, Any]:
        arrays = ((field.name, getattr(record, field.name)) for field in fields(record))
        return {name: a[rows] for name, a in arrays if isinstance(a, np.ndarray) and len(a) == len(run.q)}

    log = replace(run.log, **{**arrays_of(run.log), "q": q})
    tcp = point_over_log(run.robot, q, run.qd[rows], run.qdd[rows])
    return replace(run, **{**arrays_of(run), "log": log, "q": q, "tcp": tcp, "audit": ()})
