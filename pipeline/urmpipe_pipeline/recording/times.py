"""The time columns of everything that is sent to a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

from urmpipe_pipeline.joint_log import IntArray

if TYPE_CHECKING:
    from rerun import TimeColumn


def time_columns(
    t_ns: IntArray, name: str | None = None, numbers: IntArray | None = None
) -> list[TimeColumn]:
    """Return the time columns: t in integer [ns], and a sequence if one is named.

    Rerun truncates seconds given as floats, which puts some times off by a nanosecond; integers are exact.
    """
    import rerun as rr

    columns = [rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))]
    if name is not None and numbers is not None:
        columns.append(rr.TimeColumn(name, sequence=numbers))
    return columns
