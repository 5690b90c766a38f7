"""The texts in an FMU, as FMPy and a browser read them; the texts themselves are in description.cases."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lxml import html  # type: ignore[import-untyped]

from small_models import BOUNDED
from urmpipe_fmus.block import BlockModel, Input, Output, Table
from urmpipe_fmus.build.description import documentation, model_description
from written_units import NAMES, unit_of

NOT_XML = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""XML 1.0, production 2."""


@pytest.mark.parametrize("name", [*NAMES, "bounded"])
def test_fmpy_finds_nothing_wrong_and_reads_every_scalar(name: str, tmp_path: Path) -> None:
    model = BOUNDED if name == "bounded" else unit_of(name)
    native = model_description(model, "{9}", "native", ["model.c"])
    for text in (model_description(model, "{9}", "python"), native):
        (tmp_path / "modelDescription.xml").write_text(text, encoding="utf-8")
        assert validate_fmu(str(tmp_path)) == []
    variables = read_model_description(str(tmp_path), validate=False).modelVariables
    assert [one.name for one in variables] == [scalar for scalar, _ in model.scalars]
    for reference, (seen, (scalar, meant)) in enumerate(zip(variables, model.scalars, strict=True)):
        start = meant.starts[meant.names.index(scalar)]
        for field in ("type", "causality", "variability", "unit", "display_unit", "description"):
            found = getattr(seen, {"display_unit": "displayUnit"}.get(field, field)) or ""
            assert found == getattr(meant, field), (scalar, field)
        assert seen.valueReference == reference
        if isinstance(meant, Output):
            assert (seen.initial, seen.start) == ("calculated", None)
        else:
            assert {"true": 1.0, "false": 0.0}.get(seen.start) == start or float(seen.start) == start


@pytest.mark.slow
@settings(deadline=None)
@given(text=st.text(st.characters(exclude_categories=[])))
@example(text="a\rb\r\nc")
@example(text='<script>alert(1)</script> & "it\'s"')
def test_any_text_is_valid_and_comes_back_and_is_shown_as_it_is(text: str) -> None:
    model = BlockModel(
        name="named",
        description=text,
        variables=(Input(name="u", description=text), Output(name="y", description="")),
        outputs=lambda v: {"y": v.u},
        equations=(text,) if text.strip() else ("-",),
        source=text,
        table=Table(np.array([0]), np.array([[0.0]])),
    )
    escaped = NOT_XML.sub(lambda found: ascii(found[0])[1:-1], text)  # what XML can hold of it
    root = ET.fromstring(model_description(model, "{9}", "native").encode())
    assert root.get("description") == escaped
    assert root.find(".//ScalarVariable").get("description", "") == escaped  # type: ignore[union-attr]
    page = html.fromstring(documentation(model))
    lines = re.sub("\r\n?", "\n", escaped)  # as HTML reads them
    assert (page.find(".//p[@class='said']").text or "") == lines
    assert (page.find(".//tbody/tr/td[last()]").text or "") == lines
    assert page.findall(".//script") == []
