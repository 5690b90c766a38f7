"""Clocks written as text: each form exact to the nanosecond, learned from the cells, or asked for."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import INCREASE, OTHER_TIME
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import read_log
from urmpipe_pipeline.logs.formats.clock_forms import find_forms
from urmpipe_pipeline.logs.formats.numbers import ClockColumn
from urmpipe_pipeline.logs.formats.sniff import sniff
from urmpipe_pipeline.logs.formats.text import open_text
from urmpipe_pipeline.logs.formats.text_table import BlockParser, RowReader, row_blocks
from urmpipe_pipeline.logs.timestamps import read_text_times

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]

SECOND, MS, US = 10**9, 10**6, 10**3
DAY = 86_400 * SECOND


def clocked(*times: str, name: str = "timestamp", delimiter: str = ",") -> str:
    rows = [f"{time}{delimiter}{k // 100}{delimiter}1" for k, time in enumerate(times)]
    return "\n".join([delimiter.join([name, "q1", "q2"]), *rows, ""])


def unix(*parts: int, ns: int = 0) -> int:
    """Nanoseconds of a date in UTC."""
    return int(datetime(*parts, tzinfo=UTC).timestamp()) * SECOND + ns  # type: ignore[arg-type, misc]


def form(log: JointLog) -> str:
    return next(found.value for found in log.inferences if found.what == "form of the time")


def evidence(log: JointLog) -> str:
    return next(found.evidence for found in log.inferences if found.what == "form of the time")


NOON = unix(2021, 4, 11, 22, 27, 21)


@pytest.mark.parametrize(
    ("cells", "start", "step", "name"),
    [
        (("2021-04-11 22:27:21.573641", "2021-04-11 22:27:21.583641"),
         NOON + 573_641 * US, 10 * MS, "year first"),
        (("2021-04-11T22:27:21", "2021-04-11T22:27:21.005"), NOON, 5 * MS, "year first"),
        (("2021-04-11T22:27:21Z", "2021-04-11T22:27:22Z"), NOON, SECOND, "year first"),
        (("2021-04-11T22:27:21.1+02:00", "2021-04-11T22:27:21.2+0200"),
         NOON - 7200 * SECOND + 100 * MS, 100 * MS, "year first"),
        (("2021-04-11 22:27:21.5 -03:30", "2021-04-11 22:27:22.5 -03:30"),
         NOON + 12_600 * SECOND + 500 * MS, SECOND, "year first"),
        (("2021-04-11 22:27:21.123456789", "2021-04-11 22:27:21.123456791"),
         NOON + 123_456_789, 2, "year first"),
        (("2021/04/11 22:27:21", "2021/04/11 22:27:22"), NOON, SECOND, "year first"),
        (("2021/04/11", "2021/04/12"), NOON - (22 * 3600 + 27 * 60 + 21) * SECOND, DAY, "year first"),
        (("20210411_222721.573", "20210411_222721.578"), NOON + 573 * MS, 5 * MS, "without signs"),
        (("20210411T222721Z", "20210411T222722Z"), NOON, SECOND, "without signs"),
        (("01/20/2021 10:11:32.332", "01/20/2021 10:11:32.532"),
         unix(2021, 1, 20, 10, 11, 32, ns=332 * MS), 200 * MS, "month first"),
        (("20/01/2021 10:11:32", "20/01/2021 10:11:33"),
         unix(2021, 1, 20, 10, 11, 32), SECOND, "day first"),
        (("20.1.2021 10:11:32.332", "20.1.2021 10:11:32.432"),
         unix(2021, 1, 20, 10, 11, 32, ns=332 * MS), 100 * MS, "day first"),
        (("1/20/2021 11:59:59 PM", "1/21/2021 12:00:00 AM"),
         unix(2021, 1, 20, 23, 59, 59), SECOND, "month first"),
        (("1/20/2021 12:59:59.9 pm", "1/20/2021 1:00:00 pm"),
         unix(2021, 1, 20, 12, 59, 59, ns=900 * MS), 100 * MS, "month first"),
        (("11-Apr-2021 22:27:21", "11-Apr-2021 22:27:22"), NOON, SECOND, "month by name"),
        (("11. Mai 2021 22:27:21", "11. Mai 2021 22:27:22"),
         unix(2021, 5, 11, 22, 27, 21), SECOND, "month by name"),
        (("2020-02-28 23:59:59", "2020-02-29 00:00:00"),
         unix(2020, 2, 28, 23, 59, 59), SECOND, "year first"),
        (("1969-12-31 23:59:59.75", "1970-01-01 00:00:00"), -250 * MS, 250 * MS, "year first"),
    ],
)  # fmt: skip
def test_dates(read: Read, cells: tuple[str, str], start: int, step: int, name: str) -> None:
    log = read(clocked(*cells))
    assert log.clock_start_ns == start
    assert log.t_ns.tolist() == [0, step]
    assert log.units["timestamp"] == "date"
    assert form(log).endswith(name)
    assert log.columns[0].factor == 1.0


@pytest.mark.parametrize(
    ("cells", "start", "step", "unit"),
    [
        (("22:27:21.573641", "22:27:21.583641"), 80_841 * SECOND + 573_641 * US, 10 * MS, "time of day"),
        (("10:11 PM", "10:12 PM"), (22 * 60 + 11) * 60 * SECOND, 60 * SECOND, "time of day"),
        (("27:00:01.5", "27:00:02"), 97_201_500 * MS, 500 * MS, "time of day"),
        (("00:00:01.005", "00:00:01.01"), 1005 * MS, 5 * MS, "time of day"),
        (("-00:00:00.5", "00:00:00"), -500 * MS, 500 * MS, "time of day"),
        (("0.005 sec", "1 sec"), 5 * MS, 995 * MS, "s"),
        (("-0.1 s", "0.05 s"), -100 * MS, 150 * MS, "s"),
        (("0.5 ms", "1.0000005 ms"), 500 * US, 500 * US, "s"),
        (("0.1 min", "1.5 hr"), 6 * SECOND, 5394 * SECOND, "s"),
        (("0 days 00:00:00.005000", "0 days 00:00:00.010000"), 5 * MS, 5 * MS, "s"),
        (("-1 days +23:59:59.995000", "0 days 00:00:00"), -5 * MS, 5 * MS, "s"),
    ],
)
def test_times_of_day_and_lengths_of_time(
    read: Read, cells: tuple[str, str], start: int, step: int, unit: str
) -> None:
    log = read(clocked(*cells, name="Time"))
    assert (log.clock_start_ns, log.t_ns.tolist()) == (start, [0, step])
    assert log.units["Time"] == unit


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
def test_german_dates_with_decimal_commas(read: Read, encoding: str) -> None:
    """The stream turns commas to points: the points of a date are told apart from them."""
    text = clocked("20.01.2021 10:11:32,332", "20.01.2021 10:11:32,337", name="Zeit", delimiter=";")
    log = read(text.replace(";1\n", ";0,5\n"), encoding=encoding)
    assert log.clock_start_ns == unix(2021, 1, 20, 10, 11, 32, ns=332 * MS)
    assert log.t_ns.tolist() == [0, 5 * MS]
    assert log.q[:, 1].tolist() == [0.5, 0.5]
    assert form(log) == "date and time, day first"


def test_quoted_and_padded_cells(read: Read) -> None:
    log = read(clocked('" 01/20/2021 10:11:32.332"', '"01/20/2021 10:11:32.5 "', "  01/20/2021 10:11:33"))
    assert log.t_ns.tolist() == [0, 168 * MS, 668 * MS]


def test_a_day_far_behind_the_head_decides(read: Read) -> None:
    """The sampled cells may be read in both ways; one at the end cannot be a month."""
    cells = [f"{1 + k // 200:02d}/04/2021 {k % 200 // 60 + 12:02d}:{k % 60:02d}:00" for k in range(200)]
    cells += [f"{day:02d}/04/2021 12:00:00" for day in range(2, 14)]
    log = read(clocked(*sorted(set(cells))))
    assert form(log) == "date and time, day first"
    assert "as date and time, month first '13/04/2021 12:00:00' in row 212 is no time" in evidence(log)
    assert log.clock_start_ns == unix(2021, 4, 1, 12)
    assert np.diff(log.t_ns)[-1] == DAY


def test_dates_that_run_backwards_in_one_order_are_of_the_other(read: Read) -> None:
    """31 January to 1 February would be decided by 31; 9 October to 10 October only by its direction."""
    log = read(
        clocked("10/09/2021 23:59:59", "11/09/2021 00:00:00", "12/09/2021 00:00:00", "01/10/2021 00:00:00")
    )
    assert form(log) == "date and time, day first"
    assert evidence(log).startswith(
        "its cells, such as '10/09/2021 23:59:59'; in another form they run backwards"
    )


def test_an_order_that_makes_no_difference_is_taken_and_told(read: Read) -> None:
    log = read(clocked("02/01/2021 10:11:32.332", "02/01/2021 10:11:32.532"))
    assert log.t_ns.tolist() == [0, 200 * MS]
    assert log.clock_start_ns == unix(2021, 1, 2, 10, 11, 32, ns=332 * MS)
    assert "as date and time, month first the steps are the same" in evidence(log)
    assert [w.kind for w in log.warnings] == ["assumed-unit"]


def test_an_order_that_nothing_tells_is_asked_for(read: Read, wrong: Wrong) -> None:
    text = clocked("01/02/2021 23:59:59", "02/02/2021 00:00:01", "03/02/2021 00:00:02")
    assert wrong(text) == [
        "log.csv:2, column timestamp: found '01/02/2021 23:59:59', which may be date and time, day"
        " first or date and time, month first; --unit timestamp=dmy or --unit timestamp=mdy"
        f" specifies it{OTHER_TIME}"
    ]
    assert read(text, unit={"timestamp": "dmy"}).t_ns.tolist() == [0, 2 * SECOND, DAY + 3 * SECOND]
    assert read(text, unit={"timestamp": "mdy"}).clock_start_ns == unix(2021, 1, 2, 23, 59, 59)
    header = text.replace("timestamp", "Date (dd/mm/yyyy)")
    assert read(header).t_ns.tolist() == [0, 2 * SECOND, DAY + 3 * SECOND]
    assert wrong(text, unit={"timestamp": "ms"}) == [
        f"unit (--unit): found ms for the time 'timestamp', allowed: dmy, mdy{OTHER_TIME}"
    ]


def test_microseconds_that_are_not_zero_padded(read: Read) -> None:
    log = read(clocked("10:11:32:995021", "10:11:33:21", "10:11:33:5021", "10:11:33:10021", name="Time"))
    assert np.diff(log.t_ns).tolist() == [5 * MS] * 3
    assert form(log) == "time of day, microseconds behind the last colon"
    assert evidence(log) == ("its cells, such as '10:11:32:995021'; in another form they run backwards")


def test_a_wrong_row_does_not_change_what_its_neighbours_mean(wrong: Wrong) -> None:
    """One row too late in the file: as decimals the clock would run backwards in more places."""
    cells = [f"10:11:{33 + k // 200}:{k % 200 * 5000}" for k in range(600)]
    cells[300] = "10:11:33:0"
    assert wrong(clocked(*cells, name="Time")) == [
        f"log.csv:302, column Time: found 10:11:33 after 10:11:34.495, {INCREASE}"
    ]


def test_zero_padded_digits_behind_a_colon_are_decimals(read: Read) -> None:
    log = read(clocked("10:11:32:995", "10:11:33:000", "10:11:33:005", name="Time"))
    assert np.diff(log.t_ns).tolist() == [5 * MS] * 2
    assert form(log) == "time of day, decimals behind the last colon"


def test_digits_behind_a_colon_that_nothing_tells_are_asked_for(read: Read, wrong: Wrong) -> None:
    text = clocked("10:11:32:100", "10:11:32:105", "10:11:32:110", name="Time")
    assert wrong(text) == [
        "log.csv:2, column Time: found '10:11:32:100', which may be time of day, decimals behind the"
        " last colon or time of day, microseconds behind the last colon; --unit Time=s or"
        f" --unit Time=us specifies it{OTHER_TIME}"
    ]
    assert read(text, unit={"Time": "us"}).t_ns.tolist() == [0, 5 * US, 10 * US]
    assert read(text, unit={"Time": "ms"}).t_ns.tolist() == [0, 5 * MS, 10 * MS]


def test_midnight(read: Read, wrong: Wrong) -> None:
    log = read(clocked("23:59:59.995", "00:00:00", "00:00:00.005", name="Time"))
    assert log.t_ns.tolist() == [0, 5 * MS, 10 * MS]
    assert [(i.value, i.evidence) for i in log.inferences if i.what == "nights passed"] == [
        ("1", "there the time of day falls back by nearly 24 h: the next day begins")
    ]
    assert wrong(clocked("12:00:00", "12:00:01", "11:59:59", name="Time")) == [
        f"log.csv:4, column Time: found 11:59:59 after 12:00:01, {INCREASE}"
    ]


@pytest.mark.parametrize(
    "header", ["Date,Time,q1", "Time,Date,q1", "Datum;Uhrzeit;A1", "day,clock,q1", "Date Time q1"]
)
def test_date_and_time_in_two_columns(read: Read, header: str) -> None:
    delimiter = ";" if ";" in header else " " if "," not in header else ","
    rows = [["2021-12-31", "23:59:59.995", "1"], ["2022-01-01", "00:00:00", "2"]]
    if header.startswith("Time"):
        rows = [[time, date, q] for date, time, q in rows]
    log = read("\n".join([header, *(delimiter.join(row) for row in rows)]))
    assert log.clock_start_ns == unix(2021, 12, 31, 23, 59, 59, ns=995 * MS)
    assert log.t_ns.tolist() == [0, 5 * MS]
    assert sorted(list(log.units.values())[:2]) == ["date", "time of day"]


def test_a_clock_without_a_name_or_a_header(read: Read) -> None:
    """The index of pandas has no name; numpy writes no header at all."""
    log = read(clocked("0 days 00:00:00", "0 days 00:00:00.005000", name=""))
    assert log.t_ns.tolist() == [0, 5 * MS]
    log = read("2021-04-11 22:27:21.5,0.25,1\n2021-04-11 22:27:21.505,0.5,1\n")
    assert log.t_ns.tolist() == [0, 5 * MS]
    assert log.joints == ("q1", "q2")


def test_cells_that_are_no_times_are_all_told(wrong: Wrong) -> None:
    text = clocked("2021-04-11 22:27:21", "2021-02-30 22:27:22", "2021-04-11 24:27:22", "", "soon",
                   "2021-04-11 22:27:20", "2021-04-11 22:27:26")  # fmt: skip
    like = f"allowed: times as in the other rows{OTHER_TIME}"
    expected = [
        f"log.csv:3, column timestamp: found '2021-02-30 22:27:22', {like}",
        f"log.csv:4, column timestamp: found '2021-04-11 24:27:22', {like}",
        f"log.csv:5, column timestamp: found no time, allowed: a time in every row{OTHER_TIME}",
        f"log.csv:6, column timestamp: found 'soon', {like}",
        f"log.csv:7, column timestamp: found 2021-04-11 22:27:20 after 2021-04-11 22:27:21, {INCREASE}",
    ]
    assert wrong(text) == expected
    assert wrong(text.replace("-11 22:27:26,0,1", "-11 22:27:26,x,1"))[:5] == expected


def test_text_that_is_no_clock_is_refused(wrong: Wrong) -> None:
    assert wrong(clocked("yesterday", "today")) == [
        "log.csv:2, column timestamp: found 'yesterday', allowed: numbers in s, ms, us or ns,"
        f" or times such as 2021-04-11 22:27:21.573, 22:27:21.573, 0.005 sec{OTHER_TIME}"
    ]


WRITERS: dict[str, Callable[[datetime], str]] = {
    "iso": lambda t: t.isoformat(" "),
    "iso zone": lambda t: t.replace(tzinfo=UTC).isoformat(),
    "us": lambda t: t.strftime("%m/%d/%Y %I:%M:%S.%f %p"),
    "german": lambda t: t.strftime("%d.%m.%Y %H:%M:%S.%f"),
    "dense": lambda t: t.strftime("%Y%m%d_%H%M%S.%f"),
    "matlab": lambda t: t.strftime("%d-%b-%Y %H:%M:%S.%f"),
    "counted": lambda t: t.strftime("%Y-%m-%d %H:%M:%S:") + str(t.microsecond),
}


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    st.datetimes(datetime(1900, 1, 1), datetime(2100, 1, 1)),
    st.lists(st.integers(1, 10**12), min_size=2, max_size=30),
    st.sampled_from(sorted(WRITERS)),
)
def test_dates_are_exact_parsed_and_by_row(start: datetime, steps: list[int], writer: str) -> None:
    """Steps of 1 us to 11 days, written by Python's own clock."""
    exact = [start + timedelta(microseconds=int(us)) for us in np.cumsum([0, *steps])]
    if max(exact) > datetime(2110, 1, 1):
        return
    text = "stamp,q1\n" + "".join(f"{WRITERS[writer](time)},1.5\n" for time in exact)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(text)
        layout = sniff(open_text(path))
        # which of several forms it is may stay open: here the writer is known
        key = {"us": "mdy", "german": "dmy", "counted": "us"}.get(writer, "")
        forms = find_forms(layout.cells(0))
        clock = (ClockColumn(0, forms=tuple(f for f in forms if key in f.keys) or forms),)
        parsed = BlockParser(layout, [1], clock).parse(b"".join(row_blocks(layout)))
        by_row = RowReader(layout, [1], clock).read(text.splitlines()[1:])
        assert parsed is not None
        read = [read_text_times(layout, clock, numbers).clock for numbers in (parsed, by_row)]
    wanted = [(time - datetime(1970, 1, 1)) // timedelta(microseconds=1) * 1000 for time in exact]
    assert [times.tolist() for times in read if times is not None] == [wanted, wanted]


@pytest.mark.slow
def test_a_log_with_dates_and_the_same_with_seconds_have_the_same_times(tmp_path: Path) -> None:
    """Rows are read by the block: the last of one and the first of the next keep their places."""
    count = 70_000
    first = datetime(2021, 12, 31, 23, 58, tzinfo=UTC)
    stamps = [(first + timedelta(milliseconds=5 * k)).strftime("%Y-%m-%d %H:%M:%S.%f") for k in range(count)]
    path = tmp_path / "log.csv"
    path.write_text("t,q1\n" + "".join(f"{stamp},{k % 7}.5\n" for k, stamp in enumerate(stamps)))
    log = read_log([path])
    np.testing.assert_array_equal(log.t_ns, np.arange(count) * 5 * MS)
