"""Which arrays of a file are one table: those of an episode, and of one length.

A file of arrays (HDF5, MAT, NumPy, JSON) has groups, or structs, of arrays. Arrays with as many rows as there
are samples are the columns of one table. This module imports nothing else, so that a separate process that
reads a file starts quickly.

1. Episodes are groups whose names differ by a number and that contain the same arrays: `data/demo_0`,
   `data/demo_1`. If their arrays have one length, they are episodes only if they are named so: else
   `joint_1/position` and `joint_2/position` are columns of one table.
2. The number of rows is the length of the vectors, else of the matrices. Short arrays next to longer ones are
   parameters, such as limits. If several long lengths remain, the user chooses.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

Name = tuple[str, ...]  # the groups that contain an array, from the outermost, and its name
Shapes = Mapping[Name, tuple[int, ...]]

OPAQUE = "opaque"  # first entry of the pair in the place of an object, with the name of its class
EPISODES = re.compile("demo|demonstration|ep|episode|rollout|run|seq|sequence|take|traj|trajectory|trial")
SHORT = 16  # rows of parameters: limits, gains, a matrix of a tool
WIDE = 3  # a matrix of a MAT file this many times wider than high has one column per sample
MAX_NAMES = 4  # arrays that a choice lists


class Choice(NamedTuple):
    """The arrays of one table.

    Attributes:
        group: The group of the episode; empty without episodes.
        rows: Number of samples.
        names: The arrays.
        applied: The options that were used: "episode", "topic".
        left_out: The other arrays of more than one number.
    """

    group: Name
    rows: int
    names: tuple[Name, ...]
    applied: tuple[str, ...]
    left_out: tuple[Name, ...]


class Question(NamedTuple):
    """What the user chooses: an option, what it was, and its values with the rows that each reads."""

    option: str
    requested: str | None
    choices: tuple[tuple[str, str], ...]


def choose_arrays(
    shapes: Shapes, episode: str | None, topic: str | None, *, separator: str, by_rows: bool
) -> Choice | Question:
    """Return the arrays of one table, or the question which they are.

    Args:
        shapes: Shape of each array.
        episode: The name or number of an episode, or None.
        topic: The name of an array or group whose length is read, or None.
        separator: Sign between groups.
        by_rows: Whether a matrix without vectors has one row per sample; else its longer side is the rows.
    """
    groups, inner = find_episodes(shapes), shapes
    group: Name = ()
    applied: tuple[str, ...] = ()
    if groups:
        chosen = pick_episode(groups, episode)
        chosen = next(iter(groups)) if episode is None and len(groups) == 1 else chosen
        if chosen is None:
            inside: dict[Name, dict[Name, tuple[int, ...]]] = {path: {} for path in groups.values()}
            depth = len(next(iter(inside)))
            for name, shape in shapes.items():
                inside.get(name[:depth], {})[name] = shape
            rows_of = ((name, _row_counts(inside[path], by_rows)) for name, path in groups.items())
            choices = ((name, f"its {max(rows.values(), default=0)} rows") for name, rows in rows_of)
            return Question("episode", episode, tuple(choices))
        group, applied = groups[chosen], ("episode",) if episode else ()
        inner = {name: shape for name, shape in shapes.items() if name[: len(group)] == group}
    counts = _row_counts(inner, by_rows)
    long = {name: rows for name, rows in counts.items() if rows > SHORT} or counts
    if len(set(long.values())) > 1:
        rows = {
            count
            for name, count in long.items()
            if topic is not None and f"{separator.join(name)}{separator}".startswith(topic + separator)
        }
        if len(rows) != 1:
            lengths = sorted(set(long.values()), reverse=True)
            return Question("topic", topic, tuple(_describe_topic(long, n, separator) for n in lengths))
        long, applied = {name: n for name, n in long.items() if n in rows}, (*applied, "topic")
    count = next(iter(long.values()), 0)
    names = tuple(name for name, rows in counts.items() if rows == count)
    return Choice(group, count, names, applied, tuple(name for name in inner if name not in names))


def find_episodes(shapes: Shapes) -> dict[str, Name]:
    """Return the groups of episodes by name, in the order of their numbers; nothing without episodes."""
    inside: dict[tuple[Name, str], dict[str, dict[Name, int]]] = {}
    for name, shape in shapes.items():
        for depth, group in enumerate(name[:-1]):
            stem = re.sub(r"\d+", "#", group)
            if stem != group and shape:
                members = inside.setdefault((name[:depth], stem), {})
                members.setdefault(group, {})[name[depth + 1 :]] = max(shape)
    for (outer, stem), members in sorted(inside.items(), key=lambda entry: len(entry[0][0])):
        named = stem == "#" or any(map(EPISODES.fullmatch, re.findall("[a-z]+", stem.lower())))
        shared = set.intersection(*(set(arrays) for arrays in members.values()))
        lengths = {tuple(arrays[name] for name in sorted(shared)) for arrays in members.values()}
        if shared and (named or len(lengths) > 1):
            in_order = sorted(members, key=lambda name: (int(_number(name)), name))
            return {name: (*outer, name) for name in in_order}
    return {}


def pick_episode(names: Iterable[str], episode: str | None) -> str | None:
    """Return the name of an episode that is given by its name or number; None if there is no such episode."""
    by_number = {_number(name): name for name in names}
    return episode if episode in by_number.values() else by_number.get(episode or "")


def _number(name: str) -> str:
    """Return the last number in a name without leading zeros."""
    return re.findall(r"\d+", name)[-1].lstrip("0") or "0"


def _row_counts(shapes: Shapes, by_rows: bool) -> dict[Name, int]:
    """Return the number of rows of each vector and matrix that has more than one.

    A matrix has as many rows as a vector that is as long as one of its sides, unless that is short and may
    be a parameter.
    """
    vectors = {max(shape) for shape in shapes.values() if _is_vector(shape)}
    counts = {}
    for name, shape in shapes.items():
        if _is_vector(shape):
            rows = max(shape)
        elif len(shape) == 2:
            high, wide = shape
            sides = [side for side in shape if side in vectors and (side > SHORT or side == max(shape))]
            rows = (sides or [wide if not by_rows and wide >= WIDE * high else high])[0]
        else:
            continue
        if rows > 1:
            counts[name] = rows
    return counts


def _is_vector(shape: tuple[int, ...]) -> bool:
    """Return whether an array has one column: (n,), (n, 1) or (1, n)."""
    return len(shape) == 1 or (len(shape) == 2 and 1 in shape)


def _describe_topic(counts: Mapping[Name, int], count: int, separator: str) -> tuple[str, str]:
    """Return a group, else an array, that only arrays of this length have, and what it reads."""
    names = [name for name, rows in counts.items() if rows == count]
    groups = [names[0][:depth] for depth in range(1, len(names[0]))]
    unique = [g for g in groups if all(n == count for name, n in counts.items() if name[: len(g)] == g)]
    shown = ", ".join(separator.join(name) for name in names[:MAX_NAMES]) + ", ..." * (len(names) > MAX_NAMES)
    return separator.join((unique or names)[0]), f"{count} rows: {shown}"
