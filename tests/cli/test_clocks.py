"""How clocks are put together without sync: by absolute stamps; and what a wrong offset looks like."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import urmpipe as api
from asserting import refusal
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.results import present

S, MS = 10**9, 10**6
BEGIN = 1_700_000_000 * S + 123_456_789
"""A Unix time in [ns]."""


def number(unit: str, exponent: int) -> Callable[[int], tuple[str, str]]:
    return lambda ns: (f"t [{unit}]", f"{ns // 10**exponent}.{ns % 10**exponent:0{exponent or 1}d}")


def date(zone: str = "", ahead: int = 0) -> Callable[[int], tuple[str, str]]:
    def written(ns: int) -> tuple[str, str]:
        whole = np.datetime64(ns // S + ahead * 3600, "s")
        return "time", f"{whole}.{ns % S:09d}{zone}"

    return written


CLOCKS = {
    "s": number("s", 9),
    "ms": number("ms", 6),
    "us": number("us", 3),
    "ns": lambda ns: ("t [ns]", str(ns)),
    "utc": date("Z"),
    "zone": date("+02:00", 2),
    "local": date(),
}


def joints(t: FloatArray) -> FloatArray:
    """A motion that does not repeat itself, in [rad]."""
    return np.column_stack([0.4 * np.sin((0.9 + 0.13 * k) * t + k) + 0.05 * k * t for k in range(6)])


def write(path: Path, t_ns: IntArray, clock: str, off: float = 0.0, first: int = BEGIN) -> Path:
    """Write the motion at times since `first`, with joint 2 displaced by some [rad]."""
    q = joints(t_ns / 1e9) + off * (np.arange(6) == 1)
    cells = [CLOCKS[clock](first + int(ns)) for ns in t_ns]
    rows = [
        ",".join([cell, *(f"{value:.12f}" for value in row)]) for (_, cell), row in zip(cells, q, strict=True)
    ]
    header = ",".join([cells[0][0], *(f"q{k} [rad]" for k in range(1, 7))])
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def times(start_ns: int, period_ns: int, rows: int = 400) -> IntArray:
    return start_ns + period_ns * np.arange(rows, dtype=np.int64)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("one", "other"),
    [*((clock, clock) for clock in CLOCKS), ("ns", "zone"), ("utc", "ms"), ("s", "us")],
)
def test_stamps_put_two_logs_together_exactly(tmp_path: Path, one: str, other: str) -> None:
    wanted = write(tmp_path / "wanted.csv", times(0, 10 * MS), one)
    done = write(tmp_path / "done.csv", times(-1_234_567_000, 8 * MS, 700), other)
    result = api.compare(wanted, done, "ur5e")
    sync = result.runs[0].sync
    assert (result.verdict, sync.mode, sync.offset) == ("pass", "stamps", -1.234567)
    assert present(result).headline.endswith("; clocks by their stamps (offset -1.234567 s)")
    late = api.compare(wanted, done, "ur5e", sync="start")
    assert late.verdict == "fail" and "stamps" not in present(late).headline


REFUSED = {
    "apart": ("utc", "utc", 3600 * S, "no time in both: done begins 3600 s after wanted"),
    "in a row": ("ns", "ns", 399 * 10 * MS, "no time in both: done begins 3.99 s after wanted"),
    "zones": ("local", "utc", 0, "times without a time zone in wanted and times in UTC in done"),
    "no stamps": ("ns", "ns", -BEGIN, "neither Unix times nor dates in done"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
def test_without_stamps_in_both_logs_start_together(tmp_path: Path, name: str) -> None:
    one, other, later, why = REFUSED[name]
    wanted = write(tmp_path / "wanted.csv", times(0, 10 * MS), one)
    done = write(tmp_path / "done.csv", times(0, 10 * MS), other, off=1e-5, first=BEGIN + later)
    assert api.compare(wanted, done, "ur5e").runs[0].sync.mode == "start"
    said = refusal(LogError, api.compare, wanted, done, "ur5e", sync="stamps")
    assert (
        f"sync (--sync): stamps: found {why}, allowed: Unix times or dates on both sides that overlap" in said
    )


@pytest.mark.slow
def test_each_log_decides_for_itself_and_coarse_stamps_do_not(
    tmp_path: Path, urmpipe: Callable[..., Any]
) -> None:
    wanted = write(tmp_path / "wanted.csv", times(0, 10 * MS), "ns")
    early = write(tmp_path / "early.csv", times(-S, 10 * MS, 500), "ns", off=1e-5)
    another_day = write(tmp_path / "day.csv", times(0, 10 * MS), "ns", off=1e-5, first=BEGIN + 86400 * S)
    coarse = write(tmp_path / "coarse.csv", times(0, 10 * MS), "ns", off=1e-5)
    head, *rows = coarse.read_text().splitlines()
    coarse.write_text("\n".join([head, *(f"{row[:11]}00000000{row[19:]}" for row in rows)]))
    ran = urmpipe("compare", wanted, early, another_day, coarse, "--robot", "ur5e", "-o", "v.rrd")
    assert ran.code == 0
    assert ran.out.splitlines()[0].endswith("; clocks of 1 log by their stamps")
    made = api.read_recording(tmp_path / "v.rrd")
    assert isinstance(made, Comparison)
    assert [run.sync.mode for run in made.runs] == ["stamps", "start", "start"]
    assert refusal(OptionError, api.iso, wanted, early, "ur5e", sync="stamps").startswith(
        "sync (--sync): found stamps, allowed: auto, start or an offset: each cycle has the same reference"
    )


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(
    st.integers(-S, 0), st.integers(4 * MS, 20 * MS), st.integers(4 * MS, 20 * MS),
    st.sampled_from(list(CLOCKS)), st.sampled_from([1e-6, 0.02]),
)  # fmt: skip
def test_the_verdict_is_that_of_the_motion_whenever_the_logs_begin(
    tmp_path_factory: pytest.TempPathFactory, start: int, period: int, other: int, clock: str, off: float
) -> None:
    folder = tmp_path_factory.mktemp("clocks")
    wanted = write(folder / "wanted.csv", times(0, period, 4 * S // period), clock)
    done = write(folder / "done.csv", times(start, other, 5 * S // other + 1), clock, off)
    result = api.compare(wanted, done, "ur5e")
    assert result.runs[0].sync.offset == start / 1e9
    # 0.02 rad of joint 2 move a tool by 9 mm or more here; lines between samples of 20 ms miss by 0.1 mm.
    assert result.verdict == ("fail" if off > 1e-3 else "pass")
    assert not [one for one in result.warnings if one.kind == "clocks-differ"]


def recorded(copy: Path) -> Path:
    api.ingest(copy, "ur5e", output=copy.with_suffix(".rrd"))
    return copy.with_suffix(".rrd")


def linked(copy: Path) -> Path:
    copy.with_name("link.csv").symlink_to(copy)
    return copy.with_name("link.csv")


def renamed(copy: Path) -> Path:
    copy.write_text(copy.read_text().replace("q", "axis"))
    return copy


def later(copy: Path) -> Path:
    return write(copy, times(0, 10 * MS), "utc", first=BEGIN + 3600 * S)


@pytest.mark.slow
@pytest.mark.parametrize("form", [Path, recorded, linked, renamed, later])
def test_the_same_data_in_any_form_is_a_warning(
    tmp_path: Path, urmpipe: Callable[..., Any], form: Callable[[Path], Path]
) -> None:
    log = write(tmp_path / "log.csv", times(0, 10 * MS), "ns")
    copy = form(write(tmp_path / "copy.csv", times(0, 10 * MS), "ns"))
    ran = urmpipe("compare", log, copy, "--robot", "ur5e", "-o", "v.rrd", "--strict")
    assert ran.code == 2
    assert f"error: {copy.stem}: the same data as log: every time and every value is equal\n" in ran.err
    almost = write(tmp_path / "almost.csv", times(0, 10 * MS), "ns", off=1e-11)
    assert api.compare(log, almost, "ur5e", strict=True).verdict == "pass"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("clock", "late", "off", "warned"),
    [
        ("ns", 300 * MS, 0.0, True),  # the clock of a controller is wrong by 0.3 s
        ("ns", 300 * MS, 2e-3, True),  # and its tool is off by 1 mm or so
        ("ns", 0, 0.02, False),  # another cause than the clocks
        ("ns", 300 * MS, 0.1, False),
    ],
)
def test_a_late_log_that_follows_the_path_has_another_clock(
    tmp_path: Path, urmpipe: Callable[..., Any], clock: str, late: int, off: float, warned: bool
) -> None:
    wanted = write(tmp_path / "wanted.csv", times(0, 10 * MS), clock)
    done = write(tmp_path / "done.csv", times(-500 * MS, 10 * MS, 520), clock, off, BEGIN + late)
    given = ("compare", wanted, done, "--robot", "ur5e", "-o", "v.rrd", "--strict")
    ran = urmpipe(*given)
    hint = "--sync auto estimates the offset from the motion; --sync -0.5 sets it"
    assert ran.code == 1
    assert ("warning: done: the clocks differ: " in ran.err) == warned
    assert ("an offset of -0.5 s" in ran.err and hint in ran.err) == warned
    assert urmpipe(*given, "--sync", "-0.5").code == (0 if warned else 1)
    assert "clocks differ" not in urmpipe(*given, "--sync", "auto").err


T = 0.01 * np.arange(400)
MOTIONS: dict[str, tuple[FloatArray, FloatArray, str]] = {
    "one motion again and again": (
        np.sin(4 * np.pi * T),
        np.sin(4 * np.pi * (T - 0.1)),
        "determines no offset",
    ),
    "displaced along a line": (T**2 * (6 - T), T**2 * (6 - T) + 0.02, ""),
    "another motion": (T**2 * (6 - T), np.sin(3 * T), ""),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_path_far_from_another_has_another_clock_only_if_it_is_on_it(tmp_path: Path, name: str) -> None:
    *motions, said = MOTIONS[name]
    for file, x in zip(("wanted", "done"), motions, strict=True):
        table = np.column_stack([T, x, np.zeros((len(T), 2))])
        np.savetxt(
            tmp_path / f"{file}.csv", table, "%.9f", ",", header="t [s],x [m],y [m],z [m]", comments=""
        )
    result = api.compare(tmp_path / "wanted.csv", tmp_path / "done.csv")
    found = [one.message for one in result.warnings if one.kind == "clocks-differ"]
    assert (result.verdict, len(found)) == ("fail", bool(said))
    assert said in "".join(found)
