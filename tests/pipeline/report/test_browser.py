"""The page in Debian's Chromium: drawn, linked, readable on a phone, printed, and without any network."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest

import urmpipe
from asserting import there
from made_plans import FAILED, SMALL, limited, planned
from thinned_logs import lay_thinned_logs
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, View
from urmpipe_pipeline.presentation.section import Presentation, Section
from urmpipe_pipeline.report import render_report, spec
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.results import present
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.simulation import Simulation

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page, ViewportSize

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]

DESK: ViewportSize = {"width": 1280, "height": 900}
PHONE: ViewportSize = {"width": 390, "height": 900}

OPEN = "[...document.querySelectorAll('details')].map(folded => folded.open)"
SET_OPEN = "was => document.querySelectorAll('details').forEach((folded, k) => { folded.open = was[k]; })"
NOTE_FIRST = """window.atFirst = {
    scroll: scrollY,
    drawn: document.querySelectorAll(".plot[data-drawn]").length,
    open: [...document.querySelectorAll("details")].map(folded => folded.open),
};"""
BACK_TO_FIRST = """(() => {
    document.querySelectorAll("details").forEach((folded, k) => { folded.open = atFirst.open[k]; });
    document.body.tabIndex = -1;
    document.body.focus();  // so that the next Tab starts at the top
    document.body.removeAttribute("tabindex");
    scrollTo({ top: 0, behavior: "instant" });
})()"""

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


def watched(page: Page) -> list[str]:
    """Return the errors of a page, and what it asks of anybody, as they come."""
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
    page.on("dialog", lambda dialog: complaints.append(f"dialog: {dialog.message}"))
    page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    page.on("request", lambda asked: complaints.append(asked.url) if asked.url.startswith("http") else None)
    return complaints


def until(page: Page, condition: str) -> None:
    """Wait for a condition. The page's own policy forbids `wait_for_function`, which evaluates text there."""
    page.evaluate(f"""new Promise(met => {{
        const look = () => ({condition}) ? met() : requestAnimationFrame(look);
        look();
    }})""")


@contextmanager
def opened(
    browser: Browser, path: Path, *, phone: bool = False, script: bool = True, dark: bool = False
) -> Iterator[Page]:
    """A page at its top. It must have had no error and asked no one for anything when it closes."""
    context = browser.new_context(
        viewport=PHONE if phone else DESK,
        java_script_enabled=script,
        has_touch=phone,
        is_mobile=phone,
        color_scheme="dark" if dark else "light",
    )
    page = context.new_page()
    complaints = watched(page)
    page.goto(path.as_uri())
    yield page
    context.close()
    assert complaints == []


@pytest.fixture(scope="module")
def shared_page(browser: Browser, report: Path) -> Iterator[Page]:
    """The report, opened once, its figures drawn and nothing else done: a page takes seconds to open."""
    with opened(browser, report) as page:
        for plot in page.locator(".plot:visible").all():
            plot.locator(".main-svg").first.wait_for()
        page.evaluate(NOTE_FIRST)
        yield page


@pytest.fixture
def desk(shared_page: Page) -> Page:
    """The report on a screen, as it is after opening; figures that a test unfolded remain drawn."""
    shared_page.set_viewport_size(DESK)
    shared_page.emulate_media(media="screen", color_scheme="light")
    shared_page.evaluate(BACK_TO_FIRST)
    return shared_page


def scroll_through(page: Page) -> None:
    """Bring every figure that is not folded into view and wait until it is drawn."""
    page.evaluate("""(async () => {
        for (const plot of document.querySelectorAll(".plot")) {
            if (!plot.checkVisibility()) continue;
            plot.scrollIntoView({ behavior: "instant" });
            while (!plot.querySelector(".main-svg")) await new Promise(requestAnimationFrame);
        }
    })()""")


SIDEWAYS = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


def sideways(page: Page) -> int:
    """By how many px the page is wider than the window, once its figures have the size of the window."""
    with suppress(Exception):  # a time-out: the page stays wider
        page.wait_for_function(f"{SIDEWAYS} <= 0", timeout=10_000)
    return int(page.evaluate(SIDEWAYS))


