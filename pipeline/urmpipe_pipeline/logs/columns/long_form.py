"""Tables with a row a joint, in long form: which names stand in a column beside the values."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.errors import Finding, Hint, LogError, python_command
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.tables.sniff import Layout

MOST_NAMES = 40
"""More names than this that come again and again are hardly those of joints."""


def refuse_long_form(
    joints: Sequence[Column], columns: Sequence[Column], clock: Sequence[Column], layout: Layout
) -> None:
    """Raise if a table has a row a joint: a column beside its only joint goes round the same names.

    Args:
        joints: The joints that were found.
        columns: The columns beside the clock.
        clock: Those of the clock.
        layout: How the table is written.

    Raises:
        LogError: With the command that makes a row a sample of it.
    """
    if len(joints) != 1 or layout.header is None:
        return
    others = [column for column in columns if column not in joints]
    names = [column for column in others if _goes_round(layout.cells(column.index))]
    if not names:
        return
    found = f"one row per joint: {names[0].header} goes round {len(set(layout.cells(names[0].index)))} names"
    hints = () if len(clock) != 1 else (Hint("", effect=_command(joints[0], names[0], clock[0], layout)),)
    raise LogError(Finding(file=layout.file, found=found, allowed="one row per sample", hints=hints))


def _goes_round(cells: Sequence[str]) -> bool:
    """Return whether cells go through the same few texts again and again, in one order."""
    count = len(set(cells))
    if not 2 <= count <= MOST_NAMES or len(cells) < 3 * count:
        return False
    whole = all(not cell or not cell[0].isdigit() or cell.isdigit() for cell in cells[:count])
    return whole and all(cell == cells[k % count] for k, cell in enumerate(cells))


def _command(joint: Column, name: Column, time: Column, layout: Layout) -> str:
    """Return the command that writes such a table with a column a joint."""
    kind = "parquet" if layout.held is not None else "csv"
    sign = "" if layout.held is not None or layout.delimiter == "," else f", sep={layout.delimiter!r}"
    comma = ", decimal=','" if layout.decimal == "," else ""
    turned = f"index={time.header!r}, columns={name.header!r}, values={joint.header!r}"
    read = f"pandas.read_{kind}({layout.segment.path.name!r}{sign}{comma})"
    return python_command(f"import pandas; {read}.pivot({turned}).to_csv('table.csv')")
