"""`urmpipe.read_recording` and `urmpipe.write_recording`: results as files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from urmpipe.edge import public
from urmpipe.guards import PathLike, paths
from urmpipe_models.errors import OptionError, shown
from urmpipe_pipeline import recording
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation


@public
def read_recording(path: PathLike) -> Result:
    """Return the run, the comparison or the simulation that a recording holds.

    Args:
        path: A recording (.rrd) that urmpipe wrote.

    Raises:
        RecordingError: If it is no recording, was cut off, is not of urmpipe, or of a newer layout.
    """
    return recording.read_recording(Path(path))


@public
def write_recording(
    result: Result,
    output: PathLike,
    *,
    inputs: Sequence[PathLike] = (),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write the recording of a result, read it back, and put it in its place.

    Args:
        result: What `ingest`, `compare` or `simulate` returned.
        output: The recording (.rrd) to write; replaced if it is one of urmpipe's.
        inputs: Files that are never replaced.
        progress: Told the share of the recording that is written, 0..1.

    Returns:
        The file.

    Raises:
        OptionError: If it is no such result.
        OutputError: If it may not be written there, or did not read back as it was written.
    """
    if not isinstance(result, (Run, Comparison, Simulation)):
        allowed = "a Run, a Comparison or a Simulation; `ik` writes its own (output=FILE.rrd)"
        raise OptionError(f"result: found {shown(result)}, allowed: {allowed}")
    return recording.write_recording(result, Path(output), paths(inputs), progress)