@pytest.fixture(scope="module")
def others(make_simulation: Callable[..., Simulation]) -> list[Presentation]:
    """What is no comparison: a simulation with scripts in its drawing, two plans, and small figures."""
    script = "<script>alert(1)</script><rect onclick='alert(2)' width='9' height='9'/></svg>"
    sound = make_simulation(3000)
    svg = sound.system_svg.replace("<svg ", "<svg onload='alert(3)' ").replace("</svg>", script)
    plans = planned(limited("ur5e", acceleration=20.0), SMALL), FAILED["unreachable"]()
    t_ns = np.arange(100, dtype=np.int64) * 10_000_000
    line = Line(np.sin(t_ns / 1e8), ("wave",), ("#c25000",))
    small = Figure(
        "Wave", "A wave.", "A wave over time.", (View("wave", (Panel("wave", "m", (line,), t_ns),)),)
    )
    two, one = Section("two", figures=lambda: [small, small]), Section("one", figures=lambda: [small])
    toy = Presentation("toy", "it is", None, (), Section("toy", sections=(two, one)))
    return [present(replace(sound, system_svg=svg)), *map(present, plans), toy]


def test_drawings_run_no_script_and_small_figures_stand_side_by_side(
    browser: Browser, others: list[Presentation], tmp_path: Path
) -> None:
    simulated, *_, toy = others
    path = tmp_path / "others.html"
    path.write_text(render_report([simulated, toy]), encoding="utf-8")
    with opened(browser, path) as page:
        scroll_through(page)
        assert sideways(page) == 0
        image = page.locator("#r1 .drawing img")
        assert image.evaluate("image => [image.complete, image.naturalWidth]") == [True, 640]
        image.click()
        plots = page.locator(".pairs .plot")
        *_, first, second, alone = (box for box in (plot.bounding_box() for plot in plots.all()) if box)
        assert first["y"] == second["y"]
        assert first["x"] + first["width"] <= second["x"]
        assert alone["width"] == second["x"] + second["width"] - first["x"]  # the only one of its part


def test_the_verdict_is_seen_first(desk: Page) -> None:
    heading = desk.locator("h1")
    assert " ".join(heading.inner_text().split()) == (
        "FAIL 1 of 2 logs (joint-off) out of tolerance against path, by the joints on both sides"
    )
    box = there(heading.bounding_box())
    assert box["y"] < 200
    assert desk.locator("h1 svg.icon").count() == 1


def test_figures_are_drawn_before_anybody_scrolls(desk: Page, figures: list[spec.Figure]) -> None:
    """So a picture of the whole page has no empty box."""
    assert desk.locator(".plot").count() == len(figures)
    assert desk.evaluate("atFirst.scroll") == 0
    assert desk.evaluate("atFirst.drawn") == desk.locator(".plot:visible").count() > 5
    assert desk.locator(".plot.space:visible").count() > 0
    assert desk.locator(".plot.space canvas").count() >= desk.locator(".plot.space:visible").count()
    assert desk.locator(".plot .scatterlayer .js-line").count() > 10
    assert sideways(desk) == 0


GROUNDS = """[getComputedStyle(document.body).backgroundColor,
    ...[...document.querySelectorAll(".plot")].filter(p => p.layout)
        .map(p => p.layout.paper_bgcolor)]"""


DARK, LIGHT = {"rgb(18, 24, 28)", "#12181c"}, {"rgb(255, 255, 255)", "#ffffff"}

