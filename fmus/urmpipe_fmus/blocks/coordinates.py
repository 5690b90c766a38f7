"""Options of the blocks, and the coordinates of a robot as variables.

Options come from a file or a command line, so the functions `check_...` raise `UnitError` for a value that
does not fit. The coordinates are two arrays, as their units differ: `phi` of the revolute joints and `s` of
the prismatic ones, each from the base outwards. `read_coordinates` and `scatter` convert between these arrays
and joint order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from urmpipe_fmus.block import Input, Output, Recipe, State, Values
from urmpipe_models.arm.chain import Chain, JointKind
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import UnitError, format_value
from urmpipe_models.robots.toml import robot_toml

MAX_COUNT = 1000  # as the links of a robot; each adds variables, equations and C


def option_error(block: str, option: str, value: Any, allowed: str) -> UnitError:
    """Return the error of a value that an option cannot have."""
    return UnitError(f"unit {block}: option {option}: found {format_value(value)}, allowed: {allowed}")


def check_robot(block: str, value: Any) -> None:
    """Raise `UnitError` if the option `robot` is not a robot."""
    if not isinstance(value, Chain):
        raise option_error(block, "robot", value, "a robot (Chain)")


def check_count(block: str, option: str, value: Any) -> int:
    """Return an option that is a count; `UnitError` if it is no integer from 1 to `MAX_COUNT`."""
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MAX_COUNT:
        is_above = isinstance(value, int) and value > MAX_COUNT
        allowed = f"{MAX_COUNT} at most" if is_above else "an integer, 1 or more"
        raise option_error(block, option, value, allowed)
    return value


def check_flag(block: str, option: str, value: Any) -> bool:
    """Return an option that is true or false; `UnitError` if it is neither."""
    if not isinstance(value, bool):
        raise option_error(block, option, value, "true or false")
    return value


def check_choices(block: str, option: str, value: Any, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names that an option selects, in the order of the allowed ones.

    Raises:
        UnitError: If it is neither a name nor a list, or with every unknown name.
    """
    names = ", ".join(allowed)
    if isinstance(value, str):
        value = [value]
    if not isinstance(value, (list, tuple)):
        raise option_error(block, option, value, f"a list of {names}")
    errors = [option_error(block, option, name, names) for name in value if name not in allowed]
    if errors:
        raise UnitError(*(finding for error in errors for finding in error.findings))
    return tuple(name for name in allowed if name in value)


Moving = TypeVar("Moving", Input, State)


@dataclass(frozen=True, slots=True)
class CoordinateKind:
    """Names and units of the coordinates of a kind of joint.

    Attributes:
        kind: The kind of joint.
        name: Name of the variable; with d its velocity, with dd its acceleration.
        word: The name of one coordinate in descriptions.
        unit: Unit of a value.
        display_unit: The unit that tools display.
        effort: Name of the variable of the torques or forces.
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
    """Return the kinds of coordinates that a robot has."""
    return [kind for kind in KINDS if kind.indices(robot)]


def gather(robot: Chain, v: Values, names: Mapping[CoordinateKind, str]) -> list[Element]:
    """Return the elements of one variable per kind, in joint order.

    Args:
        robot: The robot.
        v: The values of its block model.
        names: The variable of each kind.
    """
    elements: dict[int, Element] = {}
    for kind in coordinate_kinds(robot):
        elements |= zip(kind.indices(robot), getattr(v, names[kind]), strict=True)
    return [elements[k] for k in range(len(robot.coordinates))]


def read_coordinates(robot: Chain, v: Values, suffix: str = "") -> list[Element]:
    """Return the coordinates in joint order; with suffix "d" their velocities, "dd" their accelerations."""
    return gather(robot, v, {kind: kind.name + suffix for kind in KINDS})


def scatter(robot: Chain, elements: Sequence[Element], suffix: str = "") -> dict[str, tuple[Element, ...]]:
    """Return elements in joint order by the variables of their kinds: inverse of `read_coordinates`."""
    kinds = coordinate_kinds(robot)
    return {kind.name + suffix: tuple(elements[k] for k in kind.indices(robot)) for kind in kinds}


def format_joints(robot: Chain, indices: Iterable[int]) -> str:
    """Return the end of a description that names the joints of a variable."""
    return f"of the joints {', '.join(robot.coordinates[k] for k in indices)}"


def coordinate_variables(
    robot: Chain, variable: type[Moving], derivatives: int, **fields: Any
) -> Iterator[Moving]:
    """Yield the coordinates and their derivatives as variables; they start at rest at the start pose.

    Args:
        robot: The robot.
        variable: The class of the variables.
        derivatives: 0 for the coordinates, 1 for their velocities too, 2 for their accelerations too.
        fields: Further fields of each variable.
    """
    for kind in coordinate_kinds(robot):
        indices = kind.indices(robot)
        for order, (dots, per) in enumerate((("", ""), ("d", "/s"), ("dd", "/s2"))[: derivatives + 1]):
            word = (f"{kind.word}s", "Velocities", "Accelerations")[order]
            yield variable(
                name=kind.name + dots,
                description=f"{word} {format_joints(robot, indices)}",
                unit=kind.unit + per,
                display_unit=kind.display_unit + per,
                size=len(indices),
                start=tuple(float(robot.start[k]) for k in indices) if order == 0 else 0.0,
                **fields,
            )


def acceleration_outputs(robot: Chain) -> Iterator[Output]:
    """Yield the accelerations of the coordinates as outputs."""
    for kind in coordinate_kinds(robot):
        indices = kind.indices(robot)
        yield Output(
            name=f"{kind.name}dd",
            description=f"Accelerations {format_joints(robot, indices)}",
            unit=f"{kind.unit}/s2",
            size=len(indices),
        )


def robot_recipe(module: str, robot: Chain, **options: Any) -> Recipe:
    """Return the recipe of a block of a robot: the robot as text, without visuals, which may name files."""
    return Recipe(module, "from_robot_toml", {"robot": robot_toml(replace(robot, visuals=())), **options})
