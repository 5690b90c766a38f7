"""Logs that differ in how they tell the time; q1..q6 in rad beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd

from by_python import Q6, frame, to_csv, writer
from by_robots import EPOCH
from specimen import Made, Truth, made, motion, specimen

ROWS = 24

PERIOD = 0.020461
"""No multiple of 1 ms: microseconds have leading zeros in some rows."""

START = datetime(2021, 4, 11, 22, 27, 21, 573641)


def clocked(
    name: str,
    header: str,
    text: Callable[[float], object],
    truth: Truth,
    within: float = 1e-9,
    start: float = 0,
) -> Made:
    """Return a log whose times are written by a function of the seconds since its first row."""
    rows = [[text(t), *q] for t, q in zip(truth.t.tolist(), truth.q.tolist(), strict=True)]
    truth = replace(truth, t_within=within, start=start, qd=None)
    return made(f"{name}.csv", writer([[header, *Q6], *rows]), truth)


def at(t: float, start: datetime = START) -> datetime:
    """Return the date so many seconds after the start, rounded to 1 us."""
    return start + timedelta(microseconds=round(t * 1e6))


def _seconds(moment: datetime) -> float:
    """Return a date without a zone, taken as UTC, in [s] since 1970."""
    return moment.replace(tzinfo=UTC).timestamp()


def _crossing() -> Truth:
    """Return a motion that goes on past a full second after 22:27:21.573641."""
    return motion(ROWS, PERIOD)


@specimen
def clock_ms() -> Made:
    """Time in ms, said in its name: time_ms."""
    return clocked("clock_ms", "time_ms", lambda t: round(1000 * t), motion(ROWS))


@specimen
def clock_us() -> Made:
    """Time in us, said in brackets: Time (us)."""
    return clocked("clock_us", "Time (us)", lambda t: round(1e6 * t), _crossing())


@specimen
def clock_ms_unsaid() -> Made:
    """Time in ms, not said: t counts 0, 20, 40."""
    return clocked("clock_ms_unsaid", "t", lambda t: round(1000 * t), motion(ROWS))


@specimen
def clock_epoch_s() -> Made:
    """time.time(): seconds since 1970 with all their digits."""
    return clocked(
        "clock_epoch_s", "timestamp", lambda t: EPOCH + 0.25 + t, _crossing(), 2.4e-7, EPOCH + 0.25
    )


@specimen
def clock_epoch_ms() -> Made:
    """Date.now(): milliseconds since 1970, 13 digits, unit not said."""
    return clocked(
        "clock_epoch_ms", "timestamp", lambda t: EPOCH * 1000 + round(1000 * t), motion(ROWS), start=EPOCH
    )


@specimen
def clock_epoch_us() -> Made:
    """Microseconds since 1970, 16 digits, unit not said."""
    return clocked(
        "clock_epoch_us", "timestamp", lambda t: EPOCH * 10**6 + round(1e6 * t), _crossing(), start=EPOCH
    )


@specimen
def clock_epoch_ns() -> Made:
    """time.time_ns(): nanoseconds since 1970, 19 digits, unit in the name."""
    return clocked(
        "clock_epoch_ns",
        "timestamp_ns",
        lambda t: EPOCH * 10**9 + round(1e9 * t) + 7,
        _crossing(),
        start=EPOCH + 7e-9,
    )


@specimen
def clock_sec_nanosec() -> Made:
    """Seconds and nanoseconds in two columns: sec,nanosec; the nanoseconds start again at each second."""
    truth = replace(_crossing(), qd=None)
    stamps = [EPOCH * 10**9 + 573_641_000 + round(1e9 * t) for t in truth.t.tolist()]
    rows = [[s // 10**9, s % 10**9, *q] for s, q in zip(stamps, truth.q.tolist(), strict=True)]
    text = writer([["sec", "nanosec", *Q6], *rows])
    return made("clock_sec_nanosec.csv", text, replace(truth, start=EPOCH + 0.573641))


@specimen
def clock_datetime() -> Made:
    """datetime.now() through csv.writer: 2021-04-11 22:27:21.573641."""
    return clocked("clock_datetime", "time", at, _crossing(), start=_seconds(START))


@specimen
def clock_datetime_whole_second() -> Made:
    """str(datetime) on a whole second: 2021-04-11 22:27:22 without a fraction, between rows that have one."""
    start = datetime(2021, 4, 11, 22, 27, 21, 800000)
    return clocked(
        "clock_datetime_whole_second", "time", lambda t: at(t, start), motion(ROWS), start=_seconds(start)
    )


@specimen
def clock_pandas_datetime() -> Made:
    """pandas.to_csv of a DatetimeIndex."""
    truth = replace(_crossing(), qd=None)
    table = frame(truth).drop(columns="t")
    table.index = pd.DatetimeIndex([at(t) for t in truth.t.tolist()], name="time")
    return made("clock_pandas_datetime.csv", to_csv(table), replace(truth, start=_seconds(START)))


@specimen
def clock_pandas_timedelta() -> Made:
    """pandas.to_csv of a TimedeltaIndex: 0 days 00:00:00.020461."""
    truth = replace(_crossing(), qd=None)
    table = frame(truth).drop(columns="t")
    table.index = pd.TimedeltaIndex(
        [timedelta(microseconds=round(t * 1e6)) for t in truth.t.tolist()], name="time"
    )
    return made("clock_pandas_timedelta.csv", to_csv(table), truth)


@specimen
def clock_iso_utc() -> Made:
    """ISO 8601 with milliseconds and Z: 2021-04-11T22:27:21.573Z."""
    start = datetime(2021, 4, 11, 22, 27, 21, 573000)
    return clocked(
        "clock_iso_utc",
        "timestamp",
        lambda t: at(t, start).isoformat(timespec="milliseconds") + "Z",
        motion(ROWS),
        start=_seconds(start),
    )


@specimen
def clock_iso_offset() -> Made:
    """datetime.isoformat() with a zone: 2021-04-11T22:27:21.573641+02:00."""
    start = START.replace(tzinfo=timezone(timedelta(hours=2)))
    return clocked(
        "clock_iso_offset",
        "timestamp",
        lambda t: at(t, start).isoformat(),
        _crossing(),
        start=start.timestamp(),
    )


@specimen
def clock_python_logging() -> Made:
    """Python logging's asctime: "2021-04-11 22:27:21,573", the fraction behind a comma."""
    start = datetime(2021, 4, 11, 22, 27, 21, 573000)

    def asctime(t: float) -> str:
        """Return the time as logging.Formatter writes it."""
        moment = at(t, start)
        return f"{moment:%Y-%m-%d %H:%M:%S},{moment.microsecond // 1000:03d}"

    return clocked("clock_python_logging", "asctime", asctime, motion(ROWS), start=_seconds(start))


