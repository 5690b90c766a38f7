"""What is asked where columns do not tell what they are: first of all which are the joints."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.errors import Finding, LogError
from urmpipe_models.messages import Hint
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.tables.sniff import Layout

NAME_JOINTS = Hint("joints", None, "names the joint columns, in the robot's order")

MOST_ANSWERS = 3
"""Groups of columns that a question offers."""


def take(columns: Sequence[Column], does: str = "takes these") -> Hint:
    """Return the hint that takes columns as the joints."""
    return Hint("joints", [column.called for column in columns], does)


def which_joints(layout: Layout, found: str, groups: Sequence[Sequence[Column]]) -> LogError:
    """Return the question which columns are the joints, with the groups that they may be.

    Args:
        layout: The table.
        found: What was found, and why it does not tell.
        groups: Columns that may be all joints; the likeliest first.
    """
    different = list(dict.fromkeys(tuple(group) for group in groups if group))
    hints = (*map(take, different[:MOST_ANSWERS]), NAME_JOINTS)
    message = f"found {found}, allowed: columns that are known to be joints"
    return LogError(Finding(message, layout.file, layout.header_line, hints=hints))
