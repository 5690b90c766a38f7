"""Which way imports run: between areas, and in rings between modules of one area.

What `import_module` loads by a text counts too; of f"a.b.{name}" the part before what is filled in.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations

from survey.source import PACKAGES, Function, Source, statements_below

ALLOWED: Mapping[str, frozenset[str]] = {
    "datasets": frozenset(),
    "models": frozenset({"datasets"}),
    "fmus": frozenset({"models", "datasets"}),
    "pipeline": frozenset({"models", "datasets"}),
    "cli": frozenset({"models", "fmus", "pipeline", "datasets"}),
}
"""What an area may import besides itself."""


def area_of(module: str) -> str | None:
    """Return the area of a dotted name: `cli` of `urmpipe.main`, `models` of `urmpipe_models`, else None."""
    top = module.split(".", maxsplit=1)[0]
    if top == "urmpipe":
        return "cli"
    area = top.removeprefix("urmpipe_")
    return area if area in PACKAGES and area != top else None


def imported(source: Source) -> set[str]:
    """Return the dotted names that a file imports anywhere: of `from a import b`, a and a.b."""
    named = {name for node in source.statements for name in _names(source, node)}
    by_text = source.statements if source.imports_by_text else ()
    return named | {name for node in by_text for name in _by_text(node)}


def top_level(sources: Sequence[Source]) -> set[str]:
    """Return the names of the packages and distributions that files import."""
    return {name.split(".")[0] for source in sources for name in imported(source)}


def between_areas(sources: Sequence[Source]) -> Counter[tuple[str, str]]:
    """Return how many modules of one area import from another one, anywhere in them."""
    found: Counter[tuple[str, str]] = Counter()
    for source in sources:
        others = {area_of(name) for name in imported(source)} - {source.area, None}
        found.update((source.area, other) for other in others if other is not None)
    return found


def wrong_ways(sources: Sequence[Source]) -> list[str]:
    """Return the packages' modules that import from an area that theirs may not."""
    found = []
    for source in sources:
        if source.area not in ALLOWED:
            continue
        others = {area_of(name) for name in imported(source)} - {source.area, None}
        found += [
            f"{source.path} imports {other}" for other in sorted(map(str, others - ALLOWED[source.area]))
        ]
    return found


def module_rings(sources: Sequence[Source]) -> list[tuple[str, ...]]:
    """Return the rings of modules that import each other when they are loaded, smallest first.

    Imports in functions and those for type checkers do not count: they run later, or never.
    """
    return rings(module_graph(sources))


def folder_rings(sources: Sequence[Source]) -> list[str]:
    """Return the rings of folders below an area whose modules import each other when they are loaded.

    A module that stands beside the folders is a member of its own. A ring tells one import a pair of folders.
    """
    crossing: dict[tuple[str, str], str] = {}
    graph: dict[str, set[str]] = {}
    for module, others in module_graph(sources).items():
        for other in sorted(others):
            pair = _folder(module), _folder(other)
            if pair[0] != pair[1]:
                graph.setdefault(pair[0], set()).add(pair[1])
                crossing.setdefault(pair, f"{module} -> {other}")
    return [
        " ~ ".join(ring)
        + ": "
        + ", ".join(crossing[pair] for pair in permutations(ring, 2) if pair in crossing)
        for ring in rings(graph)
    ]


def module_graph(sources: Sequence[Source]) -> dict[str, set[str]]:
    """Return which modules of the packages each of them imports when it is loaded."""
    packaged = {source.module: source for source in sources if source.area in PACKAGES}
    return {
        module: {name for name in _known(source, packaged) if name != module}
        for module, source in packaged.items()
    }


def rings(graph: Mapping[str, set[str]]) -> list[tuple[str, ...]]:
    """Return the strongly connected components of more than one node, smallest first (Tarjan 1972)."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[tuple[str, ...]] = []

    def visit(node: str) -> None:
        """Number a node and what it reaches; the first node of a component takes it off the stack."""
        number[node] = low[node] = len(number)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in number:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], number[other])
        if low[node] == number[node]:
            first = stack.index(node)
            ring = tuple(sorted(stack[first:]))
            del stack[first:]
            if len(ring) > 1:
                found.append(ring)

    for node in sorted(graph):
        if node not in number:
            visit(node)
    return sorted(found, key=lambda ring: (len(ring), ring))


def _known(source: Source, packaged: Mapping[str, Source]) -> Iterator[str]:
    """Yield the modules that a file loads with it: of `from a import b`, a.b if that is one, else a."""
    by_text = source.imports_by_text
    for statement in _loaded(source.tree):
        if isinstance(statement, ast.Import):
            yield from (alias.name for alias in statement.names if alias.name in packaged)
        elif isinstance(statement, ast.ImportFrom):
            origin = _origin(source, statement)
            for alias in statement.names:
                inner = f"{origin}.{alias.name}"
                if inner in packaged:
                    yield inner
                elif origin in packaged:
                    yield origin
        elif by_text:
            yield from (name for name in _by_text(statement) if name in packaged)


def _loaded(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements that run when a module is loaded."""
    for child in statements_below(node):
        if isinstance(child, Function):
            continue
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            yield from _loaded(ast.Module(child.orelse, []))
            continue
        yield child
        yield from _loaded(child)


def _names(source: Source, node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        origin = _origin(source, node)
        yield origin
        yield from (f"{origin}.{alias.name}" for alias in node.names)


def _by_text(statement: ast.AST) -> Iterator[str]:
    """Yield what a statement itself, without those nested in it, imports by `import_module("a.b")`."""
    for child in ast.iter_child_nodes(statement):
        if isinstance(child, ast.expr | ast.withitem):
            yield from filter(None, map(_module_text, ast.walk(child)))


def _module_text(node: ast.AST) -> str:
    """Return the module that a call of `import_module` names, as far as it is written out; else nothing."""
    match node:
        case ast.Call(
            func=ast.Name(id="import_module") | ast.Attribute(attr="import_module"), args=[named, *_]
        ):
            match named:
                case ast.Constant(value=str(text)):
                    return text
                case ast.JoinedStr(values=[ast.Constant(value=str(text)), *_]):
                    return text.rpartition(".")[0]
    return ""


def _origin(source: Source, node: ast.ImportFrom) -> str:
    """Return what a `from` imports out of, in full: of `from ..a import b` in c.d.e, c.a."""
    if not node.level:
        return node.module or ""
    parts = source.module.split(".")
    up = node.level - source.path.endswith("__init__.py")
    return ".".join([*parts[: len(parts) - up], *filter(None, [node.module])])


def _folder(module: str) -> str:
    """Return the folder below the area that a module stands in, or the module itself."""
    return ".".join(module.split(".")[:2])
