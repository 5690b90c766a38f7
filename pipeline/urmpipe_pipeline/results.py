"""The kinds of results: the name of each in a recording, its class, its presenter and its exports.

A new kind is a folder with its result and its presenter, and a line in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, TypeGuard

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.presentation.exports import Exports
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.recording.reader import read_result
from urmpipe_pipeline.recording.writer import write_result


class Kind(NamedTuple):
    """A kind of result, whose modules are imported when they are used.

    Attributes:
        name: Its name in a recording.
        class_path: Its dataclass, as "module:name".
        presenter: The function that returns the presentation of a result, likewise.
        exporter: The function that returns the tables of a result, likewise; empty if the kind has none.
    """

    name: str
    class_path: str
    presenter: str
    exporter: str = ""

    @property
    def with_article(self) -> str:
        """Its name in a sentence: a run, an accuracy."""
        return f"{'an' if self.name[0] in 'aeiou' else 'a'} {self.name}"

    @property
    def cls(self) -> type[Result]:
        """Its dataclass."""
        cls: type[Result] = _load(self.class_path)
        return cls

    def contains(self, value: object) -> bool:
        """Return whether a value is a result of this kind."""
        return f"{type(value).__module__}:{type(value).__qualname__}" == self.class_path

    def present(self, result: Result) -> Presentation:
        """Return the presentation of a result."""
        presentation: Presentation = _load(self.presenter)(result)
        return presentation

    def export(self, result: Result) -> Exports:
        """Return the tables of a result.

        Raises:
            OptionError: If the kind has none.
        """
        if not self.exporter:
            known = ", ".join(kind.name for kind in KINDS if kind.exporter)
            raise OptionError(f"found {self.with_article}, which has no tables, allowed: {known}")
        tables: Exports = _load(self.exporter)(result)
        return tables


def _load(path: str) -> Any:
    module, _, name = path.partition(":")
    return getattr(import_module(module), name)


# Modules by their names: a command imports only those of its kind, a third of its start.
_ROOT = "urmpipe_pipeline"
KINDS: tuple[Kind, ...] = (
    Kind("run", f"{_ROOT}.runs.run:Run", f"{_ROOT}.runs.presenter:present", f"{_ROOT}.runs.exports:exports"),
    Kind(
        "comparison",
        f"{_ROOT}.comparison.comparison:Comparison",
        f"{_ROOT}.comparison.presenter:present",
        f"{_ROOT}.comparison.tables:exports",
    ),
    Kind(
        "diagnosis",
        f"{_ROOT}.diagnosis.result:Diagnosis",
        f"{_ROOT}.comparison.presenter:present_diagnosis",
    ),
    Kind(
        "simulation",
        f"{_ROOT}.simulations.simulation:Simulation",
        f"{_ROOT}.simulations.presenter:present",
        f"{_ROOT}.simulations.exports:exports",
    ),
    Kind(
        "solved targets",
        f"{_ROOT}.solved_targets.result:IkResult",
        f"{_ROOT}.solved_targets.presenter:present",
        f"{_ROOT}.solved_targets.presenter:exports",
    ),
    Kind(
        "plan",
        f"{_ROOT}.planned_paths.result:PlannedPath",
        f"{_ROOT}.planned_paths.presenter:present",
        f"{_ROOT}.planned_paths.presenter:exports",
    ),
    Kind(
        "accuracy",
        f"{_ROOT}.accuracy.result:AccuracyResult",
        f"{_ROOT}.accuracy.presenter:present",
        f"{_ROOT}.accuracy.exports:exports",
    ),
    Kind("network", f"{_ROOT}.networks.result:NetworkResult", f"{_ROOT}.networks.presenter:present"),
    Kind(
        "network motion",
        f"{_ROOT}.networks.network_motion:NetworkMotion",
        f"{_ROOT}.networks.network_motion:present",
        f"{_ROOT}.networks.network_motion:exports",
    ),
)


def is_result(value: Any) -> TypeGuard[Result]:
    """Return whether a value is a result of any kind."""
    return any(kind.contains(value) for kind in KINDS)


def result_kind(result: Result) -> Kind:
    """Return the kind of a result."""
    return next(kind for kind in KINDS if kind.contains(result))


def enclosing_result(result: Result) -> Result:
    """Return the result that is recorded and reported: of a diagnosis its comparison, if it has one."""
    comparison: Result | None = getattr(result, "comparison", None)  # only a diagnosis has one
    return comparison or result


def write_recording(
    result: Result, path: Path, inputs: Sequence[Path] = (), progress: Callable[[float], None] | None = None
) -> Path:
    """Write the recording of a result, verify it, and return its path.

    Args:
        result: The result.
        path: The file (.rrd); replaced if it is a recording by urmpipe.
        inputs: The files of the result, which are not replaced.
        progress: Called with the share of the data that is written, 0..1.

    Raises:
        OutputError: If the file may not be written there, or differs when it is read back.
    """
    result = enclosing_result(result)
    write_result(result, result_kind(result).name, present(result), path, inputs, progress)
    return path


def read_recording(path: Path, *, lazy: bool = False) -> Result:
    """Return the result in a recording.

    Args:
        path: A recording (.rrd) by urmpipe.
        lazy: Whether arrays are read when they are used; the file must exist until then.

    Raises:
        RecordingError: If it is no recording, is incomplete, not by urmpipe, or of another layout.
    """
    result: Result = read_result(
        path, {kind.name: partial(_load, kind.class_path) for kind in KINDS}, lazy=lazy
    )
    return result


def present(result: Result) -> Presentation:
    """Return the presentation of a result."""
    presentation = result_kind(result).present(result)
    return replace(presentation, recording=result.recording.name) if result.recording else presentation


def exports(result: Result) -> Exports:
    """Return the tables of a result.

    Raises:
        OptionError: If it has none.
    """
    return result_kind(result).export(result)
