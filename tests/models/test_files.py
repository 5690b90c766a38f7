"""Files that are not there, and what may have been meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from urmpipe_models.files import suggest_path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with some files, which is the working folder."""
    for name in ("log.csv", "log.rrd", "notes.md", "Motion.CSV", ".hidden.csv", "arm.v2.txt"):
        (tmp_path / name).touch()
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "phi1.csv").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("asked", "meant"),
    [
        ("log", "log.csv or log.rrd"),
        ("log.csv.gz", "log.csv or log.rrd"),
        ("log.txt", "log.csv or log.rrd"),
        ("LOG.CSV", "log.csv"),
        ("motion.csv", "Motion.CSV"),
        ("moton.csv", "Motion.CSV"),
        ("lgo.csv", "log.csv or log.rrd"),
        ("arm.csv", "arm.v2.txt"),
        ("plot", "plots"),
        ("plots/phi.csv", "plots/phi1.csv"),
        ("./note", "notes.md"),
    ],
)
def test_what_may_be_meant_is_asked(folder: Path, asked: str, meant: str) -> None:
    assert suggest_path(Path(asked)) == f" (did you mean {meant}?)"


def test_of_several_those_of_the_kind_are_meant(folder: Path) -> None:
    assert suggest_path(Path("log"), (".rrd",)) == " (did you mean log.rrd?)"
    assert suggest_path(Path("note"), (".rrd",)) == " (did you mean notes.md?)"
    for k in range(5):
        (folder / f"run.{k}").touch()
    assert suggest_path(Path("run.csv")) == " (did you mean run.0 or run.1 or run.2?)"


@pytest.mark.parametrize("asked", ["targets.csv", "hidden.csv", "*.csv", "plots/path.csv", "notes.md/x"])
def test_nothing_is_asked_where_no_name_is_like_it(folder: Path, asked: str) -> None:
    assert "did you mean" not in suggest_path(Path(asked))


def test_a_missing_folder_is_told_with_the_one_above_it(folder: Path) -> None:
    assert suggest_path(Path("data/raw/log.csv")) == f": {folder} has no folder data"
    assert suggest_path(Path("plot/raw/log.csv")) == f": {folder} has no folder plot (did you mean plots?)"
    assert suggest_path(Path("plots/raw/log.csv")) == ": plots has no folder raw"
    assert suggest_path(folder / "raw" / "log.csv") == f": {folder} has no folder raw"


def test_a_link_to_nothing_is_not_meant_by_its_own_name(folder: Path) -> None:
    link = folder / "gone.csv"
    try:
        link.symlink_to(folder / "nothing.csv")
    except OSError:
        pytest.skip("no links can be made here")
    assert suggest_path(Path("gone.csv")) == ""
