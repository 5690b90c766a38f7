"""What was judged as JUnit XML, which GitLab, Jenkins and GitHub's actions show as tests.

There is no one schema. What the consumers take, and what is written here:

    testsuites   name, tests, failures, errors, time
    testsuite    name, tests, failures, errors, skipped, time, timestamp (ISO 8601, UTC); one a section
    properties   before the test cases, at least one property; property: name, value
    testcase     classname, name, time: both names are needed, and each pair stands once
    failure      message, type, and the same as text: one a test case, as Jenkins keeps one
    error        the same, of a test case that could not be run
    system-out   behind the test cases: the warnings of a section and of those above it

GitLab shows the class names in place of the suites, and of a failure the text alone. Times are 0: consumers
add them up as run times, and nothing was timed. XML holds no control characters and no lone surrogates: they
are written as they are escaped in Python.
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

BAD_INPUT = "bad-input"

UNHOLDABLE = re.compile(f"[{HIDDEN}]|[^\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML may not hold, or a reader may turn into something else: line ends and tabs in attributes."""


def write_junit(shown: Presentation, part: Path, path: Path) -> None:
    """Write the checks of a presentation as JUnit XML and read it back.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    root = ET.Element("testsuites", name=_plain(shown.name))
    root.extend(_suites(shown.body, shown.created[:19], ()))
    _write(root, part, path)


@contextmanager
def errors_in_junit(path: Path | None, inputs: Sequence[Path]) -> Iterator[None]:
    """Write an error of the body to a JUnit file, too, as `write_errors` does, and raise it on."""
    try:
        yield
    except UrmpipeError as error:
        if path is not None:
            write_errors(path, inputs, error.findings)
        raise


def write_errors(path: Path, inputs: Sequence[Path], findings: Sequence[Finding]) -> None:
    """Write why there is no verdict to a JUnit file, one test case a finding: no earlier verdict stays.

    A file that is no JUnit file of urmpipe's, or an input, is left as it is.
    """
    root = ET.Element("testsuites", name="urmpipe compare")
    suite = ET.SubElement(root, "testsuite", name="urmpipe compare")
    _add_errors(suite, findings)
    _count(suite)
    with suppress(OutputError), safe_output(path, inputs, "junit") as part:
        _write(root, part, path)


def _write(root: ET.Element, part: Path, path: Path) -> None:
    """Sum up the suites, write the file and read it back."""
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in root)))
    root.set("time", "0")
    ET.indent(root)
    written = ET.tostring(root, encoding="unicode")
    part.write_text(f"{JUNIT_HEADER}\n{written}\n", encoding="utf-8", newline="\n")
    if ET.tostring(ET.parse(part).getroot(), encoding="unicode") != written:
        raise OutputError(Finding("differs when read back", str(path)))


def _suites(section: Section, timestamp: str, above: tuple[LogWarning, ...]) -> Iterator[ET.Element]:
    """Yield the test suite of a section that judges something, and those of the sections below it."""
    warnings = (*section.warnings, *above)
    if section.checks or section.properties or section.errors:
        yield _suite(section, timestamp, warnings)
    for one in section.sections:
        yield from _suites(one, timestamp, warnings)


def _suite(section: Section, timestamp: str, warnings: Sequence[LogWarning]) -> ET.Element:
    suite = ET.Element("testsuite", name=_plain(section.title))
    if section.properties:
        properties = ET.SubElement(suite, "properties")
        for name, value in section.properties.items():
            ET.SubElement(properties, "property", name=_plain(name), value=_plain(text.exact(value)))
    for check in section.checks:
        case = _case(suite, check.about or section.title, check.name)
        if check.verdict == "fail":
            _reason(case, "failure", check.kind, check.words)
    _add_errors(suite, section.errors, section.title)
    if warnings:
        told = (f"{one.kind}: {one}" for one in warnings)
        ET.SubElement(suite, "system-out").text = "\n".join(map(_plain, told))
    _count(suite)
    if timestamp:
        suite.set("timestamp", timestamp)
    return suite


def _add_errors(suite: ET.Element, findings: Sequence[Finding], about: str = "") -> None:
    """Add a test case for each error, of a class for all or of its file's name."""
    for number, finding in enumerate(findings, start=1):
        case = _case(suite, about or finding.file or "urmpipe compare", f"can be compared ({number})")
        _reason(case, "error", BAD_INPUT, str(finding))


def _count(suite: ET.Element) -> None:
    """Set the attributes of a suite that count what is in it."""
    for name, found in (("tests", ""), ("failures", "/failure"), ("errors", "/error")):
        suite.set(name, str(len(suite.findall(f"testcase{found}"))))
    suite.set("skipped", "0")
    suite.set("time", "0")


def _case(suite: ET.Element, classname: str, name: str) -> ET.Element:
    """Return a new test case; nothing was timed."""
    return ET.SubElement(suite, "testcase", classname=_plain(classname), name=_plain(name), time="0")


def _reason(case: ET.Element, tag: Literal["failure", "error"], kind: str, message: str) -> None:
    """Say why a test case failed, or could not be run."""
    ET.SubElement(case, tag, message=_plain(message), type=kind).text = _plain(message)


def _plain(value: str) -> str:
    """Return a text with what XML cannot hold escaped."""
    return UNHOLDABLE.sub(lambda found: ascii(found[0])[1:-1], value)
