"""Space: moving a log so that what remains is what the question is about."""

from __future__ import annotations

from typing import get_args

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.comparison import Alignment, AlignMode
from urmpipe_pipeline.matching import Matched

ALIGN_MODES: tuple[AlignMode, ...] = get_args(AlignMode)


def check_align(mode: str) -> None:
    """Raise an `OptionError` if there is no such alignment."""
    if mode not in ALIGN_MODES:
        raise OptionError(f"--align: found {mode}, allowed: {', '.join(ALIGN_MODES)}")


def align(matched: Matched, mode: AlignMode, name: str) -> tuple[Alignment, Matched]:
    """Return how the log is moved in space, and both sides with the log so moved.

    Args:
        matched: Both sides at the same times.
        mode: none, start, rigid or tool.
        name: The log's name, for messages.
    """
    if mode != "none":
        raise NotImplementedError
    return Alignment(), matched
