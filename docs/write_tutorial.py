"""Run the commands of docs/tutorial.md, and write what they print into the page.

    python docs/write_tutorial.py

A block of output shows the first lines of what the command before it prints, as many as it has. A test holds
the page and the commands together: after a change of what they print, run this again.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from urmpipe.main import run
from urmpipe_datasets import LOGS

PAGE = Path(__file__).resolve().parent / "tutorial.md"
WIDTH = "100"
"""Width in characters that the terminal has."""

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def steps(text: str, folder: Path) -> Iterator[tuple[int, str]]:
    """Do in a folder what the page tells; yield the exit code of each command and what it prints.

    The folder has the logs already, and `view` needs a display: both are left out.
    """
    for source in LOGS.glob("*.csv"):
        shutil.copy(source, folder)
    for block in BLOCK.finditer(text):
        language, content = block.groups()
        if language == "toml":
            (folder / "fixed.toml").write_text(content, encoding="utf-8")
        elif language == "sh" and content.startswith("urmpipe ") and not content.startswith("urmpipe view "):
            yield printed(content)


def printed(command: str) -> tuple[int, str]:
    """Run a command in the working folder; return its exit code and what it prints."""
    output, before = io.StringIO(), dict(os.environ)
    os.environ["COLUMNS"] = WIDTH
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(io.StringIO()):
            code = run(shlex.split(command)[1:])
    finally:
        os.environ.clear()
        os.environ.update(before)
    return code, output.getvalue()


def page(text: str, outputs: list[str]) -> str:
    """Return the page with outputs, one for each command that has a block of them behind it."""
    following = iter(outputs)
    current: list[str] = []

    def renewed(block: re.Match[str]) -> str:
        nonlocal current
        language, content = block.groups()
        if language == "sh" and content.startswith("urmpipe ") and not content.startswith("urmpipe view "):
            current = next(following).splitlines()
        if language != "text":
            return block[0]
        lines = (line.rstrip() for line in current[: len(content.splitlines())])
        return "\n".join(["```text", *lines, "```"])

    return BLOCK.sub(renewed, text)


if __name__ == "__main__":
    old = PAGE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        new = page(old, [output for _, output in steps(old, Path(name))])
    PAGE.write_text(new, encoding="utf-8", newline="\n")
