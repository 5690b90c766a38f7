"""Outputs are whole or not there, and replace nothing but an output of ours."""

from __future__ import annotations

import os
import sys
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import urmpipe_pipeline.recording  # each knows its own files
import urmpipe_pipeline.tables  # noqa: F401
from urmpipe_models.errors import OutputError
from urmpipe_pipeline.outputs import OutputKind, safe_output

REPORT = '<!doctype html>\n<html lang="en"><head>\n<meta name="generator" content="urmpipe 0.1.0">\n'


def write(path: Path, text: str = "new", inputs: Sequence[Path] = (), kind: OutputKind = "report") -> None:
    with safe_output(path, inputs, kind) as part:
        assert part.parent == path.parent
        assert part.suffix == ".part"
        assert not part.exists()
        part.write_text(text)


def refusal(path: Path, inputs: Sequence[Path] = (), kind: OutputKind = "report") -> str:
    """Return why an output may not be written, without the file's name; what is there must stay."""
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(OutputError) as caught:
        write(path, inputs=inputs, kind=kind)
    assert (path.read_bytes() if path.is_file() else None) == before
    assert len(caught.value.findings) == 1
    assert caught.value.findings[0].file == str(path)
    return caught.value.findings[0].message


def test_a_new_output_is_written(tmp_path: Path) -> None:
    write(tmp_path / "report.html", inputs=[tmp_path / "log.csv"])
    assert (tmp_path / "report.html").read_text() == "new"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_name_in_the_working_folder_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path("report.html"))
    assert (tmp_path / "report.html").read_text() == "new"


def test_a_very_long_name_is_written(tmp_path: Path) -> None:
    name = "ж" * 120 + ".html"  # 245 of the 255 bytes that a name may have
    write(tmp_path / name)
    assert (tmp_path / name).read_text() == "new"


def test_an_output_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    write(tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_report_of_ours_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(REPORT)
    write(path)
    assert path.read_text() == "new"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<html></html>",
        '<meta name="generator" content="somebody">',
        '<meta name="generator" content="urmpipeline">',
        " " * 4096 + REPORT,
        "content: urmpipe",
    ],
)
def test_a_file_that_is_no_report_of_ours_is_not_replaced(tmp_path: Path, text: str) -> None:
    path = tmp_path / "page.html"
    path.write_text(text)
    wanted = "found a file that is not a report of urmpipe, allowed: a new name, or such a report to replace"
    assert refusal(path) == wanted


def test_an_output_of_the_other_kind_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "report.rrd"
    path.write_text(REPORT)
    wanted = (
        "found a file that is not a recording of urmpipe, allowed: a new name, or such a recording to replace"
    )
    assert refusal(path, kind="recording") == wanted


def test_a_broken_recording_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    path.write_bytes(b"RRF2" + bytes(100))
    wanted = (
        "found a file that is not a recording of urmpipe, allowed: a new name, or such a recording to replace"
    )
    assert refusal(path, kind="recording") == wanted


def test_an_output_that_is_no_export_of_ours_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "run.tum"
    wanted = (
        "found a file that is not an export of urmpipe, allowed: a new name, or such an export to replace"
    )
    path.write_text(REPORT)
    assert refusal(path, kind="export") == wanted
    path.write_text("# urmpipe export: t x y z\n")
    write(path, kind="export")
    assert path.read_text() == "new"


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_recording_has_a_name_that_rerun_can_open(tmp_path: Path) -> None:
    wanted = "found a name that is not UTF-8 text, which Rerun cannot open, allowed: one that is"
    for path in (tmp_path / "bad\udcff.rrd", tmp_path / "bad\udcff" / "run.rrd"):
        path.parent.mkdir(exist_ok=True)
        assert refusal(path, kind="recording") == wanted


@pytest.mark.parametrize(
    ("name", "kind", "meant"),
    [
        *[
            ("run.csv", "recording", "run.rrd"),
            ("a.html", "recording", "a.rrd"),
            ("a.PNG", "drawing", "a.svg"),
        ],
        *[("run", "recording", "run.rrd"), ("v1.2", "recording", "v1.2.rrd"), ("run", "report", "run.html")],
    ],
)
def test_a_name_that_ends_as_those_of_another_kind_is_refused(
    tmp_path: Path, name: str, kind: OutputKind, meant: str
) -> None:
    tables = "; urmpipe export writes tables" if name == "run.csv" else ""
    said = f"found a name that does not fit a {kind}, allowed: {meant}{tables}"
    assert refusal(tmp_path / name, kind=kind) == said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "kind"),
    [("run.RRD", "recording"), ("run.htm", "report"), ("verdict", "junit"), ("log.2", "audit")],
)
def test_a_name_that_no_other_kind_has_is_taken(tmp_path: Path, name: str, kind: OutputKind) -> None:
    write(tmp_path / name, kind=kind)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_folder_is_not_replaced(tmp_path: Path) -> None:
    assert refusal(tmp_path) == "found a folder, allowed: the name of a file for the report"
    assert refusal(Path()) == "found a folder, allowed: the name of a file for the report"


