"""export as a user runs it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import urmpipe as package
from urmpipe.parameters.outputs import Export
from urmpipe.parameters.param import params_of
from urmpipe_pipeline.tables import FORMATS

RunCommand = Callable[..., Any]
"""What the fixture `urmpipe` gives: arguments in; exit code, standard output and standard error out."""

LOG = "t [s],q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg],load [%]\n" + "".join(
    f"{k / 100:.2f},{147.3 + k},{-0.5 * k},1,2,3,{0.1 * k:.1f},7\n" for k in range(5)
)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    (tmp_path / "log.csv").write_text(LOG)
    package.ingest(tmp_path / "log.csv", robot="ur5e", output=tmp_path / "log.rrd")
    return tmp_path / "log.rrd"


@pytest.fixture
def comparison(tmp_path: Path, recording: Path) -> Path:
    package.compare(recording, [recording], output=tmp_path / "both.rrd")
    return tmp_path / "both.rrd"


def test_the_log_leaves_as_it_came(urmpipe: RunCommand, recording: Path, tmp_path: Path) -> None:
    ran = urmpipe("export", "log.rrd", "--to", "csv", "--rows", "file")
    assert (ran.code, ran.out) == (0, "Export: log-file.csv  (5 rows, 7 columns)\n")
    assert (
        ran.err == "warning: load [%]: not ingested (no role is known for them), so they cannot be exported\n"
    )
    found = [line.split(",") for line in (tmp_path / "log-file.csv").read_text().splitlines()]
    wanted = [line.split(",")[:-1] for line in LOG.splitlines()]
    assert found[0] == wanted[0]
    assert [row[0] for row in found[1:]] == [row[0] for row in wanted[1:]]
    assert [[float(cell) for cell in row] for row in found[1:]] == [
        [float(cell) for cell in row] for row in wanted[1:]
    ]


def test_without_a_name_the_log_beside_is_left_alone(
    urmpipe: RunCommand, recording: Path, tmp_path: Path
) -> None:
    assert urmpipe("export", "log.rrd", "--to", "csv").out == "Export: log-grid.csv  (5 rows, 31 columns)\n"
    assert (tmp_path / "log.csv").read_text() == LOG
    again = urmpipe("export", "log.rrd", "--to", "csv")
    assert (again.code, again.out) == (2, "")
    assert again.err == (
        "error: log-grid.csv: found a file, allowed: a new name; an existing CSV file is never replaced\n"
    )
    assert urmpipe("export", "log.rrd", "-o", "log.csv").code == 2
    assert (tmp_path / "log.csv").read_text() == LOG


@pytest.mark.slow
@pytest.mark.parametrize("to", ["parquet", "mat", "tum"])
def test_the_suffix_tells_the_format_and_an_export_is_replaced(
    urmpipe: RunCommand, recording: Path, tmp_path: Path, to: str
) -> None:
    for _ in range(2):
        ran = urmpipe("export", "log.rrd", "-o", f"a.{to}")
        assert (ran.code, ran.err) == (0, "")
        assert ran.out.startswith(f"Export: a.{to}  (5 rows, ")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"a.{to}", "log.csv", "log.rrd"]


def test_json_is_all_that_stands_on_standard_output(urmpipe: RunCommand, recording: Path) -> None:
    ran = urmpipe("export", "log.rrd", "-o", "a.tum", "--json")
    assert json.loads(ran.out) == {
        "schema": 1,
        "files": [{"file": "a.tum", "samples": 5}],
        "to": "tum",
        "rows": "grid",
        "columns": [
            {"name": name, "unit": unit}
            for name, unit in zip(
                ("t", "x", "y", "z", "qx", "qy", "qz", "qw"), ["s", *"mmm", *[""] * 4], strict=True
            )
        ],
        "left_out": 0,
        "warnings": [],
    }


def test_quiet_prints_nothing(urmpipe: RunCommand, recording: Path) -> None:
    ran = urmpipe("export", "log.rrd", "--to", "csv", "--rows", "file", "-q")
    assert (ran.code, ran.out, ran.err) == (0, "", "")


def test_a_comparison_leaves_too(urmpipe: RunCommand, comparison: Path, tmp_path: Path) -> None:
    assert urmpipe("export", "both.rrd", "--to", "csv").out == "Export: both.csv  (5 rows, 14 columns)\n"
    ran = urmpipe("export", "both.rrd", "--to", "tum")
    assert ran.code == 0
    assert ran.out.splitlines() == [
        "Export: both-reference.tum  (5 rows, 8 columns)",
        "Export: both-actual.tum  (5 rows, 8 columns)",
    ]
    assert ran.err.startswith(
        "warning: a comparison holds positions: every orientation is written as 0 0 0 1"
    )


def test_what_is_no_recording_is_refused(urmpipe: RunCommand, recording: Path) -> None:
    assert urmpipe("export", "log.csv", "--to", "csv").err == (
        "error: log.csv: found no recording of urmpipe,"
        " allowed: a .rrd that ingest, compare or simulate wrote\n"
    )
    assert urmpipe("export", "missing.rrd", "--to", "csv").err.startswith("error: missing.rrd: ")
    ran = urmpipe("export", "log.rrd", "--to", "tum", "--tcp", "recorded")
    assert (ran.code, ran.err.count("\n")) == (2, 1)
    assert ran.err.startswith("error: log.rrd: no recorded position, so no recorded pose; ")


def test_the_formats_of_the_command_are_those_of_the_function() -> None:
    """The command spells them again, so that its --help needs not import NumPy."""
    assert params_of(Export)["to"].kind.allowed == ", ".join(FORMATS)
