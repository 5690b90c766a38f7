"""What a person reads of any result: the verdict first, tables that fit, and no more than a person reads."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from rich.cells import cell_len

from urmpipe.printing import terminal as printing
from urmpipe.printing.results import print_presentation, print_verdict
from urmpipe.printing.terminal import LISTED, new_console
from urmpipe_pipeline.presentation.section import (
    Column,
    Fact,
    Judged,
    Place,
    Presentation,
    Ref,
    Section,
    Table,
    Value,
    Verdict,
)

Captured = pytest.CaptureFixture[str]


def table(rows: int = 2, columns: int = 2, *, brief: bool = True) -> Table:
    """A ranking from best to worst, with a column that has no value and one that is not brief."""
    return Table(
        "Largest deviations",
        (
            Column("log", "Log", [Ref(f"log {i}") for i in range(rows)]),
            Column("verdict", "Verdict", [Judged("pass")] * (rows - 1) + [Judged("fail")]),
            *(
                Column(f"max_{j}", f"max {j}", [Value(0.001 * i, "m", limit=0.0035) for i in range(rows)])
                for j in range(columns)
            ),
            Column("angle", "never there", [Value(None, "rad")] * rows),
            Column("row", "rarely read", [Value(i) for i in range(rows)], brief=False),
        ),
        brief=brief,
    )


def section(title: str, verdict: Verdict = None, tables: Sequence[Table] = ()) -> Section:
    return Section(
        title, verdict, (Fact("Clocks", "aligned"), Fact("Made", "today", brief=False)), tuple(tables)
    )


def shown(*sections: Section, tables: Sequence[Table] = (), verdict: Verdict = "fail") -> Presentation:
    facts = (Fact("Largest", Value(0.0045, "m", 0.0035)), Fact("Position", Place((0.2, 0.0, 0.9955))))
    body = Section(
        "Comparison", verdict, (*facts[:1], Fact("Nothing", None)), tuple(tables), sections=sections
    )
    return Presentation("name", "one log out of tolerance", verdict, facts, body)


def printed(one: Presentation, capsys: Captured, *, every: bool = False) -> list[str]:
    """Return the lines that are printed, without blanks at their ends."""
    capsys.readouterr()
    print_presentation(one, every=every)
    return [line.rstrip() for line in capsys.readouterr().out.splitlines()]


def test_the_verdict_stands_first_and_facts_are_told_once(capsys: Captured) -> None:
    assert printed(shown(section("a", "fail")), capsys) == [
        "FAIL  one log out of tolerance",
        "      Largest: 4.500 mm",
        "      Position: (0.2000, 0.0000, 0.9955) m",
        "  Clocks: aligned",
    ]
    assert printed(shown(verdict=None), capsys)[0] == "one log out of tolerance"


def test_the_verdict_alone_goes_where_it_is_asked_for(capsys: Captured) -> None:
    print_verdict(shown(section("a", "fail", [table()])), err=True)
    said = capsys.readouterr()
    assert (said.out, said.err.splitlines()[0]) == ("", "FAIL  one log out of tolerance")
    assert len(said.err.splitlines()) == 3


def test_a_table_has_its_units_in_the_heads_and_no_column_without_a_value(capsys: Captured) -> None:
    lines = printed(shown(tables=[table()]), capsys)
    start = lines.index("Comparison: Largest deviations")
    assert [line.split() for line in lines[start + 1 : start + 6] if not line.startswith("─")] == [
        ["max", "0", "max", "1"], ["Log", "Verdict", "[mm]", "[mm]"],
        ["log", "0", "PASS", "0.0", "0.0"], ["log", "1", "FAIL", "1.000", "1.000"],
    ]  # fmt: skip
    assert not any("rarely read" in line or "never there" in line for line in lines)
    every = printed(shown(tables=[table()]), capsys, every=True)
    assert any("rarely read" in line for line in every)
    assert not any(
        "Largest deviations" in line for line in printed(shown(tables=[table(brief=False)]), capsys)
    )


def test_a_column_of_several_units_has_them_in_its_cells(capsys: Captured) -> None:
    columns = (
        Column("joint", "Joint", ["rail", "turn"]),
        Column("max", "max", [Value(0.5, "m"), Value(0.5, "rad")]),
        Column("share", "used", [Value(0.5, "%"), Value(0.25, "%")]),
    )
    mixed = Table("Joints", columns)
    lines = printed(shown(tables=[mixed]), capsys)
    start = lines.index("Comparison: Joints")
    assert [line.split() for line in lines[start + 1 : start + 5] if not line.startswith("─")] == [
        ["Joint", "max", "used"],
        ["rail", "500.0", "mm", "50.0", "%"], ["turn", "28.65", "deg", "25.0", "%"],
    ]  # fmt: skip


def test_of_a_long_ranking_the_worst_are_shown_and_the_others_counted(capsys: Captured) -> None:
    lines = printed(shown(tables=[table(LISTED + 10)]), capsys)
    rows = [line for line in lines if line.startswith("log ")]
    assert (len(rows), rows[0].split()[1], rows[-1].split()[2]) == (LISTED, "10", "FAIL")
    assert "... and 10 more; --json lists all" in lines


def test_of_many_judged_sections_those_that_fail_are_printed(capsys: Captured) -> None:
    sections = [section(f"s{i}", "fail" if i % 2 else "pass", [table()]) for i in range(14)]
    lines = printed(shown(*sections), capsys)
    titles = [line.split(":")[0] for line in lines if line.endswith("Largest deviations")]
    assert titles == ["s5", "s7", "s9", "s11", "s13"]
    assert lines[-1] == "9 more sections: --json, or the report"


@pytest.mark.parametrize("width", [60, 80, 120, 300])
def test_tables_fit_the_terminal_and_no_column_is_lost(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setattr(printing, "PIPE_WIDTH", width)
    assert new_console().width == width
    lines = printed(shown(tables=[table(3, 20)]), capsys)
    start = lines.index("Comparison: Largest deviations") + 1
    assert max(cell_len(line) for line in lines[start:]) <= width
    heads = " ".join(lines)
    assert all(f"max {j}" in heads for j in range(20))
