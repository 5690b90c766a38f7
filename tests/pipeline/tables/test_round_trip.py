"""CSV to recording to CSV: what was read leaves as it was, however the file was written."""

from __future__ import annotations

import csv
import math
import tempfile
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import loadmat

import urmpipe
from urmpipe_pipeline.tables import FORMATS, Format
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
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
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


def test_numbers_as_people_write_them_come_back_to_the_letter(tmp_path: Path) -> None:
    text = "t [ms],q2 [deg],q1 [deg],x [mm],y [mm],z [mm]\n" + "".join(
        f"{4 * k}.25,{147.3 + k},{-0.1 * k - 0.5:.3g},{250.5 - k},{1e-3 * (k + 1):.6g},{k + 0.125}\n"
        for k in range(5)
    )
    (tmp_path / "log.csv").write_text(text)
    run = urmpipe.ingest(tmp_path / "log.csv")
    urmpipe.export(run, tmp_path / "again.csv", rows="file")
    there = pd.read_csv(tmp_path / "log.csv", dtype=str)
    back = pd.read_csv(tmp_path / "again.csv", dtype=str)
    assert list(back.columns) == list(there.columns)
    assert back["t [ms]"].tolist() == there["t [ms]"].tolist()
    for name in back.columns[1:]:
        assert back[name].astype(float).tolist() == there[name].astype(float).tolist()
    assert back["q2 [deg]"].tolist() == ["147.3", "148.3", "149.3", "150.3", "151.3"]


def test_a_log_without_a_header_gets_names_and_one_without_a_clock_gets_none(tmp_path: Path) -> None:
    (tmp_path / "bare.csv").write_text("0.0,0.1,2.5\n0.01,0.3,2.4\n0.02,0.4,2.9\n")
    urmpipe.export(urmpipe.ingest(tmp_path / "bare.csv"), tmp_path / "a.csv", rows="file")
    assert (
        tmp_path / "a.csv"
    ).read_text() == "t [s],q1 [rad],q2 [rad]\n0.00,0.1,2.5\n0.01,0.3,2.4\n0.02,0.4,2.9\n"
    (tmp_path / "timeless.csv").write_text("q1,q2\n1,2\n1.5,2.5\n")
    urmpipe.export(urmpipe.ingest(tmp_path / "timeless.csv"), tmp_path / "b.csv", rows="file")
    assert (tmp_path / "b.csv").read_text() == "q1,q2\n1,2\n1.5,2.5\n"


def test_files_that_share_a_header_leave_as_one_table_with_names_of_their_own(tmp_path: Path) -> None:
    for k in (1, 2):
        text = "Time (sec),Angular Displacement (deg)\n" + "".join(
            f"{0.1 * t:.1f},{10 * k + t}\n" for t in range(4)
        )
        (tmp_path / f"phi{k}.csv").write_text(text)
    run = urmpipe.ingest([tmp_path / "phi1.csv", tmp_path / "phi2.csv"])
    result = urmpipe.export(run, tmp_path / "both.csv", rows="file")
    assert (tmp_path / "both.csv").read_text().splitlines()[:2] == [
        "Time (sec),phi1 [deg],phi2 [deg]",
        "0.0,10,20",
    ]
    assert result.columns == (("Time (sec)", "s"), ("phi1 [deg]", "deg"), ("phi2 [deg]", "deg"))


def test_seconds_and_nanoseconds_leave_as_two_columns(tmp_path: Path) -> None:
    text = "header.stamp.sec,header.stamp.nanosec,q1 [rad]\n1700000000,999999999,0.5\n1700000001,9,0.75\n"
    (tmp_path / "log.csv").write_text(text)
    urmpipe.export(urmpipe.ingest(tmp_path / "log.csv"), tmp_path / "again.csv", rows="file")
    assert (tmp_path / "again.csv").read_text() == text


