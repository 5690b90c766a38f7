"""A comparison as JUnit XML, which GitLab, Jenkins and GitHub's actions show as tests.

There is no one schema. What the consumers take, and what is written here:

    testsuites   name, tests, failures, errors, time
    testsuite    name, tests, failures, errors, skipped, time, timestamp (ISO 8601, UTC, no zone); one a log
    properties   before the test cases, at least one property; property: name, value
    testcase     classname, name, time: both names are needed, and each pair stands once
    failure      message, type, and the same as text: one a test case, as Jenkins keeps one

GitLab shows the class names in place of the suites, and of a failure the text alone. Times are in s, without
exponents; the time of a suite is that of the motion that was compared. A test case is a quantity with a
tolerance and, against a baseline, a quantity that both comparisons have. XML holds no control characters and
no lone surrogates: they are written as they are escaped in Python.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.comparison.baseline import Absent, Change
from urmpipe_pipeline.comparison.comparison import Comparison, Deviation, Statistics
from urmpipe_pipeline.outputs import JUNIT_HEADER
from urmpipe_pipeline.text import exact

OUT_OF_TOLERANCE = "out-of-tolerance"
WORSE = "worse-than-baseline"

UNHOLDABLE = re.compile("[^\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML may not hold, or a reader may turn into something else: line ends and tabs in attributes."""


def write_junit(result: Comparison, part: Path, path: Path) -> None:
    """Write the verdict of a comparison as JUnit XML and read it back.

    Args:
        result: The comparison.
        part: Where to write it, as `guarded_output` gives it.
        path: The name it is to have, for messages.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    root = junit_tree(result)
    written = ET.tostring(root, encoding="unicode")
    part.write_text(f"{JUNIT_HEADER}\n{written}\n", encoding="utf-8", newline="\n")
    if ET.tostring(ET.parse(part).getroot(), encoding="unicode") != written:
        raise OutputError(Finding("reads back otherwise than written", str(path)))


def junit_tree(result: Comparison) -> ET.Element:
    """Return the element `testsuites` of a comparison."""
    root = ET.Element("testsuites", name=_plain(result.name))
    suites = [_suite(result, run) for run in result.runs]
    if result.baseline:
        suites += [_missing(one) for one in result.baseline.gone if one.quantity is None]
    root.extend(suites)
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in suites)))
    root.set("time", _time(sum(map(_duration, result.runs))))
    ET.indent(root)
    return root


def _suite(result: Comparison, run: Deviation) -> ET.Element:
    """Return the test suite of one log."""
    suite = ET.Element("testsuite", name=_plain(run.name))
    properties = ET.SubElement(suite, "properties")
    for name, value in _properties(result, run):
        ET.SubElement(properties, "property", name=_plain(name), value=_plain(exact(value)))
    suite.extend(_judged(run, one) for one in run.all_statistics if one.tolerance is not None)
    if result.baseline:
        suite.extend(_changed(one) for one in result.baseline.changes if one.run == run.name)
        suite.extend(_lost(one) for one in result.baseline.gone if one.run == run.name)
    return _counted(suite, _time(_duration(run)), result.provenance.created[:19])


def _counted(suite: ET.Element, time: str, timestamp: str = "") -> ET.Element:
    """Set the attributes of a suite that count what is in it."""
    suite.set("tests", str(len(suite.findall("testcase"))))
    suite.set("failures", str(len(suite.findall("testcase/failure"))))
    suite.set("errors", "0")
    suite.set("skipped", "0")
    suite.set("time", time)
    if timestamp:
        suite.set("timestamp", timestamp)
    return suite


def _properties(result: Comparison, run: Deviation) -> Iterator[tuple[str, Any]]:
    """Yield what is worth keeping of a log, and every field of the statistics of each quantity."""
    longest = run.longest_out
    yield "reference", result.reference.name
    yield "verdict", run.verdict
    yield "samples", len(run.sample)
    yield "left_out", run.left_out
    yield "reference_left_out", run.reference_left_out
    yield "sync_offset", run.sync.offset
    yield "share_out", run.share_out
    yield "longest_out", 0.0 if longest is None else longest.duration
    yield "speed_correlation", run.speed_correlation
    for one in run.all_statistics:
        for field, value in asdict(one).items():
            yield f"{_named(one)}.{field}", value


def _judged(run: Deviation, one: Statistics) -> ET.Element:
    """Return the test case of a quantity that has a tolerance."""
    case = _case(run.name, _named(one))
    if one.verdict == "fail":
        _fail(
            case,
            OUT_OF_TOLERANCE,
            f"{_named(one)}: max {one.max!r} {one.unit}, allowed {one.tolerance!r} {one.unit},"
            f" at t = {one.t_max!r} s (sample {one.sample_max});"
            f" {one.out_of_tolerance} samples out, share {one.share_out!r}",
        )
    return case


def _changed(change: Change) -> ET.Element:
    """Return the test case of a quantity that is held against the baseline."""
    case = _case(f"{change.run} against baseline", _named(change.now))
    if change.worse:
        told = (
            f"{field} {getattr(change.before, field)!r} -> {getattr(change.now, field)!r}"
            for field in change.worse
        )
        noise = f"noise {change.noise!r} {change.now.unit}"
        _fail(case, WORSE, f"{_named(change.now)}: {', '.join(told)} ({noise})")
    return case


def _lost(absent: Absent) -> ET.Element:
    """Return the test case of a quantity that only the baseline has."""
    case = _case(f"{absent.run} against baseline", f"{absent.quantity} is there")
    _fail(case, WORSE, f"{absent.quantity}: in the baseline, not compared any more")
    return case


def _missing(absent: Absent) -> ET.Element:
    """Return the test suite of a log that only the baseline has."""
    suite = ET.Element("testsuite", name=_plain(absent.run))
    case = _case(f"{absent.run} against baseline", "log is there")
    _fail(case, WORSE, f"{absent.run}: a log of the baseline, not compared any more")
    suite.append(case)
    return _counted(suite, _time(0))


def _case(classname: str, name: str) -> ET.Element:
    """Return a test case; nothing was timed."""
    return ET.Element("testcase", classname=_plain(classname), name=_plain(name), time="0")


def _fail(case: ET.Element, kind: str, message: str) -> None:
    """Let a test case fail."""
    ET.SubElement(case, "failure", message=_plain(message), type=kind).text = _plain(message)


def _named(one: Statistics) -> str:
    """Return the name of a quantity, unique in its log: a joint may be called x."""
    return f"joint {one.quantity}" if one.kind == "joint" else one.quantity


def _duration(run: Deviation) -> int:
    """Return the time from the first to the last compared sample in integer [ns]."""
    return int(run.t_ns[-1] - run.t_ns[0])


def _time(ns: int) -> str:
    """Return a time in integer [ns] as [s], without an exponent."""
    return f"{ns // 10**9}.{ns % 10**9:09d}"


def _plain(text: str) -> str:
    """Return a text with what XML cannot hold escaped."""
    return UNHOLDABLE.sub(lambda found: ascii(found[0])[1:-1], text)
