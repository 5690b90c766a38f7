"""A comparison that could not be made, as JUnit XML: a verdict from before must not stay in its place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from urmpipe_models.errors import OutputError, UrmpipeError
from urmpipe_pipeline.comparison.junit import write_junit
from urmpipe_pipeline.outputs import guarded_output


@contextmanager
def told_in_junit(path: Path | None, inputs: Sequence[Path]) -> Iterator[None]:
    """Write an error of the body to a JUnit file, too, as one test case a finding, and raise it on.

    A file that is no JUnit file of urmpipe's, or an input, is left as it is.

    Args:
        path: The JUnit file; None for none.
        inputs: The files that it may not replace.
    """
    try:
        yield
    except UrmpipeError as error:
        if path is not None:
            with suppress(OutputError), guarded_output(path, inputs, "junit") as part:
                write_junit(error.findings, part, path)
        raise
