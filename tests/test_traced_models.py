"""Each model is traced by some test: what the sources of both say, read and not run."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_each_model_is_traced() -> None:
    """What is called in a test of traces, or by what is called there, is."""
    tests = [file.read_text(encoding="utf-8") for file in (ROOT / "tests" / "models").rglob("*.py")]
    called = {name for text in tests if "import casadi" in text for name in names_in(ast.parse(text))}
    models: dict[str, list[ast.FunctionDef]] = {}
    for file in (ROOT / "models").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                models.setdefault(node.name, []).append(node)
    for _ in range(5):  # calls are no deeper
        called |= {name for one in called for node in models.get(one, ()) for name in names_in(node)}
    elementwise = {name for name, nodes in models.items() if any(map(takes_elements, nodes))}
    assert elementwise - called == {"matrix_to_rpy"}  # writes numbers into files


def names_in(tree: ast.AST) -> set[str]:
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} | {
        node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)
    }


def takes_elements(node: ast.FunctionDef) -> bool:
    """Tell whether a public function takes elements, which a symbol may be."""
    given = [argument.annotation for argument in (*node.args.args, *node.args.kwonlyargs)]
    texts = [ast.unparse(annotation) for annotation in given if annotation]
    return not node.name.startswith("_") and any("Element" in text or "Vector" in text for text in texts)
