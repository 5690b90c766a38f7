"""Logs that are wrong, or that no reader can take as they are: what is wrong must be said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from by_python import Q6, comma, savetxt, writer
from by_robots import UR, krc_trace, ros2_row
from specimen import Made, Truth, degrees, lines, made, motion, specimen
from urmpipe_models.elementwise import FloatArray

HEADER = ",".join(["t", *Q6])


def rows_of(t: FloatArray, q: FloatArray) -> list[str]:
    """Return the lines of a plain table of t and q1..q6 in rad."""
    return [f"{at:.3f}," + ",".join(f"{v:.6f}" for v in row) for at, row in zip(t, q, strict=True)]


def plain(change: Callable[[list[str]], list[str]]) -> str:
    """Return a plain log of 30 rows, its lines (header first) changed by a function."""
    truth = motion(30)
    return lines(*change([HEADER, *rows_of(truth.t, truth.q)]))


def _log(name: str, t: FloatArray, q: FloatArray, header: str = HEADER) -> Made:
    return made(f"{name}.csv", lines(header, *rows_of(t, q)))


@specimen
def time_backwards() -> Made:
    """The clock was set back by 0.1 s before row 12 (line 13)."""
    truth = motion(30)
    t = truth.t.copy()
    t[11:] -= 0.1
    return _log("time_backwards", t, truth.q)


@specimen
def time_repeated() -> Made:
    """Row 9 (line 10) has the time of row 8, with other values."""
    truth = motion(30)
    t = truth.t.copy()
    t[8] = t[7]
    return _log("time_repeated", t, truth.q)


@specimen
def time_of_one_second() -> Made:
    """MATLAB's default datetime format: whole seconds, 20 rows in each; 11-Apr-2021 22:27:21."""
    truth = motion(60, 0.05)
    times = [f"11-Apr-2021 22:27:{21 + int(t):02d}" for t in truth.t]
    rows = [f"{at}," + ",".join(f"{v:.6f}" for v in q) for at, q in zip(times, truth.q, strict=True)]
    return made("time_of_one_second.csv", lines("Time,q1,q2,q3,q4,q5,q6", *rows))


@specimen
def time_in_steps() -> Made:
    """time.time() of Windows: the clock steps by 15.625 ms, rows every 5 ms share its value in threes."""
    truth = motion(48, 0.005)
    t = np.floor(truth.t / 0.015625) * 0.015625
    rows = [f"{at:.6f}," + ",".join(f"{v:.6f}" for v in q) for at, q in zip(t, truth.q, strict=True)]
    return made("time_in_steps.csv", lines(HEADER, *rows))


@specimen
def time_missing() -> Made:
    """Row 6 (line 7) has no time."""
    return made("time_missing.csv", plain(lambda log: [*log[:6], log[6][log[6].index(",") :], *log[7:]]))


@specimen
def gap_of_two_seconds() -> Made:
    """2 s pass before row 16; the motion went on meanwhile."""
    before, after = motion(15), motion(15, begin=2.3)
    t = np.concatenate((before.t, after.t + 2.3))
    return _log("gap_of_two_seconds", t, np.vstack((before.q, after.q)))


@specimen
def gap_with_a_possible_turn() -> Made:
    """8 s without a row before row 16: the fifth joint could have turned once or twice, -pi..pi."""
    before, after = motion(15), motion(15, begin=8.3)
    t = np.concatenate((before.t, after.t + 8.3))
    whole = replace(before, q=np.vstack((before.q, after.q))).limited(-np.pi, np.pi)
    return _log("gap_with_a_possible_turn", t, whole.q)


@specimen
def repeated_samples() -> Made:
    """A controller of 40 ms polled every 10 ms: each sample four times, the times differ."""
    truth = motion(12, 0.04)
    return _log("repeated_samples", motion(48, 0.01).t, np.repeat(truth.q, 4, axis=0))


@specimen
def outlier_first_sample() -> Made:
    """q1 starts with 0.711700 and is near -2 from row 2 on: what the buffer held before."""
    truth = motion(30)
    q = truth.q.copy()
    q[:, 0] -= 2.5
    q[0, 0] = 0.7117
    return _log("outlier_first_sample", truth.t, q)


@specimen
def header_with_fewer_names() -> Made:
    """A header of six names (t,q1..q5) over seven columns."""
    return made("header_with_fewer_names.csv", plain(lambda log: ["t,q1,q2,q3,q4,q5", *log[1:]]))


@specimen
def header_with_more_names() -> Made:
    """A header of eight names (t,q1..q7) over seven columns."""
    return made("header_with_more_names.csv", plain(lambda log: [f"{HEADER},q7", *log[1:]]))


@specimen
def header_with_a_name_twice() -> Made:
    """The header says q3 twice: t,q1,q2,q3,q3,q5,q6."""
    return made("header_with_a_name_twice.csv", plain(lambda log: ["t,q1,q2,q3,q3,q5,q6", *log[1:]]))


@specimen
def header_with_all_names_twice() -> Made:
    """t,q1..q6,q1..q6: positions, then rates, called the same."""
    truth = motion(20)
    rows = np.column_stack((truth.t, truth.q, truth.rates)).tolist()
    return made("header_with_all_names_twice.csv", writer([["t", *Q6, *Q6], *rows]))


