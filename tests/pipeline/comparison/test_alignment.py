"""Moving a log in space: what each alignment takes out of a deviation, and what it leaves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asserting import refusal, there
from made_runs import path_run, run_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import Transform, from_offset, from_rpy
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.align import MIN_BREADTH, apply_alignment, frame_to_option
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.presenter import deviation_facts
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.section import Advice
from urmpipe_pipeline.runs.ingest import with_robot
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import Alignment, AlignMode

ROUNDING = 1e-12
"""Positions of some metres round at 1e-15, a fit over hundreds of them at some tens of that."""

TRACKER = Path(__file__).resolve().parents[4] / "shared/logs/ur10-laser-tracker/measurements_grid.csv"

FRAME = Rotation.from_rotvec([0.3, -0.5, 0.4])
SHIFT = np.array([0.2, -0.1, 0.4])
OFFSET = np.array([0.01, -0.02, 0.15])


def motion(count: int = 200) -> tuple[FloatArray, Rotation]:
    t = np.linspace(0.0, 5.0, count)
    position = np.column_stack([np.sin(t), np.cos(1.3 * t), 0.3 * t])
    return position, Rotation.from_euler("ZYX", np.column_stack([t, 0.5 * np.sin(t), 0.2 * t]))


def aligned(reference: Run, log: Run, mode: AlignMode) -> Deviation:
    return compare_runs(reference, [log], CompareOptions(align=mode)).runs[0]


def assert_formula(found: Alignment, before: FloatArray, turn: Rotation | None, after: FloatArray) -> None:
    """p' = R p + t + R' tool, as the docstring of `Alignment` says."""
    rotation = Rotation.from_matrix(found.rotation)
    expected = rotation.apply(before) + found.translation
    if turn is not None:
        expected = expected + (rotation * turn).apply(found.tool)
    np.testing.assert_allclose(after, expected, atol=ROUNDING)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0, abs=ROUNDING)
    moved = np.linalg.norm(after - before, axis=1)
    np.testing.assert_allclose(found.moved(after), moved, atol=ROUNDING)


@pytest.mark.parametrize("mode", ["start", "rigid"])
def test_a_motion_that_stands_elsewhere_is_brought_back(mode: AlignMode) -> None:
    position, turn = motion()
    before = FRAME.apply(position) + SHIFT
    log = path_run(before, (FRAME * turn).as_quat(), name="log")
    found = aligned(path_run(position, turn.as_quat()), log, mode)
    np.testing.assert_allclose(found.actual, position, atol=ROUNDING)
    np.testing.assert_allclose(there(found.angle), 0.0, atol=ROUNDING)
    assert found.alignment.mode == mode
    assert found.alignment.angle == pytest.approx(FRAME.magnitude(), abs=ROUNDING)
    assert found.alignment.tool == (0.0, 0.0, 0.0)
    assert_formula(found.alignment, before, None, found.actual)


def test_nothing_is_moved_without_being_asked() -> None:
    position, _ = motion()
    found = aligned(path_run(position), path_run(position + SHIFT, name="log"), "none")
    assert found.alignment == Alignment()
    assert found.alignment.angle == 0.0
    assert found.alignment.moved(found.actual).max() == 0.0
    np.testing.assert_array_equal(found.actual, position + SHIFT)


@pytest.mark.parametrize("lacking", ["reference", "log"])
def test_start_moves_by_the_translation_alone_where_a_side_has_no_orientation(lacking: str) -> None:
    position, turn = motion()
    quats = {name: None if name == lacking else turn.as_quat() for name in ("reference", "log")}
    reference = path_run(position, quats["reference"])
    found = aligned(reference, path_run(FRAME.apply(position) + SHIFT, quats["log"], name="log"), "start")
    assert found.alignment.rotation == Alignment().rotation
    np.testing.assert_allclose(found.delta[0], 0.0, atol=1e-15)
    np.testing.assert_allclose(found.actual, FRAME.apply(position - position[0]) + position[0], atol=ROUNDING)
    assert found.angle is None


def test_start_goes_by_the_first_pose_that_both_sides_have() -> None:
    position, turn = motion()
    quat = (FRAME * turn).as_quat()
    quat[:7] = np.nan
    found = aligned(
        path_run(position, turn.as_quat()), path_run(FRAME.apply(position), quat, name="log"), "start"
    )
    assert len(found.sample) == 200
    np.testing.assert_allclose(found.actual, position, atol=ROUNDING)
    assert np.isnan(there(found.angle)).tolist() == [True] * 7 + [False] * 193
    assert found.statistics["angle"].sample_max >= 7


def test_a_mirrored_motion_is_turned_and_not_mirrored_back() -> None:
    position, _ = motion()
    found = aligned(path_run(position), path_run(position * np.array([1.0, 1.0, -1.0]), name="log"), "rigid")
    assert np.linalg.det(found.alignment.rotation) == pytest.approx(1.0, abs=ROUNDING)
    assert found.statistics["norm"].max > 0.1


def test_a_motion_in_a_plane_is_aligned() -> None:
    position = motion()[0] * np.array([1.0, 1.0, 0.0])
    found = aligned(path_run(position), path_run(FRAME.apply(position) + SHIFT, name="log"), "rigid")
    assert found.statistics["norm"].max < ROUNDING
    assert found.alignment.angle == pytest.approx(FRAME.magnitude(), abs=ROUNDING)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_small_motion_more_makes_a_rigid_alignment_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wanted, done = rng.normal(size=(2, 30, 3))
    found = aligned(path_run(wanted), path_run(done, name="log"), "rigid")
    best = float((found.delta[:, 3] ** 2).sum())
    for _ in range(20):
        turn, shift = Rotation.from_rotvec(rng.normal(0, 0.01, 3)), rng.normal(0, 0.01, 3)
        assert ((turn.apply(found.actual) + shift - wanted) ** 2).sum() >= best - ROUNDING


def test_what_just_leaves_a_line_is_aligned() -> None:
    position = np.column_stack(
        [np.linspace(-1, 1, 100), np.tile([2 * MIN_BREADTH, -2 * MIN_BREADTH], 50), np.zeros(100)]
    )
    found = aligned(path_run(position), path_run(FRAME.apply(position), name="log"), "rigid")
    assert found.statistics["norm"].max < ROUNDING


def test_a_tool_is_found_and_stored() -> None:
    position, turn = motion()
    reference = position + turn.apply(OFFSET)
    found = aligned(path_run(reference), path_run(position, turn.as_quat(), name="log"), "tool")
    np.testing.assert_allclose(found.alignment.tool, OFFSET, atol=ROUNDING)
    assert found.alignment.rotation == Alignment().rotation
    assert found.alignment.translation == (0.0, 0.0, 0.0)
    assert found.statistics["norm"].max < ROUNDING
    assert_formula(found.alignment, position, turn, found.actual)


def test_the_tool_is_the_one_of_the_least_squares() -> None:
    rng = np.random.default_rng(1)
    position, turn = motion()
    reference = position + turn.apply(OFFSET) + rng.normal(0, 0.01, position.shape)
    found = aligned(path_run(reference), path_run(position, turn.as_quat(), name="log"), "tool")
    rows, right = turn.as_matrix().reshape(-1, 3), (reference - position).ravel()
    np.testing.assert_allclose(found.alignment.tool, np.linalg.lstsq(rows, right)[0], atol=ROUNDING)


def test_samples_without_an_orientation_cannot_carry_a_tool_and_are_left_out() -> None:
    position, turn = motion()
    quat = turn.as_quat()
    quat[[0, 50]] = np.nan
    result = compare_runs(
        path_run(position + turn.apply(OFFSET)),
        [path_run(position, quat, name="log")],
        CompareOptions(align="tool"),
    )
    found = result.runs[0]
    assert (found.left_out, len(found.sample), found.sample[0]) == (2, 198, 1)
    assert found.statistics["norm"].max < ROUNDING
    assert [w.message for w in result.warnings] == ["2 of 200 samples have no reference or no value"]


def arm_run(recorded_with: Transform, tool: Transform | None = None) -> Run:
    """A log of a UR5e that recorded its pose with one tool, and whose kinematics have another."""
    bare = load_robot("ur5e")
    t = np.linspace(0, 4, 300)
    q = np.column_stack([0.6 * np.sin((1 + 0.3 * k) * t) + 0.5 * k - 1.2 for k in range(6)])
    position, rotation = poses_over_log(bare.placed(tool=recorded_with), q)
    return run_of(q, bare.placed(tool=tool), position, rotation.reshape(-1, 9), "matrix")


@pytest.mark.parametrize("own", [(), (0.0, 0.0, 0.1), (0.01, 0.0, 0.1, 0.5, -0.4, 1.0)])
def test_the_tool_that_is_advised_takes_the_deviation_away(own: tuple[float, ...]) -> None:
    recorded_with = from_offset((0.02, -0.01, 0.17, *own[3:]))
    run = arm_run(recorded_with, from_offset(own) if own else None)
    found = compare_with_recorded_tcp(run, CompareOptions(align="tool")).runs[0]
    assert found.statistics["norm"].max < ROUNDING
    advised = frame_to_option(apply_alignment(there(run.robot), found.alignment).tool)
    np.testing.assert_allclose(advised, (0.02, -0.01, 0.17, *own[3:]), atol=ROUNDING)
    told = arm_run(recorded_with, from_offset(advised))
    assert compare_with_recorded_tcp(told).runs[0].statistics["norm"].max < ROUNDING


def test_one_log_alone_has_an_angle_between_kinematics_and_record() -> None:
    run = arm_run(from_rpy(0.0, 0.0, 0.25))
    found = compare_with_recorded_tcp(run).runs[0]
    np.testing.assert_allclose(there(found.angle), 0.25, atol=ROUNDING)
    start = compare_with_recorded_tcp(run, CompareOptions(align="start")).runs[0]
    assert (there(start.angle)[0], start.delta[0, 3]) == pytest.approx((0.0, 0.0), abs=ROUNDING)
    assert start.alignment.angle == pytest.approx(0.25, abs=ROUNDING)


def test_one_log_alone_without_a_recorded_orientation_has_no_angle() -> None:
    run = arm_run(Transform())
    run = replace(run, log=replace(run.log, tcp_rotation=None, rotation_form=None))
    assert compare_with_recorded_tcp(run).runs[0].angle is None
    assert (
        compare_with_recorded_tcp(run, CompareOptions(align="tool")).runs[0].statistics["norm"].max < ROUNDING
    )


def test_orientations_turn_with_the_log() -> None:
    position, turn = motion()
    log = path_run(
        FRAME.apply(position), turn.as_quat(), name="log"
    )  # turned in place only, not in orientation
    found = aligned(path_run(position, turn.as_quat()), log, "rigid")
    np.testing.assert_allclose(there(found.angle), FRAME.magnitude(), atol=ROUNDING)


OFFICE = from_offset((2.0, -1.5, 0.7, 0.4, -0.3, 2.5))
"""The base of an arm, as a tracker sees it."""

PROBE = from_offset((0.02, -0.01, 0.17, 0.3, 0.2, -1.4))
"""What the tracker sees, in the frame of the tool."""


def measured_run(noise: float = 0.0, *, turned: bool = True, base: Transform = OFFICE) -> Run:
    """A log of a UR5e whose probe was measured by a device that stands elsewhere, with noise in [m]."""
    bare, run = load_robot("ur5e"), arm_run(Transform())
    position, rotation = poses_over_log(bare.placed(base @ bare.base, bare.tool @ PROBE), run.q)
    position = position + np.random.default_rng(2).normal(0.0, noise, position.shape)
    return run_of(run.q, bare, position, rotation.reshape(-1, 9) if turned else None, "matrix")


@pytest.mark.parametrize("turned", [True, False])
def test_base_and_tool_are_found_at_once(turned: bool) -> None:
    found = compare_with_recorded_tcp(measured_run(turned=turned), CompareOptions(align="base+tool")).runs[0]
    np.testing.assert_allclose(found.alignment.rotation, OFFICE.rotation, atol=1e-9)
    np.testing.assert_allclose(found.alignment.translation, OFFICE.translation, atol=1e-9)
    np.testing.assert_allclose(found.alignment.tool, PROBE.translation, atol=1e-9)
    wanted = PROBE.rotation if turned else np.eye(3)
    np.testing.assert_allclose(found.alignment.tool_rotation, wanted, atol=1e-9)
    assert found.alignment.unobservable == ()
    assert found.statistics["norm"].max < 1e-9
    assert (found.angle is not None) == turned
    if turned:
        assert found.statistics["angle"].max < 1e-7  # half a rounding error of 1 is an angle of 1e-8


def test_a_log_is_moved_onto_the_pose_that_a_reference_measured() -> None:
    run = measured_run()
    reference = path_run(there(run.log.tcp_position), there(run.log.tcp_rotation), "matrix")
    log = replace(run, log=replace(run.log, tcp_position=None, tcp_rotation=None), tcp_recorded=None)
    found = aligned(reference, log, "base+tool")
    np.testing.assert_allclose(found.actual, there(run.log.tcp_position), atol=1e-9)
    np.testing.assert_allclose(found.alignment.translation, OFFICE.translation, atol=1e-9)
    assert found.statistics["angle"].max < 1e-7


def test_the_base_and_the_tool_that_are_advised_give_the_same_deviation() -> None:
    run = measured_run(1e-3)
    result = compare_with_recorded_tcp(run, CompareOptions(align="base+tool"))
    found = result.runs[0]
    assert found.statistics["norm"].rms == pytest.approx(np.sqrt(3) * 1e-3, rel=0.1)
    facts = {fact.name: fact.value for fact in deviation_facts(found, result)}
    advice = facts["To apply this permanently"]
    assert isinstance(advice, Advice)
    base, tool = (from_offset(cast("list[float]", hint.value)) for hint in advice.hints)
    assert [hint.parameter for hint in advice.hints] == ["base", "tool"]
    told = with_robot(run, there(run.robot).placed(base, tool))
    after = compare_with_recorded_tcp(told).runs[0]
    np.testing.assert_allclose(after.delta, found.delta, atol=5e-7)  # 7 digits, of angles on an arm of 1 m
    np.testing.assert_allclose(there(after.angle), there(found.angle), atol=5e-7)


@pytest.mark.parametrize(("align", "asked"), [("start", True), ("tool", False), ("base+tool", False)])
def test_a_doubtful_recorded_orientation_is_asked_for_where_the_alignment_goes_by_it(
    align: AlignMode, asked: bool
) -> None:
    doubt = LogWarning(
        "form", "rx may be a rotation vector", assumption="so", role="rotation", blocks_verdict=True
    )
    run = replace(measured_run(base=Transform()), warnings=(doubt,))
    options = CompareOptions(align=align)
    if asked:
        assert "rx may be a rotation vector" in refusal(LogError, compare_with_recorded_tcp, run, options)
    else:
        assert compare_with_recorded_tcp(run, options).assumptions == ()


def test_samples_without_an_orientation_carry_no_tool_between_base_and_probe() -> None:
    position, turn = motion()
    quat = turn.as_quat()
    quat[[0, 50]] = np.nan
    measured = FRAME.apply(position + turn.apply(OFFSET)) + SHIFT
    found = aligned(path_run(measured), path_run(position, quat, name="log"), "base+tool")
    assert (found.left_out, len(found.sample), found.sample[0]) == (2, 198, 1)
    np.testing.assert_allclose(found.alignment.tool, OFFSET, atol=ROUNDING)


@pytest.mark.slow
@pytest.mark.skipif(not TRACKER.is_file(), reason="no logs of others beside the checkout")
def test_a_probe_at_the_flange_of_a_real_arm_is_found_by_a_laser_tracker() -> None:
    """A fit of base and tool leaves 0.75 to 1.1 mm of a nominal UR10, as its README says."""
    text = TRACKER.read_text().replace(",", ".").splitlines()
    names, values = text[0].split(";"), np.array([row.split(";") for row in text[1:]], dtype=np.float64)
    first, probe = names.index("shoulder_pan_joint"), names.index("measurement_x")
    q, position = values[:, first : first + 6], values[:, probe : probe + 3] / 1e3
    angles = np.radians(values[:, probe + 3 : probe + 6])
    for rotation in (angles, None):
        run = run_of(q, load_robot("ur10"), position, rotation, "xyz")
        result = compare_with_recorded_tcp(run, CompareOptions(align="base+tool"))
        found = result.runs[0]
        assert len(found.sample) == 11911
        assert result.warnings == ()
        assert 0.75e-3 < found.statistics["norm"].rms < 1.1e-3
        if rotation is not None:
            assert found.statistics["angle"].rms < np.radians(0.2)
