"""The text of a program, and what is said of it.

The positions of a robot's program as a table: those that it moves to, or those that it declares.

A position is of joints or of the tool. An array of them is a path, and what stands beside it is not; without
one the rows are the positions in the order of the moves, if every move names one or holds its numbers; else
in the order of the text.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path

import numpy as np
import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.numbers import arrow_column
from urmpipe_pipeline.logs.log_map import LogMap


@dataclass(frozen=True)
class Program:
    """The text of a program.

    Attributes:
        path: Its file.
        text: All of it, comments as spaces.
        language: What it is written in, as its users call it.
        options: What the user says about the log.
    """

    path: Path
    text: str
    language: str
    options: LogMap

    def statements(self) -> Iterator[tuple[int, str]]:
        """Yield each statement that a semicolon ends, or the file, with the offset where it begins."""
        start = 0
        for statement in self.text.split(";"):
            lead = len(statement) - len(statement.lstrip())
            yield start + lead, statement[lead:]
            start += len(statement) + 1

    def line(self, offset: int) -> int:
        """Return the line of the file, from 1, that an offset of its text is in."""
        return bisect_left(self._ends, offset) + 1

    @cached_property
    def _ends(self) -> list[int]:
        return [match.start() for match in re.finditer("\n", self.text)]

    def error(self, found: str, allowed: str, offset: int | None = None, *hints: Hint) -> LogError:
        """Return an error about the whole, or a place in it."""
        line = None if offset is None else self.line(offset)
        return LogError(Finding(file=str(self.path), line=line, found=found, allowed=allowed, hints=hints))


def blanked(text: str, comments: re.Pattern[str]) -> str:
    """Return a text whose comments are spaces: what remains stands where it stood."""
    return comments.sub(lambda comment: re.sub(r"[^\n]", " ", comment[0]), text)


def shortened(text: str, length: int = 40) -> str:
    """Return the beginning of a text in one line, for messages."""
    line = " ".join(text.split())
    return line if len(line) <= length else f"{line[: length - 3]}..."


PATH, TABLE = "path", "table"
"""The sources that take the positions of the tool, and of the joints."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of positions.

    Attributes:
        name: What the language calls it.
        source: The source that takes it alone.
    """

    name: str
    source: str


@dataclass(frozen=True, slots=True)
class Target:
    """A position: its values by the name of their column.

    Attributes:
        kind: What it is.
        values: By column; NaN of an axis that is not there.
        name: What it is called; empty in a move.
        offset: Where it stands.
        array: Whether it is one of an array of this name.
    """

    kind: Kind
    values: Mapping[str, float]
    name: str
    offset: int
    array: bool = False


@dataclass(frozen=True, slots=True)
class _Rows:
    """Positions of a kind that make rows, and why; by name if they are several arrays."""

    kind: Kind
    paths: Mapping[str, Sequence[Target]]
    why: str

    @property
    def count(self) -> int:
        return len(next(iter(self.paths.values())))

    @property
    def targets(self) -> list[Target]:
        return [target for path in self.paths.values() for target in path]

    def columns(self) -> Iterator[tuple[str, list[float]]]:
        """Yield the columns, without those of axes that are not there."""
        for path, targets in self.paths.items():
            for name in targets[0].values:
                values = [target.values.get(name, math.nan) for target in targets]
                if not all(map(math.isnan, values)):
                    yield (name if len(self.paths) == 1 else f"{path}_{name}"), values


def table_of(
    program: Program, targets: Sequence[Target], moves: Sequence[Target | str | None], kinds: Sequence[Kind]
) -> MemoryTable:
    """Return the table of a program's positions.

    Args:
        program: The program.
        targets: What it declares, in the order of the text, and what stands in its moves.
        moves: The position of each move, or its name; None if it is computed.
        kinds: Of the joints, and of the tool.

    Raises:
        LogError: If there are none, if there are paths of different lengths, or if positions of joints and
            of the tool are no rows of one table.
    """
    named = {target.name.lower(): target for target in targets if target.name and not target.array}
    reached = [named.get(move.lower()) if isinstance(move, str) else move for move in moves]
    followed = [target for target in reached if target is not None]
    ordered = followed if followed and len(followed) == len(reached) else None
    found = [rows for kind in kinds if (rows := _rows(program, kind, targets, ordered)) is not None]
    if not found:
        names = " or ".join(kind.name for kind in kinds)
        raise program.error(f"{program.language} without positions", f"a {names} with its numbers")
    if len(found) == 2 and not _beside(*found):
        found = [_chosen(program, found)]
    table = {name: arrow_column(np.array(values)) for rows in found for name, values in rows.columns()}
    said = (Inference("program", " and ".join(_words(rows) for rows in found), _evidence(found, targets)),)
    return MemoryTable(program.path.stem, pa.table(table), path=program.path, inferences=said)


def _rows(
    program: Program, kind: Kind, targets: Sequence[Target], ordered: Sequence[Target] | None
) -> _Rows | None:
    """Return the positions of a kind that are rows; None without any."""
    own = [target for target in targets if target.kind is kind]
    arrays = {name: list(group) for name, group in groupby((t for t in own if t.array), lambda one: one.name)}
    if arrays:
        lengths = {name: len(array) for name, array in arrays.items()}
        if len(set(lengths.values())) > 1:
            found = ", ".join(
                f"{name} of {format_count(count, kind.name)}" for name, count in lengths.items()
            )
            delete = Hint("", effect="delete the others")
            raise program.error(shortened(found, 200), "one array, or several of one length", None, delete)
        return _Rows(kind, arrays, f"of {', '.join(arrays)}")
    if ordered is not None and (followed := [target for target in ordered if target.kind is kind]):
        return _Rows(kind, {"": followed}, "in the order of the moves")
    return _Rows(kind, {"": own}, "in the order of the text") if own and ordered is None else None


def _beside(joints: _Rows, poses: _Rows) -> bool:
    """Return whether every row has both: arrays of one length, or positions whose names pair by number."""
    if joints.count != poses.count:
        return False
    pairs = list(zip(joints.targets, poses.targets, strict=False))
    if all(one.array and other.array for one, other in pairs):
        return len(joints.paths) == len(poses.paths) == 1
    numbers = [[re.sub(r"\D", "", target.name) for target in pair] for pair in pairs]
    return all(one == other != "" for one, other in numbers)


def _chosen(program: Program, found: Sequence[_Rows]) -> _Rows:
    """Return the positions that the source takes, or ask for it."""
    source = program.options.source
    if source is None:
        hints = (Hint("source", rows.kind.source, f"takes the {_words(rows)}") for rows in found)
        message = f"{' and '.join(_words(rows) for rows in found)}, which are not rows of one table"
        raise program.error(message, "one of the two", found[0].targets[0].offset, *hints)
    return next((rows for rows in found if rows.kind.source == source), found[0])


def _words(rows: _Rows) -> str:
    return format_count(rows.count, rows.kind.name)


def _evidence(found: Sequence[_Rows], targets: Sequence[Target]) -> str:
    """Return why the rows are the rows, and what positions are none of them."""
    used = {id(target) for rows in found for target in rows.targets}
    others = list(dict.fromkeys(target.name for target in targets if id(target) not in used and target.name))
    aside = f"; not among them: {shortened(', '.join(others), 60)}" if others else ""
    return ", ".join(dict.fromkeys(rows.why for rows in found)) + aside
