"""A DataFrame, an Arrow table, a Parquet file and the CSV of the same numbers are one log."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from asserting import refusal
from urmpipe import ingest
from urmpipe_models.errors import LogError, OptionError, UrmpipeError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, MemoryTable, arrays_to_table, dataframe_to_table, read_log
from urmpipe_pipeline.runs.ingest import ingest_log

OF_TEXT = ("encoding", "delimiter", "decimal sign", "header", "significant digits", "form of the time")
"""What only a text can tell."""

T = np.arange(300) * 0.005
Q = np.sin(T[:, np.newaxis] + np.arange(3.0))
START = np.datetime64("2021-04-11T22:27:21.573", "ns")


@dataclass(frozen=True)
class Outcome:
    """What became of a log: its arrays, and what was said."""

    arrays: tuple[bytes, ...]
    said: tuple[Any, ...]


def outcome(log: Path | MemoryTable, options: LogMap | None = None) -> Outcome:
    """Return what became of a log; of an error its findings, but for file and line."""
    try:
        run = ingest_log([log], read=options)
    except UrmpipeError as error:
        return Outcome((), tuple(replace(one, file=None, line=None) for one in error.findings))
    arrays = (run.q, run.qd, run.qdd, run.t_ns, run.log.q, run.log.t_ns, run.log.tcp_position)
    found = tuple(one for one in run.log.inferences if one.what not in OF_TEXT)
    said = (run.log.clock_start_ns, run.log.joints, run.log.columns, run.audit, run.warnings, found)
    return Outcome(tuple(np.asarray(one).tobytes() for one in arrays if one is not None), said)


HEADERS = (
    ["q1", "q2", "q3"],
    ["q1 [rad]", "q2 [rad]", "q3 [rad]"],
    ["q1 [deg]", "q2 [deg]", "q3 [deg]"],
    ["J1", "J2", "J3", "qd1", "qd2", "qd3"],
    ["q1 [rad]", "q2 [rad]", "x [m]", "y [m]", "z [m]", "note"],
)
CLOCKS: dict[str, Callable[[Any], Any]] = {
    "none": lambda t: None,
    "t [s]": lambda t: t,
    "t": lambda t: t,
    "t [ms]": lambda t: t * 1e3,
    "time_us": lambda t: np.rint(t * 1e6).astype(np.int64),
    "timestamp": lambda t: 1_700_000_000_000_000_000 + np.rint(t * 1e9).astype(np.int64),
    "stamp": lambda t: 1_700_000_000.25 + t,
    "date": lambda t: START + np.rint(t * 1e9).astype("timedelta64[ns]"),
    "zoned": lambda t: pd.Series(START + np.rint(t * 1e9).astype("timedelta64[ns]")).dt.tz_localize(
        "Asia/Tokyo"
    ),
}


@st.composite
def frames(draw: st.DrawFn) -> pd.DataFrame:
    """Smooth motions that wrap or not, with or without a clock, gaps and missing samples."""
    names = draw(st.sampled_from(HEADERS))
    rows = draw(st.integers(20, 60))
    period = draw(st.sampled_from([0.001, 0.004, 0.0123, 0.1]))
    t = np.arange(rows) * period
    speed = np.array(draw(st.lists(st.floats(-3, 3), min_size=len(names), max_size=len(names))))
    values = np.array([0.1, 0.7, -0.4, 1.0, 2.0, 0.3])[: len(names)] + speed * t[:, np.newaxis]
    if draw(st.booleans()):
        values = (values + 3.0 * t[:, np.newaxis] / period * 0.05 + np.pi) % (2 * np.pi) - np.pi
    values = np.degrees(values) if "deg" in names[0] else values
    frame = pd.DataFrame(values, columns=names)
    if "note" in frame:
        frame["note"] = draw(st.sampled_from(["home", "7", "True"]))
    if draw(st.booleans()):
        frame.iloc[draw(st.integers(1, rows - 2)), 0] = np.nan
    if draw(st.booleans()):
        frame[names[1]] = frame[names[1]].astype(draw(st.sampled_from(["Float64", "object"])))
    clock = draw(st.sampled_from([*CLOCKS]))
    if clock != "none":
        frame.insert(0, clock, CLOCKS[clock](t))
    if draw(st.booleans()):
        frame = frame.drop(index=range(rows // 2, rows // 2 + draw(st.integers(1, 4))))
    return frame


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(frames())
def test_what_python_holds_reads_as_its_csv(frame: pd.DataFrame) -> None:
    with tempfile.TemporaryDirectory() as name:
        csv, parquet = Path(name) / "log.csv", Path(name) / "log.parquet"
        frame.to_csv(csv, index=False)
        frame.to_parquet(parquet, index=False)
        wanted = outcome(csv)
        held: dict[str, Path | MemoryTable] = {
            "frame": dataframe_to_table(frame, "log"),
            "Arrow": dataframe_to_table(pa.Table.from_pandas(frame, preserve_index=False), "log"),
            "Parquet": parquet,
        }
        for what, one in held.items():
            assert outcome(one) == wanted, what


class Stream:
    """A table of a library that is not known: it only gives itself as a stream."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return pl.DataFrame(COLUMNS).__arrow_c_stream__(requested_schema)


