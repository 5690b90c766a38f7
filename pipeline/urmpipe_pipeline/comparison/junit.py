"""A comparison as JUnit XML, which GitLab, Jenkins and GitHub's actions show as tests.

There is no one schema. What the consumers take, and what is written here:

    testsuites   name, tests, failures, errors, time
    testsuite    name, tests, failures, errors, skipped, time, timestamp (ISO 8601, UTC, no zone); one a log
    properties   before the test cases, at least one property; property: name, value
    testcase     classname, name, time: both names are needed, and each pair stands once
    failure      message, type, and the same as text: one a test case, as Jenkins keeps one
    error        the same, of a test case that could not be run
    system-out   behind the test cases: the warnings of a log, and those of the comparison that are for all

GitLab shows the class names in place of the suites, and of a failure the text alone. Times are 0: consumers
add them up as run times, and nothing was timed; that of the motion is the property duration. A test case is a
quantity with a tolerance and, against a baseline, a quantity that both comparisons have; of a comparison that
could not be made, what was wrong. XML holds no control characters and no lone surrogates: they are written as
they are escaped in Python.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from urmpipe_models.errors import Finding, OutputError
from urmpipe_models.spelling import Voice
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.change import Absent, Change
from urmpipe_pipeline.comparison.change_wording import noise_words, worse_words
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Statistics
from urmpipe_pipeline.comparison.symbols import size_of
from urmpipe_pipeline.comparison.wording import decided_words, out_words
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import JUNIT_HEADER

OUT_OF_TOLERANCE = "out-of-tolerance"
WORSE = "worse-than-baseline"
BAD_INPUT = "bad-input"

UNHOLDABLE = re.compile("[^\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML may not hold, or a reader may turn into something else: line ends and tabs in attributes."""


def write_junit(
    result: Comparison | Sequence[Finding], part: Path, path: Path, voice: Voice = "python"
) -> None:
    """Write the verdict of a comparison, or why there is none, as JUnit XML and read it back.

    Args:
        result: The comparison, or what was wrong: at least one finding.
        part: Where to write it, as `guarded_output` gives it.
        path: The name it is to have, for messages.
        voice: In whose words it tells warnings and errors.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    root = junit_tree(result, voice) if isinstance(result, Comparison) else error_tree(result, voice)
    written = ET.tostring(root, encoding="unicode")
    part.write_text(f"{JUNIT_HEADER}\n{written}\n", encoding="utf-8", newline="\n")
    if ET.tostring(ET.parse(part).getroot(), encoding="unicode") != written:
        raise OutputError(Finding("reads back otherwise than written", str(path)))


def junit_tree(result: Comparison, voice: Voice = "python") -> ET.Element:
    """Return the element `testsuites` of a comparison, its warnings in somebody's words."""
    root = ET.Element("testsuites", name=_plain(result.name))
    root.extend(_suite(result, run, voice) for run in result.runs)
    if result.baseline:
        root.extend(_missing(one) for one in result.baseline.gone if one.quantity is None)
    return _summed(root)


def error_tree(findings: Sequence[Finding], voice: Voice = "python") -> ET.Element:
    """Return the element `testsuites` of a comparison that could not be made: an error a finding.

    Args:
        findings: What was wrong, at least one.
        voice: In whose words it is told.
    """
    root = ET.Element("testsuites", name="urmpipe compare")
    suite = ET.SubElement(root, "testsuite", name="urmpipe compare")
    for number, finding in enumerate(findings, start=1):
        case = _case(finding.file or "urmpipe compare", f"can be compared ({number})")
        _told(case, "error", BAD_INPUT, finding.words(voice))
        suite.append(case)
    _counted(suite)
    return _summed(root)


def _summed(root: ET.Element) -> ET.Element:
    """Set the attributes that sum up the suites, and indent."""
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in root)))
    root.set("time", "0")
    ET.indent(root)
    return root


