"""What of an arm's shape can be changed while it is simulated: parameters, and the chain that they make.

The kinematics of an arm as a unit: where its points are, and how they move.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, Values, Variable
from urmpipe_fmus.blocks.coordinates import (
    check_choices,
    check_flag,
    check_robot,
    coordinate_kinds,
    format_joints,
    read_coordinates,
    robot_recipe,
)
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.chain import Parameter as ArmParameter
from urmpipe_models.arm.geometric_models import SEGMENT_SOURCE, TILT_SOURCE
from urmpipe_models.errors import UnitError
from urmpipe_models.kinematics.forward import Motion, forward, iter_point_motions
from urmpipe_models.math3d import Transform, euler_zyx, from_rpy, matrix_to_rpy
from urmpipe_models.robots.toml import chain_from_dict


class Geometry(NamedTuple):
    """The shape of an arm.

    Attributes:
        parameters: Tunable; they start at the shape that the robot's description tells.
        chain_at: Returns the arm of some values of the parameters.
    """

    parameters: tuple[Parameter, ...]
    chain_at: Callable[[Values], Chain]


def chain_to_geometry(robot: Chain) -> Geometry:
    """Return the parameters of an arm: its lengths and tilts if they describe it, else its joints' frames.

    Where it stands (`base`) and its `tool` are parameters of both.
    """
    links = [one for one in robot.parameters if one.place not in ("base", "tool")]
    of_urm = {one.source for one in links} == {SEGMENT_SOURCE, TILT_SOURCE}
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
    lengths, tilts = (
        [one for one in links if one.source == source] for source in (SEGMENT_SOURCE, TILT_SOURCE)
    )

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
            start=matrix_to_rpy(frame.rotation),
            size=3,
        ),
    )


def _frame_at(v: Values, name: str) -> Transform:
    """Return the frame of the two parameters of a name."""
    return Transform(from_rpy(*getattr(v, f"{name}_rpy")).rotation, getattr(v, name))


KINEMATIC_CHAIN_OPTIONS: Mapping[str, str] = {
    "robot": "a robot: a name of the catalogue, a .toml or a .urdf file",
    "points": 'the points whose place is an output, such as ["p6", "p7"] (default: all)',
    "sensors": "the points whose angles, and motion with rates, are outputs (default: the tool centre)",
    "rates": "true: the joints' rates are inputs, the sensors' velocity and acceleration outputs",
}


def kinematic_chain(
    robot: Chain,
    *,
    points: Sequence[str] | None = None,
    sensors: Sequence[str] | None = None,
    rates: bool = False,
) -> BlockModel:
    """Return the unit that computes points of an arm from its joints.

    Inputs are the angles `phi` of the joints that turn and the ways `s` of those that slide, each from the
    base outwards; with rates also `phid`, `phidd`, `sd`, `sdd`. They start at the calibration pose. They have
    no limits: what lies beyond a joint's range has its place all the same, and a repolarized angle counts on.

    Args:
        robot: The arm.
        points: Which of p1..pn are outputs, by name; all by default.
        sensors: Points whose angles rz, ry, rx are outputs too; the tool centre point by default.
        rates: Whether the joints' rates are inputs; then velocity v and acceleration a of the sensors are
            outputs.

    Raises:
        UnitError: With what is wrong with the options.

    Source: [UrmArm2021]_ eq. 1-14; v and a by the outward recursion (see `iter_point_motions`).
    """
    check_robot("kinematic_chain", robot)
    names = robot.point_names
    chosen = check_choices("kinematic_chain", "points", names if points is None else points, names)
    sensed = check_choices("kinematic_chain", "sensors", names[-1:] if sensors is None else sensors, names)
    check_flag("kinematic_chain", "rates", rates)
    if not (chosen or sensed):
        raise UnitError("unit kinematic_chain: options points, sensors: found none, allowed: one of either")
    geometry = chain_to_geometry(robot)

    def outputs(v: Values) -> Mapping[str, Any]:
        """Return the points, and what the sensors see."""
        arm = geometry.chain_at(v)
        poses, motions = _moved(arm, v, rates)
        places = dict(zip(names, poses, strict=True))
        found = {name: places[name].translation for name in chosen}
        for name in sensed:
            found |= _sensed(name[1:], places[name], motions[names.index(name)] if rates else None)
        return found

    return BlockModel(
        name="kinematic_chain",
        description=f"Points of {robot.name or 'an arm'} from its joints",
        variables=(
            *geometry.parameters,
            *_inputs(robot, rates),
            *(_output(name, f"Place of point {name}: x, y, z", "m", 3) for name in chosen),
            *(variable for name in sensed for variable in _sensor_outputs(name, rates)),
        ),
        outputs=outputs,
        equations=_equations(rates),
        source="UrmArm2021, eq. 1-14, with atan2 in eq. 10 and 13",
        recipe=robot_recipe(__name__, robot, points=list(chosen), sensors=list(sensed), rates=rates),
    )


def from_robot_toml(robot: str, **options: Any) -> BlockModel:
    """Return `kinematic_chain` of the arm that a text of `robot_toml` describes, bit by bit."""
    return kinematic_chain(chain_from_dict(tomllib.loads(robot)), **options)


def _moved(arm: Chain, v: Values, rates: bool) -> tuple[Sequence[Transform], Sequence[Motion]]:
    """Return the poses of p1..pn, and their motions if the rates are known."""
    q = read_coordinates(arm, v)
    if not rates:
        return forward(arm, q), ()
    motions = tuple(iter_point_motions(arm, q, read_coordinates(arm, v, "d"), read_coordinates(arm, v, "dd")))
    return [motion.pose for motion in motions], motions


def _sensed(number: str, pose: Transform, motion: Motion | None) -> dict[str, Any]:
    """Return the outputs of a sensor: angles, where they are a convention, and motion."""
    rz, ry, rx, singular = euler_zyx(pose.rotation)
    found = {"rz": rz, "ry": ry, "rx": rx, "singular": singular}
    if motion is not None:
        found |= {"v": motion.velocity, "a": motion.acceleration}
    return {f"{name}{number}": value for name, value in found.items()}


def _inputs(robot: Chain, rates: bool) -> Iterator[Input]:
    """Yield the joints' angles and ways, and their rates."""
    for kind in coordinate_kinds(robot):
        at = kind.indices(robot)
        of = format_joints(robot, at)
        yield Input(
            name=kind.name,
            description=f"{kind.word}s {of}",
            unit=kind.unit,
            display_unit=kind.display_unit,
            start=tuple(float(robot.start[k]) for k in at),
            size=len(at),
        )
        for dots, rate in (("d", "/s"), ("dd", "/s2")) if rates else ():
            yield Input(
                name=f"{kind.name}{dots}",
                description=f"{'Velocities' if dots == 'd' else 'Accelerations'} {of}",
                unit=f"{kind.unit}{rate}",
                display_unit=f"{kind.display_unit}{rate}",
                size=len(at),
            )


