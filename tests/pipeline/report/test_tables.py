"""Tables and facts: digits, units in heads, verdicts, bars, links; long tables folded and cut."""

from __future__ import annotations

import re

import pytest

from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.section import (
    Cell,
    Column,
    Fact,
    Judged,
    Place,
    Presentation,
    Ref,
    Section,
    Table,
    Value,
)
from urmpipe_pipeline.report import render_report
from urmpipe_pipeline.report.page import Page, lay_out
from urmpipe_pipeline.report.tables import Grid, ShownCell, grid


def nowhere(cell: Cell) -> str:
    return ""


def drawn(*columns: Column, folded: bool = False, folds: bool = True) -> Grid:
    return grid(Table("T", columns, "A note.", folded=folded), nowhere, folds=folds)


def of(*cells: Cell) -> Column:
    return Column("key", "Head", cells)


def page_of(section: Section) -> Page:
    return lay_out([Presentation("toy", "it is", section.verdict, (), section)])


@pytest.mark.parametrize(
    ("column", "head", "texts"),
    [
        (of(Value(0.0025, "m"), Value(None, "m")), ("Head [mm]", True), ["2.500", "–"]),
        (of(Value(0.0035, "m", given=True), None), ("Head [mm]", True), ["3.5", "–"]),
        (of(Value(0.5, "rad"), Value(1e-9, "rad")), ("Head [deg]", True), ["28.65", "0.0000"]),
        (of(Value(0.001, "m"), Value(1.0, "rad")), ("Head", True), ["1.000 mm", "57.30 deg"]),
        (of(Value(0.258, "%"), Value(0.0, "%")), ("Head", True), ["25.8 %", "0 %"]),
        (of(Value(1.25, "s"), Value(0.0, "s")), ("Head [s]", True), ["1.250", "0.000"]),
        (of(Value(7, ""), Value(12, "")), ("Head", True), ["7", "12"]),
        (of(Place((0.1, -0.2, 0.3)), None), ("Head [m]", True), ["(0.1000, -0.2000, 0.3000)", "–"]),
        (of("word", ""), ("Head", False), ["word", "–"]),
        (of(Judged("pass"), Judged(None)), ("Head", False), ["PASS", "–"]),
    ],
)  # fmt: skip
def test_units_stand_in_heads_and_digits_follow_the_value(
    column: Column, head: tuple[str, bool], texts: list[str]
) -> None:
    found = drawn(column)
    assert found.heads == (head,)
    assert [row[0].text for row in found.rows] == texts


def test_columns_without_a_value_are_not_there() -> None:
    found = drawn(
        Column("a", "A", ["x", "y"]), Column("b", "B", [None, Value(None)]), Column("c", "C", ["", "z"])
    )
    assert [head for head, _ in found.heads] == ["A", "C"]
    assert [[cell.text for cell in row] for row in found.rows] == [["x", "–"], ["y", "z"]]


def test_verdicts_bars_colours_and_what_stands_out() -> None:
    cells: list[Cell] = [
        Value(0.004, "m", 0.0035, "fail", 1.14), Value(0.001, "m", 0.0035, "pass", 0.286, most=True),
        Value(None, "m", 0.0035, "fail"), Judged("fail"), Ref("log", "#fda201"),
    ]  # fmt: skip
    assert [row[0] for row in drawn(of(*cells)).rows] == [
        ShownCell("4.000", "fail", used=1.0, exact="0.004 m"),
        ShownCell("1.000", used=0.286, most=True, exact="0.001 m"),
        ShownCell("–"),
        ShownCell("FAIL", "fail"),
        ShownCell("log", colour="#fda201"),
    ]


@pytest.mark.parametrize(("rows", "folded"), [(12, False), (13, True)])
def test_a_long_table_is_folded_unless_it_is_read_first(rows: int, folded: bool) -> None:
    column = of(*(Value(k) for k in range(rows)))
    assert drawn(column).folded is folded
    assert drawn(column, folds=False).folded is False
    assert drawn(column, folded=True, folds=False).folded is True


def test_a_very_long_table_is_cut_and_counts_what_is_left_out() -> None:
    found = drawn(of(*(Value(k) for k in range(700))))
    assert (len(found.rows), found.rows[-1][0].text) == (500, "499")
    assert found.note == "200 more; the JSON output lists them all. A note."


def test_facts_without_a_value_are_left_out_and_explained_ones_stand_apart() -> None:
    facts = (
        Fact("|Δx|", Value(0.0025, "m", 0.0035, "pass", 0.71), "71.4 % of the tolerance"),
        Fact("Robot", "urm6"), Fact("Recording", ""), Fact("Offset", None), Fact("Mean", Value(None, "m")),
        Fact("See", Ref("below"), brief=False), Fact("Nowhere", Ref("else")),
    )  # fmt: skip
    section = Section("toy", facts=facts, sections=(Section("below"),))
    (part,) = page_of(section).parts
    assert [(fact.name, fact.value, fact.help, fact.href) for fact in part.facts] == [
        ("|Δx|", "2.500 mm of 3.5 mm allowed", "71.4 % of the tolerance", ""),
        ("Robot", "urm6", "", ""), ("See", "below", "", "#r1-1"), ("Nowhere", "else", "", ""),
    ]  # fmt: skip
    html = render_report([Presentation("toy", "it is", None, (), section)])
    lists = re.findall(r'<dl class="facts( explained|)">(.*?)</dl>', html)[-2:]
    assert [(style, re.findall("<dt>(.*?)</dt>", said)) for style, said in lists] == [
        ("", ["Robot", "See", "Nowhere"]), (" explained", ["|Δx|"]),
    ]  # fmt: skip


def test_warnings_are_a_table_before_everything_but_what_is_read_first() -> None:
    first, last = (Table(title, (of("x"),)) for title in ("First", "Last"))
    warned = (LogWarning("gap", "a gap", 7, column="q1"), LogWarning("gap", "another"))
    section = Section("toy", tables=(first,), blocks=lambda: [last], warnings=warned)
    (part,) = page_of(section).parts
    assert [block.title for block in part.blocks] == ["First", "Warnings (2)", "Last"]
    table = part.blocks[1]
    assert isinstance(table, Grid)
    assert [head for head, _ in table.heads] == ["Kind", "About", "Row", "What"]
    assert [[cell.text for cell in row] for row in table.rows] == [
        ["gap", "q1", "7", "a gap"], ["gap", "–", "–", "another"],
    ]  # fmt: skip
    assert page_of(Section("calm")).parts[0].blocks == ()


def test_parts_stand_by_their_rank() -> None:
    sections = (Section("second", rank=2), Section("first", rank=1), Section("also second", rank=2))
    (part,) = page_of(Section("toy", sections=sections)).parts
    assert [(one.title, one.ident) for one in part.parts] == [
        ("first", "r1-2"), ("second", "r1-1"), ("also second", "r1-3"),
    ]  # fmt: skip
