"""Which of urmpipe's modules a unit needs where it runs, under names that nothing else has."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from urmpipe_models.errors import UnitError

OURS = ("urmpipe_datasets", "urmpipe_fmus", "urmpipe_models")
DATA = {"urmpipe_datasets": "robots"}
"""Folders with data that a package reads."""

_NAME = re.compile(rf"\b({'|'.join(OURS)})\b")


def renamed(text: str, mark: str) -> str:
    """Return a text of Python in which urmpipe's packages have a mark at the end of their names."""
    return _NAME.sub(rf"\1_{mark}", text)


def sources_of(modules: Iterable[str]) -> dict[str, bytes]:
    """Return the files of some of urmpipe's modules and of all that they import, by their path.

    Args:
        modules: Import names.
    """
    waiting, files = set(modules), {}
    seen: set[str] = set()
    while waiting:
        name = waiting.pop()
        seen.add(name)
        spec = find_spec(name)
        if spec is None or not spec.origin:
            continue
        path = Path(spec.origin)
        inside = path.name == "__init__.py"
        files["/".join(name.split(".")) + ("/__init__.py" if inside else ".py")] = path.read_bytes()
        if inside and name in DATA:
            files |= _data(name, path.parent, DATA[name])
        waiting |= set(_imported(path.read_text(encoding="utf-8"))) - seen
        waiting |= {name.rpartition(".")[0]} - seen - {""}
    return files


def imports_of(source: str) -> set[str]:
    """Return the names of urmpipe's modules that a text of Python imports."""
    return set(_imported(source))


def check_imports(unit: str, file: str, source: str) -> None:
    """Refuse a user's file that imports what an FMU does not bring.

    Raises:
        UnitError: If it imports anything but the standard library, NumPy and urmpipe's models and units.
    """
    allowed = {*sys.stdlib_module_names, *OURS, "numpy"}
    found = sorted({name for name in _names(source) if name.split(".")[0] not in allowed})
    if found:
        raise UnitError(
            f"unit {unit}: found imports of {', '.join(found)} in {file}, allowed in a Python FMU: the"
            f" standard library, numpy, {', '.join(OURS)}"
        )


def _imported(source: str) -> Iterator[str]:
    """Yield the names of urmpipe's modules that a text may import."""
    for name in _names(source):
        if name.split(".")[0] in OURS and _is_module(name):
            yield name


@cache
def _names(source: str) -> tuple[str, ...]:
    """Return what a text imports: modules, and for `from a import b` both a and a.b."""
    found: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found += (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
    return tuple(found)


def _is_module(name: str) -> bool:
    """Tell whether a name is a module's, not that of something in one."""
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def _data(name: str, folder: Path, inner: str) -> dict[str, bytes]:
    """Return the data files of a package."""
    files = sorted(path for path in (folder / inner).rglob("*") if path.is_file() and path.suffix != ".pyc")
    return {f"{name}/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in files}
