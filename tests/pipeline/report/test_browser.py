"""The page in Debian's Chromium: drawn, linked, readable on a phone, printed, and without any network."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.report import render_report
from urmpipe_pipeline.results import Run

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
PLOTS = 7  # three a compared log, the joints of the log without a robot

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"no browser at {CHROMIUM}: apt-get install chromium"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with playwright.sync_playwright() as play:
        found = play.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield found
        found.close()


@pytest.fixture(scope="module")
def report(comparison: Comparison, bare_run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(render_report([comparison, bare_run]), encoding="utf-8")
    return path


@contextmanager
def opened(
    browser: Browser, path: Path, *, width: int = 1280, phone: bool = False, script: bool = True
) -> Iterator[Page]:
    """A page at its top. It must have had no error and asked no one for anything when it closes."""
    context = browser.new_context(
        viewport={"width": width, "height": 900},
        java_script_enabled=script,
        has_touch=phone,
        is_mobile=phone,
    )
    page = context.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
    page.on("dialog", lambda dialog: complaints.append(f"dialog: {dialog.message}"))
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: complaints.append(asked.url) if asked.url.startswith("http") else None)
    page.goto(path.as_uri())
    yield page
    context.close()
    assert complaints == []


def scroll_through(page: Page) -> None:
    """Bring every figure into view and wait until it is drawn."""
    for plot in page.locator(".plot").all():
        plot.scroll_into_view_if_needed()
        plot.locator(".main-svg").first.wait_for()


def sideways(page: Page) -> int:
    """By how many px the page is wider than the window."""
    return int(page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))


def test_the_verdict_is_seen_first(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        heading = page.locator("h1")
        assert " ".join(heading.inner_text().split()) == "FAIL 1 of 2 logs is out of tolerance: joint-off"
        box = heading.bounding_box()
        assert box is not None
        assert box["y"] < 200
        assert page.locator("h1 svg.icon").count() == 1


def test_figures_are_drawn_when_they_come_into_view(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        page.wait_for_selector(".plot[data-drawn]")
        assert page.locator(".plot").count() == PLOTS
        assert page.locator(".plot[data-drawn]").count() < PLOTS
        scroll_through(page)
        assert page.locator(".plot[data-drawn]").count() == PLOTS
        assert page.locator(".plot.space canvas").count() == 2
        assert page.locator(".plot .scatterlayer .js-line").count() > 20
        assert sideways(page) == 0


def test_the_pointer_tells_time_and_values(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        plot = page.locator(".plot").first
        plot.scroll_into_view_if_needed()
        plot.locator(".main-svg").first.wait_for()
        box = plot.bounding_box()
        assert box is not None
        for share in (0.4, 0.5):  # a pointer that appears from nowhere is not seen as moving
            page.mouse.move(box["x"] + box["width"] * share, box["y"] + 80)
        plot.locator(".hoverlayer .legend, .hoverlayer .hovertext").first.wait_for()
        said = plot.locator(".hoverlayer").text_content() or ""
        assert "t = " in said
        # the first log stands 2.5 mm too high all the time
        for words in ("Δx : ", "Δy : ", "Δz : -2.5000 mm", "‖Δ‖ : 2.5000 mm", "speed : "):
            assert words in said
        assert " m/s" in said


def test_nothing_offers_to_send_the_data_away(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        plot = page.locator(".plot").first
        plot.scroll_into_view_if_needed()
        plot.hover()
        plot.locator(".modebar-btn").first.wait_for()
        titles = [button.get_attribute("data-title") for button in plot.locator(".modebar-btn").all()]
        assert titles == ["Download plot", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"]


def test_time_axes_of_a_log_are_linked(browser: Browser, report: Path) -> None:
    ranges = "[...document.querySelectorAll('.plot:not(.space)')].map(p => p.layout.xaxis.range)"
    with opened(browser, report) as page:
        scroll_through(page)
        whole = page.evaluate(ranges)
        deviation, _, _, _, _ = whole
        assert deviation == pytest.approx([0.0, 14.995])
        page.evaluate("Plotly.relayout(document.querySelector('.plot'), {'xaxis.range': [5, 9]})")
        page.wait_for_function(f"{ranges}[1][0] === 5")
        zoomed = page.evaluate(ranges)
        assert zoomed[:2] == [[5, 9], [5, 9]]
        assert zoomed[2:] == whole[2:]


def test_a_phone_shows_it_without_sideways_scroll(browser: Browser, report: Path) -> None:
    with opened(browser, report, width=390, phone=True) as page:
        scroll_through(page)
        assert sideways(page) == 0
        for box in page.locator(".scroll").all():
            found = box.bounding_box()
            if found is not None:  # folded tables have none
                assert found["x"] + found["width"] <= 390
        assert page.locator(".modebar-btn").count() == 0


def test_print_shows_everything_and_the_screen_is_as_before(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        folded = page.locator("details:not([open])").count()
        assert folded > 0
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert page.locator("details:not([open])").count() == 0
        assert page.locator(".plot[data-drawn]").count() == PLOTS
        page.evaluate("dispatchEvent(new Event('afterprint'))")
        assert page.locator("details:not([open])").count() == folded
        assert sideways(page) == 0
        assert page.pdf(format="A4", print_background=True).startswith(b"%PDF-")


def test_without_scripts_the_numbers_are_there(browser: Browser, report: Path) -> None:
    with opened(browser, report, script=False) as page:
        assert page.locator("noscript p").is_visible()
        assert page.locator("td", has_text="2.5000").first.is_visible()
        assert page.locator(".plot").first.is_hidden()


def test_hostile_texts_do_nothing(browser: Browser, hostile: Comparison, tmp_path: Path) -> None:
    path = tmp_path / "hostile.html"
    path.write_text(render_report([hostile, hostile.runs[0].run]), encoding="utf-8")
    with opened(browser, path) as page:
        scroll_through(page)
        assert page.locator("img, b").count() == 0
        legend = page.locator(".plot .legendtext").all_text_contents()
        assert hostile.runs[0].run.log.joints[0] in legend
        assert hostile.name in page.locator("#c1 > h2").inner_text()
