"""Which urmpipe.toml is read: up to the own folders, with a warning if others may write it."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from urmpipe.main import run

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A lab's folder with defaults, with a log in a folder of it, which is the working folder."""
    work = tmp_path / "lab" / "today"
    work.mkdir(parents=True)
    rows = "".join(f"{k * 0.005},{k},1,2,3,4,5\n" for k in range(20))
    (work / "log.csv").write_text("t [s],q1,q2,q3,q4,q5,q6\n" + rows)
    (work.parent / "urmpipe.toml").write_text('robot = "ur5e"\nunit = "deg"\n')
    monkeypatch.chdir(work)
    return work.parent


@pytest.mark.parametrize("limit", ["repository", "home", "owner"])
def test_files_are_looked_for_up_to_the_own_folders(
    lab: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch, limit: str
) -> None:
    (lab.parent / "urmpipe.toml").write_text('tsp = "10ms"\n')
    assert run(["ingest", "log.csv", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tsp"] == 0.01
    if limit == "repository":
        (lab / ".git").mkdir()
    elif limit == "home":
        monkeypatch.setenv("HOME", str(lab))
        monkeypatch.setenv("USERPROFILE", str(lab))
    elif not hasattr(os, "getuid") or os.getuid() != 0:
        pytest.skip("giving a folder to another user needs root")
    else:
        os.chown(lab.parent, 12345, -1)
    assert run(["ingest", "log.csv", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["tsp"] == 0.005
    assert err == f"note: defaults of {lab}/urmpipe.toml: robot=ur5e, unit=deg\n"


@pytest.mark.skipif(os.name != "posix", reason="POSIX alone has these modes")
@pytest.mark.parametrize(("mode", "who"), [(0o664, "its group"), (0o646, "all users"), (0o644, "its owner")])
def test_a_file_that_others_may_write_is_a_warning(lab: Path, capsys: Captured, mode: int, who: str) -> None:
    path = lab / "urmpipe.toml"
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
