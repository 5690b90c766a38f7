"""Time: the offset between the clocks of two logs of one motion."""

from __future__ import annotations

from typing import Literal, TypeAlias

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.comparison import Sync, Trajectory

SyncOption: TypeAlias = Literal["start", "auto"] | float

LONGEST_OFFSET = 1e9
"""Offset in [s] that integers of 64 bits in [ns] hold beside any time of a log: 30 years."""


def check_sync(option: SyncOption) -> None:
    """Raise an `OptionError` if there is no such way to put clocks together."""
    if isinstance(option, str):
        if option in ("start", "auto"):
            return
    elif abs(option) < LONGEST_OFFSET:
        return
    raise OptionError(
        f"--sync: found {option}, allowed: start, auto, or a time in s below {LONGEST_OFFSET:g}"
    )


def synchronise(reference: Trajectory, log: Trajectory, option: SyncOption) -> Sync:
    """Return how the clocks of a log and the reference are put together.

    Args:
        reference: What was asked for.
        log: What was done.
        option: start, auto, or the offset in [s]: t_reference = t_log + offset.
    """
    if option == "auto":
        raise NotImplementedError
    if option == "start":
        return Sync()
    return Sync("given", float(option))
