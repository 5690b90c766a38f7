"""`urmpipe.view`: recordings in the viewer, at their worst sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from urmpipe.keyword_checks import PathLike, one_or_many, public, refuse_others


@public
def view(recordings: PathLike | Sequence[PathLike]) -> None:
    """Open recordings in the viewer, each in a window paused at its worst sample; return when all are closed.

    Args:
        recordings: Recordings (.rrd) that urmpipe wrote.

    Raises:
        UrmpipeError: With every file that is no recording, or if the viewer cannot be shown here.
    """
    from urmpipe_pipeline.recording.viewer import view_recordings

    given = one_or_many(recordings)
    refuse_others("recordings", given, (), "recordings (.rrd): the `recording` of a result is its file")
    view_recordings([Path(one) for one in given])
