"""What the report says of an earlier comparison: what is worse, by how much, what is gone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.baseline import against_baseline
from urmpipe_pipeline.comparison.change_wording import share_words, since_words
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.report.baseline_table import baseline_table
from urmpipe_pipeline.report.page import lay_out


def of_one(comparison: Comparison, index: int) -> Comparison:
    return replace(comparison, name=("last month", "now")[index], runs=(comparison.runs[index],))


def test_what_is_worse_stands_first_with_its_numbers(comparison: Comparison) -> None:
    before, now = of_one(comparison, 0), of_one(comparison, 1)
    found = against_baseline(now, replace(before, recording=Path("october.rrd")), 1e-5)
    table = baseline_table(found)
    assert table.title == f"Against the baseline last month: {len(found.worse)} quantities worse"
    titles = [column.title for column in table.columns]
    rows = [dict(zip(titles, (cell.text for cell in row), strict=True)) for row in table.rows]
    marked = [row["Worse"] != text.NOTHING for row in rows]
    assert marked == sorted(marked, reverse=True) and any(marked)
    x, old, new = rows[0], before.runs[0].statistics["x"], now.runs[0].statistics["x"]
    assert (x["Log"], x["Quantity"], x["Worse"]) == ("joint-off", "Δx [mm]", "max, rms, out")
    assert (x["max before"], x["max now"]) == (
        text.number(old.max, "m", new.max),
        text.number(new.max, "m", old.max),
    )
    assert (x["out before"], x["out now"]) == ("0 %", text.percent(new.share_out or 0.0))
    assert "samples now" not in titles
    assert table.note == (
        "Baseline: october.rrd. Made otherwise: log of joint-off."
        " Only what changed by more than the noise is listed."
    )


def test_shares_that_count_as_changed_differ_as_they_do_in_the_terminal(comparison: Comparison) -> None:
    now = of_one(comparison, 1)
    found = against_baseline(now, now)
    x = found.changes[0]
    before = replace(x.now, out_of_tolerance=99_000, share_out=0.99)
    after = replace(x.now, out_of_tolerance=99_004, share_out=0.99004)
    more = replace(x, before=before, now=after, share_noise=(0.0, 0.0))
    table = baseline_table(replace(found, changes=(more,)))
    row = {column.title: cell.text for column, cell in zip(table.columns, table.rows[0], strict=True)}
    assert (row["Worse"], row["out before"], row["out now"]) == ("out", "99 %", "99.004 %")
    assert share_words(more) == "99 % → 99.004 %"


def test_what_is_gone_or_nothing_is_said_in_the_title(comparison: Comparison) -> None:
    less = replace(comparison, runs=comparison.runs[:1])
    gone = baseline_table(against_baseline(less, comparison))
    assert gone.title == f"Against the baseline {comparison.name}: 1 gone"
    assert "Gone: joint-off." in gone.note
    nothing = baseline_table(against_baseline(comparison, comparison))
    assert nothing.title == f"Against the baseline {comparison.name}: nothing worse"
    assert nothing.rows == ()


def test_the_page_says_what_changed_before_anything_else_but_the_verdict(comparison: Comparison) -> None:
    before, now = of_one(comparison, 1), of_one(comparison, 0)
    held = replace(now, baseline=against_baseline(now, before))
    page = lay_out([held])
    (table,) = page.summaries[0].tables
    assert held.baseline is not None and table == baseline_table(held.baseline)
    told = {fact.name: fact.value for fact in page.parts[0].facts}
    assert told["Against the baseline"] == since_words(held.baseline)
    assert lay_out([now]).summaries[0].tables == ()
