"""docs/logs.md against the code: one table has every kind of warning and of error."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from fnmatch import fnmatch
from importlib import import_module
from pathlib import Path

import pytest

from urmpipe.defaults import defaults_for
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.logs import read_map
from urmpipe_pipeline.runs.ingest import ingest_log

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "logs.md").read_text(encoding="utf-8")


def table() -> dict[str, tuple[str, str, str]]:
    """Return what each kind means, error or warning, and what to do."""
    lines = PAGE.split("\n## What is checked\n")[1].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    assert rows[0] == ["kind", "what it means", "", "what to do"]
    found: dict[str, tuple[str, str, str]] = {}
    for names, meaning, severity, remedy in rows[2:]:
        for name in names.split(", "):
            assert name.strip("`") not in found
            found[name.strip("`")] = meaning, severity, remedy
            assert (severity == "warning") == name.startswith("`")
    return found


ROWS = table()
WARNINGS = {kind for kind, (_, severity, _) in ROWS.items() if severity == "warning"}
ERRORS = {kind for kind, (_, severity, _) in ROWS.items() if severity == "error"}


def test_each_row_is_an_error_or_a_warning_and_says_what_to_do() -> None:
    assert ROWS.keys() == WARNINGS | ERRORS
    assert all(meaning and remedy for meaning, _, remedy in ROWS.values())


def kinds(path: Path) -> Iterator[str]:
    """Yield the kinds of the warnings that a module makes; an f-string's unknown parts are stars."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    constants = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for line in tree.body:
        if isinstance(line, ast.ImportFrom) and (line.module or "").startswith("urmpipe"):
            module = import_module(line.module or "")
            taken = {one.asname or one.name: getattr(module, one.name, None) for one in line.names}
            constants |= {
                name: ast.Constant(value) for name, value in taken.items() if isinstance(value, str)
            }
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "LogWarning":
            named = [keyword.value for keyword in node.keywords if keyword.arg == "kind"]
            for kind in (*node.args[:1], *named):
                yield from texts(kind, constants)


def texts(kind: ast.expr, constants: Mapping[str, ast.expr]) -> Iterator[str]:
    """Yield the texts that an expression may be."""
    match kind:
        case ast.Constant(value=str(text)):
            yield text
        case ast.IfExp(body=body, orelse=orelse):
            yield from (*texts(body, constants), *texts(orelse, constants))
        case ast.Name(id=name) if name in constants:
            yield from texts(constants[name], {})
        case ast.JoinedStr(values=parts):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "*" for part in parts)
        case _:
            raise AssertionError(f"line {kind.lineno}: the kind of a warning stands where it is made")


MAKERS = [path for area in ("pipeline", "cli", "fmus") for path in sorted((ROOT / area).rglob("*.py"))]


@pytest.fixture(scope="module")
def made() -> set[str]:
    """Every kind of warning that the code makes."""
    makers = [path for path in MAKERS if "LogWarning" in path.read_text(encoding="utf-8")]
    return {kind for path in makers for kind in kinds(path)}


@pytest.mark.slow
def test_each_kind_of_warning_has_its_row(made: set[str]) -> None:
    assert [kind for kind in sorted(made) if not any(fnmatch(row, kind) for row in WARNINGS)] == []


@pytest.mark.slow
def test_each_row_of_a_warning_has_its_code(made: set[str]) -> None:
    assert [row for row in sorted(WARNINGS) if not any(fnmatch(row, kind) for kind in made)] == []


def test_the_map_and_the_defaults_of_the_page_are_sound(tmp_path: Path) -> None:
    lab, defaults = (block.split("```")[0] for block in PAGE.split("```toml\n")[1:])
    (tmp_path / "lab.toml").write_text(lab, encoding="utf-8")
    said = read_map(tmp_path / "lab.toml")
    assert (said.robot, said.names, said.rotation) == ("ur5e", ("shoulder",), "zyx")
    (tmp_path / "urmpipe.toml").write_text(defaults, encoding="utf-8")
    names = ("ingest", "compare")
    commands = {name: getattr(import_module(f"urmpipe.commands.{name}"), name) for name in names}
    ingest, compare = (defaults_for(commands[name], tmp_path / "urmpipe.toml", commands) for name in names)
    assert ingest == {"robot": "ur5e", "map": str(tmp_path / "maps/lab.toml")}
    assert compare == {"robot": "ur5e", "tolerance": ["0.002"]}


SPECIMENS = {
    "no log": "",
    "no rows": "t,q1,q2\n",
    "ragged header": "t,q1\n0,1,2\n0.1,2,3\n",
    "ragged row": "t,q1,q2\n0,1,2\n0.1,1\n0.2,1,2\n",
    "merge conflict": "t,q1,q2\n0,1,2\n<<<<<<< HEAD\n0.1,1,2\n=======\n0.1,2,3\n>>>>>>> other\n",
    "stray text": "t,q1,q2\n0,1,2\n0.1,1,2\n0.2,x,2\n0.3,1,2\n",
    "time out of order": "t,q1,q2\n0,1,2\n0.1,1,2\n0.05,1,2\n0.2,1,2\n",
    "infinite value": "t,q1,q2\n0,1,2\n0.1,inf,2\n0.2,1,2\n",
    "empty column": "t,q1,q2\n0,1,\n0.1,1,\n",
    "same name twice": "t,q1,q1\n0,1,2\n0.1,1,2\n",
    "no joints": "t,a,b\n0,1,2\n0.1,1,2\n",
    "unknown unit": "t,q1 [furlong],q2 [furlong]\n0,1,2\n0.1,1,2\n",
    "unclear unit": "t,q1,q2\n0,1,200\n0.1,1,201\n",
    "second log": "t,q1,q2\n0,1,2\n0.1,1,2\nt,q1,q2\n0,1,2\n",
    "unclear clock": "Time,q1,q2\n10:11:32:100,1,2\n10:11:32:200,1,2\n10:11:33:100,1,2\n",
}


def test_each_error_of_the_table_has_a_specimen() -> None:
    assert SPECIMENS.keys() == ERRORS


@pytest.mark.parametrize("kind", SPECIMENS)
def test_an_error_stops(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(SPECIMENS[kind], encoding="utf-8")
    with pytest.raises(UrmpipeError) as error:
        ingest_log([path])
    assert all("found" in finding.sentence() for finding in error.value.findings)


def test_a_log_of_another_number_of_joints_stops(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2\n0,1,2\n0.1,1,2\n", encoding="utf-8")
    with pytest.raises(UrmpipeError, match="found 2 joint columns"):
        ingest_log([path], robot=load_robot("ur5e"))
