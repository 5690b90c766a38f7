"""The page inside an FMU: it tells all variables, equations and what a step does, and escapes any text."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lxml import html  # type: ignore[import-untyped]

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, Table
from urmpipe_fmus.build.description import documentation

Make = Callable[..., BlockModel]


def rows_of(model: BlockModel) -> list[list[str]]:
    page = html.fromstring(documentation(model))
    return [[cell.text or "" for cell in row.findall("td")] for row in page.findall(".//tbody/tr")]


def test_the_table_tells_every_variable(make: Make) -> None:
    assert rows_of(make("arm")) == [
        *[["phi[1] .. [3]", "input, continuous", "rad", START, "", "", "Angles"]],
        *[["length[1] .. [3]", "parameter, tunable", "m", "0.5 (500 mm)", "", "", "Lengths"]],
        *[["p[1] .. [2]", "output, continuous", "m", "computed", "", "", "Tip"]],
        *[["reach", "output, continuous", "m", "computed", "", "", "Distance of the tip"]],
        *[["first", "output, continuous", "m", "computed", "", "", "x of the first joint's end"]],
    ]


START = "0.1 (5.729578 deg), 0.2 (11.45916 deg), 0.3 (17.18873 deg)"


def test_types_and_bounds_are_told(make: Make) -> None:
    assert rows_of(make("counter"))[:4] == [
        ["on", "input, discrete", "Boolean", "true", "", "", "Whether it counts"],
        ["by", "input, discrete", "Integer", "2", "-10", "10", "Counts by"],
        ["limit", "parameter, fixed", "Integer", "7", "", "", "Counts up to this"],
        ["count", "output, discrete", "Integer", "1", "", "", "So far"],
    ]


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.1, "0.1"), (1 / 3, "0.3333333333333333"), (1e-9, "1e-09"), (1234567.0, "1234567.0")],
)
def test_a_value_is_told_in_full(value: float, said: str) -> None:
    model = BlockModel(
        name="one", description="", variables=(Parameter(name="p", description="", start=value),)
    )
    assert rows_of(model)[0][3] == said


def test_equations_and_source_are_shown_where_there_are_some(make: Make) -> None:
    page = html.fromstring(documentation(make("spring")))
    assert page.find(".//pre").text == "m dv/dt = F - c x - d v\ndx/dt = v\nE = (c x^2 + m v^2) / 2"
    assert [one.text for one in page.findall(".//h2")] == ["Variables", "Equations", "Source", "A step"]
    page = html.fromstring(documentation(make("arm")))
    assert [one.text for one in page.findall(".//h2")] == ["Variables", "A step"]


def test_the_page_needs_nothing_else(model: BlockModel) -> None:
    page = html.fromstring(documentation(model))
    assert [one.tag for one in page.iter() if one.get("src") or one.get("href")] == []
    assert page.find(".//meta[@name='viewport']").get("content") == "width=device-width, initial-scale=1"


NOT_MARKUP = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 cannot hold."""


@pytest.mark.slow
@settings(deadline=None)
@given(text=st.text(st.characters(exclude_categories=[], exclude_characters="\r")))  # \r is read as \n
@example(text='<script>alert(1)</script> & "it\'s"')
def test_any_text_is_shown_as_it_is(text: str) -> None:
    model = BlockModel(
        name="named",
        description=text,
        variables=(Input(name="u", description=text), Output(name="y", description="")),
        outputs=lambda v: {"y": v.u},
        equations=(text,) if text.strip() else ("-",),
        source=text,
        table=Table(np.array([0]), np.array([[0.0]])),
    )
    page = html.fromstring(documentation(model))
    shown = NOT_MARKUP.sub(lambda found: ascii(found[0])[1:-1], text)
    assert (page.find(".//p[@class='said']").text or "") == shown
    assert rows_of(model)[0][-1] == shown
    assert page.findall(".//script") == []
