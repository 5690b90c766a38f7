"""A user's block: one Python file with one `BlockModel` in it.

An FMU contains the text of this file and no other: the file has everything that the block needs, except for
installed packages. Its functions keep nothing between two calls; a value that is kept is a `State` or a
`Memory`. `load_block_file` checks all of that.
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
from urmpipe_fmus.instance import Equations
from urmpipe_models.errors import Finding, UnitError, UrmpipeError
from urmpipe_models.files import read_contents


def load_block_file(path: str | Path) -> BlockModel:
    """Return the block model of a user's file, checked so that it can become an FMU.

    Args:
        path: The file.

    Raises:
        UnitError: If it cannot be read or run, imports a neighbouring file, has no block model or several, or
            if the functions do what C could not or keep something between two calls.
    """
    path = Path(path)
    content = BytesIO(read_contents(path, UnitError, (".py",)))
    try:
        source = TextIOWrapper(content, "utf-8-sig").read()
    except UnicodeDecodeError as error:
        fault = f"byte {error.start} is not UTF-8; allowed: Python in UTF-8"
        raise UnitError(Finding(fault, str(path))) from error
    neighbours = list(_find_neighbours(path, source))
    if neighbours:
        raise UnitError(*neighbours)
    model = block_from_source(source, str(path))
    try:
        Dependencies(model)
        _check_keeps_nothing(model)
    except UnitError as error:
        findings = (replace(finding, file=finding.file or str(path)) for finding in error.findings)
        raise UnitError(*findings) from error
    return replace(model, recipe=Recipe(module=path.name, source=source))


def block_from_source(source: str, file: str) -> BlockModel:
    """Return the one block model that a text of Python makes.

    Args:
        source: The text. It is run as a separate module, `urmpipe_unit_` and a hash of the text.
        file: The name of the file in messages.

    Raises:
        UnitError: If it cannot be run, or has no block model or several.
    """
    module = ModuleType(f"urmpipe_unit_{hashlib.sha256(source.encode()).hexdigest()[:16]}")
    module.__file__ = file
    sys.modules[module.__name__] = module  # dataclasses and pickle look it up there
    try:
        exec(compile(source, file, "exec"), vars(module))  # the user requested to run this file
    except SyntaxError as error:
        fault = f"not valid Python: {error.msg}; allowed: Python with a BlockModel in it"
        raise UnitError(Finding(fault, file, error.lineno)) from error
    except (Exception, SystemExit) as error:
        raise UnitError(*_run_findings(error, file)) from error
    models = {  # names with _ do not count, two names of one model do once
        id(value): (name, value)
        for name, value in vars(module).items()
        if isinstance(value, BlockModel) and not name.startswith("_")
    }
    if not models:
        fault = "found no BlockModel, allowed: one, such as unit = BlockModel(name=..., ...)"
        raise UnitError(Finding(fault, file))
    if len(models) > 1:
        names = ", ".join(name for name, _ in models.values())
        fault = f"found {len(models)} units: {names}; allowed: one (a name with _ before it does not count)"
        raise UnitError(Finding(fault, file))
    [(_, model)] = models.values()
    return model


def _find_neighbours(path: Path, source: str) -> Iterator[Finding]:
    """Yield the imports of neighbouring files, which would not exist where the FMU runs."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return  # running it reports the error
    for name, line in _iter_imports(tree):
        top = name.split(".")[0]
        if top in sys.stdlib_module_names:
            continue  # `import time` finds the standard library's, not a file time.py
        candidates = (path.parent / f"{top}.py", path.parent / top / "__init__.py")
        if not top or any(candidate.exists() for candidate in candidates):
            fault = (
                f"imports {name}, a neighbouring file, which the FMU does not contain: move its code into the"
                " block's file, or install it as a package"
            )
            yield Finding(fault, str(path), line)


def _iter_imports(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield the imported modules with their lines; relative ones with their dots."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or ""), node.lineno


def _run_findings(error: BaseException, file: str) -> list[Finding]:
    """Return the findings of an error that a file raised, with its line."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    line = lines[-1] if lines else None
    if isinstance(error, UrmpipeError):
        return [
            finding if finding.file else replace(finding, file=file, line=line) for finding in error.findings
        ]
    message = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return [Finding(f"cannot be run: {message}; allowed: Python with a BlockModel in it", file, line)]


def _check_keeps_nothing(model: BlockModel) -> None:
    """Check that the functions return the same for the same values, before and after other values.

    Raises:
        UnitError: If not: they keep something that an FMU would not keep, or use random numbers.
    """
    equations = Equations(model)
    starts: list[Any] = [np.float64(start) for variable in model.arguments for start in variable.starts]
    other_values = [start + 0.5 + 0.01 * k for k, start in enumerate(starts)]
    for name in ("outputs", "derivatives", "update"):
        method = getattr(equations, name)
        first, _, again = (
            method(time, arguments, None if model.table is None else model.table.rows_at(time))
            for time, arguments in ((0.0, starts), (0.5, other_values), (0.0, starts))
        )
        if not all(np.array_equal(a, b, equal_nan=True) for a, b in zip(first, again, strict=True)):
            raise UnitError(
                f"unit {model.name}: {name}: gives other results for the same values, allowed: a function"
                " that keeps and draws nothing; what is remembered is a State or a Memory"
            )
