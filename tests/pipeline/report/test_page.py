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

from urmpipe_models.errors import OptionError, OutputError
from urmpipe_models.kinematics import point_over_log
from urmpipe_pipeline.audit_entry import AuditEntry
from urmpipe_pipeline.compare import compare_runs
from urmpipe_pipeline.comparison import AXES, Comparison
from urmpipe_pipeline.report import render_report, tables, text, write_report
from urmpipe_pipeline.report.banner import banner
from urmpipe_pipeline.report.markup import script_json
from urmpipe_pipeline.results import Run

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


@pytest.fixture(scope="module")
def html(comparison: Comparison, bare_run: Run) -> str:
    return render_report([comparison, bare_run])


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def test_the_head_tells_who_made_it(html: str) -> None:
    assert re.search(r'<meta name="generator" content="urmpipe \d+\.\d+\.\d+">', html[:400])
    assert html.startswith('<!doctype html>\n<html lang="en">')


def test_the_verdict_stands_first_in_words(page: Page, comparison: Comparison) -> None:
    (_, said) = page.all("h1")[0]
    assert said == "FAIL 1 of 2 logs is out of tolerance: joint-off"
    assert page.all("title")[0][1] == "FAIL: against-path, bare - urmpipe report"


def test_numbers_are_those_of_the_json(page: Page, comparison: Comparison) -> None:
    cells = [cell for _, cell in page.all("td")]
    for run in comparison.to_dict()["runs"]:
        for axis in AXES:
            statistics = run["delta"][axis]
            for key in ("rms", "mean", "std", "p95"):
                written = next(cell for cell in cells if cell == text.millimetres(statistics[key]))
                # the last digit printed is a tenth of a micrometre, or the fourth of a tiny number
                assert float(written) / 1e3 == pytest.approx(statistics[key], abs=5.1e-8, rel=5e-4)


def test_the_verdict_table_has_one_line_a_log(comparison: Comparison) -> None:
    table = tables.verdict_table(comparison, ["#a", "#b"])
    shifted, off = table.rows
    assert [column.title for column in table.columns] == [
        "Log",
        "Verdict",
        "max |Δx| [mm]",
        "max |Δy| [mm]",
        "max |Δz| [mm]",
        "max ‖Δ‖ [mm]",
        "Samples out",
        "Worst at t [s]",
        "Worst at x, y, z [m]",
    ]
    assert [cell.text for cell in shifted[:7]] == [
        "shifted", "PASS", "0.0000", "0.0000", "2.5000", "2.5000", "0 %",
    ]  # fmt: skip
    assert shifted[4].used == pytest.approx(2.5 / 3.5)
    worst = off[5]
    assert worst.text == f"{comparison.runs[1].statistics['norm'].max * 1e3:.4f}"
    assert off[1].state == "fail"
    assert any(cell.state == "fail" and cell.used == 1.0 for cell in off[2:5])
    assert off[6].text == text.percent(comparison.runs[1].share_out)


def test_start_poses_and_audit_are_told(page: Page, comparison: Comparison) -> None:
    said = " ".join(words for _, words in page.all("td", "th", "p", "dd"))
    for run in comparison.runs:
        for value in run.start:
            assert text.millimetres(value) in said
        for item in run.run.repolarizations:
            assert f"{item.step:+.6f}" in said
            assert text.seconds(item.t) in said
    assert "agreement of the start poses (mutual calibration) at t = 0.000 s" in said
    assert "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08" in said
    assert "every line has 7 fields with it" in said


