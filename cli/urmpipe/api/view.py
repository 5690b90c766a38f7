"""`urmpipe.view`: recordings in the viewer, at their worst sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from urmpipe.public_functions import PathLike, as_list, check_types, public_function


@public_function()
def view(recordings: PathLike | Sequence[PathLike]) -> None:
    """Open recordings in the viewer, each in a window paused at its worst sample; return when all are closed.

    Args:
        recordings: Recordings (.rrd) that urmpipe wrote.

    Raises:
        UrmpipeError: With every file that is no recording, or if the viewer cannot be shown here.
    """
    from urmpipe_pipeline.recording.viewer import view_recordings

    files = as_list(recordings)
    check_types("recordings", files, (), "recordings (.rrd): the `recording` of a result is its file")
    view_recordings([Path(file) for file in files])
