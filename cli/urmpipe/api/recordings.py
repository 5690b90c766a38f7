"""`urmpipe.read_recording` and `urmpipe.write_recording`: results as files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from urmpipe.parameters import kinds
from urmpipe.public_functions import PathLike, as_paths, public_function
from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_pipeline import results
from urmpipe_pipeline.presentation.result import Result


@public_function(path=kinds.RECORDING, lazy=kinds.FLAG)
def read_recording(path: PathLike, *, lazy: bool = False) -> Result:
    """Return the result that a recording holds: a Run, a Comparison, a Simulation, ...

    Args:
        path: A recording (.rrd) that urmpipe wrote.
        lazy: Whether arrays are read only when they are used, a slice of rows alone; the file must exist
            until then. They are used as arrays are, and `np.asarray` makes one of them.

    Raises:
        RecordingError: If it is no recording, was cut off, is not of urmpipe, or of another layout.
    """
    result: Result = results.read_recording(Path(path), lazy=lazy)
    return result


@public_function(output=kinds.RECORDING, inputs=kinds.PATHS, progress=kinds.PROGRESS)
def write_recording(
    result: Result,
    output: PathLike,
    *,
    inputs: Sequence[PathLike] = (),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write the recording of a result, read it back, and put it in its place.

    Args:
        result: What `ingest`, `compare`, `simulate` or `ik` returned.
        output: The recording (.rrd) to write; replaced if it is one of urmpipe's.
        inputs: Files that are never replaced.
        progress: Told the share of the recording that is written, 0..1.

    Returns:
        The file.

    Raises:
        OptionError: If it is no such result.
        OutputError: If it may not be written there, or did not read back as it was written.
    """
    if not results.is_result(result):
        allowed = "a result, such as a Run or a Comparison"
        raise OptionError(Finding(parameter="result", found=format_value(result), allowed=allowed))
    return results.write_recording(result, Path(output), as_paths(inputs), progress)
