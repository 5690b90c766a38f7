"""The kinds of results: what each is called in a recording, its class, and how it presents itself.

A new kind is a folder with its result and its presenter, and its line here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from urmpipe_pipeline.presentation.section import Presentation


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of result.

    Attributes:
        name: What a recording calls it.
        cls: Its dataclass.
        present: Returns what a result of it shows.
    """

    name: str
    cls: type
    present: Callable[[Any], Presentation]


KINDS: tuple[Kind, ...] = ()
"""Every kind."""


def kind_of(result: Any) -> Kind:
    """Return the kind of a result."""
    return next(kind for kind in KINDS if kind.cls is type(result))


def present(result: Any) -> Presentation:
    """Return what a result shows."""
    return kind_of(result).present(result)
