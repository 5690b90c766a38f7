"""The page in Debian's Chromium: drawn, linked, readable on a phone, printed, and without any network."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import urmpipe
from asserting import there
from made_plans import FAILED, SMALL, limited, planned
from urmpipe_datasets import LOGS
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, View
from urmpipe_pipeline.presentation.section import Presentation, Section
from urmpipe_pipeline.report import render_report, spec
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.results import present
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Simulation

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]

TAGS_OF_HEADINGS = """[...document.querySelectorAll("h1, h2, h3, h4, h5, h6")].map(h => h.tagName)"""

CONTRASTS = """(() => {
    const rgb = (colour) => colour.match(/[\\d.]+/g).map(Number);
    const luminance = ([r, g, b]) => [r, g, b]
        .map(c => c / 255).map(c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
        .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
    const ground = (element) => {
        for (let e = element; e; e = e.parentElement) {
            const colour = rgb(getComputedStyle(e).backgroundColor);
            if (colour.length === 3 || colour[3] === 1) return colour;
        }
        return [255, 255, 255];
    };
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    const found = [];
    while (texts.nextNode()) {
        const parent = texts.currentNode.parentElement;
        if (!texts.currentNode.textContent.trim() || parent.closest("script, noscript, .plot")) continue;
        const pair = [luminance(rgb(getComputedStyle(parent).color)), luminance(ground(parent))];
        found.push([texts.currentNode.textContent, (Math.max(...pair) + 0.05) / (Math.min(...pair) + 0.05)]);
    }
    return found;
})()"""
"""Every text of the page with its contrast against what it stands on. Source: WCAG 2.2."""

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
def shown(comparison: Comparison, bare_run: Run) -> list[Presentation]:
    """A comparison and a log of which only the joints are known."""
    return [present(comparison), present(bare_run)]


@pytest.fixture(scope="module")
def report(shown: list[Presentation], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(render_report(shown), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def figures(shown: list[Presentation]) -> list[spec.Figure]:
    """Every figure of the page, from the top."""
    return [figure for _, figure in lay_out(shown).figures]


@contextmanager
def opened(
    browser: Browser,
    path: Path,
    *,
    width: int = 1280,
    phone: bool = False,
    script: bool = True,
    dark: bool = False,
) -> Iterator[Page]:
    """A page at its top. It must have had no error and asked no one for anything when it closes."""
    context = browser.new_context(
        viewport={"width": width, "height": 900},
        java_script_enabled=script,
        has_touch=phone,
        is_mobile=phone,
        color_scheme="dark" if dark else "light",
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
    """Bring every figure that is not folded into view and wait until it is drawn."""
    for plot in page.locator(".plot:visible").all():
        plot.scroll_into_view_if_needed()
        plot.locator(".main-svg").first.wait_for()


def sideways(page: Page) -> int:
    """By how many px the page is wider than the window."""
    return int(page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))


def test_a_drawing_is_seen_and_runs_no_script(
    browser: Browser, make_simulation: Callable[..., Simulation], tmp_path: Path
) -> None:
    script = "<script>alert(1)</script><rect onclick='alert(2)' width='9' height='9'/></svg>"
    sound = make_simulation(3000)
    svg = sound.system_svg.replace("<svg ", "<svg onload='alert(3)' ").replace("</svg>", script)
    path = tmp_path / "simulation.html"
    path.write_text(render_report([present(replace(sound, system_svg=svg))]), encoding="utf-8")
    with opened(browser, path) as page:
        scroll_through(page)
        image = page.locator(".drawing img")
        assert image.evaluate("image => [image.complete, image.naturalWidth]") == [True, 640]
        image.click()
    with opened(browser, path, width=390, phone=True) as page:
        scroll_through(page)
        assert sideways(page) == 0


def test_plans_are_drawn_on_a_desk_and_on_a_phone(browser: Browser, tmp_path: Path) -> None:
    plans = planned(limited("ur5e", acceleration=20.0), SMALL), FAILED["unreachable"]()
    path = tmp_path / "plans.html"
    path.write_text(render_report([present(plan) for plan in plans]), encoding="utf-8")
    for width in (1280, 390):
        with opened(browser, path, width=width, phone=width < 1000) as page:
            scroll_through(page)
            assert sideways(page) == 0
            assert page.locator(".plot.space canvas").count() > 0
            for image in page.locator(".drawing img").all():
                assert image.evaluate("image => image.complete && image.naturalWidth > 300")


def test_small_figures_stand_side_by_side(browser: Browser, tmp_path: Path) -> None:
    t_ns = np.arange(100, dtype=np.int64) * 10_000_000
    line = Line(np.sin(t_ns / 1e8), ("wave",), ("#c25000",))
    small = Figure(
        "Wave", "A wave.", "A wave over time.", (View("wave", (Panel("wave", "m", (line,), t_ns),)),)
    )
    two, one = Section("two", figures=lambda: [small, small]), Section("one", figures=lambda: [small])
    toy = Presentation("toy", "it is", None, (), Section("toy", sections=(two, one)))
    path = tmp_path / "toy.html"
    path.write_text(render_report([toy]), encoding="utf-8")
    with opened(browser, path) as page:
        scroll_through(page)
        plots = page.locator(".pairs .plot")
        first, second, alone = (box for box in (plots.nth(k).bounding_box() for k in range(3)) if box)
        assert first["y"] == second["y"]
        assert first["x"] + first["width"] <= second["x"]
        assert alone["width"] == second["x"] + second["width"] - first["x"]  # the only one of its part
    with opened(browser, path, width=390, phone=True) as page:
        scroll_through(page)
        assert sideways(page) == 0
        boxes = [box for box in (plot.bounding_box() for plot in page.locator(".pairs .plot").all()) if box]
        assert all(box["x"] >= 0 and box["x"] + box["width"] <= 390 for box in boxes)


def test_the_verdict_is_seen_first(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        heading = page.locator("h1")
        assert " ".join(heading.inner_text().split()) == (
            "FAIL 1 of 2 logs (joint-off) out of tolerance against path, by the joints on both sides"
        )
        box = there(heading.bounding_box())
        assert box["y"] < 200
        assert page.locator("h1 svg.icon").count() == 1


def test_figures_are_drawn_before_anybody_scrolls(
    browser: Browser, report: Path, figures: list[spec.Figure]
) -> None:
    """So a picture of the whole page has no empty box."""
    with opened(browser, report) as page:
        assert page.locator(".plot").count() == len(figures)
        for plot in page.locator(".plot:visible").all():
            plot.locator(".main-svg").first.wait_for()
        assert page.evaluate("scrollY") == 0
        assert page.locator(".plot[data-drawn]").count() == page.locator(".plot:visible").count() > 5
        assert page.locator(".plot.space:visible").count() > 0
        assert page.locator(".plot.space canvas").count() >= page.locator(".plot.space:visible").count()
        assert page.locator(".plot .scatterlayer .js-line").count() > 10
        assert sideways(page) == 0


def plot_of(page: Page, quantity: str, within: str = "") -> Locator:
    """The first figure that draws such a quantity over time, in view and drawn."""
    for plot in page.locator(f"{within}.plot:not(.space):visible").all():
        plot.scroll_into_view_if_needed()
        plot.locator(".main-svg").first.wait_for()
        names = plot.evaluate("p => p.data.map(trace => trace.name)")
        if quantity in names:
            return plot
    raise AssertionError(f"no figure draws {quantity}")


def test_the_pointer_tells_the_number_that_the_table_has(
    browser: Browser, report: Path, comparison: Comparison
) -> None:
    best = comparison.ranking[0]
    one = best.statistics["norm"]
    with opened(browser, report) as page:
        page.locator("#r1-1 summary").first.click()
        plot = plot_of(page, "‖Δ‖", "#r1-1 ")
        where = plot.evaluate(
            """(plot, t) => {
                const trace = plot.data.findIndex(trace => trace.name === "‖Δ‖");
                const { _offset, _length, range } = plot._fullLayout.xaxis;
                const axis = plot._fullLayout[plot.data[trace].yaxis.replace("y", "yaxis")];
                const share = (t - range[0]) / (range[1] - range[0]);
                return [_offset + share * _length, axis._offset + axis._length / 2];
            }""",
            one.t_max,
        )
        box = there(plot.bounding_box())
        for aside in (40, 0):  # a pointer that appears from nowhere is not seen as moving
            page.mouse.move(box["x"] + where[0] + aside, box["y"] + where[1])
        plot.locator(".hoverlayer .legend, .hoverlayer .hovertext").first.wait_for()
        said = plot.locator(".hoverlayer").text_content() or ""
        assert "t = " in said
        (row,) = page.locator(".summary tr", has=page.locator("th a", has_text=best.name)).all()
        assert text.number(one.max, "m") in row.locator("td").all_inner_texts()  # the pointer has more digits
        assert f"‖Δ‖ : {one.max * 1e3:.4f} mm" in said


def test_nothing_offers_to_send_the_data_away(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        plot = page.locator(".plot").first
        plot.scroll_into_view_if_needed()
        plot.hover()
        plot.locator(".modebar-btn").first.wait_for()
        titles = [button.get_attribute("data-title") for button in plot.locator(".modebar-btn").all()]
        assert titles == ["Download plot", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"]


def test_time_axes_of_a_log_are_linked(browser: Browser, report: Path) -> None:
    own = '.plot[data-link="r1-1"]:not(.space)'
    ranges = """[...document.querySelectorAll(".plot:not(.space)")].filter(p => p.layout)
        .map(p => [p.dataset.link, p.layout.xaxis.range])"""
    with opened(browser, report) as page:
        open_all(page)
        scroll_through(page)
        before = page.evaluate(ranges)
        siblings = page.locator(own).count()
        assert siblings > 1
        page.evaluate(f"Plotly.relayout(document.querySelector('{own}'), {{'xaxis.range': [5, 9]}})")
        page.wait_for_function(
            f"[...document.querySelectorAll('{own}')].every(p => p.layout.xaxis.range[0] === 5)"
        )
        after = page.evaluate(ranges)
        assert [one for one in after if one[0] == "r1-1"] == [["r1-1", [5, 9]]] * siblings
        assert [one for one in after if one[0] != "r1-1"] == [one for one in before if one[0] != "r1-1"]


def open_all(page: Page) -> None:
    """Unfold everything."""
    page.evaluate("document.querySelectorAll('details').forEach(folded => { folded.open = true; })")


def test_a_phone_shows_it_without_sideways_scroll(
    browser: Browser, everything: Comparison, bare_run: Run, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    path.write_text(render_report([present(everything), present(bare_run)]), encoding="utf-8")
    with opened(browser, path, width=390, phone=True) as page:
        open_all(page)
        scroll_through(page)
        assert sideways(page) == 0
        for box in page.locator(".scroll, .card, .verdict, .facts, .plot").all():
            found = there(box.bounding_box())
            assert found["x"] + found["width"] <= 390
        assert page.locator(".modebar-btn").count() == 0


def test_every_ink_is_legible_where_it_stands(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        open_all(page)
        found = page.evaluate(CONTRASTS)
        assert len(found) > 200
        faint = {said: ratio for said, ratio in found if ratio < 4.5}  # WCAG 2.2 AA
        assert faint == {}


def test_what_is_drawn_and_tabled_has_a_name(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        open_all(page)
        levels = [int(tag[1]) for tag in page.evaluate(TAGS_OF_HEADINGS)]
        assert levels[0] == 1
        assert levels.count(1) == 1
        assert all(after - before <= 1 for before, after in pairwise(levels))
        for plot in page.locator(".plot").all():
            assert plot.get_attribute("role") == "img"
            assert len(plot.get_attribute("aria-label") or "") > 40
        for table in page.locator("table").all():
            assert table.locator("thead th[scope=col]").count() > 1
            region = table.locator("xpath=..")
            heading = table.locator("xpath=ancestor::section[1]").locator("h2, h3, h4, h5").first
            assert region.get_attribute("aria-label") == heading.inner_text()


def test_a_keyboard_reaches_the_links_and_what_is_folded(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "Skip to the details"
        assert page.locator(".skip").bounding_box()["y"] >= 0  # type: ignore[index]
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "details"
        page.locator("summary").first.focus()
        page.keyboard.press("Enter")
        assert page.locator("details").first.get_attribute("open") == ""


def test_what_failed_is_open_and_first_and_what_passed_opens_by_its_link(
    browser: Browser, report: Path, comparison: Comparison
) -> None:
    with opened(browser, report) as page:
        worst, best = (run.name for run in reversed(comparison.ranking))
        assert [said.split()[0] for said in page.locator("h3:has(.badge)").all_inner_texts()] == [worst, best]
        assert page.locator(".summary th a").all_inner_texts() == [worst, best]
        assert page.locator("#r1-2 .plot").first.is_visible()
        assert page.locator("#r1-1 .plot").first.is_hidden()
        page.locator(".summary th a", has_text=best).click()
        assert page.locator("#r1-1 .plot").first.is_visible()
        assert 0 <= there(page.locator("#r1-1").bounding_box())["y"] < 200


GROUNDS = """[getComputedStyle(document.body).backgroundColor,
    ...[...document.querySelectorAll(".plot")].filter(p => p.layout)
        .map(p => p.layout.paper_bgcolor)]"""


TWO_FRAMES = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""Changed settings reach the page with its next frame."""


def test_a_dark_setting_is_followed_at_once_and_paper_is_light(browser: Browser, report: Path) -> None:
    with opened(browser, report, dark=True) as page:
        scroll_through(page)
        assert set(page.evaluate(GROUNDS)) == {"rgb(18, 24, 28)", "#12181c"}
        assert {said: ratio for said, ratio in page.evaluate(CONTRASTS) if ratio < 4.5} == {}  # WCAG 2.2 AA
        page.emulate_media(color_scheme="light")
        page.evaluate(TWO_FRAMES)
        assert set(page.evaluate(GROUNDS)) == {"rgb(255, 255, 255)", "#ffffff"}
        page.emulate_media(color_scheme="dark", media="print")
        page.evaluate(TWO_FRAMES)
        assert set(page.evaluate(GROUNDS)) == {"rgb(255, 255, 255)", "#ffffff"}


def test_print_shows_what_is_open_and_what_passed_and_the_screen_is_as_before(
    browser: Browser, report: Path
) -> None:
    with opened(browser, report) as page:
        scroll_through(page)
        folded = page.locator("details:not([open])").count()
        passed = page.locator("details.passed").count()
        heights = page.evaluate("[...document.querySelectorAll('.plot')].map(p => p.style.height)")
        assert passed > 0
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert page.locator("details:not([open])").count() == folded - passed
        assert page.locator(".plot[data-drawn]").count() >= page.locator(".plot:visible").count() > 5
        page.evaluate("dispatchEvent(new Event('afterprint'))")
        assert page.locator("details:not([open])").count() == folded
        assert page.evaluate("[...document.querySelectorAll('.plot')].map(p => p.style.height)") == heights
        assert sideways(page) == 0


def test_printed_pages_are_a4_and_nothing_is_cut(browser: Browser, report: Path) -> None:
    with opened(browser, report, width=688) as page:  # what an A4 page holds between margins of 14 mm
        page.emulate_media(media="print")
        open_all(page)
        cut = page.evaluate(
            "[...document.querySelectorAll('.scroll')].map(s => s.scrollWidth - s.clientWidth)"
        )
        assert max(cut) == 0
        assert sideways(page) == 0
        page.emulate_media(media="screen")
        assert {(round(w), round(h)) for w, h in printed_pages(page)} == {(595, 842)}  # A4 in points


def printed_pages(page: Page) -> list[tuple[float, float]]:
    """The width and the height of each page of the print, in points."""
    printed = page.pdf(format="A4", print_background=True, prefer_css_page_size=True)
    sizes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", printed)
    return [(float(width), float(height)) for width, height in sizes]


def test_four_logs_take_a_page_each_and_three_for_the_rest(browser: Browser, tmp_path: Path) -> None:
    """The report that `urmpipe demo` writes: of the same logs, with the same options."""
    logs = [
        LOGS / "solidworks",
        *(LOGS / f"{name}.csv" for name in ("coppeliasim", "matlab", "counter_rotating")),
    ]
    compared = urmpipe.compare(LOGS / "path.csv", logs, robot="urm6", diagnose=True)
    path = tmp_path / "demo.html"
    path.write_text(render_report([present(compared)]), encoding="utf-8")
    with opened(browser, path) as page:
        page.locator(".plot:visible .main-svg").first.wait_for()
        assert len(printed_pages(page)) <= 10
        titles = page.locator(".level3 h3").all_inner_texts()
        assert titles[0].split() == ["counter_rotating", "FAIL"]
        assert page.locator(".level3 details.passed").count() == 3
        axis = page.locator("#r1-4 .plot").first.evaluate("p => p.layout.yaxis.ticktext")
        assert axis == ["−500", "−3.5", "0", "3.5", "500"]  # the tolerance is seen beside 807 mm
    with opened(browser, path, width=390, phone=True, dark=True) as page:
        scroll_through(page)
        assert sideways(page) == 0


def test_without_scripts_the_numbers_are_there(browser: Browser, report: Path) -> None:
    with opened(browser, report, script=False) as page:
        assert page.locator("noscript p").is_visible()
        assert page.locator("h1").inner_text().startswith("FAIL")
        assert page.locator(".summary td", has_text="2.500").first.is_visible()
        assert page.locator(".plot").first.is_hidden()


def test_hostile_texts_do_nothing(browser: Browser, hostile: Comparison, tmp_path: Path) -> None:
    path = tmp_path / "hostile.html"
    path.write_text(render_report([present(hostile), present(hostile.runs[0].run)]), encoding="utf-8")
    with opened(browser, path) as page:
        scroll_through(page)
        assert page.locator("img, b").count() == 0
        legend = page.locator(".plot .legendtext").all_text_contents()
        assert hostile.runs[0].run.log.joints[0] in legend
        names = {plot.get_attribute("data-name") or "" for plot in page.locator(".plot").all()}
        assert all(re.fullmatch(r"[a-z0-9-]+", name) for name in names)
        assert hostile.name in page.locator("#r1 > h2").inner_text()
