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

from asserting import refusal, there
from made_runs import arms, off, paths
from urmpipe_models.errors import Finding, LogError, OutputError
from urmpipe_pipeline.comparison.baseline import compare_with_baseline
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


def test_a_log_is_a_suite_and_a_judged_quantity_a_case(tmp_path: Path) -> None:
    result = paths({"good": off(0.001), "bad": off(0.004)}, tolerance={"axis": 0.0035, "norm": 0.01})
    root = written(result, tmp_path / "verdict.xml")
    assert {name: root.get(name) for name in ("name", "tests", "failures", "errors", "time")} == {
        "name": "against-path", "tests": "12", "failures": "1", "errors": "0", "time": "0",
    }  # fmt: skip
    assert [suite.get("name") for suite in root] == ["good", "bad"]
    assert [(case.get("classname"), case.get("name"), len(case)) for case in root[1].findall("testcase")] == [
        ("bad", "x", 1), ("bad", "y", 0), ("bad", "z", 0), ("bad", "norm", 0),
        ("bad", "coverage", 0), ("bad", "judged", 0),
    ]  # fmt: skip
    failure = root[1].findall("testcase/failure")[0]
    assert (failure.get("type"), failure.text) == (
        "out-of-tolerance",
        "|Δx| = 4.000 mm of 3.5 mm allowed (1.14 times the tolerance) at t = 0.495 s (row 100); out of"
        " tolerance: 13 of 100 samples (13.0 %)",
    )
    assert root[0].get("timestamp") == result.provenance.created[:19]


def test_the_properties_are_the_statistics_bit_for_bit(tmp_path: Path) -> None:
    deltas = 0.001 * np.random.default_rng(1).normal(size=(60, 6))
    result = arms({"a": deltas}, tolerance={"axis": 0.001, "joint": 0.002})
    suite = written(result, tmp_path / "verdict.xml")[0]
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


def test_a_joint_that_is_called_x_is_not_the_axis(tmp_path: Path) -> None:
    result = arms({"a": np.full((20, 6), 0.01)}, tolerance={"axis": 1.0, "joint": 0.002})
    run = result.runs[0]
    assert run.joint_delta is not None
    renamed = {"x": replace(run.joint_statistics["q1"], quantity="x")}
    changed = replace(
        result,
        runs=(replace(run, joint_statistics=renamed, joint_turns=(0,), joint_delta=run.joint_delta[:, :1]),),
    )
    cases = written(changed, tmp_path / "verdict.xml")[0].findall("testcase")
    assert [case.get("name") for case in cases] == ["x", "y", "z", "joint x", "coverage", "judged"]


def test_what_is_worse_than_the_baseline_fails(tmp_path: Path) -> None:
    before = paths({"a": off(0.001), "old": off(0.0)})
    now = paths({"a": off(0.0015)})
    result = replace(now, baseline=compare_with_baseline(now, before))
    root = written(result, tmp_path / "verdict.xml")
    failures = {
        (case.get("classname"), case.get("name")): case[0] for case in root.iter("testcase") if len(case)
    }
    assert {one.get("type") for one in failures.values()} == {"worse-than-baseline"}
    assert list(failures) == [
        ("a against baseline", "x"), ("a against baseline", "norm"),
        ("old against baseline", "log is there"),
    ]  # fmt: skip
    assert failures["a against baseline", "x"].text == (
        "|Δx|: max 1.000 → 1.500 mm, rms 0.5788 → 0.8682 mm (noise 0.001 mm)"
    )
    assert failures["old against baseline", "log is there"].text == (
        "old: a log of the baseline, not compared any more"
    )
    with_joints = arms({"a": np.zeros((100, 6))})
    result = replace(now, baseline=compare_with_baseline(now, with_joints))
    lost = written(result, tmp_path / "verdict.xml").findall(".//testcase[@name='angle is there']/failure")
    assert [one.text for one in lost] == ["angle: in the baseline, not compared any more"]


