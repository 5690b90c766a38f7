"""Output files of a public function: checked before the work, written to parts, renamed all or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import urmpipe
from urmpipe import __version__
from urmpipe.public_functions import PathLike
from urmpipe_models.errors import Finding, OptionError, format_value, map_collecting_errors
from urmpipe_pipeline.outputs import (
    DRAWING_HEADER,
    OUTPUT_RULES,
    OutputKind,
    atomic_group,
    check_output,
    safe_output,
)
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.recording import preload_writer
from urmpipe_pipeline.results import write_recording

AnyResult = TypeVar("AnyResult", bound=Result)


class Outputs:
    """The output files of a public function, none of which has its name yet."""

    def __init__(self, named: Mapping[OutputKind, Path], inputs: Sequence[Path]) -> None:
        self._named = named
        self._inputs = inputs

    def write(self, kind: OutputKind, write: Callable[[Path, Path], object]) -> None:
        """Write the file of a kind, if it is requested.

        Args:
            kind: The kind.
            write: Writes to its first argument; its second is the name that the file will have.

        Raises:
            OutputError: If it cannot be written.
        """
        path = self._named.get(kind)
        if path is not None:
            with safe_output(path, self._inputs, kind) as part:
                write(part, path)

    def recorded(self, result: AnyResult, progress: Callable[[float], None] | None) -> AnyResult:
        """Return a result with the path of its written recording; unchanged if none is requested.

        Args:
            result: The result to record.
            progress: Called with the written share of the recording, 0..1.

        Raises:
            OutputError: If it cannot be written, or differs when it is read back.
        """
        path = self._named.get("recording")
        if path is None:
            return result
        recording = write_recording(result, path, self._inputs, progress)
        return replace(result, recording=recording)  # type: ignore[type-var]


@contextmanager
def guarded_outputs(named: Mapping[OutputKind, PathLike | None], inputs: Sequence[Path]) -> Iterator[Outputs]:
    """Let the body write its outputs, and give them their names once all are written: all or none.

    Args:
        named: The requested files by kind; None for one that is not requested.
        inputs: Files that are never replaced.

    Raises:
        OptionError: If two outputs have one name.
        OutputError: With all outputs that may not be written; if one cannot be written.
    """
    targets = {kind: Path(path) for kind, path in named.items() if path is not None}
    kinds: dict[Path, OutputKind] = {}
    for kind, path in targets.items():
        other = kinds.setdefault(path.resolve(), kind)
        if other != kind:
            raise OptionError(f"found {path} as {other} and as {kind}; allowed: a name for each")
    map_collecting_errors(lambda target: check_output(target[1], inputs, target[0]), targets.items())
    if "recording" in targets:
        preload_writer(pandas=not urmpipe.is_command_process)
    with atomic_group():
        yield Outputs(targets, inputs)


def write_drawing(part: Path, svg: str) -> None:
    """Write a drawing with a mark that identifies it as one of urmpipe."""
    header = "" if svg.startswith(DRAWING_HEADER) else f"{DRAWING_HEADER}{__version__} -->\n"
    part.write_text(header + svg, encoding="utf-8", newline="\n")


def output_kind(output: Path | None, log: OutputKind) -> OutputKind | None:
    """Return the kind of an output by its suffix: a recording, or a log of the given kind; None without one.

    Raises:
        OptionError: If it has another suffix.
    """
    if output is None:
        return None
    kind = {".csv": log, ".rrd": "recording"}.get(output.suffix.lower())
    if kind is None:
        allowed = f"a name that ends in .csv (a {OUTPUT_RULES[log].noun}) or .rrd (a recording)"
        raise OptionError(Finding(parameter="output", found=format_value(str(output)), allowed=allowed))
    return kind
