"""The Python of pages without a test of their own runs: the blocks of a page one after the other."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from pages import DOCS, snippets
from urmpipe_fmus.native import native_unavailable_reason

PAGES = [
    pytest.param("accuracy", "found", marks=pytest.mark.slow),
    pytest.param(
        "fmu",
        "chain",
        marks=[
            pytest.mark.slow,
            pytest.mark.skipif(bool(native_unavailable_reason()), reason=str(native_unavailable_reason())),
        ],
    ),
    ("dynamics", "again"),
    ("python", "pose"),
    ("robots", "longer"),
    ("units", "joint"),
]
"""Pages, each with a name that its blocks give."""


@pytest.mark.parametrize(("page", "made"), PAGES)
def test_the_python_of_a_page_runs(
    page: str, made: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for unit in (DOCS / "examples").glob("*.py"):
        shutil.copy(unit, tmp_path)
    names: dict[str, Any] = {}
    for code in snippets(f"docs/{page}.md", "python"):
        exec(compile(code, f"docs/{page}.md", "exec"), names)
    assert made in names
