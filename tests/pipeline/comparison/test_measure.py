"""What is measured beside delta: orientation, joints, path and speed, where a side has gaps or lacks them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from asserting import there
from made_runs import path_run, run_of
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import RotationForm, translation
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, tcp_trajectory
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.measure import MIN_STD, Quantity, compute_statistics, correlation, measure
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources import ReadOptions
from urmpipe_pipeline.trajectories import Sync, match

LOGS = Path(__file__).parents[3] / "datasets" / "urmpipe_datasets" / "logs"
TURN = 2 * np.pi
T = np.linspace(0.0, 5.0, 300)


def planar(kinds: str = "rrp") -> Chain:
    """An arm of joints that turn (r) or slide (p)."""
    words = {"r": "revolute", "p": "prismatic"}
    joints = tuple(Joint(f"j{k}", words[kind]) for k, kind in enumerate(kinds))  # type: ignore[arg-type]
    return Chain("arm", joints, tip=translation(0.3, 0.0, 0.0))


def arm_run(q: FloatArray, names: tuple[str, ...], kinds: str = "rrp", name: str = "log") -> Run:
    return run_of(q, planar(kinds), name=name, joints=names)


def joints() -> FloatArray:
    return np.column_stack([np.sin(T), 1.0 + 0.5 * np.cos(T), 0.1 * T])


NAMES = ("a", "b", "s")
TWO = ((0.005, "path"), (0.0047, "log"))


def held(reference: Run, log: Run, **tolerance: float) -> Deviation:
    return compare_runs(reference, [log], CompareOptions(tolerance or {"axis": 1e9})).runs[0]


# Joints


def test_joints_are_held_against_each_other_in_their_units() -> None:
    off = np.array([0.01, -0.02, 0.003])
    found = held(arm_run(joints() + off, NAMES), arm_run(joints(), NAMES))
    np.testing.assert_allclose(there(found.joint_delta), np.tile(off, (300, 1)), atol=1e-15)
    units = {name: one.unit for name, one in found.joint_statistics.items()}
    assert units == {"a": "rad", "b": "rad", "s": "m"}
    assert found.joint_turns == (0, 0, 0)


def test_joints_of_the_same_names_are_matched_by_name_and_others_by_place() -> None:
    q = joints()[:, [0, 1, 0]]
    by_name = held(arm_run(q[:, [1, 0, 2]], ("b", "a", "c"), "rrr"), arm_run(q, ("a", "b", "c"), "rrr"))
    assert np.abs(there(by_name.joint_delta)).max() == 0.0
    by_place = held(arm_run(q, ("x", "y", "z"), "rrr"), arm_run(q, ("a", "b", "c"), "rrr"))
    assert np.abs(there(by_place.joint_delta)).max() == 0.0
    assert list(by_place.joint_statistics) == ["a", "b", "c"]


def test_turns_counted_apart_at_the_start_are_no_deviation() -> None:
    off = np.array([TURN + 0.01, -3 * TURN - 0.02, 0.0])
    found = held(arm_run(joints() + off, NAMES), arm_run(joints(), NAMES))
    assert found.joint_turns == (1, -3, 0)
    np.testing.assert_allclose(there(found.joint_delta)[:, :2], [[0.01, -0.02]] * 300, atol=1e-14)


def test_a_start_beside_half_a_turn_is_counted_to_the_near_side() -> None:
    near = np.column_stack([np.full(300, np.pi - 0.01), np.zeros(300), np.zeros(300)])
    other = near * np.array([-1.0, 1.0, 1.0])  # -pi + 0.01: 0.02 further on
    found = held(arm_run(near, NAMES), arm_run(other, NAMES))
    assert found.joint_turns == (1, 0, 0)
    assert found.joint_statistics["a"].max == pytest.approx(0.02, abs=1e-14)


def test_a_turn_lost_on_the_way_stays_a_deviation_where_it_happens() -> None:
    q = joints()
    q[100:, 0] += TURN
    found = held(arm_run(q, NAMES), arm_run(joints(), NAMES), joint=0.1)
    assert (found.joint_turns, found.verdict) == ((0, 0, 0), "fail")
    assert np.flatnonzero(found.out_of_tolerance)[0] == 100
    assert found.joint_statistics["a"].max == pytest.approx(TURN, abs=1e-14)


def test_a_wild_first_sample_does_not_put_the_others_a_turn_out() -> None:
    q = joints()
    q[0, 0] += TURN
    found = held(arm_run(q, NAMES), arm_run(joints(), NAMES), joint=0.1)
    assert found.joint_turns == (0, 0, 0)
    assert np.flatnonzero(found.out_of_tolerance).tolist() == [0]


def test_joints_that_slide_have_no_turns() -> None:
    found = held(arm_run(joints() + [0.0, 0.0, 7.0], NAMES), arm_run(joints(), NAMES))  # noqa: RUF005
    assert found.joint_turns == (0, 0, 0)
    assert found.joint_statistics["s"].mean == pytest.approx(7.0, abs=1e-14)


# Orientations


def poses(count: int) -> tuple[FloatArray, Rotation]:
    rng = np.random.default_rng(3)
    return rng.uniform(-1, 1, (count, 3)), Rotation.random(count, rng=rng)


FORMS: list[tuple[RotationForm, str]] = [
    ("vector", "rotvec"), ("rpy", "xyz"), ("zyx", "ZYX"), ("xyz", "XYZ"), ("zyz", "ZYZ"), ("zxz", "ZXZ"),
    ("quat_xyzw", "quat"), ("matrix", "matrix"),
]  # fmt: skip


def recorded(rotation: Rotation, way: str) -> FloatArray:
    """SciPy's columns of an orientation."""
    if way == "rotvec":
        return rotation.as_rotvec()
    if way == "quat":
        return rotation.as_quat()
    if way == "matrix":
        return rotation.as_matrix().reshape(-1, 9)
    return rotation.as_euler(way)  # type: ignore[call-overload,no-any-return]


