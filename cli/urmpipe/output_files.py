"""Files that a public function writes beside its result: guarded, all or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from urmpipe import __version__
from urmpipe.keyword_checks import PathLike
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

Made = TypeVar("Made", bound=Result)


class Outputs:
    """The files that a public function writes beside its result, none of which has its name yet."""

    def __init__(self, named: Mapping[OutputKind, Path], inputs: Sequence[Path]) -> None:
        self._named = named
        self._inputs = inputs

    def write(self, kind: OutputKind, write: Callable[[Path, Path], object]) -> None:
        """Write the file of a kind, if it was asked for.

        Args:
            kind: Which.
            write: Writes to its first argument what is to stand in the second.

        Raises:
            OutputError: If it could not be written.
        """
        path = self._named.get(kind)
        if path is not None:
            with safe_output(path, self._inputs, kind) as part:
                write(part, path)

    def recorded(self, result: Made, progress: Callable[[float], None] | None) -> Made:
        """Return a result with the recording that was written of it; as it is if none was asked for.

        Args:
            result: What to record.
            progress: Told the share of the recording that is written, 0..1.

        Raises:
            OutputError: If it could not be written, or did not read back as it was written.
        """
        path = self._named.get("recording")
        if path is None:
            return result
        written = write_recording(result, path, self._inputs, progress)
        return replace(result, recording=written)  # type: ignore[type-var]


@contextmanager
def guarded_outputs(named: Mapping[OutputKind, PathLike | None], inputs: Sequence[Path]) -> Iterator[Outputs]:
    """Let the body write its outputs, and give them their names once all are written: all or none.

    Args:
        named: The files that are asked for, by kind; None for one that is not.
        inputs: Files that are never replaced.

    Raises:
        OptionError: If two outputs have one name.
        OutputError: With all that may not be written where it is asked for; if one cannot be written.
    """
    targets = {kind: Path(path) for kind, path in named.items() if path is not None}
    _refuse_shared(targets)
    map_collecting_errors(lambda one: check_output(one[1], inputs, one[0]), targets.items())
    if "recording" in targets:
        preload_writer()
    with atomic_group():
        yield Outputs(targets, inputs)


def write_drawing(part: Path, svg: str) -> None:
    """Write a drawing with the mark by which one of ours is known."""
    header = "" if svg.startswith(DRAWING_HEADER) else f"{DRAWING_HEADER}{__version__} -->\n"
    part.write_text(header + svg, encoding="utf-8", newline="\n")


def output_kind(output: Path | None, log: OutputKind) -> OutputKind | None:
    """Return the kind of an output by its suffix: a log of the kind given, or a recording; None without one.

    Raises:
        OptionError: If the suffix is another.
    """
    if output is None:
        return None
    kind = {".csv": log, ".rrd": "recording"}.get(output.suffix.lower())
    if kind is None:
        allowed = f"a name that ends in .csv (a {OUTPUT_RULES[log].noun}) or .rrd (a recording)"
        raise OptionError(Finding(parameter="output", found=format_value(str(output)), allowed=allowed))
    return kind


def _refuse_shared(targets: Mapping[OutputKind, Path]) -> None:
    """Raise an `OptionError` if two outputs have one name."""
    places: dict[Path, OutputKind] = {}
    for kind, path in targets.items():
        other = places.setdefault(path.resolve(), kind)
        if other != kind:
            raise OptionError(f"found {path} as {other} and as {kind}; allowed: a name for each")
