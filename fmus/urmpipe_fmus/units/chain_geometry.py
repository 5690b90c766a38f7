"""What of an arm's shape can be changed while it is simulated: parameters, and the chain that they make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Parameter
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.chain import Parameter as ArmParameter
from urmpipe_models.arm.geometric_models import SEGMENT, TILT
from urmpipe_models.math3d import Transform, from_rpy, rpy_of


class Geometry(NamedTuple):
    """The shape of an arm.

    Attributes:
        parameters: Tunable; they start at the shape that the robot's description tells.
        chain_at: Returns the arm of some values of the parameters.
    """

    parameters: tuple[Parameter, ...]
    chain_at: Callable[[Values], Chain]


def geometry_of(robot: Chain) -> Geometry:
    """Return the parameters of an arm: its lengths and tilts if they describe it, else its joints' frames.

    Where it stands (`base`) and its `tool` are parameters of both.
    """
    links = [one for one in robot.parameters if one.place not in ("base", "tool")]
    of_urm = {one.source for one in links} == {SEGMENT, TILT}
    shape = _of_urm(robot, links) if of_urm else _of_frames(robot)
    ends = (
        *_frame_parameters("base", "the base in the world", robot.base),
        *_frame_parameters("tool", "the tool centre point at the end of the arm", robot.tool),
    )

    def chain_at(v: Values) -> Chain:
        """Return the arm on its base and with its tool."""
        return shape.chain_at(v).placed(_frame_at(v, "base"), _frame_at(v, "tool"))

    return Geometry((*shape.parameters, *ends), chain_at)


def _of_urm(robot: Chain, links: Sequence[ArmParameter]) -> Geometry:
    """Return the shape of a URM arm."""
    lengths, tilts = ([one for one in links if one.source == source] for source in (SEGMENT, TILT))

    def chain_at(v: Values) -> Chain:
        """Return the arm of some lengths and tilts."""
        values = zip((*lengths, *tilts), (*v.lengths, *v.tilts), strict=True)
        return robot.with_parameters({one.name: value for one, value in values})

    return Geometry(
        (
            Parameter(
                name="lengths",
                description="Segments r_1..r_(n+1), the last one the effector",
                unit="m",
                display_unit="mm",
                start=tuple(one.value for one in lengths),
                size=len(lengths),
            ),
            Parameter(
                name="tilts",
                description="Tilts theta_2..theta_(n+1) of each segment against the one before",
                unit="rad",
                display_unit="deg",
                start=tuple(one.value for one in tilts),
                size=len(tilts),
            ),
        ),
        chain_at,
    )


def _of_frames(robot: Chain) -> Geometry:
    """Return the shape of any arm: the frame that every joint sits in, and the end; the axes are constant."""
    origins = [f"origin{k}" for k in range(1, len(robot.joints) + 1)]
    parameters = [
        parameter
        for name, joint in zip(origins, robot.joints, strict=True)
        for parameter in _frame_parameters(name, f"joint {joint.name} in the frame before it", joint.origin)
    ]

    def chain_at(v: Values) -> Chain:
        """Return the arm of some frames."""
        joints = [
            replace(joint, origin=_frame_at(v, name))
            for name, joint in zip(origins, robot.joints, strict=True)
        ]
        return replace(robot, joints=tuple(joints), tip=_frame_at(v, "tip"), visuals=())

    tip = _frame_parameters("tip", "the end of the arm in the frame of the last joint", robot.tip)
    return Geometry((*parameters, *tip), chain_at)


def _frame_parameters(name: str, where: str, frame: Transform) -> tuple[Parameter, Parameter]:
    """Return a frame as two parameters: x, y, z, and the angles about the fixed x, y, z."""
    return (
        Parameter(
            name=name,
            description=f"Place of {where}: x, y, z",
            unit="m",
            display_unit="mm",
            start=tuple(map(float, frame.translation)),
            size=3,
        ),
        Parameter(
            name=f"{name}_rpy",
            description=f"Turn of {where}: roll, pitch, yaw (about the fixed x, y, z)",
            unit="rad",
            display_unit="deg",
            start=rpy_of(frame.rotation),
            size=3,
        ),
    )


def _frame_at(v: Values, name: str) -> Transform:
    """Return the frame of the two parameters of a name."""
    return Transform(from_rpy(*getattr(v, f"{name}_rpy")).rotation, getattr(v, name))
