"""The repr of results: one line at a prompt, headline, notes and table in a notebook."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd
import pytest

from urmpipe_models.display import HEAD_ROWS, MAX_LINE_LENGTH, Displayable, format_count, format_headline
from urmpipe_models.errors import Finding


@dataclass(repr=False)
class Shelf(Displayable):
    """A result of some rows."""

    headline: str
    rows: int = 0
    warnings: tuple[Finding, ...] = ()

    def _headline(self) -> str:
        return self.headline

    def to_frame(self) -> pd.DataFrame:
        return pd.DataFrame({"book": range(1000, 1000 + self.rows)})


def warned(*messages: str) -> tuple[Finding, ...]:
    return tuple(Finding(message) for message in messages)


def test_the_line_has_the_headline_and_the_number_of_warnings() -> None:
    assert repr(Shelf("three\nbooks")) == "<Shelf three\\nbooks>"
    assert repr(Shelf("books", warnings=warned("one"))) == "<Shelf books, 1 warning>"
    assert repr(Shelf("books", warnings=warned("one", "two"))) == "<Shelf books, 2 warnings>"


@pytest.mark.parametrize(("warnings", "ending"), [((), ">"), (warned("one"), ", 1 warning>")])
def test_what_does_not_fit_into_the_line_is_cut(warnings: tuple[Finding, ...], ending: str) -> None:
    room = MAX_LINE_LENGTH - len("<Shelf ") - len(ending)
    assert repr(Shelf("x" * room, warnings=warnings)) == f"<Shelf {'x' * room}{ending}"
    assert repr(Shelf("x" * (room + 1), warnings=warnings)) == f"<Shelf {'x' * (room - 3)}...{ending}"


def test_a_notebook_shows_headline_notes_and_the_head_of_the_table() -> None:
    html = Shelf("a<b\n", 2, warned("c<d\n", "e"))._repr_html_()
    shown, table = html.split("<table", 1)
    assert shown == "<p><b>Shelf</b> a&lt;b\\n</p><ul><li>c&lt;d\\n</li><li>e</li></ul>"
    assert table.endswith("</table>")
    assert Shelf("books", 2)._repr_html_().startswith("<p><b>Shelf</b> books</p><table")


def test_a_result_with_a_presentation_shows_its_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Displayable, "page", staticmethod(lambda result: f"<p>{result.headline}</p>"))
    assert Shelf("books")._repr_html_() == "<p>books</p>"


def test_a_table_is_cut_after_its_head_and_says_so() -> None:
    whole, cut = Shelf("books", HEAD_ROWS)._repr_html_(), Shelf("books", HEAD_ROWS + 1)._repr_html_()
    assert whole.endswith("</table>")
    assert cut == whole + f"<p>{HEAD_ROWS} of {HEAD_ROWS + 1} rows of to_frame()</p>"
    cells = "".join(f"<tr><td>{1000 + row}</td></tr>" for row in range(HEAD_ROWS))
    assert f"<tbody>{cells}</tbody>" in "".join(whole.split())


def test_numbers_and_facts_are_listed() -> None:
    assert [format_count(count, "row") for count in (0, 1, 2)] == ["0 rows", "1 row", "2 rows"]
    assert format_headline("log", "urm6", "", None, format_count(2, "row")) == "log: urm6, 2 rows"
