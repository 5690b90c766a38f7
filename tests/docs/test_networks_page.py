"""docs/networks.md against the code: its keys are those that are read, its examples move, its code runs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, get_args

import pytest

import urmpipe
from asserting import there
from pages import lay_files, snippets, text_of
from urmpipe.main import run
from urmpipe_models.errors import NetworkError
from urmpipe_models.networks.assembly import CLOSED_TOLERANCE, DEFAULT_RESTARTS, MAX_ASSEMBLIES, SAME_ASSEMBLY
from urmpipe_models.networks.mobility import RANK_TOLERANCE
from urmpipe_models.networks.parts import ALLOWED_ARITHMETIC, JOINT_UNITS, MAX_LETTERS, ElementKind
from urmpipe_pipeline.networks.finding import ROUNDED

PAGE = text_of("docs/networks.md")

KINDS = {
    "joints": ("revolute", "prismatic", "cylindrical", "helical", "global"),
    "elements": get_args(ElementKind),
    "dh.elements": ("R", "P", "C", "H"),
}
"""The kinds that have the keys of a table; a user joint lacks some."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that pages name."""
    lay_files(tmp_path, monkeypatch)
    return tmp_path


def keys_of(head: str) -> set[str]:
    """Return the first column of the table with a head."""
    rows = PAGE.partition(f"| {head} | default |")[2].partition("\n\n")[0].splitlines()[2:]
    return {match[1] for row in rows if (match := re.match(r"\| `(\w+)` \|", row))}


def known(folder: Path, table: str) -> set[str]:
    """Return the keys that the message about a wrong one in a table calls known."""
    (folder / "wrong.toml").write_text(f"{table}\nunheard = 1\n", encoding="utf-8")
    with pytest.raises(NetworkError) as caught:
        urmpipe.load_network("wrong.toml")
    said = [one.sentence() for one in caught.value.findings if one.about and one.about.endswith("unheard")]
    return {key for one in said for key in one.partition("allowed: ")[2].split(", ")}


@pytest.mark.parametrize(
    ("table", "head"),
    [
        ("", "key"),
        ("[bodies.A]", "key of `bodies`"),
        ("[dh]", "key of `dh`"),
        ("[chains.A]\nrobot = 'ur5e'", "key of `chains`"),
    ],
)
def test_the_keys_of_a_table_are_those_that_are_read(folder: Path, table: str, head: str) -> None:
    assert known(folder, table) == keys_of(head)


def test_a_control_has_limits_or_a_value(folder: Path) -> None:
    keys = known(folder, "[controls.A]") | known(folder, "[controls.A]\nvalue = 1")
    assert keys == keys_of("key of `controls`")


@pytest.mark.parametrize("table", KINDS)
def test_the_keys_of_all_kinds_are_those_that_are_read(folder: Path, table: str) -> None:
    found = {kind: known(folder, f"[{table}.A]\nkind = '{kind}'") for kind in KINDS[table]}
    assert set().union(*found.values()) == keys_of(f"key of `{table}`")


def test_every_kind_is_on_the_page() -> None:
    rows = re.findall(r"^\| `([a-z]+)`[^|]* \| [^|]", PAGE, re.MULTILINE)
    assert set(rows) >= {*JOINT_UNITS, *get_args(ElementKind)}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "count"), [("boom", 2), ("five-bar", 2), ("door", 8), ("timing", 1)])
def test_an_example_moves_by_its_control(name: str, count: int) -> None:
    found = urmpipe.network_solve(f"{name}.toml", every=True)
    assert (len(found.assemblies), there(found.mobility).mobility) == (count, 1)
    assert found.warnings == ()


def test_the_angles_of_the_boom_are_those_of_the_page() -> None:
    found = urmpipe.network_solve("boom.toml", every=True)
    angles = [57.29577951308232 * one.values["pivot"][0] for one in found.assemblies]
    assert [f"{angle:.1f}°" in PAGE for angle in angles] == [True, True]


def test_the_answer_of_the_page_is_what_its_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["network", "check", "four-bar"]) == 0
    shown = PAGE.split("```text\n")[1].split("```")[0]
    assert capsys.readouterr().out.startswith(shown)


def test_the_code_of_the_page_runs() -> None:
    names: dict[str, Any] = {}
    exec(snippets("docs/networks.md", "python")[0], names)
    found, mobility = names["found"], names["found"].mobility
    assert (found.verdict, mobility.mobility, mobility.kutzbach) == ("pass", 1, 1)
    assert len(names["frame"]) == 2


def test_numbers_of_the_page_are_those_of_the_code() -> None:
    assert f"`--restarts` ({DEFAULT_RESTARTS}) in a row" in PAGE
    assert f"Singular values below {RANK_TOLERANCE:g}".replace("e-0", "e-") in PAGE
    assert f"A gap of {CLOSED_TOLERANCE:g}".replace("e-0", "e-") in PAGE
    assert f"within {SAME_ASSEMBLY:g}".replace("e-0", "e-") in PAGE
    assert f"At most {MAX_ASSEMBLIES} are listed" in PAGE
    assert f"{MAX_LETTERS} letters at most" in " ".join(PAGE.split())
    assert ROUNDED == 1e-4
    functions = re.findall(r"[a-z]\w+", ALLOWED_ARITHMETIC.partition("brackets")[2])
    assert all(re.search(rf"\b{name}\b", PAGE) for name in functions)
