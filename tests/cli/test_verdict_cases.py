"""Small logs of which a verdict once said PASS without having looked: what each gives now."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urmpipe_datasets import LOGS

Run = Callable[..., Any]


@pytest.fixture
def cases(shared: Path, tmp_path: Path) -> Path:
    """The folder of the commands, with the cases in it."""
    folder = shared / "cases"
    if not folder.is_dir():
        pytest.skip("the folder shared has no cases")
    for file in [*(folder / "verdict").glob("*.csv"), *(folder / "reading").glob("sparse-*.csv")]:
        shutil.copy(file, tmp_path)
    return tmp_path


def compared(urmpipe: Run, *arguments: str | Path) -> tuple[int, dict[str, Any]]:
    ran = urmpipe("compare", *arguments, "--json")
    return ran.code, json.loads(ran.out)


@pytest.mark.parametrize(
    ("reference", "log", "seen"),
    [
        ("path.csv", "two.csv", 2 / 400),
        ("path.csv", "five.csv", 5 / 400),
        ("path.csv", "del3.csv", 4 / 400),
        ("path.csv", "halfnan.csv", 200 / 400),
        ("path_ms.csv", "bump.csv", 1 / 400),
        (LOGS / "path.csv", "cr_nan.csv", 248 / 7383),
        (LOGS / "path.csv", "cr_holes.csv", 248 / 7383),
    ],
)
def test_what_was_not_seen_is_no_pass(
    urmpipe: Run, cases: Path, reference: str | Path, log: str, seen: float
) -> None:
    arm = ("--robot", "urm6", "--unit", "rad") if log.startswith("cr") else ("--robot", "ur5e")
    code, found = compared(urmpipe, reference, log, *arm)
    (one,) = found["runs"]
    assert (code, found["verdict"], one["coverage"]["verdict"]) == (1, "fail", "fail")
    assert one["coverage"]["value"] == seen  # of the same two whole numbers
    assert all(axis["verdict"] != "fail" for axis in one["delta"].values())


@pytest.mark.parametrize("log", ["bump.csv", "c9.csv", "c10.csv", "xyz_x_real.csv"])
def test_the_measured_motion_fails_beside_a_command_that_does_not(
    urmpipe: Run, cases: Path, log: str
) -> None:
    code, found = compared(urmpipe, "path.csv", log, "--robot", "ur5e")
    (one,) = found["runs"]
    assert (code, one["delta"]["z"]["max"]) == (1, pytest.approx(0.02957, abs=1e-5))  # the bump, by its print
    assert one["coverage"]["value"] == 1.0


def test_cycles_that_do_not_follow_fail_the_test(urmpipe: Run, cases: Path) -> None:
    ran = urmpipe("iso", "sq.csv", "t10d.csv", "--tolerance", "AP=0.4mm,AT=1mm")
    assert ran.code == 1
    assert ran.out.startswith("FAIL  1 of 10 cycles")


def test_the_same_data_on_both_sides_is_a_warning(urmpipe: Run, cases: Path) -> None:
    ran = urmpipe("compare", "ok.csv", "ok.csv", "--robot", "ur5e", "--strict")
    assert (ran.code, ran.out) == (2, "")
    assert "the same data as ok" in ran.err


@pytest.mark.parametrize(
    ("line", "readings"),
    [
        ("ik reach.csv --robot ur5e --tolerance 3.5", "3.5mm or 3.5m"),
        ("compare path.csv ok.csv --robot ur5e --tolerance 0.1", "0.1mm or 0.1m"),
        ("accuracy --path cube: --limit 0.4", "0.4mm or 0.4m"),
    ],
)
def test_a_deviation_of_an_unclear_unit_is_refused(
    urmpipe: Run, cases: Path, line: str, readings: str
) -> None:
    ran = urmpipe(*line.split())
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.endswith(f"allowed: a unit: {readings}\n")


def test_rows_of_another_topic_are_no_gaps(urmpipe: Run, cases: Path) -> None:
    sides = "sparse-reference.csv", "sparse-reference-log.csv"
    arm = "--robot", "ur5e", "--unit", "rad"
    code, found = compared(urmpipe, *sides, *arm)
    lines = (cases / sides[0]).read_text().splitlines()
    (cases / "dense.csv").write_text("\n".join([lines[0], *(one for one in lines[1:] if ",,,," not in one)]))
    dense = compared(urmpipe, "dense.csv", sides[1], *arm)
    assert (code, dense[0]) == (1, 1)
    for name in ("samples", "delta", "coverage", "judged"):
        assert found["runs"][0][name] == dense[1]["runs"][0][name]
    code, found = compared(urmpipe, "sparse-two-topics.csv", "--sides", "command,states", *arm)
    assert (code, found["runs"][0]["samples"], found["runs"][0]["coverage"]["verdict"]) == (0, 59, "pass")