@specimen
def clock_german_date() -> Made:
    """A German date: 11.04.2021 22:27:21,573 between semicolons, decimal commas."""
    truth, start = replace(motion(ROWS), qd=None), datetime(2021, 4, 11, 22, 27, 21, 573000)
    rows = [
        [f"{at(t, start):%d.%m.%Y %H:%M:%S},{at(t, start).microsecond // 1000:03d}", *(_comma(v) for v in q)]
        for t, q in zip(truth.t.tolist(), truth.q.tolist(), strict=True)
    ]
    text = writer([["Zeitstempel", *Q6], *rows], delimiter=";")
    return made("clock_german_date.csv", text, replace(truth, start=_seconds(start)))


def _comma(value: float) -> str:
    """Return all digits of a number, with a decimal comma."""
    return str(value).replace(".", ",")


@specimen
def clock_american_date() -> Made:
    """An American date with PM: 04/25/2021 10:27:21.573 PM."""
    start = datetime(2021, 4, 25, 22, 27, 21, 573000)

    def american(t: float) -> str:
        """Return month/day/year and a clock of twelve hours."""
        moment = at(t, start)
        return f"{moment:%m/%d/%Y %I:%M:%S}.{moment.microsecond // 1000:03d} PM"

    return clocked("clock_american_date", "DateTime", american, motion(ROWS), start=_seconds(start))


