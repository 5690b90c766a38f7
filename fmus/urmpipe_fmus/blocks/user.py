"""A user's own unit: one Python file with a `BlockModel` in it.

An FMU carries the text of this file and no other, so the file holds all that the unit needs; what it imports
is installed. Its functions keep nothing between two calls: what is remembered is a `State` or a `Memory`.
"""

from __future__ import annotations

import ast
import hashlib
import sys
import traceback
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO, TextIOWrapper
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from urmpipe_fmus.block import BlockModel, Recipe
from urmpipe_fmus.dependencies import Dependencies
from urmpipe_fmus.run import Equations
from urmpipe_models.errors import Finding, UnitError, UrmpipeError
from urmpipe_models.files import read_contents


def load_block_file(path: str | Path) -> BlockModel:
    """Return the unit of a user's file, found fit to become an FMU.

    Args:
        path: The file.

    Raises:
        UnitError: If it cannot be read or run, imports a file beside it, holds no unit or several, or if the
            unit's functions do what C could not or keep something between two calls.
    """
    path = Path(path)
    source = _read(path)
    neighbours = list(_neighbours(path, source))
    if neighbours:
        raise UnitError(*neighbours)
    model = block_from_source(source, str(path))
    try:
        Dependencies(model)
        _check_keeps_nothing(model)
    except UnitError as error:
        raise UnitError(*(replace(one, file=one.file or str(path)) for one in error.findings)) from error
    return replace(model, recipe=Recipe(module=path.name, source=source))


def block_from_source(source: str, file: str) -> BlockModel:
    """Return the one unit that a text of Python makes.

    Args:
        source: The text. It is run as a module of a name of its own, `urmpipe_unit_` and a hash of the text.
        file: What the messages call it.

    Raises:
        UnitError: If it cannot be run, or holds no unit or several.
    """
    module = ModuleType(f"urmpipe_unit_{hashlib.sha256(source.encode()).hexdigest()[:16]}")
    module.__file__ = file
    sys.modules[module.__name__] = module  # dataclasses and pickle look it up there
    try:
        exec(compile(source, file, "exec"), vars(module))  # the user asked for this file to be run
    except SyntaxError as error:
        found = Finding(
            f"not valid Python: {error.msg}; allowed: Python with a BlockModel in it", file, error.lineno
        )
        raise UnitError(found) from error
    except (Exception, SystemExit) as error:
        raise UnitError(*_told(error, file)) from error
    return _only_unit(module, file)


def _read(path: Path) -> str:
    """Return the text of a file.

    Raises:
        UnitError: If it cannot be read or is no UTF-8.
    """
    content = BytesIO(read_contents(path, UnitError, (".py",)))
    try:
        return TextIOWrapper(content, "utf-8-sig").read()
    except UnicodeDecodeError as error:
        fault = f"byte {error.start} is not UTF-8; allowed: Python in UTF-8"
        raise UnitError(Finding(fault, str(path))) from error


def _neighbours(path: Path, source: str) -> Iterator[Finding]:
    """Yield the imports of files that stand beside a file, and would not be there where its FMU runs."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return  # running it tells what is wrong
    for name, line in _imports(tree):
        top = name.split(".")[0]
        if top in sys.stdlib_module_names:
            continue  # a file time.py, or the unit's own of that name, is not what `import time` finds
        beside = (path.parent / f"{top}.py", path.parent / top / "__init__.py")
        if not top or any(one.exists() for one in beside):
            fault = (
                f"imports {name}, which stands beside it; allowed: installed packages, and all else in"
                " the one file, the only one that the FMU carries"
            )
            yield Finding(fault, str(path), line)


def _imports(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield what is imported, and in which line; relative to the file with its dots."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((one.name, node.lineno) for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or ""), node.lineno


def _told(error: BaseException, file: str) -> list[Finding]:
    """Return what went wrong while a file was run, with its line."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    line = lines[-1] if lines else None
    if isinstance(error, UrmpipeError):
        return [one if one.file else replace(one, file=file, line=line) for one in error.findings]
    said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return [Finding(f"cannot be run: {said}; allowed: Python with a BlockModel in it", file, line)]


def _only_unit(module: ModuleType, file: str) -> BlockModel:
    """Return the one unit of a module; names with _ before them do not count.

    Raises:
        UnitError: If there is none or several.
    """
    found = {
        id(value): (name, value)
        for name, value in vars(module).items()
        if isinstance(value, BlockModel) and not name.startswith("_")
    }
    if not found:
        raise UnitError(
            Finding("found no BlockModel, allowed: one, such as unit = BlockModel(name=..., ...)", file)
        )
    if len(found) > 1:
        names = ", ".join(name for name, _ in found.values())
        fault = f"found {len(found)} units: {names}; allowed: one (a name with _ before it does not count)"
        raise UnitError(Finding(fault, file))
    [(_, model)] = found.values()
    return model


def _check_keeps_nothing(model: BlockModel) -> None:
    """Compare what a unit's functions give of the same values, before and after others.

    Raises:
        UnitError: If they differ: something is kept that an FMU would not keep, or drawn at random.
    """
    equations = Equations(model)
    starts: list[Any] = [np.float64(start) for one in model.arguments for start in one.starts]
    others = [start + 0.5 + 0.01 * k for k, start in enumerate(starts)]
    for what in ("outputs", "derivatives", "update"):
        method = getattr(equations, what)
        first, _, again = (
            method(time, given, None if model.table is None else model.table.rows_at(time))
            for time, given in ((0.0, starts), (0.5, others), (0.0, starts))
        )
        if not all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, again, strict=True)):
            raise UnitError(
                f"unit {model.name}: {what}: gives other results for the same values, allowed: a function"
                " that keeps and draws nothing; what is remembered is a State or a Memory"
            )
