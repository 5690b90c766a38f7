"""docs/ci.md against the code: its jobs are YAML, their commands run, and give what the page says."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
import yaml

from pages import lay_files, run_in_process, snippets, text_of

PAGE = "docs/ci.md"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that pages name."""
    lay_files(tmp_path, monkeypatch)
    return tmp_path


def jobs() -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the job of GitLab, and that of GitHub."""
    blocks = re.findall(r"^```yaml\n(.*?)^```$", text_of(PAGE), re.DOTALL | re.MULTILINE)
    gitlab, github = map(yaml.safe_load, blocks)
    return gitlab["verdict"], github["jobs"]["verdict"]


def commands() -> list[str]:
    """Return the commands of urmpipe of both jobs."""
    gitlab, github = jobs()
    lines = [*gitlab["script"], *gitlab["after_script"], *(step.get("run", "") for step in github["steps"])]
    return [line for line in lines if line.startswith("urmpipe ")]


@pytest.mark.slow
def test_both_jobs_run_the_same_and_keep_what_they_write(folder: Path) -> None:
    compare, report, *of_github = commands()
    assert of_github == [compare, report]
    assert (run_in_process(compare), run_in_process(report)) == (0, 0)
    gitlab, _ = jobs()
    kept = {*gitlab["artifacts"]["paths"], gitlab["artifacts"]["reports"]["junit"]}
    assert kept == {path.name for path in folder.glob("verdict.*")}


@pytest.mark.slow
def test_each_exit_code_leaves_the_junit_file_that_the_page_says(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    compare = commands()[0]
    assert run_in_process(compare) == 0
    assert capsys.readouterr() == ("", "")
    recording = (folder / "verdict.rrd").read_bytes()
    found = {}
    for code, line in ((1, compare.replace("3.5mm", "1um")), (2, f"{compare} --joints q9")):
        assert run_in_process(line) == code
        root = ET.parse(folder / "verdict.xml").getroot()
        found[code] = (root.get("failures") != "0", root.get("errors") != "0")
        assert capsys.readouterr().err.startswith(("", "FAIL  log out of tolerance", "error: ")[code])
        assert ((folder / "verdict.rrd").read_bytes() == recording) == (code == 2)
        recording = (folder / "verdict.rrd").read_bytes()
    assert found == {1: (True, False), 2: (False, True)}


def run_script(folder: Path, script: str) -> int:
    """Run a script of the page in the folder, as a job does, and return its exit code."""
    shim = folder / "bin" / "urmpipe"
    shim.parent.mkdir(exist_ok=True)
    shim.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m urmpipe "$@"\n')
    shim.chmod(0o755)
    path = os.pathsep.join([str(shim.parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(["sh", "-e", "-c", script], cwd=folder, env=environment, check=False).returncode


@pytest.mark.slow
def test_a_night_judges_all_that_it_can_and_keeps_the_worst_exit_code(folder: Path) -> None:
    (jobs,) = snippets(PAGE, "text")
    (folder / "jobs.txt").write_text(jobs, encoding="utf-8")
    (folder / "accepted").mkdir()
    compare = "urmpipe compare path.csv a.csv coppelia.csv --robot urm6 -q -o accepted/urm6.rrd"
    assert run_in_process(compare) == 0
    (folder / "coppelia.csv").unlink()
    night, _ = snippets(PAGE, "sh")
    assert run_script(folder, night) == 2
    found = {
        path.name: [
            (case.get("classname"), [one.tag for one in case]) for case in ET.parse(path).iter("testcase")
        ]
        for path in sorted((folder / "night").glob("*.xml"))
    }
    assert list(found) == ["ur5e.xml", "urm6.xml"]
    assert {("a", ()), ("a against baseline", ()), ("coppelia", ("error",))} == {
        (name, tuple(tags)) for name, tags in found["urm6.xml"]
    }
    assert {tuple(tags) for _, tags in found["ur5e.xml"]} == {()}
    page = (folder / "night" / "report.html").read_text(encoding="utf-8")
    assert "coppelia.csv" in page
    assert "found no such file" in page


@pytest.mark.slow
def test_a_first_run_needs_no_baseline_and_a_later_one_is_held_against_it(folder: Path) -> None:
    _, script = snippets(PAGE, "sh")
    assert run_script(folder, script) == 0
    (folder / "released.rrd").write_bytes((folder / "verdict.rrd").read_bytes())
    path = folder / "path.csv"
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    moved = [[t, x, y, str(float(z) + 0.0005), *more] for t, x, y, z, *more in cells]  # by half a millimetre
    path.write_text("\n".join([head, *map(",".join, moved)]) + "\n", encoding="utf-8")
    assert run_script(folder, script) == 1
    types = {one.get("type") for one in ET.parse(folder / "verdict.xml").iter("failure")}
    assert types == {"worse-than-baseline"}


@pytest.mark.slow
def test_the_defaults_of_the_page_are_those_of_a_call(folder: Path) -> None:
    (defaults,) = snippets(PAGE, "toml")
    (folder / "urmpipe.toml").write_text(defaults, encoding="utf-8")
    assert run_in_process("urmpipe compare path.csv log.csv -q -o a.rrd") == 0
    assert run_in_process("urmpipe compare a.rrd --baseline a.rrd -q") == 0