@specimen
def header_without_a_number() -> Made:
    """q1,q2,q4,q5,q6,q7: no q3."""
    return made("header_without_a_number.csv", plain(lambda log: ["t,q1,q2,q4,q5,q6,q7", *log[1:]]))


@specimen
def header_of_unknown_unit() -> Made:
    """q1 [gon] .. q6 [gon]: a unit that is none of ours."""
    names = ",".join(f"{name} [gon]" for name in Q6)
    return made("header_of_unknown_unit.csv", plain(lambda log: [f"t,{names}", *log[1:]]))


@specimen
def rows_too_short() -> Made:
    """Lines 8 and 20 lack their last cell."""

    def shorten(log: list[str]) -> list[str]:
        """Return the log with two rows cut."""
        return [row.rpartition(",")[0] if k in (8, 20) else row for k, row in enumerate(log, 1)]

    return made("rows_too_short.csv", plain(shorten))


@specimen
def row_cut_off() -> Made:
    """The recorder was killed while it wrote line 31: `0.580,0.6` without a line end."""
    truth = motion(30)
    text = lines(HEADER, *rows_of(truth.t[:-1], truth.q[:-1]))
    return made("row_cut_off.csv", text + rows_of(truth.t, truth.q)[-1][:9])


@specimen
def row_of_two_rows() -> Made:
    """Two processes wrote at once: line 15 holds two rows without a line end between."""
    return made("row_of_two_rows.csv", plain(lambda log: [*log[:14], log[14] + log[15], *log[16:]]))


@specimen
def merge_conflict() -> Made:
    """git's markers of a conflict around lines 10 to 14."""

    def conflict(log: list[str]) -> list[str]:
        """Return the log with two versions of one row."""
        marked = ["<<<<<<< HEAD", log[9], "=======", log[9].replace("0.160", "0.161"), ">>>>>>> faster"]
        return [*log[:9], *marked, *log[10:]]

    return made("merge_conflict.csv", plain(conflict))


@specimen
def stray_text() -> Made:
    """A driver's message in line 12, among the rows."""
    return made(
        "stray_text.csv", plain(lambda log: [*log[:11], "[WARN] connection lost, retrying", *log[11:]])
    )


@specimen
def stray_cell() -> Made:
    """The cell of q4 in line 9 is `ERR`."""

    def spoil(log: list[str]) -> list[str]:
        """Return the log with a word for a number."""
        cells = log[8].split(",")
        cells[4] = "ERR"
        return [*log[:8], ",".join(cells), *log[9:]]

    return made("stray_cell.csv", plain(spoil))


@specimen
def nul_bytes() -> Made:
    """The power failed: the end of the file is 200 NUL bytes."""
    return made("nul_bytes.csv", plain(lambda log: log).encode() + b"\0" * 200)


@specimen
def two_logs() -> Made:
    """cat a.csv b.csv without the second header: the time starts again in line 17."""
    a, b = motion(15), motion(15, begin=0.7)
    return made("two_logs.csv", lines(HEADER, *rows_of(a.t, a.q), *rows_of(b.t, b.q)))


@specimen
def two_logs_with_headers() -> Made:
    """cat a.csv b.csv: the header again in line 17, the time starts again."""
    a, b = motion(15), motion(15, begin=0.7)
    return made("two_logs_with_headers.csv", lines(HEADER, *rows_of(a.t, a.q), HEADER, *rows_of(b.t, b.q)))


@specimen
def two_publishers() -> Made:
    """ros2 topic echo --csv /joint_states where arm and gripper publish in turn: rows of two kinds."""
    truth = motion(20)
    arm = [ros2_row(t, UR, q) for t, q in zip(truth.t, truth.q.tolist(), strict=True)]
    gripper = [ros2_row(t + 0.003, ["finger_joint"], [0.4]) for t in truth.t]
    return made(
        "two_publishers.csv", lines(*(row for both in zip(arm, gripper, strict=True) for row in both))
    )


@specimen
def header_says_deg_krc() -> Made:
    """KUKA KRC trace whose header says AxisPos_Act1[°] while the axes are in rad: X_Act.. tell (ur5e)."""
    truth = motion(20, 0.012, robot="ur5e")
    return made("header_says_deg_krc.csv", krc_trace(truth.q, truth), encoding="latin-1")


@specimen
def header_says_rad() -> Made:
    """J1 [rad].. over values in deg that wrap at 180."""
    truth = motion(30).limited(-np.pi, np.pi)
    header = ",".join(["t", *(f"J{k} [rad]" for k in range(1, 7))])
    return _log("header_says_rad", truth.t, degrees(truth.q), header)


@specimen
def header_says_mm() -> Made:
    """x [mm],y [mm],z [mm] over values in m, beside the joints in rad (ur5e): the joints tell."""
    truth = motion(30, robot="ur5e")
    rows = np.column_stack((truth.t, truth.q, truth.tool)).tolist()
    return made("header_says_mm.csv", writer([["t", *Q6, "x [mm]", "y [mm]", "z [mm]"], *rows]))


