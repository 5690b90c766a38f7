"""compare on the command line: tolerances, JUnit, CSV and a baseline; all numbers are the same."""

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

import urmpipe
from four_logs import ALLOWED, Captured, compare, lay_logs, names, recorded, said, write_log
from urmpipe.main import cli, run
from urmpipe.parameters.kinds import SYNC
from urmpipe_models.errors import OptionError
from urmpipe_pipeline.comparison.deviation import Statistics
from urmpipe_pipeline.comparison.verdict import MIN_SHARES


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


@pytest.mark.slow
def test_what_is_given_replaces_the_default_tolerance_whole(capsys: Captured) -> None:
    assert compare("bad.csv", "--json") == 1
    assert json.loads(capsys.readouterr().out)["tolerance"] == {"axis": 0.0035, **MIN_SHARES}
    assert compare("bad.csv", "--tolerance", "angle=5deg", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["tolerance"] == {"angle": np.radians(5.0), **MIN_SHARES}
    assert told["runs"][0]["delta"]["x"]["verdict"] is None


def test_all_that_is_wrong_with_a_tolerance_is_told_at_once(capsys: Captured) -> None:
    assert compare("good.csv", "--tolerance", "axis=3 inch,roll=1deg,norm=5mm") == 2
    assert capsys.readouterr().err.splitlines() == [
        f"error: tolerance (--tolerance): found 'axis=3 inch', {ALLOWED}",
        f"error: tolerance (--tolerance): found 'roll=1deg', {ALLOWED}",
    ]
    assert names() == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "tolerance"),
    [
        ("[compare]\ntolerance = 0.002", {"axis": 0.002}),
        ("tolerance = '2mm,norm=3mm'", {"axis": 0.002, "norm": 0.003}),
        ("[compare]\ntolerance = {axis = 0.002, angle = '10mrad'}", {"axis": 0.002, "angle": 0.01}),
        ("tolerance = {x = 0.002, coverage = '40%'}", {"x": 0.002, "coverage": 0.4}),
        ("[compare.tolerance]\npath = '1mm'", {"path": 0.001}),
    ],
)
def test_a_lab_says_its_tolerance_as_text_or_as_a_table(
    folder: Path, capsys: Captured, text: str, tolerance: dict[str, float]
) -> None:
    (folder / "urmpipe.toml").write_text(text)
    compare("good.csv", "--json")
    assert json.loads(capsys.readouterr().out)["tolerance"] == MIN_SHARES | tolerance


def test_a_lab_says_its_noise_for_the_calls_that_have_a_baseline(folder: Path, capsys: Captured) -> None:
    (folder / "urmpipe.toml").write_text("noise = {axis = '2um'}")
    assert compare("good.csv", "-q", "-o", "a.rrd") == 0
    assert run(["compare", "a.rrd", "--baseline", "a.rrd", "--json"]) == 0
    noise = json.loads(capsys.readouterr().out)["baseline"]["noise"]
    assert noise == {"axis": 2e-6, **dict.fromkeys(("norm", "path", "angle", "joint"), 1e-6)}


def test_a_table_that_is_no_tolerance_is_refused(folder: Path, capsys: Captured) -> None:
    (folder / "urmpipe.toml").write_text("tolerance = {roll = 1, axis = {x = 1}}")
    assert compare("good.csv", "-q") == 2
    assert capsys.readouterr().err.splitlines() == [
        f"error: {folder}/urmpipe.toml: key tolerance: found 'roll=1', {ALLOWED}",
        f"""error: {folder}/urmpipe.toml: key tolerance: found "axis={{'x': '1'}}", {ALLOWED}""",
    ]


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


def test_an_output_is_no_input_and_no_other_output(capsys: Captured) -> None:
    assert compare("good.csv", "--csv", "good.csv", "-q") == 2
    assert said(capsys) == (
        "error: good.csv: found an input of this command, allowed: any other name for the table of statistics"
    )
    assert compare("good.csv", "--csv", "a", "--junit", "./a", "-q") == 2
    assert said(capsys) == "error: found a as junit and as statistics; allowed: a name for each"
    assert names() == {"a"}
    assert [one.text for one in ET.parse("a").iter("error")] == [
        "found a as junit and as statistics; allowed: a name for each"
    ]


def test_errors_replace_neither_an_operand_nor_a_file_of_another(folder: Path) -> None:
    assert compare("good.csv", "-q", "--junit", "v.xml") == 0
    (folder / "other.xml").write_text("<testsuites/>")
    before = {name: (folder / name).read_bytes() for name in ("v.xml", "other.xml")}
    for wrong in (["v.xml", "--junit", "v.xml"], ["v.xml", "--junit=./v.xml"], ["--junit=other.xml"]):
        assert run(["compare", "wanted.csv", "--nosuch", *wrong]) == 2
    assert {name: (folder / name).read_bytes() for name in before} == before
    (folder / "urmpipe.toml").write_text("robot = ur5e")
    assert run(["compare", "wanted.csv", "good.csv", "-q", "--junit=v.xml"]) == 2
    (error,) = ET.parse("v.xml").iter("error")
    assert f"{folder / 'urmpipe.toml'}:1: not valid TOML" in str(error.text)


