"""What the code cites stands in docs/sources.md, and nothing else does."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "sources.md"


def cited() -> set[str]:
    """Return the keys in brackets with an underscore behind them, of all code."""
    files = (
        file
        for area in ("models", "pipeline", "fmus", "cli", "tests")
        for file in (ROOT / area).rglob("*.py")
    )
    return {key for file in files for key in re.findall(r"\[([A-Z]\w+)\]_", file.read_text(encoding="utf-8"))}


def listed() -> list[str]:
    return re.findall(r"^\| ([A-Z]\w+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def test_each_key_that_is_cited_can_be_looked_up_and_each_one_listed_is_cited() -> None:
    assert set(listed()) == cited()
    assert len(set(listed())) == len(listed())


def test_the_readme_names_no_other_source() -> None:
    named = set(re.findall(r"\[([A-Z][a-z]\w*\d\w*)\]", (ROOT / "README.md").read_text(encoding="utf-8")))
    assert named <= cited()
