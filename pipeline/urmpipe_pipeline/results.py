"""The kinds of results: what each is called in a recording, its class, and how it presents itself.

A new kind is a folder with its result and its presenter, and its line here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.comparison import exports as comparison_exports
from urmpipe_pipeline.comparison import presenter as comparison
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.presentation.exports import Exports
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.runs import exports as run_exports
from urmpipe_pipeline.runs import presenter as runs
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations import exports as simulation_exports
from urmpipe_pipeline.simulations import presenter as simulations
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.solved_targets import presenter as solved_targets
from urmpipe_pipeline.solved_targets.result import SolvedTargets


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of result.

    Attributes:
        name: What a recording calls it.
        cls: Its dataclass.
        present: Returns what a result of it shows.
        exports: Returns what can leave of a result of it; None where nothing can.
    """

    name: str
    cls: type
    present: Callable[[Any], Presentation]
    exports: Callable[[Any], Exports] | None = None


KINDS: tuple[Kind, ...] = (
    Kind("run", Run, runs.present, run_exports.exports),
    Kind("comparison", Comparison, comparison.present, comparison_exports.exports),
    Kind("simulation", Simulation, simulations.present, simulation_exports.exports),
    Kind("solved targets", SolvedTargets, solved_targets.present, solved_targets.exports),
)
"""Every kind."""


def is_result(value: Any) -> bool:
    """Tell whether a value is a result of any kind."""
    return any(kind.cls is type(value) for kind in KINDS)


def kind_of(result: Any) -> Kind:
    """Return the kind of a result."""
    return next(kind for kind in KINDS if kind.cls is type(result))


def present(result: Any) -> Presentation:
    """Return what a result shows."""
    return kind_of(result).present(result)


def exports(result: Any) -> Exports:
    """Return what can leave of a result.

    Raises:
        OptionError: If nothing can.
    """
    kind = kind_of(result)
    if kind.exports is None:
        raise OptionError(f"a {kind.name} has no tables")
    return kind.exports(result)
