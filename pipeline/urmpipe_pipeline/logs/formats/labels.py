"""Text logs whose rows say what each value is: `Time: 0.015  q values: [0.1, 0.2]  mode=3`.

KUKA's FRI examples, console output and JSON lines are written so. The labels are learnt from the first rows:
the same ones, in the same order, stand in all of them. Lines with none of them are other messages.

Merge conflicts: the markers that git leaves in a file whose versions it could not merge.

    <<<<<<< HEAD            one version begins
    ||||||| 3f07bf4         what both began from (git's styles diff3 and zdiff3)
    =======                 the other version
    >>>>>>> branch          it ends

They are looked for in the whole file before anything else is: a header may stand between them, and the rows
of two versions may go on from one another as one motion.

`ros2 topic echo --csv /joint_states`: a table without header whose rows name the joints themselves.

Source: rosidl_runtime_py, message_to_csv: the fields of sensor_msgs/JointState in order, arrays spread over
cells, an empty array as one empty cell: seconds, nanoseconds, frame, names, positions, velocities, efforts.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, takewhile

from urmpipe_models.errors import Finding, LogError, format_value
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import is_number, is_text, printable
from urmpipe_pipeline.logs.formats.form import Form, spread_names, usual_length, words_around
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS
from urmpipe_pipeline.logs.formats.numbers import capped
from urmpipe_pipeline.logs.formats.text import HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable

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


def sniff_labels(segment: Segment) -> TextTable | None:
    """Return how a log with labels in its rows is written, as rows of plain cells; None if it has none."""
    lines = list(islice(head_lines(segment), MAX_SAMPLED_ROWS))
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
) -> TextTable | None:
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
    return TextTable(
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


_READ_BYTES = 1 << 20
_WIDTH = 7
_MEANING = {
    "<": "the beginning of a merge conflict",
    "|": "the common ancestor in a merge conflict",
    "=": "the middle of a merge conflict",
    ">": "the end of a merge conflict",
}
_AROUND = r"[\s,;|\"]*"  # what spreadsheets and editors put around a line
_MARKER = re.compile(
    rf"(?:[\s,;\"]*|{_AROUND}(?!\|))(?P<text>(?:(?P<comment>[#%/]+)\s*)?"
    rf"(?P<run>(?P<sign>[<|=>])(?P=sign){{6,}})(?!(?P=sign))"  # in one way: rows may begin with many bars
    rf"(?P<label>[\s,;].*[^<>\s,;|\"])?){_AROUND}"
)
"""A line that may be a marker; a label with an angle at its end is an ornament: # >>>>>>> LOG <<<<<<<"""


@dataclass(frozen=True, slots=True)
class Marker:
    """A line that may be a marker of a merge conflict.

    Attributes:
        line: Line of the file, from 1.
        text: What stands there.
        sign: What it consists of: <, |, = or >.
        certain: Whether it is one wherever it stands. A line of = may underline a title, one of | be a row
            of empty cells, and a longer one an ornament: they are markers within a conflict.
        is_comment: Whether it stands in a comment.
    """

    line: int
    text: str
    sign: str
    certain: bool
    is_comment: bool

    def finding(self, file: str) -> Finding:
        """Return it as a finding."""
        found = f"{format_value(self.text)}, {_MEANING[self.sign]}"
        return Finding(file=file, line=self.line, found=found, allowed="one version, without git's markers")


def refuse_conflict(segment: Segment) -> list[Marker]:
    """Return the lines of a file that are markers if they stand among its rows: single lines of =.

    Raises:
        LogError: If there is a merge conflict, or what is left of one, with all markers.
    """
    if not _may_hold_markers(segment):
        return []
    markers = [marker for line, text in segment.lines() if (marker := _marker(line, text))]
    certain = [k for k, marker in enumerate(markers) if marker.certain]
    if not certain:
        return [one for one in markers if one.sign == "=" and not one.is_comment and len(one.text) == _WIDTH]
    first = certain[0] if markers[certain[0]].sign == "<" else 0
    end = certain[-1] + 1 if markers[certain[-1]].sign == ">" else len(markers)
    raise _error(segment, markers[first:end])


