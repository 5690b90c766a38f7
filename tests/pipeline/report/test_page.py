"""The page as a file: what it says, that it is whole, safe and well formed."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from urmpipe_models.errors import OptionError, OutputError
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.compare import compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.report import render_report, write_report
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.report.render import asset, script_json
from urmpipe_pipeline.results import present, read_recording, write_recording
from urmpipe_pipeline.runs.run import Run

VOID = {"meta", "br", "img", "link", "input", "hr", "path"}


class Page(HTMLParser):
    """What a browser would see: elements with their attributes and the text inside them."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None], list[str]]] = []
        self._open: list[int] = []
        self.feed(html)
        self.close()
        assert not self._open, [self.elements[i][0] for i in self._open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), []))
        if tag not in VOID:
            self._open.append(len(self.elements) - 1)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), []))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.elements[self._open.pop()][0] == tag

    def handle_data(self, data: str) -> None:
        for i in self._open:
            self.elements[i][2].append(data)

    def all(self, *tags: str) -> list[tuple[dict[str, str | None], str]]:
        """Attributes and text of every element with one of the tags."""
        return [(attrs, "".join(text).strip()) for tag, attrs, text in self.elements if tag in tags]

    def tables(self, title: str) -> list[list[dict[str, str]]]:
        """Every table under such a heading: a dict of its cells by the column's head, one a row."""
        found: list[list[dict[str, str]]] = []
        heading = ""
        heads: list[str] = []
        row: list[str] = []
        for tag, attrs, parts in self.elements:
            said = "".join(parts).strip().replace("\u00a0", " ").removeprefix("out of tolerance: ")
            if tag in ("h2", "h3", "h4", "h5"):
                heading = said
            elif heading.startswith(title) and tag == "table":
                heads, row = [], []
                found.append([])
            elif heading.startswith(title) and attrs.get("scope") == "col":
                heads.append(said)
            elif heading.startswith(title) and (attrs.get("scope") == "row" or tag == "td"):
                row.append(said)
                if len(row) == len(heads):
                    found[-1].append(dict(zip(heads, row, strict=True)))
                    row = []
        return found


@pytest.fixture(scope="module")
def html(comparison: Comparison, bare_run: Run) -> str:
    return render_report([present(comparison), present(bare_run)])


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def test_the_head_tells_who_made_it(html: str) -> None:
    assert re.search(r'<meta name="generator" content="urmpipe \d+\.\d+\.\d+">', html[:400])
    assert html.startswith('<!doctype html>\n<html lang="en">')


def printed_again(cell: str, value: float, factor: float) -> str:
    """A number of the JSON with as many digits as a cell of the page has of it."""
    mantissa, exponent, _ = cell.partition("e")
    digits = len(mantissa.partition(".")[2])
    return f"{value * factor:.{digits}{'e' if exponent else 'f'}}"


@pytest.mark.slow
def test_numbers_are_those_of_the_json_and_the_recording(everything: Comparison, tmp_path: Path) -> None:
    written = write_recording(everything, tmp_path / "all.rrd")
    read = read_recording(written)
    assert isinstance(read, Comparison)
    page = Page(render_report([present(read)]))
    as_json = json.loads(json.dumps(everything.to_dict()))["runs"]
    assert as_json == json.loads(json.dumps(read.to_dict()))["runs"]
    by_unit = zip(
        page.tables("Statistics of position"), page.tables("Statistics of orientation"), strict=True
    )
    worst = reversed(everything.ranking)
    ranked = [next(run for run in as_json if run["name"] == one.name) for one in worst]
    for run, tables in zip(ranked, by_unit, strict=True):
        lengths = [*run["delta"].values(), run["path"]]
        angles = [run["angle"], *run["joints"].values()]
        for rows, statistics, unit, factor in (
            (tables[0], lengths, "mm", 1e3),
            (tables[1], angles, "deg", 180.0 / np.pi),
        ):
            assert len(rows) == len(statistics)
            for row, one in zip(rows, statistics, strict=True):
                for key in (*(("max",) if unit == "deg" else ()), "rms", "p95", "mean", "std"):
                    cell = row[f"{key} [{unit}]"]
                    assert cell == printed_again(cell, one[key], factor)
                assert row["at t [s]"] == text.format_seconds(one["t_max"])
                assert row["samples out"] == str(one["out_of_tolerance"])
                assert row["out"] == text.format_percent(one["out_fraction"])
                assert row["Verdict"] == one["verdict"].upper()