@specimen
def clock_date_and_time() -> Made:
    """Date and Time in two columns, to be joined: 2021-04-11,23:59:59.800000; midnight passes."""
    truth, start = replace(motion(ROWS), qd=None), datetime(2021, 4, 11, 23, 59, 59, 800000)
    rows = [
        [f"{at(t, start):%Y-%m-%d}", f"{at(t, start):%H:%M:%S.%f}", *q]
        for t, q in zip(truth.t.tolist(), truth.q.tolist(), strict=True)
    ]
    text = writer([["Date", "Time", *Q6], *rows])
    return made("clock_date_and_time.csv", text, replace(truth, start=_seconds(start)))


@specimen
def clock_time_of_day() -> Made:
    """Time of day: 22:27:21.573641; a full second passes."""
    return clocked(
        "clock_time_of_day",
        "time",
        lambda t: f"{at(t):%H:%M:%S.%f}",
        _crossing(),
        start=22 * 3600 + 27 * 60 + 21.573641,
    )


@specimen
def clock_time_of_day_midnight() -> Made:
    """Time of day past midnight: 23:59:59.8 is followed by 00:00:00."""
    start = datetime(2021, 4, 11, 23, 59, 59, 800000)
    return clocked(
        "clock_time_of_day_midnight",
        "time",
        lambda t: f"{at(t, start):%H:%M:%S.%f}",
        motion(ROWS),
        start=86399.8,
    )


@specimen
def clock_seconds_of_day() -> Made:
    """Seconds of the day past midnight: 86399.98 is followed by 0.00."""
    return clocked(
        "clock_seconds_of_day",
        "time [s]",
        lambda t: f"{(86399.8 + t) % 86400:.2f}",
        motion(ROWS),
        start=86399.8,
    )


@specimen
def clock_micros_not_padded() -> Made:
    """hh:mm:ss:micro with the microseconds as a whole number: 22:27:22:5247 is 5247 us, not 0.5247 s."""

    def unpadded(t: float) -> str:
        """Return the parts of the time as whole numbers."""
        moment = at(t)
        return f"{moment:%H:%M:%S}:{moment.microsecond}"

    return clocked(
        "clock_micros_not_padded", "time", unpadded, _crossing(), start=22 * 3600 + 27 * 60 + 21.573641
    )


@specimen
def clock_micros_point_not_padded() -> Made:
    """The same behind a point: f"{second}.{microsecond}"; read as fractions the clock runs backwards."""

    def unpadded(t: float) -> str:
        """Return date and time with the microseconds as a whole number."""
        moment = at(t)
        return f"{moment:%Y-%m-%d %H:%M:%S}.{moment.microsecond}"

    return clocked("clock_micros_point_not_padded", "time", unpadded, _crossing(), start=_seconds(START))


@specimen
def clock_minutes() -> Made:
    """Stopwatch: mm:ss.mmm, a minute passes (00:59.800 to 01:00.380)."""
    return clocked(
        "clock_minutes",
        "Time",
        lambda t: f"{int((59.8 + t) // 60):02d}:{(59.8 + t) % 60:06.3f}",
        motion(ROWS),
        start=59.8,
    )


@specimen
def clock_uneven() -> Made:
    """time.perf_counter() of a loop that is not even: steps of 16 to 24 ms."""
    t = np.round(motion(ROWS).t + 0.002 * np.sin(5.0 * np.arange(ROWS)), 6)
    return clocked("clock_uneven", "elapsed_time", lambda elapsed: elapsed, replace(motion(ROWS), t=t))
