"""Text logs whose rows say what each value is: `Time: 0.015  q values: [0.1, 0.2]  mode=3`.

KUKA's FRI examples, console output and JSON lines are written so. The labels are learnt from the first rows:
the same ones, in the same order, stand in all of them. Lines with none of them are other messages.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.cells.cell import is_number
from urmpipe_pipeline.logs.tables.form import Form, spread_names, usual_length, words_around
from urmpipe_pipeline.logs.tables.sniff import SAMPLED_LINES, Layout
from urmpipe_pipeline.logs.tables.text import HeadLine, Segment, head_lines

_ARRAY = r"\[[^\[\]]*\]|\([^()]*\)"
_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|\.\d+)(?:[eE][-+]?\d+)?(?![\w.:]|\s*[:=])"
_WORD = r"\"[^\"]*\"|[^\s,;|\[\](){}\"]+"
_PAIR = re.compile(
    rf"""(?P<before>[\s,;|{{]*+["']?[^\W\d][^:=\[\](){{}}"',;|]{{0,200}}?["']?)
    (?: \s*+[:=]\s*+(?P<told>{_ARRAY}|{_NUMBER}|{_WORD})
      | \s*+(?P<array>{_ARRAY})
      | \s++(?P<number>{_NUMBER})
      | (?P<glued>[-+]?\d+\.\d+(?![\w.:]|\s*[:=])) )""",
    re.VERBOSE,
)
_TAIL = re.compile(r"[\s,;}]*\Z")
_BARE = re.compile(r"""[\s{},;|"':=]+|\b(?i:values?)\b""")

FEWEST_LABELS = 2
"""A line with one label may be anything."""


def sniff_labels(segment: Segment) -> Layout | None:
    """Return how a log with labels in its rows is written, as rows of plain cells; None if it has none."""
    lines = list(islice(head_lines(segment), SAMPLED_LINES))
    alike: dict[tuple[tuple[str, ...], str], list[HeadLine]] = {}
    for line in lines:
        if (found := _labels(line.text)) is not None:
            alike.setdefault(found, []).append(line)
    labelled = sum(map(len, alike.values()))
    if not alike or 2 * labelled < len(lines):
        return None
    (labels, tail), rows = max(alike.items(), key=lambda item: len(item[1]))
    return _layout(segment, lines, rows, labels, tail) if 2 * len(rows) >= labelled else None


def _labels(text: str) -> tuple[tuple[str, ...], str] | None:
    """Return the label before each value of a line, and what stands behind the last; None without labels."""
    labels, place = [], 0
    while match := _PAIR.match(text, place):
        start = next(match.start(group) for group in ("told", "array", "number", "glued") if match[group])
        labels.append(text[place:start].strip())
        place = match.end()
    tail = _TAIL.match(text, place)
    signed = any(label.endswith((":", "=")) for label in labels)
    if tail is None or not signed or len(labels) < FEWEST_LABELS:
        return None
    return tuple(labels), tail[0].strip()


def _layout(
    segment: Segment, lines: Sequence[HeadLine], rows: Sequence[HeadLine], labels: tuple[str, ...], tail: str
) -> Layout | None:
    """Return how rows with labels are written; a torn row may be the first, with some of the labels."""
    opening = next((sign for sign in "[(" if all(sign in row.text for row in rows)), "")
    names = tuple(_BARE.sub(" ", label).strip() for label in labels)
    form = Form(names, (0,) * len(names), ";", opening=opening, labels=labels, tail=tail)
    form = replace(form, words=words_around(row.text for row in rows))
    values = form.readable(row.text for row in rows)
    if not values:
        return None
    lengths = tuple(usual_length(row[j] for row in values) for j in range(len(names)))
    plain = [value for row in values for value in row if isinstance(value, str)]
    decimal = "," if any(is_number(v, ",") and not is_number(v, ".") for v in plain) else "."
    form = replace(form, lengths=lengths, decimal=decimal, opening=opening if any(lengths) else "")
    sample = form.sampled(form.readable(row.text for row in rows))
    if not sample or not any(is_number(cell, decimal) for cell in sample[0]):
        return None
    torn = (line for line in lines if not line.is_comment and form.labels_in(line.text) >= FEWEST_LABELS)
    first = next(torn, rows[0])
    shown = " ".join(label.strip(",;{ ") for label in labels)
    return Layout(
        segment=segment,
        delimiter=form.delimiter,
        decimal=decimal,
        names=tuple(spread_names(names, lengths)),
        units=(),
        header=first.number,
        first_line=first.number,
        offset=first.offset,
        sample=sample,
        inferences=(Inference("labels", shown, "they stand before the values of every row"),),
        form=form,
    )
