"""What is told of a network: whether it closes, how much moves and why, its assemblies, and its drawings."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from asserting import there
from made_networks import NAMES, found
from presented import cells, facts
from urmpipe_models.networks.assembly import ClosureError
from urmpipe_models.networks.mobility import Mobility
from urmpipe_pipeline.networks.parts import gap_words
from urmpipe_pipeline.presentation.figure import Drawing
from urmpipe_pipeline.presentation.section import Table
from urmpipe_pipeline.report import render_report
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.results import present


def tables(name: str, *, every: bool = False) -> dict[str, Table]:
    return {one.title: one for one in present(found(name, every=every)).body.tables}


def told(name: str) -> dict[str, str]:
    return {one.name: str(one.value) for one in present(found(name)).facts}


def test_the_headline_says_what_moves_and_why_not_as_kutzbach_counts() -> None:
    assert present(found("bars")).headline == (
        "bars: assembled, a mechanism of mobility 1 (Kutzbach -2: 3 constraints are redundant)"
    )
    assert present(found("bars", every=True)).headline.startswith("bars: at least 2 assemblies, a mechanism")
    assert (
        present(found("rssr")).headline
        == "rssr: assembled, a mechanism of mobility 2, 1 passive rotation of it"
    )
    assert told("rssr")["Passive rotations"] in found("rssr").network.body_names


def test_one_that_does_not_close_says_what_and_by_how_much() -> None:
    result = found("too long")
    shown = present(result)
    assert shown.verdict == "fail"
    loop = ", ".join(result.loops[0])
    assert re.fullmatch(rf"too long: does not close: loop {loop} is [\d.]+ mm apart", shown.headline)
    (check,) = shown.body.checks
    assert (check.verdict, check.kind) == ("fail", "not-assembled")
    table = cells(tables("too long")["What does not close"])
    assert table["metres"] == [one.metres for one in result.closure_errors]


@pytest.mark.parametrize(
    ("gap", "words"),
    [
        (
            ClosureError("C", ("A", "B", "C"), 0.0123, math.radians(1.2)),
            "loop A, B, C is 12.3 mm and 1.2 deg apart",
        ),
        (ClosureError("C", ("A", "C"), 0.0, math.radians(1.2)), "loop A, C is 1.2 deg apart"),
        (ClosureError("C", ("A", "C"), 0.002, 1e-9), "loop A, C is 2 mm apart"),
        (ClosureError("rod", ("rod",), 0.003, 0.0), "element rod is 3 mm off its length"),
    ],
)
def test_a_gap_in_words(gap: ClosureError, words: str) -> None:
    assert gap_words(gap) == words


def test_what_is_special_is_told() -> None:
    result = found("bars")
    moves = replace(there(result.mobility), rank=there(result.mobility).rank - 1)
    shown = present(replace(result, mobility=moves))
    said = {one.name: one.value for one in shown.facts}
    assert said["Special configuration"] == "mobility 2 here, 1 at assembled configurations nearby"
    none = Mobility(6, 6, 0, (), (), 0)
    assert present(replace(result, mobility=none)).headline == "bars: assembled, a structure of mobility 0"


def test_the_facts_tell_how_it_was_assembled() -> None:
    result = found("bars")
    said = facts(present(result).body)
    assert said["Structure"] == "closed chain of 4 bodies by 4 joints, 1 loop"
    assert said["Controls"] == "s = -0.8"
    assert said["Assemblies"] == result.reason == "the start closes"
    every = found("bars", every=True)
    assert facts(present(every).body)["Assemblies"] == f"{every.reason} ({every.start_count} starts in all)"


def test_the_mobility_is_what_its_table_adds_up_to() -> None:
    for name in ("bars", "rssr", "screw-jack"):
        table = cells(tables(name)["Mobility"])
        rows = dict(zip(table["quantity"], table["value"], strict=True))
        assert rows["variables"] - rows["rank"] == rows["mobility"]
        assert rows["mobility"] - rows["Kutzbach"] == rows.get("redundant", 0)


@pytest.mark.slow
def test_assemblies_have_a_row_each_and_a_single_one_a_row_a_variable() -> None:
    every = found("stewart-gough", every=True)
    table = cells(tables("stewart-gough", every=True)[f"Assemblies ({len(every.assemblies)})"])
    assert table["assembly"] == list(range(1, len(every.assemblies) + 1))
    body = next(iter(every.network.bodies)).name
    wanted = [one.values[body][2] for one in every.assemblies]
    np.testing.assert_allclose(table[f"{body} 3"], wanted, rtol=0, atol=1e-9)  # rounded to that
    single = cells(tables("bars")["Variables"])
    assert single["name"] == list(found("bars").assemblies[0].values)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", NAMES)
def test_every_network_has_a_page_with_its_drawings(name: str) -> None:
    result = found(name, every=True)
    shown = present(result)
    (part,) = lay_out([shown]).parts
    titles = [one.title for one in part.blocks if isinstance(one, Drawing)]
    assert titles == ["Graph", "Mechanism", *(["Assemblies"] if len(result.assemblies) > 1 else [])]
    assert [one.title for one in part.blocks if isinstance(one, Figure)] == ["In space"]
    html = render_report([shown])
    assert all(one.svg.splitlines()[-1] in html for one in part.blocks if isinstance(one, Drawing))
    assert not re.search(r"\bnan\b", html.split('<div id="details"')[1].split("<footer>")[0])
