"""Each fenced block of every page is checked by its language; the tests of single pages also run them."""

from __future__ import annotations

import csv
import json
import re
import shlex
import tomllib
from collections.abc import Callable
from xml.etree import ElementTree

import pytest
import yaml

from pages import pages, text_of

FENCED = re.compile(r"^( *)```(\w*)\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)


def same_width(content: str) -> None:
    """Refuse a CSV whose rows differ in their number of cells; a semicolon in its header is its delimiter."""
    lines = content.splitlines()
    rows = csv.reader(lines, delimiter=";" if ";" in lines[0] else ",")
    assert len({len(row) for row in rows}) == 1


CHECKS: dict[str, Callable[[str], object]] = {
    "csv": same_width,
    "json": json.loads,
    "python": lambda content: compile(content, "page", "exec"),
    "sh": lambda content: shlex.split(content, comments=True),
    "toml": tomllib.loads,
    "xml": ElementTree.fromstring,
    "yaml": lambda content: list(yaml.safe_load_all(content)),
}

NOT_CHECKED = {
    "text": "output or a diagram: test_tutorial.py, test_commands_page.py",
    "lua": "runs in test_recorders.py where lua5.4 is",
    "matlab": "runs in test_recorders.py where octave is",
}
"""Languages that nothing here reads, and why."""


WRONG_ON_PURPOSE = {
    ("docs/targets.md", "x,y,z,qx,qy,qz,qw"): "each wrong row has its error: test_targets_page.py"
}
"""Page and first line of blocks that show what is refused, and where that is tested."""


def blocks(page: str) -> list[tuple[str, str]]:
    """Return the language and the content of each fenced block, without its indent."""
    return [
        (language, re.sub(f"^{indent}", "", content, flags=re.MULTILINE))
        for indent, language, content in FENCED.findall(text_of(page))
    ]


@pytest.mark.parametrize("page", [page for page in [*pages(), "CONTRIBUTING.md"] if blocks(page)])
def test_each_fenced_block_is_of_its_language(page: str) -> None:
    for language, content in blocks(page):
        assert language in CHECKS or language in NOT_CHECKED, f"{page}: {language!r}: {content}"
        if language in CHECKS and (page, content.partition("\n")[0]) not in WRONG_ON_PURPOSE:
            CHECKS[language](content)
