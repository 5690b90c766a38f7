"""What reading options call the columns of a log."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_pipeline.joint_log import LogColumn
from urmpipe_pipeline.sources.vocabulary import split_unit


def joint_names(columns: Sequence[LogColumn]) -> list[str]:
    """Return what `joints` calls some columns, in order: their names, or numbers where names do not tell."""
    names = [split_unit(column.header)[0] if column.header else "" for column in columns]
    told = [name if name and "," not in name and names.count(name) == 1 else "" for name in names]
    return [name or str(column.number) for name, column in zip(told, columns, strict=True)]
