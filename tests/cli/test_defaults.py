"""urmpipe.toml, maps and --explain on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from urmpipe.main import run
from urmpipe.options import FORMS
from urmpipe_models import orientation

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


def test_the_forms_are_those_of_the_models() -> None:
    assert tuple(FORMS) == orientation.FORMS


def test_defaults_of_a_folder_above_hold_and_are_told(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text('robot = "ur5e"\nunit = ["deg"]\n[ingest]\nstrict = true\n')
    assert run(["ingest", "log.csv", "--json"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["robot"], found["units"]["a"]) == ("ur5e", "deg")
    assert err == f"defaults of {lab}/urmpipe.toml: robot=ur5e, unit=deg, strict=true\n"


def test_the_command_line_comes_before_the_defaults(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text('robot = "ur5e"\nunit = "deg"\ntsp = "10ms"\n')
    assert run(["ingest", "log.csv", "--json", "--robot", "urm6", "--unit", "rad"]) == 0
    found = result(capsys)
    assert (found["robot"], found["tsp"]) == ("urm6", 0.01)
    assert found["units"]["a"] == "rad"  # type: ignore[index]


def test_the_nearest_file_is_taken(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text('robot = "ur5e"\n')
    (lab / "today" / "urmpipe.toml").write_text('robot = "ur10"\nunit="deg"\n')
    assert run(["ingest", "log.csv", "--json"]) == 0
    assert result(capsys)["robot"] == "ur10"


def test_files_in_it_are_seen_from_its_folder(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text('map = "maps/lab.toml"\n')
    (lab / "maps").mkdir()
    (lab / "maps" / "lab.toml").write_text('robot = "ur3"\n[units]\nb = "deg"\n')
    assert run(["ingest", "log.csv", "--json"]) == 0
    assert result(capsys)["robot"] == "ur3"


def test_everything_that_is_wrong_with_it(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text('robt = "ur5e"\n[compare]\ntolrance = 0.1\n')
    assert run(["ingest", "log.csv"]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith(f"error: {lab}/urmpipe.toml: key robt: unknown (did you mean robot?); allowed: ")
    assert "key compare.tolrance: unknown (did you mean tolerance?); allowed: " in second


def test_a_value_that_makes_no_sense_is_refused_as_on_the_command_line(lab: Path, capsys: Captured) -> None:
    (lab / "urmpipe.toml").write_text("tsp = -1\n")
    assert run(["ingest", "log.csv"]) == 2
    assert "found '-1', allowed: a positive time in s, such as 0.005 or 5ms" in capsys.readouterr().err


def test_explain_prints_alternatives_and_writes_nothing(lab: Path, capsys: Captured) -> None:
    assert run([*INGEST, "--explain"]) == 0
    out = capsys.readouterr().out
    assert "Otherwise" in out
    assert "--delimiter CHAR" in out
    assert sorted(path.name for path in Path.cwd().iterdir()) == ["log.csv"]


def test_a_map_that_was_written_reads_the_next_log(lab: Path, capsys: Captured) -> None:
    assert (
        run(
            [
                "ingest",
                "log.csv",
                "--robot",
                "ur5e",
                "--unit",
                "deg",
                "--tool",
                "0,0,0.1",
                "--write-map",
                "m.toml",
            ]
        )
        == 0
    )
    assert "Map: m.toml  (use it: urmpipe ingest LOG --map m.toml)" in capsys.readouterr().out
    Path("next.csv").write_text(LOG)
    assert run(["ingest", "next.csv", "--map", "m.toml", "--strict", "--json"]) == 0
    found = result(capsys)
    assert found["robot"] == "ur5e"
    assert found["joints"] == list("abcdef")
    assert found["units"] == {"t": "s", **dict.fromkeys("abcdef", "deg")}
    assert not found["warnings"]


def test_a_map_replaces_only_a_map(lab: Path, capsys: Captured) -> None:
    assert run([*INGEST, "-q", "--write-map", "log.csv"]) == 2
    assert capsys.readouterr().err.startswith("error: log.csv: found an input of this command, allowed: ")
    Path("notes.toml").write_text("mine = 1\n")
    assert run([*INGEST, "-q", "--write-map", "notes.toml"]) == 2
    assert "found a file that is no map of urmpipe's" in capsys.readouterr().err
    assert Path("notes.toml").read_text() == "mine = 1\n"
    for _ in range(2):
        assert run([*INGEST, "-q", "--write-map", "m.toml"]) == 0
