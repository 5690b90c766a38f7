"""Options as a person may paste them into a shell."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.spelling import pasted
from urmpipe_pipeline.joint_log import LogColumn
from urmpipe_pipeline.sources.vocabulary import split_unit


def option(name: str, value: str) -> str:
    """Return an option with its value, quoted where a shell would part it: --unit 'q 1=deg'."""
    return f"{name} {pasted(value)}"


def joints_option(columns: Sequence[LogColumn]) -> str:
    """Return --joints with some columns in their order, by name or, where that does not tell, number."""
    names = [split_unit(column.header)[0] if column.header else "" for column in columns]
    told = [name if name and "," not in name and names.count(name) == 1 else "" for name in names]
    numbers = (str(column.number) for column in columns)
    return option("--joints", ",".join(map(lambda name, number: name or number, told, numbers)))
