"""What cannot be exported is said in one line, and what is there stays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from exported import export_result
from urmpipe_models.errors import OptionError, OutputError, RecordingError, UrmpipeError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.presentation.exports import Times
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import ExportOptions, Format, csv_files, typed_files
from urmpipe_pipeline.tables.csv_files import find_line_differences, to_text_columns, write_lines
from urmpipe_pipeline.tables.export import is_export, write_all


def said(kind: type[UrmpipeError], work: Callable[..., object], *args: Any) -> str:
    """What an error of this kind says of its only finding, on the command line."""
    with pytest.raises(kind) as caught:
        work(*args)
    assert len(caught.value.findings) == 1
    return caught.value.findings[0].sentence()


def test_a_comparison_has_the_samples_that_it_compared(comparison: Comparison, tmp_path: Path) -> None:
    assert (
        said(OptionError, export_result, comparison, tmp_path / "a.csv", ExportOptions("csv", "file"))
        == "rows (--rows): found file with a comparison, allowed: compared"
    )


def test_a_trajectory_needs_a_row_with_a_pose(run: Run, tmp_path: Path) -> None:
    empty = replace(run, q=np.full_like(run.q, np.nan))
    assert (
        said(RecordingError, export_result, empty, tmp_path / "a.tum", ExportOptions("tum"))
        == "no row with a pose"
    )
    assert not list(tmp_path.iterdir())


def test_a_log_that_came_from_no_file_has_no_columns_of_one(run: Run, tmp_path: Path) -> None:
    made = replace(run, log=replace(run.log, columns=()))
    assert (
        said(RecordingError, export_result, made, tmp_path / "a.csv", ExportOptions("csv", "file"))
        == "the log was not read from a file; --rows grid writes what was made of it"
    )


@pytest.mark.parametrize("to", ["parquet", "mat", "tum"])
def test_an_export_of_ours_is_replaced_and_nothing_else(run: Run, tmp_path: Path, to: Format) -> None:
    path = tmp_path / f"a.{to}"
    export_result(run, path, ExportOptions(to))
    assert is_export(path)
    export_result(replace(run, name="other"), path, ExportOptions(to))
    assert (
        said(OutputError, export_result, run, path, ExportOptions(to), [path])
        == "found an input of this command, allowed: any other name for the export"
    )
    for foreign in (b"", b"precious", b"# timestamp tx ty tz", b"PAR1", b"MATLAB 5.0 MAT-file Platform: nt"):
        path.write_bytes(foreign)
        assert said(OutputError, export_result, run, path, ExportOptions(to)) == (
            "found a file that is not an export of urmpipe, allowed: a new name, or such an export to replace"
        )
        assert path.read_bytes() == foreign


def test_what_a_mat_file_cannot_hold_is_said_before_it_is_written(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(typed_files, "MAX_SIZE", 1000)
    message = said(OutputError, export_result, run, tmp_path / "a.mat", ExportOptions("mat"))
    size = 40 * 8 * (2 + 3 * 6 + 5 * 3)
    assert message == (
        f"found {size} bytes, allowed: 1000 in a MAT file of version 5; --to parquet takes all"
    )
    assert not list(tmp_path.iterdir())


def test_of_several_trajectories_all_are_written_or_none(comparison: Comparison, tmp_path: Path) -> None:
    (tmp_path / "c-b-actual.tum").write_text("precious")
    with pytest.raises(OutputError):
        export_result(comparison, tmp_path / "c.tum", ExportOptions("tum"))
    assert [path.name for path in tmp_path.iterdir()] == ["c-b-actual.tum"]


def test_a_file_that_reads_back_otherwise_does_not_get_its_name(tmp_path: Path) -> None:
    def write(part: Path) -> list[str]:
        """Write a file, and find the fault that a full disk would leave."""
        part.write_text("half")
        return ["the head", "row 2"]

    message = said(OutputError, write_all, [tmp_path / "a.csv"], [write], "csv", ())
    assert message == "differs when read back: the head, row 2"
    assert not list(tmp_path.iterdir())


def test_other_numbers_at_the_ends_of_a_parquet_file_are_seen(tmp_path: Path) -> None:
    def table(*values: float) -> Any:
        return pa.table({"q1": pa.array(values, pa.float64())})

    pq.write_table(table(1.0, 2.0, 3.0), tmp_path / "a.parquet")
    found = [
        typed_files.find_parquet_differences(one, tmp_path / "a.parquet")
        for one in (
            table(1, 9, 3),
            table(0, 2, 3),
            table(1, 2, 4),
            table(1, 2),
            table(1, 2, 3).rename_columns(["q2"]),
        )
    ]
    assert found == [[], ["row 1"], ["row 3"], ["3 rows of 2"], ["the schema", "row 1", "row 3"]]


def test_other_numbers_at_the_ends_of_a_mat_file_are_seen(tmp_path: Path) -> None:
    def fields(*values: float, name: str = "a", units: tuple[str, ...] = ("rad",)) -> dict[str, Any]:
        return {"name": name, "q": np.array(values), "units": {"q": typed_files.matlab_cells(units)}}

    savemat(tmp_path / "a.mat", {"run": fields(1, 2, np.nan)}, oned_as="column")
    others = [
        fields(1, 9, np.nan),
        fields(0, 2, np.nan),
        fields(1, 2, 3),
        fields(1, 2),
        fields(1, 2, np.nan, name=""),
        fields(1, 2, np.nan, units=("deg",)),
        fields(1, 2, np.nan, units=("rad", "rad")),
    ]
    found = [typed_files.find_mat_differences("run", one, tmp_path / "a.mat") for one in others]
    expected = [[], ["run.q"], ["run.q"], ["run.q"], ["run.name"], ["run.units.q{1}"], ["run.units.q"]]
    assert found == expected


@pytest.mark.parametrize(
    ("damage", "found"),
    [
        (lambda text: text, []),
        (lambda text: text.replace("a,b", "a,c"), ["the head"]),
        (lambda text: text[: text.rindex("0.002")], ["2 rows of 3", "row 3"]),
        (lambda text: text.replace("0.000,1", "0.000,2"), ["row 1"]),
        (lambda text: text.replace("0.002,\n", "0.002,0\n"), ["row 3"]),
        (lambda text: text.replace("0.002", "0.003"), ["row 3"]),
        (lambda text: text.replace("0.000", "0.001"), ["row 1"]),
        (lambda text: text.replace("0.000,1", "0.000,one"), ["row 1"]),
        (lambda text: "", ["the head", "0 rows of 3", "row 1", "row 3"]),
    ],
)
def test_damage_at_head_count_or_ends_is_seen(
    tmp_path: Path, damage: Callable[[str], str], found: list[str]
) -> None:
    columns = to_text_columns([Times(np.array([0, 1_000_000, 2_000_000]), "s"), np.array([1.0, 2.5, np.nan])])
    path = tmp_path / "a.csv"
    write_lines(path, "a,b\n", columns, ",")
    assert path.read_text() == "a,b\n0.000,1\n0.001,2.5\n0.002,\n"
    path.write_text(damage(path.read_text()))
    assert find_line_differences(path, "a,b\n", columns, ",") == found


def test_slices_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    columns = to_text_columns(
        [Times(np.arange(10) * 10**6, "ms"), np.arange(10) / 4, np.array([f"r{k}" for k in range(10)])]
    )
    write_lines(tmp_path / "whole", "", columns, " ")
    monkeypatch.setattr(csv_files, "SLICE", 3)
    write_lines(tmp_path / "sliced", "", columns, " ")
    assert (tmp_path / "sliced").read_bytes() == (tmp_path / "whole").read_bytes()
    assert (tmp_path / "whole").read_text().splitlines()[7] == "7 1.75 r7"
