"""The summary of a recording: the verdict first, then what explains it, what to know, and where to go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toys import shown
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.palette import DEVIATION_COLOUR, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.presentation.scene import Path, Scene
from urmpipe_pipeline.presentation.section import (
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
from urmpipe_pipeline.recording.views.summary import LISTED, NAMED, ROWS, summary


def table(rows: int, *, judged: bool, title: str = "Log") -> Table:
    verdicts: list[Verdict] = ["fail" if k == rows - 1 else "pass" for k in range(rows)]
    columns = (
        Column("name", title, [Ref(f"{title} {k}") for k in range(rows)]),
        Column("max", "max", [Value(0.001 * (k + 1), "m") for k in range(rows)]),
        Column("none", "none", [None] * rows),
        Column("long", "long", ["text"] * rows, brief=False),
        *([Column("verdict", "Verdict", [Judged(one) for one in verdicts])] if judged else []),
    )
    return Table("Table", columns)


def lines(one: Presentation, scene: Scene | None = None) -> list[str]:
    return "\n".join(summary(one, scene)).splitlines()


def test_the_verdict_comes_first_then_what_explains_it() -> None:
    body = Section(
        "toy", "fail",
        (
            Fact("Decided by", "told above"), Fact("Samples", Value(7)), Fact("Hidden", "1", brief=False),
            Fact("Nothing", None),
        ),
        notice="half of it is missing",
    )  # fmt: skip
    one = replace(shown(), headline="a_b|c is out", verdict="fail", body=body)
    one = replace(one, facts=(Fact("Decided by", Value(0.0012, "m")), Fact("At", Value(2.5, "s"))))
    assert lines(one)[:7] == [
        "### FAIL: a\\_b\\|c is out",
        "",
        "Decided by: **1.200 mm**; At: **2.500 s**",
        "",
        "Samples: 7",
        "",
        "**half of it is missing**",
    ]
    assert lines(replace(one, verdict=None, word="read"))[0].startswith("### READ: ")
    assert lines(replace(one, verdict=None))[0] == "### a\\_b\\|c is out"


def test_verdicts_stand_above_warnings_and_other_tables_below_all() -> None:
    tables = table(3, judged=False, title="Signal"), table(2, judged=True)
    told = lines(shown(tables=tables, warnings=(LogWarning("gap", "two rows lie apart", row=7),)))
    assert told[2:] == [
        "| Log | max [mm] | Verdict |".replace("[", "\\[").replace("]", "\\]"),
        "| --- | --- | --- |",
        "| Log 0 | 1.000 | PASS |",
        "| Log 1 | 2.000 | FAIL |",
        "",
        "Warnings: 1",
        "",
        "- row 7: two rows lie apart",
        "",
        "Everything else: `urmpipe report` with this file.",
        "",
        "| Signal | max \\[mm\\] |",
        "| --- | --- |",
        *(f"| Signal {k} | {k + 1}.000 |" for k in range(3)),
    ]


def test_of_many_verdicts_the_worst_are_shown_and_long_tables_are_left_to_the_report() -> None:
    told = lines(shown(tables=(table(ROWS + 5, judged=True), table(ROWS + 1, judged=False, title="Signal"))))
    rows = [line for line in told if line.startswith("| Log ")][1:]
    assert [row.split(" | ")[0] for row in rows] == [f"| Log {k}" for k in range(5, ROWS + 5)]
    assert "and 5 more, all in the report" in told
    assert not [line for line in told if "Signal" in line]


def test_of_two_tables_about_the_same_things_there_is_room_for_one() -> None:
    both = table(3, judged=True), table(3, judged=False)
    assert lines(shown(tables=both)) == lines(shown(tables=both[:1]))


def test_a_single_section_is_told_and_several_are_not() -> None:
    part = Section("part", "pass", (Fact("Size", Value(3)),), (table(1, judged=True),))
    assert "Size: 3" in lines(shown(sections=(part,)))
    assert "Size: 3" not in lines(shown(sections=(part, part)))


def test_warnings_say_what_they_are_about_and_many_are_counted() -> None:
    warnings = [LogWarning("gap", f"{k} gaps") for k in range(LISTED)]
    parts = tuple(Section(name, warnings=tuple(warnings[:2])) for name in ("one", "two"))
    told = lines(shown(sections=parts, warnings=(LogWarning("own", "of all"),)))
    assert [line for line in told if line.startswith("- ")] == [
        "- of all", "- one: 0 gaps", "- one: 1 gaps", "- two: 0 gaps", "- and 1 more, all in the report",
    ]  # fmt: skip
    assert f"Warnings: {LISTED + 1}" in told


def test_each_path_is_told_with_its_colour() -> None:
    def path(name: str, colour: str) -> Path:
        return Path(name, np.zeros((2, 3)), None, colour)

    asked = replace(path("asked for", REFERENCE_COLOUR), asked=True)
    paths = (asked, replace(asked, line=False), path("a|b", run_colour(0)), path("x50", DEVIATION_COLOUR))
    assert "Paths: asked for grey, dashed; a\\|b orange; x50 crimson." in lines(shown(), Scene(paths=paths))
    assert not [line for line in lines(shown(), Scene(paths=paths[2:3])) if line.startswith("Paths")]
    logs = Table("Logs", (Column("log", "Log", [Ref("a|b", run_colour(0))]),))
    judged = replace(logs, columns=(*logs.columns, Column("v", "Verdict", [Judged("pass")])))
    assert "Paths: asked for grey, dashed; x50 crimson." in lines(shown(tables=(judged,)), Scene(paths=paths))
    many = Scene(paths=tuple(path(f"p{k}", run_colour(k)) for k in range(NAMED + 3)))
    (told,) = [line for line in lines(shown(), many) if line.startswith("Paths")]
    assert told.endswith("; and 3 more.") and told.count(";") == NAMED


def test_it_says_where_it_opens() -> None:
    one = shown()
    for more, words in (
        ({"opens_at_ns": 25_230_000_000}, "at 25.230 s,"),
        ({"opens_at_row": 6}, "at row 7,"),
    ):
        assert words in lines(replace(one, **more))[-1]  # type: ignore[arg-type]
    assert "opens" not in lines(replace(one, opens_at_row=0))[-1]


def test_what_no_text_can_hold_is_told_all_the_same() -> None:
    assert lines(replace(shown(), headline="q\udcff\nb"))[0] == "### q? b"
