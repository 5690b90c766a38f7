"""What a deviation may come from: causes of some size, and causes that are there or not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.identification import Twist
from urmpipe_pipeline.diagnosis.result import Kind
from urmpipe_pipeline.runs.reading_errors import Edits

Axis: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Group:
    """A cause of some size: one number, or three of base and tool.

    Attributes:
        kind: What it is.
        name: What it is of.
        unit: Of its numbers.
        columns: Their places among all numbers.
        joint: Index of its joint; None of another cause.
        segment: The point that ends its segment; None of another cause.
        axis: Along or about which it acts in the frame of segment, base or tool; None of another cause, and
            of three numbers.
        twists: What it changes in the arm, one a number; none of joints and time.
    """

    kind: Kind
    name: str
    unit: str
    columns: tuple[int, ...]
    joint: int | None = None
    segment: str | None = None
    axis: Axis | None = None
    twists: tuple[Twist, ...] = ()

    def is_of_frame(self, other: Group) -> bool:
        """Tell whether both are the same, or axes of the same frame."""
        return (self.kind, self.name) == (other.kind, other.name)


@dataclass(frozen=True)
class State:
    """An explanation: what is changed, and by how much.

    Attributes:
        values: All numbers of all groups, in the unit of each ([m], [rad], [s]); 0 if not taken, shape (p,).
        edits: The causes that are there.
    """

    values: FloatArray
    edits: Edits = ()

    def of(self, group: Group) -> FloatArray:
        """Return the numbers of a group, in its unit ([m], [rad], [s]), shape (k,)."""
        return self.values[list(group.columns)]


def zero(groups: Iterable[Group]) -> State:
    """Return the explanation that nothing differs."""
    return State(np.zeros(sum(len(group.columns) for group in groups)))


def numbered(groups: Iterable[Group]) -> tuple[Group, ...]:
    """Return groups with places for their numbers, one behind the other."""
    result: list[Group] = []
    place = 0
    for group in groups:
        count = len(group.columns)
        result.append(replace(group, columns=tuple(range(place, place + count))))
        place += count
    return tuple(result)
