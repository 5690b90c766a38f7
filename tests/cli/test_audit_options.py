"""--audit, --interval and --repair, as a user gives them."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe as package

RunCommand = Callable[..., Any]
HEADER = ["joint", "row", "t", "kind", "step", "turns_before", "turns_after"]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Two joints of a log of 5 ms: one wraps over an in-between sample, one jumps and has a gap."""
    folder = tmp_path / "in"
    folder.mkdir()
    x = 180.0 + 3.0 * (np.arange(60) - 29.5)
    q1 = x - 360.0 * np.floor((x + 180.0) / 360.0)
    q1[30] = 90.0
    q2 = np.where(np.arange(60) < 20, 0.0, 100.0)
    t = 0.005 * np.r_[0:40, 640:660]
    table = np.column_stack([t, q1, q2])
    np.savetxt(
        folder / "log.csv", table, delimiter=",", header="t,q1 [deg],q2 [deg]", comments="", fmt="%.6g"
    )
    return folder / "log.csv"


def test_the_audit_is_a_table_with_a_line_for_each_entry(
    urmpipe: RunCommand, log: Path, tmp_path: Path
) -> None:
    ran = urmpipe("ingest", log, "--audit", "audit.csv", "--json")
    assert ran.code == 0, ran.err
    rows = list(csv.reader((tmp_path / "audit.csv").open(newline="")))
    assert rows[0] == HEADER
    assert [(row[0], row[1], row[3], row[5], row[6]) for row in rows[1:]] == [
        ("q2", "21", "unexplained", "0", "0"),
        ("q1", "31", "in-between", "0", "0"),
        ("q1", "32", "wrap", "0", "1"),
        ("q1", "41", "ambiguous", "1", "1"),
    ]
    answer = json.loads(ran.out)
    assert [[str(one[name]) for name in HEADER] for one in answer["audit"]] == rows[1:]
    assert [one["row"] for one in answer["repolarizations"]] == [32]
    assert {"large-step", "in-between", "ambiguous-turn"} <= {one["kind"] for one in answer["warnings"]}


def test_what_is_told_of_an_audit_counts_its_lines(urmpipe: RunCommand, log: Path) -> None:
    ran = urmpipe("ingest", log, "--audit", "audit.csv")
    assert "1 repolarization, 3 other findings\n" in "".join(
        f"{line.rstrip()}\n" for line in ran.out.splitlines()
    )
    assert "Audit: audit.csv  (4 lines)\n" in ran.out


def test_an_audit_replaces_only_an_audit(urmpipe: RunCommand, log: Path, tmp_path: Path) -> None:
    target = tmp_path / "audit.csv"
    target.write_text("my notes\n")
    refused = urmpipe("ingest", log, "--audit", "audit.csv", "-q")
    assert refused.code == 2
    assert refused.err == (
        "error: audit.csv: found a file that is not an audit of urmpipe, allowed: a new name, or such an"
        " audit to replace\n"
    )
    assert target.read_text() == "my notes\n"
    assert not (tmp_path / "log.rrd").exists()
    target.unlink()
    assert [urmpipe("ingest", log, "--audit", "audit.csv", "-q").code for _ in range(2)] == [0, 0]
    same = urmpipe("ingest", log, "-o", "x.csv", "--audit", "x.csv")
    assert same.err == "error: found x.csv as recording and as audit; allowed: a name for each\n"


def test_repair_and_interval_reach_the_repolarizer(urmpipe: RunCommand, log: Path) -> None:
    ran = urmpipe("ingest", log, "--repair", "--interval", "-180:180", "--interval", "q2=-90:270", "--json")
    assert ran.code == 0, ran.err
    answer = json.loads(ran.out)
    assert [one["kind"] for one in answer["audit"]].count("repaired") == 1
    said = {one["what"]: one["value"] for one in answer["inferences"]}
    assert said["interval of q1"] == "-180..180 deg"
    assert said["interval of q2"] == "-90..270 deg"
    outside = urmpipe("ingest", log, "--interval", "q2=-90:90")
    assert outside.code == 2
    assert outside.err == (
        "error: log.csv, row 21, column q2: interval (--interval): found 40 values outside, first 100 deg"
        " in row"
        " 21, allowed: -90..90 deg\n"
    )


@pytest.mark.parametrize("value", ["0", "0:1:2", "q1=", "low:high"])
def test_an_interval_that_is_none_is_a_usage_error(urmpipe: RunCommand, log: Path, value: str) -> None:
    ran = urmpipe("ingest", log, "--interval", value)
    assert ran.code == 2
    assert f"found {value!r}, allowed: LOW:HIGH or JOINT=LOW:HIGH" in ran.err


@pytest.mark.parametrize(
    ("operands", "joint", "allowed"),
    [
        (["q", "j"], "q2", None),
        (["j", "q"], "q2", None),  # of the log that has the joint, whichever that is
        (["tcp", "q"], "q2", None),
        (["both", "--sides", "target,actual"], "actual_q2", None),
        (["q", "j"], "z", "q1, q2, j1, j2"),
        (["tcp", "q"], "z", "q1, q2"),
        (["both", "--sides", "target,actual"], "q2", "target_q1, target_q2, actual_q1, actual_q2"),
        (["slide", "slide"], "q2", "q1"),
        (["tcp", "tcp"], "q2", "none"),
    ],
)
def test_an_interval_is_that_of_a_joint_of_any_log(
    urmpipe: RunCommand, tmp_path: Path, operands: list[str], joint: str, allowed: str | None
) -> None:
    t = 0.01 * np.arange(50)
    heads = {
        "q": "q1 [deg],q2 [deg]", "j": "j1 [deg],j2 [deg]", "slide": "q1 [deg],q2 [m]",
        "tcp": "x [m],y [m],z [m]",
        "both": "target_q1 [deg],target_q2 [deg],actual_q1 [deg],actual_q2 [deg]",
    }  # fmt: skip
    for name, head in heads.items():
        table = np.column_stack([t, *[10.0 * t] * (head.count(",") + 1)])
        np.savetxt(tmp_path / name, table, delimiter=",", header=f"t,{head}", comments="")
    ran = urmpipe("compare", *operands, "--tolerance", "joint=1deg", "--interval", f"{joint}=-180:180")
    said = f"error: interval (--interval): found {joint}, allowed: joints that turn: {allowed}"
    assert [line for line in ran.err.splitlines() if "interval" in line] == ([said] if allowed else [])


def test_the_options_hold_in_python(log: Path, tmp_path: Path) -> None:
    run = package.ingest(log, repair=True, interval={"q1": (-180.0, 180.0)}, audit=tmp_path / "a.csv")
    assert [one.kind for one in run.audit] == ["unexplained", "repaired", "wrap", "ambiguous"]
    assert run.recording is None
    assert (tmp_path / "a.csv").read_text().count("\n") == 5
    assert run.provenance.options["read"] == {"interval": {"q1": (-180.0, 180.0)}, "repair": True}
