"""Columns of any table over its time, as models that are no arm take them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.errors import LogError
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.logs.read import read_series

TABLE = "t [ms],u (V),phi [deg],w,speed (mm/s)\n5,1,180,1,1000\n15,2,90,2,0\n25,-0.5,45,nan,1\n"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "voltage.csv"
    path.write_text(TABLE, encoding="utf-8")
    return path


def test_times_start_at_the_first_row_and_known_units_are_si(table: Path) -> None:
    series = read_series(table, ["u", "phi", "speed (mm/s)"])
    assert series.names == ("u", "phi", "speed")
    assert series.units == ("V", "rad", "m/s")
    np.testing.assert_array_equal(series.t_ns, [0, 10_000_000, 20_000_000])
    np.testing.assert_array_equal(series.values[:, 0], [1.0, 2.0, -0.5])
    # one product of two doubles: a unit in the last place
    np.testing.assert_allclose(series.values[:, 1], np.radians([180.0, 90.0, 45.0]), rtol=2.3e-16)
    np.testing.assert_array_equal(series.values[:, 2], [1.0, 0.0, 0.001])


def test_a_column_is_found_by_its_number(table: Path) -> None:
    assert read_series(table, ["2"]).names == ("u",)


def test_a_column_without_a_unit_tells_none_and_the_user_may(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("t,u\n0,1\n0.1,2\n", encoding="utf-8")
    assert read_series(path, ["u"]).units == (None,)
    told = read_series(path, ["u"], LogMap(unit={"u": "deg"}))
    assert told.units == ("rad",)
    assert told.values[1, 0] == 2.0 * 0.017453292519943295


def test_a_table_without_a_clock_takes_its_period(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("u,v\n0,1\n0.1,2\n", encoding="utf-8")
    series = read_series(path, ["u"], LogMap(period=0.02))
    np.testing.assert_array_equal(series.t_ns, [0, 20_000_000])
    assert [one.kind for one in read_series(path, ["u"]).warnings] == ["assumed-period"]


def test_all_columns_that_are_not_there_are_told_at_once(table: Path) -> None:
    with pytest.raises(LogError) as error:
        read_series(table, ["x", "y"])
    allowed = "allowed: t [ms], u (V), phi [deg], w, speed (mm/s)"
    assert [str(one) for one in error.value.findings] == [
        f"{table}: found no column 'x', {allowed}",
        f"{table}: found no column 'y', {allowed}",
    ]


def test_a_row_without_a_number_is_an_error_with_its_place(table: Path) -> None:
    with pytest.raises(LogError) as error:
        read_series(table, ["w"])
    assert (
        str(error.value)
        == f"{table}, row 3, column w: found 1 row without a number, allowed: one in every row"
    )
    assert error.value.findings[0].row == 3
