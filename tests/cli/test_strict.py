"""--strict: a doubt about the motion fails the run, and nothing is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.comparison.sync import SyncOption
from urmpipe_pipeline.comparison.verdict import MIN_SHARES

Spoil = Callable[[FloatArray], FloatArray]


def outlier_first(q: FloatArray) -> FloatArray:
    return np.vstack((q[:1] + 0.4, q[1:]))


def outlier_last(q: FloatArray) -> FloatArray:
    return np.vstack((q[:-1], q[-1:] - 0.4))


def repeated_samples(q: FloatArray) -> FloatArray:
    return q[np.arange(len(q)) // 4 * 4]


def joint_limit(q: FloatArray) -> FloatArray:
    return q + 5.3  # of 2 pi


def speed_limit(q: FloatArray) -> FloatArray:
    return q + np.where(np.arange(len(q)) < 100, 0.0, 0.2)[:, None]  # in 5 ms


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoil", "row"),
    [(outlier_first, 1), (outlier_last, 200), (repeated_samples, 2), (joint_limit, 1), (speed_limit, 101)],
)
def test_a_doubt_is_a_warning_and_with_strict_an_error(
    urmpipe: Callable[..., Any], tmp_path: Path, spoil: Spoil, row: int
) -> None:
    kind = spoil.__name__.replace("_", "-")
    t = 0.005 * np.arange(200)
    q = spoil(np.cos(np.outer(t, 0.5 + 0.1 * np.arange(6))))
    header = "t [s]," + ",".join(f"q{j} [rad]" for j in range(1, 7))
    log = tmp_path / "log.csv"
    np.savetxt(log, np.column_stack([t, q]), fmt="%.9f", delimiter=",", header=header, comments="")

    ran = urmpipe("ingest", log, "--robot", "ur5e", "--json", "-o", "run.rrd")
    assert ran.code == 0, ran.err
    warnings = json.loads(ran.out)["warnings"]
    assert {warning["kind"] for warning in warnings} == {kind}
    assert warnings[0]["row"] == row
    assert f"warning: row {row}: {warnings[0]['message']}" in ran.err.splitlines()

    (tmp_path / "run.rrd").unlink()
    strict = urmpipe("ingest", log, "--robot", "ur5e", "--strict", "-o", "run.rrd")
    assert strict.code == 2
    assert f"error: row {row}: {warnings[0]['message']}" in strict.err.splitlines()
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def write_piece(path: Path, first: int, rows: int) -> Path:
    """Write a piece of one motion of six joints, by a clock of its own."""
    t = 0.005 * np.arange(first, first + rows)
    q = np.cos(np.outer(t, 0.5 + 0.4 * np.arange(6)))
    header = "t [s]," + ",".join(f"q{j} [rad]" for j in range(1, 7))
    table = np.column_stack([t - t[0], q + 1e-9 * (path.stem == "done")])  # not the same data
    np.savetxt(path, table, fmt="%.9f", delimiter=",", header=header, comments="")
    return path


def test_what_an_offset_leaves_out_of_a_log_is_no_doubt(tmp_path: Path) -> None:
    wanted = write_piece(tmp_path / "wanted.csv", 100, 300)
    late = write_piece(tmp_path / "late.csv", 0, 397)
    result = urmpipe.compare(wanted, [late], robot="ur5e", sync="auto", strict=True)
    assert result.runs[0].sync.offset == pytest.approx(-0.5, abs=1e-7)  # of values to 1e-9 rad
    assert result.warnings == ()
    assert [(one.samples, one.total) for one in result.runs[0].shares.values()] == [(297, 300), (297, 397)]
    with pytest.raises(LogError) as error:
        urmpipe.compare(wanted, [late], robot="ur5e", sync="auto", tsp=0.0051, strict=True)
    assert "resampled" in {one.kind for one in error.value.findings}


@pytest.mark.parametrize("sync", ["auto", 0.5])
def test_a_part_of_the_reference_that_an_offset_leaves_out_is_a_doubt(
    tmp_path: Path, sync: SyncOption
) -> None:
    wanted = write_piece(tmp_path / "wanted.csv", 0, 300)
    late = write_piece(tmp_path / "late.csv", 100, 200)
    judge = partial(urmpipe.compare, wanted, [late], robot="ur5e", sync=sync)
    assert judge(strict=True).verdict == "fail"
    result = judge(tolerance="coverage=60%")
    said = "it shows 200 of 300 samples of wanted (66.7 %), longest unseen: 0.495 s from t = 0.000 s"
    said += " of the reference"
    assert [(one.kind, one.message) for one in result.warnings] == [("not-covered", said)]
    with pytest.raises(LogError) as error:
        judge(tolerance="coverage=60%", strict=True)
    (told,) = error.value.findings[1:]
    assert (told.kind, told.about, told.message) == ("not-covered", "late", said)


LARGE = "a tolerance of 500 mm (axis) accepts any deviation: 0.5 is in m"


@pytest.mark.slow
def test_a_large_tolerance_with_its_unit_is_meant(urmpipe: Callable[..., Any], tmp_path: Path) -> None:
    logs = [write_piece(tmp_path / f"{name}.csv", 0, 100) for name in ("wanted", "done")]
    given = ("compare", *logs, "--robot", "ur5e", "--strict", "-q", "--tolerance")
    for meant in ("axis=500mm", "0.5m", "axis=0.5m,angle=15deg,joint=1rad", "0.0199,angle=0.2"):
        ran = urmpipe(*given, meant)
        assert (ran.code, ran.err) == (0, ""), meant


def test_in_python_a_tolerance_with_units_is_a_text(tmp_path: Path) -> None:
    logs = [write_piece(tmp_path / f"{name}.csv", 0, 100) for name in ("wanted", "done")]
    with pytest.raises(LogError) as error:
        urmpipe.compare(logs[0], logs[1], robot="ur5e", tolerance=0.5, strict=True)
    (told,) = error.value.findings[1:]
    assert (told.kind, told.message, told.hints[1].value) == ("large-tolerance", LARGE, "axis=0.5m")
    text = "axis=500mm,angle=15deg"
    result = urmpipe.compare(logs[0], logs[1], robot="ur5e", tolerance=text, strict=True)
    assert result.verdict == "pass"
    assert result.tolerance == {"axis": 0.5, "angle": pytest.approx(np.pi / 12), **MIN_SHARES}
    for text, allowed in (("'foo'", "a length in m, or axis="), ("3.5", "a unit: 3.5mm or 3.5m")):
        with pytest.raises(
            OptionError, match=rf"^tolerance \(--tolerance\): found {text}, allowed: {allowed}"
        ):
            urmpipe.compare(logs[0], logs[1], robot="ur5e", tolerance=text.strip("'"))
