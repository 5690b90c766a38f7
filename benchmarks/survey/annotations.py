"""Which functions have annotations of all parameters and of what they return."""

from __future__ import annotations

from collections.abc import Sequence

from survey.source import Definition, Function, Source


def unannotated(sources: Sequence[Source]) -> list[Definition]:
    """Return the functions, private and nested ones too, that lack an annotation."""
    return [
        made
        for source in sources
        for made, node in source.functions()
        if not is_annotated(node, bound=made.method and "staticmethod" not in made.decorators)
    ]


def is_annotated(node: Function, *, bound: bool) -> bool:
    """Return whether parameters and return have annotations; the first of a bound method needs none."""
    positional = [*node.args.posonlyargs, *node.args.args][bound:]
    others = [given for given in (node.args.vararg, node.args.kwarg) if given is not None]
    parameters = [*positional, *node.args.kwonlyargs, *others]
    return node.returns is not None and all(parameter.annotation is not None for parameter in parameters)