COLUMNS = {"t [s]": T, **{f"q{k + 1} [rad]": Q[:, k] for k in range(3)}, "mode": ["run"] * len(T)}
TABLES: dict[str, Callable[[], Any]] = {
    "polars": lambda: pl.DataFrame(COLUMNS),
    "categories of polars": lambda: pl.DataFrame(COLUMNS).cast({"mode": pl.Categorical}),
    "a lazy frame of polars": lambda: pl.LazyFrame(COLUMNS),
    "a relation of DuckDB": lambda: duckdb.from_arrow(pa.table(COLUMNS)),
    "batches of Arrow": lambda: pa.table(COLUMNS).to_reader(max_chunksize=7),
    "any stream": Stream,
}


@pytest.mark.parametrize("what", TABLES)
def test_tables_of_other_libraries(what: str) -> None:
    wanted = outcome(dataframe_to_table(pd.DataFrame(COLUMNS), "log"))
    assert outcome(dataframe_to_table(TABLES[what](), "log")) == wanted
    assert (ingest(TABLES[what]()).q == Q).all()


def test_a_query_that_fails_is_one_line() -> None:
    for query in (
        pl.LazyFrame(COLUMNS).select("q7"),
        duckdb.sql("select cast(x as double) from (select 'a' x)"),
    ):
        found = refusal(LogError, dataframe_to_table, query, "log")
        assert found.startswith(f"log: found a {type(query).__name__} that cannot be read (")
        assert "\n" not in found
    for column in (pl.Series([1.0, 2.0]), pa.chunked_array([[1.0, 2.0]])):
        assert "allowed: a file, several of one log" in refusal(OptionError, ingest, column)


def log_of(frame: Any, **options: Any) -> JointLog:
    """Return the log that a table in Python is."""
    return read_log([dataframe_to_table(frame, "log")], LogMap(**options))


def test_float32_is_read_as_it_is_and_its_clock_by_its_digits() -> None:
    """A CSV has the shortest digits that tell floats of 32 bits apart, which are other doubles."""
    frame = pd.DataFrame({"t [s]": T, "q1 [rad]": Q[:, 0]}).astype(np.float32)
    log = log_of(frame)
    assert log.q[:, 0].tolist() == frame["q1 [rad]"].astype(np.float64).tolist()
    assert log.t_ns.tolist() == [5_000_000 * k for k in range(300)]


INDEXES: dict[str, Any] = {
    "dates": pd.DatetimeIndex(START + np.rint(T * 1e9).astype("timedelta64[ns]")),
    "lengths of time": pd.to_timedelta(T, unit="s"),
    "named floats": pd.Index(T, name="time"),
    "floats": pd.Index(T),
    "named integers": pd.Index(5 * np.arange(300), name="t_ms"),
}


@pytest.mark.parametrize("what", INDEXES)
def test_an_index_of_times_is_the_clock(what: str, tmp_path: Path) -> None:
    frame = pd.DataFrame(Q, columns=["q1 [rad]", "q2 [rad]", "q3 [rad]"], index=INDEXES[what])
    frame.to_parquet(tmp_path / "log.parquet")
    for log in (log_of(frame), read_log([tmp_path / "log.parquet"])):
        assert log.t_ns.tolist() == [5_000_000 * k for k in range(300)]
        assert (log.q == Q).all()
        assert log.warnings == ()