def test_the_audit_is_told(page: Page, comparison: Comparison, bare_run: Run) -> None:
    runs = [*(one.run for one in reversed(comparison.ranking)), bare_run]  # from the worst
    for rows, run in zip(page.tables("Audit"), runs, strict=True):
        for row, item in zip(rows, run.audit, strict=True):
            assert row["Step [deg]"] == f"{np.degrees(item.step):+.1f}"  # four digits of some 350
            assert row["Instant t_r [s]"] == text.format_seconds(item.t)
            assert row["Row"] == str(item.row)


def test_where_it_comes_from_is_told(page: Page) -> None:
    said = " ".join(words for _, words in page.all("td", "p"))
    assert "start poses (mutual calibration) at t = 0.000 s" in said
    assert "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08" in said
    assert "every line has 7 fields with it" in said


def test_the_contents_stand_once(page: Page, comparison: Comparison) -> None:
    """The table at the top leads to each log: with few other parts there is no list beside it."""
    assert not [attrs for attrs, _ in page.all("nav") if attrs["aria-label"] == "Contents"]
    leads = [attrs["href"] for attrs, said in page.all("a") if said in {run.name for run in comparison.runs}]
    assert {"#r1-1", "#r1-2"} <= set(leads)


def test_no_number_of_the_results_stands_twice_on_a_page(comparison: Comparison) -> None:
    """The largest deviations of a log that moves: of a constant one the mean is the same number."""
    page = Page(render_report([present(comparison)]))
    words = [said for _, said in page.all("td", "dd")]
    largest = {
        text.format_number(held.max, held.unit)
        for held in comparison.worst.statistics.values()
        if held.kind != "angle"
    }
    told = [said.removeprefix("out of tolerance: ") for said in words]
    assert {number: told.count(number) for number in largest} == dict.fromkeys(largest, 1)


