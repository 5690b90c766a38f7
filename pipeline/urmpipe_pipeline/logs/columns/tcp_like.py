"""Columns that look like a recorded tool centre point and were not read as one."""

from __future__ import annotations

import re
from collections.abc import Sequence

from urmpipe_models.display import format_count
from urmpipe_models.errors import Hint
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.columns.columns import Column, listed
from urmpipe_pipeline.logs.columns.families import find_families, prefer_measured
from urmpipe_pipeline.logs.columns.pose import odd_rows
from urmpipe_pipeline.logs.columns.questions import take
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.vocabulary import vocabulary

TCP_NOT_READ = "tcp-not-read"

_NEAR = re.compile(r"(tcp|tpc|ctp|tool|tip|eef|endeff|werkzeug)|(?:^|_)ee(?:_|$)")
"""Words for a tool centre point, misspelled ones among them, anywhere in a name."""

_ENTRY = re.compile(r"[xyz\d]$")
"""How the name of an entry of a point ends."""

_TORQUES = re.compile(r"[tp]_?[xyz]")
"""Names of a position that forces beside them make torques."""

_BESIDE = frozenset({"analog", "digital", "input", "output", "in", "out", "bits", "offset", "payload"})
"""Words of what a tool has besides its place."""


def about_tcp(rest: Sequence[Column]) -> list[LogWarning]:
    """Return a warning if two columns or more look like a tool centre point."""
    alike = [column for column in rest if _is_like(column)]
    if len(alike) < 2:
        return []
    said = f"{listed(alike)} look like a recorded TCP and are not read as one"
    hints = (
        Hint("", effect="name its columns tcp_x, tcp_y, tcp_z"),
        take(alike, "takes them", parameter="position")
        if len(alike) == 3
        else Hint("position", None, "names them"),
    )
    return [LogWarning(TCP_NOT_READ, said, hints=hints)]


def about_odd_rows(rest: Sequence[Column], layouts: Sequence[Layout]) -> list[LogWarning]:
    """Return a warning for columns that are called as a matrix, and are one but for a few rows."""
    for family in prefer_measured(find_families(rest, vocabulary().tcp_matrix, 0)):
        columns = family.ordered()
        if len(columns) in (9, 12, 16) and (rows := odd_rows(columns, layouts)):
            found = (
                f"{listed(columns, most=4)} hold no orientation in {format_count(len(rows), 'row')}, first in"
            )
            hints = (Hint("", effect="correct the row, or leave these cells empty"),)
            return [LogWarning(TCP_NOT_READ, f"{found} this one: none is read", rows[0], hints=hints)]
    return []


def _is_like(column: Column) -> bool:
    """Return whether the name of a column is that of a position, or near to one."""
    words = vocabulary()
    subject = {"tcp", "tool", "pose", "cartesian"}
    others = words.other - subject | words.joint_words["rate"] | words.joint_words["acceleration"]
    if column.words & (others | _BESIDE) or (column.unit and column.unit.quantity != "length"):
        return False
    named = any(pattern.search(column.key) for pattern in words.tcp_position)
    near = bool(_NEAR.search(column.key) and _ENTRY.search(column.key))
    return (named and not _TORQUES.fullmatch(column.key)) or near
