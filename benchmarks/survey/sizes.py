"""How long files and functions are, how many arguments they take, and how deep they nest."""

from __future__ import annotations

import ast
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from survey.source import Definition, Function, Source, statements_below

FILE_MEDIAN, FILE_MOST = 150, 400
FUNCTION_MEDIAN, FUNCTION_MOST = 10, 60
MANY_ARGUMENTS = 8
"""Above this a function is listed: no bound, as a kinematic function takes q, qd, qdd, chain and more."""

DEEPEST = 10
"""How many of the functions that nest deepest are listed."""

_NESTS = (ast.If, ast.For, ast.AsyncFor, ast.While, ast.With, ast.AsyncWith, ast.Try, ast.TryStar, ast.Match)


@dataclass(frozen=True, slots=True)
class Spread:
    """Sizes of files or functions, in lines."""

    count: int
    median: float
    largest: int

    @classmethod
    def of(cls, sizes: Sequence[int]) -> Self:
        """Return the spread of sizes; of none, zeros."""
        return cls(len(sizes), statistics.median(sizes), max(sizes)) if sizes else cls(0, 0.0, 0)


def file_sizes(sources: Sequence[Source]) -> Spread:
    """Return the spread of the files' lines."""
    return Spread.of([len(source.lines) for source in sources])


def function_sizes(sources: Sequence[Source]) -> Spread:
    """Return the spread of the functions' lines, of methods and nested functions too."""
    return Spread.of([made.size for source in sources for made, _ in source.functions()])


def long_files(sources: Sequence[Source]) -> list[Source]:
    """Return the files over the bound, longest first."""
    return sorted((s for s in sources if len(s.lines) > FILE_MOST), key=lambda s: -len(s.lines))


def long_functions(sources: Sequence[Source]) -> list[Definition]:
    """Return the functions over the bound, longest first."""
    made = [made for source in sources for made, _ in source.functions()]
    return sorted((one for one in made if one.size > FUNCTION_MOST), key=lambda one: -one.size)


def many_arguments(sources: Sequence[Source]) -> list[str]:
    """Return the functions that take many arguments, and how many, most first."""
    counts = [(argument_count(node), made) for source in sources for made, node in source.functions()]
    over = sorted((one for one in counts if one[0] > MANY_ARGUMENTS), key=lambda one: (-one[0], one[1].key))
    return [f"{made.place}: {count}" for count, made in over]


def deepest(sources: Sequence[Source]) -> list[str]:
    """Return the functions that nest deepest, and how deep."""
    depths = [(nesting(node), made) for source in sources for made, node in source.functions()]
    first = sorted(depths, key=lambda one: (-one[0], one[1].key))[:DEEPEST]
    return [f"{made.place}: {depth} blocks" for depth, made in first]


def argument_count(node: Function) -> int:
    """Return how many parameters a caller may fill: `self`, `cls`, *args and **kwargs do not count."""
    named = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    return sum(parameter.arg not in {"self", "cls"} for parameter in named)


def nesting(node: ast.AST) -> int:
    """Return how many blocks lie inside each other at the deepest place; `elif` is as deep as its `if`."""
    return max((_depth(child) for child in statements_below(node)), default=0)


def _depth(node: ast.AST) -> int:
    """Return the depth of a statement, itself counted; a nested function begins anew."""
    if isinstance(node, Function | ast.ClassDef):
        return 0
    if isinstance(node, ast.If) and len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
        below = max((_depth(child) for child in node.body), default=0)
        return max(1 + below, _depth(node.orelse[0]))
    return isinstance(node, _NESTS) + nesting(node)