def test_columns_that_were_not_used_are_named(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,q1,battery,qd1\n0,1,12.5,\n1,2,12.6,\n2,3,12.7,\n")
    result = urmpipe.export(urmpipe.ingest(tmp_path / "log.csv"), tmp_path / "again.csv", rows="file")
    assert [warning.message for warning in result.warnings] == [
        "qd1: not ingested, since a column of them was empty",
        "battery: not ingested (no role is known for them), so they cannot be exported",
    ]
    assert [name for name, _ in result.columns] == ["t", "q1"]


def test_units_that_the_names_do_not_tell_are_told(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,q1,q2 (arm),q3 [deg]\n0,1,2,3\n1,2,3,4\n")
    run = urmpipe.ingest(tmp_path / "log.csv", unit="deg")
    result = urmpipe.export(run, tmp_path / "again.csv", rows="file")
    assert [warning.message for warning in result.warnings] == [
        "q1, q2: in deg, which their names do not give"
    ]
    assert result.columns[1] == ("q1", "deg")
    assert not urmpipe.export(run, tmp_path / "again.parquet", rows="file").warnings


def test_a_clock_that_the_file_did_not_have_does_not_leave_with_it(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("q1,q2\n1,2\n1.5,2.5\n")
    run = urmpipe.ingest(tmp_path / "log.csv")
    urmpipe.export(run, tmp_path / "a.parquet", rows="file")
    assert pq.read_table(tmp_path / "a.parquet").column_names == ["q1", "q2"]
    urmpipe.export(run, tmp_path / "a.mat", rows="file")
    assert loadmat(tmp_path / "a.mat", simplify_cells=True)["run"]["clock_ns"].size == 0


def test_a_missing_sample_of_the_only_column_stays_a_row(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("q1,note\n1,a\n,b\n3,c\n")
    urmpipe.export(urmpipe.ingest(tmp_path / "log.csv"), tmp_path / "again.csv", rows="file")
    assert pd.read_csv(tmp_path / "again.csv")["q1"].isna().tolist() == [False, True, False]


@pytest.mark.parametrize("to", FORMATS[:3])
def test_a_path_leaves_though_a_robot_was_named(tmp_path: Path, to: Format) -> None:
    (tmp_path / "path.csv").write_text("t,x,y,z\n0,1,2,3\n1,1,2,4\n2,1,2,5\n")
    run = urmpipe.ingest(tmp_path / "path.csv", robot="urm6")
    for rows in ("grid", "file"):
        result = urmpipe.export(run, tmp_path / f"{rows}.{to}", rows=rows)
        assert result.files[0].rows == 3
        assert len(result.columns) == 4


def test_the_grid_is_a_log_again(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(
        "t,q1 [deg],q2 [deg]\n" + "".join(f"{k},{3 * k},{-k}\n" for k in range(9))
    )
    run = urmpipe.ingest(tmp_path / "log.csv")
    urmpipe.export(run, tmp_path / "grid.csv")
    again = urmpipe.ingest(tmp_path / "grid.csv")
    assert again.log.joints == run.log.joints
    for name in ("q", "qd", "qdd", "t_ns"):
        assert (getattr(again, name) == getattr(run, name)).all()


LOG_OF_TIMES = "time,q1 [rad]\n{},0.5\n{},0.75\n{},0.875\n"


@pytest.mark.parametrize(
    "times",
    [
        ("23:59:59.500", "00:00:00.000", "00:00:00.500"),
        ("25:10:00.000", "25:10:00.005", "25:10:00.010"),
        ("-00:00:01", "00:00:00", "00:00:01"),
    ],
)
def test_times_of_day_leave_as_the_file_counts_them(tmp_path: Path, times: tuple[str, ...]) -> None:
    (tmp_path / "log.csv").write_text(LOG_OF_TIMES.format(*times))
    result = urmpipe.export(urmpipe.ingest(tmp_path / "log.csv"), tmp_path / "again.csv", rows="file")
    assert (tmp_path / "again.csv").read_text() == (tmp_path / "log.csv").read_text()
    assert not result.warnings


def test_dates_with_a_time_zone_are_said_to_leave_in_utc(tmp_path: Path) -> None:
    zoned = [f"2021-04-11T23:59:5{k}+02:00" for k in range(3)]
    (tmp_path / "log.csv").write_text(LOG_OF_TIMES.format(*zoned))
    result = urmpipe.export(urmpipe.ingest(tmp_path / "log.csv"), tmp_path / "again.csv", rows="file")
    assert [warning.message for warning in result.warnings] == [
        "date and time, year first with a time zone: the dates are exported in UTC"
    ]
    assert pd.read_csv(tmp_path / "again.csv")["time"][0] == "2021-04-11T21:59:50"
    (tmp_path / "plain.csv").write_text(LOG_OF_TIMES.format(*(one[:19] for one in zoned)))
    assert not urmpipe.export(
        urmpipe.ingest(tmp_path / "plain.csv"), tmp_path / "b.csv", rows="file"
    ).warnings


def test_times_that_were_rebuilt_and_rows_that_were_left_out_are_said(tmp_path: Path) -> None:
    lines = [f"{k // 10},{k * 0.001}" for k in range(200)]
    (tmp_path / "log.csv").write_text("\n".join(["t [s],q1 [rad]", *lines]) + "\n")
    rebuilt = urmpipe.export(urmpipe.ingest(tmp_path / "log.csv"), tmp_path / "a.csv", rows="file")
    assert [warning.message for warning in rebuilt.warnings] == [
        "the file's own times, which were not kept: times in steps of 1 s cover 10 rows each: a regular"
        " clock of 0.1 s is used instead"
    ]
    bad = [f"{k * 0.1:.1f},{'oops' if k == 50 else k * 0.001}" for k in range(200)]
    (tmp_path / "bad.csv").write_text("\n".join(["t [s],q1 [rad]", *bad]) + "\n")
    run = urmpipe.ingest(tmp_path / "bad.csv", skip_bad=True)
    left = urmpipe.export(run, tmp_path / "b.csv", rows="file").warnings
    assert [(warning.kind, warning.row) for warning in left] == [("not-exported", 51)]
    assert left[0].message.startswith("data row 51 of the file is left out: ")
