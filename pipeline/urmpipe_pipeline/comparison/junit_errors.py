"""A comparison that could not be made, as JUnit XML: a verdict from before must not stay in its place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from urmpipe_models.errors import Finding, OutputError, UrmpipeError
from urmpipe_models.spelling import Voice
from urmpipe_pipeline.comparison.junit import write_junit
from urmpipe_pipeline.outputs import guarded_output


@contextmanager
def told_in_junit(path: Path | None, inputs: Sequence[Path], voice: Voice = "python") -> Iterator[None]:
    """Write an error of the body to a JUnit file, too, as `tell_junit` does, and raise it on.

    Args:
        path: The JUnit file; None for none.
        inputs: The files that it may not replace.
        voice: In whose words it is told.
    """
    try:
        yield
    except UrmpipeError as error:
        if path is not None:
            tell_junit(path, inputs, error.findings, voice)
        raise


def tell_junit(path: Path, inputs: Sequence[Path], findings: Sequence[Finding], voice: Voice) -> None:
    """Write why there is no verdict to a JUnit file, one test case a finding.

    A file that is no JUnit file of urmpipe's, or an input, is left as it is.

    Args:
        path: The JUnit file.
        inputs: The files that it may not replace.
        findings: What was wrong, at least one.
        voice: In whose words it is told.
    """
    with suppress(OutputError), guarded_output(path, inputs, "junit") as part:
        write_junit(findings, part, path, voice)
