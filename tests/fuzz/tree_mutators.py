"""Changes of what a TOML or JSON file tells: types of values, keys, and how deep they nest."""

from __future__ import annotations

import copy
import json
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

from tests.fuzz.byte_mutators import LARGEST, Mutator


@dataclass(frozen=True)
class Raw:
    """A value as it stands in the file, which no writer would write."""

    text: str


VALUES: tuple[Any, ...] = (
    True, False, 0, 1, -1, 2, 7, 0.0, -0.0, 1.5, 1e308, float("nan"), float("inf"), 2**31, 2**63, 2**64,
    10**30, 1e-320, "", "x", "0", "1", "nan", "a\nb", "a\0b", "\u202e", "../x", "q1", "deg", "x" * 300, [],
    [[]], [1, "a"], [0.0, 0.0, 0.0], [1.0] * 7, {}, {"a": 1}, {"x": {"y": []}}, [{}, {}], [True], ["a", "b"],
)  # fmt: skip
"""What stands for a value: of every type, and at the limits of each."""


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Yield each container with each of its keys or indices."""
    waiting = [tree]
    while waiting:
        one = waiting.pop()
        keys: Any = list(one) if isinstance(one, dict) else range(len(one)) if isinstance(one, list) else ()
        for key in keys:
            yield one, key
            waiting.append(one[key])


def _deep(rng: Random) -> Raw:
    """Return a value that nests deep."""
    times = int(10.0 ** rng.uniform(1.0, 4.5))
    if rng.random() < 0.5:
        return Raw("[" * times + "]" * times)
    key = rng.choice(('"a":', "a="))
    return Raw(f"{{{key}" * times + "1" + "}" * times)


def _value(rng: Random) -> Any:
    """Return any value."""
    if rng.random() < 0.1:
        return rng.choice(
            (
                _deep(rng),
                Raw("9" * 5000),
                Raw("1e999"),
                Raw("0x" + "f" * 3000),
                Raw("1979-05-27T07:32:00Z"),
                Raw("null"),
            )
        )
    return copy.deepcopy(rng.choice(VALUES))


def change(tree: Any, rng: Random) -> Any:
    """Return a tree after one change; the tree itself may change."""
    places = list(_places(tree))
    if not places:
        return _value(rng)
    at, key = rng.choice(places)
    other, its = rng.choice(places)
    match rng.randrange(14):
        case 0:
            del at[key]
        case 1 if isinstance(at, dict):
            at[rng.choice(("", "x", f"{key}s", str(key).upper(), "a.b", "a\nb", str(its)))] = at.pop(key)
        case 2:
            at[key] = copy.deepcopy(other[its])
        case 3 if isinstance(at, list):
            at[key:key] = [at[key]] * int(10.0 ** rng.uniform(0.0, 2.5))
        case 4:
            at[key] = rng.choice(([at[key]], {"a": at[key]}, [at[key], at[key]], str(at[key])[:1000]))
        case 5 if isinstance(at, dict):
            at[rng.choice((f"{key}2", str(its), "extra"))] = _value(rng)
        case 6 | 7:
            at[key] = _value(rng)
        case _:
            at[key] = _alike(at[key], rng)
    return tree


def _alike(value: Any, rng: Random) -> Any:
    """Return another value of the same type, or one that is shorter or longer."""
    if isinstance(value, list):
        return value[: rng.randrange(len(value) + 1)] if rng.random() < 0.5 else value + value[:1]
    if isinstance(value, str):
        return rng.choice((value[:-1], value + value[-1:], value.swapcase(), "", rng.choice(value or " ")))
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return rng.choice((value + 1, value - 1, -value, 2 * value, 0))
    if isinstance(value, float):
        return rng.choice((-value, 0.0, 2.0 * value, value * 1e3, value * 1e-9, value + 1.0))
    return _value(rng)


def as_json(tree: Any) -> str:
    """Return a tree as JSON, raw parts as they are."""
    raw: list[str] = []

    def mark(value: Any) -> str:
        """Leave a mark for what is no JSON."""
        raw.append(value.text if isinstance(value, Raw) else json.dumps(str(value)))
        return f"@raw{len(raw) - 1}@"

    text = json.dumps(tree, default=mark)
    for i, one in enumerate(raw):
        text = text.replace(f'"@raw{i}@"', one)
    return text


def as_toml(tree: Any) -> str:
    """Return a tree as TOML: a line for each key at the top, tables in a line."""
    if not isinstance(tree, dict):
        return _inline(tree)
    return "".join(f"{json.dumps(key)} = {_inline(value)}\n" for key, value in tree.items())


def _inline(value: Any) -> str:
    """Return a value as it stands behind a key."""
    if isinstance(value, Raw):
        return value.text
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return json.dumps(value) if isinstance(value, str | bool) else str(value)


def _through(parse: Callable[[str], Any], write: Callable[[Any], str]) -> Mutator:
    """Return what changes the tree of a text; a text that is none, or nests too deep, stays."""

    def changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
        if len(data) > LARGEST // 2:
            return data
        try:
            tree = change(parse(data.decode()), rng)
            return write(tree).encode("utf-8", "surrogatepass")
        except (ValueError, RecursionError):
            return data

    return changed


toml = _through(tomllib.loads, as_toml)
json_tree = _through(json.loads, as_json)
