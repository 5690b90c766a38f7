"""`urmpipe.read_map`: how to read logs, as a file says it."""

from __future__ import annotations

from pathlib import Path

from urmpipe.parameters import kinds
from urmpipe.public_functions import PathLike, public_function
from urmpipe_pipeline import logs
from urmpipe_pipeline.logs import LogMap


@public_function(path=kinds.MAP_FILE)
def read_map(path: PathLike) -> LogMap:
    """Return a map (TOML): how to read a log, and its `robot`, `base` and `tool`.

    Args:
        path: The file.

    Raises:
        OptionError: With everything that is wrong with it.
    """
    return logs.read_map(Path(path))
