"""What the user says about a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class ReadOptions:
    """What the user says about a log where the file need not, or cannot, tell.

    Attributes:
        source: Name of the source, as `source_names` lists them.
        delimiter: Sign between cells, or comma, semicolon, tab, spaces, bar.
        decimal: Decimal sign, or point, comma.
        time: Name or number (from 1) of the time column; "none" if there is none.
        joints: Names or numbers (from 1) of the joint columns, in the robot's order.
        units: Unit of a column by its name or number; by "" that of all joint columns that turn.
        period: Time between rows in [s], of a log without a time column.
        skip_bad: Leave out rows that cannot be read, up to one in a hundred; each is a warning.
    """

    source: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    time: str | None = None
    joints: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    period: float | None = None
    skip_bad: bool = False
