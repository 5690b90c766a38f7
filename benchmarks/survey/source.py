"""The code as it is read: files of the areas with their syntax, and what each of them defines."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

PACKAGES = ("models", "fmus", "pipeline", "cli", "datasets")
"""The areas that are installed: what is public in them is for users."""

AREAS = (*PACKAGES, "benchmarks", "docs", "tests")

_BLOCKS = ("body", "handlers", "orelse", "finalbody", "cases")
"""Where a statement holds others."""

Function: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Definition:
    """A function, method or class.

    Attributes:
        path: Of its file, from the root.
        name: Dotted, within its module.
        node: Its syntax.
        public: Whether nothing in its dotted path begins with an underscore and no function encloses it.
        method: Whether a class encloses it directly.
    """

    path: str
    name: str
    node: Function | ast.ClassDef
    public: bool
    method: bool

    @property
    def size(self) -> int:
        """Lines from `def` to the last one: signature and docstring count, decorators do not."""
        return (self.node.end_lineno or self.node.lineno) - self.node.lineno + 1

    @property
    def key(self) -> str:
        """What a reason is kept under: file:function."""
        return f"{self.path}:{self.name}"

    @property
    def place(self) -> str:
        """Where an editor finds it."""
        return f"{self.path}:{self.node.lineno} {self.name}"

    @property
    def decorators(self) -> set[str]:
        """The last names of its decorators: `setter` of `@rate.setter`."""
        return {_last_name(decorator) for decorator in self.node.decorator_list}


@dataclass(frozen=True, slots=True)
class Source:
    """A file of Python.

    Attributes:
        path: From the root, with slashes.
        module: The dotted name it is imported by.
        lines: Its text.
        tree: Its syntax.
        statements: All of them, nested ones too.
        definitions: Likewise.
    """

    path: str
    module: str
    lines: tuple[str, ...]
    tree: ast.Module
    statements: tuple[ast.AST, ...]
    definitions: tuple[Definition, ...]

    @property
    def area(self) -> str:
        """The folder below the root."""
        return self.path.split("/")[0]

    @property
    def public(self) -> bool:
        """Whether no part of its path begins with an underscore; `__init__` stands for its package."""
        return not any(_hidden(part) for part in self.module.split("."))

    @property
    def imports_by_text(self) -> bool:
        """Whether it loads modules by a text."""
        return any("import_module" in line for line in self.lines)

    def functions(self) -> list[tuple[Definition, Function]]:
        """Return the functions and methods, nested ones too."""
        return [(made, made.node) for made in self.definitions if not isinstance(made.node, ast.ClassDef)]


def read_sources(root: Path, areas: tuple[str, ...] = AREAS) -> tuple[Source, ...]:
    """Return the files of the areas that are there, sorted by path."""
    paths = sorted(path for area in areas for path in (root / area).rglob("*.py"))
    return tuple(read_source(path, root) for path in paths)


def read_source(path: Path, root: Path) -> Source:
    """Return a file as read; what is no Python raises SyntaxError."""
    text = path.read_text(encoding="utf-8")
    place = path.relative_to(root)
    tree = ast.parse(text, filename=str(path))
    parts = [part for part in place.with_suffix("").parts[1:] if part != "__init__"]
    module = ".".join(parts)
    shown = not any(_hidden(part) for part in parts)
    found = tuple(_defined(tree, place.as_posix(), "", shown, inside_class=False))
    lines, statements = tuple(text.splitlines()), tuple(_statements(tree))
    return Source(place.as_posix(), module, lines, tree, statements, found)


def statements_below(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements directly below a node; the arms of `try` and `match` are such nodes too."""
    for block in _BLOCKS:
        yield from getattr(node, block, ())


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements below a node, at every depth."""
    for child in statements_below(node):
        yield child
        yield from _statements(child)


def _defined(
    node: ast.AST, path: str, prefix: str, public: bool, *, inside_class: bool
) -> Iterator[Definition]:
    """Yield what is defined below a node, each before what is nested in it."""
    for child in statements_below(node):
        if isinstance(child, Function | ast.ClassDef):
            name, shown = prefix + child.name, public and not _hidden(child.name)
            yield Definition(path, name, child, shown, inside_class)
            is_class = isinstance(child, ast.ClassDef)
            yield from _defined(child, path, name + ".", shown and is_class, inside_class=is_class)
        else:
            yield from _defined(child, path, prefix, public, inside_class=inside_class)


def _hidden(name: str) -> bool:
    return name.startswith("_") and name != "__main__"


def _last_name(decorator: ast.expr) -> str:
    """Return `c` of `a.b.c(...)`."""
    node = decorator.func if isinstance(decorator, ast.Call) else decorator
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""
