"""What the functions of a unit are given: the values of its variables, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from urmpipe_fmus.table import Rows
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import UnitError


class NoSuchValueError(UnitError, AttributeError):
    """A unit's function reads a variable that the unit has not; also what `hasattr` and `copy` expect."""


class Values:
    """The values at an instant: `v.u` is an element, `v.phi` of a variable with a size a tuple of elements.

    Attributes:
        time: The instant in [s].
        table: The rows of the unit's table about the instant; None if the unit has none.
    """

    time: Element
    table: Any

    def __init__(
        self, time: Element, named: Mapping[str, Element | tuple[Element, ...]], table: Rows | None = None
    ) -> None:
        self.__dict__.update(named, time=time, table=table)

    def __getattr__(self, name: str) -> Any:
        allowed = ", ".join(sorted(self.__dict__))
        raise NoSuchValueError(f"v.{name}: found in a unit's function, allowed: {allowed}")
