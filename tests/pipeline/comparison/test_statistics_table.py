"""The statistics as CSV: read back by others, bit for bit."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from urmpipe_models.errors import OutputError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.statistics_table import COLUMNS, write_statistics
from urmpipe_pipeline.comparison.trajectory import Sync
from urmpipe_pipeline.outputs import STATISTICS_HEADER, guarded_output

Compared = Callable[..., Comparison]


def write(result: Comparison, path: Path) -> None:
    """Write a table as the command does."""
    with guarded_output(path, [], "statistics") as part:
        write_statistics(result, part, path)


def test_every_field_of_every_quantity_reads_back(arms: Compared, tmp_path: Path) -> None:
    deltas = 0.001 * np.random.default_rng(2).normal(size=(60, 6))
    result = arms({"a": deltas, 'b, "c"\n': deltas[:30]}, tolerance={"z": 0.001, "joint": 0.002})
    late = replace(result.runs[0], sync=Sync("given", 0.1 + 0.2))
    result = replace(result, runs=(late, result.runs[1]))
    write(result, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    expected = [(run, one) for run in result.runs for one in run.all_statistics]
    assert len(rows) == len(expected) == 24
    for row, (run, one) in zip(rows, expected, strict=True):
        assert (row["run"], float(row["sync_offset"])) == (run.name, run.sync.offset)
        for field, value in asdict(one).items():
            assert row[field] == "" if value is None else type(value)(row[field]) == value, field


def test_pandas_reads_it_as_the_frame(arms: Compared, tmp_path: Path) -> None:
    result = arms({"a": np.full((20, 6), 0.001)})
    write(result, tmp_path / "a.csv")
    read = pd.read_csv(tmp_path / "a.csv")
    pd.testing.assert_frame_equal(read, result.to_frame(), check_dtype=False, check_exact=True)


def test_the_mark_is_the_head_and_only_such_a_file_is_replaced(paths: Compared, tmp_path: Path) -> None:
    assert ",".join(COLUMNS).startswith(STATISTICS_HEADER)
    path = tmp_path / "a.csv"
    result = paths({"a": np.zeros((5, 3))})
    for _ in range(2):
        write(result, path)
    path.write_text("t,x,y,z\n")
    with pytest.raises(OutputError) as error:
        write(result, path)
    assert str(error.value) == (
        f"{path}: found a file that is no table of statistics of urmpipe's, allowed: a new name,"
        " or such a table of statistics to replace"
    )
