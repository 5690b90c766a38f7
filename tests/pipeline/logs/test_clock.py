"""The clock: its column, its unit, exact integer nanoseconds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from asserting import OTHER_TIME
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]


def clocked(name: str, *times: str) -> str:
    return "\n".join([f"{name},q1", *(f"{time},{k}" for k, time in enumerate(times)), ""])


@pytest.mark.parametrize(
    "name",
    ["t", "time", "Time", "Zeit", "timestamp", "Time (s)", "Zeit[sec]", "t_s", "time_sec", "simulation time",
     "__time", "%time", "field.header.stamp", "elapsed_time [s]", "robot time", "duration [s]",
     "tout", "t_out", "tsim", "sim_t"],
)  # fmt: skip
def test_names_of_the_time(read: Read, name: str) -> None:
    log = read(clocked(name, "1.5", "1.51", "1.53"))
    assert log.t_ns.tolist() == [0, 10_000_000, 30_000_000]
    assert log.clock_start == 1.5


@pytest.mark.parametrize(
    ("name", "times", "steps", "unit"),
    [
        ("t_ms", ["0", "5", "10"], [5_000_000, 5_000_000], "ms"),
        ("time [us]", ["0", "5", "10"], [5000, 5000], "us"),
        ("t (ns)", ["0", "5", "10"], [5, 5], "ns"),
        ("t", ["0", "0.005", "0.01"], [5_000_000, 5_000_000], "s"),
        ("t", ["0", "5000", "10000"], [5_000_000, 5_000_000], "us"),
        ("t", ["0", "5000000", "10000000"], [5_000_000, 5_000_000], "ns"),
        ("timestamp", ["1740416404.0470498", "1740416404.0571585"], [10_108_700], "s"),
        ("timestamp", ["1740416404047", "1740416404052"], [5_000_000], "ms"),
        ("timestamp", ["1740416404047049", "1740416404052050"], [5_001_000], "us"),
        ("%time", ["1486559106139796569", "1486559106140360682"], [564_113], "ns"),
        ("__time", ["1396293888.886", "1396293888.985"], [99_000_000], "s"),
        ("timestamp", ["1740416404.047049", "1740416404.052050"], [5_001_000], "s"),
        ("Zeit [ms]", ["-2.5", "0", "2.5"], [2_500_000, 2_500_000], "ms"),
        ("t", ["3601.25", "3601.255"], [5_000_000], "s"),
        ("time", ["1.0e+00", "1.005e+00", "1.01e+00"], [5_000_000, 5_000_000], "s"),
    ],
)
def test_units_of_the_time(read: Read, name: str, times: list[str], steps: list[int], unit: str) -> None:
    log = read(clocked(name, *times))
    assert np.diff(log.t_ns).tolist() == steps
    assert next(iter(log.units.values())) == unit


def test_nanoseconds_since_1970_lose_nothing(read: Read) -> None:
    start = 1486559106139796569
    log = read(clocked("%time", *(str(start + k) for k in (0, 1, 2, 1001))))
    assert log.t_ns.tolist() == [0, 1, 2, 1001]
    assert log.clock_start == start / 10**9


@pytest.mark.parametrize("quoted", ["", '"'])
def test_decimals_are_rounded_once_to_the_nearest_ns(read: Read, quoted: str) -> None:
    """4029.6389999999997 and its kind are what a binary clock prints; a tie goes to the even one."""
    times = ["4029.5389999999998", "4029.6389999999997", "4029.7390000005", "4029.8390000015", "4.0299e+03"]
    times = [f"{quoted}{time}{quoted}" for time in times]
    log = read(clocked("t", *times))
    assert log.t_ns.tolist() == [0, 100_000_000, 200_000_000, 300_000_002, 361_000_000]
    assert log.clock_start == 4029.539


def test_small_decimals_with_many_digits(read: Read) -> None:
    log = read(clocked("t", "8.881784197001252e-16", "0.0033333333333333335", "0.010000000000000002"))
    assert log.t_ns.tolist() == [0, 3_333_333, 10_000_000]


def test_negative_times(read: Read) -> None:
    log = read(clocked("t", "-0.1", "0.05", "0.2"))
    assert log.t_ns.tolist() == [0, 150_000_000, 300_000_000]
    assert log.clock_start == -0.1


def test_seconds_and_nanoseconds_apart(read: Read) -> None:
    text = "header.stamp.sec,header.stamp.nanosec,q1\n1740416404,999999999,1\n1740416405,4,2\n"
    log = read(text)
    assert log.t_ns.tolist() == [0, 5]
    assert log.units == {"header.stamp.sec": "s", "header.stamp.nanosec": "ns", "q1": "rad"}


def test_steps_that_may_be_two_units_are_asked_for(wrong: Wrong, read: Read) -> None:
    text = clocked("t", "0", "600", "1200")
    assert wrong(text) == [
        "log.csv:2, column t: found steps of 600, which may be ms or us; --unit t=ms or"
        f" --unit t=us specifies it{OTHER_TIME}"
    ]
    assert read(text, unit={"t": "us"}).t_ns.tolist() == [0, 600_000, 1_200_000]


@pytest.mark.parametrize(
    ("step", "turn", "unit"),
    [
        (1, 0.1, "s"),  # 100 rad/s as ms: of no arm
        (3, 0.2, "s"),
        (17, 0.9, "s"),
        (1.008, 0.02, "s"),  # UR RTDE at 1 Hz
        (5, 0.01, "ms"),
        (20, 0.02, "ms"),  # 1 mrad/s as s
        (20, 0.0, "ms"),
        (1, 0.01, None),  # 10 rad/s or 10 mrad/s
        (4, 0.0, "s"),
        (17, 0.2, None),
        (2.5, 0.002, None),
    ],
)
@pytest.mark.parametrize("name", ["t", "duration"])
def test_steps_without_a_unit_are_s_or_ms_by_how_fast_the_joints_turn(
    read: Read, name: str, step: float, turn: float, unit: str | None
) -> None:
    times = [step] * 40 if name == "duration" else [step * k for k in range(40)]
    rows = "".join(f"{time:g},{turn * abs(k % 10 - 5):g}\n" for k, time in enumerate(times))
    text = f"{name},q1 [rad]\n{rows}"
    if unit is None:
        with pytest.raises(LogError, match="which may be s or ms") as asked:
            read(text)
        hints = [hint.value for hint in asked.value.findings[0].hints[:2]]
        assert hints == [{name: "s"}, {name: "ms"}]
        return
    log = read(text)
    assert log.period == pytest.approx(step * {"s": 1.0, "ms": 1e-3}[unit])
    assert [one.assumption for one in log.warnings if one.role == "time"] == [f"the times are in {unit}"]


def test_without_a_time_the_period_is_given_or_that_of_the_paper(read: Read, wrong: Wrong) -> None:
    text = "q1,q2\n0.1,0.2\n0.3,0.4\n0.5,0.1\n"
    log = read(text)
    assert log.t_ns.tolist() == [0, 5_000_000, 10_000_000]
    assert (log.warnings[0].kind, log.warnings[0].message) == (
        "assumed-period",
        "no time column: the rows are taken as 5 ms apart",
    )
    log = read(text, period=1 / 3)
    assert log.t_ns.tolist() == [0, 333_333_333, 666_666_667]
    assert [warning.kind for warning in log.warnings] == ["assumed-unit"]
    for period in (0.0, -1.0, float("nan"), float("inf")):
        assert wrong(text, period=period) == [
            f"period (--period): found {period:g} s, allowed: a positive time of 1e-9 s or more"
        ]


@pytest.mark.parametrize(
    "text",
    [
        "takt,q1,q2\n0.5,0.1,1\n1.25,0.2,1\n1.5,0.3,1\n",
        "q1,q2,way,takt\n0.1,1,0.5,0.5\n0.2,1,0.5,1.25\n0.3,1,0.25,1.5\n",
    ],
)
def test_a_column_that_runs_like_a_clock_is_named_not_taken(read: Read, text: str) -> None:
    log = read(text)
    assert log.t_ns.tolist() == [0, 5_000_000, 10_000_000]
    assert (log.warnings[0].kind, log.warnings[0].hints[1].value) == ("assumed-period", "takt")
    assert read(text, time="takt").t_ns.tolist() == [0, 750_000_000, 1_000_000_000]


@pytest.mark.parametrize("column", ["1,2,3", "0.5,0.5,0.75", "0.5,,x"])
def test_a_counter_and_what_stands_still_are_not_named_as_a_time(read: Read, column: str) -> None:
    cells = column.split(",")
    log = read("takt,q1,q2\n" + "".join(f"{cell},0.{k},1\n" for k, cell in enumerate(cells, 1)))
    assert log.warnings[0].message == ("no time column: the rows are taken as 5 ms apart")


@pytest.mark.parametrize("name", ["way [mm]", "pulses [counts]", "turn_deg"])
def test_what_has_another_unit_is_not_named_as_a_time(read: Read, name: str) -> None:
    log = read(f"{name},q1 [rad],q2 [rad]\n0.5,0.1,1\n1.25,0.2,1\n1.5,0.3,1\n", joints=[2, 3])
    assert [one.message for one in log.warnings] == ["no time column: the rows are taken as 5 ms apart"]


def test_the_time_as_the_user_says(read: Read, wrong: Wrong) -> None:
    text = "a,b,q1\n0,0.5,1\n0,0.6,2\n"
    assert read(text, time="b").t_ns.tolist() == [0, 100_000_000]
    assert read(text, time="2").t_ns.tolist() == [0, 100_000_000]
    assert read(clocked("t", "0", "0"), time="none").t_ns.tolist() == [0, 5_000_000]
    assert wrong(text, time="c") == ["time (--time): found no column 'c', allowed: a, b, q1"]


def test_two_columns_of_one_name(wrong: Wrong, read: Read) -> None:
    text = "time,time,q1\n0,0.5,1\n1,0.6,2\n"
    assert wrong(text) == [
        "log.csv:1, column time: found as columns 1, 2, allowed: once; --time COLUMN selects one:"
        " give"
        " its number"
    ]
    assert read(text, time="2").period == 0.1


def test_a_date_beside_a_number_does_not_matter(read: Read) -> None:
    log = read("timestamp,t,q1\n22:27:21,0,1\n22:27:22,0.1,1\n")
    assert log.period == 0.1


def test_gaps(read: Read) -> None:
    times = np.cumsum([0, *[0.01] * 10, 0.031, *[0.01] * 5, 5.0, *[0.01] * 3])
    log = read(clocked("t", *(f"{time:.3f}" for time in times)), unit={"": "deg"})
    assert [(w.kind, w.row, w.message) for w in log.warnings if w.kind == "gap"] == [
        ("gap", 12, "2 gaps: 0.031 s pass before this row, 5 s before row 18; the median period is 0.01 s")
    ]
    one = next(w for w in read(clocked("t", "0", "0.1", "0.2", "0.9", "1.0")).warnings if w.kind == "gap")
    assert (one.row, one.message) == (4, "0.7 s pass before this row; the median period is 0.1 s")


def test_many_gaps_are_counted(read: Read) -> None:
    times = np.cumsum(np.where(np.arange(200) % 4 == 3, 0.05, 0.01))
    times[150:] += 1.0
    log = read(clocked("t", *(f"{time:.3f}" for time in times)))
    (gaps,) = (warning for warning in log.warnings if warning.kind == "gap")
    told = ", ".join(f"0.05 s before row {row}" for row in range(8, 41, 4))
    assert gaps.message == (
        f"51 gaps: 0.05 s pass before this row, {told}, 41 more, the longest of all of 1.01 s before row 151;"
        " the median period is 0.01 s"
    )
    assert gaps.row == 4


def test_times_that_64_bits_cannot_hold(wrong: Wrong, read: Read) -> None:
    """Windows counts 100 ns since 1601: no unit that is known, and as s an age."""
    text = clocked("t [s]", "133500000000000000", "133500000000050000")
    assert wrong(text) == [
        "log.csv:2, column t [s]: found 1.335e+17 s, allowed: times within 146 years of 0; --unit t=ns"
        f" applies this{OTHER_TIME}"
    ]
    assert read(text, unit={"t": "ns"}).t_ns.tolist() == [0, 50_000]
    assert wrong(clocked("t [s]", "0", "1", "1e30")) == [
        f"log.csv:4, column t [s]: found '1e30', allowed: a number in every row{OTHER_TIME}"
    ]


def test_frames_are_no_clock(read: Read) -> None:
    log = read("Frame,q1\n1,0.5\n2,0.6\n3,0.7\n", period=0.02)
    assert log.t_ns.tolist() == [0, 20_000_000, 40_000_000]
    assert log.joints == ("q1",)


def test_libfranka_writes_milliseconds(read: Read) -> None:
    names = ",".join(f"state.q[{k}]" for k in range(7))
    log = read(f"time,{names}\n1000,0,0,0,0,0,0,0\n1001,1,1,1,1,1,1,1\n")
    assert (log.source, log.clock_start, log.t_ns.tolist()) == ("libfranka", 1.0, [0, 1_000_000])


def test_a_coarse_clock_is_rebuilt_and_that_is_said(read: Read) -> None:
    """20 Hz, whole seconds: the first and the last second are not whole."""
    stamps = (np.arange(13, 13 + 200) // 20).tolist()
    log = read(clocked("t [s]", *map(str, stamps)), unit={"": "deg"})
    assert log.period == pytest.approx(0.05, rel=1e-9)
    assert (np.abs(log.t + log.clock_start - stamps) <= 1.0).all()
    said = "times in steps of 1 s cover 20 rows each"
    assert [(w.kind, w.message) for w in log.warnings if w.kind == "clock-rebuilt"] == [
        ("clock-rebuilt", f"{said}: a regular clock of 0.05 s is used instead")
    ]
    assert [(i.value, i.evidence) for i in log.inferences if i.what == "clock"] == [
        ("rebuilt with a period of 0.05 s", said)
    ]


def test_a_coarse_time_of_day_goes_over_midnight(read: Read) -> None:
    cells = [f"23:59:{k // 10 + 50}" if k < 100 else f"00:00:0{k // 10 - 10}" for k in range(200)]
    log = read(clocked("Time", *cells), unit={"": "deg"})
    assert log.period == pytest.approx(0.1, rel=1e-9)
    assert log.t[-1] == pytest.approx(19.9, rel=1e-9)


@pytest.mark.parametrize(
    ("stamps", "times", "kind", "assumed"),
    [
        ([0, 1, 2, 2, 4, 5], [0, 1, 2, 3, 4, 5], "repeated-time", False),
        ([0, 1, 2, 2, 3, 4], [0, 1, 2, 2.5, 3, 4], "repeated-time", False),
        ([0, 1, 2, 3, 3, 3], [0, 1, 2, 3, 4, 5], "repeated-time", False),
        ([0, 0, 0, 6, 6, 12, 12, 12, 18], [0, 2, 4, 6, 9, 12, 14, 16, 18], "repeated-time", False),
        ([0, 6, 15, 20, 28, 34] * 2, [0, 3, 6, 10.5, 15, 17.5, 20, 24, 28, 31, 34, 37], "clock-spread", True),
        ([0] * 6 + [6] * 3 + [9] + [10] * 8 + [18], [*range(19)], "clock-spread", False),
        ([0] + [6] * 6 + [9] * 3 + [10] + [18] * 8, [*range(19)], "clock-spread", False),
    ],
)
def test_rows_that_share_a_time_are_spread(
    read: Read, stamps: list[int], times: list[float], kind: str, assumed: bool
) -> None:
    """Up to the next one, or back to the one before where the numbers of rows show it (received chunks)."""
    log = read(clocked("t [s]", *map(str, sorted(stamps))), unit={"": "deg"})
    np.testing.assert_allclose(log.t, times, rtol=0, atol=1e-9)
    (warning,) = (one for one in log.warnings if "repeat" in one.message)
    assert (warning.kind, bool(warning.assumption)) == (kind, assumed)


@pytest.mark.parametrize("counts", [[1] * 50 + [500] + [1] * 50, [4, 1, 5]], ids=["stands still", "too few"])
def test_too_few_times_are_refused_with_the_period_as_the_next_step(
    read: Read, wrong: Wrong, counts: list[int]
) -> None:
    rows = [f"{k},{row % 7 / 100}" for k, count in enumerate(counts) for row in range(count)]
    text = "\n".join(["t [s],q1", *rows, ""])
    (said,) = wrong(text)
    assert "rows repeat a time: too coarse to rebuild a clock" in said and "--period SECONDS sets" in said
    assert read(text, time="none", period=0.01).rows == sum(counts)


@pytest.mark.parametrize(("start", "step", "units"), [
    (1_600_000_000, 5, ("s", "ms")), (1_600_000_000_000, 5000, ("ms", "us")),
    (1_600_000_000_000_000, 5_000_000, ("us", "ns")),
])  # fmt: skip
def test_a_counter_since_boot_is_not_taken_for_unix_time(
    read: Read, wrong: Wrong, start: int, step: int, units: tuple[str, str]
) -> None:
    text = clocked("time", *(str(start + k * step) for k in range(4)))
    found = f"found times of our years in steps of {step:g}, which may be {units[0]} or {units[1]}"
    asked = " or ".join(f"--unit time={unit}" for unit in units)
    assert wrong(text) == [f"log.csv:2, column time: {found}; {asked} specifies it{OTHER_TIME}"]
    assert read(text, unit={"time": units[1]}).period == 0.005


def test_minutes_days_and_dates_in_numbers_are_not_taken_for_seconds(read: Read, wrong: Wrong) -> None:
    minutes = clocked("Time [min]", "0", "0.1", "0.2")
    even = f"{OTHER_TIME}; --period SECONDS sets the time between rows then"
    said = f"found the unit 'min', allowed: s, ms, us, ns; convert the times{even}"
    assert wrong(minutes) == [f"log.csv:2, column Time [min]: {said}"]
    assert read(minutes, time="none", period=6.0).period == 6.0
    excel = clocked("Time", *(f"{44297.5 + k * 0.005 / 86400:.12f}" for k in range(4)))
    said = "found 44297.5 in steps of 5.79e-08, as Excel's days since 1900, allowed: times in s, ms, us, ns"
    hint = "convert them: (t - 25569) * 86400 is Unix time in s"
    as_s = "--unit Time=s keeps them unchanged"
    assert wrong(excel) == [f"log.csv:2, column Time: {said}; {hint}; {as_s}{even}"]
    hours = clocked("Time", *(f"{10.5 + k * 0.005 / 3600:.12f}" for k in range(4)))
    said = "found steps of 1.39e-06, as of days or hours, allowed: times in s, ms, us, ns; convert them"
    assert wrong(hours) == [f"log.csv:2, column Time: {said}; {as_s}{even}"]
    assert read(excel, unit={"Time": "s"}).units["Time"] == "s"
    date = clocked("Time", "20211311222721.0", "20211311222721.5")  # of the 13th month
    said = "found 2.02113e+13 s, allowed: times within 146 years of 0"
    hint = "a date is read if it is written as 2021-04-11 22:27:21.5"
    assert wrong(date) == [f"log.csv:2, column Time: {said}; {hint}{OTHER_TIME}"]


def test_a_clock_of_more_than_5_khz_is_said_to_be_assumed(read: Read) -> None:
    log = read(clocked("Time", "0", "0.0001", "0.0002"))
    assert [w.message for w in log.warnings if "time" in w.message] == [
        "the time 'Time' steps by 0.0001: taken as s"
    ]


@pytest.mark.parametrize(
    "times", [("101158", "101159", "101200", "101201"), ("105958", "105959", "110000", "110001")]
)
def test_times_of_day_in_numbers_are_refused_where_they_leap(
    read: Read, wrong: Wrong, times: tuple[str, ...]
) -> None:
    text = clocked("Time", *times)
    said = f"found {times[2]} after {times[1]}, as a time of day hhmmss goes on, allowed: a clock of one unit"
    hint = f"write it as hh:mm:ss; --unit Time=s takes it as no time of day{OTHER_TIME}"
    assert wrong(text) == [f"log.csv:4, column Time: {said}; {hint}"]
    assert read(text, unit={"Time": "s"}).t[1:].tolist()[0] == 1.0


def test_a_gap_of_forty_seconds_is_no_time_of_day(read: Read) -> None:
    assert read(clocked("Time", "57", "58", "59", "100", "101", "162")).t[-1] == 105.0


@pytest.mark.parametrize("names", [("time_sec", "time_nsec"), ("timestamp_secs", "timestamp_nsecs")])
def test_halves_of_a_stamp_are_joined_though_the_first_is_named_like_a_time(
    read: Read, names: tuple[str, str]
) -> None:
    for order in (names, names[::-1]):
        cells = {names[0]: ("7", "7", "8"), names[1]: ("990000000", "995000000", "0")}
        rows = [f"{cells[order[0]][k]},{cells[order[1]][k]},{k}" for k in range(3)]
        log = read("\n".join([f"{order[0]},{order[1]},q1", *rows, ""]))
        assert log.t_ns.tolist() == [0, 5_000_000, 10_000_000]


def test_a_whole_time_beside_whole_nanoseconds_is_no_half_of_it(read: Read) -> None:
    log = read("time_sec,time_nsec,q1\n1.5,1500000000,0\n1.505,1505000000,1\n")
    assert log.t_ns.tolist() == [0, 5_000_000]


@pytest.mark.parametrize(
    ("times", "start"),
    [(("2.350", "2.400"), "2.35 s"), (("10:11:32.5", "10:11:32.6"), "10:11:32.5"), (("0", "0.1"), None)],
)
def test_where_the_clock_starts_is_told(times: tuple[str, ...], start: str | None, read: Read) -> None:
    log = read("t,q1\n" + "".join(f"{time},1\n" for time in times))
    assert log.t_ns[0] == 0
    said = [(one.value, one.evidence) for one in log.inferences if one.what == "start of the time"]
    assert said == ([(start, "the first row; times are counted from it")] if start else [])
