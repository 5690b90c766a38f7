"""Tables in long form: a column has the joint of each row, and the rows of one sample are its joints.

1. `find_long_form`, `require_long_form`: the column by its name and cells, and the sample of each row: rows
   one after another until a joint repeats, or rows of one time, in any order.
2. `pivot`: a table with a row per sample, in which VALUE of JOINT is the column VALUE.JOINT. A sample without
   a joint, with two rows of one, or with several times is an error with its line.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import is_missing, is_number, plain
from urmpipe_pipeline.logs.formats.log_table import MAX_FINDINGS, LogTable, capped
from urmpipe_pipeline.logs.formats.memory import JOINT, ROLE, UNIT, MemoryTable, to_log_table
from urmpipe_pipeline.logs.vocabulary import key, split_unit, vocabulary

LONG = "long"
MAX_NAMES = 40  # of joints in a column; no arm has more
MIN_COMPLETE = 0.5  # share of the samples with a row of each joint, below which the rows are not joints


class LongForm(NamedTuple):
    """How rows of joints make samples.

    Attributes:
        column: Index of the column with the joint of each row.
        names: Names of the joints, in the order of the file.
        joint: Joint of each row, from 0, shape (n,); -1 where it is missing.
        sample: Sample of each row, from 0, shape (n,).
    """

    column: int
    names: tuple[str, ...]
    joint: IntArray
    sample: IntArray

    @property
    def counts(self) -> IntArray:
        """Number of rows of each joint in each sample, shape (samples, joints)."""
        size, samples = len(self.names), int(self.sample.max()) + 1
        cells = (self.sample * size + self.joint)[self.joint >= 0]
        return np.asarray(np.bincount(cells, minlength=samples * size).reshape(samples, size))

    def describe(self, table: LogTable) -> str:
        """Return why the rows are joints."""
        count = format_count(len(self.counts), "sample")
        return f"{table.names[self.column]} has the joint of each row: {len(self.names)} joints, {count}"

    @property
    def complete(self) -> float:
        """Share of the samples that have one row of each joint; 0 if there are too few or too many names."""
        are_joints = 2 <= len(self.names) <= MAX_NAMES
        return float((self.counts == 1).all(axis=1).mean()) if are_joints else 0.0


def find_long_form(table: LogTable) -> LongForm | None:
    """Return how the rows of a table make samples, if a column is called like the joint of a row.

    At least half of the samples are complete, and no other columns are numbered like joints; else None.
    """
    labels, words = _labels(table), vocabulary()
    numbered = [label for label in labels if re.search(r"\d", label)]
    has_joints = sum(_matches(label, words.joint["position"]) for label in numbered) > 1
    if table.header is None or has_joints or not _value_columns(table):
        return None
    is_path = sum(_matches(label, words.tcp_position) for label in labels) > 2
    for column in _name_columns(table):
        form, is_text = _group_rows(table, column), column not in table.numeric_columns
        are_joints = "joint" in labels[column] or (not is_path and all(map(_is_joint, form.names)))
        is_list = is_text or (form.sample.any() and "".join(form.names).isdigit())  # else they are values
        if are_joints and is_list and form.complete >= MIN_COMPLETE:
            return form
    return None


def require_long_form(table: LogTable) -> LongForm:
    """Return how the rows of a table make samples, as an option states that they do."""
    called = _name_columns(table) if table.header is not None else []
    texts = [k for k in range(len(table.names)) if k not in (*table.numeric_columns, *called)]
    forms = [_group_rows(table, column, is_given=True) for column in (*called, *texts)]
    best = max(forms, key=lambda form: form.complete, default=None)  # the first of equals
    if best is None or not best.complete or not _value_columns(table):
        allowed = f"with layout {LONG} a column with the joint of each row, and one of its values"
        raise LogError(Finding(file=table.file, found=", ".join(table.names), allowed=allowed))
    return best


def _labels(table: LogTable) -> list[str]:
    return [key(split_unit(name)[0]) for name in table.names]


def _matches(label: str, patterns: Iterable[re.Pattern[str]]) -> bool:
    return any(pattern.search(label) for pattern in patterns)


def _name_columns(table: LogTable) -> list[int]:
    """Return the columns that are called like the joint of a row, those of texts first."""
    called = [k for k, label in enumerate(_labels(table)) if _matches(label, vocabulary().joint_of_row)]
    return sorted(called, key=lambda column: column in table.numeric_columns)


def _value_columns(table: LogTable) -> list[int]:
    """Return the columns of numbers that joints have; of a sample are times, counters and episodes."""
    labels, words = _labels(table), vocabulary()
    of_sample = (*words.time, *words.dates, *words.index, *words.joint_of_row)
    numeric = table.numeric_columns
    return [k for k in numeric if not (_matches(labels[k], of_sample) or labels[k] in words.episode)]


def _is_joint(name: str) -> bool:
    """Return whether a text is called like a joint: joint_1, A1, 1, shoulder_pan, gripper."""
    text, words = key(name), vocabulary()
    known = {*words.grippers, *(each for order in words.orders for each in order)}
    is_known = any(f"_{each}_" in f"_{text}_" for each in known)
    return is_known or "joint" in text or _matches(text, words.joint["position"])


def _group_rows(table: LogTable, column: int, *, is_given: bool = False) -> LongForm:
    """Return samples: rows one after another until a joint repeats, or else the rows of one time or number.

    Joints one after another, without a time, are samples only if the layout is given.
    """
    cells, labels, words = table.texts(column), _labels(table), vocabulary()
    names = tuple(name for name in dict.fromkeys(cells) if not is_missing(name))
    number, size = {name: k for k, name in enumerate(names)}, len(names)
    joint = np.array([number.get(cell, -1) for cell in cells])
    sample, seen = list[int](), set[int]()
    for k in joint.tolist():
        is_next = k in seen or len(seen) == size
        seen = {k} if is_next else seen | {k}
        sample.append((sample[-1] if sample else 0) + is_next)
    form = LongForm(column, names, joint, np.array(sample))
    if form.complete == 0.0 and not 2 <= size <= MAX_NAMES:
        return form
    times = [k for k, label in enumerate(labels) if _matches(label, (*words.time, *words.dates))]
    counters = [[k] for k, label in enumerate(labels) if label and _matches(label, words.index)]
    groups = [_number_rows(table, group) for group in (times, *counters) if group]
    if form.complete == 1.0 and (not times or (groups[0] == np.repeat(groups[0][::size], size)).all()):
        return form
    starts = np.flatnonzero(np.diff(joint, prepend=-1))
    if is_given and not groups and len(starts) == size:
        return form._replace(sample=np.arange(len(joint)) - starts[joint])
    best = max((form._replace(sample=group) for group in groups), key=lambda f: f.complete, default=form)
    return form if is_given and not best.complete else best


def _number_rows(table: LogTable, columns: Sequence[int]) -> IntArray:
    """Return the number of the group of each row, shape (n,): rows with the same cells are a group."""
    number: dict[tuple[str, ...], int] = {}
    cells = zip(*map(table.texts, columns), strict=True)
    return np.array([number.setdefault(row, len(number)) for row in cells])


def pivot(table: LogTable, form: LongForm, why: str, *otherwise: Hint) -> LogTable:
    """Return a table with a row per sample: numbers as VALUE.JOINT, what the rows of a sample share as it is.

    Raises:
        LogError: If a cell holds no number, or a sample is not complete or has several times.
    """
    values = _value_columns(table)
    if (numbers := table.read(values)).findings:
        raise LogError(*numbers.findings)
    _check_samples(table, form)
    order = np.empty_like(form.counts)
    order[form.sample, form.joint] = np.arange(len(form.joint))
    labels, words = _labels(table), vocabulary()
    columns: dict[pa.Field, pa.Array] = {}
    for k in (k for k in range(len(labels)) if k not in (form.column, *values)):
        cells = np.array(table.texts(k), dtype=object)[order]
        differing = np.flatnonzero((cells != cells[:, :1]).any(axis=1))
        if not len(differing):
            texts = [_to_text(cell, table.decimal) for cell in cells[:, 0]]
            columns[_field(table, k)] = pa.array(texts, pa.string())
        elif _matches(labels[k], (*words.time, *words.dates)):
            message = "found several times in a sample, allowed: one for all joints"
            raise LogError(_row_finding(table, int(order[differing[0]].min()), message, k))
        else:
            why = f"{why}; {table.names[k]} differs among them: left out"
    positions = [k for k in values if _may_be_position(table, k)]
    for place, k in enumerate(values):
        for joint, name in enumerate(form.names):
            field = _field(table, k, name, is_joint=positions == [k])
            columns[field] = pa.array(numbers.values[order[:, joint], place])
    arrow = pa.Table.from_arrays(list(columns.values()), schema=pa.schema(list(columns)))
    earlier = (known for known in table.inferences if known.what != "header")
    inferences = (*earlier, Inference("layout", LONG, why, hints=otherwise))
    return replace(to_log_table(MemoryTable(table.path.stem, arrow, path=table.path)), inferences=inferences)


def _check_samples(table: LogTable, form: LongForm) -> None:
    """Raise a `LogError` with each sample that lacks a joint, or has two rows of one."""
    counts, findings = form.counts, list[Finding]()
    for sample in np.flatnonzero((counts != 1).any(axis=1))[: MAX_FINDINGS + 1].tolist():
        parts = []
        for word, is_wrong in (("without", counts[sample] == 0), ("with two rows of", counts[sample] > 1)):
            names = ", ".join(form.names[k] for k in np.flatnonzero(is_wrong))
            parts += [f"{word} {names}"] if names else []
        message = (
            f"found a sample {' and '.join(parts)}, allowed: one row of each of {len(form.names)} joints"
        )
        first = int(np.flatnonzero(form.sample == sample)[0])
        findings.append(_row_finding(table, first, message, form.column))
    if findings:
        raise LogError(*capped(findings, table.file))


def _row_finding(table: LogTable, row: int, message: str, column: int) -> Finding:
    line = table.lines_of([row + 1]).get(row + 1)
    return Finding(message, table.file, line, table.file_row(row + 1), table.names[column])


def _to_text(cell: str, decimal: str) -> str | None:
    """Return a cell as tables in memory have it, with all its digits."""
    return None if is_missing(cell) else plain(cell, decimal) if is_number(cell, decimal) else cell


def _unit_of(table: LogTable, column: int) -> str:
    """Return the unit of a column as the file has it, below its name or in it; empty without one."""
    below = table.units[column].strip("[]() ") if column < len(table.units) else ""
    return below or split_unit(table.names[column])[1] or ""


def _field(table: LogTable, column: int, joint: str = "", *, is_joint: bool = False) -> pa.Field:
    """Return the field of a column, or of a joint's values in it, with its unit and role as metadata."""
    name, unit = table.names[column], _unit_of(table, column)
    if joint:
        is_known = not unit or vocabulary().unit(unit) is not None
        name = f"{split_unit(name)[0]}.{joint}" + ("" if is_known else f" [{unit}]")
    metadata = ({UNIT: unit} if unit else {}) | ({ROLE: JOINT} if is_joint else {})
    return pa.field(name, pa.float64() if joint else pa.string(), metadata=metadata)


def _may_be_position(table: LogTable, column: int) -> bool:
    """Return whether name and unit of a column may be those of joint positions."""
    words, unit = vocabulary(), vocabulary().unit(_unit_of(table, column))
    not_positions = words.other.union(*(words.joint_terms[role] for role in ("rate", "acceleration")))
    is_size = unit is None or (unit.quantity in ("angle", "length") and not unit.order)
    return is_size and not {*_labels(table)[column].split("_")} & not_positions
