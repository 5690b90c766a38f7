"""The audit: everything the repolarizer did to a log, left, or could not decide is told."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_models.math3d import translation
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import JointLog, LogColumn
from urmpipe_pipeline.repolarization.audit import AuditResult, audit_log
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.derivatives import Method, derivatives
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources import ReadOptions

MS = 1_000_000
DEG = math.pi / 180.0
ALLOWED = "allowed: LOW:HIGH with LOW below HIGH, both finite"


def wrap(x: FloatArray, period: float = FULL_TURN, low: float | None = None) -> FloatArray:
    start = -period / 2.0 if low is None else low
    return np.asarray(x - period * np.floor((x - start) / period), dtype=np.float64)


def log_of(q: FloatArray, t_ns: IntArray | None = None, unit: str = "rad", factor: float = 1.0) -> JointLog:
    values = q.reshape(len(q), -1)
    names = tuple(f"q{j + 1}" for j in range(values.shape[1]))
    columns = tuple(LogColumn(name, name, "joint", j, unit, factor) for j, name in enumerate(names))
    t = 5 * MS * np.arange(len(values)) if t_ns is None else t_ns
    return JointLog("log", "table", (), t, names, values, columns=columns)


def kinds(audited: AuditResult) -> list[tuple[str, int]]:
    return [(entry.kind, entry.row) for entry in audited.entries]


def arm(*speeds: float) -> Chain:
    joints = tuple(Joint(f"q{j + 1}", "revolute", velocity=speed) for j, speed in enumerate(speeds))
    return Chain("arm", joints, tip=translation(0.1, 0.0, 0.0))


def moving(rows: int = 40) -> FloatArray:
    """0.05 rad a row over +pi: the wrap leads to row index 20."""
    return np.asarray(np.pi + 0.05 * (np.arange(rows) - 19.5), dtype=np.float64)


def test_a_wrap_an_unexplained_step_and_an_in_between_sample_stand_in_the_audit() -> None:
    q = wrap(moving())
    q[30:] += 2.5
    q[20] = 0.4 * q[19] + 0.6 * q[21]
    found = audit_log(log_of(q))
    assert kinds(found) == [("in-between", 21), ("wrap", 22), ("unexplained", 31)]
    between, turn, odd = found.entries
    assert (turn.joint, turn.before, turn.after, turn.t, turn.half_period) == ("q1", 0, 1, 0.1025, 0.0025)
    assert turn.step == q[21] - q[20]
    assert (between.t, between.half_period) == (0.1, 0.0)
    # the line of its neighbours is the motion itself: rounding of values of 3
    assert between.step == pytest.approx(q[20] - moving()[20], abs=1e-14)
    assert odd.step == pytest.approx(0.05 + 2.5, abs=1e-14)
    assert (odd.before, odd.after) == (1, 1)
    assert [(w.kind, w.row, w.message) for w in found.warnings] == [
        ("large-step", 31, f"q1 steps by more than 90 deg from the value before, to {q[30]:.6g} rad: not a"
         " wrap, the value is kept"),
        ("in-between", 21, f"q1 lies between the ends of a wrap, {abs(between.step):.4g} rad off the line of"
         " its neighbours, where a linear resampling left it"),
    ]  # fmt: skip


def test_repair_replaces_exactly_the_in_between_samples_and_says_so() -> None:
    q = wrap(moving())
    q[20] = 0.9 * q[19] + 0.1 * q[21]
    before = q.copy()
    log = log_of(q)
    left, repaired = audit_log(log), audit_log(log, repaired=True)
    assert [entry.kind for entry in repaired.entries] == ["repaired", "wrap"]
    assert repaired.warnings == ()
    np.testing.assert_allclose(repaired.q[:, 0], moving(), rtol=0, atol=4e-15)  # units in the last place of 4
    assert np.flatnonzero(repaired.q != left.q).tolist() == [20]
    assert log.q.tobytes() == before.tobytes()


def test_a_gap_in_which_a_joint_can_turn_half_a_period_is_ambiguous() -> None:
    t = 5 * MS * np.r_[0:20, 120:140].astype(np.int64)  # 0.505 s between rows 20 and 21
    q = np.full(40, 1.0)
    slow, fast = audit_log(log_of(q, t), arm(6.2)), audit_log(log_of(q, t), arm(6.3))
    assert kinds(slow) == []
    assert kinds(fast) == [("ambiguous", 21)]
    assert fast.unresolved.tolist() == [[19, 20, 0]]
    (warning,) = fast.warnings
    assert warning.kind == "ambiguous-turn"
    assert warning.message == (
        "no value for 0.505 s before this row: q1 (at 6.3 rad/s) can have turned by more than half a"
        " period; the nearest turn is taken"
    )


def test_without_a_robot_the_largest_speed_that_was_held_decides() -> None:
    q = wrap(moving(80))  # 10 rad/s: half a turn in 0.314 s
    q[60:] = wrap(moving(80)[60:] + 20.0)
    t = 5 * MS * np.r_[0:60, 160:180].astype(np.int64)
    assert ("ambiguous", 61) in kinds(audit_log(log_of(q, t)))
    still = np.full(80, 1.0)
    still[10:] = 1.2  # one step of 40 rad/s is no speed that was held
    assert kinds(audit_log(log_of(still, t))) == []


def test_missing_values_are_a_gap_of_their_own_joint() -> None:
    q = np.ones((400, 2))
    q[100:300, 1] = np.nan
    found = audit_log(log_of(q), arm(6.0, 6.0))
    assert [(entry.joint, entry.row) for entry in found.entries] == [("q2", 301)]
    assert found.unresolved.tolist() == [[99, 300, 1]]


def test_steps_of_one_kind_are_one_warning_and_all_in_the_audit() -> None:
    q = np.tile([0.0, 2.0], 97)[:193]
    q[121] = 2.2
    found = audit_log(log_of(np.column_stack((q, np.zeros(193), q))))
    assert len(found.entries) == 384
    (warning,) = found.warnings
    assert (warning.kind, warning.row) == ("large-step", 2)
    assert str(warning) == (
        "row 2: 384 steps of q1 and q3 by more than 90 deg are not wraps and are kept; the largest, of q1 by"
        " 126.1 deg, is to row 122; urmpipe ingest --audit FILE.csv lists all"
    )


def test_samples_on_wraps_are_one_warning() -> None:
    q = np.pi + 0.05 * np.linspace(-19.5, 379.5, 400)
    wrapped = wrap(q)
    wraps = np.flatnonzero(np.abs(np.diff(wrapped)) > 3) + 1
    for k, row in enumerate(wraps.tolist()):
        wrapped[row] = (0.4 - 0.1 * k) * wrapped[row - 1] + (0.6 + 0.1 * k) * wrapped[row + 1]
    found = audit_log(log_of(wrapped))
    off = [entry for entry in found.entries if entry.kind == "in-between"]
    assert [entry.row for entry in off] == (wraps + 1).tolist()
    worst = max(off, key=lambda entry: abs(entry.step))
    (warning,) = found.warnings
    assert (warning.kind, warning.row) == ("in-between", wraps[0] + 1)
    assert str(warning) == (
        f"row {wraps[0] + 1}: {len(wraps)} samples of q1 lie between the ends of wraps, where a linear"
        f" resampling left them, off the line of their neighbours, at most that of q1 in row {worst.row} by"
        f" {abs(worst.step):.4g} rad; --repair puts them there; urmpipe ingest --audit FILE.csv lists all"
    )


def test_gaps_in_which_joints_can_have_turned_are_one_warning() -> None:
    t = 5 * MS * np.r_[0:20, 120:140, 250:260].astype(np.int64)
    found = audit_log(log_of(np.full((50, 2), 1.0), t), arm(6.3, 7.0))
    (warning,) = found.warnings
    assert (warning.kind, warning.row) == ("ambiguous-turn", 21)
    assert warning.message == (
        "in 2 gaps without values q1 (at 6.3 rad/s), q2 (at 7 rad/s) can have turned by more than half a"
        " period; the longest, 0.555 s, ends at row 41; the nearest turns are taken"
    )


@pytest.mark.parametrize(
    ("low", "said"), [(-180.0, "-180..180 deg"), (0.0, "0..360 deg"), (-90.0, "-90..270 deg")]
)
def test_the_interval_is_inferred_from_wraps_and_range(low: float, said: str) -> None:
    x = np.linspace(0.0, 800.0, 400)
    found = audit_log(log_of(wrap(x, 360.0, low) * DEG, unit="deg", factor=DEG))
    (inference,) = found.inferences
    assert (inference.what, inference.value) == ("interval of q1", said)
    assert inference.evidence.startswith("2 wraps by 360 deg, values from" if low else "2 wraps by 360 deg")
    # two roundings of 14 rad
    np.testing.assert_allclose(found.q[:, 0], x * DEG, rtol=0, atol=4e-15 * 2)


def test_a_joint_limited_to_two_turns_is_seen_by_its_jumps() -> None:
    x = np.linspace(0.0, 30.0, 600)
    found = audit_log(log_of(wrap(x, 2 * FULL_TURN)))
    np.testing.assert_allclose(found.q[:, 0], x, rtol=0, atol=8e-15)  # two roundings of 30
    assert [entry.after for entry in found.entries] == [1, 2]
    assert found.inferences[0].value == "-6.28319..6.28319 rad"


def test_jumps_of_one_and_of_two_turns_in_one_joint_are_asked_for() -> None:
    q = wrap(np.linspace(0.0, 30.0, 600), 2 * FULL_TURN)
    q[300:310] -= FULL_TURN * np.sign(q[300])
    with pytest.raises(LogError) as error:
        audit_log(log_of(q))
    assert str(error.value) == (
        "log, column q1: found 2 steps of about 4 pi and 2 of about 2 pi, allowed: wraps of one"
        " interval; --interval q1=LOW:HIGH specifies it"
    )
    assert len(audit_log(log_of(q), interval={"q1": (-FULL_TURN, FULL_TURN)}).entries) == 4


def test_a_real_jump_near_two_turns_is_none_where_values_go_beyond() -> None:
    q = np.r_[np.linspace(-2.0, -1.0, 50), np.linspace(10.5, 11.0, 50)]
    assert kinds(audit_log(log_of(q))) == [("unexplained", 51)]


def test_wraps_of_a_joint_whose_values_span_more_than_a_turn_are_doubted() -> None:
    x = np.linspace(0.0, 16.0, 200)
    x[100:] -= FULL_TURN
    (warning,) = audit_log(log_of(x)).warnings
    assert warning.kind == "interval"
    assert warning.message.startswith("q1 wraps by 6.28319 rad, but its values span 9.")


def test_an_interval_holds_for_one_joint_or_for_all_in_the_unit_of_the_file() -> None:
    q = np.column_stack([wrap(np.linspace(0, 800, 99), 360.0, 0.0), np.linspace(-100.0, 100.0, 99)]) * DEG
    log = log_of(q, unit="deg", factor=DEG)
    found = audit_log(log, interval={"": (-180.0, 180.0), "q1": (0.0, 360.0)})
    assert [(i.what, i.value, i.evidence) for i in found.inferences] == [
        ("interval of q1", "0..360 deg", "given as an option"),
        ("interval of q2", "-180..180 deg", "given as an option"),
    ]
    with pytest.raises(LogError) as error:
        audit_log(log, interval={"": (-90.0, 90.0)})
    outside = [np.flatnonzero(np.abs(column / DEG) > 90.0018) for column in q.T]
    assert str(error.value).splitlines() == [
        f"log, row {rows[0] + 1}, column {name}: interval (--interval): found {len(rows)} values outside,"
        " first"
        f" {q[rows[0], j] / DEG:.6g} deg in row"
        f" {rows[0] + 1}, allowed: -90..90 deg"
        for j, (name, rows) in enumerate(zip(("q1", "q2"), outside, strict=True))
    ]


@pytest.mark.parametrize(
    ("interval", "said"),
    [
        ({"": (1.0, 1.0)}, f"interval (--interval): found 1:1, {ALLOWED}"),
        ({"q1": (0.0, math.inf)}, f"interval (--interval): found q1=0:inf, {ALLOWED}"),
        ({"": (math.nan, 1.0)}, f"interval (--interval): found nan:1, {ALLOWED}"),
        ({"q7": (0.0, 6.0)}, "interval (--interval): found q7, allowed: joints that turn: q1"),
    ],
)  # fmt: skip
def test_intervals_that_make_no_sense_are_refused(
    interval: dict[str, tuple[float, float]], said: str
) -> None:
    with pytest.raises(OptionError) as error:
        audit_log(log_of(np.zeros(4)), interval=interval)
    assert str(error.value) == said


def test_a_joint_that_slides_has_no_interval() -> None:
    log = log_of(np.array([0.0, 6.3, 0.0, 6.3]), unit="m")
    assert kinds(audit_log(log)) == []
    with pytest.raises(OptionError, match=r"found q1, allowed: joints that turn: none"):
        audit_log(log, interval={"q1": (-3.0, 3.0)})


def test_a_rounded_interval_means_whole_turns() -> None:
    x = np.linspace(0.0, 70.0, 2000)
    found = audit_log(log_of(wrap(x)), interval={"": (-3.1416, 3.1416)})
    np.testing.assert_allclose(found.q[:, 0], x, rtol=0, atol=3e-14)  # eleven turns: two roundings of 70


def odd_log(path: Path) -> Path:
    q = wrap(moving())
    q[30:] += 2.5
    table = np.column_stack([0.005 * np.arange(40), q, np.cos(0.1 * np.arange(40))])
    np.savetxt(path, table, delimiter=",", header="t,q1,q2", comments="", fmt="%.17g")
    return path


def test_the_audit_comes_back_from_a_recording(tmp_path: Path) -> None:
    run = ingest_log([odd_log(tmp_path / "a.csv")], read=ReadOptions(unit={"": "rad"}))
    assert [(one.kind, one.row) for one in run.audit] == [("wrap", 21), ("unexplained", 31)]
    read = read_recording(write_recording(run, tmp_path / "a.rrd"))
    assert isinstance(read, Run)
    assert read.audit == run.audit


def test_rates_across_an_unexplained_step_are_left_out(tmp_path: Path) -> None:
    run = ingest_log([odd_log(tmp_path / "a.csv")], read=ReadOptions(unit={"": "rad"}))
    assert np.flatnonzero(np.isnan(run.qd[:, 0])).tolist() == [29, 30]
    assert np.flatnonzero(np.isnan(run.qdd[:, 0])).tolist() == [29, 30]
    assert not np.isnan(run.qd[:, 1]).any()
    np.testing.assert_allclose(
        run.qd[[28, 31], 0], 10.0, rtol=1e-12
    )  # 0.05 rad in 5 ms, roundings of 1e-15 rad
    assert not np.isnan(run.q).any()


def test_rates_about_an_in_between_sample_are_left_out_on_any_grid(tmp_path: Path) -> None:
    q = wrap(moving())
    q[20] = 0.4 * q[19] + 0.6 * q[21]
    table = np.column_stack([0.005 * np.arange(40), q])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,q1", comments="", fmt="%.17g")
    for tsp, left_out in ((None, range(19, 22)), (0.001, range(95, 106))):
        run = ingest_log([tmp_path / "a.csv"], read=ReadOptions(unit={"": "rad"}), tsp=tsp)
        assert np.flatnonzero(np.isnan(run.qd[:, 0])).tolist() == list(left_out)
        assert np.nanmax(np.abs(run.qd)) < 10.1
    repaired = ingest_log([tmp_path / "a.csv"], read=ReadOptions(unit={"": "rad"}, repair=True))
    np.testing.assert_allclose(repaired.qd[:, 0], 10.0, rtol=1e-10)  # roundings of 1e-15 rad in 10 ms


def test_rates_at_the_ends_share_the_first_and_the_last_window() -> None:
    q = 0.01 * np.arange(60.0)[:, np.newaxis]
    at_start, at_end = np.array([[1, 1, 0]]), np.array([[57, 57, 0]])
    cases: tuple[tuple[Method, int, int], ...] = (("central", 3, 57), ("savgol", 17, 43))
    for method, start, end in cases:
        left = [np.isnan(derivatives(q, 0.01, method, one)[0][:, 0]) for one in (at_start, at_end)]
        assert np.flatnonzero(left[0]).tolist() == list(range(start))
        assert np.flatnonzero(left[1]).tolist() == list(range(end, 60))


def test_resampling_leaves_an_unexplained_step_open_and_counts_it(tmp_path: Path) -> None:
    run = ingest_log([odd_log(tmp_path / "a.csv")], read=ReadOptions(unit={"": "rad"}), tsp=0.001)
    assert np.flatnonzero(np.isnan(run.q[:, 0])).tolist() == [146, 147, 148, 149]
    assert not np.isnan(run.q[:, 1]).any()
    assert run.warnings[-1].kind == "step-left-open"
    assert run.warnings[-1].message == (
        "4 grid samples lie inside steps of a joint that no motion explains and have no value"
    )
    assert np.nanmax(np.abs(run.qd[:, 0])) < 10.1


def test_an_interval_that_is_no_whole_turns_is_told() -> None:
    """Degrees said of a log in rad: nothing would wrap, and nothing would be unexplained."""
    found = audit_log(log_of(wrap(moving())), interval={"": (-180.0, 180.0)})
    assert [(warning.kind, warning.message) for warning in found.warnings] == [
        (
            "interval",
            "q1: the interval -180..180 rad is 57.2958 turns wide: angles wrap by whole turns; check"
            " the unit and the interval",
        )
    ]
    both = log_of(np.column_stack([wrap(moving())] * 3))
    said = "turns wide: angles wrap by whole turns; check the unit and the interval"
    told = audit_log(both, interval={"": (-180.0, 180.0), "q2": (-90.0, 90.0)}).warnings
    assert [warning.message for warning in told] == [
        f"q1, q3: the interval -180..180 rad is 57.2958 {said}",
        f"q2: the interval -90..90 rad is 28.6479 {said}",
    ]
