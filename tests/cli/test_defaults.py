"""urmpipe.toml, maps and --explain on the command line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from urmpipe import read_recording
from urmpipe.main import run
from urmpipe_pipeline.comparison.comparison import Comparison

LOG = "t [s],a,b,c,d,e,f\n" + "".join(f"{k * 0.005},{k},1,2,3,4,5\n" for k in range(20))

INGEST = ("ingest", "log.csv", "--unit", "deg", "--joints", "a,b,c,d,e,f")

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A lab's folder, with one log in a folder of it, which is the working one."""
    work = tmp_path / "lab" / "today"
    work.mkdir(parents=True)
    (work / "log.csv").write_text(LOG)
    monkeypatch.chdir(work)
    return work.parent


def result(capsys: Captured) -> dict[str, object]:
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_defaults_of_a_folder_above_hold_and_are_told(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text('robot = "ur5e"\nunit = ["deg"]\n[ingest]\nstrict = true\n')
    assert run(["ingest", "log.csv", "--json"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["robot"], found["units"]["a"]) == ("ur5e", "deg")
    assert err == f"note: defaults of {lab}/urmpipe.toml: robot=ur5e, unit=deg, strict=true\n"


def test_of_an_option_in_several_files_the_nearest_decides(lab: Path, capsys: Captured) -> None:
    upper, nearer = lab / "urmpipe.toml", lab / "today" / "urmpipe.toml"
    upper.write_text('robot = "ur5e"\nunit = "deg"\n[ingest]\ntsp = "10ms"\nstrict = true\n')
    nearer.write_text('robot = "ur10"\ntsp = "5ms"\n')
    assert run(["ingest", "log.csv", "--json"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["robot"], found["tsp"], found["units"]["a"]) == ("ur10", 0.005, "deg")
    assert err.splitlines() == [
        f"note: defaults of {nearer}: robot=ur10, tsp=5ms",
        f"note: defaults of {upper}: unit=deg, strict=true",
    ]


def test_each_error_names_the_file_that_it_is_in(lab: Path, capsys: Captured) -> None:
    upper, nearer = lab / "urmpipe.toml", lab / "today" / "urmpipe.toml"
    upper.write_text("tsp = true\n")
    nearer.write_text("strict = 1\n")
    assert run(["ingest", "log.csv", "-q"]) == 2
    assert capsys.readouterr().err == (
        f"error: {upper}: key tsp: found true, allowed: a positive time in s, such as 0.005 or 5ms\n"
        f"error: {nearer}: key strict: found 1, allowed: true or false\n"
    )
    upper.write_text("tsp = -1\n")
    nearer.write_text('robot = "ur10"\n')
    assert run(["ingest", "log.csv", "-q"]) == 2
    said = "key tsp: found '-1', allowed: a positive time in s, such as 0.005 or 5ms"
    assert capsys.readouterr().err == f"error: {upper}: {said}\n"


def test_everything_that_is_wrong_with_it(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text('robt = "ur5e"\n[compare]\ntolrance = 0.1\n')
    assert run(["ingest", "log.csv"]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith(f"error: {lab}/urmpipe.toml: key robt: unknown (did you mean robot?); allowed: ")
    assert "key compare.tolrance: unknown (did you mean tolerance?); allowed: " in second


@pytest.mark.slow
def test_options_of_logs_are_refused_with_recordings_alone(lab: Path, capsys: Captured) -> None:
    assert run([*INGEST, "-q", "--robot", "ur5e"]) == 0
    both = ["compare", "log.rrd", "log.rrd", "--unit", "rad", "--repair"]
    assert run(both) == 2
    assert (
        "--unit, --repair: found with recordings only (log.rrd, log.rrd), allowed: "
        in capsys.readouterr().err
    )
    mixed = ["compare", "log.rrd", "log.csv", "--robot", "ur5e", "--unit", "deg", "--joints", "a,b,c,d,e,f"]
    assert run(mixed) == 0
    assert (
        "note: --joints, --unit applied to the logs only: log.rrd used as ingested\n"
        in capsys.readouterr().err
    )
    (lab / "urmpipe.toml").write_text("unit = 'deg'\n")
    assert run(["compare", "log.rrd", "log.rrd", "-q"]) == 0


def limited_by_git(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / ".git").mkdir()


def limited_by_home(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setenv("USERPROFILE", str(folder))


def limited_by_owner(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not hasattr(os, "getuid") or os.getuid() != 0:
        pytest.skip("giving a folder to another user needs root")
    os.chown(folder.parent, 12345, -1)


@pytest.mark.parametrize("limit", [limited_by_git, limited_by_home, limited_by_owner])
def test_files_are_looked_for_up_to_the_own_folders(
    lab: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch, limit: Callable[..., None]
) -> None:
    (lab.parent / "urmpipe.toml").write_text('tsp = "10ms"\n')
    (lab / "urmpipe.toml").write_text('robot = "ur5e"\nunit = "deg"\n')
    assert run(["ingest", "log.csv", "--json"]) == 0
    assert result(capsys)["tsp"] == 0.01
    limit(lab, monkeypatch)
    assert run(["ingest", "log.csv", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["tsp"] == 0.005
    assert err == f"note: defaults of {lab}/urmpipe.toml: robot=ur5e, unit=deg\n"


@pytest.mark.skipif(os.name != "posix", reason="POSIX alone has these modes")
@pytest.mark.parametrize(("mode", "who"), [(0o664, "its group"), (0o646, "all users"), (0o644, "its owner")])
def test_a_file_that_others_may_write_is_a_warning(lab: Path, capsys: Captured, mode: int, who: str) -> None:
    path = lab / "urmpipe.toml"
    path.write_text('robot = "ur5e"\nunit = "deg"\n')
    path.chmod(mode)
    if who != "all users":
        if os.getuid() != 0:
            pytest.skip("giving a file to another user or group needs root")
        os.chown(path, *((12345, -1) if who == "its owner" else (-1, 12345)))
        who += " (user 12345)" if who == "its owner" else ""
    said = f"{path}: {who} may write it: the defaults in it may be those of others"
    for command in (["ingest", "log.csv"], ["compare", "log.csv", "log.csv"]):
        assert run(command) == 0
        assert f"warning: {said}\n" in capsys.readouterr().err
    assert run(["ingest", "log.csv", "--strict"]) == 2
    assert f"error: {said}\n" in capsys.readouterr().err
    assert run(["compare", "log.csv", "--strict", "--help"]) == 0
    os.chown(path, os.getuid(), os.getgid())
    path.chmod(0o664 if path.group() == path.owner() else 0o644)
    assert run(["ingest", "log.csv"]) == 0
    assert "may write it" not in capsys.readouterr().err  # its group is its owner's alone


def test_the_line_of_a_verdict_names_the_file_that_sets_what_decides_it(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text(
        'robot = "ur5e"\nunit = "deg"\nskip-bad = true\n[compare]\ntolerance = {axis = "9mm"}\n'
        'sync = "start"\n[diagnose]\ntolerance = "8mm"\n'
    )
    (lab / "today" / "urmpipe.toml").write_text('[compare]\nalign = "start"\nsync = "auto"\n')
    given = ["compare", "log.csv", "log.csv", "--sync", "0", "-o", "v.rrd"]
    assert run(given) == 0
    upper = "; skip-bad=true, tolerance=axis=9mm from ../urmpipe.toml"
    line = f"; align=start from urmpipe.toml{upper}"
    assert capsys.readouterr().out.splitlines()[0].endswith(line)
    made = read_recording("v.rrd")
    assert isinstance(made, Comparison)
    assert made.provenance.defaults == tuple(line.removeprefix("; ").split("; "))
    assert run(["report", "v.rrd", "-o", "v.html"]) == 0
    assert line in Path("v.html").read_text(encoding="utf-8")
    capsys.readouterr()
    assert run(["diagnose", "log.csv", "log.csv"]) == 0
    assert "; skip-bad=true, tolerance=8mm from ../urmpipe.toml\n" in capsys.readouterr().out