@pytest.mark.parametrize(("form", "way"), FORMS)
def test_the_angle_is_that_between_recorded_orientations_of_any_form(form: RotationForm, way: str) -> None:
    position, rotation = poses(50)
    turned = rotation * Rotation.from_rotvec([0.0, 0.3, 0.4])
    found = held(
        path_run(position, rotation.as_quat(), "quat_xyzw"),
        path_run(position, recorded(turned, way), form, name="log"),
    )
    np.testing.assert_allclose(there(found.angle), 0.5, atol=1e-14)  # some tens of rounding errors
    assert (found.statistics["angle"].unit, found.statistics["angle"].kind) == ("rad", "angle")


def test_the_reference_turns_on_the_great_arc_between_its_samples() -> None:
    position, rotation = poses(20)
    wanted = Slerp(np.arange(20.0), rotation)(np.arange(0, 19.01, 0.25))
    at = np.column_stack(
        [np.interp(np.arange(0, 19.01, 0.25), np.arange(20), column) for column in position.T]
    )
    found = held(
        path_run(position, rotation.as_quat(), "quat_xyzw", tsp=0.02),
        path_run(at, wanted.as_quat(), "quat_xyzw", name="log"),
    )
    np.testing.assert_allclose(there(found.angle), 0.0, atol=1e-14)
    assert found.statistics["norm"].max < 1e-14


def test_missing_orientations_leave_the_angle_open_between_their_neighbours() -> None:
    position, rotation = poses(20)
    quat = rotation.as_quat()
    quat[5] = np.nan
    at = np.column_stack(
        [np.interp(np.arange(0, 19.01, 0.5), np.arange(20), column) for column in position.T]
    )
    log = path_run(at, np.tile([0.0, 0, 0, 1], (39, 1)), "quat_xyzw", name="log")
    found = held(path_run(position, quat, "quat_xyzw", tsp=0.01), log, angle=4.0)
    assert np.flatnonzero(np.isnan(there(found.angle))).tolist() == [9, 10, 11]  # 4.5, 5 and 5.5
    assert len(found.sample) == 39
    angle = found.statistics["angle"]
    assert (angle.verdict, angle.samples, angle.missing, angle.out_of_tolerance) == ("fail", 36, 3, 3)
    assert found.out_of_tolerance[[9, 10, 11]].all()
    assert np.isfinite(found.statistics["angle"].rms)


def test_orientations_that_are_missing_throughout_are_none() -> None:
    position, _ = poses(20)
    nothing = np.full((20, 4), np.nan)
    found = held(path_run(position, nothing, "quat_xyzw"), path_run(position, nothing, "quat_xyzw", name="b"))
    assert found.angle is None
    assert "angle" not in found.statistics


