"""What compare writes: JSON, JUnit, CSV and recording agree; permissions and names of files."""

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

import pytest

from four_logs import log_text
from urmpipe.main import run
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.results import read_recording


@pytest.fixture(autouse=True)
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a reference and logs within tolerance and out of it."""
    monkeypatch.chdir(tmp_path)
    for name, off in (("wanted", 0.0), ("good", 0.0005), ("bad", 0.02)):
        Path(f"{name}.csv").write_text(log_text(off), encoding="utf-8")


def recorded(name: str) -> Comparison:
    result = read_recording(Path(name))
    assert isinstance(result, Comparison)
    return result


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
def test_json_csv_junit_and_recording_agree_bit_for_bit(capsys: pytest.CaptureFixture[str]) -> None:
    line = "compare wanted.csv good.csv bad.csv --robot ur5e --csv a.csv --junit a.xml -o a.rrd --json"
    assert run([*line.split(), "--tolerance", "axis=3.5mm,norm=5mm,path=3mm,angle=0.5deg,joint=2mrad"]) == 1
    in_json = json.loads(capsys.readouterr().out)["runs"]
    with Path("a.csv").open(encoding="utf-8", newline="") as file:
        rows = {(row["run"], row["kind"], row["quantity"]): row for row in csv.DictReader(file)}
    suites = {suite.get("name"): suite for suite in ET.parse("a.xml").getroot()}
    for one, answer in zip(recorded("a.rrd").runs, in_json, strict=True):
        properties = {p.attrib["name"]: p.attrib["value"] for p in suites[one.name].iter("property")}
        for statistics in one.all_statistics:
            kept = statistics.to_dict()
            assert kept == (answer | answer["delta"] | answer["joints"])[statistics.quantity]
            prefix = f"{'joint ' if statistics.kind == 'joint' else ''}{statistics.quantity}"
            for field, value in kept.items():
                text = "" if value is None else value if isinstance(value, str) else repr(value)
                assert rows[one.name, statistics.kind, statistics.quantity][field] == text
                assert properties[f"{prefix}.{field}"] == text
    failed = [case for case in ET.parse("a.xml").iter("testcase") if len(case)]
    assert [row["verdict"] for row in rows.values()].count("fail") == len(failed)
    assert {(one.get("classname"), one[0].get("type")) for one in failed} == {("bad", "out-of-tolerance")}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only there may a file name hold any bytes")
def test_a_log_whose_name_is_no_text_is_compared_recorded_and_reported() -> None:
    Path("good.csv").rename("gut\udcfc.csv")
    assert run(["compare", "wanted.csv", "gut\udcfc.csv", "--robot", "ur5e", "-q"]) == 0
    assert recorded("gut\ufffd-against-wanted.rrd").runs[0].name == "gut\udcfc"
    assert run(["report", "gut\ufffd-against-wanted.rrd", "-o", "gut.html", "-q"]) == 0
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