TWO_FRAMES = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""Changed settings reach the page with its next frame."""


def test_a_dark_setting_is_followed_at_once(desk: Page) -> None:
    settings: dict[Literal["dark", "light"], set[str]] = {"dark": DARK, "light": LIGHT}
    for scheme, grounds in settings.items():
        desk.emulate_media(color_scheme=scheme)
        desk.evaluate(TWO_FRAMES)
        assert set(desk.evaluate(GROUNDS)) == grounds
        assert {said: ratio for said, ratio in desk.evaluate(CONTRASTS) if ratio < 4.5} == {}  # WCAG 2.2 AA


def plot_of(page: Page, quantity: str, within: str = "") -> Locator:
    """The first figure that draws such a quantity over time, in view and drawn."""
    for plot in page.locator(f"{within}.plot:not(.space):visible").all():
        plot.scroll_into_view_if_needed()
        plot.locator(".main-svg").first.wait_for()
        names = plot.evaluate("p => p.data.map(trace => trace.name)")
        if quantity in names:
            return plot
    raise AssertionError(f"no figure draws {quantity}")


def test_the_pointer_tells_the_number_that_the_table_has(desk: Page, comparison: Comparison) -> None:
    best = comparison.ranking[0]
    one = best.statistics["norm"]
    desk.locator("#r1-1 summary").first.click()
    plot = plot_of(desk, "‖Δ‖", "#r1-1 ")
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
        desk.mouse.move(box["x"] + where[0] + aside, box["y"] + where[1])
    plot.locator(".hoverlayer .legend, .hoverlayer .hovertext").first.wait_for()
    said = plot.locator(".hoverlayer").text_content() or ""
    assert "t = " in said
    (row,) = desk.locator(".summary tr", has=desk.locator("th a", has_text=best.name)).all()
    assert (
        text.format_number(one.max, "m") in row.locator("td").all_inner_texts()
    )  # the pointer has more digits
    assert f"‖Δ‖ : {one.max * 1e3:.4f} mm" in said


def test_nothing_offers_to_send_the_data_away(desk: Page) -> None:
    plot = desk.locator(".plot").first
    plot.scroll_into_view_if_needed()
    plot.hover()
    plot.locator(".modebar-btn").first.wait_for()
    titles = [button.get_attribute("data-title") for button in plot.locator(".modebar-btn").all()]
    assert titles == ["Download plot", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"]


def test_time_axes_of_a_log_are_linked(desk: Page) -> None:
    own = '.plot[data-link="r1-1"]:not(.space)'
    ranges = """[...document.querySelectorAll(".plot:not(.space)")].filter(p => p.layout)
        .map(p => [p.dataset.link, p.layout.xaxis.range])"""
    open_all(desk, "#r1-1")
    scroll_through(desk)
    before = desk.evaluate(ranges)
    siblings = desk.locator(own).count()
    assert siblings > 1
    desk.evaluate(f"Plotly.relayout(document.querySelector('{own}'), {{'xaxis.range': [5, 9]}})")
    until(desk, f"[...document.querySelectorAll('{own}')].every(p => p.layout.xaxis.range[0] === 5)")
    after = desk.evaluate(ranges)
    assert [one for one in after if one[0] == "r1-1"] == [["r1-1", [5, 9]]] * siblings
    assert [one for one in after if one[0] != "r1-1"] == [one for one in before if one[0] != "r1-1"]
    desk.evaluate(f"Plotly.relayout(document.querySelector('{own}'), {{'xaxis.autorange': true}})")


def open_all(page: Page, within: str = "body") -> None:
    """Unfold everything in a part of the page."""
    page.evaluate(
        f"document.querySelectorAll('{within} details').forEach(folded => {{ folded.open = true; }})"
    )


def test_a_phone_shows_it_without_sideways_scroll(
    browser: Browser, everything: Comparison, bare_run: Run, others: list[Presentation], tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    path.write_text(render_report([present(everything), present(bare_run), *others]), encoding="utf-8")
    with opened(browser, path, phone=True, dark=True) as page:
        open_all(page)
        scroll_through(page)
        assert set(page.evaluate(GROUNDS)) == DARK
        assert sideways(page) == 0
        assert page.locator(".plot.space canvas").count() >= 2  # a scene for each plan
        assert page.locator(".drawing img").count() >= 3
        for image in page.locator(".drawing img").all():
            assert image.evaluate("image => image.complete && image.naturalWidth > 300")
        sides = page.evaluate("""
            [...document.querySelectorAll(".scroll, .card, .verdict, .facts, .plot")]
                .map(box => box.getBoundingClientRect()).map(box => [box.left, box.right])""")
        assert len(sides) > 20
        assert min(left for left, _ in sides) >= 0
        assert max(right for _, right in sides) <= 390
        assert page.locator(".modebar-btn").count() == 0


def test_every_ink_is_legible_where_it_stands(desk: Page) -> None:
    open_all(desk)
    found = desk.evaluate(CONTRASTS)
    assert len(found) > 200
    faint = {said: ratio for said, ratio in found if ratio < 4.5}  # WCAG 2.2 AA
    assert faint == {}


def test_what_is_drawn_and_tabled_has_a_name(desk: Page) -> None:
    open_all(desk)
    levels = [int(tag[1]) for tag in desk.evaluate(TAGS_OF_HEADINGS)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
    for plot in desk.locator(".plot").all():
        assert plot.get_attribute("role") == "img"
        assert len(plot.get_attribute("aria-label") or "") > 40
    for table in desk.locator("table").all():
        assert table.locator("thead th[scope=col]").count() > 1
        region = table.locator("xpath=..")
        heading = table.locator("xpath=ancestor::section[1]").locator("h2, h3, h4, h5").first
        assert region.get_attribute("aria-label") == heading.inner_text()


def test_a_keyboard_reaches_the_links_and_what_is_folded(desk: Page) -> None:
    desk.keyboard.press("Tab")
    assert desk.evaluate("document.activeElement.textContent") == "Skip to the details"
    assert desk.locator(".skip").bounding_box()["y"] >= 0  # type: ignore[index]
    desk.keyboard.press("Enter")
    assert desk.evaluate("document.activeElement.id") == "details"
    desk.locator("summary").first.focus()
    desk.keyboard.press("Enter")
    assert desk.locator("details").first.get_attribute("open") == ""


def test_what_failed_is_open_and_first_and_what_passed_opens_by_its_link(
    desk: Page, comparison: Comparison
) -> None:
    worst, best = (run.name for run in reversed(comparison.ranking))
    assert [said.split()[0] for said in desk.locator("h3:has(.badge)").all_inner_texts()] == [worst, best]
    assert desk.locator(".summary th a").all_inner_texts() == [worst, best]
    assert desk.locator("#r1-2 .plot").first.is_visible()
    assert desk.locator("#r1-1 .plot").first.is_hidden()
    desk.locator(".summary th a", has_text=best).click()
    desk.locator("#r1-1 .plot").first.wait_for(state="visible")
    assert 0 <= there(desk.locator("#r1-1").bounding_box())["y"] < 200


def test_paper_is_light_shows_what_passed_and_cuts_nothing_and_the_screen_is_as_before(desk: Page) -> None:
    desk.emulate_media(color_scheme="dark")
    desk.set_viewport_size({**DESK, "width": 688})  # what an A4 page holds between margins of 14 mm
    scroll_through(desk)
    until(desk, f"{GROUNDS}.every(ground => {sorted(DARK)}.includes(ground))")  # each figure in its own frame
    assert set(desk.evaluate(GROUNDS)) == DARK
    folded = desk.locator("details:not([open])").count()
    passed = desk.locator("details.passed").count()
    heights = desk.evaluate("[...document.querySelectorAll('.plot')].map(p => p.style.height)")
    assert passed > 0
    desk.emulate_media(media="print")
    desk.evaluate(TWO_FRAMES)
    assert set(desk.evaluate(GROUNDS)) == LIGHT
    assert desk.locator("details:not([open])").count() == folded - passed
    assert desk.locator(".plot[data-drawn]").count() >= desk.locator(".plot:visible").count() > 5
    opened_for_print = desk.evaluate(OPEN)
    open_all(desk)
    cut = desk.evaluate("[...document.querySelectorAll('.scroll')].map(s => s.scrollWidth - s.clientWidth)")
    assert max(cut) == 0
    assert sideways(desk) == 0
    desk.evaluate(SET_OPEN, opened_for_print)
    desk.emulate_media(media="screen")
    desk.evaluate(TWO_FRAMES)
    assert set(desk.evaluate(GROUNDS)) == DARK
    assert desk.locator("details:not([open])").count() == folded
    assert desk.evaluate("[...document.querySelectorAll('.plot')].map(p => p.style.height)") == heights
    until(desk, f"{SIDEWAYS} === 0")  # figures take their width again one after the other


def printed_pages(page: Page) -> list[tuple[float, float]]:
    """The width and the height of each page of the print, in points."""
    printed = page.pdf(format="A4", print_background=True, prefer_css_page_size=True)
    sizes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", printed)
    return [(float(width), float(height)) for width, height in sizes]


def test_four_logs_take_a_page_each_and_three_for_the_rest(browser: Browser, tmp_path: Path) -> None:
    """The report that `urmpipe demo` writes, with the same options, of some rows of the same logs."""
    lay_thinned_logs(tmp_path)
    names = ("solidworks", "coppeliasim.csv", "matlab.csv", "counter_rotating.csv")
    logs = [tmp_path / name for name in names]
    compared = urmpipe.diagnose(tmp_path / "path.csv", logs, robot="urm6")
    path = tmp_path / "demo.html"
    path.write_text(render_report([present(compared)]), encoding="utf-8")
    with opened(browser, path) as page:
        page.locator(".plot:visible .main-svg").first.wait_for()
        titles = page.locator(".level3 h3").all_inner_texts()
        assert titles[0].split() == ["counter_rotating", "FAIL"]
        assert page.locator(".level3 details.passed").count() == 3
        axis = page.locator("#r1-4 .plot").first.evaluate("p => p.layout.yaxis.ticktext")
        assert axis == ["−500", "−3.5", "0", "3.5", "500"]  # the tolerance is seen beside 807 mm
        page.set_viewport_size(PHONE)
        scroll_through(page)
        assert sideways(page) == 0
        page.set_viewport_size(DESK)
        printed = printed_pages(page)
        assert len(printed) <= 10
        assert {(round(width), round(height)) for width, height in printed} == {(595, 842)}  # A4 in points
        page.emulate_media(media="print")
        logs_of_page = "[...document.querySelectorAll('.level3')]"
        breaks = page.evaluate(f"{logs_of_page}.map(p => getComputedStyle(p).breakBefore)")
        assert breaks == ["auto", "page", "page", "page"]  # the worst is printed below the verdict


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
