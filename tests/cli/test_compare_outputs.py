"""What compare writes: JSON, JUnit, CSV, recording and report agree, with a baseline too; names of files."""

from __future__ import annotations

import csv
import itertools
import json
import os
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.shell_completion import ShellComplete

from four_logs import Captured, compare, lay_logs, names, recorded
from urmpipe.main import cli, run
from urmpipe_pipeline.comparison.baseline import format_worse_count
from urmpipe_pipeline.comparison.deviation import Statistics


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a reference and three logs: within tolerance, a little worse, and out of it."""
    return lay_logs(tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows knows one permission")
def test_a_replaced_output_keeps_its_permissions_and_a_new_one_has_the_usual() -> None:
    lines = [
        "compare wanted.csv good.csv --robot ur5e -o a.rrd --csv a.csv --junit a.xml",
        "report a.rrd -o a.html",
        "robot export urm6 -o a.urdf",
        "fmu build repolarizer -s joints=1 --backend python -o a.fmu",
    ]
    Path("usual").touch()
    usual, outputs = Path("usual").stat().st_mode, ["a.rrd", "a.csv", "a.xml", "a.html", "a.urdf", "a.fmu"]
    assert [run([*line.split(), "-q"]) for line in lines] == [0] * 4
    assert {Path(name).stat().st_mode for name in outputs} == {usual}
    modes = dict(zip(outputs, itertools.cycle((0o640, 0o600, 0o664)), strict=False))
    for name, mode in modes.items():
        Path(name).chmod(mode)
    before = {name: Path(name).stat().st_ino for name in outputs}
    assert [run([*line.split(), "-q"]) for line in lines] == [0] * 4
    assert {name: stat.S_IMODE(Path(name).stat().st_mode) for name in outputs} == modes
    assert all(Path(name).stat().st_ino != number for name, number in before.items())


@pytest.mark.slow
def test_json_csv_junit_and_recording_agree_bit_for_bit(capsys: Captured) -> None:
    tolerance = "axis=3.5mm,norm=5mm,path=3mm,angle=0.5deg,joint=2mrad"
    files = ["--csv", "a.csv", "--junit", "a.xml", "-o", "a.rrd", "--json"]
    assert compare("good.csv", "bad.csv", "--tolerance", tolerance, *files) == 1
    told = json.loads(capsys.readouterr().out)
    stored = recorded("a.rrd")
    with Path("a.csv").open(encoding="utf-8", newline="") as file:
        rows = {(row["run"], row["kind"], row["quantity"]): row for row in csv.DictReader(file)}
    suites = {suite.get("name"): suite for suite in ET.parse("a.xml").getroot()}
    for one, in_json in zip(stored.runs, told["runs"], strict=True):
        properties = {p.attrib["name"]: p.attrib["value"] for p in suites[one.name].iter("property")}
        for statistics in one.all_statistics:
            kept = statistics.to_dict()
            assert kept == in_json_of(in_json, statistics)
            prefix = f"{'joint ' if statistics.kind == 'joint' else ''}{statistics.quantity}"
            for field, value in kept.items():
                text = "" if value is None else value if isinstance(value, str) else repr(value)
                assert rows[one.name, statistics.kind, statistics.quantity][field] == text
                assert properties[f"{prefix}.{field}"] == text
    assert [row["verdict"] for row in rows.values()].count("fail") == len(
        [case for suite in suites.values() for case in suite.findall("testcase/failure")]
    )
    failed = [case for case in ET.parse("a.xml").iter("testcase") if len(case)]
    assert {(one.get("classname"), one[0].get("type")) for one in failed} == {("bad", "out-of-tolerance")}


def in_json_of(told: dict[str, Any], one: Statistics) -> dict[str, Any]:
    """Return the statistics of a quantity in the JSON object of a run."""
    place = told["joints"] if one.kind == "joint" else told["delta"] if one.kind in ("axis", "norm") else told
    found: dict[str, Any] = place[one.quantity]
    return found


def test_options_complete_in_the_shell() -> None:
    shell = ShellComplete(cli, {}, "urmpipe", "_URMPIPE_COMPLETE")
    for option in ("--junit", "--csv", "--baseline", "--noise", "--tolerance"):
        assert [item.value for item in shell.get_completions(["compare"], option)] == [option]


@pytest.mark.slow
def test_a_verdict_of_fail_writes_all_and_bad_input_nothing_but_its_error(
    folder: Path, capsys: Captured
) -> None:
    files = ["--junit", "v.xml", "--csv", "v.csv", "-o", "v.rrd"]
    assert compare("bad.csv", *files) == 1
    out = capsys.readouterr().out.splitlines()
    assert {"JUnit: v.xml", "Statistics: v.csv"} <= set(out)
    assert names() == {"v.xml", "v.csv", "v.rrd"}
    before = {name: (folder / name).read_bytes() for name in names()}
    (folder / "notes.txt").write_text("mine")
    for wrong in (
        ["missing.csv"], ["--strict", "--tsp", "7ms"], ["--csv", "notes.txt"], ["-o", "notes.txt"],
        ["--tolerance", "0"], ["--tool", "1"], ["--nosuch"], ["--map", "missing.toml"], ["--robot", "nosuch"],
    ):  # fmt: skip
        call = ["compare", "wanted.csv", "good.csv", "--robot", "ur5e", *files, "-q", *wrong]
        assert run(call) == 2, wrong
        errors = [one.text for one in ET.parse("v.xml").iter("error")]
        assert [f"error: {one}" for one in errors] == capsys.readouterr().err.splitlines(), wrong
        (folder / "v.xml").write_bytes(before["v.xml"])
    assert {name: (folder / name).read_bytes() for name in before} == before
    assert names() == {"v.xml", "v.csv", "v.rrd", "notes.txt"}
    assert (folder / "notes.txt").read_text() == "mine"
    capsys.readouterr()
    assert compare("good.csv", *files, "-q") == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only there may a file name hold any bytes")
def test_a_log_whose_name_is_no_text_is_compared_recorded_and_reported(capsys: Captured) -> None:
    Path("good.csv").rename("gut\udcfc.csv")
    assert compare("gut\udcfc.csv", "--json") == 0
    assert json.loads(capsys.readouterr().out)["runs"][0]["name"] == "gut\udcfc"
    assert recorded("gut\ufffd-against-wanted.rrd").runs[0].name == "gut\udcfc"
    assert run(["report", "gut\ufffd-against-wanted.rrd", "-o", "gut.html"]) == 0
    assert "gut?" in Path("gut.html").read_text(encoding="utf-8")
    assert run(["ingest", "gut\udcfc.csv", "--robot", "ur5e", "-q"]) == 0
    assert Path("gut\ufffd.rrd").is_file()


@pytest.mark.slow
def test_a_comparison_is_held_against_another(folder: Path, capsys: Captured) -> None:
    assert compare("good.csv", "-q", "-o", "before.rrd") == 0
    (folder / "good.csv").write_bytes((folder / "slack.csv").read_bytes())
    assert compare("good.csv", "-q", "-o", "now.rrd") == 0
    capsys.readouterr()
    assert run(["compare", "now.rrd", "--baseline", "before.rrd", "--json", "--junit", "v.xml"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert (told["verdict"], told["recording"], told["baseline"]["verdict"]) == ("fail", "now.rrd", "fail")
    assert told["baseline"]["recording"] == "before.rrd"
    x = next(one for one in told["baseline"]["changes"] if one["quantity"] == "x")
    before, now = (recorded(name).runs[0] for name in ("before.rrd", "now.rrd"))
    assert x["max"] == {"before": before.statistics["x"].max, "now": now.statistics["x"].max}
    assert x["largest_change"] == np.abs(now.delta[:, 0] - before.delta[:, 0]).max()
    types = {one.get("type") for one in ET.parse("v.xml").iter("failure")}
    assert types == {"worse-than-baseline"}
    assert names() == {"before.rrd", "now.rrd", "v.xml"}
    assert compare("good.csv", "--baseline", "before.rrd", "-q") == 1
    assert recorded("now.rrd").baseline is None
    kept = recorded("good-against-wanted.rrd").baseline
    assert kept is not None and (kept.verdict, kept.recording) == ("fail", Path("before.rrd"))


@pytest.mark.slow
def test_the_report_of_a_recording_says_what_the_exit_code_said(folder: Path) -> None:
    assert compare("good.csv", "-q", "-o", "before.rrd") == 0
    noise = ["--noise", "50um,angle=1deg,joint=1deg"]
    assert compare("slack.csv", "--baseline", "before.rrd", "-q", "-o", "now.rrd", *noise) == 1
    assert run(["report", "now.rrd", "-q"]) == 0
    page = Path("now.html").read_text(encoding="utf-8")
    assert "<title>FAIL: slack-against-wanted" in page
    assert ", by the joints on both sides, but worse than the baseline good-against-wanted" in page
    assert "Against the baseline good-against-wanted" in page
    held = recorded("now.rrd").baseline
    assert held is not None and format_worse_count(held) in page


NARROW = """
import sys
from urmpipe.__main__ import main

def ended() -> object:
    try:
        main()
    except SystemExit as end:
        return end.code

words = [*sys.argv]
for encoding in ("utf-8", "ascii"):
    for more in ([], ["--json"]):
        sys.stdout.reconfigure(encoding=encoding, errors="strict")
        sys.stderr.reconfigure(encoding=encoding, errors="strict")
        sys.argv = [*words, *more]
        assert not ended()
        print("AGAIN")
"""
"""Runs a command line with each encoding, with and without --json: importing takes most of the time."""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only there may a file name hold any bytes")
def test_no_output_is_too_narrow_for_a_name_or_a_sign() -> None:
    Path("good.csv").rename("gut\udcfc.csv")
    call = [sys.executable, "-c", NARROW, "compare", "wanted.csv", "gut\udcfc.csv", "--robot", "ur5e"]
    done = subprocess.run(call, capture_output=True, check=True, timeout=120)
    *printed, end = done.stdout.split(b"AGAIN\n")
    assert (len(printed), end) == (4, b"")
    for told, found in (printed[:2], printed[2:]):
        assert told.startswith(rb"PASS  gut\udcfc within tolerance against wanted")
        assert json.loads(found)["runs"][0]["name"] == "gut\udcfc"
