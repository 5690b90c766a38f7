"""Diagnoses of two sides: a reference with few samples, recorded tool centre points, units, other robots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import urmpipe
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import Transform
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.presenter import remedy_hints
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.runs.run import Run

UR5E = load_robot("ur5e")
ZERO = np.radians([0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
"""What one log reads too high: 0.5 deg of its third joint."""

SPARSE, DENSE = np.arange(0.0, 6.01, 0.05), np.arange(0.0, 6.0005, 0.001)


def moved(t: FloatArray, often: float = 0.4) -> FloatArray:
    """Return joints that swing by 18 to 40 deg, about `often` times a second, shape (n, 6)."""
    wide, rest = (
        np.radians([35.0, 20.0, 25.0, 18.0, 22.0, 40.0]),
        np.radians([0.0, -90.0, 90.0, -90.0, -90.0, 0.0]),
    )
    waves = often * np.array([0.78, 1.18, 0.93, 1.33, 1.03, 0.73])
    return np.asarray(rest + wide * np.sin(2.0 * np.pi * waves * t[:, np.newaxis] + np.arange(6)))


def place(q: FloatArray) -> FloatArray:
    """Return where the arm is, shape (n, 3)."""
    return poses_over_log(UR5E, q)[0]


def side(
    t: FloatArray, q: FloatArray | None = None, tcp: FloatArray | None = None, name: str = "side"
) -> Run:
    """Return a run with joints, a recorded tool centre point, or both."""
    robot = None if q is None else UR5E
    return urmpipe.ingest(
        name=name, t=t, q=q, recorded_tcp=tcp, robot=robot, unit=None if q is None else "rad"
    )


def on_lines(t: FloatArray, values: FloatArray) -> FloatArray:
    """Return a reference between its samples as a comparison has it, shape (n, k)."""
    return np.column_stack([np.interp(DENSE, t, column) for column in values.T])


@pytest.mark.parametrize("reads", ["path", "joints", "reversed"])
@pytest.mark.parametrize("stamps", ["even", "uneven with a gap"])
def test_lines_between_few_samples_do_not_change_the_number_of_a_cause(reads: str, stamps: str) -> None:
    """20 Hz and 1 kHz: a line is 0.5 mm (rms) from the motion, and the zero of a joint moves it by 4 mm."""
    t = SPARSE
    if stamps != "even":
        t = np.delete(t, [50, 51, 52]) + np.random.default_rng(1).uniform(-0.01, 0.01, len(t) - 3)
        t[[0, -1]] = SPARSE[[0, -1]]
    commanded, actual = moved(t), moved(DENSE) + ZERO
    if reads == "reversed":
        commanded, actual = moved(t) + ZERO, moved(DENSE)
    reference = side(t, tcp=place(commanded)) if reads == "path" else side(t, commanded)
    log = side(DENSE, tcp=place(actual)) if reads == "reversed" else side(DENSE, actual)
    diagnosis = urmpipe.diagnose(reference, log)
    (cause,) = diagnosis.causes
    assert (cause.kind, cause.name) == ("joint_offset", "elbow_joint")
    assert cause.value[0] == pytest.approx(-ZERO[2], rel=1e-4)
    between = on_lines(t, place(commanded)) - place(actual)
    between = between[np.isin(np.arange(len(DENSE)), diagnosis.sample)]
    assert diagnosis.rms == pytest.approx(np.sqrt((between**2).sum(axis=1).mean()), rel=1e-9)


def test_a_polygon_stays_one() -> None:
    corners = np.random.default_rng(2).uniform(0.2, 0.6, (len(SPARSE[::5]), 3))
    log = on_lines(SPARSE[::5], corners) + np.array([0.0, 0.002, 0.0])
    (cause,) = urmpipe.diagnose(side(SPARSE[::5], tcp=corners), side(DENSE, tcp=log)).causes
    assert (cause.kind, cause.axis) == ("base_shift", (0.0, 1.0, 0.0))
    assert cause.value == pytest.approx((-0.002,), abs=1e-9)


T = np.arange(0.0, 6.0, 0.008)
Q = moved(T, 0.2)
READ, LATE = Q + ZERO, moved(T - 0.02, 0.2)
TOOL = poses_over_log(UR5E, READ)[1] @ [0.0, 0.0, 0.1]
NONE = "neither side recorded a tool centre point"
Recorded = tuple[FloatArray | None, FloatArray | None]
"""The joints of a side, and the joints that lead to its tool centre point."""


@pytest.mark.parametrize(
    ("reference", "log", "agree", "origin", "reason"),
    [
        pytest.param((Q, Q), (READ, None), {"one": True}, "two", "one, diagnosed alone,", id="simulated"),
        pytest.param((READ, None), (Q, Q), {"two": True}, "one", "two, diagnosed alone,", id="exchanged"),
        pytest.param((Q, Q), (READ, Q), {"one": True, "two": False}, "two", "one and two,", id="one agrees"),
        pytest.param((Q, Q), (READ, READ), {"one": True, "two": True}, "", "one and two,", id="both agree"),
        pytest.param((Q, Q), (READ, TOOL), {"one": True, "two": False}, "", "one and two,", id="a tool"),
        pytest.param((Q, None), (READ, Q), {"two": False}, "two", "two, diagnosed alone,", id="as the other"),
        pytest.param((Q, None), (READ, None), {}, "", NONE, id="none"),
        pytest.param((None, Q), (READ, Q), {"two": False}, "two", "", id="a path that the record follows"),
        pytest.param((None, Q), (READ, READ), {"two": True}, "", "", id="a path that nothing follows"),
        pytest.param((Q, Q), (LATE, LATE), {"one": True, "two": True}, "", "one and two,", id="a clock"),
    ],
)
def test_the_side_that_disagrees_with_its_tool_centre_point_has_the_causes(
    reference: Recorded, log: Recorded, agree: dict[str, bool], origin: str, reason: str
) -> None:
    rng, sides, distances = np.random.default_rng(3), [], {}
    for name, (q, of) in (("one", reference), ("two", log)):
        tcp = place(READ) + TOOL if of is TOOL else None if of is None else place(of)
        tcp = None if tcp is None else tcp + rng.normal(0.0, 5e-5, tcp.shape)
        sides.append(side(T, q, tcp, name))
        if q is not None and tcp is not None:
            distances[name] = np.linalg.norm(place(q) - tcp, axis=1)
    diagnosis = urmpipe.diagnose(sides[0], sides[1])
    assert {check.name: check.agrees for check in diagnosis.recorded_tcp} == agree
    for check in diagnosis.recorded_tcp:
        assert check.rms == pytest.approx(np.sqrt((distances[check.name] ** 2).mean()), rel=1e-9)
        assert check.max == pytest.approx(distances[check.name].max(), rel=1e-9)
    assert diagnosis.origin == origin
    assert diagnosis.summary.endswith(f"that is in {origin}") is bool(origin)
    reasons = [causes.reason for causes in diagnosis.untested if "link_length" in causes.kinds]
    assert [reason in text for text in reasons] == ([True] if reason else [])


@pytest.mark.parametrize("elbow", [0.0, 0.5])
def test_a_joint_that_turns_about_the_tool_centre_point_is_named_separately(elbow: float) -> None:
    """The last joint of a UR5e moves no tool centre point, and here breaks its tolerance."""
    off = np.radians([0.0, 0.0, elbow, 0.0, 0.0, 1.0])
    diagnosis = urmpipe.diagnose(side(T, Q), side(T, Q + off), tolerance="axis=3.5mm,joint=0.6deg")
    assert {cause.name for cause in diagnosis.causes} == {*["elbow_joint"] * (elbow > 0.0), "wrist_3_joint"}
    chain, _, separate = diagnosis.summary.rpartition("wrist_3_joint")
    assert separate == " reads 1 deg too high (this turns the TCP, but does not move it)"
    assert ("elbow_joint reads 0.5 deg too high: rms" in chain) is (elbow > 0.0)
    assert diagnosis.verdict == "fail"


@pytest.mark.parametrize(
    ("tolerance", "breaks"), [("x=10mm,y=1mm,z=10mm", False), ("x=4mm,y=10mm,z=10mm", True)]
)
def test_a_cause_breaks_the_tolerance_of_its_axis(tolerance: str, breaks: bool) -> None:
    path = side(T, tcp=place(Q) + np.array([0.005, 0.0, 0.0]))
    diagnosis = urmpipe.diagnose(path, side(T, Q), tolerance=tolerance)
    (cause,) = diagnosis.causes
    expected = ("base_shift", breaks, "fail" if breaks else "pass")
    assert (cause.kind, cause.exceeds_tolerance, diagnosis.verdict) == expected


def robots_differ() -> Diagnosis:
    """A tool of 100 mm is known to one side only."""
    longer = UR5E.placed(tool=Transform(translation=(0.0, 0.0, 0.1)))
    return urmpipe.diagnose(urmpipe.ingest(t=T, q=Q, unit="rad", robot=longer), side(T, Q))


def rows_lack_a_joint() -> Diagnosis:
    few = Q.copy()
    few[np.arange(len(T)) % (len(T) // 5) != 0, 5] = np.nan
    return urmpipe.diagnose(side(T, tcp=place(Q) + np.array([0.0, 0.0, 0.005])), side(T, few))


def reference_rests() -> Diagnosis:
    return urmpipe.diagnose(side(T, np.tile(Q[0], (len(T), 1))), side(T, tcp=place(Q)))


@pytest.mark.parametrize(
    ("build", "interpretation"),
    [
        (robots_differ, "no change of joints or clock makes the tool centre points agree"),
        (rows_lack_a_joint, "5 samples with all values: fewer than 10"),
        (reference_rests, "the reference is at rest: one pose"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_why_no_cause_is_found(build: Any, interpretation: str) -> None:
    diagnosis = build()
    assert (diagnosis.causes, diagnosis.unexplained.interpretation) == ((), interpretation)
    if build is robots_differ:
        assert diagnosis.summary == f"no cause found: rms 100 mm remains ({interpretation})"


@pytest.mark.parametrize("turn", [-np.pi, np.pi])
def test_of_joints_on_both_sides_half_a_turn_has_a_sense(turn: float) -> None:
    log = Q.copy()
    log[300:, 1] -= turn
    (cause,) = urmpipe.diagnose(side(T, Q), side(T, log)).causes
    assert (cause.kind, cause.from_sample, cause.value) == ("half_turn", 300, (turn,))


def test_a_path_in_mm_is_read_so_and_has_no_exponent() -> None:
    diagnosis = urmpipe.diagnose(side(T, tcp=1000.0 * place(Q)), side(T, Q))
    assert "in mm, read as m: rms " in diagnosis.summary
    assert "e+" not in diagnosis.summary


def test_all_joints_in_degrees_are_corrected_at_once() -> None:
    (run,) = urmpipe.diagnose(side(T, Q), [side(T, np.degrees(Q))]).runs
    (hint,) = remedy_hints(run)
    assert hint.value == dict.fromkeys(run.run.log.joints, "deg")


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["ur10e", "ur3"])
def test_another_robot_on_a_turned_base_is_found_with_it(robot: str) -> None:
    base = Transform(((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)))
    path = poses_over_log(load_robot(robot).placed(base), Q)[0]
    noise = np.random.default_rng(4).normal(0.0, 1e-4, path.shape)
    diagnosis = urmpipe.diagnose(side(T, tcp=path + noise), side(T, Q))
    named = {cause.kind: cause for cause in diagnosis.causes}
    assert {*named} == {"base_rotation", "other_robot"}
    assert named["other_robot"].name == robot
    assert named["base_rotation"].value == pytest.approx((np.pi,))


@pytest.mark.parametrize("factor", [np.pi / 180.0, 180.0 / np.pi])
@pytest.mark.parametrize("others", [False, True])
def test_a_joint_or_all_others_in_another_unit(factor: float, others: bool) -> None:
    wrong = np.full(6, others)
    wrong[3] = not others
    noise = np.random.default_rng(5).normal(0.0, 1e-4, (len(T), 3))
    log = side(T, np.where(wrong, Q / factor, Q))
    (cause,) = urmpipe.diagnose(side(T, tcp=place(Q) + noise), log).causes
    assert cause.kind == "joint_unit"
    assert cause.value == pytest.approx((factor,))
    assert {*cause.joints} == {name for name, is_wrong in zip(log.log.joints, wrong, strict=True) if is_wrong}
