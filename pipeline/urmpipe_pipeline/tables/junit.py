"""Checks of a presentation as JUnit XML, which GitLab, Jenkins and GitHub's actions show as tests.

There is no single schema. What these programs read, and what is written here:

    testsuites   name, tests, failures, errors, time
    testsuite    name, tests, failures, errors, skipped, time, timestamp (ISO 8601, UTC); one per section
    properties   before the test cases, at least one property; property: name, value
    testcase     classname, name, time: both names are needed, and each pair is unique
    failure      message, type, and the same as text: one per test case, since Jenkins keeps one
    error        the same, of a test case that could not be run
    system-out   after the test cases: the warnings of a section and of those above it

GitLab shows the class names in place of the suites, and of a failure only the text. Times are 0: these
programs add them up as run times, and nothing was timed. XML has no control characters and no lone
surrogates: they are written as they are escaped in Python.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

from urmpipe_models.errors import HIDDEN, Finding, OutputError, UrmpipeError
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import JUNIT_HEADER, safe_output
from urmpipe_pipeline.presentation.section import Presentation, Section

BAD_INPUT = "bad-input"  # type of an error

# Characters that XML does not allow, or that a reader may change: line ends and tabs in attributes.
ESCAPED = re.compile(f"[{HIDDEN}]|[^\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(shown: Presentation, part: Path, path: Path) -> None:
    """Write the checks of a presentation as JUnit XML and read it back.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    root = ET.Element("testsuites", name=_escape(shown.name))
    root.extend(_iter_suites(shown.body, shown.created[:19], ()))
    _write(root, part, path)


@contextmanager
def errors_in_junit(path: Path | None, inputs: Sequence[Path]) -> Iterator[None]:
    """Write an error of the body to a JUnit file, too, as `write_errors` does, and raise it again."""
    try:
        yield
    except UrmpipeError as error:
        if path is not None:
            write_errors(path, inputs, error.findings)
        raise


def write_errors(path: Path, inputs: Sequence[Path], findings: Sequence[Finding]) -> None:
    """Write to a JUnit file why there is no verdict, one test case per finding: no earlier verdict stays.

    A file that is no JUnit file of urmpipe, or an input, is not replaced.
    """
    root = ET.Element("testsuites", name="urmpipe compare")
    suite = ET.SubElement(root, "testsuite", name="urmpipe compare")
    _add_errors(suite, findings)
    _set_counts(suite)
    with suppress(OutputError), safe_output(path, inputs, "junit") as part:
        _write(root, part, path)


def _write(root: ET.Element, part: Path, path: Path) -> None:
    """Add up the counts of the suites, write the file and read it back."""
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in root)))
    root.set("time", "0")
    ET.indent(root)
    written = ET.tostring(root, encoding="unicode")
    part.write_text(f"{JUNIT_HEADER}\n{written}\n", encoding="utf-8", newline="\n")
    if ET.tostring(ET.parse(part).getroot(), encoding="unicode") != written:
        raise OutputError(Finding("differs when read back", str(path)))


def _iter_suites(section: Section, timestamp: str, above: tuple[LogWarning, ...]) -> Iterator[ET.Element]:
    """Yield the suite of a section with checks, properties or errors, and those of the sections in it."""
    warnings = (*section.warnings, *above)
    if section.checks or section.properties or section.errors:
        yield _build_suite(section, timestamp, warnings)
    for part in section.sections:
        yield from _iter_suites(part, timestamp, warnings)


def _build_suite(section: Section, timestamp: str, warnings: Sequence[LogWarning]) -> ET.Element:
    suite = ET.Element("testsuite", name=_escape(section.title))
    if section.properties:
        properties = ET.SubElement(suite, "properties")
        for name, value in section.properties.items():
            ET.SubElement(properties, "property", name=_escape(name), value=_escape(text.format_exact(value)))
    for check in section.checks:
        case = _add_case(suite, check.about or section.title, check.name)
        if check.verdict == "fail":
            _add_reason(case, "failure", check.kind, check.words)
    _add_errors(suite, section.errors, section.title)
    if warnings:
        lines = (f"{warning.kind}: {warning}" for warning in warnings)
        ET.SubElement(suite, "system-out").text = "\n".join(map(_escape, lines))
    _set_counts(suite)
    if timestamp:
        suite.set("timestamp", timestamp)
    return suite


def _add_errors(suite: ET.Element, findings: Sequence[Finding], about: str = "") -> None:
    """Add a test case for each error, whose class name is stated or the name of its file."""
    for number, finding in enumerate(findings, start=1):
        case = _add_case(suite, about or finding.file or "urmpipe compare", f"can be compared ({number})")
        _add_reason(case, "error", BAD_INPUT, str(finding))


def _set_counts(suite: ET.Element) -> None:
    for name, element in (("tests", ""), ("failures", "/failure"), ("errors", "/error")):
        suite.set(name, str(len(suite.findall(f"testcase{element}"))))
    suite.set("skipped", "0")
    suite.set("time", "0")


def _add_case(suite: ET.Element, classname: str, name: str) -> ET.Element:
    return ET.SubElement(suite, "testcase", classname=_escape(classname), name=_escape(name), time="0")


def _add_reason(case: ET.Element, tag: Literal["failure", "error"], kind: str, message: str) -> None:
    """Add why a test case failed, or could not be run."""
    ET.SubElement(case, tag, message=_escape(message), type=kind).text = _escape(message)


def _escape(value: str) -> str:
    return ESCAPED.sub(lambda match: ascii(match[0])[1:-1], value)
