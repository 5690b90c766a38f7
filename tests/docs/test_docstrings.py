"""Public docstrings give unit and shape of the arrays that functions take and return, and classes hold."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = [path for area in ("models", "fmus", "pipeline", "cli") for path in (ROOT / area).rglob("[!_]*.py")]

ARRAY = re.compile(r"\b(?:(?:Float|Index|Int|Bool)Array|ArrayLike|NDArray|ndarray)\b")
WITHOUT_UNIT = re.compile(r"(?:Index|Int|Bool)Array|np\.(?:u?int|bool_|str_|object_)")
SYMBOL = r"(?:[numkM]?(?:m|s|g|A|V|W|N|J|H|Hz|B)|Nm|kg|Ohm|rad|deg|px|turns?|-|%)"
UNIT = re.compile(
    rf"\[(?:\d+ )?{SYMBOL}\d?(?:[ */^]*{SYMBOL}\d?)*\]"  # [m/s2], [kg m2], [-]
    r"|\b(?:units?|rad|dimensionless|SI|radians?|degrees?|seconds|pixels|nanoseconds)\b"
)
LENGTH = r"(?:\.{3}|\w+(?: [+*-] \w+)?|\d \w+)"
SHAPE = re.compile(
    rf"\bshape[sd]?\b|(?<!\w)\({LENGTH},(?: {LENGTH},?)*\)"  # (n,), (..., 3)
    r"|\b[Oo]ne (?:array|element|column|row|value|entry) (?:an?|per|for each|each)\b"
)
Definition = ast.FunctionDef | ast.ClassDef


def public(node: ast.Module | ast.ClassDef) -> Iterator[Definition]:
    """Yield public classes, functions and methods; the function speaks for its overloads."""
    for child in node.body:
        if isinstance(child, Definition) and not child.name.startswith("_"):
            if not any(re.search(r"overload|\.setter", ast.unparse(one)) for one in child.decorator_list):
                yield child
            if isinstance(child, ast.ClassDef):
                yield from public(child)


def arrays(node: Definition) -> Iterator[tuple[str, str]]:
    """Yield name and type of each array among the fields, or among what is taken and returned."""
    if isinstance(node, ast.ClassDef):
        held = [one for one in node.body if isinstance(one, ast.AnnAssign)]
        pairs = [(ast.unparse(one.target), one.annotation) for one in held]
    else:
        taken = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
        pairs = [(one.arg, one.annotation) for one in taken if one.annotation]
        pairs += [("Returns", node.returns)] if node.returns else []
    for name, annotation in pairs:
        kind = ast.unparse(annotation)
        if ARRAY.search(kind) and "Callable" not in kind and not name.startswith("_"):
            yield name, kind


def stated(node: Definition) -> dict[str, str]:
    """Return what a docstring says of each name; its prose, which may speak of all, under no name."""
    text = ast.get_docstring(node) or ""
    said = {"": re.split(r"(?m)^(?:Args|Attributes|Returns|Yields):", text, maxsplit=1)[0]}
    said["Returns"] = text.partition("Returns:")[2] + text.partition("Yields:")[2]
    before = ""
    for names, entry in re.findall(r"(?m)^    \*{0,2}(\w+(?:, \w+)*): (.+(?:\n {5,}.+)*)", text):
        before = f"{entry} {before}" if "ikewise" in entry else entry
        said |= dict.fromkeys(names.split(", "), before)
    for field, below in zip(node.body, node.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
            said[ast.unparse(field.target)] = ast.unparse(below)
    return said


@pytest.mark.slow
def test_public_docstrings_give_unit_and_shape_of_each_array() -> None:
    missing, seen = [], 0
    texts = [(path, path.read_text(encoding="utf-8")) for path in FILES]
    for path, module in ((path, text) for path, text in texts if ARRAY.search(text)):
        for node in public(ast.parse(module)):
            for name, kind in arrays(node):
                said = stated(node)
                seen += 1
                text = f"{said.get(name, '')} {said['']}"
                unit = WITHOUT_UNIT.search(kind) or UNIT.search(text)
                if not (unit and SHAPE.search(text)):
                    missing.append(f"{path.name}:{node.lineno} {node.name}: {name}")
    assert not missing, "no unit or no shape:\n" + "\n".join(missing)
    assert seen > 300  # the patterns above still find arrays
