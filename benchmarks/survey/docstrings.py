"""Which public definitions lack a docstring, and which docstrings the unit or the shape of their arrays."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from dataclasses import dataclass

from survey.arrays import Aliases
from survey.source import Definition, Source

_SYMBOL = r"(?:[numkM]?(?:m|s|g|A|V|W|N|J|H|Hz|B)|Nm|kg|Ohm|rad|deg|px|turns?|-|%)"
UNIT = re.compile(
    rf"\[(?:\d+ )?{_SYMBOL}\d?(?:[ */^]*{_SYMBOL}\d?)*\]"  # [m/s2], [kg m2], [-]
    r"|\b(?:rad|dimensionless|SI|radians?|degrees?|seconds|pixels|nanoseconds)\b"
    r"|\bunits? (?:of|as|vectors?|quaternions?)\b|\b(?:own|same|its|any|their|whose) units?\b"
)
"""A unit as a docstring states it: in brackets, in words, or as that of something else."""

_LENGTH = r"(?:\.{3}|\w+(?: [+*-] \w+)?|\d \w+)"
SHAPE = re.compile(
    r"\bshapes? (?:\(|as\b|of\b)|\b(?:same|any|whatever) shape\b|\bshaped (?:as|like)\b"
    rf"|(?<!\w)\({_LENGTH},(?: {_LENGTH},?)*\)"  # (n,), (..., 3)
    r"|\b[Oo]ne (?:array|element|column|row|value|entry) (?:a|an|per|for each|each)\b"
)
"""A shape as a docstring states it."""


@dataclass(frozen=True, slots=True)
class Documented:
    """Public definitions with their docstrings."""

    public: int
    """Modules, classes, functions and methods."""
    bare: tuple[str, ...]
    """Those without a docstring."""


@dataclass(frozen=True, slots=True)
class ArraysDocumented:
    """Public functions that arrays pass through, and public classes that hold some."""

    passing: int
    incomplete: tuple[str, ...]
    """Those that leave a unit or a shape open, and which."""


def documented(sources: Sequence[Source]) -> Documented:
    """Return the public definitions of some files and which of them lack a docstring."""
    count, bare = 0, []
    for source in sources:
        if not source.public:
            continue
        count += 1
        if not ast.get_docstring(source.tree):
            bare.append(f"{source.path}:1 the module")
        for made in _public(source):
            count += 1
            if not ast.get_docstring(made.node):
                bare.append(made.place)
    return Documented(count, tuple(bare))


def arrays_documented(sources: Sequence[Source], aliases: Aliases) -> ArraysDocumented:
    """Return the public definitions that arrays pass through, and what they leave open."""
    count, incomplete = 0, []
    for source in sources:
        for made in _public(source):
            found = aliases.passed(source.module, made.node)
            if not found.any:
                continue
            count += 1
            lacking = open_questions(ast.get_docstring(made.node) or "", measured=found.measured)
            if lacking:
                incomplete.append(f"{made.place}: no {' and no '.join(lacking)}")
    return ArraysDocumented(count, tuple(incomplete))


def open_questions(docstring: str, *, measured: bool) -> list[str]:
    """Return what a docstring of arrays does not state: a unit (of measured ones), a shape."""
    text = " ".join(docstring.split())
    unit = not measured or UNIT.search(text)
    return [*([] if unit else ["unit"]), *([] if SHAPE.search(text) else ["shape"])]


def _public(source: Source) -> list[Definition]:
    """Return what is public; of setters and overloads the getter or function tells, of a test its name."""
    silent = {"setter", "deleter", "overload"}
    return [
        made
        for made in source.definitions
        if made.public
        and not made.decorators & silent
        and not (source.area == "tests" and made.name.split(".")[-1].lower().startswith("test"))
    ]
