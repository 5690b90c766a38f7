"""docs/dependencies.md against pyproject.toml: each dependency and each extra has one row; its code runs."""

from __future__ import annotations

import re
import tomllib

import pytest

from pages import ROOT, snippets, text_of

PAGE = "docs/dependencies.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]


def rows(heading: str) -> list[list[str]]:
    """Return the cells of the table below a heading, without its head."""
    lines = text_of(PAGE).split(f"\n## {heading}\n")[1].split("\n## ")[0].splitlines()
    table = [line.strip("|").split("|") for line in lines if line.startswith("|")]
    return [[cell.strip() for cell in row] for row in table[2:]]


def names(requirements: list[str]) -> list[str]:
    """Return the packages of requirements, without versions and markers."""
    return sorted(re.split(r"[^\w-]", one)[0] for one in requirements)


def test_each_core_dependency_has_one_row() -> None:
    assert sorted(row[0] for row in rows("Core")) == names(PROJECT["dependencies"])


def test_each_extra_has_one_row() -> None:
    assert sorted(row[0].strip("`") for row in rows("Extras")) == sorted(EXTRAS)


@pytest.mark.parametrize("extra", sorted(set(EXTRAS) - {"test"}))  # its packages stand in pyproject.toml
def test_the_row_of_an_extra_names_its_packages(extra: str) -> None:
    (row,) = (row for row in rows("Extras") if row[0] == f"`{extra}`")
    assert row[1].split(", ") == names(EXTRAS[extra])


def test_each_row_says_what_for_and_why() -> None:
    assert all(all(row) for row in rows("Core"))
    users = [row for row in rows("Extras") if row[0].strip("`") not in ("test", "fuzz", "bench")]
    assert all(all(row) for row in users)


@pytest.mark.slow
def test_the_code_of_the_page_lists_this_environment(capsys: pytest.CaptureFixture[str]) -> None:
    exec(snippets(PAGE, "python")[0], {})
    assert re.search(r"^ *[\d.]+ MB  numpy \d", capsys.readouterr().out, re.MULTILINE)
