"""Files that a public function writes beside its result: guarded, all or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from urmpipe.keyword_checks import PathLike
from urmpipe_models.errors import Finding, OptionError, shown
from urmpipe_pipeline.outputs import NOUNS, OutputKind, guarded_output, refuse_output
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.recording import import_ahead
from urmpipe_pipeline.results import write_recording

Made = TypeVar("Made", bound=Result)


@contextmanager
def guarded_outputs(
    named: Mapping[OutputKind, PathLike | None], inputs: Sequence[Path]
) -> Iterator[dict[OutputKind, Path]]:
    """Give the parts to write of all outputs but the recording, which `recorded` writes: all or none of them.

    Args:
        named: The files that are asked for, by kind; None for one that is not.
        inputs: Files that are never replaced.

    Raises:
        OptionError: If two outputs have one name.
        OutputError: If one may not be written there.
    """
    targets = {kind: Path(path) for kind, path in named.items() if path is not None}
    _refuse_shared(targets)
    if "recording" in targets:
        refuse_output(targets["recording"], inputs, "recording")
        import_ahead()
    with ExitStack() as stack:
        yield {
            kind: stack.enter_context(guarded_output(path, inputs, kind))
            for kind, path in targets.items()
            if kind != "recording"
        }


def recorded(
    result: Made,
    output: PathLike | None,
    inputs: Sequence[Path],
    progress: Callable[[float], None] | None,
) -> Made:
    """Return a result with the recording that was written of it; as it is without an output.

    Args:
        result: What to record.
        output: The recording (.rrd) to write; None for none.
        inputs: Files that are never replaced.
        progress: Told the share of the recording that is written, 0..1.

    Raises:
        OutputError: If it may not be written there, or did not read back as it was written.
    """
    if output is None:
        return result
    written = write_recording(result, Path(output), inputs, progress)
    return replace(result, recording=written)  # type: ignore[type-var]


def output_kind(output: Path | None, log: OutputKind) -> OutputKind | None:
    """Return the kind of an output by its suffix: a log of the kind given, or a recording; None without one.

    Raises:
        OptionError: If the suffix is another.
    """
    if output is None:
        return None
    kind = {".csv": log, ".rrd": "recording"}.get(output.suffix.lower())
    if kind is None:
        allowed = f"a name that ends in .csv (a {NOUNS.get(log, log)}) or .rrd (a recording)"
        raise OptionError(Finding(parameter="output", found=shown(str(output)), allowed=allowed))
    return kind


def _refuse_shared(targets: Mapping[OutputKind, Path]) -> None:
    """Raise an `OptionError` if two outputs have one name."""
    places: dict[Path, OutputKind] = {}
    for kind, path in targets.items():
        other = places.setdefault(path.resolve(), kind)
        if other != kind:
            raise OptionError(f"found {path} as {other} and as {kind}; allowed: a name for each")
