"""Checks of the options that a unit is made with: they come from a file or a command line.

The coordinates of an arm as variables: those that turn and those that slide apart, as their units are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from urmpipe_fmus.block import Output, Recipe, State, Values
from urmpipe_models.arm.chain import Chain, JointKind
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import UnitError, format_value
from urmpipe_models.robots.toml import robot_toml

MAX_COUNT = 1000
"""Most of what an option counts: as many as the links of a robot; each adds variables, equations and C."""


def check_robot(unit: str, value: Any) -> None:
    """Check the option of a robot.

    Raises:
        UnitError: If it is none.
    """
    if not isinstance(value, Chain):
        raise UnitError(f"unit {unit}: option robot: found {format_value(value)}, allowed: a robot (Chain)")


def check_count(unit: str, option: str, value: Any) -> int:
    """Return an option that counts something.

    Raises:
        UnitError: If it is no integer from 1 to `MAX_COUNT`.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MAX_COUNT:
        too_many = isinstance(value, int) and value > MAX_COUNT
        allowed = f"{MAX_COUNT} at most" if too_many else "an integer, 1 or more"
        raise UnitError(f"unit {unit}: option {option}: found {format_value(value)}, allowed: {allowed}")
    return value


def check_flag(unit: str, option: str, value: Any) -> bool:
    """Return an option that is true or false.

    Raises:
        UnitError: If it is neither.
    """
    if not isinstance(value, bool):
        raise UnitError(f"unit {unit}: option {option}: found {format_value(value)}, allowed: true or false")
    return value


def check_choices(unit: str, option: str, value: Any, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """Return an option that names one or some of what there is, in the order in which that stands.

    Raises:
        UnitError: If it is neither a name nor a list, or with every name that there is not.
    """
    if isinstance(value, str):
        value = [value]
    if not isinstance(value, (list, tuple)):
        found = f"found {format_value(value)}, allowed: a list of {', '.join(allowed)}"
        raise UnitError(f"unit {unit}: option {option}: {found}")
    wrong = [one for one in value if one not in allowed]
    if wrong:
        raise UnitError(
            *(
                f"unit {unit}: option {option}: found {format_value(one)}, allowed: {', '.join(allowed)}"
                for one in wrong
            )
        )
    return tuple(one for one in allowed if one in value)


@dataclass(frozen=True, slots=True)
class CoordinateKind:
    """How the coordinates of a kind are named and measured.

    Attributes:
        kind: Of the joints.
        name: Of the variable; with d its rate, with dd its second derivative.
        word: One coordinate in words.
        unit: Of a value.
        display_unit: What people like to see.
        effort: Name of the variable that drives them.
        effort_unit: Its unit.
    """

    kind: JointKind
    name: str
    word: str
    unit: str
    display_unit: str
    effort: str
    effort_unit: str

    def indices(self, robot: Chain) -> list[int]:
        """Return the indices of the coordinates of this kind."""
        return [k for k, joint in enumerate(robot.moving) if joint.kind == self.kind]


REVOLUTE = CoordinateKind("revolute", "phi", "Angle", "rad", "deg", "tau", "N.m")
PRISMATIC = CoordinateKind("prismatic", "s", "Way", "m", "mm", "f", "N")
KINDS = (REVOLUTE, PRISMATIC)


def coordinate_kinds(robot: Chain) -> list[CoordinateKind]:
    """Return the kinds that an arm has."""
    return [one for one in KINDS if one.indices(robot)]


def gather(robot: Chain, v: Values, names: Mapping[CoordinateKind, str]) -> list[Element]:
    """Return the elements of the variables of each kind in the arm's order.

    Args:
        robot: The arm.
        v: The values of its unit.
        names: The variable of each kind.
    """
    found: dict[int, Element] = {}
    for one in coordinate_kinds(robot):
        found |= zip(one.indices(robot), getattr(v, names[one]), strict=True)
    return [found[k] for k in range(len(robot.coordinates))]


def read_coordinates(robot: Chain, v: Values, suffix: str = "") -> list[Element]:
    """Return the coordinates in the arm's order; with suffix "d" their rates, "dd" their accelerations."""
    return gather(robot, v, {one: one.name + suffix for one in KINDS})


def scatter(robot: Chain, elements: Sequence[Element], suffix: str = "") -> dict[str, tuple[Element, ...]]:
    """Return elements in joint order by the variables of their kinds: inverse of `read_coordinates`."""
    return {
        one.name + suffix: tuple(elements[k] for k in one.indices(robot)) for one in coordinate_kinds(robot)
    }


def format_joints(robot: Chain, indices: Iterable[int]) -> str:
    """Return which joints a variable is of, from the base outwards."""
    return f"of the joints {', '.join(robot.coordinates[k] for k in indices)}"


def motion_states(robot: Chain) -> Iterator[State]:
    """Yield the coordinates and their rates; they start at the start pose at rest."""
    for kind in coordinate_kinds(robot):
        at = kind.indices(robot)
        yield State(
            name=kind.name,
            description=f"{kind.word}s {format_joints(robot, at)}",
            unit=kind.unit,
            display_unit=kind.display_unit,
            start=tuple(float(robot.start[k]) for k in at),
            size=len(at),
            output=True,
        )
        yield State(
            name=f"{kind.name}d",
            description=f"Velocities {format_joints(robot, at)}",
            unit=f"{kind.unit}/s",
            display_unit=f"{kind.display_unit}/s",
            size=len(at),
            output=True,
        )


def acceleration_outputs(robot: Chain) -> Iterator[Output]:
    """Yield the accelerations of the coordinates."""
    for kind in coordinate_kinds(robot):
        at = kind.indices(robot)
        yield Output(
            name=f"{kind.name}dd",
            description=f"Accelerations {format_joints(robot, at)}",
            unit=f"{kind.unit}/s2",
            size=len(at),
        )


def arm_recipe(module: str, robot: Chain, **options: Any) -> Recipe:
    """Return how to make a unit of an arm again: by the arm as text, without its looks, which name files."""
    return Recipe(module, "from_robot_toml", {"robot": robot_toml(replace(robot, visuals=())), **options})