def test_a_missing_folder_is_not_made(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "report.html"
    assert refusal(path) == f"found no folder {path.parent}, allowed: a folder that exists"
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "report.html"
    assert refusal(path) == f"found no folder {path.parent}, allowed: a folder that exists"


INPUT = "found an input of this command, allowed: any other name for the report"


def test_an_input_is_not_replaced_whatever_its_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log.html"
    log.write_text(REPORT)  # even if it is a report of ours
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "sub")
    for path in (log, Path("../log.html"), tmp_path / "sub" / ".." / "log.html"):
        assert refusal(path, inputs=[tmp_path / "missing.csv", log]) == INPUT
        assert refusal(log, inputs=[path]) == INPUT


@pytest.mark.skipif(sys.platform == "win32", reason="Windows lets only administrators make links")
def test_an_input_is_not_replaced_through_a_link(tmp_path: Path) -> None:
    log = tmp_path / "log.html"
    log.write_text(REPORT)
    (tmp_path / "soft.html").symlink_to(log)
    (tmp_path / "hard.html").hardlink_to(log)
    for link in ("soft.html", "hard.html"):
        assert refusal(tmp_path / link, inputs=[log]) == INPUT
        assert refusal(log, inputs=[tmp_path / link]) == INPUT


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="there is no /dev/null here")
def test_a_device_is_not_replaced() -> None:
    wanted = "found a file that is not a report of urmpipe, allowed: a new name, or such a report to replace"
    assert refusal(Path("/dev/null")) == wanted


def test_a_failing_writer_leaves_what_is_there(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(REPORT)
    with pytest.raises(ZeroDivisionError), safe_output(path, (), "report") as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert [(one, one.read_text()) for one in tmp_path.iterdir()] == [(path, REPORT)]


def test_an_error_of_the_file_system_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(REPORT)
    with pytest.raises(OutputError) as caught, safe_output(path, (), "report") as part:
        part.write_text("half")
        raise OSError(28, "No space left on device")
    assert str(caught.value) == f"{path}: cannot be written: No space left on device"
    assert [(one, one.read_text()) for one in tmp_path.iterdir()] == [(path, REPORT)]


def test_a_writer_that_wrote_nothing_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    with pytest.raises(OutputError) as caught, safe_output(path, (), "report"):
        pass
    assert str(caught.value) == f"{path}: cannot be written: No such file or directory"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_is_one_line(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        assert refusal(tmp_path / "report.html") == "cannot be written: Permission denied"
    finally:
        tmp_path.chmod(0o700)


def test_two_writers_of_one_output_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    with ThreadPoolExecutor() as pool, safe_output(path, (), "report") as one:
        one.write_text("one")
        pool.submit(write, path).result()
        assert path.read_text() == "new"
    assert [(file, file.read_text()) for file in tmp_path.iterdir()] == [(path, "one")]


def write_fmu(path: Path, description: str | None, method: int = zipfile.ZIP_DEFLATED) -> None:
    """Write an archive with a model description, or with none."""
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("other.txt", "")
        if description is not None:
            archive.writestr("modelDescription.xml", description)


DESCRIPTION = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<fmiModelDescription fmiVersion="2.0" modelName="chain" generationTool="urmpipe 0.1.0" guid="1">'
)


def test_an_fmu_of_ours_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "chain.fmu"
    write_fmu(path, DESCRIPTION)
    write(path, kind="fmu")
    assert path.read_text() == "new"


@pytest.mark.parametrize(
    "description",
    [
        None,
        DESCRIPTION.replace("urmpipe", "Dymola"),
        DESCRIPTION.replace("urmpipe 0.1.0", "urmpipeline"),
        DESCRIPTION.replace("generationTool", "author"),
        '<fmiModelDescription modelName="chain"><!-- generationTool="urmpipe 0.1.0" -->',
    ],
)
def test_an_fmu_of_another_tool_is_not_replaced(tmp_path: Path, description: str | None) -> None:
    path = tmp_path / "chain.fmu"
    write_fmu(path, description)
    assert refusal(path, kind="fmu") == (
        "found a file that is not an FMU of urmpipe, allowed: a new name, or such an FMU to replace"
    )


def test_an_fmu_that_cannot_be_read_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "chain.fmu"
    write_fmu(path, DESCRIPTION)
    whole = path.read_bytes()
    for broken in (b"", b"no archive", whole[: len(whole) // 2], whole.replace(b"\x08\x00", b"\x63\x00")):
        path.write_bytes(broken)
        assert "found a file that is not an FMU of urmpipe" in refusal(path, kind="fmu")


def test_a_drawing_of_ours_is_replaced_and_another_is_not(tmp_path: Path) -> None:
    path = tmp_path / "system.svg"
    path.write_text("<!-- Generator: urmpipe 0.1.0 -->\n<svg/>")
    write(path, kind="drawing")
    path.write_text("<svg/>")
    assert refusal(path, kind="drawing") == (
        "found a file that is not a drawing of urmpipe, allowed: a new name, or such a drawing to replace"
    )
