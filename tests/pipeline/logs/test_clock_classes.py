"""What labs write as a clock: each class in variants of names, units, delimiters, with and without a header.

The writers here know nothing of the reader. Each table is read right, or the one question that it raises has
an answer that reads it right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.clock_columns import kind_of_steps
from urmpipe_pipeline.logs.map_file import format_map, map_of, read_map

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Write = Callable[..., Path]

MS = 1_000_000
SECOND = 1_000_000_000
UNIX = 1_594_744_744_300_000_000  # 2020-07-14 16:39:04.3 UTC in [ns]
ROWS = 400

RNG = np.random.default_rng(25)
JITTER = np.cumsum(RNG.choice([4, 4, 4, 5, 13], ROWS) * MS + RNG.integers(-200, 200, ROWS) * 1000) - 3 * MS
EVEN = np.arange(ROWS) * 10 * MS

PHASES = np.arange(6) * 1.1
Q: FloatArray = 0.7 * np.sin(np.outer(np.arange(ROWS) / 40.0, [1.0, 1.3, 0.8, 1.7, 1.1, 0.9]) + PHASES)
JOINTS = [f"q{k}" for k in range(1, 7)]


def table(
    clock: Sequence[Sequence[object]],
    *,
    names: Sequence[str] = (),
    delimiter: str = ",",
    behind: bool = False,
    q: FloatArray = Q,
) -> str:
    """The columns of a clock beside six joints; without names there is no header."""
    joints = [[f"{value:.6f}" for value in column] for column in q.T]
    columns = [*joints, *clock] if behind else [*clock, *joints]
    header = [*JOINTS, *names] if behind else [*names, *JOINTS]
    rows = [delimiter.join(map(str, row)) for row in zip(*columns, strict=True)]
    return "\n".join([delimiter.join(header), *rows] if names else rows) + "\n"


def seconds(t_ns: IntArray, decimals: int = 6) -> list[str]:
    return [f"{t // SECOND}.{t % SECOND:09d}"[: decimals - 9 or None] for t in t_ns.tolist()]


def assert_times(log: JointLog, t_ns: IntArray, tolerance: int = 0) -> None:
    assert len(log.joints) == 6
    np.testing.assert_allclose(log.q[0], Q[0], atol=1e-6)  # six decimals are written
    np.testing.assert_allclose(log.t_ns, t_ns - t_ns[0], rtol=0, atol=tolerance)


def parts(t_ns: IntArray, unit: int) -> list[list[int]]:
    """Whole seconds, and what goes on from them in some unit in [ns]."""
    return [(t_ns // SECOND).tolist(), (t_ns % SECOND // unit).tolist()]


@pytest.mark.parametrize(
    ("clock", "delimiter", "behind"),
    [
        (seconds(JITTER), ",", False),
        (seconds(JITTER + 77 * SECOND), ";", True),
        ([f"{t / 1e9:.18e}" for t in (JITTER + UNIX).tolist()], " ", False),
    ],
)
def test_without_a_header_what_alone_increases_is_the_clock(
    read: Read, clock: list[str], delimiter: str, behind: bool
) -> None:
    """%.18e of a Unix time in s has 240 ns between two floats of 64 bits."""
    assert_times(read(table([clock], delimiter=delimiter, behind=behind)), JITTER, 600)


@pytest.mark.parametrize("columns", [2, 6])
def test_without_a_header_each_ramp_may_be_the_time_and_is_asked_about_once(
    read: Read, wrong: Wrong, columns: int
) -> None:
    q = Q.copy()
    q[:, :columns] = np.linspace(0.1, 1.1, ROWS)[:, np.newaxis] * np.arange(1, columns + 1)
    text = table([], q=q)
    (said,) = wrong(text)
    assert all(f"--time {column}" in said for column in (*range(1, columns + 1), "none"))
    assert read(text, time="none", unit={"": "rad"}).q.shape == (ROWS, 6)


def test_no_question_where_the_robot_or_the_user_tells_the_joints(
    read: Read, arm: Callable[..., object]
) -> None:
    ramps = np.linspace(0.1, 1.1, ROWS)[:, np.newaxis] * np.arange(1, 7)
    assert read(table([], q=ramps), arm(6)).q.shape == (ROWS, 6)
    named = read(table([seconds(EVEN)], q=ramps), joints=[2, 3, 4, 5, 6, 7])
    np.testing.assert_array_equal(named.t_ns, EVEN)


@pytest.mark.parametrize("clock", [range(ROWS), range(1, ROWS + 1)])
def test_a_counter_is_asked_about(wrong: Wrong, clock: range) -> None:
    (said,) = wrong(table([clock]))
    assert "which may be the time, a counter or a joint; --time 1 or --time none specifies it" in said


@pytest.mark.parametrize(
    ("steps", "kind"),
    [
        (np.full(60, 0.005), "even"),
        (np.where(np.arange(60) % 20 == 7, 0.02, 0.005), "even"),  # gaps
        (np.diff(np.round(np.arange(61) / 300.0, 3)), "even"),  # rounded times of a regular clock
        (0.005 + 0.001 * np.random.default_rng(1).standard_normal(60), "rough"),
        (np.sin(np.linspace(0.1, 3.0, 60)), "smooth"),  # a joint from rest to rest
        (np.diff(np.round(np.sin(np.linspace(0.0, 1.2, 61)), 3)), "unclear"),  # a joint in three decimals
    ],
)
def test_the_steps_of_clocks_and_joints(steps: FloatArray, kind: str) -> None:
    assert kind_of_steps(np.cumsum(np.r_[1.0, steps])) == kind


def dense(form: str, t_ns: IntArray) -> list[str]:
    start = datetime(2020, 7, 14, 16, 39, 4, tzinfo=UTC)
    return [(start + timedelta(microseconds=t // 1000)).strftime(form) for t in t_ns.tolist()]


@pytest.mark.slow
@pytest.mark.parametrize("names", [(), ("stamp_of_row",), ("Date",)])
@pytest.mark.parametrize("form", ["%Y%m%d%H%M%S.%f", "%Y%m%d_%H%M%S.%f", "%Y%m%d%H%M%S%f"])
@pytest.mark.parametrize("delimiter", [",", ";"])
def test_a_date_in_digits(read: Read, names: tuple[str, ...], form: str, delimiter: str) -> None:
    log = read(table([dense(form, EVEN)], names=names, delimiter=delimiter))
    assert_times(log, EVEN)
    assert log.clock_start_ns == UNIX - 300 * MS


@pytest.mark.parametrize("names", [(), ("date", "time"), ("Datum", "Uhrzeit")])
def test_a_date_and_a_time_of_day_in_digits(read: Read, names: tuple[str, ...]) -> None:
    log = read(table([dense("%Y%m%d", EVEN), dense("%H%M%S.%f", EVEN)], names=names))
    assert_times(log, EVEN)
    assert log.clock_start_ns == UNIX - 300 * MS


@pytest.mark.parametrize("names", [(), ("stamp",)])
def test_a_date_with_an_exponent(read: Read, names: tuple[str, ...]) -> None:
    """numpy.savetxt writes numbers so; between two floats of 2e13 there are 4 ms."""
    clock = [f"{float(text):.18e}" for text in dense("%Y%m%d%H%M%S.%f", EVEN * 5)]
    assert_times(read(table([clock], names=names)), EVEN * 5, 4 * MS)


def test_a_date_in_whole_seconds_is_rebuilt(read: Read) -> None:
    log = read(table([dense("%Y%m%d%H%M%S", EVEN * 5)]))
    assert log.period == pytest.approx(0.05)
    assert "clock-rebuilt" in [warning.kind for warning in log.warnings]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "unit"),
    [
        (("sec", "nsec"), 1),
        (("header.stamp.secs", "header.stamp.nsecs"), 1),
        (("stamp_sec", "stamp_nanosec"), 1),
        (("Time Stamp/seconds", "Time Stamp/nseconds"), 1),
        (("Stempel [s]", "Rest"), 1),
        (("tv_sec", "tv_usec"), 1000),
        (("ts_sec", "ts_msec"), MS),
        (("time", "ns"), 1),
        ((), 1),
        ((), 1000),
        ((), MS),
    ],
)
@pytest.mark.parametrize("start", [UNIX, 12 * SECOND])
@pytest.mark.parametrize("resolution", [1000, MS])
def test_a_clock_in_two_columns(
    read: Read, names: tuple[str, ...], unit: int, start: int, resolution: int
) -> None:
    t_ns = (JITTER + start) // resolution * resolution
    assert_times(read(table(parts(t_ns, unit), names=names)), t_ns // unit * unit)


@pytest.mark.parametrize("names", [(), ("a", "b")])
@pytest.mark.parametrize("half", ["1", "2"])
def test_either_half_names_a_clock_in_two_columns(read: Read, names: tuple[str, ...], half: str) -> None:
    assert_times(read(table(parts(JITTER + UNIX, 1), names=names), time=half), JITTER)


@pytest.mark.parametrize("names", [(), ("time", "fraction"), ("epoch_sec", "epoch_frac")])
def test_whole_seconds_beside_their_decimals(read: Read, names: tuple[str, ...]) -> None:
    t_ns = JITTER + UNIX
    decimals = [f"0.{t % SECOND // 1000:06d}" for t in t_ns.tolist()]
    assert_times(read(table([(t_ns // SECOND).tolist(), decimals], names=names)), t_ns // 1000 * 1000)


@pytest.mark.parametrize("names", [(), ("time",), ("stamp",)])
def test_nanoseconds_that_are_not_zero_padded(read: Read, names: tuple[str, ...]) -> None:
    t_ns = JITTER + UNIX
    assert_times(read(table([[f"{t // SECOND}.{t % SECOND}" for t in t_ns.tolist()]], names=names)), t_ns)


def test_a_segment_and_its_rows_are_no_seconds(wrong: Wrong, read: Read) -> None:
    segments, rows = [k // 20 for k in range(ROWS)], [k % 20 for k in range(ROWS)]
    log = read(table([segments, rows], names=("segment", "row")))
    assert [column.role for column in log.columns].count("time") == 0


@pytest.mark.slow
@pytest.mark.parametrize("names", [(), ("t",), ("timestamp",)])
@pytest.mark.parametrize("unit", [SECOND, MS, 1000, 1])
def test_the_size_of_a_unix_time_tells_its_unit(read: Read, names: tuple[str, ...], unit: int) -> None:
    t_ns = EVEN + UNIX
    clock = seconds(t_ns, 3) if unit == SECOND else (t_ns // unit).tolist()
    log = read(table([clock], names=names))
    assert_times(log, EVEN)
    assert log.clock_start_ns == UNIX


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "step", "kind", "cure"),
    [
        ("738000.5", 1 / 86400, "MATLAB's datenum in days", "(t - 719529) * 86400"),
        ("44000.5", 0.02 / 86400, "Excel's days since 1900", "(t - 25569) * 86400"),
        ("2459000.5", 0.5 / 86400, "Julian days", "(t - 2440587.5) * 86400"),
        ("637303143440000000", 50_000, ".NET's ticks of 100 ns", "(t - 621355968000000000) / 10"),
        ("132393143440000000", 50_000, "Windows' ticks of 100 ns", "(t - 116444736000000000) / 10"),
    ],
)
@pytest.mark.parametrize("names", [(), ("Time",)])
def test_other_epochs_are_named(
    wrong: Wrong, read: Read, first: str, step: float, kind: str, cure: str, names: tuple[str, ...]
) -> None:
    if "." in first:
        clock: list[object] = [f"{float(first) + k * step:.11f}" for k in range(ROWS)]
    else:
        clock = [int(first) + k * int(step) for k in range(ROWS)]
    text = table([clock], names=names)
    (said,) = wrong(text, **({} if names else {"time": "1"}))
    assert f"as {kind}, allowed: times in s, ms, us, ns; convert them: {cure} is Unix time" in said
    assert "--time none leaves the time column out" in said
    assert read(text, time="none", joints=[2, 3, 4, 5, 6, 7], period=0.01).q.shape == (ROWS, 6)


def chunks_of(rows: int) -> list[int]:
    """Numbers of rows of chunks, the last one cut."""
    counts = np.random.default_rng(3).integers(1, 7, rows)
    whole = counts[np.cumsum(counts) < rows]
    return [*whole.tolist(), rows - int(whole.sum())]


COUNTS = chunks_of(ROWS)


def chunked(counts: Sequence[int], *, first: bool = False) -> IntArray:
    """Stamps of rows at 4 ms: that of the last row of its chunk, or of the first."""
    ends = np.cumsum(counts)
    return np.repeat((ends - counts if first else ends - 1) * 4 * MS, counts)


@pytest.mark.parametrize(("names", "start"), [(("t",), 5 * SECOND), (("Zeit [s]",), 0), ((), UNIX)])
@pytest.mark.parametrize("first", [False, True])
def test_a_stamp_of_a_chunk_is_spread_over_its_rows(
    read: Read, names: tuple[str, ...], start: int, first: bool
) -> None:
    log = read(table([seconds(chunked(COUNTS, first=first) + start)], names=names))
    np.testing.assert_allclose(np.diff(log.t_ns), 4 * MS, atol=1000)  # written in us
    (warning,) = (one for one in log.warnings if one.kind == "clock-spread")
    assert f"spread evenly {'up to the next' if first else 'back to the'} time" in warning.message
    assert [hint.parameter for hint in warning.hints] == ["time", "time", "period"]


def test_chunks_without_a_header_are_asked_about(wrong: Wrong, read: Read) -> None:
    text = table([seconds(chunked(COUNTS))])
    (said,) = wrong(text)
    assert "--time 1 or --time none specifies it" in said
    np.testing.assert_allclose(np.diff(read(text, time="1").t_ns), 4 * MS, atol=1000)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("dt", SECOND), ("delta_t", SECOND), ("duration [ms]", MS), ("dauer_ms", MS), ("step_time", SECOND)],
)
@pytest.mark.parametrize("delimiter", [",", ";"])
def test_durations_are_summed(read: Read, name: str, unit: int, delimiter: str) -> None:
    steps = np.diff(JITTER, prepend=JITTER[0] - 4 * MS)
    log = read(table([[f"{step / unit:.6f}" for step in steps.tolist()]], names=[name], delimiter=delimiter))
    assert_times(log, JITTER, ROWS)  # 1e-6 ms is 1 ns a row
    assert log.clock_start_ns == 4 * MS
    assert "clock-summed" in [warning.kind for warning in log.warnings]


def test_durations_to_the_row_behind_end_with_none(read: Read) -> None:
    steps = np.diff(JITTER, append=JITTER[-1])
    log = read(table([[f"{step / SECOND:.9f}" for step in steps.tolist()]], names=["dt"]))
    assert_times(log, JITTER)
    assert log.clock_start_ns == 0


def test_a_duration_beside_a_time_is_none(read: Read) -> None:
    log = read(table([["0.5"] * ROWS, seconds(EVEN)], names=["dt", "t"]))
    np.testing.assert_array_equal(log.t_ns, EVEN)


@pytest.mark.parametrize("times", [RNG.permutation(EVEN), np.full(ROWS, SECOND)])
def test_what_is_named_like_a_time_and_is_none_is_one_finding(
    wrong: Wrong, read: Read, times: IntArray
) -> None:
    text = table([seconds(times)], names=["t"])
    (said,) = wrong(text)
    assert "--time COLUMN names the time column; --time none leaves the time column out; --period " in said
    assert read(text, time="none", period=0.01).period == 0.01


TIMES = "k;stamp;note\n" + "".join(f"{k};{t};x\n" for k, t in enumerate(seconds(EVEN + 7 * SECOND, 3)))


@pytest.mark.parametrize("names", [(), ("t",)])
@pytest.mark.parametrize(
    ("times", "column"), [(TIMES, "stamp"), (TIMES, "2"), ("\n".join(seconds(EVEN)), "1")]
)
def test_a_column_of_another_file_is_the_time(
    write: Write, names: tuple[str, ...], times: str, column: str
) -> None:
    """A clock of the log itself is neither used nor a joint."""
    path, clock = write(table([seconds(JITTER)], names=names), "q.csv"), write(times, "times: all.csv")
    log = read_log([path], LogMap(time=f"{clock}:{column}"))
    assert_times(log, EVEN)
    assert [file.name for file in log.files] == ["q.csv", "times: all.csv"]
    assert next(one.value for one in log.inferences if one.what == "time column") == f"{clock.name}:{column}"


def test_a_map_keeps_the_file_of_the_times(write: Write, tmp_path: Path) -> None:
    path, clock = write(table([], names=()), "q.csv"), write(TIMES, "times.csv")
    time = f"{clock}:stamp"
    log = read_log([path], LogMap(time=time))
    for text in (format_map(map_of(log, LogMap(time=time))), 'time = "times.csv:stamp"\n'):
        again = read_log([path], read_map(write(text, "lab.toml")))
        np.testing.assert_array_equal(again.t_ns, log.t_ns)


def test_a_file_of_times_that_does_not_fit(write: Write) -> None:
    path, clock = write(table([]), "q.csv"), write("stamp\n0\n0.1\n", "times.csv")
    said = refusal(LogError, read_log, [path], LogMap(time=f"{clock}:stamp"))
    assert said == f"{clock}: found 2 times, allowed: {ROWS}, as q.csv has rows"
    said = refusal(LogError, read_log, [path], LogMap(time=f"{clock}:clock"))
    assert said == "time (--time): found no column 'clock', allowed: stamp"
    said = refusal(OptionError, read_log, [path, path], LogMap(time=f"{clock}:stamp"))
    assert said.endswith(" for 2 tables, allowed: FILE:COLUMN for one table")


def test_the_log_of_a_dx200(shared: Path) -> None:
    path = shared / "logs" / "motoman-dx200" / "joint_recording.csv"
    log = read_log([path], LogMap(joints=tuple(str(k) for k in range(2, 8))))
    stamps = np.loadtxt(path.read_text().replace(",\n", "\n").splitlines(), delimiter=",")[:, 0]
    np.testing.assert_allclose(log.t_ns / 1e9, stamps - stamps[0], atol=5e-7)  # floats of 1.7e9 s
