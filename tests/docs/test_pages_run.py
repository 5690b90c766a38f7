"""Every command that README or a page of docs/ shows runs, with files called as the page calls them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pages import ROOT, command_lines, files_told, lay_files, pages, run_in_process, text_of

ELSEWHERE = {
    "urmpipe view ": "needs a display: tests/cli/test_view.py",
    "--block ": "needs a simulation, which is slow: tests/cli/test_compare_simulation.py",
    "--limit ": "looks for the running speed, which is slow: tests/cli/test_accuracy.py",
    "--platforms": "takes minutes for its first build: tests/fmus/native/test_compile.py",
}
"""What is run by tests of its own: a part of the line, and why."""

HEAVY = ("urmpipe fmu build", "urmpipe simulate", "urmpipe accuracy")
"""What compiles, and so is slow."""

WRITTEN_BY_A_SCRIPT = ("docs/commands.md", "docs/tutorial.md")
"""Held by test_commands_page.py (examples of --help, with files of all kinds) and test_tutorial.py."""


NAMED = [page for page in pages() if page not in WRITTEN_BY_A_SCRIPT]


def shown(page: str, *, heavy: bool) -> list[str]:
    """Return the commands of a page that are run here, the slow or the quick ones.

    A slow one runs for the first page that shows it: each page has the same files.
    """
    before = {line for one in NAMED[: NAMED.index(page)] for line in command_lines(one)} if heavy else set()
    return [
        line
        for line in command_lines(page)
        if line.startswith(HEAVY) == heavy
        and line not in before
        and not any(part in line for part in ELSEWHERE)
    ]


def cases() -> list[object]:
    """Return each page with its quick and with its slow commands."""
    return [
        pytest.param(page, heavy, id=f"{page}{', slow' * heavy}")
        for page in NAMED
        for heavy in (False, True)
        if shown(page, heavy=heavy)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("page", "heavy"), cases())
def test_the_commands_of_a_page_run(
    page: str, heavy: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lay_files(tmp_path, monkeypatch)
    lines = shown(page, heavy=heavy)
    if any(line.startswith("urmpipe fmu check") for line in lines):
        lines = ["urmpipe fmu build kinematic_chain --robot urm6 --backend python", *lines]
    assert {line: run_in_process(line) for line in lines} == dict.fromkeys(lines, 0)
    told = {name for line in lines for name in files_told(page, line)}
    assert {
        name for name in told | (viewed(page) if not heavy else set()) if not Path(name).exists()
    } == set()


def viewed(page: str) -> set[str]:
    """Return the recordings that a page opens in the viewer."""
    lines = [line for line in command_lines(page) if line.startswith("urmpipe view ")]
    return {word for line in lines for word in line.split()[2:]}


def test_every_link_of_a_page_leads_somewhere() -> None:
    for page in pages():
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text_of(page)):
            assert "://" in link or (ROOT / page).parent.joinpath(link).exists(), f"{page}: {link}"


def test_every_page_is_linked_from_the_readme_or_a_page_that_is() -> None:
    reached, new = set[str](), {"README.md"}
    while new:
        reached |= new
        found = {
            (ROOT / page).parent.joinpath(link).resolve().relative_to(ROOT).as_posix()
            for page in new
            for link in re.findall(r"\]\(([^)#:\s]+\.md)", text_of(page))
        }
        new = {one for one in found if one in pages()} - reached
    assert set(pages()) - reached == set()


def test_readme_shows_every_command() -> None:
    from urmpipe.main import find_commands

    assert {line.split()[1] for line in command_lines("README.md")} >= set(find_commands()) - {"demo"}
