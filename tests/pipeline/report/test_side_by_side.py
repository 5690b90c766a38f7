"""Several comparisons on one page, such as those of two months: which is which, and what differs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.baseline import against_baseline
from urmpipe_pipeline.comparison.change import Absent
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.report.verdict_tables import side_by_side


def of_month(comparison: Comparison, index: int, month: int) -> Comparison:
    run = replace(comparison.runs[index], name="log")
    created = replace(comparison.provenance, created=f"2026-{month}-22T05:06:07+00:00")
    recording = Path(f"{month}/verdict.rrd")
    return replace(comparison, name="log-against-path", runs=(run,), provenance=created, recording=recording)


def test_comparisons_of_one_name_stand_apart_by_recording_and_date(comparison: Comparison) -> None:
    october, november = of_month(comparison, 0, 10), of_month(comparison, 1, 11)
    page = lay_out([october, november])
    beside, *cards = page.summaries
    assert beside.title == "2 comparisons side by side"
    assert [one.title for one in cards] == [
        "Verdict against path (10/verdict.rrd)",
        "Verdict against path (11/verdict.rrd)",
    ]
    assert [one.title for one in page.parts] == [
        "Comparison log-against-path (10/verdict.rrd)",
        "Comparison log-against-path (11/verdict.rrd)",
    ]
    (table,) = beside.tables
    titles = [column.title for column in table.columns]
    assert titles[:5] == ["Log", "Recording", "Made", "Reference", "Verdict"]
    assert "Worse than its baseline" not in titles
    found = [[cell.text for cell in row] for row in table.rows]
    assert [row[:5] for row in found] == [
        ["log", "10/verdict.rrd", "2026-10-22 05:06 UTC", "path", "PASS"],
        ["log", "11/verdict.rrd", "2026-11-22 05:06 UTC", "path", "FAIL"],
    ]
    assert [row[0].href for row in table.rows] == ["#c1-1", "#c2-1"]
    at = titles.index("max |Δx| [mm]")
    for row, one in zip(found, (october, november), strict=True):
        assert row[at] == text.millimetres(one.runs[0].statistics["x"].max, 0.0035)


def test_logs_of_one_name_stand_below_each_other(comparison: Comparison) -> None:
    links = [["#a", "#b"], ["#c", "#d"]]
    table = side_by_side([comparison, comparison], links)
    assert [(row[0].text, row[0].href) for row in table.rows] == [
        ("shifted", "#a"), ("shifted", "#c"), ("joint-off", "#b"), ("joint-off", "#d"),
    ]  # fmt: skip


def test_what_is_worse_than_its_baseline_is_counted(comparison: Comparison) -> None:
    october, november = of_month(comparison, 0, 10), of_month(comparison, 1, 11)
    held = replace(november, baseline=against_baseline(november, october))
    assert held.baseline is not None
    table = side_by_side([october, held], [["#a"], ["#b"]])
    at = [column.title for column in table.columns].index("Worse than its baseline")
    told = [row[at].text for row in table.rows]
    assert told == [text.NOTHING, f"in {len(held.baseline.worse)} quantities"]
    gone = replace(held.baseline, changes=(), gone=(Absent("log", "angle"), Absent("other")))
    table = side_by_side([october, replace(held, baseline=gone)], [["#a"], ["#b"]])
    assert [row[at].text for row in table.rows] == [text.NOTHING, "in 1 quantity"]


def test_a_comparison_alone_is_as_it_was(comparison: Comparison) -> None:
    page = lay_out([of_month(comparison, 0, 10)])
    assert [one.title for one in page.summaries] == ["Verdict against path"]
    assert [one.title for one in page.parts] == ["Comparison log-against-path"]
    assert {fact.name: fact.value for fact in page.parts[0].facts}["Made"] == "2026-10-22 05:06 UTC"
