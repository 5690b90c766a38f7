"""Rows at the end that hold no sample are left out and said; an arm that comes to zero keeps its rows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.formats.padding import end_rows

Read = Callable[..., JointLog]

LOGS = Path(__file__).resolve().parents[3].parent / "shared" / "logs"
NAMES = ["t [s]", *(f"q{k} [rad]" for k in range(1, 5))]


def samples(rows: int = 300, seed: int = 1) -> FloatArray:
    """Return times in [s] and four joints in [rad], none of which is near zero at the end."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * 0.02
    ending = t[-1] - t
    q = rng.uniform(0.5, 2.0, 4) * rng.choice([-1, 1], 4) + 0.3 * np.sin(
        np.outer(ending, rng.uniform(0.5, 2, 4))
    )
    return np.column_stack((t, q))


def written(values: FloatArray, sign: str = ",", *, header: bool = True) -> str:
    lines = [sign.join(NAMES[5 - values.shape[1] :])] if header else []
    return "\n".join([*lines, *(sign.join(map(repr, row)) for row in values.tolist()), ""])


def padded(values: FloatArray, count: int, mark: float = 0.0, *, ticks: bool = False) -> FloatArray:
    """Return rows with as many of a mark behind them; with a clock that ticks on, or is the mark as well."""
    rows = np.full((count, values.shape[1]), mark)
    if ticks:
        rows[:, 0] = values[-1, 0] + 0.02 * np.arange(1, count + 1)
    return np.vstack((values, rows))


def about_rows(log: JointLog) -> list[str]:
    return [warning.message for warning in log.warnings if warning.kind in ("end-rows", "start-rows")]


@pytest.mark.slow
@pytest.mark.parametrize(("count", "place"), [(1, "data row 301"), (40, "data rows 301 to 340")])
@pytest.mark.parametrize(("sign", "header"), [(",", True), (";", True), ("\t", True), (",", False)])
@pytest.mark.parametrize("ticks", [True, False])
def test_zeros_at_the_end_are_left_out(
    count: int, place: str, sign: str, header: bool, ticks: bool, read: Read
) -> None:
    values = samples()
    log = read(written(padded(values, count, ticks=ticks), sign, header=header))
    np.testing.assert_array_equal(log.q, values[:, 1:])
    assert log.t_ns[-1] == 299 * 20_000_000
    assert about_rows(log) == [
        f"the end of the file, {place}, holds 0 in every column, and no step of the motion leads there:"
        " left out as padding or end mark"
    ]


@pytest.mark.parametrize("mark", [0.0, -1.0, 9999.0])
def test_a_mark_behind_rows_without_a_clock(mark: float, read: Read) -> None:
    values = samples()[:, 1:]
    log = read(written(padded(values, 1, mark)), unit="rad")
    np.testing.assert_array_equal(log.q, values)
    assert len(about_rows(log)) == 1


def test_a_short_log(read: Read) -> None:
    """The rows of which the columns are told hold the padding as well."""
    values = samples(30)[:, :4]
    log = read(written(padded(values, 9), header=False))
    np.testing.assert_array_equal(log.q, values[:, 1:])


@pytest.mark.parametrize("ticks", [True, False])
def test_an_arm_that_comes_to_zero_keeps_its_rows(ticks: bool, read: Read) -> None:
    values = samples()
    values[:, 1:] *= np.linspace(1.0, 0.0, 300)[:, None]
    at_rest = padded(values, 20, ticks=True)
    log = read(written(at_rest if ticks else at_rest[:, 1:]), unit="rad")
    np.testing.assert_array_equal(log.q, at_rest[:, 1:])
    assert not about_rows(log)


def test_a_column_that_is_not_used_may_say_that_rows_are_samples(read: Read) -> None:
    values = padded(samples(), 5, ticks=True)
    table = np.column_stack((values, np.linspace(20.0, 21.0, 305)[::-1] + 0.1 * (np.arange(305) % 2)))
    text = "\n".join(
        [",".join([*NAMES, "temperature"]), *(",".join(map(repr, row)) for row in table.tolist()), ""]
    )
    np.testing.assert_array_equal(read(text).q, values[:, 1:])


@pytest.mark.parametrize("value", [0.0, 0.7])
def test_a_log_that_never_changes_stays(value: float, read: Read) -> None:
    values = samples()
    values[:, 1:] = value
    assert read(written(values)).rows == 300


def test_zeros_before_the_first_sample_are_said(read: Read) -> None:
    values = samples()
    values[:25, 1:] = 0.0
    log = read(written(values))
    np.testing.assert_array_equal(log.q, values[:, 1:])
    assert about_rows(log) == [
        "the first 25 rows hold 0 in every column, and then the values jump: had the controller not started?"
    ]


def test_rows_in_warnings_are_those_of_the_file_beside_bad_ones(read: Read) -> None:
    lines = written(padded(samples(), 3)).splitlines()
    lines[10] = "a broken line"
    log = read("\n".join([*lines, ""]), skip_bad=True)
    assert log.rows == 299
    assert "data rows 301 to 303" in about_rows(log)[0]


@pytest.mark.skipif(not LOGS.is_dir(), reason="the real logs in ../shared/logs are not here")
def test_youbot() -> None:
    path = LOGS / "youbot-vrep-scene8" / "configurations.csv"
    table = np.loadtxt(path, delimiter=",")
    log = read_log([path], LogMap(joints=("4", "5", "6", "7", "8")))
    np.testing.assert_array_equal(log.q, table[:-1, 3:8])
    assert "data row 1600" in about_rows(log)[0]


@given(
    st.integers(0, 10**6),
    st.integers(10, 200),
    st.integers(0, 60),
    st.booleans(),
    st.sampled_from([0.0, -1.0, 9999.0]),
)
def test_padding_is_counted(seed: int, rows: int, count: int, ticks: bool, mark: float) -> None:
    values = samples(rows, seed)
    if mark == -1.0:
        values[:, 1:] += 4.0  # away from -1 in every column
    assert end_rows(padded(values, count, mark, ticks=ticks)) == count
