"""Laws of reading: tables, times, dates, coarse clocks, motions and poses come back as they were written."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from decimal import ROUND_HALF_EVEN, Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "latin-1")
STYLES = ((",", "."), (";", ","), (";", "."), ("\t", "."), ("\t", ","), (" ", "."), ("   ", ","), ("|", "."))


def read(text: bytes, **options: Any) -> JointLog:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_bytes(text)
        return read_log([path], LogMap(**options))


@dataclass(frozen=True)
class Written:
    """A table and how it is written."""

    times: list[int]
    joints: FloatArray
    style: tuple[str, str]
    encoding: str
    newline: str
    missing: str
    trailing: bool
    order: tuple[int, ...]
    unit: str

    def text(self) -> bytes:
        delimiter, decimal = self.style
        spaces = not delimiter.strip(" ")
        titles = ["t [ns]", *(f"q{k + 1} [{self.unit}]" for k in range(self.joints.shape[1]))]
        rows = [[title.replace(" ", "") if spaces else title for title in titles]]
        missing = "NaN" if spaces else self.missing  # nothing between spaces is no cell
        for time, values in zip(self.times, self.joints.tolist(), strict=True):
            cells = ["nan" if math.isnan(value) else repr(value).replace(".", decimal) for value in values]
            rows.append([str(time), *(cell.replace("nan", missing) for cell in cells)])
        end = (delimiter if self.trailing and not spaces else "") + self.newline
        return "".join(delimiter.join(row[k] for k in self.order) + end for row in rows).encode(self.encoding)


@st.composite
def tables(draw: st.DrawFn) -> Written:
    """Random tables: numbers that their unit allows, some missing, times that increase."""
    rows, joints = draw(st.integers(3, 12)), draw(st.integers(1, 7))
    unit = draw(st.sampled_from(["rad", "deg", "°"]))
    largest = 3.0 if unit == "rad" else 1e3  # a step of 360 would contradict rad
    numbers = st.floats(-largest, largest, allow_nan=False) | st.just(float("nan"))
    row = st.lists(numbers, min_size=joints, max_size=joints)
    values = np.array(draw(st.lists(row, min_size=rows, max_size=rows)))
    sure = st.floats(0.5, 3) if unit == "rad" else st.floats(7, 30)  # within a turn deg might be rad
    values[0] = draw(st.lists(sure, min_size=joints, max_size=joints))  # no joint without any value
    steps = draw(st.lists(st.integers(1, 10**10), min_size=rows - 1, max_size=rows - 1))
    start = draw(st.integers(-(10**9), 2 * 10**18))
    return Written(
        times=np.cumsum([start, *steps]).tolist(),
        joints=values,
        style=draw(st.sampled_from(STYLES)),
        encoding=draw(st.sampled_from(ENCODINGS)),
        newline=draw(st.sampled_from(["\n", "\r\n"])),
        missing=draw(st.sampled_from(["", "NaN", "Null", "nan", "NA"])),
        trailing=draw(st.booleans()),
        order=tuple(draw(st.permutations(range(joints + 1)))),
        unit=unit,
    )


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(tables())
def test_tables_come_back_as_they_were(table: Written) -> None:
    log = read(table.text())
    factor = 1.0 if table.unit == "rad" else np.pi / 180
    assert log.joints == tuple(f"q{k + 1}" for k in range(table.joints.shape[1]))
    np.testing.assert_array_equal(log.q, table.joints * factor)
    assert log.t_ns.tolist() == [t - table.times[0] for t in table.times]
    assert log.clock_start == table.times[0] / 10**9


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(st.decimals(0, 10**6, allow_nan=False, places=12), min_size=3, max_size=20, unique=True))
def test_decimal_times_are_rounded_once(times: list[object]) -> None:
    """Any text with up to 12 decimals: the nearest nanosecond, as Python's exact decimals say."""
    exact = sorted(Decimal(str(time)) for time in times)
    nanoseconds = [int((time * 10**9).to_integral_value(ROUND_HALF_EVEN)) for time in exact]
    if len(set(nanoseconds)) == len(nanoseconds):
        log = read(("t [s],q1\n" + "".join(f"{time:f},1\n" for time in exact)).encode())
        assert log.t_ns.tolist() == [time - nanoseconds[0] for time in nanoseconds]


