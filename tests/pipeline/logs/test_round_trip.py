"""Random tables, written in random ways, come back as they were; the fast way and the careful one agree."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.formats.numbers import ClockColumn
from urmpipe_pipeline.logs.formats.sniff import sniff
from urmpipe_pipeline.logs.formats.text import open_text
from urmpipe_pipeline.logs.formats.text_table import (
    BlockParser,
    RowReader,
    row_blocks,
    squeeze,
)

Floats = NDArray[np.float64]

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "latin-1")
STYLES = ((",", "."), (";", ","), (";", "."), ("\t", "."), ("\t", ","), (" ", "."), ("   ", ","), ("|", "."))


@dataclass(frozen=True)
class Written:
    """A table and how it is written."""

    times: list[int]
    joints: Floats
    style: tuple[str, str]
    encoding: str
    newline: str
    missing: str
    trailing: bool
    order: tuple[int, ...]
    unit: str

    def text(self) -> str:
        delimiter, decimal = self.style
        spaces = not delimiter.strip(" ")
        titles = ["t [ns]", *(f"q{k + 1} [{self.unit}]" for k in range(self.joints.shape[1]))]
        rows = [[title.replace(" ", "") if spaces else title for title in titles]]
        missing = "NaN" if spaces else self.missing  # nothing between spaces is no cell
        for time, values in zip(self.times, self.joints.tolist(), strict=True):
            cells = ["nan" if math.isnan(value) else repr(value).replace(".", decimal) for value in values]
            rows.append([str(time), *(cell.replace("nan", missing) for cell in cells)])
        end = delimiter if self.trailing and not spaces else ""
        return "".join(delimiter.join(row[k] for k in self.order) + end + self.newline for row in rows)


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
    full = st.lists(sure, min_size=joints, max_size=joints)
    values[0] = draw(full)  # no joint without any value
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
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_bytes(table.text().encode(table.encoding))
        log = read_log([path])
    factor = 1.0 if table.unit == "rad" else np.pi / 180
    assert log.joints == tuple(f"q{k + 1}" for k in range(table.joints.shape[1]))
    np.testing.assert_array_equal(log.q, table.joints * factor)
    assert log.t_ns.tolist() == [t - table.times[0] for t in table.times]
    assert log.clock_start == table.times[0] / 10**9


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(st.lists(st.decimals(0, 10**6, allow_nan=False, places=12), min_size=3, max_size=20, unique=True))
def test_decimal_times_are_rounded_once(times: list[object]) -> None:
    """Any text with up to 12 decimals: the nearest nanosecond, as Python's exact decimals say."""
    from decimal import ROUND_HALF_EVEN, Decimal

    exact = sorted(Decimal(str(time)) for time in times)
    nanoseconds = [int((time * 10**9).to_integral_value(ROUND_HALF_EVEN)) for time in exact]
    if len(set(nanoseconds)) < len(nanoseconds):
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text("t [s],q1\n" + "".join(f"{time:f},1\n" for time in exact))
        log = read_log([path])
    assert log.t_ns.tolist() == [time - nanoseconds[0] for time in nanoseconds]


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(tables())
def test_rows_are_read_alone_as_they_are_parsed_together(table: Written) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_bytes(table.text().encode(table.encoding))
        layout = sniff(open_text(path))
        clock = (ClockColumn(table.order.index(0), 0),)
        columns = [table.order.index(k + 1) for k in range(table.joints.shape[1])]
        block, reader = b"".join(row_blocks(layout)), RowReader(layout, columns, clock)
    parsed = BlockParser(layout, columns, clock).parse(block)
    by_row = reader.read(block.decode(layout.byte_encoding).split("\n"))
    assert parsed is not None
    assert not reader.summary().findings
    np.testing.assert_array_equal(parsed.values, by_row.values)
    np.testing.assert_array_equal(parsed.clock, by_row.clock)


NUMBERS = st.lists(st.sampled_from(["1", "-2.5", "3e4"]), min_size=1, max_size=4)
BLANKS = st.lists(st.sampled_from([" ", "  ", "\t", " \t "]), min_size=1, max_size=3)


@given(st.lists(NUMBERS, min_size=1, max_size=5), BLANKS, st.sampled_from(["\n", "\r\n", "\r"]))
def test_squeezing_keeps_the_cells(rows: list[list[str]], blanks: list[str], newline: str) -> None:
    blank = blanks[0].join(blanks[1:]) or blanks[0]
    text = "".join(blank + blank.join(row) + blank + newline for row in rows)
    assert squeeze(text.encode()) == "".join(" ".join(row) + newline for row in rows).encode()


def test_times_of_an_option_are_exact_too(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("when,q1\n0.1,1\n0.30000000000000004,2\n")
    assert read_log([path], LogMap(time="when")).t_ns.tolist() == [0, 200_000_000]