@pytest.mark.slow
@pytest.mark.parametrize("flags", [("-q",), ("-q", "--json")])
def test_a_quiet_failure_says_why_in_one_place(capsys: Captured, flags: tuple[str, ...]) -> None:
    assert compare("good.csv", *flags) == 0
    assert capsys.readouterr().err == ""
    assert compare("bad.csv", *flags) == 1
    out, err = capsys.readouterr()
    assert bool(out) == ("--json" in flags)
    said = "FAIL  bad out of tolerance against wanted, by the joints on both sides"
    assert err.startswith(f"{said}\n      Furthest out: bad\n      Decided by: |Δ")
    assert all(line.startswith("      ") for line in err.splitlines()[1:])


def test_a_path_held_against_a_log_is_not_said_to_have_joints(capsys: Captured) -> None:
    rows = "".join(f"{0.01 * k:.2f},0.3,{0.001 * k:.3f},0.4\n" for k in range(40))
    Path("asked.csv").write_text("t,x [m],y [m],z [m]\n" + rows, encoding="utf-8")
    assert run(["compare", "good.csv", "asked.csv", "--robot", "ur5e"]) == 1
    first = capsys.readouterr().out.splitlines()[0]
    said = "FAIL  asked out of tolerance against good, by the joints of the reference"
    assert first == (
        f"{said}; coverage 39.5 % of 90 % needed, longest unseen: 0.600 s from t = 0.395 s of the reference"
    )
    assert run(["compare", "asked.csv", "good.csv", "--robot", "ur5e"]) == 1
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("FAIL  good out of tolerance against asked; judged 15.1 % of 50 % needed,")


def test_tolerances_add_up(capsys: Captured) -> None:
    assert compare("good.csv", "--tolerance", "axis=1mm", "--tolerance", "norm=2mm", "--json") == 0
    assert json.loads(capsys.readouterr().out)["tolerance"] == {"axis": 0.001, "norm": 0.002, **MIN_SHARES}
    assert compare("good.csv", "--tolerance", "axis=1mm", "--tolerance", "axis=2mm") == 2


@pytest.mark.parametrize("offset", ["0.2", "200ms", "0.2 s", "-200 ms"])
def test_an_offset_of_clocks_may_have_its_unit(offset: str) -> None:
    seconds = SYNC.read(offset)
    assert abs(seconds) == 0.2
    assert (seconds < 0.0) == offset.startswith("-")


def test_results_are_operands_of_the_function() -> None:
    before = urmpipe.compare("wanted.csv", ["good.csv"], robot="ur5e")
    now = urmpipe.compare(before, baseline=before, noise=0.0, junit="v.xml", csv="v.csv")
    assert now.verdict == "pass"
    assert now.baseline is not None
    assert (now.baseline.worse, now.baseline.noise["axis"]) == ((), 0.0)
    assert names() == {"v.xml", "v.csv"}
    with pytest.raises(OptionError) as error:
        urmpipe.compare(before)
    wanted = "found a comparison as the reference, allowed: with a baseline, and without logs"
    assert str(error.value) == wanted
    with pytest.raises(OptionError) as error:
        urmpipe.compare(before, baseline=before, output="a.rrd")
    assert str(error.value) == "output (--output): found a.rrd with an existing comparison, allowed: without"


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


def test_all_that_is_wrong_with_any_log_is_told_at_once(capsys: Captured) -> None:
    assert compare("no.csv", "good.csv", "none.csv", "none.csv") == 2
    assert capsys.readouterr().err.splitlines() == [
        "error: no.csv: found no such file",
        "error: none.csv: found no such file",
    ]
    t = 0.005 * np.arange(200)
    for name in ("still", "rest"):
        write_log(f"{name}.csv", t, np.full((200, 6), 0.5))
    assert compare("still.csv", "good.csv", "rest.csv", "--sync", "auto") == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert [line.split(":")[1] for line in errors] == [" still.csv", " rest.csv"]
    assert all("sync (--sync): auto: found no motion of the joints in this log" in line for line in errors)


def test_strict_names_the_log_of_each_warning(capsys: Captured) -> None:
    for name in ("good", "slack"):
        lines = Path(f"{name}.csv").read_text().splitlines()
        Path(f"{name}.csv").write_text("\n".join([lines[0].replace(" [rad]", ""), *lines[1:]]))
    assert compare("good.csv", "slack.csv", "--strict") == 2
    said = "no unit is given for q1, q2, q3, q4, q5, q6: the joints are taken as rad; --unit deg"
    assert capsys.readouterr().err.splitlines() == [
        "error: strict (--strict): found 2 warnings, allowed: none",
        *(f"error: {name}: {said} overrides this" for name in ("good", "slack")),
    ]