def _sensor_outputs(name: str, rates: bool) -> Iterator[Variable]:
    """Yield the outputs of the sensor on a point."""
    number = name[1:]
    for angle, axis in (("rz", "z"), ("ry", "the turned y"), ("rx", "the turned x")):
        yield _output(f"{angle}{number}", f"Angle of {name} about {axis}", "rad", None)
    yield Output(
        name=f"singular{number}",
        description=f"Whether ry{number} is +-90 deg, where rx{number} is 0 by convention",
        type="Boolean",
    )
    if rates:
        yield _output(f"v{number}", f"Velocity of {name}", "m/s", 3)
        yield _output(f"a{number}", f"Acceleration of {name}", "m/s2", 3)


def _output(name: str, description: str, unit: str, size: int | None) -> Output:
    return Output(
        name=name,
        description=description,
        unit=unit,
        display_unit="deg" if unit == "rad" else "",
        size=size,
    )


def _equations(rates: bool) -> tuple[str, ...]:
    return (
        "p_k = the origin of the frame after joint k: the product of the joints' frames and motions;",
        "of a URM arm p_(i+1) = Rz(phi_1) [r_1 + sum_k prod_j (Ry(theta_(j+1)) Rz(phi_(j+1))) r_(k+1)]"
        " (eq. 1-8)",
        "R = Rz(rz) Ry(ry) Rx(rx) (eq. 9, 14)",
        "rz = atan2(a21, a11), ry = atan2(-a31, hypot(a11, a21)), rx = atan2(a32, a33) (eq. 10-13)",
        "at ry = +-90 deg: rx = 0, rz = atan2(-a12, a22), and singular is true",
        *(
            (
                "v = v_before + omega x d, a = a_before + alpha x d + omega x (omega x d), joint by joint",
                "omega grows by z phid, alpha by z phidd + omega x z phid; a sliding joint adds z sd to v,",
                "z sdd + 2 omega x z sd to a",
            )
            if rates
            else ()
        ),
    )
