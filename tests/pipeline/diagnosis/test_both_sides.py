"""Files of two sides: a reference with few samples, and the tool centre points that the sides recorded."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import urmpipe
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import Transform
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.facts import remedy_hints
from urmpipe_pipeline.diagnosis.result import Diagnosis

UR5E = load_robot("ur5e")
ZERO = np.radians([0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
"""What one log reads too high: 0.5 deg of its third joint."""

SPARSE, DENSE = np.arange(0.0, 6.01, 0.05), np.arange(0.0, 6.0005, 0.001)
Write = Callable[..., Path]


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


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return what writes a log with joints, a tool centre point, or both."""

    def file(name: str, t: FloatArray, q: FloatArray | None = None, tcp: FloatArray | None = None) -> Path:
        columns = {"t [s]": t}
        columns |= {} if q is None else {f"q{k + 1} [rad]": column for k, column in enumerate(q.T)}
        columns |= {} if tcp is None else {f"{k} [m]": column for k, column in zip("xyz", tcp.T, strict=True)}
        there = tmp_path / f"{name}.csv"
        np.savetxt(
            there, np.column_stack([*columns.values()]), "%.15g", ",", header=",".join(columns), comments=""
        )
        return there

    return file


def diagnosed(reference: Path, log: Path, tolerance: float | str = 3.5e-3) -> Diagnosis:
    """Return why a log deviates; that a path is no log is not what is tested."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", urmpipe.UrmpipeWarning)
        return urmpipe.diagnose(reference, log, robot="ur5e", tolerance=tolerance)


def on_lines(t: FloatArray, values: FloatArray) -> FloatArray:
    """Return a reference between its samples as a comparison has it, shape (n, k)."""
    return np.column_stack([np.interp(DENSE, t, column) for column in values.T])


@pytest.mark.parametrize("reads", ["path", "joints", "reversed"])
@pytest.mark.parametrize("stamps", ["even", "uneven with a gap"])
def test_lines_between_few_samples_do_not_change_the_number_of_a_cause(
    write: Write, reads: str, stamps: str
) -> None:
    """20 Hz and 1 kHz: a line is 0.5 mm (rms) from the motion, and the zero of a joint moves it by 4 mm."""
    t = SPARSE
    if stamps != "even":
        t = np.delete(t, [50, 51, 52]) + np.random.default_rng(1).uniform(-0.01, 0.01, len(t) - 3)
        t[[0, -1]] = SPARSE[[0, -1]]
    at, dense = moved(t), moved(DENSE)
    sides = {
        "path": (write("path", t, tcp=place(at)), write("log", DENSE, dense + ZERO)),
        "joints": (write("asked", t, at), write("log", DENSE, dense + ZERO)),
        "reversed": (write("read", t, at + ZERO), write("done", DENSE, tcp=place(dense))),
    }[reads]
    found = diagnosed(*sides)
    ((kind, joint, value),) = [(cause.kind, cause.name, cause.value[0]) for cause in found.causes]
    assert (kind, joint) == ("joint_offset", "elbow_joint")
    assert value == pytest.approx(-ZERO[2], rel=1e-4)
    asked, done = (at + ZERO, dense) if reads == "reversed" else (at, dense + ZERO)
    apart = on_lines(t, place(asked)) - place(done)
    apart = apart[np.isin(np.arange(len(DENSE)), found.sample)]
    assert found.rms == pytest.approx(np.sqrt((apart**2).sum(axis=1).mean()), rel=1e-9)


def test_a_polygon_stays_one(write: Write) -> None:
    corners = np.random.default_rng(2).uniform(0.2, 0.6, (len(SPARSE[::5]), 3))
    log = on_lines(SPARSE[::5], corners) + np.array([0.0, 0.002, 0.0])
    found = diagnosed(write("path", SPARSE[::5], tcp=corners), write("log", DENSE, tcp=log))
    ((kind, axis, value),) = [(cause.kind, cause.axis, cause.value) for cause in found.causes]
    assert (kind, axis) == ("base_shift", (0.0, 1.0, 0.0))
    assert value == pytest.approx((-0.002,), abs=1e-9)


T = np.arange(0.0, 6.0, 0.008)
Q = moved(T, 0.2)
READ, LATE = Q + ZERO, moved(T - 0.02, 0.2)
TOOL = poses_over_log(UR5E, READ)[1] @ [0.0, 0.0, 0.1]
NONE = "neither side recorded a tool centre point"


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
    write: Write,
    reference: tuple[FloatArray | None, FloatArray | None],
    log: tuple[FloatArray | None, FloatArray | None],
    agree: dict[str, bool],
    origin: str,
    reason: str,
) -> None:
    """Each side has joints, or the joints that its tool centre point is of, or both."""
    rng, sides, apart = np.random.default_rng(3), [], {}
    for name, (q, of) in (("one", reference), ("two", log)):
        tcp = place(READ) + TOOL if of is TOOL else None if of is None else place(of)
        tcp = None if tcp is None else tcp + rng.normal(0.0, 5e-5, tcp.shape)
        sides.append(write(name, T, q, tcp))
        if q is not None and tcp is not None:
            apart[name] = np.linalg.norm(place(q) - tcp, axis=1)
    found = diagnosed(sides[0], sides[1])
    assert {one.name: one.agrees for one in found.recorded_tcp} == agree
    for one in found.recorded_tcp:
        assert one.rms == pytest.approx(np.sqrt((apart[one.name] ** 2).mean()), rel=1e-9)
        assert one.max == pytest.approx(apart[one.name].max(), rel=1e-9)
    assert found.origin == origin
    assert found.summary.endswith(f"that is in {origin}") is bool(origin)
    reasons = [one.reason for one in found.untested if "link_length" in one.kinds]
    assert [reason in one for one in reasons] == ([True] if reason else [])


@pytest.mark.parametrize("elbow", [0.0, 0.5])
def test_a_joint_that_turns_about_the_tool_centre_point_is_named_apart(write: Write, elbow: float) -> None:
    """The last joint of a UR5e moves no tool centre point, and here breaks its own tolerance."""
    off = np.radians([0.0, 0.0, elbow, 0.0, 0.0, 1.0])
    found = diagnosed(write("one", T, Q), write("two", T, Q + off), "axis=3.5mm,joint=0.6deg")
    assert {cause.name for cause in found.causes} == {*["elbow_joint"] * (elbow > 0.0), "wrist_3_joint"}
    chain, _, apart = found.summary.rpartition("wrist_3_joint")
    assert apart == " reads 1 deg too high (this turns the TCP, but does not move it)"
    assert ("elbow_joint reads 0.5 deg too high: rms" in chain) is (elbow > 0.0)
    assert found.verdict == "fail"


def test_joints_that_agree_do_not_where_the_robots_differ() -> None:
    """A tool of 100 mm is known to one side only."""
    longer = UR5E.placed(tool=Transform(translation=(0.0, 0.0, 0.1)))
    asked, done = (urmpipe.ingest(name="side", t=T, q=Q, unit="rad", robot=robot) for robot in (longer, UR5E))
    found = urmpipe.diagnose(asked, done)
    reason = "no change of joints or clock makes the tool centre points agree"
    assert found.summary == f"no cause found: rms 100 mm remains ({reason})"


@pytest.mark.parametrize(
    ("allowed", "breaks"), [("x=10mm,y=1mm,z=10mm", False), ("x=4mm,y=10mm,z=10mm", True)]
)
def test_a_cause_breaks_the_tolerance_of_its_own_axis(write: Write, allowed: str, breaks: bool) -> None:
    found = diagnosed(
        write("path", T, tcp=place(Q) + np.array([0.005, 0.0, 0.0])), write("log", T, Q), allowed
    )
    ((kind, broken),) = [(cause.kind, cause.exceeds_tolerance) for cause in found.causes]
    assert (kind, broken, found.verdict) == ("base_shift", breaks, "fail" if breaks else "pass")


def test_rows_without_all_joints_are_no_samples(write: Write) -> None:
    few = Q.copy()
    few[np.arange(len(T)) % (len(T) // 5) != 0, 5] = np.nan
    found = diagnosed(write("path", T, tcp=place(Q) + np.array([0.0, 0.0, 0.005])), write("log", T, few))
    assert found.causes == ()
    assert found.unexplained.interpretation.endswith(" samples with all values: fewer than 10")


def test_it_is_the_reference_that_rests(write: Write) -> None:
    found = diagnosed(write("still", T, np.tile(Q[0], (len(T), 1))), write("path", T, tcp=place(Q)))
    assert found.unexplained.interpretation == "the reference is at rest: one pose"


@pytest.mark.parametrize("turn", [-np.pi, np.pi])
def test_of_joints_on_both_sides_half_a_turn_has_a_sense(write: Write, turn: float) -> None:
    log = Q.copy()
    log[300:, 1] -= turn
    (cause,) = diagnosed(write("one", T, Q), write("two", T, log)).causes
    assert (cause.kind, cause.from_sample, cause.value) == ("half_turn", 300, (turn,))


def test_a_path_in_mm_is_read_so_and_has_no_exponent(write: Write) -> None:
    found = diagnosed(write("path", T, tcp=1000.0 * place(Q)), write("log", T, Q))
    assert "in mm, read as m: rms " in found.summary
    assert "e+" not in found.summary


def test_all_joints_in_degrees_are_corrected_at_once(write: Write) -> None:
    files = write("one", T, Q), write("two", T, np.degrees(Q))
    asked, done = (urmpipe.ingest(file, "ur5e", unit="rad") for file in files)
    (run,) = urmpipe.diagnose(asked, [done]).runs
    (hint,) = remedy_hints(run)
    assert hint.value == dict.fromkeys(run.run.log.joints, "deg")


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["ur10e", "ur3"])
def test_another_robot_on_a_turned_base_is_found_with_it(write: Write, robot: str) -> None:
    base = Transform(((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)))
    path = poses_over_log(load_robot(robot).placed(base), Q)[0]
    noise = np.random.default_rng(4).normal(0.0, 1e-4, path.shape)
    found = diagnosed(write("path", T, tcp=path + noise), write("log", T, Q))
    named = {cause.kind: cause for cause in found.causes}
    assert {*named} == {"base_rotation", "other_robot"}
    assert named["other_robot"].name == robot
    assert named["base_rotation"].value == pytest.approx((np.pi,))


@pytest.mark.parametrize("read", [np.pi / 180.0, 180.0 / np.pi])
@pytest.mark.parametrize("others", [False, True])
def test_a_joint_or_all_others_in_another_unit(write: Write, read: float, others: bool) -> None:
    wrong = np.full(6, others)
    wrong[3] = not others
    log = np.where(wrong, Q / read, Q)
    noise = np.random.default_rng(5).normal(0.0, 1e-4, (len(T), 3))
    asked = urmpipe.ingest(write("path", T, tcp=place(Q) + noise))
    done = urmpipe.ingest(name="log", t=T, q=log, unit="rad", robot=UR5E, names=UR5E.coordinates)
    (cause,) = urmpipe.diagnose(asked, done).causes
    assert cause.kind == "joint_unit"
    assert cause.value == pytest.approx((read,))
    assert {*cause.joints} == {name for name, one in zip(UR5E.coordinates, wrong, strict=True) if one}
