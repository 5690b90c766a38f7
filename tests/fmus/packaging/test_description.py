"""The texts in an FMU: model description and documentation."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lxml import html  # type: ignore[import-untyped]

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, Table
from urmpipe_fmus.build.description import documentation, model_description

NOT_XML = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""XML 1.0, production 2."""
GUID = "{00000000-0000-0000-0000-000000000000}"


def problems_of(text: str, folder: Path) -> list[str]:
    (folder / "modelDescription.xml").write_text(text, encoding="utf-8")
    found: list[str] = validate_fmu(str(folder))
    return found


def read_back(text: str, folder: Path) -> ModelDescription:
    (folder / "modelDescription.xml").write_text(text, encoding="utf-8")
    return read_model_description(str(folder), validate=False)


def test_fmpy_finds_nothing_wrong(model: BlockModel, tmp_path: Path) -> None:
    assert problems_of(model_description(model, GUID, "native", ["model.c"]), tmp_path) == []
    assert problems_of(model_description(model, GUID, "python"), tmp_path) == []


def test_every_scalar_is_described_as_the_unit_says(model: BlockModel, tmp_path: Path) -> None:
    found = read_back(model_description(model, GUID, "native"), tmp_path).modelVariables
    assert [one.name for one in found] == [name for name, _ in model.scalars]
    for reference, (seen, (name, meant)) in enumerate(zip(found, model.scalars, strict=True)):
        start = meant.starts[meant.names.index(name)]
        assert seen.valueReference == reference
        assert (seen.type, seen.causality, seen.variability) == (
            meant.type,
            meant.causality,
            meant.variability,
        )
        assert (seen.unit or "", seen.displayUnit or "") == (meant.unit, meant.display_unit)
        assert seen.description == meant.description
        if isinstance(meant, Output):
            assert (seen.initial, seen.start) == ("calculated", None)
        elif meant.type == "Boolean":
            assert seen.start == ("true" if start else "false")
        else:
            assert float(seen.start) == start


def test_units_are_told_in_base_units_with_their_display_units(
    make: Callable[..., BlockModel], tmp_path: Path
) -> None:
    found = read_back(model_description(make("spring"), GUID, "native"), tmp_path).unitDefinitions
    bases = {one.name: one.baseUnit for one in found}
    assert sorted(bases) == ["J", "N", "N.s/m", "N/m", "kg", "m", "m/s", "m/s2", "s"]
    assert (bases["J"].kg, bases["J"].m, bases["J"].s, bases["J"].factor) == (1, 2, -2, 1.0)
    (metre,) = (one for one in found if one.name == "m")
    assert [(one.name, one.factor) for one in metre.displayUnits] == [("mm", 1000.0)]


def dependencies(text: str, folder: Path, title: str) -> dict[str, set[str]]:
    read = getattr(read_back(text, folder), title)
    return {one.variable.name: {known.name for known in one.dependencies} for one in read}


def test_outputs_depend_on_inputs_and_initial_unknowns_on_all_that_is_known(
    make: Callable[..., BlockModel], tmp_path: Path
) -> None:
    text = model_description(make("spring"), GUID, "native")
    assert dependencies(text, tmp_path, "outputs") == {"x": set(), "a": {"F"}, "E": set()}
    assert dependencies(text, tmp_path, "initialUnknowns") == {
        "a": {"m", "c", "d", "F", "x", "v"},
        "E": {"m", "c", "x", "v"},
    }
    text = model_description(make("arm"), GUID, "native")
    angles = {"phi[1]", "phi[2]", "phi[3]"}
    assert dependencies(text, tmp_path, "outputs") == {
        "p[1]": angles,
        "p[2]": angles,
        "reach": angles,
        "first": {"phi[1]"},
    }


def test_an_fmu_with_a_table_plays_it_by_default(make: Callable[..., BlockModel], tmp_path: Path) -> None:
    found = read_back(model_description(make("playback"), GUID, "native"), tmp_path).defaultExperiment
    assert (found.startTime, found.stopTime, found.stepSize) == ("0.0", "0.3", "0.1")


@pytest.mark.parametrize(
    ("backend", "needs_python", "sources"), [("native", False, ["model.c"]), ("python", True, [])]
)
def test_capabilities_are_those_of_the_backend(
    make: Callable[..., BlockModel], tmp_path: Path, backend: str, needs_python: bool, sources: list[str]
) -> None:
    text = model_description(make("spring"), GUID, backend, sources)  # type: ignore[arg-type]
    assert [one.get("name") for one in ET.fromstring(text.encode()).findall(".//File")] == sources
    found = read_back(text, tmp_path).coSimulation
    assert found.modelIdentifier == "spring"
    assert bool(found.needsExecutionTool) is needs_python
    assert found.canGetAndSetFMUstate and found.canSerializeFMUstate
    assert found.canHandleVariableCommunicationStepSize
    assert not found.canBeInstantiatedOnlyOncePerProcess
    assert not found.providesDirectionalDerivative


def test_bounds_are_told_where_they_are_some(tmp_path: Path) -> None:
    model = BlockModel(
        name="bounded",
        description="",
        variables=(
            Parameter(name="r", description="", minimum=-0.5),
            Parameter(name="n", description="", type="Integer", minimum=-1.5, maximum=1e12),
            Input(name="b", description="", type="Boolean", minimum=0, maximum=1),
        ),
    )
    text = model_description(model, GUID, "native")
    assert problems_of(text, tmp_path) == []
    found = read_back(text, tmp_path).modelVariables
    assert [(one.min, one.max) for one in found] == [("-0.5", None), ("-1", None), (None, None)]


@pytest.mark.slow
@settings(deadline=None)
@given(text=st.text(st.characters(exclude_categories=[])))
def test_any_description_is_valid_and_what_xml_can_hold_of_it_comes_back(text: str) -> None:
    model = BlockModel(
        name="named",
        description=text,
        variables=(Input(name="u", description=text), Output(name="y", description="")),
        outputs=lambda v: {"y": v.u},
    )
    root = ET.fromstring(model_description(model, GUID, "native").encode())
    escaped = NOT_XML.sub(lambda found: ascii(found[0])[1:-1], text)
    assert root.get("description") == escaped
    assert root.find(".//ScalarVariable").get("description", "") == escaped  # type: ignore[union-attr]


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
