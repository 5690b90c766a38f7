"""The kinds of results: the name of each in a recording, its class, its presenter and its exports.

A new kind is a folder with its result and its presenter, and a line in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeGuard

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.accuracy import exports as accuracy_exports
from urmpipe_pipeline.accuracy import presenter as accuracy
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.comparison import exports as comparison_exports
from urmpipe_pipeline.comparison import presenter as comparison
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.networks import network_motion
from urmpipe_pipeline.networks import presenter as networks
from urmpipe_pipeline.networks.network_motion import NetworkMotion
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.planned_paths import presenter as planned_paths
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.presentation.exports import Exports
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.recording.reader import read_result
from urmpipe_pipeline.recording.writer import write_result
from urmpipe_pipeline.runs import exports as run_exports
from urmpipe_pipeline.runs import presenter as runs
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations import exports as simulation_exports
from urmpipe_pipeline.simulations import presenter as simulations
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.solved_targets import presenter as solved_targets
from urmpipe_pipeline.solved_targets.result import IkResult


class Kind(NamedTuple):
    """A kind of result.

    Attributes:
        name: Its name in a recording.
        cls: Its dataclass.
        present: Returns the presentation of a result.
        exports: Returns the tables of a result; None if the kind has none.
    """

    name: str
    cls: type[Result]
    present: Callable[[Any], Presentation]
    exports: Callable[[Any], Exports] | None = None

    @property
    def with_article(self) -> str:
        """Its name in a sentence: a run, an accuracy."""
        return f"{'an' if self.name[0] in 'aeiou' else 'a'} {self.name}"


KINDS: tuple[Kind, ...] = (
    Kind("run", Run, runs.present, run_exports.exports),
    Kind("comparison", Comparison, comparison.present, comparison_exports.exports),
    Kind("diagnosis", Diagnosis, comparison.present_diagnosis),
    Kind("simulation", Simulation, simulations.present, simulation_exports.exports),
    Kind("solved targets", IkResult, solved_targets.present, solved_targets.exports),
    Kind("plan", PlannedPath, planned_paths.present, planned_paths.exports),
    Kind("accuracy", AccuracyResult, accuracy.present, accuracy_exports.exports),
    Kind("network", NetworkResult, networks.present),
    Kind("network motion", NetworkMotion, network_motion.present, network_motion.exports),
)


def is_result(value: Any) -> TypeGuard[Result]:
    """Return whether a value is a result of any kind."""
    return any(kind.cls is type(value) for kind in KINDS)


def result_kind(result: Result) -> Kind:
    """Return the kind of a result."""
    return next(kind for kind in KINDS if kind.cls is type(result))


def enclosing_result(result: Result) -> Result:
    """Return the result that is recorded and reported: of a diagnosis its comparison, if it has one."""
    return (result.comparison if isinstance(result, Diagnosis) else None) or result


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
    result: Result = read_result(path, {kind.name: kind.cls for kind in KINDS}, lazy=lazy)
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
    kind = result_kind(result)
    if kind.exports is None:
        raise OptionError(f"{kind.with_article} has no tables")
    return kind.exports(result)