def test_headings_step_down_one_at_a_time(page: Page) -> None:
    levels = [int(tag[1]) for tag, _, _ in page.elements if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(next_ - level <= 1 for level, next_ in pairwise(levels))


def test_tables_and_figures_are_told_to_a_screen_reader(page: Page) -> None:
    heads = page.all("th")
    assert heads
    assert all(attrs.get("scope") in ("col", "row") for attrs, _ in heads)
    plots = [attrs for tag, attrs, _ in page.elements if (attrs.get("class") or "").startswith("plot")]
    assert len(plots) == 1 + 2 * 8 + 1  # of both logs together, of each, the joints of the bare one
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
    html = render_report([hostile, hostile.runs[0].run])
    page = Page(html)
    assert not page.all("img")
    assert not page.all("b")
    assert "<img" not in html
    scripts = [attrs for attrs, _ in page.all("script")]
    assert len(scripts) == 6 + 3 + 2  # figures of the compared log and of the ingested one; the code
    for attrs, spec in page.all("script"):
        if attrs:
            assert json.loads(spec)["data"]
    assert any(said == hostile.runs[0].name for _, said in page.all("td"))
    assert any(hostile.runs[0].name in said for _, said in page.all("h1"))


def test_json_in_a_script_comes_back() -> None:
    value = {"a": ["</script>", "<!--", "&amp;", "\u2028"]}
    written = str(script_json(value))
    assert not set("<>&\u2028") & set(written)
    assert json.loads(written) == value
    with pytest.raises(ValueError, match="not JSON compliant"):
        script_json([float("nan")])


def test_a_banner_of_logs_that_pass(comparison: Comparison) -> None:
    one = replace(comparison, runs=comparison.runs[:1])
    said = banner([one], [])
    assert (said.state, said.word, said.headline) == ("pass", "PASS", "shifted is within tolerance")
    assert said.detail.startswith("Closest to the limit: |Δz| = 2.5000 mm of 3.5 mm allowed, at t = ")
    assert said.detail.endswith(" s (shifted). Reference: path. Tolerance: ±3.5 mm per axis.")
    two = replace(comparison, runs=comparison.runs[:1] * 2)
    assert banner([two], []).headline == "all 2 logs are within tolerance"


def test_a_banner_of_logs_that_fail(comparison: Comparison) -> None:
    said = banner([comparison, comparison], [])
    assert said.headline == "2 of 4 logs are out of tolerance: joint-off, joint-off"
    assert said.detail.startswith("Furthest out: |Δ")
    many = replace(comparison, runs=comparison.runs[1:] * 4)
    assert banner([many], []).headline == "all 4 logs are out of tolerance"


def test_a_banner_without_a_comparison(bare_run: Run) -> None:
    said = banner([], [bare_run])
    count = len(bare_run.repolarizations)
    assert said.word == "INGESTED"
    assert said.headline == f"bare: 3000 rows, {count} repolarizations"
    assert said.detail == "0 warnings. Nothing was compared: there is no verdict."


def test_a_long_audit_is_folded_and_a_very_long_one_cut(bare_run: Run) -> None:
    item = AuditEntry("phi1", 2, 0.0075, 0.0025, -6.28, 0, 1)
    short = tables.audit_table(replace(bare_run, audit=(item,) * 12))
    folded = tables.audit_table(replace(bare_run, audit=(item,) * 13))
    cut = tables.audit_table(replace(bare_run, audit=(item,) * 700))
    assert (short.folded, folded.folded, cut.folded) == (False, True, True)
    assert (cut.title, len(cut.rows)) == ("Audit of the repolarizer (700 wraps)", 500)
    assert cut.note == "200 more; the JSON output lists them all."


def test_the_audit_says_what_its_kinds_mean(bare_run: Run) -> None:
    wrap = AuditEntry("phi1", 2, 0.0075, 0.0025, -6.28, 0, 1)
    table = tables.audit_table(
        replace(bare_run, audit=(wrap, replace(wrap, kind="repaired"), replace(wrap, kind="ambiguous")))
    )
    assert [row[0].text for row in table.rows] == ["wrap", "repaired", "ambiguous"]
    assert table.title == "Audit of the repolarizer (1 wrap)"
    assert table.note == (
        "repaired: a sample that a linear resampling left on a wrap, put on the line of its neighbours, Step"
        " rad away. ambiguous: a gap in which the joint can have turned more than half a period."
    )


def test_a_report_of_four_logs_is_small(comparison: Comparison) -> None:
    four = replace(comparison, runs=comparison.runs * 2)
    # every trace is decimated to the same number of points, however long the log is
    assert len(render_report([four]).encode()) < 15e6


def test_writing_replaces_a_report_of_ours_and_nothing_else(bare_run: Run, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    assert write_report([bare_run], path) == path
    first = path.read_bytes()
    assert first.decode("utf-8") == render_report([bare_run])
    write_report([replace(bare_run, name="other")], path)
    assert path.read_bytes() != first
    with pytest.raises(OutputError, match="found an input of this command"):
        write_report([bare_run], path, [path])
    foreign = tmp_path / "mine.html"
    foreign.write_text("<html></html>")
    with pytest.raises(OutputError, match="found a file that is no report of urmpipe's"):
        write_report([bare_run], foreign)
    assert foreign.read_text() == "<html></html>"
    assert {file.name for file in tmp_path.iterdir()} == {"report.html", "mine.html"}


@pytest.mark.filterwarnings("error")
def test_a_log_of_one_sample_and_a_path_have_pages_too(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    assert run.robot is not None
    log = replace(run.log, t_ns=run.log.t_ns[:1], q=run.log.q[:1])
    one = point_over_log(run.robot, run.q[:1], run.qd[:1] * np.nan, run.qdd[:1] * np.nan)
    single = replace(run, log=log, t_ns=run.t_ns[:1], q=run.q[:1], qd=run.qd[:1], tcp=one, audit=())
    nothing = np.empty((1, 0))
    path = replace(
        single,
        log=replace(log, joints=(), q=nothing),
        robot=None,
        q=nothing,
        tcp=None,
        tcp_recorded=one.position,
    )
    result = compare_runs(path, [single])
    page = Page(render_report([result, single, path]))
    plots = [attrs for _, attrs, _ in page.elements if (attrs.get("class") or "").startswith("plot")]
    assert len(plots) == 4 + 3 + 2
    assert [said for _, said in page.all("h1")] == ["PASS shifted is within tolerance"]


def test_nothing_to_report_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OptionError) as caught:
        write_report([], tmp_path / "report.html")
    assert str(caught.value) == "a report needs at least one run or comparison; found none"
    assert not list(tmp_path.iterdir())