WRITERS: dict[str, tuple[str, Callable[[datetime], str]]] = {
    "iso": ("", lambda t: t.isoformat(" ")),
    "iso zone": ("", lambda t: t.replace(tzinfo=UTC).isoformat()),
    "us": ("mdy", lambda t: t.strftime("%m/%d/%Y %I:%M:%S.%f %p")),
    "german": ("dmy", lambda t: t.strftime("%d.%m.%Y %H:%M:%S.%f")),
    "dense": ("", lambda t: t.strftime("%Y%m%d_%H%M%S.%f")),
    "matlab": ("", lambda t: t.strftime("%d-%b-%Y %H:%M:%S.%f")),
    "counted": ("us", lambda t: t.strftime("%Y-%m-%d %H:%M:%S:") + str(t.microsecond)),
}


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.datetimes(datetime(1900, 1, 1), datetime(2000, 1, 1)),
    st.lists(st.integers(1, 10**12), min_size=2, max_size=30),
    st.sampled_from(sorted(WRITERS)),
)
def test_dates_are_exact(start: datetime, steps: list[int], writer: str) -> None:
    """Steps of 1 us to 11 days, written by Python's own clock."""
    exact = [start + timedelta(microseconds=int(us)) for us in np.cumsum([0, *steps])]
    order, write = WRITERS[writer]
    text = "stamp,q1 [rad]\n" + "".join(f"{write(time)},1.5\n" for time in exact)
    log = read(text.encode(), unit={"stamp": order} if order else {})
    since = [(time - datetime(1970, 1, 1)) // timedelta(microseconds=1) * 1000 for time in exact]
    assert [log.clock_start_ns + t for t in log.t_ns.tolist()] == since


def coarse(step: int, period: float, rows: int, phase: float) -> Sequence[int]:
    """Return stamps in [ms] of a regular clock, cut to whole steps."""
    return [int((k + phase) * period // step) * step for k in range(rows)]


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.floats(0.02, 0.7), st.integers(60, 200), st.floats(0, 1), st.sampled_from([10, 1000]))
def test_a_regular_clock_is_found_behind_coarse_stamps(
    share: float, ticks: int, phase: float, step: int
) -> None:
    """Its period is as exact as the changes of the stamps are: seen up to one period late at either end."""
    stamps = coarse(step, share * step, int(ticks / share), phase)
    rows = "".join(f"{time},{0.3 * math.sin(k / 30):.6f}\n" for k, time in enumerate(stamps))
    log = read(f"t [ms],q1 [rad]\n{rows}".encode())
    assert "clock-rebuilt" in [one.kind for one in log.warnings]
    assert log.period == pytest.approx(share * step / 1e3, rel=2.0 / ticks)
    assert np.abs(log.t + log.clock_start - np.array(stamps) / 1e3).max() <= step / 1e3


def csv(q: FloatArray) -> bytes:
    return "\n".join(["q1,q2,q3,q4,q5,q6", *(",".join(map(repr, row)) for row in q.tolist()), ""]).encode()


def motion(rows: int, shortest: float, seed: int) -> FloatArray:
    """Return joints that swing and wrap, with so many samples in their shortest period."""
    rng = np.random.default_rng(seed)
    rates = 2 * np.pi / (shortest * rng.uniform(1.0, 6.0, (3, 6)))
    phases, sizes = rng.uniform(0, 2 * np.pi, (3, 6)), rng.uniform(0.2, 3.0, (3, 6))
    q = (sizes * np.sin(rates * np.arange(rows)[:, None, None] + phases)).sum(axis=1)
    return np.asarray(np.remainder(q + np.pi, 2 * np.pi) - np.pi)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), rows=st.integers(3, 300), shortest=st.floats(10.0, 400.0))
@example(seed=0, rows=300, shortest=10.0)
def test_smooth_motions_are_never_poses(seed: int, rows: int, shortest: float) -> None:
    assert read(csv(motion(rows, shortest, seed)), unit={"": "rad"}).timed


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), rows=st.integers(12, 300), reach=st.floats(0.5, 6.2))
def test_random_configurations_always_are(seed: int, rows: int, reach: float) -> None:
    q = np.random.default_rng(seed).uniform(-reach, reach, (rows, 6))
    assert not read(csv(q), unit={"": "rad"}).timed
