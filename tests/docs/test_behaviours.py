"""The table of behaviours in CONTRIBUTING names modules and symbols that there are."""

from __future__ import annotations

import re
from functools import reduce
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

PAGE = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| ([^|]+) \| `(urmpipe[\w.]*)` \| `([\w.]+)` \|$", PAGE, re.MULTILINE)


def test_the_behaviours_are_listed() -> None:
    assert len(ROWS) >= 14


@pytest.mark.parametrize(("module", "symbol"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_each_is_where_it_is_said_to_be(module: str, symbol: str) -> None:
    found = reduce(getattr, symbol.split("."), import_module(module))
    assert not callable(found) or found.__module__ == module  # defined there, not imported


@pytest.mark.parametrize("name", ["urmpipe_pipeline.logs", "urmpipe_pipeline.logs.formats"])
def test_a_package_of_the_reader_names_its_chapters(name: str) -> None:
    package = import_module(name)
    words = set(re.findall(r"\w+", package.__doc__ or ""))
    assert {chapter.name for chapter in iter_modules(package.__path__)} - words == set()