def _suite(result: Comparison, run: Deviation, voice: Voice) -> ET.Element:
    """Return the test suite of one log."""
    suite = ET.Element("testsuite", name=_plain(run.name))
    properties = ET.SubElement(suite, "properties")
    for name, value in _properties(result, run):
        ET.SubElement(properties, "property", name=_plain(name), value=_plain(text.exact(value)))
    suite.extend(_judged(run, one) for one in run.all_statistics if one.tolerance is not None)
    if result.baseline:
        suite.extend(_changed(one) for one in result.baseline.changes if one.run == run.name)
        suite.extend(_lost(one) for one in result.baseline.gone if one.run == run.name)
    if told := [f"{one.kind}: {one.words(voice)}" for one in _warnings(result, run)]:
        ET.SubElement(suite, "system-out").text = "\n".join(map(_plain, told))
    return _counted(suite, result.provenance.created[:19])


def _warnings(result: Comparison, run: Deviation) -> Iterator[LogWarning]:
    """Yield the warnings of a log, and those of its comparison that are about no other log."""
    yield from run.run.warnings
    others = [one.name for one in result.runs if one is not run]
    yield from (one for one in result.warnings if one.about not in others)


def _counted(suite: ET.Element, timestamp: str = "") -> ET.Element:
    """Set the attributes of a suite that count what is in it."""
    suite.set("tests", str(len(suite.findall("testcase"))))
    suite.set("failures", str(len(suite.findall("testcase/failure"))))
    suite.set("errors", str(len(suite.findall("testcase/error"))))
    suite.set("skipped", "0")
    suite.set("time", "0")
    if timestamp:
        suite.set("timestamp", timestamp)
    return suite


def _properties(result: Comparison, run: Deviation) -> Iterator[tuple[str, Any]]:
    """Yield what is worth keeping of a log, and every field of the statistics of each quantity."""
    longest = run.longest_out
    yield "reference", result.reference.name
    yield "verdict", run.verdict
    yield "duration", run.duration
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
        row = "" if one.missing else f" (row {run.row(one)})"
        out = out_words(one.out_of_tolerance or 0, len(run.sample))
        _told(case, "failure", OUT_OF_TOLERANCE, f"{decided_words(one)}{row}; out of tolerance: {out}")
    return case


def _changed(change: Change) -> ET.Element:
    """Return the test case of a quantity that is held against the baseline."""
    case = _case(f"{change.run} against baseline", _named(change.now))
    if change.worse:
        said = f"{size_of(change.now)}: {worse_words(change)} ({noise_words(change)})"
        _told(case, "failure", WORSE, said)
    return case


def _lost(absent: Absent) -> ET.Element:
    """Return the test case of a quantity that only the baseline has."""
    case = _case(f"{absent.run} against baseline", f"{absent.quantity} is there")
    _told(case, "failure", WORSE, f"{absent.quantity}: in the baseline, not compared any more")
    return case


def _missing(absent: Absent) -> ET.Element:
    """Return the test suite of a log that only the baseline has."""
    suite = ET.Element("testsuite", name=_plain(absent.run))
    case = _case(f"{absent.run} against baseline", "log is there")
    _told(case, "failure", WORSE, f"{absent.run}: a log of the baseline, not compared any more")
    suite.append(case)
    return _counted(suite)


def _case(classname: str, name: str) -> ET.Element:
    """Return a test case; nothing was timed."""
    return ET.Element("testcase", classname=_plain(classname), name=_plain(name), time="0")


def _told(case: ET.Element, tag: Literal["failure", "error"], kind: str, message: str) -> None:
    """Say why a test case failed, or could not be run."""
    ET.SubElement(case, tag, message=_plain(message), type=kind).text = _plain(message)


def _named(one: Statistics) -> str:
    """Return the name of a quantity, unique in its log: a joint may be called x."""
    return f"joint {one.quantity}" if one.kind == "joint" else one.quantity


def _plain(value: str) -> str:
    """Return a text with what XML cannot hold escaped."""
    return UNHOLDABLE.sub(lambda found: ascii(found[0])[1:-1], value)
