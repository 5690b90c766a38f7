"""The names of the variables of an open form, in text and in C."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from urmpipe_models.lagrange.angles import Angle
from urmpipe_models.lagrange.variables import WRENCH, Variables
from urmpipe_models.messages import one_line


def angle_names(variables: Variables) -> list[str]:
    """Return what stands behind c and s of each angle: 12 of the first two coordinates, else _1, _2, ..."""
    names = []
    for k, angle in enumerate(variables.angles, start=1):
        plain = set(angle) <= {0.0, 1.0}
        names.append("".join(str(i) for i, one in enumerate(angle, start=1) if one) if plain else f"_{k}")
    return names


def coordinate_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the names of the coordinates in text, or q1, q2, ... where a formula would be unclear."""
    taken = {f"{kind}{name}" for kind in "cs" for name in angle_names(variables)}
    taken |= {"cos", "sin", *WRENCH}
    plain = all(name.isidentifier() and name not in taken for name in coordinates)
    return list(coordinates) if plain else [f"q{k}" for k in range(1, len(coordinates) + 1)]


def text_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the name of each variable in text.

    Args:
        variables: The variables.
        coordinates: The names of the coordinates in text.
    """
    rates = [f"{name}{mark}" for mark in ("'", "''") for name in coordinates]
    return [*_pose_names(variables, coordinates), *rates, *WRENCH]


def c_symbols(variables: Variables) -> list[Any]:
    """Return the symbol of each variable in C: c12, s12, q[0], qd[0], qdd[0], force[0], ..."""
    from sympy import Symbol

    def elements(name: str, count: int) -> list[str]:
        """Return the elements of an array."""
        return [f"{name}[{k}]" for k in range(count)]

    count = variables.coordinates
    names = _pose_names(variables, elements("q", count))
    names += elements("qd", count) + elements("qdd", count) + elements("force", len(WRENCH))
    return [Symbol(name) for name in names]


def angle_words(angle: Angle, coordinates: Sequence[str]) -> str:
    """Return an angle as a sum, such as theta1 + theta2 or 0.5*theta1 - theta2."""
    words = ""
    for factor, name in zip(angle, coordinates, strict=True):
        if factor:
            size = "" if abs(factor) == 1.0 else f"{abs(factor)!r}*"
            sign = (" - " if factor < 0.0 else " + ") if words else ""
            words += f"{sign}{size}{name}"
    return words


def legend(coordinates: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return a line for each coordinate whose name in the formulas is another one."""
    pairs = zip(names, coordinates, strict=True)
    return [f"{name}: {one_line(own)}" for name, own in pairs if name != own]


def _pose_names(variables: Variables, coordinates: Sequence[str]) -> list[str]:
    """Return the names of the variables that tell the pose."""
    angles = [f"{kind}{name}" for name in angle_names(variables) for kind in "cs"]
    return [*angles, *(coordinates[k] for k in variables.slides)]
