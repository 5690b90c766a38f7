"""JUnit XML: read back by a parser, against what consumers need, and number by number."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from asserting import there
from made_runs import arms, off, paths
from urmpipe_models.errors import LogError
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.outputs import safe_output
from urmpipe_pipeline.results import present
from urmpipe_pipeline.tables.junit import errors_in_junit, write_junit


def written(result: Comparison, path: Path) -> ET.Element:
    """Write a JUnit file as the command does, and parse it."""
    with safe_output(path, [], "junit") as part:
        write_junit(present(result), part, path)
    root = ET.parse(path).getroot()
    assert_consumers_take_it(root)
    return root


def assert_consumers_take_it(root: ET.Element) -> None:
    """Hold a file against the attributes that Jenkins' schema, GitLab and GitHub's actions ask for."""
    assert root.tag == "testsuites"
    counted = dict.fromkeys(("tests", "failures", "errors"), 0)
    for suite in root:
        assert suite.tag == "testsuite"
        assert suite.get("name")
        cases = suite.findall("testcase")
        assert int(suite.attrib["tests"]) == len(cases)
        assert int(suite.attrib["failures"]) == len(suite.findall("testcase/failure"))
        assert int(suite.attrib["errors"]) == len(suite.findall("testcase/error"))
        assert suite.attrib["time"] == suite.attrib["skipped"] == "0"
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", suite.get("timestamp", "2026-01-01T00:00:00"))
        order = [child.tag for child in suite]
        before, behind = order.count("properties"), order.count("system-out")
        assert order == [*["properties"] * before, *["testcase"] * len(cases), *["system-out"] * behind]
        for properties in suite.findall("properties"):
            assert len(properties) > 0
            assert all(one.tag == "property" and set(one.attrib) == {"name", "value"} for one in properties)
        for case in cases:
            assert case.get("classname") and case.get("name") and float(case.attrib["time"]) >= 0.0
            assert [child.tag for child in case] in ([], ["failure"], ["error"])
            for failure in case:
                assert failure.get("type") and failure.get("message") == failure.text
        for name in counted:
            counted[name] += int(suite.attrib[name])
    assert {name: int(root.attrib[name]) for name in counted} == counted
    names = [(case.get("classname"), case.get("name")) for case in root.iter("testcase")]
    assert len(set(names)) == len(names)


def test_the_properties_are_the_statistics_bit_for_bit(tmp_path: Path) -> None:
    deltas = 0.001 * np.random.default_rng(1).normal(size=(60, 6))
    result = arms({"a": deltas}, tolerance={"axis": 0.001, "joint": 0.002})
    suite = written(result, tmp_path / "verdict.xml")[0]
    assert suite.get("timestamp") == result.provenance.created[:19]
    told = {one.attrib["name"]: one.attrib["value"] for one in suite.iter("property")}
    run = result.runs[0]
    for one in run.quantities:
        prefix = f"joint {one.quantity}" if one.kind == "joint" else one.quantity
        for field, value in one.fields().items():
            text = told[f"{prefix}.{field}"]
            assert text == "" if value is None else type(value)(text) == value, (prefix, field)
    assert float(told["out_fraction"]) == run.out_fraction
    assert float(told["speed_correlation"]) == run.speed_correlation
    assert float(told["longest_out_interval"]) == there(run.longest_out_interval).duration


def test_an_error_replaces_no_file_of_another_and_no_input(tmp_path: Path) -> None:
    mine, other = tmp_path / "mine.xml", tmp_path / "other.xml"
    written(paths({"a": off(0.0, 5)}), mine)
    other.write_text("<testsuites/>")
    for path, inputs in ((mine, [mine]), (other, []), (tmp_path / "nowhere" / "v.xml", [])):
        before = path.read_bytes() if path.exists() else None
        with pytest.raises(LogError, match=r"^broken$"), errors_in_junit(path, inputs):
            raise LogError("broken")
        assert (path.read_bytes() if path.exists() else None) == before
    with pytest.raises(LogError, match=r"^broken$"), errors_in_junit(None, []):
        raise LogError("broken")


@pytest.mark.slow
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(st.characters(categories=["L", "N", "P", "S", "Z", "C"]), min_size=1, max_size=20))
def test_any_name_of_a_file_is_kept(tmp_path: Path, name: str) -> None:
    result = replace(paths({"a": off(0.0, 5)}), name=name)
    result = replace(result, runs=(replace(result.runs[0], name=name),))
    root = written(result, tmp_path / "verdict.xml")
    if name.isprintable():
        assert root[0].get("name") == root.get("name") == name
