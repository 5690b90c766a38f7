"""The README's promises: its commands are those that run, its Python works."""

from pathlib import Path

import pytest

from pages import ROOT, indented, lay_files, text_of

README = text_of("README.md")
COMMANDS = [line.strip() for line in README.splitlines() if line.startswith("    python")]


def test_ci_runs_the_test_command_word_for_word() -> None:
    tests = 'python3 -m venv .venv && .venv/bin/pip install -e ".[test]" && .venv/bin/pytest'
    tests += ' -m "not slow" -n 2 --dist worksteal'
    assert tests in COMMANDS
    assert tests in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert tests in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_each_command_stands_in_both_shells() -> None:
    unix = [command for command in COMMANDS if "&&" in command]
    windows = [command for command in COMMANDS if "Scripts" in command]
    as_windows = [
        command.replace(" && ", "; ").replace(".venv/bin/", ".venv\\Scripts\\").replace("python3", "python")
        for command in unix
    ]
    assert len(unix) == 2
    assert windows == as_windows


@pytest.mark.slow
def test_the_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lay_files(tmp_path, monkeypatch)
    names: dict[str, object] = {}
    exec(compile(indented("README.md", "import urmpipe"), "README.md", "exec"), names)
    assert getattr(names["result"], "verdict", None) == "pass"
    assert (tmp_path / "report.html").stat().st_size > 1e6