# Path


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.3, 3.0))
def test_the_path_is_never_further_than_the_place_at_that_time(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    wanted = np.cumsum(rng.normal(0, 0.01, (120, 3)), axis=0)
    wanted[rng.integers(0, 120, 5)] = np.nan
    done = rng.normal(0, 0.05, (150, 3))
    found = held(path_run(wanted), path_run(done, tsp=0.005 * share, name="log"))
    assert (found.path <= found.delta[:, 3]).all()


# Speed and its correlation


def test_the_speed_of_positions_is_that_of_the_parabola_through_the_neighbours() -> None:
    position = np.column_stack([T**2, 2 * T, np.zeros(300)])
    step = round(T[1], 9)
    found = held(path_run(position, tsp=step), path_run(position, tsp=step, name="b"))
    expected = np.hypot(2 * T, 2.0)
    np.testing.assert_allclose(found.speed[1:-1], expected[1:-1], rtol=1e-7)  # the period rounds to 1 ns
    np.testing.assert_allclose(
        found.speed, np.linalg.norm(np.gradient(position, T, axis=0), axis=1), rtol=1e-7
    )


def test_no_speed_is_taken_across_samples_left_out_and_gaps() -> None:
    position = np.column_stack([T, 0 * T, 0 * T]) * (0.005 / T[1])  # 1 m/s
    log = position.copy()
    log[[50, 52]] = np.nan  # 51 stands alone
    log[53:] += 10.0
    found = held(path_run(position), path_run(log, name="log"))
    lone = int(np.flatnonzero(found.sample == 51)[0])
    assert np.flatnonzero(np.isnan(found.speed)).tolist() == [lone]
    np.testing.assert_allclose(np.delete(found.speed, lone), 1.0, rtol=1e-9)
    gap = replace(found.run, t_ns=found.run.t_ns + np.where(np.arange(300) >= 100, 10**9, 0))
    late = held(path_run(np.tile(position, (2, 1))), gap)
    np.testing.assert_allclose(late.speed[np.isfinite(late.speed)], 1.0, rtol=1e-9)


def test_a_single_sample_has_no_speed() -> None:
    found = held(path_run(np.zeros((1, 3))), path_run(np.zeros((1, 3)), name="log"))
    assert np.isnan(found.speed).tolist() == [True]
    assert found.speed_correlation is None


def test_a_correlation_is_that_of_numpy() -> None:
    rng = np.random.default_rng(6)
    first = rng.normal(size=500)
    second = first + rng.normal(size=500)
    first[3], second[7] = np.nan, np.nan
    both = np.isfinite(first) & np.isfinite(second)
    expected = np.corrcoef(first[both], second[both])[0, 1]
    assert correlation(first, second) == pytest.approx(expected, abs=1e-14)
    assert correlation(second, 2.0 * second) == pytest.approx(1.0, abs=1e-15)
    assert correlation(first, -first) == pytest.approx(-1.0, abs=1e-15)


def test_what_does_not_change_correlates_with_nothing() -> None:
    rng = np.random.default_rng(7)
    speed = rng.uniform(0.0, 0.5, 500)
    rounding = 0.0025 + 1e-16 * rng.integers(-3, 4, 500).astype(np.float64)
    assert correlation(rounding, speed) is None
    assert correlation(speed, np.full(500, 0.3)) is None
    assert correlation(0.0025 + MIN_STD * speed, speed) is None
    assert correlation(0.0025 + 1e-6 * speed, speed) == pytest.approx(1.0, abs=1e-9)  # 1e-16 m of 1e-7 m
    assert correlation(np.full(500, np.nan), speed) is None
    assert correlation(np.array([1.0]), np.array([2.0])) is None


# Blocks of rows


@pytest.mark.parametrize("block_rows", [1, 7, 100, 299])
@pytest.mark.parametrize("kind", ["joints", "poses", "path"])
def test_no_size_of_the_blocks_changes_a_bit(kind: str, block_rows: int) -> None:
    rng = np.random.default_rng(8)
    position, rotation = np.cumsum(rng.normal(0, 0.01, (300, 3)), axis=0), Rotation.random(300, rng=rng)
    quat = np.where(rng.random((300, 1)) < 0.1, np.nan, rotation.as_quat())
    runs = {
        "joints": (arm_run(joints() + rng.normal(0, 0.01, (300, 3)), NAMES), arm_run(joints(), NAMES)),
        "poses": tuple(path_run(position, quat, tsp=tsp, name=name) for tsp, name in TWO),
        "path": tuple(path_run(position, tsp=tsp, name=name) for tsp, name in TWO),
    }[kind]
    reference, log = (replace(tcp_trajectory(run), discontinuities=np.array([40, 41])) for run in runs)
    late = np.where(np.arange(300) < 200, 0, 300_000_000)
    reference, log = (replace(side, t_ns=side.t_ns + late) for side in (reference, log))
    missing = log.position.copy()
    missing[rng.integers(0, 300, 9)] = np.nan
    log = replace(log, position=missing)

    def measured(**sizes: int) -> Deviation:
        matched = match(reference, log, Sync("given", 0.0123), **sizes)
        assert len(matched.sample) > 200
        return measure(runs[1], reference, log, matched, {"axis": 0.01, "coverage": 0.9}, **sizes)

    at_once, in_blocks = measured(), measured(block_rows=block_rows)
    for name in ("sample", "t_ns", "reference", "actual", "delta", "path", "speed", "angle", "joint_delta"):
        first, second = getattr(at_once, name), getattr(in_blocks, name)
        assert (first is None) == (second is None)
        assert first is None or first.tobytes() == second.tobytes()
    assert at_once.to_dict() == in_blocks.to_dict()


def test_sums_are_those_of_parts_of_a_fixed_size() -> None:
    """The mean of 200,000 values, to the last bits; all rows at once would round elsewhere."""
    values = np.random.default_rng(9).normal(1.0, 1.0, 200_000)
    rows = np.arange(len(values))
    found = compute_statistics(Quantity("norm", "norm", "m", values), rows / 1e3, rows, {})
    assert found.mean == pytest.approx(math.fsum(values) / len(values), rel=1e-15)
    assert found.rms == pytest.approx(math.sqrt(math.fsum(values**2) / len(values)), rel=1e-15)
    deviations = (values - found.mean) ** 2
    assert found.std == pytest.approx(math.sqrt(math.fsum(deviations) / len(values)), rel=1e-15)


# The sample logs

PRINTED = 6 * np.radians(0.00005) * 1.35
"""In [m]: four decimals of a degree, six joints, 1.35 m from the first to the tip of a stretched urm6."""


@pytest.fixture(scope="module")
def demo() -> Comparison:
    robot, read = load_robot("urm6"), ReadOptions(unit={"": "rad"})
    path = ingest_log([LOGS / "path.csv"])
    matlab = ingest_log([LOGS / "matlab.csv"], robot=robot, read=read)
    solidworks = ingest_log(log_files(LOGS / "solidworks"), robot=robot, name="solidworks")
    return compare_runs(path, [matlab, solidworks])


@pytest.mark.slow
def test_a_log_that_is_late_deviates_as_fast_as_it_moves(demo: Comparison) -> None:
    """Fig. 9b of [UrmArm2021]_: the norm is largest where the effector is fastest."""
    matlab = demo.runs[0]
    assert there(matlab.speed_correlation) > 0.9999
    assert matlab.speed[matlab.worst] > 0.999 * matlab.speed.max()


@pytest.mark.slow
def test_the_base_of_solidworks_stands_two_and_a_half_millimetres_off(demo: Comparison) -> None:
    norm = demo.runs[1].statistics["norm"]
    assert norm.mean == pytest.approx(2.5e-3, abs=1e-7)  # roundings mean out over 7383 samples
    assert np.abs(demo.runs[1].delta[:, 3] - 2.5e-3).max() < PRINTED


def test_start_takes_the_base_of_solidworks_away(demo: Comparison) -> None:
    reference = ingest_log([LOGS / "path.csv"])
    found = compare_runs(reference, [demo.runs[1].run], CompareOptions(align="start")).runs[0]
    assert found.alignment.translation == pytest.approx((1.5e-3, -1.2e-3, 1.6e-3), abs=PRINTED)
    assert found.alignment.moved(found.actual).max() == pytest.approx(2.5e-3, abs=PRINTED)
    assert found.statistics["norm"].max < 2 * PRINTED  # what rounding leaves here and at the start
