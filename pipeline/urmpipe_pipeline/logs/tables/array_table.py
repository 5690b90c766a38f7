"""Arrays of a file as a table in memory: names of columns, a clock of even times, what the user chooses."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.array_choice import Choice, Name, Question
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.tables import numpy_columns
from urmpipe_pipeline.logs.tables.column_facts import UNIT
from urmpipe_pipeline.logs.tables.held import MemoryTable
from urmpipe_pipeline.logs.tables.numpy_file import even_times
from urmpipe_pipeline.logs.vocabulary import key, split_unit, vocabulary

SHOWN = 9  # choices of a question, or arrays that are not read, which a message lists

_NUMBERED = re.compile(r"\[\d+\]$")

ArrayColumn = tuple[Name, str, NDArray[Any]]
"""The groups and the name of a column, its unit or an empty text, and its values, shape (n,)."""


def make_array_table(
    path: Path,
    choice: Choice,
    columns: Sequence[ArrayColumn],
    scalars: Mapping[str, float],
    separator: str,
    not_read: Sequence[str] = (),
) -> MemoryTable:
    """Return the columns of some arrays as a table.

    A column is called by its groups, without those that all columns share. A clock is called by its own name,
    if no other one is called so.

    Args:
        path: The file.
        choice: Which arrays of the file they are.
        columns: The columns.
        scalars: Single numbers of the file, of which one may be the time between samples.
        separator: Sign between groups in names.
        not_read: The other arrays of the file, as a message lists them.
    """
    shared = 0
    if "topic" not in choice.applied:
        groups = zip(*(name[:-1] for name, _, _ in columns), strict=False)
        shared = sum(1 for _ in takewhile(lambda same: len(set(same)) == 1, groups))
    clocks = {k: values for k, (name, _, values) in enumerate(columns) if _is_clock(name[-1])}
    first = next(iter(clocks.values()), None)
    same = [k for k, values in clocks.items() if first is not None and np.array_equal(values, first)]
    is_unique = len(same) == len(clocks)
    named: dict[str, tuple[str, NDArray[Any]]] = {}
    for k, (name, unit, values) in enumerate(columns):
        if is_unique and k in same[1:]:
            continue
        label = name[-1] if is_unique and k in same else separator.join(name[shared:])
        named[label if label not in named else separator.join(name)] = unit, values
    times, reasons = even_times(scalars, {name: values for name, (_, values) in named.items()})
    arrays = [numpy_columns.column(values) for values in times.values()]
    arrays += [
        pa.array(values.tolist()) if values.dtype == object else numpy_columns.column(values)
        for _, values in named.values()
    ]
    names, units = [*times, *named], [""] * len(times) + [unit for unit, _ in named.values()]
    fields = [
        pa.field(name, array.type, metadata={UNIT: unit} if unit else None)
        for name, array, unit in zip(names, arrays, units, strict=True)
    ]
    inferences = [*reasons]
    if not_read:
        more = f" and {len(not_read) - SHOWN} more" if len(not_read) > SHOWN else ""
        rows = f"they have no column of {choice.rows} rows"
        inferences.append(Inference("arrays", f"{', '.join(not_read[:SHOWN])}{more} are not read", rows))
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    patterns = vocabulary().joint["position"]
    says = len(choice.names) > 1 or not all(map(_NUMBERED.search, named))
    says = says or any(pattern.search(key(names[-1])) for pattern in patterns)
    return MemoryTable(path.stem, table, says, path, tuple(inferences), choice.applied)


def _is_clock(name: str) -> bool:
    return any(pattern.search(key(split_unit(name)[0])) for pattern in vocabulary().time)


def ask_for_arrays(path: Path, question: Question) -> NoReturn:
    """Raise the question which episode, or which arrays of one length, are read."""
    values = [value for value, _ in question.choices]
    shown = ", ".join(values[:SHOWN]) + ", ..." * (len(values) > SHOWN)
    parts = f"{len(values)} episodes" if question.option == "episode" else f"arrays of {len(values)} lengths"
    if question.requested is not None:
        parts = f"no {question.option} {question.requested} among {parts}"
    hints = (Hint(question.option, value, f"reads {rows}") for value, rows in question.choices[:SHOWN])
    raise LogError(Finding(file=str(path), found=f"{parts}: {shown}", allowed="one", hints=tuple(hints)))