def test_a_keyboard_can_skip_to_the_details(page: Page) -> None:
    attrs, said = page.all("a")[0]
    assert (attrs["href"], said) == ("#details", "Skip to the details")


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb. Source: WCAG 2.2."""
    channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("setting", ["light", "dark"])
@pytest.mark.parametrize("ink", ["ink", "muted", "pass", "fail", "plain"])
def test_every_ink_is_legible_on_every_ground(ink: str, setting: str) -> None:
    both = asset("style.css").split("@media screen and (prefers-color-scheme: dark)")
    style = both[setting == "dark"]
    variables = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", style.partition("@media")[0]))
    for ground in (value for name, value in variables.items() if name.endswith(("wash", "ground"))):
        dark, light = sorted((luminance(variables[ink]), luminance(ground)))
        assert (light + 0.05) / (dark + 0.05) >= 4.5, (ink, ground)  # WCAG 2.2 AA


def test_the_verdict_stands_first_in_words(page: Page, comparison: Comparison) -> None:
    (_, said) = page.all("h1")[0]
    assert said == ("FAIL 1 of 2 logs (joint-off) out of tolerance against path, by the joints on both sides")
    assert page.all("title")[0][1] == "FAIL: against-path, bare - urmpipe report"


def test_headings_step_down_one_at_a_time(page: Page) -> None:
    levels = [int(tag[1]) for tag, _, _ in page.elements if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(next_ - level <= 1 for level, next_ in pairwise(levels))


def test_tables_and_figures_are_told_to_a_screen_reader(
    page: Page, comparison: Comparison, bare_run: Run
) -> None:
    heads = page.all("th")
    assert heads
    assert all(attrs.get("scope") in ("col", "row") for attrs, _ in heads)
    plots = [attrs for tag, attrs, _ in page.elements if (attrs.get("class") or "").startswith("plot")]
    assert len(plots) == len(lay_out([present(comparison), present(bare_run)]).figures)
    assert all(attrs["role"] == "img" and len(attrs["aria-label"] or "") > 40 for attrs in plots)
    assert len(page.all("figcaption")) == len(plots)
    assert page.all("noscript")


def test_links_lead_to_what_is_there_and_nothing_is_loaded(page: Page) -> None:
    idents = [attrs["id"] for _, attrs, _ in page.elements if "id" in attrs]
    assert len(set(idents)) == len(idents)
    for attrs, _ in page.all("a"):
        assert (attrs["href"] or "").removeprefix("#") in idents
    assert not any("src" in attrs for _, attrs, _ in page.elements)
    assert all((attrs["href"] or "").startswith("#") for _, attrs, _ in page.elements if "href" in attrs)
    assert not page.all("link", "img", "iframe")


def test_only_the_scripts_of_the_page_may_run(page: Page) -> None:
    (policy,) = [
        a["content"] for a, _ in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy"
    ]
    assert policy is not None
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    scripts = [text for tag, attrs, text in page.elements if tag == "script" and "type" not in attrs]
    assert len(scripts) == 2
    for script in scripts:
        digest = hashlib.sha256("".join(script).encode()).digest()
        assert f"'sha256-{base64.b64encode(digest).decode()}'" in policy


def test_hostile_texts_stay_texts(hostile: Comparison) -> None:
    html = render_report([present(hostile), present(hostile.runs[0].run)])
    page = Page(html)
    assert not page.all("img")
    assert not page.all("b")
    assert "<img" not in html
    scripts = [attrs for attrs, _ in page.all("script")]
    drawn = lay_out([present(hostile), present(hostile.runs[0].run)]).figures
    assert len(scripts) == len(drawn) + 2  # a figure each, and the code
    for attrs, spec in page.all("script"):
        if attrs:
            assert json.loads(spec)["data"]
    assert any(said == hostile.runs[0].run.name for _, said in page.all("td"))
    assert any(hostile.runs[0].name in said for _, said in page.all("h1"))


def test_json_in_a_script_comes_back() -> None:
    value = {"a": ["</script>", "<!--", "&amp;", "\u2028"]}
    written = str(script_json(value))
    assert not set("<>&\u2028") & set(written)
    assert json.loads(written) == value
    with pytest.raises(ValueError, match="not JSON compliant"):
        script_json([float("nan")])


@pytest.mark.slow
def test_a_report_of_four_logs_is_small(comparison: Comparison) -> None:
    four = replace(comparison, runs=comparison.runs * 2)
    # every trace is decimated to the same number of points, however long the log is
    assert len(render_report([present(four)]).encode()) < 15e6


def test_writing_replaces_a_report_of_ours_and_nothing_else(bare_run: Run, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    assert write_report([present(bare_run)], path).path == path
    first = path.read_bytes()
    assert first.decode("utf-8") == render_report([present(bare_run)])
    write_report([present(replace(bare_run, name="other"))], path)
    assert path.read_bytes() != first
    with pytest.raises(OutputError, match="found an input of this command"):
        write_report([present(bare_run)], path, [path])
    foreign = tmp_path / "mine.html"
    foreign.write_text("<html></html>")
    with pytest.raises(OutputError, match="found a file that is not a report of urmpipe"):
        write_report([present(bare_run)], foreign)
    assert foreign.read_text() == "<html></html>"
    assert {file.name for file in tmp_path.iterdir()} == {"report.html", "mine.html"}


@pytest.mark.filterwarnings("error")
def test_a_log_of_one_sample_and_a_path_have_pages_too(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    log = replace(run.log, t_ns=run.log.t_ns[:1], q=run.log.q[:1])
    one = point_over_log(there(run.robot), run.q[:1], run.qd[:1] * np.nan, run.qdd[:1] * np.nan)
    single = replace(run, log=log, t_ns=run.t_ns[:1], q=run.q[:1], qd=run.qd[:1], tcp=one, audit=())
    nothing = np.empty((1, 0))
    path = replace(
        single,
        log=replace(log, joints=(), q=nothing, tcp_position=one.position),
        robot=None,
        q=nothing,
        tcp=None,
        tcp_recorded=one.position,
    )
    result = compare_runs(path, [single])
    page = Page(render_report([present(result), present(single), present(path)]))
    assert len([part for part in page.all("section") if "part" in (part[0]["class"] or "")]) == 4
    assert [said for _, said in page.all("h1")] == ["PASS shifted-2 within tolerance against shifted"]


def test_nothing_to_report_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OptionError) as caught:
        write_report([], tmp_path / "report.html")
    assert str(caught.value) == "a report needs at least one run, comparison or simulation; found none"
    assert not list(tmp_path.iterdir())
