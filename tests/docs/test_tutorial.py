"""docs/tutorial.md against the commands: they end as it says, and print what it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from pages import DOCS, script, text_of


@pytest.mark.slow
def test_the_tutorial_shows_what_its_commands_print(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    writer = script(DOCS / "write_tutorial.py")
    text = text_of("docs/tutorial.md")
    codes, outputs = zip(*writer.steps(text, tmp_path), strict=True)
    assert codes == (0, 1, 1, 0, 0)
    assert text == writer.page(text, list(outputs)), "run: python docs/write_tutorial.py"
    assert (tmp_path / "report.html").is_file()
