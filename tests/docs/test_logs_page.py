"""docs/logs.md against the code: one table has every kind of warning and of error."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from fnmatch import fnmatch
from importlib import import_module
from pathlib import Path

import pytest

from pages import snippets
from urmpipe.main import run
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.runs.ingest import ingest_log

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "logs.md").read_text(encoding="utf-8")


def table(severity: str) -> dict[str, tuple[str, str]]:
    """Return what each kind of error or warning means, and what to do."""
    block = PAGE.split(f"| {severity} | meaning | what to do |\n")[1].split("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines()[1:]]
    kinds = [(name.strip("`"), row[1:]) for row in rows for name in row[0].split(", ")]
    assert len(dict(kinds)) == len(kinds)
    return {kind: (meaning, remedy) for kind, (meaning, remedy) in kinds}


ERRORS, WARNINGS = table("error"), table("warning")


def test_each_row_says_what_it_means_and_what_to_do() -> None:
    assert all(meaning and remedy for meaning, remedy in (ERRORS | WARNINGS).values())


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


def test_the_map_and_the_question_of_the_page_are_what_explain_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    languages = {"cell.csv": "toml", "arms.csv": "text"}
    for (name, language), log in zip(languages.items(), snippets("docs/logs.md", "csv"), strict=True):
        Path(name).write_text(log, encoding="utf-8")
        assert run(["ingest", name, "--explain"]) == (2 if language == "text" else 0)
        (block,) = snippets("docs/logs.md", language)
        assert capsys.readouterr().out.strip().endswith(block)


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
    assert SPECIMENS.keys() == ERRORS.keys()


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
