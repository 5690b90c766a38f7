"""What of an arm's masses can be changed while it is simulated, and what acts on its tool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import chain as joined
from typing import Any, NamedTuple

from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Parameter
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import SMALLEST
from urmpipe_models.dynamics.links import Links, Wrench, links_of


class Arm(NamedTuple):
    """An arm of some masses.

    Attributes:
        chain: The arm.
        links: Its moving parts.
    """

    chain: Chain
    links: Links


class Masses(NamedTuple):
    """The masses of an arm.

    Attributes:
        parameters: Tunable; they start at the masses of the robot's description.
        arm_at: Returns the arm of some values of the parameters.
    """

    parameters: tuple[Parameter, ...]
    arm_at: Callable[[Values], Arm]


def masses_of(robot: Chain) -> Masses:
    """Return the masses of an arm that move, their centres, and gravity as parameters.

    Masses that stand still and masses of 0 have no part in the motion and are left out.
    """
    first = next(k for k, joint in enumerate(robot.joints) if joint.kind != "fixed")
    carriers = {joint.name for joint in robot.joints[first:]}
    moving = tuple(one for one in robot.inertials if one.joint in carriers and one.mass)
    arm = replace(robot, inertials=moving, visuals=())
    centres = [f"centre{k}" for k in range(1, len(moving) + 1)]

    last: tuple[list[Any], Arm] | None = None

    def arm_at(v: Values) -> Arm:
        """Return the arm of some masses: the last one as long as they are the same objects."""
        nonlocal last
        given = [v.masses, v.gravity, *(getattr(v, name) for name in centres)]
        elements = [*joined.from_iterable(given)]
        found = last
        if found is None or [*map(id, elements)] != [*map(id, found[0])]:
            inertials = (
                replace(one, mass=mass, centre=centre)
                for one, mass, centre in zip(moving, given[0], given[2:], strict=True)
            )
            chain = replace(arm, inertials=tuple(inertials), gravity=v.gravity)
            found = last = elements, Arm(chain, links_of(chain))
        return found[1]

    masses = Parameter(
        name="masses",
        description="Masses on the joints " + ", ".join(str(one.joint) for one in moving),
        unit="kg",
        start=tuple(float(one.mass) for one in moving),
        minimum=SMALLEST,
        size=len(moving),
    )
    places = (
        Parameter(
            name=name,
            description=f"Centre of mass {k} in the frame of joint {one.joint}: x, y, z",
            unit="m",
            display_unit="mm",
            start=tuple(map(float, one.centre)),
            size=3,
        )
        for k, (name, one) in enumerate(zip(centres, moving, strict=True), start=1)
    )
    gravity = Parameter(
        name="gravity",
        description="Acceleration of gravity in the world: x, y, z",
        unit="m/s2",
        start=tuple(map(float, robot.gravity)),
        size=3,
    )
    return Masses((masses, *places, gravity), arm_at)


def tool_inputs() -> tuple[Input, Input]:
    """Return what acts on the tool centre point as inputs."""
    return (
        Input(
            name="force",
            description="Force on the tool centre point, along the axes of the world",
            unit="N",
            size=3,
        ),
        Input(
            name="moment",
            description="Moment on the tool centre point, along the axes of the world",
            unit="N.m",
            size=3,
        ),
    )


def wrench_at(v: Values) -> Wrench:
    """Return what acts on the tool centre point."""
    return Wrench(v.force, v.moment)