def test_a_quantity_that_is_gone_fails_whatever_the_log_was_called(tmp_path: Path) -> None:
    before, now = arms({"monday": np.zeros((100, 6))}), paths({"tuesday": off(0.0)})
    result = replace(now, baseline=compare_with_baseline(now, before))
    gone = ["angle", *(f"q{number}" for number in range(1, 7))]
    assert [str(one) for one in there(result.baseline).missing] == [f"{name} of tuesday" for name in gone]
    root = written(result, tmp_path / "verdict.xml")
    assert (result.verdict, root.get("failures")) == ("fail", "7")
    failed = [(case.get("classname"), case.get("name")) for case in root.iter("testcase") if len(case)]
    assert failed == [("tuesday against baseline", f"{name} is there") for name in gone]


def test_the_warnings_of_a_log_stand_behind_its_cases(tmp_path: Path) -> None:
    logs, half = {"short": off(0.001, 50), "long": off(0.001)}, {"coverage": 0.5}
    result = paths(logs, tolerance={"norm": 0.15, **half})
    told = [suite.findtext("system-out") for suite in written(result, tmp_path / "verdict.xml")]
    seen = "it shows 50 of 100 samples of path (50.0 %), longest unseen: 0.245 s from t = 0.250 s"
    seen += " of the reference"
    for_all = "large-tolerance: a tolerance of 150 mm (norm) accepts any deviation: 0.15 is in m;"
    for_all += " --tolerance norm=0.15mm if mm was meant; --tolerance norm=0.15m if not"
    assert told == [f"not-covered: short: {seen}\n{for_all}", for_all]
    result = paths(logs, tolerance=half)
    told = [suite.findtext("system-out") for suite in written(result, tmp_path / "verdict.xml")]
    assert told == [f"not-covered: short: {seen}", None]


def test_what_could_not_be_compared_takes_the_place_of_a_verdict_from_before(tmp_path: Path) -> None:
    path = tmp_path / "verdict.xml"
    written(paths({"a": off(0.0, 5)}), path)
    wrong = LogError(Finding("found 'x', allowed: a number", "a.csv", line=7, column="q1"), Finding("no arm"))
    with pytest.raises(LogError), errors_in_junit(path, []):
        raise wrong
    root = ET.parse(path).getroot()
    assert_consumers_take_it(root)
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("2", "0", "2")
    cases = root[0].findall("testcase")
    assert [(case.get("classname"), case.get("name"), case[0].text) for case in cases] == [
        ("a.csv", "can be compared (1)", "a.csv:7, column q1: found 'x', allowed: a number"),
        ("urmpipe compare", "can be compared (2)", "no arm"),
    ]
    assert {case[0].get("type") for case in cases} == {"bad-input"}


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
def test_any_name_of_a_file_is_held(tmp_path: Path, name: str) -> None:
    result = replace(paths({"a": off(0.0, 5)}), name=name)
    result = replace(result, runs=(replace(result.runs[0], name=name),))
    root = written(result, tmp_path / "verdict.xml")
    if name.isprintable():
        assert root[0].get("name") == root.get("name") == name


def test_control_characters_stand_as_python_escapes_them(tmp_path: Path) -> None:
    result = replace(
        paths({"a": off(0.0, 5)}), name="a\x00b\tc\nd\r\x85\udc80\uffff]]><&\"'\N{GRINNING FACE}"
    )
    assert written(result, tmp_path / "verdict.xml").get("name") == (
        "a\\x00b\\tc\\nd\\r\\x85\\udc80\\uffff]]><&\"'\N{GRINNING FACE}"
    )


def test_a_junit_file_of_ours_is_replaced_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "verdict.xml"
    for _ in range(2):
        written(paths({"a": off(0.0, 5)}), path)
    path.write_text('<?xml version="1.0" encoding="UTF-8"?>\n<testsuites/>\n')
    assert refusal(OutputError, written, paths({"a": off(0.0, 5)}), path) == (
        f"{path}: found a file that is not a JUnit file of urmpipe, allowed: a new name,"
        " or such a JUnit file to replace"
    )
