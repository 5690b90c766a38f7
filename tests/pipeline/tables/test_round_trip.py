"""CSV to recording to CSV: what was read leaves as it was, however the file was written."""

from __future__ import annotations

import csv
import math
import tempfile
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import urmpipe
from urmpipe_pipeline.tables.csv_files import EXPONENTS

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "latin-1")
STYLES = ((",", "."), (";", ","), (";", "."), ("\t", "."), ("\t", ","), ("|", "."))


@dataclass(frozen=True)
class Specimen:
    """A log and how it is written."""

    times: list[int]
    unit: str
    rows: list[list[float]]
    headers: list[str]
    order: tuple[int, ...]
    style: tuple[str, str]
    encoding: str
    by_pandas: bool

    @property
    def names(self) -> list[str]:
        return [f"Zeit [{self.unit}]", *self.headers]

    def cells(self) -> list[list[str]]:
        """The cells of the file by row: times as exact decimals, NaN as an empty cell."""
        exponent, decimal = EXPONENTS[self.unit], self.style[1]
        found = []
        for time, row in zip(self.times, self.rows, strict=True):
            texts = [f"{Decimal(time).scaleb(-exponent):f}", *("" if math.isnan(x) else repr(x) for x in row)]
            found.append([text.replace(".", decimal) for text in texts])
        return found

    def write(self, path: Path) -> None:
        rows = [[row[k] for k in self.order] for row in self.cells()]
        names = [self.names[k] for k in self.order]
        if self.by_pandas:
            frame = pd.DataFrame(rows, columns=names)
            frame.to_csv(path, sep=self.style[0], index=False, encoding=self.encoding)
            return
        with path.open("w", encoding=self.encoding, newline="") as file:
            csv.writer(file, delimiter=self.style[0]).writerows([names, *rows])


@st.composite
def specimens(draw: st.DrawFn) -> Specimen:
    """Random logs of two or three joints, some with a recorded rate or more columns than are of use."""
    unit = draw(st.sampled_from(sorted(EXPONENTS)))
    headers = draw(
        st.sampled_from(
            [
                ["q1 [rad]", "q2 [deg]"],
                ["q2 [deg]", "q1 [rad]", "q3 (°)"],
                ["Gelenk, 1 [deg]", "Gelenk, 2 [deg]"],
                ["x [mm]", "q1 [deg]", "y [mm]", "z [m]", "qd1 [deg/s]"],
            ]
        )
    )
    count = draw(st.integers(3, 8))
    number = st.floats(-170, 170, allow_subnormal=False) | st.decimals(-170, 170, places=3).map(float)
    number = number.filter(lambda x: x == 0 or abs(x) > 1e-290)
    row = st.lists(number, min_size=len(headers), max_size=len(headers))
    rows = draw(st.lists(row, min_size=count, max_size=count))
    for k, header in enumerate(headers):  # a unit that the data contradict is asked for
        if "rad" in header:
            rows = [[*one[:k], one[k] / 100, *one[k + 1 :]] for one in rows]
        elif "deg" in header or "°" in header:
            rows[0][k] = 100 + rows[0][k] / 10
    missing = draw(st.integers(1, count - 1))
    if draw(st.booleans()):
        rows[missing][0] = math.nan
    steps = draw(st.lists(st.integers(10**3, 10**10), min_size=count - 1, max_size=count - 1))
    times = [draw(st.integers(-(10**9), 2 * 10**18))]
    for step in steps:
        times.append(times[-1] + step)
    return Specimen(
        times,
        unit,
        rows,
        headers,
        tuple(draw(st.permutations(range(len(headers) + 1)))),
        draw(st.sampled_from(STYLES)),
        draw(st.sampled_from(ENCODINGS)),
        draw(st.booleans()),
    )


@pytest.mark.slow
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(specimens())
def test_what_was_read_leaves_as_it_was(specimen: Specimen) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        specimen.write(folder / "log.csv")
        urmpipe.ingest(folder / "log.csv", output=folder / "log.rrd")
        result = urmpipe.export(folder / "log.rrd", folder / "again.csv", rows="file")
        with (folder / "again.csv").open(encoding="utf-8", newline="") as file:
            names, *rows = csv.reader(file)
    assert names == [specimen.names[k] for k in specimen.order if specimen.names[k] in names]
    assert set(names) == set(specimen.names)
    assert not result.warnings
    written = specimen.cells()
    assert len(rows) == len(written)
    for k, header in enumerate(specimen.names):
        back = [row[names.index(header)] for row in rows]
        there = [row[k].replace(specimen.style[1], ".") for row in written]
        if k == 0:
            assert [Decimal(cell) for cell in back] == [Decimal(cell) for cell in there]
            continue
        assert [cell == "" for cell in back] == [cell == "" for cell in there]
        for one, other in zip(back, there, strict=True):
            if one:
                # Two neighbours may convert to one value in SI: then the shorter text is written.
                ulp = 0.0 if "[rad]" in header or "[m]" in header else math.ulp(float(other))
                assert abs(float(one) - float(other)) <= ulp
