"""The figures as files: their names, sizes, texts, what they replace, and who drew them."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from matplotlib import get_cachedir
from PIL import Image
from pypdf import PdfReader

from toys import figure, panel, shown, toy
from urmpipe_models.errors import OptionError, OutputError
from urmpipe_pipeline.figures import FigureFile, FigureOptions, write_figures
from urmpipe_pipeline.figures.files import FigureFormat, figure_stem
from urmpipe_pipeline.presentation.figure import Drawing, Line, SpaceFigure
from urmpipe_pipeline.presentation.scene import Path as Way
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.report import write_report

SVG = "{http://www.w3.org/2000/svg}"
WITHIN = 0.01
"""Share that the size of a printed figure may be off; a PNG is off by less than a dot of 250 an inch."""

SYSTEM = Drawing("System", "Blocks & lines", '<svg width="9" viewBox="0 0 9 9"><text>log</text></svg>')


def waves(name: str = "Speed <over> time") -> Presentation:
    """Two lines over time, with names that mean something in TeX, XML and matplotlib."""
    one = toy()
    lines = Line(one.values, ("$x_1$ ‖Δ‖", "_hidden & <b>"), ("#c25000", "#21c3ff"))
    return shown(replace(figure(panel(one, lines), name=name), alt="It rises & \x01rises."))


def with_space() -> Presentation:
    """A plot, paths in space and a drawing that is ready."""
    angle = np.linspace(0.0, 6.0, 50)
    circle = np.column_stack([np.cos(angle), np.sin(angle), angle])
    space = SpaceFigure("Path in space", "", "A helix.", paths=(Way("helix", circle, None, "#c25000"),))
    body = replace(waves().body, blocks=lambda: [space, SYSTEM])
    return replace(waves(), body=body)


def written(one: Presentation, folder: Path, *formats: FigureFormat, **more: object) -> list[Path]:
    options = FigureOptions(folder, formats or ("pdf",), **more)  # type: ignore[arg-type]
    return [file.path for file in write_figures([one], options)]


def refused(**options: object) -> str:
    with pytest.raises(OptionError) as caught:
        FigureOptions(Path("figures"), **options)  # type: ignore[arg-type]
    return str(caught.value)


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


def test_all_that_is_wrong_with_options_is_told_at_once() -> None:
    assert refused(formats=("jpg", "pdf"), width="12 miles", font=math.nan, dpi=5) == (
        "formats (--formats): found jpg, allowed: pdf, svg, png\n"
        "figure_width (--figure-width): found '12 miles', allowed: column, page, or 40 mm to 1 m, such as"
        " 85mm or 3.5in\n"
        "figure_font (--figure-font): found nan, allowed: 4 to 32, in pt\n"
        "figure_dpi (--figure-dpi): found 5, allowed: 50 to 1200"
    )
    assert refused(formats=()) == "formats (--formats): found nothing, allowed: pdf, svg, png"
    assert refused(width=85.0).startswith(
        "figure_width (--figure-width): found 85.0, allowed: column, page, or 40 mm to 1 m"
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width", "millimetres"),
    [("column", 88.0), ("page", 180.0), ("85mm", 85.0), ("3.5in", 88.9), ("9 cm", 90.0), (0.1, 100.0)],
)
def test_a_figure_is_as_wide_as_it_is_asked_for(
    width: str | float, millimetres: float, tmp_path: Path
) -> None:
    (path,) = written(waves(), tmp_path, "svg", width=width)
    points = float(ET.parse(path).getroot().attrib["width"].removesuffix("pt"))
    assert points / 72.0 * 25.4 == pytest.approx(millimetres, rel=WITHIN)


@pytest.mark.slow
def test_all_formats_have_one_size(tmp_path: Path) -> None:
    pdf, svg, png = written(waves(), tmp_path, "pdf", "svg", "png", width="column", dpi=250)
    size = [float(end) / 72.0 for end in PdfReader(pdf).pages[0].mediabox[2:]]
    root = ET.parse(svg).getroot()
    assert [float(root.attrib[key].removesuffix("pt")) / 72.0 for key in ("width", "height")] == (
        pytest.approx(size, rel=WITHIN)
    )
    with Image.open(png) as image:
        assert [end / 250.0 for end in image.size] == pytest.approx(size, rel=WITHIN)
        assert image.info["dpi"] == pytest.approx((250.0, 250.0), rel=1e-3)  # stored as whole dots a metre


@pytest.mark.slow
def test_text_is_text_in_pdf_and_svg(tmp_path: Path) -> None:
    pdf, svg = written(waves(), tmp_path, "pdf", "svg")
    said = PdfReader(pdf).pages[0].extract_text()
    texts = {element.text for element in ET.parse(svg).getroot().iter(f"{SVG}text")}
    for words in ("$x_1$ ‖Δ‖", "_hidden & <b>", "t [s]", "values [rad]"):
        assert words in said
        assert words in texts


def test_the_font_is_as_large_as_it_is_asked_for(tmp_path: Path) -> None:
    (svg,) = written(waves(), tmp_path, "svg", font=10.0)
    (label,) = (one for one in ET.parse(svg).getroot().iter(f"{SVG}text") if one.text == "t [s]")
    assert "10px" in label.attrib["style"]  # a px of an SVG of matplotlib's is a pt: its viewBox is its size


@pytest.mark.slow
def test_each_file_says_who_drew_it_and_what_it_shows(tmp_path: Path) -> None:
    pdf, svg, png = written(waves(), tmp_path, "pdf", "svg", "png")
    found = PdfReader(pdf).metadata
    assert found is not None
    assert (found.title, found.subject) == ("Speed <over> time", "It rises & rises.")
    assert (found.creator or "").startswith("urmpipe ")
    assert svg.read_text(encoding="utf-8").startswith("<!-- Generator: urmpipe ")
    root = ET.parse(svg).getroot()
    assert (root.tag, root.get("role")) == (f"{SVG}svg", "img")
    assert root.findtext(f"{SVG}title") == "Speed <over> time"
    assert root.findtext(f"{SVG}desc") == "It rises & rises."
    with Image.open(png) as image:
        told = {key: image.info[key] for key in ("Title", "Description")}
        assert told == {"Title": "Speed <over> time", "Description": "It rises & rises."}
        assert image.info["Software"].startswith("urmpipe ")


@pytest.mark.slow
def test_one_figure_is_one_file_to_the_byte(tmp_path: Path) -> None:
    first, second = (
        [path.read_bytes() for path in written(with_space(), tmp_path / name, "pdf", "svg", "png", dpi=50)]
        for name in "ab"
    )
    assert first == second


@pytest.mark.slow
def test_a_drawing_is_svg_in_any_case(tmp_path: Path) -> None:
    paths = written(with_space(), tmp_path, "pdf")
    assert [path.name for path in paths] == [
        "toy-speed-over-time.pdf",
        "toy-path-in-space.pdf",
        "toy-system.svg",
    ]
    said = paths[-1].read_text(encoding="utf-8")
    assert said == (
        f"<!-- Generator: urmpipe {version('urmpipe')} -->\n"
        '<svg width="9" viewBox="0 0 9 9" role="img"><title>System</title><desc>Blocks &amp; lines</desc>'
        "<text>log</text></svg>"
    )


def test_figures_are_chosen_by_title_part_and_pattern(tmp_path: Path) -> None:
    def names(*wanted: str) -> list[str]:
        return [path.stem for path in written(with_space(), tmp_path, "png", names=wanted, dpi=50)]

    assert names("path in SPACE") == ["toy-path-in-space"]
    assert names("toy/*over*", "Sys*") == ["toy-speed-over-time", "toy-system"]
    with pytest.raises(OptionError) as caught:
        names("Path*", "Torque", "log/*")
    there = "allowed: Speed <over> time, Path in space, System"
    assert str(caught.value) == (
        f"figure_names (--figure-names): found 'Torque', {there}\nfigure_names (--figure-names): found"
        f" 'log/*', {there}"
    )


@pytest.mark.slow
def test_ours_are_replaced_and_others_are_left_alone(tmp_path: Path) -> None:
    other = tmp_path / "notes.txt"
    other.write_text("mine")
    shares: list[float] = []
    options = FigureOptions(tmp_path, ("pdf", "svg", "png"), dpi=50)
    twice = replace(waves(), body=replace(waves().body, sections=(waves().body,)))
    files = write_figures([twice], options, progress=shares.append)
    ends = (".pdf", ".svg", ".png", "-2.pdf", "-2.svg", "-2.png")
    assert [file.path.name for file in files] == [f"toy-speed-over-time{end}" for end in ends]
    assert shares == pytest.approx([k / 6 for k in range(1, 7)])
    assert write_figures([twice], options) == files
    assert {path.name for path in tmp_path.iterdir()} == {"notes.txt", *(file.path.name for file in files)}
    assert other.read_text() == "mine"


@pytest.mark.parametrize("suffix", ["svg", "pdf", "png"])
def test_a_foreign_file_stays_and_nothing_is_written(suffix: FigureFormat, tmp_path: Path) -> None:
    foreign = tmp_path / f"toy-speed-over-time.{suffix}"
    foreign.write_bytes({"svg": b"<svg/>", "pdf": b"%PDF-1.4 /Creator (TeX)", "png": b"\x89PNG"}[suffix])
    before = foreign.read_bytes()
    with pytest.raises(OutputError) as caught:
        written(waves(), tmp_path, "pdf", "svg", "png")
    assert str(caught.value) == (
        f"{foreign}: found a file that is not a figure of urmpipe, allowed: a new name, or such a figure to"
        " replace"
    )
    assert [*tmp_path.iterdir()] == [foreign]
    assert foreign.read_bytes() == before


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    path = tmp_path / "figures"
    path.write_text("mine")
    with pytest.raises(OutputError) as caught:
        written(waves(), path)
    assert str(caught.value) == f"{path}: figures (--figures): found a file, allowed: a folder"


def test_without_matplotlib_one_line_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(OutputError) as caught:
        write_report([waves()], tmp_path / "page.html", figures=FigureOptions(tmp_path / "new" / "figures"))
    assert str(caught.value) == (
        "figures (--figures): found no matplotlib, which draws them, allowed: pip install 'urmpipe[figures]'"
    )
    assert [*tmp_path.iterdir()] == []


@pytest.mark.slow
def test_every_plot_of_the_page_has_its_file_and_none_is_blank(tmp_path: Path) -> None:
    """The page names the pictures that a reader saves of it as the files are named."""
    folder = tmp_path / "figures"
    options = FigureOptions(folder, ("png",), dpi=50)
    files = write_report([with_space()], tmp_path / "page.html", figures=options).figures
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    plots = [file.path for file in files if file.path.suffix == ".png"]
    assert {path.stem for path in plots} == set(re.findall(r'data-name="([\w-]+)"', page))
    assert {file.path for file in files} == set(folder.iterdir())
    for path in plots:
        with Image.open(path) as image:
            assert len(image.convert("RGB").getcolors(1 << 16) or ()) > 20  # a blank one has one colour


@pytest.mark.slow
def test_no_browser_and_no_window_is_needed(tmp_path: Path) -> None:
    """A process with no program in reach, no display, and settings that ask for a window, draws."""
    bare = {
        "PATH": "",
        "MPLBACKEND": "TkAgg",
        "MPLCONFIGDIR": get_cachedir(),  # where the fonts are listed already, which takes seconds
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    run = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(run, env=bare, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split(), done.stderr) == (0, ["False", "1"], "")


PROGRAM = """
import sys
from pathlib import Path
from toys import figure, panel, shown, toy
from urmpipe_pipeline.figures import FigureOptions, write_figures
from urmpipe_pipeline.figures.plot import plot
waves = shown(figure(panel(toy())))
plot(waves, None, "page", 8.0)
files = write_figures([waves], FigureOptions(Path("figures"), ("pdf",)))
print("matplotlib.pyplot" in sys.modules, sum(file.path.exists() for file in files))
"""


def test_figure_files_are_told_as_json(tmp_path: Path) -> None:
    from urmpipe.api.report import Report

    report = Report(tmp_path / "a.html", (), (FigureFile(tmp_path / "a.svg", "Path", "log"),))
    assert json.loads(json.dumps(report.to_dict())) == {
        "schema": 1,
        "report": str(tmp_path / "a.html"),
        "recordings": [],
        "figures": [{"file": str(tmp_path / "a.svg"), "title": "Path", "part": "log"}],
    }
