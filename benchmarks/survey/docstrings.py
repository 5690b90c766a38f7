"""Which public definitions lack a docstring, and which docstrings the unit or the shape of their arrays."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from dataclasses import dataclass

from survey.arrays import Aliases
from survey.source import Definition, Source
from survey.stated import stated

_SYMBOL = r"(?:[numkM]?(?:m|s|g|A|V|W|N|J|H|Hz|B)|Nm|kg|Ohm|rad|deg|px|turns?|-|%)"
UNIT = re.compile(
    rf"\[(?:\d+ )?{_SYMBOL}\d?(?:[ */^]*{_SYMBOL}\d?)*\]"  # [m/s2], [kg m2], [-]
    r"|\b(?:rad|dimensionless|SI|radians?|degrees?|seconds|pixels|nanoseconds)\b"
    r"|\bunits? (?:of|as|vectors?|quaternions?)\b|\b(?:own|same|its|any|that|their|whose) units?\b"
    r"|\b[Ii]n (?:one unit\b|`units?`)"
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
    """Arrays that public functions take and give, and that public classes hold."""

    passing: int
    incomplete: tuple[str, ...]
    """Those whose unit or shape the docstring leaves open."""


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
    """Return the arrays of public definitions, and what their docstrings leave open of each."""
    count, incomplete = 0, []
    for source in sources:
        for made in _public(source):
            said = stated(made.node)
            for name, array in aliases.passed(source.module, made.node).items():
                count += 1
                lacking = open_questions(said.of(name), measured=array.measured)
                if lacking:
                    incomplete.append(f"{made.place}: {name}: no {' and no '.join(lacking)}")
    return ArraysDocumented(count, tuple(incomplete))


def open_questions(said: str, *, measured: bool) -> list[str]:
    """Return what is not said of an array: a unit (of a measured one), a shape."""
    text = " ".join(said.split())
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
