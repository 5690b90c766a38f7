"""Where arrays pass: which annotations mention one, whatever alias the code gave it.

An array is NumPy's `NDArray`, `ArrayLike` or `ndarray`, alone or inside a tuple, list, mapping or union, and
every alias of such a type. `Element` and `Vector` of the models are none: their definition says which shape
they have (a float, an array over samples, or a symbol). A callable that takes arrays is none either.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from survey.source import Function, Source
from survey.stated import RESULT

_ROOTS = {"NDArray", "ArrayLike", "ndarray"}
_COUNTED = {
    "bool_",
    "int8",
    "int32",
    "int64",
    "intp",
    "uint8",
    "uint16",
    "uint32",
    "uint64",
    "str_",
    "object_",
}
"""Entries that count, flag or name something: they have no unit, or the name says it (`t_ns`)."""

_TYPES = (ast.Name, ast.Attribute, ast.Subscript, ast.BinOp)
"""What the value of an alias may be."""


@dataclass(frozen=True, slots=True)
class Arrays:
    """Which arrays an annotation mentions."""

    any: bool = False
    measured: bool = False
    """Whether one of them holds quantities, which have a unit."""


NONE = Arrays()


class Aliases:
    """The names that stand for array types, by the module that defines or imports them."""

    def __init__(self, sources: Sequence[Source]) -> None:
        self._values = {source.module: dict(_assigned(source.tree)) for source in sources}
        self._imports = {source.module: dict(_imported(source.tree)) for source in sources}
        self._known: dict[tuple[str, str], Arrays] = {}

    def mentioned(self, module: str, annotation: ast.expr | None) -> Arrays:
        """Return which arrays an annotation in a module mentions."""
        match annotation:
            case None | ast.Subscript(value=ast.Name(id="Callable" | "Literal")):
                return NONE
            case ast.Name(id=name) | ast.Attribute(attr=name):
                return self._named(module, name)
            case ast.Subscript(value=head, slice=entries) if self.mentioned(module, head).any:
                return Arrays(any=True, measured=_measured(entries))
            case ast.Constant(value=str(text)):
                return self.mentioned(module, ast.parse(text, mode="eval").body)
        parts = (part for part in ast.iter_child_nodes(annotation) if isinstance(part, ast.expr))
        return _union(self.mentioned(module, part) for part in parts)

    def passed(self, module: str, node: Function | ast.ClassDef) -> dict[str, Arrays]:
        """Return which arguments and result, or fields of a class and what makes it, are arrays, by name."""
        found = {name: self.mentioned(module, annotation) for name, annotation in _annotations(node)}
        return {name: arrays for name, arrays in found.items() if arrays.any}

    def _named(self, module: str, name: str) -> Arrays:
        """Follow a name to what it was assigned, through imports."""
        if name in _ROOTS:
            return Arrays(any=True, measured=True)
        key = (module, name)
        if key not in self._known:
            self._known[key] = NONE  # what a type that is made of itself adds to what it else mentions
            value = self._values.get(module, {}).get(name)
            origin = self._imports.get(module, {}).get(name, ("", ""))
            if value is not None:
                self._known[key] = self.mentioned(module, value)
            elif origin[0] in self._values:
                self._known[key] = self._named(*origin)
        return self._known[key]


def _union(found: Iterable[Arrays]) -> Arrays:
    """Return what any of some mentions."""
    every = list(found)
    return Arrays(any(one.any for one in every), any(one.measured for one in every))


def _measured(entries: ast.expr) -> bool:
    """Return whether an array of these entries, `np.float64` or `Any`, holds quantities."""
    return not (isinstance(entries, ast.Attribute) and entries.attr in _COUNTED)


def _annotations(node: Function | ast.ClassDef) -> Iterator[tuple[str, ast.expr | None]]:
    if isinstance(node, ast.ClassDef):
        for statement in node.body:
            if isinstance(statement, ast.AnnAssign) and not ast.unparse(statement.target).startswith("_"):
                yield ast.unparse(statement.target), statement.annotation
            elif isinstance(statement, ast.FunctionDef) and statement.name == "__init__":
                yield from ((name, kind) for name, kind in _annotations(statement) if name != RESULT)
        return
    rest = [one for one in (node.args.vararg, node.args.kwarg) if one]
    for parameter in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, *rest):
        yield parameter.arg, parameter.annotation
    yield RESULT, node.returns


def _top(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the statements of a module, those for type checkers too."""
    for statement in tree.body:
        if isinstance(statement, ast.If):
            yield from statement.body
        else:
            yield statement


def _assigned(tree: ast.Module) -> Mapping[str, ast.expr]:
    """Return what the names of a module that look like types were assigned."""
    found: dict[str, ast.expr] = {}
    for statement in _top(tree):
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if name[:1].isupper():
                found[name] = value
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value) if name[:1].isupper():
                found[name] = value
    return {name: value for name, value in found.items() if isinstance(value, _TYPES)}


def _imported(tree: ast.Module) -> Mapping[str, tuple[str, str]]:
    """Return where the names of a module come from."""
    return {
        alias.asname or alias.name: (statement.module, alias.name)
        for statement in _top(tree)
        if isinstance(statement, ast.ImportFrom) and statement.module and not statement.level
        for alias in statement.names
    }
