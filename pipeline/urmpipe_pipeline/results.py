"""The kinds of results: what each is called in a recording, its class, and how it presents itself.

A new kind is a folder with its result and its presenter, and its line here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Simulation


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of result.

    Attributes:
        name: What a recording calls it.
        cls: Its dataclass.
        present: Returns what a result of it shows; None of a kind that is only stored.
    """

    name: str
    cls: type
    present: Callable[[Any], Presentation] | None = None


KINDS: tuple[Kind, ...] = (Kind("run", Run), Kind("comparison", Comparison), Kind("simulation", Simulation))
"""Every kind."""


def kind_of(result: Any) -> Kind:
    """Return the kind of a result."""
    return next(kind for kind in KINDS if kind.cls is type(result))


def present(result: Any) -> Presentation:
    """Return what a result shows."""
    kind = kind_of(result)
    if kind.present is None:
        raise TypeError(f"found a {kind.name}, allowed: a kind with a presenter")
    return kind.present(result)
