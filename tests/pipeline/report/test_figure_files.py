"""The figures as files: their names, what they replace, and, drawn by a real Chromium, what is in them."""

from __future__ import annotations

import asyncio
import json
import re
import struct
import sys
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from urmpipe_models.errors import OptionError, OutputError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.report import FigureOptions, headless, write_report
from urmpipe_pipeline.report.figure_files import figure_stem, write_figures
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.results import present

CHROMIUM = Path("/usr/bin/chromium")
SVG = "{http://www.w3.org/2000/svg}"


def drawn(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that has a real Chromium draw."""
    there = pytest.mark.skipif(not CHROMIUM.exists(), reason=f"no {CHROMIUM}: apt-get install chromium")
    marked: Callable[..., None] = pytest.mark.slow(there(test))
    return marked


def chunks(png: bytes) -> list[tuple[bytes, bytes]]:
    """The chunks of a PNG with their data, checksums checked."""
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    found, at = [], 8
    while at < len(png):
        (length,) = struct.unpack_from(">I", png, at)
        kind, data = png[at + 4 : at + 8], png[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", png, at + 8 + length) == (zlib.crc32(kind + data),)
        found.append((kind, data))
        at += 12 + length
    return found


@pytest.fixture
def figure() -> Figure:
    spec = {"data": [{"type": "scatter", "x": [0, 1], "y": [0, 1]}], "layout": {"font": {"size": 12}}}
    return Figure("Speed <over> time", "A line.", "It rises & \x01rises.", spec, 240)


@pytest.mark.parametrize(
    ("title", "part", "stem"),
    [
        ("Path in space", "counter_rotating", "counter-rotating-path-in-space"),
        ("Ünïcode / path", "../../etc/passwd", "etc-passwd-unicode-path"),
        ("路径", "路", "figure"),
        ("x" * 90, "y" * 90, f"{'y' * 60}-{'x' * 60}"),
    ],
)
def test_a_name_is_one_that_every_system_takes(title: str, part: str, stem: str) -> None:
    assert figure_stem(title, part) == stem


def test_formats_are_svg_and_png(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"^formats: found pdf, allowed: svg, png, both$"):
        FigureOptions(tmp_path, ("pdf",))  # type: ignore[arg-type]
    with pytest.raises(OptionError, match=r"^formats: found nothing, allowed: svg, png, both$"):
        FigureOptions(tmp_path, ())


def test_a_foreign_file_stays_and_nothing_is_written(figure: Figure, tmp_path: Path) -> None:
    foreign = tmp_path / "log-speed-over-time.svg"
    foreign.write_text("<svg/>")
    with pytest.raises(OutputError) as caught:
        write_figures([("other", figure), ("log", figure)], FigureOptions(tmp_path))
    assert str(caught.value) == (
        f"{foreign}: found a file that is not a figure of urmpipe, allowed: a new name, or such a figure to"
        " replace"
    )
    assert [path.name for path in tmp_path.iterdir()] == [foreign.name]
    assert foreign.read_text() == "<svg/>"


def test_a_file_is_no_folder(figure: Figure, tmp_path: Path) -> None:
    path = tmp_path / "figures"
    path.write_text("mine")
    with pytest.raises(OutputError) as caught:
        write_figures([("log", figure)], FigureOptions(path))
    assert str(caught.value) == f"{path}: figures: found a file, allowed: a folder"


def test_without_kaleido_one_line_says_how_to_install_it(
    figure: Figure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "kaleido", None)
    with pytest.raises(OutputError) as caught:
        write_figures([("log", figure)], FigureOptions(tmp_path / "new" / "figures"))
    assert str(caught.value) == str(headless.NO_KALEIDO)
    assert "pip install 'urmpipe[figures]'" in str(headless.NO_KALEIDO)
    assert list(tmp_path.iterdir()) == []


def test_without_a_browser_one_line_says_so_and_no_report_is_written(
    comparison: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("kaleido")
    monkeypatch.setenv("BROWSER_PATH", str(tmp_path / "nowhere"))
    with pytest.raises(OutputError) as caught:
        write_report(
            [present(comparison)], tmp_path / "report.html", figures=FigureOptions(tmp_path / "figures")
        )
    assert str(caught.value) == str(headless.NO_BROWSER)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def folder(comparison: Comparison, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The figures of one compared log, 3D ones too, beside its report."""
    pytest.importorskip("kaleido")
    folder = tmp_path_factory.mktemp("report") / "figures"
    one = replace(comparison, runs=comparison.runs[:1])
    written = write_report([present(one)], folder.parent / "report.html", figures=FigureOptions(folder))
    assert {file.path for file in written.figures} == set(folder.iterdir())
    assert {file.part for file in written.figures} >= {"shifted"}
    return folder


@drawn
def test_every_figure_of_the_page_has_both_files(folder: Path) -> None:
    page = (folder.parent / "report.html").read_text(encoding="utf-8")
    named = set(re.findall(r'data-name="([\w-]+)"', page))
    assert named
    assert {path.stem for path in folder.glob("*.svg")} == named
    assert {path.stem for path in folder.glob("*.png")} == named


@drawn
def test_an_svg_says_what_it_shows_and_who_drew_it(folder: Path) -> None:
    for path in folder.glob("*.svg"):
        assert path.read_bytes().startswith(b"<!-- Generator: urmpipe ")
        root = ET.parse(path).getroot()
        assert (root.tag, root.get("role"), root.get("width")) == (f"{SVG}svg", "img", "960")
        assert root.findtext(f"{SVG}title")
        assert "shifted" in (root.findtext(f"{SVG}desc") or "")


@drawn
def test_a_png_is_whole_twice_as_fine_and_not_blank(folder: Path) -> None:
    for path in folder.glob("*.png"):
        found = chunks(path.read_bytes())
        assert [kind for kind, _ in found][:4] == [b"IHDR", b"tEXt", b"iTXt", b"iTXt"]
        assert found[1][1].startswith(b"Software\0urmpipe ")
        assert found[-1][0] == b"IEND"
        assert struct.unpack(">I", found[0][1][:4]) == (1920,)
        pixels = zlib.decompress(b"".join(data for kind, data in found if kind == b"IDAT"))
        assert len(set(pixels)) > 50  # one colour alone has a few values


@drawn
def test_spaces_in_3d_are_drawn(comparison: Comparison, folder: Path) -> None:
    page = lay_out([present(replace(comparison, runs=comparison.runs[:1]))])
    spaces = [figure_stem(figure.title, part) for part, figure in page.figures if figure.space]
    assert spaces
    for stem in spaces:
        (image, *_) = ET.parse(folder / f"{stem}.svg").getroot().iter(f"{SVG}image")
        (data,) = [value for name, value in image.attrib.items() if name.endswith("href")]
        assert len(data) > 20_000  # a blank scene of that size has a tenth of it


@drawn
def test_ours_are_replaced_and_others_are_left_alone(figure: Figure, tmp_path: Path) -> None:
    other = tmp_path / "notes.txt"
    other.write_text("mine")
    shares: list[float] = []
    options = FigureOptions(tmp_path)
    pairs = [("log", figure), ("log", figure)]
    files = write_figures(pairs, options, progress=shares.append)
    names = [f"log-speed-over-time{end}" for end in (".svg", ".png", "-2.svg", "-2.png")]
    assert [file.path.name for file in files] == names
    assert shares == [0.25, 0.5, 0.75, 1.0]
    root = ET.parse(files[0].path).getroot()
    assert root.findtext(f"{SVG}title") == "Speed <over> time"
    assert root.findtext(f"{SVG}desc") == "It rises & rises."
    assert write_figures(pairs, options) == files
    assert {path.name for path in tmp_path.iterdir()} == {"notes.txt", *names}
    assert other.read_text() == "mine"


@drawn
def test_it_works_where_a_loop_is_running_as_in_a_notebook(figure: Figure, tmp_path: Path) -> None:
    async def cell() -> int:
        return len(write_figures([("log", figure)], FigureOptions(tmp_path, ("png",))))

    assert asyncio.run(cell()) == 1


def test_figure_files_are_told_as_json(tmp_path: Path) -> None:
    from urmpipe.api.report import Report
    from urmpipe_pipeline.report import FigureFile

    report = Report(tmp_path / "a.html", (), (FigureFile(tmp_path / "a.svg", "Path", "log"),))
    assert json.loads(json.dumps(report.to_dict())) == {
        "schema": 1,
        "report": str(tmp_path / "a.html"),
        "recordings": [],
        "figures": [{"file": str(tmp_path / "a.svg"), "title": "Path", "part": "log"}],
    }