def test_an_index_that_counts_is_no_column() -> None:
    frame = pd.DataFrame({"t [s]": T, "q1 [rad]": Q[:, 0]})
    for one in (frame, frame.iloc[::2]):
        assert [column.number for column in log_of(one).columns] == [1, 2]


def test_two_levels_of_names_are_group_and_name() -> None:
    names = pd.MultiIndex.from_tuples([("", "t [s]"), ("position", "q1 [rad]"), ("position", "q2 [rad]")])
    frame = pd.DataFrame(np.column_stack([T, Q[:, :2]]), columns=names)
    assert log_of(frame).joints == ("position/q1", "position/q2")


def test_columns_that_are_only_counted_have_no_names() -> None:
    q = np.sin(9 * T[:, np.newaxis] + np.arange(4.0))  # no joint increases throughout, as the clock does
    log = log_of(pd.DataFrame(np.column_stack([T, q])), unit="rad")
    assert (log.q == q).all()
    assert log.t_ns.tolist() == [5_000_000 * k for k in range(300)]


@pytest.mark.parametrize("cell", [list, tuple, np.asarray, lambda row: np.asarray(row, dtype=np.float32)])
def test_arrays_in_cells_are_spread(cell: Callable[[Any], Any]) -> None:
    frame = pd.DataFrame({"t [s]": T, "q [rad]": [cell(row) for row in Q.tolist()]})
    log = log_of(frame)
    assert log.joints == ("q_1", "q_2", "q_3")
    # Floats of 32 bits are half a unit of their last bit off.
    np.testing.assert_allclose(log.q, Q, rtol=2**-24, atol=0)


def test_an_array_of_another_length_is_named_by_its_row() -> None:
    cells = Q.tolist()
    cells[7] = cells[7][:2]
    frame = pd.DataFrame({"t [s]": T, "q": cells})
    assert (
        refusal(LogError, log_of, frame)
        == "log, row 8, column q: found 2 entries, allowed: 3, as in the other rows"
    )


def test_lists_of_many_lengths_are_no_joints() -> None:
    frame = pd.DataFrame({"t [s]": T, "q1 [rad]": Q[:, 0], "seen": [[1.0] * (k % 5) for k in range(300)]})
    assert log_of(frame).joints == ("q1",)


def test_structs_are_flattened_by_points() -> None:
    state = [{"q": row, "mode": "run"} for row in Q.tolist()]
    log = read_log([dataframe_to_table(pa.table({"t": T, "state": state}), "log")], LogMap(unit={"": "rad"}))
    assert log.joints == ("state.q_1", "state.q_2", "state.q_3")
    assert (log.q == Q).all()


def test_numbers_as_text_are_read_and_other_texts_named() -> None:
    frame = pd.DataFrame(
        {"t": T, "q1": Q[:, 0].astype(str), "q2": [f" {value!r} " for value in Q[:, 1].tolist()]}
    )
    assert (log_of(frame, unit="rad").q == Q[:, :2]).all()
    frame.loc[5, "q2"] = "oops"
    assert refusal(LogError, log_of, frame, unit="rad").splitlines() == [
        "log, row 6, column q2: found 'oops', allowed: a number, or an empty, Null or NaN cell where a sample"
        " is missing",
        "log: 1 of 300 rows cannot be read; --skip-bad leaves them out",
    ]
    log = log_of(frame, unit="rad", skip_bad=True)
    assert (log.q == np.delete(Q[:, :2], 5, axis=0)).all()


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        (pd.DataFrame(), "log: found a table without rows, allowed: one row per sample"),
        (
            pd.DataFrame({"t": [], "q1": []}),
            "log: found a table without rows, allowed: one row per sample",
        ),
        (
            pd.DataFrame({"a": ["x", "y"], "b": [{}, []]}),
            "log: found no number in a, b, allowed: one column per joint",
        ),
        (
            pd.DataFrame({"t": [0.0, 0.1], "q1": [object(), object()]}),
            "log: found no joint columns in q1",
        ),
    ],
)
def test_tables_without_joints_are_one_line(frame: pd.DataFrame, said: str) -> None:
    found = refusal(LogError, log_of, frame)
    assert found.startswith(said)
    assert "\n" not in found


