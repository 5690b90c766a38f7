"""The README's promises: its commands are those that run, its robot is one, its Python works."""

import re
import tomllib
from pathlib import Path

import pytest

from urmpipe_models.robots.robot_file import read_robot_file

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = [line.strip() for line in README.splitlines() if line.startswith("    python")]


def test_ci_runs_the_test_command_word_for_word() -> None:
    tests = 'python3 -m venv .venv && .venv/bin/pip install -e ".[test]" && .venv/bin/pytest'
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


@pytest.mark.parametrize("name", re.findall(r"\]\((docs/pictures/[^)]+)\)", README))
def test_pictures_are_there(name: str) -> None:
    assert (ROOT / name).read_bytes().startswith(b"\x89PNG")


def test_the_robot_of_the_readme_is_one(tmp_path: Path) -> None:
    start = README.index("    name = ")
    lines = README[start : README.index("**In Python**")].splitlines()
    text = "\n".join(line[4:] for line in lines)
    tomllib.loads(text)
    path = tmp_path / "my-arm.toml"
    path.write_text(text, encoding="utf-8")
    assert len(read_robot_file(path).coordinates) == 3


def test_the_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from urmpipe_datasets import LOGS

    start = README.index("    import urmpipe")
    code = "\n".join(line[4:] for line in README[start : README.index("**Exit codes.**")].splitlines())
    (tmp_path / "log.csv").write_bytes((LOGS / "matlab.csv").read_bytes())
    (tmp_path / "path.csv").write_bytes((LOGS / "path.csv").read_bytes())
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert getattr(names["result"], "verdict", None) == "pass"
    assert (tmp_path / "report.html").stat().st_size > 1e6
