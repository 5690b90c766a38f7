"""The banner, the cards, and results side by side: the worst first, nothing hidden behind it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.section import (
    Cell,
    Column,
    Fact,
    Judged,
    Presentation,
    Ref,
    Section,
    Table,
    Value,
    Verdict,
)
from urmpipe_pipeline.report.page import Page, lay_out


def off(used: float | None, verdict: Verdict) -> Fact:
    """A deviation held against 3.5 mm."""
    number = None if used is None or math.isinf(used) else 0.0035 * used
    return Fact("|Δx|", Value(number, "m", 0.0035, verdict, used), "of the tolerance")


def judged(title: str, verdict: Verdict, used: float | None, *facts: Fact) -> Section:
    return Section(title, verdict, (off(used, verdict), *facts))


ROWS = (Fact("Rows", Value(3)),)


def toy(
    name: str,
    verdict: Verdict,
    *sections: Section,
    word: str = "",
    tables: tuple[Table, ...] = (),
    facts: tuple[Fact, ...] = ROWS,
    **more: Any,
) -> Presentation:
    body = Section(f"Toy {name}", verdict, facts, tables, sections=sections)
    which = (Fact("Which", Ref(f"{name}-1")),)
    return Presentation(name, f"{name} came out", verdict, which, body, word, **more)


def names(page: Page) -> list[str]:
    """The cards of a page from the top."""
    return [card.name for summary in page.summaries for card in summary.cards]


def test_the_worst_result_leads_and_the_others_stand_below() -> None:
    near, far = judged("near-1", "pass", 0.9), judged("far-1", "fail", 2.0)
    further = judged("further-1", "fail", 3.0)
    read = toy("log", None, word="ingested")
    page = lay_out(
        [toy("near", "pass", near), read, toy("far", "fail", far), toy("further", "fail", further)]
    )
    banner = page.banner
    assert (banner.state, banner.word, banner.headline) == ("fail", "FAIL", "2 of 3 results")
    assert banner.others == (
        "FAIL: further came out.", "FAIL: far came out.", "PASS: near came out.", "INGESTED: log came out.",
    )  # fmt: skip
    assert [(fact.name, fact.value, fact.href) for fact in banner.facts] == [("Which", "further-1", "#r4-1")]
    assert page.title == "near, log, far, further"
    assert [part.title for part in page.parts] == ["Toy further", "Toy far", "Toy near", "Toy log"]


def test_many_other_results_are_counted() -> None:
    page = lay_out([toy(f"t{k}", "pass" if k else "fail") for k in range(8)])
    told = ("FAIL: t0 came out.", *(f"PASS: t{k} came out." for k in range(1, 4)))
    assert page.banner.others == (*told, "And 4 more: PASS.")


def test_the_banner_counts_the_logs_of_all_recordings() -> None:
    """Logs that fail, in how many recordings; results alone where a result fails for another reason."""

    def recorded(name: str, verdict: Verdict, *logs: Verdict) -> Presentation:
        lines = tuple({"Log": f"log {k}", "Verdict": Judged(one)} for k, one in enumerate(logs))
        return toy(name, verdict, lines=lines, recording=f"{name}.rrd")

    good, bad = recorded("good", "pass", "pass"), recorded("bad", "fail", "pass", "fail", "fail")
    assert lay_out([good, bad]).banner.headline == "2 of 4 logs, in 1 of 2 recordings"
    assert lay_out([good, good]).banner.headline == "all 2 logs"
    assert lay_out([good, bad, recorded("worse", "fail", "pass")]).banner.headline == "2 of 3 recordings"
    assert lay_out([bad, toy("alone", "pass")]).banner.headline == "2 of 3 logs, in 1 of 2 results"
    assert lay_out([bad, toy("read", None)]).banner.headline == "bad came out"


def test_nothing_judged_is_no_verdict() -> None:
    page = lay_out([toy("log", None, word="ingested")])
    assert (page.banner.state, page.banner.word) == ("plain", "INGESTED")
    assert page.summaries == ()  # it stands below
    assert page.parts[0].state == ""


def test_each_judged_part_has_a_card_the_worst_first() -> None:
    warned = Section("joints", warnings=(LogWarning("gap", "a gap"),))
    sections = (
        judged("good", "pass", 0.457),
        Section(
            "bad", "fail", (off(231.0, "fail"), Fact("When", Value(35.535, "s"), "help")), sections=(warned,)
        ),
        judged("blind", "fail", math.inf),
        Section("about"),
    )
    page = lay_out([toy("four", "fail", *sections)])
    (summary,) = page.summaries
    assert summary.title == "Verdicts, the worst first"
    told = [(card.name, card.href, card.state, card.size, card.share, card.used) for card in summary.cards]
    assert told == [
        ("blind", "#r1-3", "fail", "|Δx|", 1.0, ""),
        ("bad", "#r1-2", "fail", "|Δx|", 1.0, "231 times the limit"),
        ("good", "#r1-1", "pass", "|Δx|", 0.457, "45.7 % of the limit"),
    ]
    below = page.parts[0].parts
    assert [(part.title, part.folded) for part in below] == [
        ("blind", False), ("bad", False), ("good", True), ("about", False),
    ]  # fmt: skip


def test_a_result_that_fails_for_a_reason_of_its_own_has_a_card_beside_its_parts() -> None:
    meter = judged("meter", "pass", 0.5)
    assert names(lay_out([toy("broken", "fail", meter)])) == ["Toy broken", "meter"]
    assert names(lay_out([toy("sound", "pass", meter)])) == []  # the only judged part


def test_a_judged_part_that_says_nothing_of_itself_has_no_card_of_its_own() -> None:
    gone = judged("baseline", "fail", None), Section("gone", "fail")
    outer = Section("baseline", "fail", (Fact("Since then", "1 gone"),), sections=gone[1:])
    assert names(lay_out([toy("now", "fail", judged("log", "pass", 0.5), outer)])) == ["baseline", "log"]
    assert names(lay_out([toy("bare", "pass", facts=())])) == []


def test_tables_about_the_parts_stand_with_the_cards_and_others_in_the_part() -> None:
    ranking = Table("Ranking", (Column("log", "Log", [Ref("a")]), Column("n", "n", [Value(1)])))
    other = Table("Signals", (Column("signal", "Signal", ["x"]), Column("n", "n", [Value(1)])))
    shown = toy("one", "pass", judged("a", "pass", 0.1), tables=(ranking, other))
    page = lay_out([shown])
    assert [table.title for table in page.summaries[0].tables] == ["Ranking"]
    assert page.summaries[0].tables[0].rows[0][0].href == "#r1-1"
    assert [block.title for block in page.parts[0].blocks] == ["Signals"]
    both = lay_out([toy("read", None, word="ingested"), shown])
    assert [(one.title, len(one.cards)) for one in both.summaries] == [
        ("Verdicts: Toy one", 0),
    ]  # fmt: skip
    ordered = replace(shown, body=replace(shown.body, tables=(replace(ranking, worst_first=True),)))
    assert [one.title for one in lay_out([ordered]).summaries] == ["Verdicts, the worst first"]


def line(name: Cell, **cells: Cell) -> Mapping[str, Cell]:
    return {"Log": name} | cells


def test_results_with_one_kind_of_line_stand_side_by_side() -> None:
    october = toy(
        "october", "pass", Section("log"), lines=(line(Ref("log"), Verdict=Judged("pass"), x=Value(1)),)
    )
    november = toy(
        "november", "fail", Section("log"),
        lines=(
            line(Ref("log"), Verdict=Judged("fail"), worse="in 1 quantity"),
            line("gone", Verdict=Judged(None)),
        ),
    )  # fmt: skip
    alone = toy("system", None, lines=({"System": "system", "Verdict": Judged(None)},))
    page = lay_out([november, october, alone])
    (table,) = page.summaries[0].tables
    assert table.title == "Log: 2 results"
    assert [head for head, _ in table.heads] == ["Log", "Verdict", "worse", "x"]
    found = [(row[0].text, row[0].href, *(cell.text for cell in row[1:])) for row in table.rows]
    assert found == [
        ("log", "#r1-1", "FAIL", "in 1 quantity", "–"),
        ("log", "#r2-1", "PASS", "–", "1"),
        ("gone", "#r1", "–", "–", "–"),
    ]
    assert lay_out([october]).summaries == ()


@pytest.mark.parametrize("several", [False, True])
def test_cards_of_several_results_say_whose_they_are(several: bool) -> None:
    one = toy("monday", "pass", judged("log", "pass", 0.2))
    page = lay_out([one, toy("tuesday", "fail", judged("log", "fail", 1.2))] if several else [one])
    assert names(page) == (["log (tuesday)", "log (monday)"] if several else [])


def test_results_of_one_title_are_told_apart_by_when_they_were_made() -> None:
    made = [toy("log", "pass", created=f"2026-{month}-22T05:06:07+00:00") for month in (10, 11)]
    assert [part.title for part in lay_out(made).parts] == [
        "Toy log (2026-10-22 05:06)", "Toy log (2026-11-22 05:06)",
    ]  # fmt: skip
    assert lay_out(made[:1]).parts[0].title == "Toy log"
    named = [replace(one, recording=name) for one, name in zip(made, ("cell.rrd", "arm.rrd"), strict=True)]
    assert [part.title for part in lay_out(named).parts] == ["Toy log (cell.rrd)", "Toy log (arm.rrd)"]
    of_one_name = [replace(one, recording="log.rrd") for one in made]
    assert lay_out(of_one_name).parts[0].title == "Toy log (2026-10-22 05:06)"