def test_twins_are_asked_about_as_in_a_csv(tmp_path: Path) -> None:
    frame = pd.DataFrame(np.column_stack([T, Q]), columns=["t", "q1", "q2", "q1"])
    frame.to_csv(tmp_path / "log.csv", index=False)
    assert outcome(dataframe_to_table(frame, "log")) == outcome(tmp_path / "log.csv")
    assert (log_of(frame, joints=("4", "3"), unit="rad").q == Q[:, [2, 1]]).all()


def test_integers_beyond_doubles_keep_their_nanoseconds() -> None:
    stamps = [1_700_000_000_000_000_001 + 5_000_000 * k for k in range(300)]
    for kind in (np.int64, np.uint64):
        log = log_of(pd.DataFrame({"stamp": np.array(stamps, dtype=kind), "q1 [rad]": Q[:, 0]}))
        assert log.clock_start_ns == stamps[0]
        assert log.t_ns[-1] == 299 * 5_000_000


@pytest.mark.parametrize("digits", [1e-18, 1e-12, 1e-6, 1.0, 1e3])
def test_clocks_of_doubles_are_rounded_once(digits: float) -> None:
    """Also where they have more decimals than a decimal of 128 bits: 3e-4 is 0.00030000000000000003."""
    t = [k * 0.0001 + 1e-9 * digits for k in range(300)]
    log = log_of(pd.DataFrame({"t [s]": t, "q1 [rad]": Q[:, 0]}))
    from decimal import ROUND_HALF_EVEN, Decimal

    exact = [int((Decimal(repr(one)) * 10**9).to_integral_value(ROUND_HALF_EVEN)) for one in t]
    assert (log.clock_start_ns + log.t_ns).tolist() == exact


ARRAYS: Sequence[tuple[str, Any, Any]] = [
    ("lists", T.tolist(), Q.tolist()),
    ("arrays", T, Q),
    ("dates", START + np.rint(T * 1e9).astype("timedelta64[ns]"), Q),
    ("lengths of time", np.rint(T * 1e9).astype("timedelta64[ns]"), Q),
    ("objects", pd.Series(pd.to_datetime("2021-04-11") + pd.to_timedelta(T, unit="s")).dt.to_pydatetime(), Q),
]


@pytest.mark.parametrize(("what", "t", "q"), ARRAYS)
def test_arrays_are_a_log(what: str, t: Any, q: Any) -> None:
    log = read_log([arrays_to_table(t, q, None, (), "log", None, ())])
    assert (log.q == Q).all()
    assert log.t_ns.tolist() == [5_000_000 * k for k in range(300)]
    assert (log.joints, log.warnings) == (("q1", "q2", "q3"), ())


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.integers(1, 7), st.integers(2, 40), st.sampled_from([0.001, 0.0123, 0.1]), st.booleans())
def test_arrays_read_as_their_csv(joints: int, rows: int, period: float, wraps: bool) -> None:
    t = np.arange(rows) * period
    q = np.cos(np.arange(joints)) + t[:, np.newaxis] * np.linspace(-2, 3, joints) * (9 if wraps else 1)
    q = (q + np.pi) % (2 * np.pi) - np.pi
    with tempfile.TemporaryDirectory() as name:
        names = ["t [s]", *(f"q{k + 1} [rad]" for k in range(joints))]
        pd.DataFrame(np.column_stack([t, q]), columns=names).to_csv(Path(name) / "log.csv", index=False)
        wanted = outcome(Path(name) / "log.csv")
    found = outcome(arrays_to_table(t, q, None, (), "log", None, ()))
    assert found.arrays == wanted.arrays
    assert bool(found.arrays) == (len(wanted.said) == 6)
    for one, other in zip(found.said[3:5], wanted.said[3:5], strict=True):  # audit and warnings
        assert one == other


def test_masked_samples_are_missing() -> None:
    q = np.ma.masked_array(Q, mask=np.arange(900).reshape(300, 3) == 4)
    log = read_log([arrays_to_table(T, q, None, (), "log", None, ())])
    assert np.argwhere(np.isnan(log.q)).tolist() == [[1, 1]]
