"""What benchmarks/house.py measures holds its bounds, and it measures what it says."""

from __future__ import annotations

from pathlib import Path

import pytest
from survey.contributing import BEGIN, END, show, shown
from survey.house import House, survey
from survey.mutation_score import mutation_score
from survey.tables import full, summary

from measured_tree import function, measured

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def house() -> House:
    return survey(ROOT)


BOUNDS = [
    "files over 400 lines without a reason",
    "functions over 60 lines without a reason",
    "medians over their bounds",
    "public definitions without a docstring",
    "arrays of which the docstring tells no unit or no shape",
    "functions without all annotations",
    "imports the wrong way",
    "rings of modules",
    "rings of folders",
    "duplicates of 6 lines and more without a reason",
    "reasons for nothing",
]


@pytest.mark.parametrize("bound", BOUNDS)
def test_the_house_holds_its_bounds(house: House, bound: str) -> None:
    places = house.faults()[bound]
    assert not places, f"{len(places)} {bound}:\n" + "\n".join(places)


def test_every_bound_is_tested(house: House) -> None:
    assert list(house.faults()) == BOUNDS


def test_contributing_shows_the_table_of_this_tree(house: House) -> None:
    page = ROOT / "CONTRIBUTING.md"
    score = mutation_score(ROOT / "benchmarks" / "results" / "mutation.md")
    assert shown(page) == [*summary(house), "", score], "renew it: python benchmarks/house.py --write"


def test_the_mutation_score_is_the_one_that_was_measured_last(tmp_path: Path) -> None:
    results = tmp_path / "mutation.md"
    results.write_text(
        "# Mutation score\n\nMeasured 2026-01-02 on 2 cores.\n\n"
        "## Models and so on: 94.9 % (94 to 96 %), raw\n\n## Inverse: 89.4 % (84 to 95 %)\n",
        encoding="utf-8",
    )
    assert mutation_score(results) == (
        "Mutation score, by `benchmarks/mutation.py` on 2026-01-02, with the 95 % interval: models and so on"
        " 94.9 % (94 to 96 %); inverse 89.4 % (84 to 95 %)."
    )
    results.write_text("# Mutation score\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"^mutation.md has no score: run"):
        mutation_score(results)


def test_the_same_tree_gives_the_same_page(tmp_path: Path) -> None:
    def page() -> list[str]:
        return full(measured(tmp_path, models__a=function(61), tests__a=function(9)))

    assert page() == page()


def test_the_table_is_put_between_its_markers_and_nothing_else_changes(tmp_path: Path) -> None:
    page = tmp_path / "PAGE.md"
    page.write_text(f"# Page\n\n{BEGIN}\nold\n{END}\n\nlast\n", encoding="utf-8")
    show(page, ["| a |", "|---|"])
    assert page.read_text(encoding="utf-8") == f"# Page\n\n{BEGIN}\n| a |\n|---|\n{END}\n\nlast\n"
    assert shown(page) == ["| a |", "|---|"]


def test_a_page_without_markers_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "PAGE.md"
    page.write_text("# Page\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"^PAGE.md lacks the lines"):
        show(page, [])
