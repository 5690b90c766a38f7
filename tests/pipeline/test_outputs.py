"""Outputs are written completely or not at all; where they may be written is in outputs.cases."""

from __future__ import annotations

import os
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import urmpipe_pipeline.recording  # noqa: F401 - registers the check of its files
from urmpipe_models.errors import OutputError
from urmpipe_pipeline.outputs import OutputKind, atomic_group, safe_output

REPORT = '<!doctype html>\n<html lang="en"><head>\n<meta name="generator" content="urmpipe 0.1.0">\n'


def write(path: Path, inputs: tuple[Path, ...] = (), kind: OutputKind = "report") -> None:
    with safe_output(path, inputs, kind) as part:
        part.write_text("new")


def refusal(path: Path, *inputs: Path, kind: OutputKind = "report") -> str:
    with pytest.raises(OutputError) as caught:
        write(path, inputs, kind)
    return str(caught.value)


@pytest.fixture
def report(tmp_path: Path) -> Path:
    """A report of ours, which may be replaced."""
    path = tmp_path / "report.html"
    path.write_text(REPORT)
    return path


def test_an_output_has_the_usual_permissions_or_those_of_the_file_it_replaces(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    (tmp_path / "plain").write_text("")
    write(path)
    assert path.stat().st_mode == (tmp_path / "plain").stat().st_mode
    path.write_text(REPORT)
    path.chmod(0o640)
    write(path)
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == (0o640 if sys.platform != "win32" else 0o666)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_recording_has_a_name_that_rerun_can_open(tmp_path: Path) -> None:
    for path in (tmp_path / "bad\udcff.rrd", tmp_path / "bad\udcff" / "run.rrd"):
        path.parent.mkdir(exist_ok=True)
        assert "found a name that is not UTF-8 text, which Rerun cannot open" in refusal(
            path, kind="recording"
        )


@pytest.mark.skipif(sys.platform == "win32", reason="Windows lets only administrators make links")
def test_an_input_is_not_replaced_through_a_link(tmp_path: Path, report: Path) -> None:
    (tmp_path / "soft.html").symlink_to(report)
    (tmp_path / "hard.html").hardlink_to(report)
    for name in ("soft.html", "hard.html"):
        for path, source in ((tmp_path / name, report), (report, tmp_path / name)):
            assert refusal(path, source).endswith(
                "found an input of this command, allowed: any other name for the report"
            )


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="there is no /dev/null here")
def test_a_device_is_not_replaced() -> None:
    assert "found a file that is not a report of urmpipe" in refusal(Path("/dev/null"))


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ZeroDivisionError(), ""),
        (OSError(28, "No space left on device"), "cannot be written: No space left on device"),
        (None, "cannot be written: No such file or directory"),  # the writer wrote nothing
    ],
)
def test_a_failing_writer_leaves_what_is_there(
    tmp_path: Path, report: Path, error: Exception | None, message: str
) -> None:
    with pytest.raises((ZeroDivisionError, OutputError)) as caught, safe_output(report, (), "report") as part:
        if error:
            part.write_text("half")
            raise error
    assert str(caught.value) == (f"{report}: {message}" if message else "")
    assert [(file, file.read_text()) for file in tmp_path.iterdir()] == [(report, REPORT)]


def test_of_a_group_all_outputs_get_their_names_or_none(tmp_path: Path, report: Path) -> None:
    """The folder of the second output is removed while it is written: the first has its old content again."""
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match=r"other\.html: cannot be written: No such file"), atomic_group():
        write(report)
        write(tmp_path / "folder" / "other.html")
        assert report.read_text() == REPORT
        shutil.rmtree(tmp_path / "folder")
    assert [(file, file.read_text()) for file in tmp_path.iterdir()] == [(report, REPORT)]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_is_one_line(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        assert refusal(tmp_path / "report.html").endswith("cannot be written: Permission denied")
    finally:
        tmp_path.chmod(0o700)


def test_two_writers_of_one_output_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    with ThreadPoolExecutor() as pool, safe_output(path, (), "report") as part:
        part.write_text(REPORT)
        pool.submit(write, path).result()
        assert path.read_text() == "new"
    assert [(file, file.read_text()) for file in tmp_path.iterdir()] == [(path, REPORT)]