@specimen
def tcp_of_another_order() -> Made:
    """The columns of q2 and q3 are exchanged in the header, as the recorded tool shows (ur5e, m)."""
    truth = motion(30, robot="ur5e")
    rows = np.column_stack((truth.t, truth.q, truth.tool)).tolist()
    return made(
        "tcp_of_another_order.csv", writer([["t", "q1", "q3", "q2", "q4", "q5", "q6", *"xyz"], *rows])
    )


@specimen
def empty_column() -> Made:
    """q4 has no value in any row."""
    truth = motion(30)
    rows = [
        ",".join("" if k == 4 else cell for k, cell in enumerate(row.split(",")))
        for row in rows_of(truth.t, truth.q)
    ]
    return made("empty_column.csv", lines(HEADER, *rows))


@specimen
def header_only() -> Made:
    """A header and no row."""
    return made("header_only.csv", HEADER + "\n")


@specimen
def no_bytes() -> Made:
    """An empty file."""
    return made("no_bytes.csv", "")


@specimen
def decimal_commas_between_commas() -> Made:
    """A German printf with commas between: 0,020,0,413 - nothing tells them from delimiters."""
    truth = motion(30)
    rows = [",".join([comma(t, 3), *(comma(v, 6) for v in q)]) for t, q in zip(truth.t, truth.q, strict=True)]
    return made("decimal_commas_between_commas.csv", lines(HEADER, *rows))


@specimen
def impossible_speed() -> Made:
    """A spike: q2 is 1.2 rad off in row 14 alone, at 60 rad/s there and back (ur5e: 3.14 rad/s)."""
    truth = motion(30)
    q = truth.q.copy()
    q[13, 1] += 1.2
    return _log("impossible_speed", truth.t, q)


@specimen
def beyond_limits() -> Made:
    """q3 rises to 7.5 rad, steadily: a ur5e ends at 6.2832."""
    truth = motion(30)
    q = truth.q.copy()
    q[:, 2] = np.linspace(6.0, 7.5, 30)
    return _log("beyond_limits", truth.t, q)


@specimen
def in_between_on_wrap() -> Made:
    """Linear resampling of -pi..pi: one sample half way down between the two rows of q5's wrap."""
    truth = motion(30).limited(-np.pi, np.pi)
    q = truth.q.copy()
    at = int(np.argmin(np.diff(q[:, 4]))) + 1
    q[at, 4] = 0.5 * (q[at - 1, 4] + q[at + 1, 4])
    return _log("in_between_on_wrap", truth.t, q)


@specimen
def angles_of_unknown_unit() -> Made:
    """Joints at 2..8 and q6 at 27..43 without a unit, slow: degrees, or rad and a flange that turns on."""
    truth = motion(30, 0.5)
    q = np.round(
        [5, 5, 5, 5, 5, 35] + [3, 3, 3, 3, 3, 8] * np.sin(0.1 * truth.t[:, np.newaxis] + np.arange(6)), 6
    )
    return _log("angles_of_unknown_unit", truth.t, q)


@specimen
def quaternion_of_no_length() -> Made:
    """qx,qy,qz,qw of length 0.5: no rotation, whatever the names say."""
    truth = motion(30, robot="ur5e")
    quat = np.round(0.5 * truth.turn.as_quat(), 9)
    rows = np.column_stack((truth.t, truth.q, truth.tool, quat)).tolist()
    return made("quaternion_of_no_length.csv", writer([["t", *Q6, *"xyz", "qx", "qy", "qz", "qw"], *rows]))


@specimen
def infinite_value() -> Made:
    """numpy.savetxt of a division by zero: q6 is inf in row 10 (line 11)."""
    truth = motion(30)
    q = truth.q.copy()
    q[9, 5] = np.inf
    text = savetxt(np.column_stack((truth.t, q)), fmt="%.6f", delimiter=",", header=HEADER, comments="")
    return made("infinite_value.csv", text)


@specimen
def seven_joints_for_six() -> Made:
    """joint_1..joint_7 for a robot of six joints (ur5e)."""
    truth: Truth = motion(30, joints=7)
    rows = np.column_stack((truth.t, truth.q)).tolist()
    return made("seven_joints_for_six.csv", writer([["t", *(f"joint_{k}" for k in range(1, 8))], *rows]))


@specimen
def rows_of_one_cell() -> Made:
    """A header of a time and a joint over rows of one number: which of both is missing, nothing tells."""
    return made("rows_of_one_cell.csv", "t,q1\n1\n2\n")


@specimen
def midnight_among_rows() -> Made:
    """Times of day of 24 rows, 10 ms apart over midnight, of which two are exchanged there."""
    truth = motion(24)
    start = datetime(2021, 4, 11, 23, 59, 59, 875000)
    times = [f"{start + timedelta(milliseconds=10 * k):%H:%M:%S.%f}" for k in range(24)]
    times[12], times[13] = times[13], times[12]
    rows = [[time, *q] for time, q in zip(times, np.round(truth.q, 6).tolist(), strict=True)]
    return made("midnight_among_rows.csv", writer([["t", *Q6], *rows]))
