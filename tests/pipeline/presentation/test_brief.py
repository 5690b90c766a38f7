"""What is shown where there is little room: the worst of a table of verdicts."""

from __future__ import annotations

from urmpipe_pipeline.presentation.brief import rows_within
from urmpipe_pipeline.presentation.section import Column, Judged, Table


def test_of_a_long_table_of_verdicts_the_worst_rows_are_shown() -> None:
    names = Column("name", "Name", list("abcde"))
    verdicts = (names, Column("verdict", "Verdict", [Judged("pass")] * 5))
    assert list("abcde")[rows_within(Table("plain", (names,)), 3)] == ["a", "b", "c"]
    assert list("abcde")[rows_within(Table("best first", verdicts), 3)] == ["c", "d", "e"]
    assert list("abcde")[rows_within(Table("worst first", verdicts, worst_first=True), 3)] == ["a", "b", "c"]
