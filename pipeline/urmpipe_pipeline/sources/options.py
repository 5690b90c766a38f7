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
        interval: LOW, HIGH of the interval to which the environment limits a joint, by its name; by "" that
            of all joints that turn; in the file's own unit.
        repair: Whether samples that a linear resampling left on a wrap are put on the line through their
            neighbours.
    """

    source: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    time: str | None = None
    joints: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    period: float | None = None
    interval: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    repair: bool = False