def refuse_among_rows(layout: TextTable, markers: Sequence[Marker]) -> None:
    """Raise a `LogError` if lines that may be markers stand below the first row of a table."""
    among = [marker for marker in markers if marker.line >= layout.first_line]
    if among:
        raise _error(layout.segment, among)


def _error(segment: Segment, markers: Sequence[Marker]) -> LogError:
    file = str(segment.path)
    return LogError(*capped([marker.finding(file) for marker in markers], file))


def _marker(line: int, text: str) -> Marker | None:
    """Return what a line is, if it may be a marker."""
    match = _MARKER.fullmatch(text)
    if match is None or (match["sign"] == "=" and match["label"]):
        return None
    label = match["label"] or ""
    named = match["sign"] in "<>" or any(map(str.isalpha, label))
    plain = not match["comment"] or bool(label)
    certain = len(match["run"]) == _WIDTH and match["sign"] != "=" and named and plain
    return Marker(line, match["text"], match["sign"], certain, bool(match["comment"]))


def _may_hold_markers(segment: Segment) -> bool:
    """Return whether a sign of a marker stands seven times on end anywhere: quickly, most files have none.

    In numbers none of the signs stands at all, which is seen faster than that seven are missing.
    """
    marks = [(sign.encode(), (sign * _WIDTH).encode(segment.encoding)) for sign in _MEANING]
    longest, end = max(len(mark) for _, mark in marks), b""
    with segment.open() as file:
        while read := file.read(_READ_BYTES):
            wanted = [mark for sign, mark in marks if sign in read]
            block = end + read if wanted else b""
            if any(mark in block for mark in wanted):
                return True
            end = block[1 - longest :]
    return False


_FIRST_NAME = 3


def with_names(layout: TextTable) -> TextTable:
    """Return the layout with names for its columns if most rows are those of such a table, else as it is.

    Raises:
        LogError: If rows of several publishers, each with joints of its own, stand in one file.
    """
    if layout.header is not None:
        return layout
    found = [_names(row, layout.decimal) for row in layout.sample]
    usual = max(filter(None, found), key=found.count, default=())
    _refuse_other_publishers(layout, found, usual)
    joints = tuple(map(printable, usual))
    if not joints or len(set(joints)) < len(joints) or 2 * found.count(usual) <= len(found):
        return layout
    count, row = len(joints), layout.sample[found.index(usual)]
    velocity = _FIRST_NAME + 2 * count
    has_rates = row[velocity : velocity + 1] != ("",)
    full = {
        2 * count: (True, True, True),
        count + 1: (True, has_rates, not has_rates),
        2: (True, False, False),
    }.get(len(row) - velocity)
    if full is None:
        return layout
    names = ["sec", "nanosec", "frame_id", *(f"name.{joint}" for joint in joints)]
    for group, spread in zip(("position", "velocity", "effort"), full, strict=True):
        names += [f"{group}.{joint}" for joint in joints] if spread else [f"{group}."]
    said = Inference("header", "none", "seconds, nanoseconds and names of joints, as ros2 topic echo writes")
    kept = tuple(inference for inference in layout.inferences if inference.what != "header")
    return replace(layout, names=tuple(names), header=layout.first_line, inferences=(*kept, said))


def _names(row: Sequence[str], decimal: str) -> tuple[str, ...]:
    """Return the texts behind a stamp, none if the row does not begin with one."""
    if len(row) < _FIRST_NAME + 4 or not (row[0].isdecimal() and row[1].isdecimal() and int(row[1]) < 10**9):
        return ()
    return tuple(takewhile(lambda cell: is_text(cell, decimal), row[_FIRST_NAME:]))


def _refuse_other_publishers(
    layout: TextTable, found: Sequence[tuple[str, ...]], usual: tuple[str, ...]
) -> None:
    """Raise at the first row with other names than the usual ones; a text where a number belongs is none."""
    for row, names in enumerate(found, start=1):
        if names and names[: len(usual)] != usual:
            listed, wanted = (", ".join(map(printable, group)) for group in (names, usual))
            message = f"found a row with the joints {listed} among rows with {wanted}, allowed: one publisher"
            line = layout.lines_of([row]).get(row)
            raise LogError(Finding(f"{message}; keep the rows of one of them", layout.file, line, row))
